//! Environments side by side with markers among them, as one scene.

use super::snapshot::{EnvStage, Shown, Snapshot};
use kinetoscope_scene::{Instance, Marker, PoseF32, RenderScene};
use std::sync::Arc;

/// The geom group of markers: MuJoCo's are 0 to 5.
pub(super) const MARKERS: u8 = 31;

/// What is drawn, and whose it is.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    /// Its instances have their number in `parts` and one as mask id; markers have [`Marker::MASK_ID`].
    pub(super) scene: Option<RenderScene>,
    pub(super) poses: Vec<PoseF32>,
    /// Environment and instance in it of each instance, without the markers, which come last.
    pub(super) parts: Vec<(usize, usize)>,
    /// Whether each of these is the ground, which stays where it is.
    is_ground: Vec<bool>,
    instances: Vec<Instance>,
    /// What the instances were made of: made anew only where this changes.
    key: Option<Key>,
}

#[derive(Debug)]
struct Key {
    shown: Shown,
    scenes: Vec<Arc<RenderScene>>,
}

impl Key {
    fn fits(&self, shown: Shown, scenes: &[Arc<RenderScene>]) -> bool {
        self.shown == shown
            && self.scenes.len() == scenes.len()
            && self.scenes.iter().zip(scenes).all(|(a, b)| Arc::ptr_eq(a, b))
    }
}

/// The environments that are shown, with their numbers.
pub(super) fn chosen(snapshot: &Snapshot, shown: Shown) -> impl Iterator<Item = (usize, &EnvStage)> {
    snapshot.envs.iter().enumerate().filter(move |(env, _)| shown.has(*env))
}

impl Assembly {
    /// Puts the environments of a snapshot side by side; the ground is there once. `markers` are in their environments.
    pub(super) fn set(&mut self, snapshot: &Snapshot, shown: Shown, markers: &[(usize, Marker)]) {
        let scenes: Vec<Arc<RenderScene>> =
            chosen(snapshot, shown).filter_map(|(_, env)| snapshot.scene_of(env)).collect();
        let mut outdated = !markers.is_empty() || self.instances.len() != self.poses.len();
        if !self.key.as_ref().is_some_and(|key| key.fits(shown, &scenes)) {
            self.collect(snapshot, shown);
            self.key = Some(Key { shown, scenes: scenes.clone() });
            outdated = true;
        }
        self.place(snapshot);
        if !(outdated || self.scene.is_none()) {
            return;
        }
        let mut instances = self.instances.clone();
        for (env, marker) in markers {
            let Some(origin) = snapshot.envs.get(*env).map(|env| env.origin) else { continue };
            for (instance, pose) in marker.instances() {
                instances.push(Instance { group: MARKERS, ..instance });
                self.poses.push(moved(&pose, origin));
            }
        }
        let lit = scenes.first().cloned().unwrap_or_else(|| Arc::new(RenderScene::empty()));
        // Every instance was drawable where it came from; there may be too many triangles together.
        self.scene = lit.with_instances(instances).ok();
    }

    fn collect(&mut self, snapshot: &Snapshot, shown: Shown) {
        self.parts.clear();
        self.is_ground.clear();
        self.instances.clear();
        for (index, (k, env)) in chosen(snapshot, shown).enumerate() {
            let Some(scene) = snapshot.scene_of(env) else { continue };
            for (i, instance) in scene.instances().iter().enumerate() {
                let is_ground = Some(instance.mask_id) == snapshot.names.ground;
                if index > 0 && is_ground {
                    continue;
                }
                self.parts.push((k, i));
                self.is_ground.push(is_ground);
                self.instances.push(Instance { mask_id: self.parts.len() as i32, ..instance.clone() });
            }
        }
    }

    /// Moves the instances to where they are now.
    fn place(&mut self, snapshot: &Snapshot) {
        let Self { poses, parts, is_ground, .. } = self;
        poses.clear();
        poses.extend(parts.iter().zip(is_ground).map(|(&(env, i), is_ground)| {
            let env = &snapshot.envs[env];
            let pose = env.look.instances.get(i).copied().unwrap_or_default();
            if *is_ground { pose } else { moved(&pose, env.origin) }
        }));
    }
}

fn moved(pose: &PoseF32, origin: [f64; 3]) -> PoseF32 {
    let t = pose.translation;
    PoseF32 { translation: [0, 1, 2].map(|k| t[k] + origin[k] as f32), ..*pose }
}
