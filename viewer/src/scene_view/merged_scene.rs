//! Merges the environments and markers into one render scene.

use super::snapshot::{EnvSelection, Snapshot, SnapshotEnv};
use kinetoscope_scene::{Instance, Marker, PoseF32, RenderScene};
use std::sync::Arc;

/// Geom group of markers. MuJoCo uses the groups 0 to 5.
pub(super) const MARKER_GROUP: u8 = 31;

/// The merged render scene, and for each instance its environment and its index in that environment's scene.
#[derive(Debug, Default)]
pub(super) struct MergedScene {
    /// Render scene; `None` if it would have too many triangles. The mask id of an instance is its index in
    /// `instance_sources` plus one; markers have [`Marker::MASK_ID`].
    pub(super) scene: Option<RenderScene>,
    /// Poses of all instances, markers included, in the frame of the overview.
    pub(super) poses: Vec<PoseF32>,
    /// Environment and instance index of each instance; markers come last and have no entry.
    pub(super) instance_sources: Vec<(usize, usize)>,
    /// True for each instance of `instance_sources` that is the ground. The ground is not moved to the origin of its
    /// environment.
    is_ground: Vec<bool>,
    instances: Vec<Instance>,
    /// Sources of `instances`, which are rebuilt only when this key changes.
    key: Option<SceneKey>,
}

#[derive(Debug)]
struct SceneKey {
    shown: EnvSelection,
    scenes: Vec<Arc<RenderScene>>,
}

impl SceneKey {
    fn matches(&self, shown: EnvSelection, scenes: &[Arc<RenderScene>]) -> bool {
        self.shown == shown
            && self.scenes.len() == scenes.len()
            && self.scenes.iter().zip(scenes).all(|(a, b)| Arc::ptr_eq(a, b))
    }
}

/// Returns the shown environments with their indices.
pub(super) fn shown_envs(snapshot: &Snapshot, shown: EnvSelection) -> impl Iterator<Item = (usize, &SnapshotEnv)> {
    snapshot.envs.iter().enumerate().filter(move |(env, _)| shown.contains(*env))
}

impl MergedScene {
    /// Updates the merged scene from a snapshot. The ground is included once. Each marker is paired with the index of
    /// its environment, and its pose is in the frame of that environment.
    pub(super) fn update(&mut self, snapshot: &Snapshot, shown: EnvSelection, markers: &[(usize, Marker)]) {
        let scenes: Vec<Arc<RenderScene>> =
            shown_envs(snapshot, shown).filter_map(|(_, env)| snapshot.env_scene(env)).collect();
        let mut outdated = !markers.is_empty() || self.instances.len() != self.poses.len();
        if !self.key.as_ref().is_some_and(|key| key.matches(shown, &scenes)) {
            self.rebuild_instances(snapshot, shown);
            self.key = Some(SceneKey { shown, scenes: scenes.clone() });
            outdated = true;
        }
        self.update_poses(snapshot);
        if !(outdated || self.scene.is_none()) {
            return;
        }
        let mut instances = self.instances.clone();
        for (env, marker) in markers {
            let Some(origin) = snapshot.envs.get(*env).map(|env| env.origin) else { continue };
            for (instance, pose) in marker.instances() {
                instances.push(Instance { group: MARKER_GROUP, ..instance });
                self.poses.push(translated(&pose, origin));
            }
        }
        let base_scene = scenes.first().cloned().unwrap_or_else(|| Arc::new(RenderScene::empty()));
        // Each instance was renderable in its own scene, but the triangle count of all instances may exceed the limit.
        self.scene = base_scene.with_instances(instances).ok();
    }

    fn rebuild_instances(&mut self, snapshot: &Snapshot, shown: EnvSelection) {
        self.instance_sources.clear();
        self.is_ground.clear();
        self.instances.clear();
        for (index, (k, env)) in shown_envs(snapshot, shown).enumerate() {
            let Some(scene) = snapshot.env_scene(env) else { continue };
            for (i, instance) in scene.instances().iter().enumerate() {
                let is_ground = Some(instance.mask_id) == snapshot.names.ground;
                if index > 0 && is_ground {
                    continue;
                }
                self.instance_sources.push((k, i));
                self.is_ground.push(is_ground);
                self.instances.push(Instance { mask_id: self.instance_sources.len() as i32, ..instance.clone() });
            }
        }
    }

    /// Updates the poses of the instances.
    fn update_poses(&mut self, snapshot: &Snapshot) {
        let Self { poses, instance_sources, is_ground, .. } = self;
        poses.clear();
        poses.extend(instance_sources.iter().zip(is_ground).map(|(&(env, i), is_ground)| {
            let env = &snapshot.envs[env];
            let pose = env.snapshot.instances.get(i).copied().unwrap_or_default();
            if *is_ground { pose } else { translated(&pose, env.origin) }
        }));
    }
}

fn translated(pose: &PoseF32, origin: [f64; 3]) -> PoseF32 {
    let t = pose.translation;
    PoseF32 { translation: [0, 1, 2].map(|k| t[k] + origin[k] as f32), ..*pose }
}
