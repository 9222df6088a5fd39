//! Elements whose shape changes from frame to frame: spatial tendons, skins, flexes.
//!
//! Each element is one or several instances of the scene. A tendon has a fixed number of capsules, of which as many are
//! visible as its path has segments. A skin or a flex is a mesh whose vertices move. Every environment has a copy of
//! the scene with the current shapes, which is reused ([`buffers`]) as soon as no camera holds it.

mod buffers;
mod catenary;
mod flex;
mod skin;
mod tendon;
#[cfg(test)]
mod tests;

pub(super) use buffers::SceneBufferPool;

use super::color::color;
use super::identity::DeformingElement;
use super::visibility::is_visible;
use kinetoscope_look::ModelMaterials;
use kinetoscope_mujoco::{Data, Model};
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::shape::{Capsule, Mesh};
use kinetoscope_scene::vector::{norm, sub};
use kinetoscope_scene::{Instance, Material, PoseF32, RenderScene, RenderSceneError};
use std::sync::Arc;

/// Instances of a model whose shapes change.
#[derive(Clone, Debug, Default)]
pub(super) struct DeformingInstances {
    paths: Vec<CapsulePath>,
    meshes: Vec<DeformingMesh>,
}

/// Capsules along a path that changes.
#[derive(Clone, Debug)]
struct CapsulePath {
    first: usize,
    capsules: usize,
    line: PathSource,
}

/// Path that capsules follow.
#[derive(Clone, Debug)]
enum PathSource {
    Tendon(tendon::Tendon),
    Cable(flex::Cable),
}

/// Mesh whose vertices move.
#[derive(Clone, Debug)]
struct DeformingMesh {
    instance: usize,
    surface: MeshSource,
}

/// Element that moves the vertices of a mesh.
#[derive(Clone, Debug)]
enum MeshSource {
    Skin(usize),
    Flex(Arc<flex::Cloth>),
}

/// Straight segment of a path.
struct Segment {
    ends: [[f64; 3]; 2],
    /// Radius \[m\].
    radius: f64,
}

/// Working memory for the vertices of one mesh.
#[derive(Debug, Default)]
struct Scratch {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Positions and normals of a flex's own vertices.
    of_flex: [Vec<[f32; 3]>; 2],
}

impl PathSource {
    fn segments(&self, data: &Data, each: &mut dyn FnMut(Segment)) {
        match self {
            Self::Tendon(tendon) => tendon.segments(data, each),
            Self::Cable(cable) => cable.segments(data, each),
        }
    }
}

impl MeshSource {
    fn vertices(&self, data: &Data, scratch: &mut Scratch) {
        match self {
            Self::Skin(skin) => skin::vertices(data, *skin, scratch),
            Self::Flex(cloth) => cloth.vertices(data, scratch),
        }
    }
}

/// Finds the visible elements of a model whose shape changes.
pub(super) fn visible_elements(model: &Model) -> Vec<DeformingElement> {
    let tendons = (0..model.ntendon()).filter(|&t| {
        let rgba = &model.tendon_rgba()[4 * t..4 * t + 4];
        tendon::is_spatial(model, t)
            && model.tendon_width()[t] > 0.0
            && is_visible(model.tendon_group()[t], &color(model, rgba, model.tendon_matid()[t]))
    });
    let skins = (0..model.nskin()).filter(|&s| {
        let skin = model.skin(s);
        !skin.faces.is_empty() && is_visible(skin.group, &color(model, skin.rgba, skin.material))
    });
    let flexes = (0..model.nflex()).filter(|&f| {
        let flex = model.flex(f);
        flex.is_some_and(|flex| {
            let drawn = flex.dimensions != 1 || flex.radius > 0.0;
            drawn && is_visible(flex.group, &color(model, flex.rgba, flex.material))
        })
    });
    tendons
        .map(DeformingElement::Tendon)
        .chain(skins.map(DeformingElement::Skin))
        .chain(flexes.map(DeformingElement::Flex))
        .collect()
}

impl DeformingInstances {
    pub(super) fn is_empty(&self) -> bool {
        self.paths.is_empty() && self.meshes.is_empty()
    }

    /// Adds the instances of an element to those of a scene. `like` has all fields except the shape, the material and
    /// the group.
    ///
    /// # Errors
    /// A size or the material is invalid for rendering; then nothing is added.
    pub(super) fn add(
        &mut self,
        model: &Model,
        surfaces: &ModelMaterials,
        drawable: DeformingElement,
        like: &Instance,
        instances: &mut Vec<Instance>,
    ) -> Result<(), RenderSceneError> {
        let instance = |shape: kinetoscope_scene::shape::Shape, material: Material, group: i32| Instance {
            shape,
            material,
            // A negative group counts as the first one, as in MuJoCo's viewers.
            group: u8::try_from(group.clamp(0, 31)).unwrap_or(0),
            is_deformable: true,
            ..like.clone()
        };
        let mut path = |line: PathSource, capsules: usize, width: f64, material: Material, group: i32| {
            let first = instances.len();
            let unused = Capsule { radius: width as f32, half_length: width as f32 };
            let hidden = Instance { visible: false, ..instance(unused.into(), material, group) };
            hidden.validate()?;
            instances.extend(std::iter::repeat_n(hidden, capsules));
            self.paths.push(CapsulePath { first, capsules, line });
            Ok(())
        };
        match drawable {
            DeformingElement::Tendon(t) => {
                let tendon = tendon::Tendon::of(model, t);
                let material = surfaces.of_element(&model.tendon_rgba()[4 * t..4 * t + 4], model.tendon_matid()[t]);
                let capsules = tendon.max_segments();
                path(PathSource::Tendon(tendon), capsules, model.tendon_width()[t], material, model.tendon_group()[t])
            }
            DeformingElement::Skin(s) => {
                let skin = model.skin(s);
                let mesh = Arc::new(RenderMesh::deformable(&skin::bind_pose(&skin)));
                let material = surfaces.of_element(skin.rgba, skin.material);
                let skinned = instance(Mesh { mesh }.into(), material, skin.group);
                skinned.validate()?;
                self.meshes.push(DeformingMesh { instance: instances.len(), surface: MeshSource::Skin(s) });
                instances.push(skinned);
                Ok(())
            }
            DeformingElement::Flex(f) => {
                let Some(flex) = model.flex(f) else { return Ok(()) };
                let material = surfaces.of_element(flex.rgba, flex.material);
                if flex.dimensions == 1 {
                    let cable = flex::Cable::of(f);
                    return path(PathSource::Cable(cable), flex.edges.len(), flex.radius, material, flex.group);
                }
                let (cloth, mesh) = flex::Cloth::of(&flex);
                let mesh = Arc::new(RenderMesh::deformable(&mesh));
                let draped = instance(Mesh { mesh }.into(), material, flex.group);
                draped.validate()?;
                self.meshes
                    .push(DeformingMesh { instance: instances.len(), surface: MeshSource::Flex(Arc::new(cloth)) });
                instances.push(draped);
                Ok(())
            }
        }
    }

    /// Moves the capsules of paths to their poses in `data`. Meshes are in the world frame.
    pub(super) fn update_poses(&self, data: &Data, poses: &mut [PoseF32]) {
        for path in &self.paths {
            let poses = &mut poses[path.first..path.first + path.capsules];
            let mut used = 0;
            path.line.segments(data, &mut |segment| {
                if let Some(pose) = poses.get_mut(used) {
                    *pose = segment.pose();
                }
                used += 1;
            });
            // Unused capsules stay at the end of the path, so that a capsule that reappears moves from there.
            if let Some(last) = used.checked_sub(1).and_then(|last| poses.get(last)).copied() {
                poses[used.min(path.capsules)..].fill(last);
            }
        }
    }

    /// Sets the shapes of a scene to those of `data`.
    fn update_shapes(&self, data: &Data, scene: &mut RenderScene, scratch: &mut Scratch) {
        for path in &self.paths {
            let mut used = 0;
            path.line.segments(data, &mut |segment| {
                if used < path.capsules {
                    scene.set_shape(path.first + used, segment.capsule().into(), true);
                }
                used += 1;
            });
            for unused in used..path.capsules {
                let index = path.first + unused;
                let shape = scene.instances()[index].shape.clone();
                scene.set_shape(index, shape, false);
            }
        }
        for DeformingMesh { instance, surface } in &self.meshes {
            surface.vertices(data, scratch);
            let Scratch { positions, normals, .. } = scratch;
            // A diverged environment keeps its last shape; the poses of its bodies show that it cannot be rendered.
            if positions.iter().flatten().all(|x| x.is_finite()) {
                scene.deform(*instance, |mesh| mesh.deform(positions, normals));
            }
        }
    }
}

impl Segment {
    /// Pose of the capsule in the world: its axis is rotated from z by the smallest angle.
    fn pose(&self) -> PoseF32 {
        let [from, to] = self.ends;
        let along = sub(to, from);
        let length = norm(along);
        let [x, y, z] = if length > 0.0 { along.map(|a| a / length) } else { [0.0, 0.0, 1.0] };
        let rotation = if z > -1.0 + 1e-12 {
            let s = 1.0 / (1.0 + z);
            [[1.0 - x * x * s, -x * y * s, x], [-x * y * s, 1.0 - y * y * s, y], [-x, -y, z]]
        } else if z.is_nan() {
            [[f64::NAN; 3]; 3]
        } else {
            [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
        };
        let middle = [0, 1, 2].map(|k| 0.5 * (from[k] + to[k]));
        PoseF32 { rotation: rotation.map(|row| row.map(|x| x as f32)), translation: middle.map(|x| x as f32) }
    }

    /// Capsule in its own frame. A segment without length gives a sphere, or nearly one.
    fn capsule(&self) -> Capsule {
        let [from, to] = self.ends;
        let length = (0..3).map(|k| (to[k] - from[k]).powi(2)).sum::<f64>().sqrt();
        let radius = self.radius as f32;
        let half = (0.5 * length) as f32;
        let shortest = 1e-6 * radius;
        // The pose reports a position that is not finite.
        Capsule { radius, half_length: if half.is_finite() { half.max(shortest) } else { shortest } }
    }
}
