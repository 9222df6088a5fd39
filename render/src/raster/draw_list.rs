//! Draw list of a frame: visible items, their order, and their bounds in the image.

use super::lod;
use super::tile::BLOCK;
use crate::lens::rays::LensRays;
use crate::visibility::Projection;
use crate::visibility::projection::LocalCamera;
use kinetoscope_scene::shape::Cluster;
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::vector::{dot, norm, sub};
use kinetoscope_scene::{Instance, LightingSpace, Marker, PoseF32, RenderScene};

/// A primitive or a cluster that may be visible.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DrawItem {
    pub(crate) instance: u32,
    /// `None` for shapes with a closed form.
    pub(crate) cluster: Option<u32>,
    /// Blocks that the item may touch: x0, y0, x1, y1, the last included.
    pub(crate) rect: [u16; 4],
    /// Upper bound of the item's nearness.
    pub(crate) nearness: f32,
    /// Sort key, largest first: the nearness, but infinite planes come last.
    order: f32,
}

/// An instance in the camera's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedInstance {
    pub(crate) camera_from_instance: PoseF32,
    pub(crate) local: LocalCamera,
    /// True if the camera is outside of the instance's bounds, by enough that the near plane cuts nothing off. Always
    /// true in a parallel projection.
    pub(crate) outside: bool,
    /// True if backs are invisible, see [`OpenGlRules::culls_backs`].
    pub(crate) culls_backs: bool,
    /// Level of the mesh that is rendered: ids count that level's triangles.
    pub(crate) level: u8,
    /// Largest distance of that level from the mesh \[m\].
    pub(crate) error: f32,
}

impl PlacedInstance {
    /// The triangles of the instance at the selected level; `None` for a shape without triangles.
    #[inline(always)]
    pub(crate) fn mesh<'a>(&self, instance: &'a Instance) -> Option<&'a RenderMesh> {
        let mesh = instance.mesh()?;
        Some(if self.level == 0 { mesh } else { mesh.level(usize::from(self.level)) })
    }
}

/// Visibility class of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Not rendered.
    Hidden,
    /// Visible in all channels.
    Opaque,
    /// Blended into the color, and opaque in the other channels.
    Blended,
}

impl Layer {
    /// Layer of an instance, when the geom groups of `groups` are rendered (bit k is group k; instance groups above 31
    /// count as 31).
    pub fn for_instance(instance: &Instance, groups: u32) -> Self {
        let alpha = instance.material.rgba[3];
        if !instance.visible || alpha <= 0.0 || groups >> instance.group.min(31) & 1 == 0 {
            Self::Hidden
        } else if alpha >= 1.0 {
            Self::Opaque
        } else {
            Self::Blended
        }
    }

    /// True if an instance casts shadows into shadow maps: it is rendered, it is not a marker, and its alpha is at
    /// least 0.5, or `space` is [`LightingSpace::Display`]: MuJoCo's renderer casts shadows whatever the alpha. Markers
    /// show measurements and are not part of the scene.
    pub(crate) fn casts_shadows(instance: &Instance, groups: u32, space: LightingSpace) -> bool {
        Self::for_instance(instance, groups) != Self::Hidden
            && (instance.material.rgba[3] >= 0.5 || space == LightingSpace::Display)
            && instance.group != Marker::GROUP
    }
}

/// Granularity of a draw list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Granularity {
    /// Meshes by cluster, at their level of detail.
    LodClusters,
    /// Meshes by cluster, at full detail.
    FullClusters,
    /// Each instance as one item.
    Instances,
}

/// The visible items of a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct DrawList {
    pub(crate) placed: Vec<PlacedInstance>,
    /// Opaque items, the nearest first.
    pub(crate) opaque: Vec<DrawItem>,
    /// Transparent items, the farthest instance first.
    pub(crate) blended: Vec<(Layer, DrawItem)>,
    /// The largest [`PlacedInstance::error`].
    pub(crate) error: f32,
}

impl DrawList {
    pub(crate) fn bytes(&self) -> usize {
        self.placed.capacity() * size_of::<PlacedInstance>()
            + self.opaque.capacity() * size_of::<DrawItem>()
            + self.blended.capacity() * size_of::<(Layer, DrawItem)>()
    }

    /// Empties the list and reserves memory for all instances that may be kept: visibility changes from frame to frame,
    /// and memory must not grow with it.
    pub(crate) fn reserve(&mut self, scene: &RenderScene, parts: Granularity, keep: impl Fn(&Instance) -> Layer) {
        self.placed.clear();
        self.opaque.clear();
        self.blended.clear();
        let (mut opaque, mut blended) = (0, 0);
        for instance in scene.instances() {
            let mesh = instance.mesh().filter(|_| parts != Granularity::Instances);
            let items = mesh.map_or(1, |mesh| mesh.clusters().len());
            match keep(instance) {
                Layer::Hidden => {}
                Layer::Opaque => opaque += items,
                _ => blended += items,
            }
        }
        self.placed.reserve_exact(scene.instances().len());
        self.opaque.reserve_exact(opaque);
        self.blended.reserve_exact(blended);
    }

    /// Finds and sorts the items that may be visible. `keep` returns the layer of an instance. With a lens, items are
    /// culled by depth only, and their bounds are the whole image.
    pub(crate) fn build(
        &mut self,
        projection: &Projection,
        lens: Option<&LensRays>,
        scene: &RenderScene,
        poses: &[PoseF32],
        parts: Granularity,
        keep: impl Fn(&Instance) -> Layer,
    ) {
        self.error = 0.0;
        let largest_shift = lod::largest_shift(scene, projection);
        // Backs cast shadows.
        let culls = projection.is_camera && scene.opengl.is_some_and(|rules| rules.culls_backs);
        self.reserve(scene, parts, &keep);
        for (index, (instance, pose)) in scene.instances().iter().zip(poses).enumerate() {
            let [lo, hi] = instance.shape.aabb();
            let local = projection.local(pose);
            let t = local.instance_from_camera.translation;
            let camera_from_instance = projection.world_from_camera.inverse_times(pose);
            let outside = if projection.parallel {
                // Lights without a near plane have all casters in front.
                !projection.is_camera && projection.near == 0.0
                    || is_in_front(projection, &camera_from_instance, lo, hi)
            } else {
                let margin = 2.0 * projection.near;
                (0..3).any(|k| t[k] < lo[k] - margin || t[k] > hi[k] + margin)
            };
            let culls_backs = culls && instance.group != Marker::GROUP;
            let placed = PlacedInstance { camera_from_instance, local, outside, culls_backs, level: 0, error: 0.0 };
            self.placed.push(placed);
            let layer = keep(instance);
            if layer == Layer::Hidden
                || matches!(instance.shape, Shape::Plane(_)) && is_seen_from_below(projection, &local)
            {
                continue;
            }
            let center = [0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k]));
            let half = [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k]));
            let seen = match lens {
                None => bounds(projection, &placed.camera_from_instance, center, half),
                Some(lens) => lens_bounds(projection, lens, placed.camera_from_instance.apply(center), half),
            };
            let Some((rect, nearness)) = seen else { continue };
            let order = if half.iter().all(|h| h.is_finite()) { nearness } else { f32::MIN };
            let whole = DrawItem { instance: index as u32, cluster: None, rect, nearness, order };
            let mut push = |item| match layer {
                Layer::Opaque => self.opaque.push(item),
                _ => self.blended.push((layer, item)),
            };
            let Some(mesh) = instance.mesh().filter(|_| parts != Granularity::Instances) else {
                push(whole);
                continue;
            };
            let level = if parts == Granularity::LodClusters {
                lod::select_level(projection, instance, &placed.camera_from_instance, largest_shift)
            } else {
                0
            };
            let error = mesh.level_error(usize::from(level));
            self.placed[index] = PlacedInstance { level, error, ..placed };
            self.error = self.error.max(error);
            for (k, cluster) in mesh.level(usize::from(level)).clusters().iter().enumerate() {
                let is_culled = culls_backs || outside && cluster.closed;
                if is_culled && faces_away(projection, &placed, cluster) {
                    continue;
                }
                let c = placed.camera_from_instance.apply(cluster.center);
                if let Some((rect, nearness)) = ball_bounds(projection, c, cluster.radius) {
                    push(DrawItem { cluster: Some(k as u32), rect, nearness, order: nearness, ..whole });
                }
            }
        }
        // By nearness, then by order in the scene: the same order in every run.
        self.opaque.sort_unstable_by(|a, b| {
            b.order.total_cmp(&a.order).then((a.instance, a.cluster).cmp(&(b.instance, b.cluster)))
        });
        let depth = |i: u32| {
            let t = self.placed[i as usize].camera_from_instance.translation;
            if lens.is_none_or(LensRays::is_forward) { t[2] } else { t.iter().map(|x| x * x).sum::<f32>().sqrt() }
        };
        self.blended.sort_unstable_by(|(_, a), (_, b)| {
            let order = depth(b.instance).total_cmp(&depth(a.instance));
            order.then((a.instance, a.cluster).cmp(&(b.instance, b.cluster)))
        });
    }
}

/// True if the camera sees the back of a plane, which is invisible.
fn is_seen_from_below(projection: &Projection, camera: &LocalCamera) -> bool {
    let pose = &camera.instance_from_camera;
    if projection.parallel { pose.rotation[2][2] >= 0.0 } else { pose.translation[2] <= 0.0 }
}

/// True if a whole box is deeper than twice the near limit.
fn is_in_front(projection: &Projection, camera_from_instance: &PoseF32, lo: [f32; 3], hi: [f32; 3]) -> bool {
    let forward = camera_from_instance.rotation[2];
    let nearest = |k: usize| (forward[k] * lo[k]).min(forward[k] * hi[k]);
    camera_from_instance.translation[2] + nearest(0) + nearest(1) + nearest(2) > 2.0 * projection.near
}

/// True if all triangles of a cluster are certainly back-facing.
fn faces_away(projection: &Projection, placed: &PlacedInstance, cluster: &Cluster) -> bool {
    if cluster.cone_cos <= 0.0 {
        return false;
    }
    let camera = &placed.local.instance_from_camera;
    let sine = (1.0 - cluster.cone_cos * cluster.cone_cos).max(0.0).sqrt();
    if projection.parallel {
        return dot(camera.rotate([0., 0., 1.]), cluster.cone_axis) > sine + 1e-4;
    }
    let t = camera.translation;
    let to = sub(cluster.center, t);
    dot(to, cluster.cone_axis) > sine * norm(to) + 1.01 * cluster.radius
}

/// Returns the blocks that a box may touch, as [`DrawItem::rect`], and an upper bound of its nearness; `None` if the
/// box is outside of the image or the depth range. `middle` and `half` (center and half lengths) are in the frame of
/// the instance. An infinite box, and in perspective a box that crosses the near plane, get all blocks and `f32::MAX`.
fn bounds(
    projection: &Projection,
    camera_from_instance: &PoseF32,
    middle: [f32; 3],
    half: [f32; 3],
) -> Option<([u16; 4], f32)> {
    let everywhere = full_rect(projection);
    if !half.iter().all(|h| h.is_finite()) {
        return Some((everywhere, f32::MAX));
    }
    let c = camera_from_instance.apply(middle);
    let r = camera_from_instance.rotation;
    let reach =
        [0, 1, 2].map(|i| 1.0001 * (r[i][0].abs() * half[0] + r[i][1].abs() * half[1] + r[i][2].abs() * half[2]));
    if projection.parallel {
        return box_bounds(projection, c, reach);
    }
    // Corner by corner if all are in front, which is tighter than the box around the box.
    let (near, far) = (c[2] - reach[2], c[2] + reach[2]);
    if far < projection.near || near > projection.far {
        return None;
    }
    if near < projection.near {
        return Some((everywhere, f32::MAX));
    }
    let (mut lo, mut hi) = ([f32::MAX; 2], [f32::MIN; 2]);
    for corner in 0..8 {
        let local = [0, 1, 2].map(|k| middle[k] + if corner >> k & 1 == 1 { half[k] } else { -half[k] });
        let p = camera_from_instance.apply(local);
        let screen = [p[0] / p[2] * projection.fx + projection.cx, p[1] / p[2] * projection.fy + projection.cy];
        for k in 0..2 {
            (lo[k], hi[k]) = (lo[k].min(screen[k]), hi[k].max(screen[k]));
        }
    }
    Some((blocks(projection, lo, hi)?, projection.nearness(near * 0.9999)))
}

/// Bounds of a box around a point of the optical frame, through a lens, and its largest nearness: the whole image if
/// the depth range allows it, else `None`. Blocks are tested later.
fn lens_bounds(projection: &Projection, lens: &LensRays, middle: [f32; 3], half: [f32; 3]) -> Option<([u16; 4], f32)> {
    let everywhere = full_rect(projection);
    let radius = 1.0001 * norm(half);
    if !radius.is_finite() {
        return Some((everywhere, f32::MAX));
    }
    let at = if lens.is_forward() { middle[2] } else { norm(middle) };
    let (near, far) = (at - radius - 1e-4 * at.abs(), at + radius + 1e-4 * at.abs());
    if far < projection.near || near > projection.far {
        return None;
    }
    Some((everywhere, if near < projection.near { f32::MAX } else { projection.nearness(near) }))
}

/// As [`bounds`], for a ball around a point of the optical frame.
fn ball_bounds(projection: &Projection, c: [f32; 3], radius: f32) -> Option<([u16; 4], f32)> {
    box_bounds(projection, c, [radius; 3])
}

fn box_bounds(projection: &Projection, c: [f32; 3], r: [f32; 3]) -> Option<([u16; 4], f32)> {
    let (near, far) = (c[2] - r[2], c[2] + r[2]);
    if far < projection.near || near > projection.far {
        return None;
    }
    let f = [projection.fx, projection.fy];
    let middle = [projection.cx, projection.cy];
    if projection.parallel {
        let lo = [0, 1].map(|k| (c[k] - r[k]) * f[k] + middle[k]);
        let hi = [0, 1].map(|k| (c[k] + r[k]) * f[k] + middle[k]);
        return Some((blocks(projection, lo, hi)?, projection.nearness(near) + 1e-6));
    }
    if near < projection.near {
        return Some((full_rect(projection), f32::MAX));
    }
    let lo = [0, 1].map(|k| (c[k] - r[k]) / if c[k] - r[k] < 0.0 { near } else { far } * f[k] + middle[k]);
    let hi = [0, 1].map(|k| (c[k] + r[k]) / if c[k] + r[k] > 0.0 { near } else { far } * f[k] + middle[k]);
    Some((blocks(projection, lo, hi)?, projection.nearness(near * 0.9999)))
}

fn full_rect(projection: &Projection) -> [u16; 4] {
    [0, 0, ((projection.width - 1) / BLOCK) as u16, ((projection.height - 1) / BLOCK) as u16]
}

/// Blocks of a rectangle \[pixels\], enlarged by one pixel on each side; `None` outside of the image.
fn blocks(projection: &Projection, lo: [f32; 2], hi: [f32; 2]) -> Option<[u16; 4]> {
    let size = [projection.width as f32, projection.height as f32];
    if (0..2).any(|k| hi[k] + 1.0 < 0.0 || lo[k] - 1.0 > size[k]) {
        return None;
    }
    let block = |x: f32, k: usize| (x.clamp(0.0, size[k] - 1.0) as usize / BLOCK) as u16;
    Some([block(lo[0] - 1.0, 0), block(lo[1] - 1.0, 1), block(hi[0] + 1.0, 0), block(hi[1] + 1.0, 1)])
}
