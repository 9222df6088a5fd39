//! Appearance of environments for viewers: shapes attached to the recorded frames.

use crate::error::Result;
use crate::stream::{StreamKind, StreamSchema};
use kinetoscope_render::RasterCfg;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::{Instance, Pose, RenderScene, Texture};
use kinetoscope_sim::{EnvId, EnvVisualState, SimulationManager};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Largest uncompressed size of all scene messages of a file, or of those that a live stream sends at a time \[bytes\].
const MAX_BYTES: u64 = 64 << 20;
/// Number of segments of tessellated round shapes.
const SEGMENTS: usize = 32;
/// Approximate size of an entity in a message, besides its shape \[bytes\].
const ENTITY_OVERHEAD: u64 = 256;

/// The appearance of an environment from a time on.
#[derive(Debug)]
pub(crate) struct SceneUpdate {
    pub(crate) env: usize,
    /// Recorded time \[s\].
    pub(crate) at: f64,
    pub(crate) entities: Vec<Entity>,
    /// Appearance of the entities, by instance.
    pub(crate) visuals: InstanceVisuals,
}

/// Appearance of each instance of a scene; `None` if it is not drawn.
pub(crate) type InstanceVisuals = Arc<Vec<Option<InstanceVisual>>>;

/// An instance attached to a frame.
#[derive(Clone, Debug)]
pub(crate) struct Entity {
    /// Index of the instance in the scene.
    pub(crate) instance: usize,
    /// Name of the entity.
    pub(crate) name: Arc<str>,
    /// Value of the mask channel of cameras.
    pub(crate) mask_id: i32,
    /// Its frame, without the environment prefix; `None` for the frame of the environment.
    pub(crate) frame: Option<String>,
    /// Pose in that frame.
    pub(crate) pose: Pose,
}

/// Appearance of an instance.
#[derive(Debug)]
pub(crate) struct InstanceVisual {
    pub(crate) shape: VisualShape,
    /// Color in 0..=1, multiplied by the mean color of its texture, if any.
    pub(crate) rgba: [f64; 4],
}

/// Surface in the instance's own frame.
#[derive(Debug)]
pub(crate) enum VisualShape {
    /// Box by its side lengths \[m\].
    Box([f64; 3]),
    /// Sphere or ellipsoid by its diameters \[m\].
    Ellipsoid([f64; 3]),
    /// Cylinder by its two diameters and its length along z \[m\].
    Cylinder([f64; 3]),
    /// Shared mesh, with a color of each vertex if it is textured.
    Mesh(Arc<RenderMesh>, Vec<[f64; 4]>),
    /// Other shapes, tessellated.
    Triangles(TriMesh),
}

impl VisualShape {
    /// Vertices and triangles; empty for primitives.
    pub(crate) fn triangles(&self) -> (&[[f32; 3]], &[[u32; 3]]) {
        match self {
            Self::Mesh(mesh, _) => (mesh.positions(), mesh.triangles()),
            Self::Triangles(mesh) => (&mesh.positions, &mesh.triangles),
            Self::Box(_) | Self::Ellipsoid(_) | Self::Cylinder(_) => (&[], &[]),
        }
    }

    /// Approximate size in a message \[bytes\].
    fn bytes(&self) -> u64 {
        let (vertices, triangles) = self.triangles();
        let colors = if let Self::Mesh(_, colors) = self { colors.len() } else { 0 };
        (24 * vertices.len() + 12 * triangles.len() + 32 * colors) as u64
    }
}

impl InstanceVisual {
    fn of(instance: &Instance) -> Self {
        let rgba = instance.material.rgba.map(f64::from);
        let texture = instance.material.texture.as_deref();
        let mean = texture.map_or([1.0; 3], mean_color);
        let form = match &instance.shape {
            Shape::Box(shape) => VisualShape::Box(shape.half.map(|half| 2.0 * f64::from(half))),
            Shape::Sphere(shape) => VisualShape::Ellipsoid([2.0 * f64::from(shape.radius); 3]),
            Shape::Ellipsoid(shape) => VisualShape::Ellipsoid(shape.radii.map(|radius| 2.0 * f64::from(radius))),
            Shape::Cylinder(shape) => {
                let [across, along] = [shape.radius, shape.half_length].map(|half| 2.0 * f64::from(half));
                VisualShape::Cylinder([across, across, along])
            }
            Shape::Mesh(shape) => {
                let of_vertices = texture.zip(shape.mesh.uvs());
                let colors = of_vertices.map_or_else(Vec::new, |(texture, uvs)| {
                    let color = |uv: &[f32; 2]| {
                        let [r, g, b] = color_at(texture, *uv);
                        [r * rgba[0], g * rgba[1], b * rgba[2], rgba[3]]
                    };
                    uvs.iter().map(color).collect()
                });
                VisualShape::Mesh(Arc::clone(&shape.mesh), colors)
            }
            other => VisualShape::Triangles(other.tessellate(SEGMENTS)),
        };
        Self { shape: form, rgba: [rgba[0] * mean[0], rgba[1] * mean[1], rgba[2] * mean[2], rgba[3]] }
    }
}

/// Mean color of a texture, computed from its smallest mipmap level.
fn mean_color(texture: &Texture) -> [f64; 3] {
    let Some(last) = texture.mip_levels().last() else { return [1.0; 3] };
    // Rows have one pixel more than the width.
    let row = 4 * (last.width() as usize + 1);
    let pixels = last.bytes().chunks_exact(row).take(last.height() as usize);
    let pixels: Vec<&[u8]> = pixels.flat_map(|row| row[..row.len() - 4].chunks_exact(4)).collect();
    let count = pixels.len().max(1) as f64;
    [0, 1, 2].map(|k| pixels.iter().map(|pixel| f64::from(pixel[k])).sum::<f64>() / (255.0 * count))
}

/// Color of a texture at texture coordinates, with the origin at the lower left and repetition. The edges 0 and 1 have
/// the colors of the first and the last column, and of the bottom and the top row.
fn color_at(texture: &Texture, [u, v]: [f32; 2]) -> [f64; 3] {
    let Some(level) = texture.mip_levels().first() else { return [1.0; 3] };
    let place = |x: f32, count: u32| {
        let part = if (0.0..=1.0).contains(&x) { f64::from(x) } else { f64::from(x).rem_euclid(1.0) };
        // The conversion of NaN gives 0.
        ((part * f64::from(count)) as usize).min(count as usize - 1)
    };
    let (column, row) = (place(u, level.width()), place(1.0 - v, level.height()));
    let at = 4 * (row * (level.width() as usize + 1) + column);
    [0, 1, 2].map(|k| level.bytes().get(at + k).map_or(1.0, |byte| f64::from(*byte) / 255.0))
}

/// Tracks the scenes that were written for viewers.
#[derive(Debug)]
pub(crate) struct SceneTracker {
    /// Frames with recorded poses, without the environment prefix.
    frames: BTreeSet<String>,
    /// Last scene of each recorded environment, written or left out because of the size limit.
    last_scenes: BTreeMap<usize, Option<Arc<RenderScene>>>,
    /// Remaining size for messages \[bytes\].
    bytes_left: u64,
    /// Moving entities without a recorded pose.
    without_pose: BTreeSet<String>,
    /// Entities with deforming shapes.
    deforming: BTreeSet<String>,
    /// Environments that were skipped because of the size limit.
    omitted: BTreeSet<usize>,
    /// True for a live stream, which does not keep its messages.
    is_live: bool,
}

impl SceneTracker {
    pub(crate) fn new(streams: &[StreamSchema], is_live: bool) -> Self {
        let of = |stream: &StreamSchema| match &stream.kind {
            StreamKind::Poses { frames } => frames.clone(),
            _ => Vec::new(),
        };
        let frames = streams.iter().flat_map(of).collect();
        let last_scenes = streams.iter().flat_map(|stream| stream.env_ids.iter().map(|env| (*env, None))).collect();
        Self {
            frames,
            last_scenes,
            bytes_left: MAX_BYTES,
            without_pose: BTreeSet::new(),
            deforming: BTreeSet::new(),
            omitted: BTreeSet::new(),
            is_live,
        }
    }

    /// Returns updates for those of `envs` that are recorded and whose appearance has changed since their last message.
    /// Those that exceed the limit for all messages are left out and listed.
    ///
    /// # Errors
    /// There is no such environment.
    pub(crate) fn updates(
        &mut self,
        sim: &mut SimulationManager,
        envs: BTreeSet<usize>,
        at: f64,
    ) -> Result<Vec<SceneUpdate>> {
        let mut updates = Vec::new();
        if self.is_live {
            self.bytes_left = MAX_BYTES;
        }
        // Most environments share one scene.
        let mut known: Vec<(Arc<RenderScene>, InstanceVisuals)> = Vec::new();
        let groups = RasterCfg::default().groups;
        for env in envs {
            let Some(told) = self.last_scenes.get_mut(&env) else { continue };
            let scene = sim.scene_mut().env_scene(EnvId(env))?;
            if told.as_ref().is_some_and(|told| Arc::ptr_eq(told, &scene)) {
                continue;
            }
            *told = Some(Arc::clone(&scene));
            let visuals = match known.iter().find(|(other, _)| Arc::ptr_eq(other, &scene)) {
                Some((_, drawn)) => Arc::clone(drawn),
                None => {
                    let is_drawn =
                        |one: &&Instance| one.visible && !one.is_deformable && groups >> one.group.min(31) & 1 == 1;
                    let of = |one: &Instance| Some(one).filter(is_drawn).map(InstanceVisual::of);
                    let drawn: InstanceVisuals = Arc::new(scene.instances().iter().map(of).collect());
                    known.push((Arc::clone(&scene), Arc::clone(&drawn)));
                    drawn
                }
            };
            let entities = self.entities(sim, env, &scene, &visuals)?;
            let of = |entity: &Entity| {
                visuals[entity.instance].as_ref().map_or(0, |drawn| ENTITY_OVERHEAD + drawn.shape.bytes())
            };
            let bytes: u64 = entities.iter().map(of).sum();
            if bytes > self.bytes_left {
                self.omitted.insert(env);
                continue;
            }
            self.bytes_left -= bytes;
            updates.push(SceneUpdate { env, at, entities, visuals });
        }
        Ok(updates)
    }

    /// Drawn instances of an environment, attached to their frames. Moving ones without a recorded pose are left out
    /// and listed.
    fn entities(
        &mut self,
        sim: &mut SimulationManager,
        env: usize,
        scene: &RenderScene,
        drawn: &[Option<InstanceVisual>],
    ) -> Result<Vec<Entity>> {
        let (mut look, bodies) = (EnvVisualState::default(), sim.entities().body_names());
        sim.scene_mut().read_visual_state(EnvId(env), &mut look)?;
        let mut entities = Vec::new();
        let deforming = scene.instances().iter().filter(|instance| instance.is_deformable);
        self.deforming.extend(deforming.map(|instance| instance.name.to_string()));
        for (index, instance) in scene.instances().iter().enumerate().filter(|(index, _)| drawn[*index].is_some()) {
            let body = instance.body.and_then(|body| bodies.get(body as usize));
            let frame = body.filter(|body| self.frames.contains(*body)).cloned();
            let here = instance.body.and_then(|body| look.bodies.get(body as usize));
            let pose = match (&frame, here, look.instances.get(index)) {
                (Some(_), ..) => instance.frame_from_instance,
                (None, Some(here), _) if instance.fixed => here * instance.frame_from_instance,
                (None, None, Some(pose)) => Pose::from(pose),
                _ => {
                    let of = body.map_or(&*instance.name, |body| body.split('/').next().unwrap_or(body));
                    self.without_pose.insert(of.into());
                    continue;
                }
            };
            let (name, mask_id) = (Arc::clone(&instance.name), instance.mask_id);
            entities.push(Entity { instance: index, name, mask_id, frame, pose });
        }
        Ok(entities)
    }

    /// Describes what the scene messages lack, and the reasons.
    pub(crate) fn left_out(&self) -> Vec<String> {
        let list = |names: Vec<String>| names.join(", ");
        let lost = (!self.without_pose.is_empty()).then(|| {
            let names = list(self.without_pose.iter().cloned().collect());
            format!("of the scene for viewers: {names} (poses that are not recorded)")
        });
        let deforming = (!self.deforming.is_empty()).then(|| {
            let names = list(self.deforming.iter().cloned().collect());
            format!("of the scene for viewers: {names} (shapes that change from frame to frame)")
        });
        let omitted = (!self.omitted.is_empty()).then(|| {
            let envs = list(self.omitted.iter().map(usize::to_string).collect());
            format!("the appearance of environments {envs}, for viewers (more than {} MiB in all)", MAX_BYTES >> 20)
        });
        lost.into_iter().chain(deforming).chain(omitted).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use kinetoscope_scene::TextureKind;

    /// Root cause: 1 - v was wrapped to 0..1, so that the lower edge of a texture, v = 0, had the color of its top row.
    /// The right edge, u = 1, likewise had the color of the first column.
    #[test]
    fn texture_edges() {
        // From the top left: red, green; blue, white.
        let pixels = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
        let texture = Texture::new(TextureKind::TwoD, 2, 2, 3, pixels.as_flattened()).unwrap();
        let [red, green, blue, white] = pixels.map(|pixel| pixel.map(|byte: u8| f64::from(byte) / 255.0));
        for (u, v, expected) in [
            (0.25, 0.75, red),
            (0.75, 0.75, green),
            (0.25, 0.25, blue),
            (0.75, 0.25, white),
            // The edges, and a point so close to the lower edge that 1 - v is rounded to 1.
            (0.0, 1.0, red),
            (1.0, 1.0, green),
            (0.0, 0.0, blue),
            (1.0, 0.0, white),
            (0.25, 1e-9, blue),
            // Repetitions.
            (1.25, -0.25, red),
            (-0.25, 1.25, white),
            (f32::NAN, f32::INFINITY, red),
        ] {
            assert_eq!(color_at(&texture, [u, v]), expected, "{u} {v}");
        }
    }
}
