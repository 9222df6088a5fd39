//! Surface reconstruction at sixteen samples of one instance: exact, from the ray and the shape, not from the
//! visibility buffer.

use crate::raster::PlacedInstance;
use crate::simd::{F, LANES, M, Simd, U, V3, load, max, min, select, splat};
use crate::visibility::{Projection, primitive};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Instance, PlaneLines, PoseF32};

/// Surfaces at sixteen samples.
#[derive(Clone, Copy)]
pub(crate) struct Surface<S: Simd> {
    /// Distance in units of the ray's direction: depth along the optical axis, or distance, \[m\].
    pub(crate) t: F<S>,
    /// Geometric normal, facing the camera, world frame.
    pub(crate) normal: V3<S>,
    /// Interpolated normal, world frame.
    pub(crate) shading_normal: V3<S>,
    /// Position in the world frame \[m\].
    pub(crate) position: V3<S>,
    /// Position in the frame of the instance \[m\].
    pub(crate) local_position: V3<S>,
    /// Texture coordinates, and their number per meter of surface.
    pub(crate) uv: [F<S>; 2],
    pub(crate) uv_density: F<S>,
    /// Barycentric coordinates in the triangle of a mesh; of other shapes, any.
    pub(crate) shares: [F<S>; 3],
}

/// Points on surfaces, as origins of rays.
#[derive(Clone, Copy)]
pub(crate) struct SurfacePointLanes<S: Simd> {
    /// Position in the world frame \[m\].
    pub(crate) position: V3<S>,
    /// Geometric normal, facing the camera, world frame.
    pub(crate) normal: V3<S>,
    /// Depth, as in [`Surface::t`].
    pub(crate) depth: F<S>,
}

impl<S: Simd> Surface<S> {
    #[inline(always)]
    pub(crate) fn point(&self) -> SurfacePointLanes<S> {
        SurfacePointLanes { position: self.position, normal: self.normal, depth: self.t }
    }
}

/// State that all samples of an instance share.
#[derive(Clone, Copy)]
pub(crate) struct InstanceSurface<'a> {
    pub(crate) instance: &'a Instance,
    pub(crate) world_from_instance: &'a PoseF32,
    pub(crate) placed: &'a PlacedInstance,
    pub(crate) first_id: u32,
    /// Linear color of the material.
    pub(crate) color: [f32; 3],
    /// Texture coordinates per meter, see [`kinetoscope_scene::RenderScene::texture_scales`].
    pub(crate) texture_scale: [f32; 3],
    /// Texture coordinates at the origin, see [`kinetoscope_scene::RenderScene::texture_offsets`].
    pub(crate) texture_offset: [f32; 2],
    /// Repetitions of the texture on the faces of a box, see [`kinetoscope_scene::RenderScene::face_images`].
    pub(crate) face_images: Option<[f32; 2]>,
    /// Polygons of a plane, see [`kinetoscope_scene::RenderScene::plane_lines`].
    pub(crate) plane_lines: [PlaneLines; 2],
}

/// Sixteen rays through a lens that bends them.
#[derive(Clone, Copy)]
pub(crate) struct LensRayLanes<S: Simd> {
    /// Directions in the optical frame.
    pub(crate) direction: V3<S>,
    /// True if they have z = 1, else length 1.
    pub(crate) forward: bool,
}

/// Sixteen rays from the camera.
#[derive(Clone, Copy)]
pub(crate) struct CameraRays<S: Simd> {
    /// Points (u, v) of the image \[pixels\].
    pub(crate) uv: [F<S>; 2],
    /// Rays through a lens; `None` for a pinhole.
    pub(crate) lens_rays: Option<LensRayLanes<S>>,
    /// Origins relative to the camera, world frame \[m\]; 0 unless the rays are parallel.
    pub(crate) origin: V3<S>,
    /// Directions in the world frame.
    pub(crate) direction: V3<S>,
}

/// Surfaces at the rays of the selected lanes, given by their ids in the visibility buffer; all belong to this
/// instance.
///
/// A function of its own, because the compile time of a function grows faster than its size.
#[inline(never)]
pub(crate) fn surface<S: Simd>(
    s: S,
    projection: &Projection,
    source: &InstanceSurface<'_>,
    ids: U<S>,
    lanes: M<S>,
    rays: CameraRays<S>,
) -> Surface<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let CameraRays { uv: [u, v], lens_rays, origin, direction } = rays;
            let camera = &source.placed.local.instance_from_camera;
            let (o, d) = match lens_rays {
                None => projection.rays(s, &source.placed.local, u, v),
                Some(ray) => (V3::splat(s, camera.translation), ray.direction.rotate(&camera.rotation)),
            };
            let zero = splat(s, 0.0);
            let (t, normal, shading, uv, uv_density);
            let mut shares = [zero; 3];
            if let Some(mesh) = source.placed.mesh(source.instance) {
                let [x, y, z] = &camera.rotation;
                let axis = match lens_rays {
                    Some(LensRayLanes { forward: false, .. }) => d.scale(1.0 / d.dot(d)),
                    _ => V3::splat(s, [x[2], y[2], z[2]]),
                };
                let hit = intersect_triangles(s, mesh, source.first_id, ids, lanes, o, d, axis);
                (t, normal, shading, uv, uv_density) = (hit.t, hit.normal, hit.shading, hit.uv, hit.uv_density);
                shares = hit.shares;
            } else {
                let hit = primitive::intersect(s, &source.instance.shape, o, d, projection.near);
                t = hit.t;
                // Other shapes have a unit normal already.
                normal = match source.instance.shape {
                    Shape::Plane(_) | Shape::Box(_) => hit.normal,
                    _ => hit.normal.unit(s),
                };
                shading = normal;
                uv = [zero, zero];
                uv_density = splat(s, 1.0);
            }
            let back = normal.dot(d).simd_gt(zero);
            let flip = select(back, splat(s, -1.0), splat(s, 1.0));
            let world = source.world_from_instance;
            let local_position = o.add(d.scale(t));
            // From the camera outward, as for the depth: both agree to the last digits.
            let eye = V3::splat(s, projection.world_from_camera.translation);
            let position = direction.scale(t).add(if projection.parallel { eye.add(origin) } else { eye });
            Surface {
                t,
                normal: normal.scale(flip).rotate(&world.rotation),
                shading_normal: shading.scale(flip).rotate(&world.rotation),
                position,
                local_position,
                uv,
                uv_density,
                shares,
            }
        },
    )
}

struct TriangleHit<S: Simd> {
    t: F<S>,
    normal: V3<S>,
    shading: V3<S>,
    uv: [F<S>; 2],
    uv_density: F<S>,
    shares: [F<S>; 3],
}

#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into its only caller")]
fn intersect_triangles<S: Simd>(
    s: S,
    mesh: &RenderMesh,
    first_id: u32,
    ids: U<S>,
    lanes: M<S>,
    o: V3<S>,
    d: V3<S>,
    axis: V3<S>,
) -> TriangleHit<S> {
    // Gathered lane by lane: positions and normals of three corners.
    let mut p = [[[0.0f32; LANES]; 3]; 3];
    let mut n = [[[0.0f32; LANES]; 3]; 3];
    let mut t = [[[0.0f32; LANES]; 2]; 3];
    let bits = lanes.to_bitmask();
    let ids: [u32; LANES] = ids.array();
    let (positions, normals) = (mesh.positions(), mesh.normals());
    let fill = bits.trailing_zeros() as usize % LANES;
    for lane in 0..LANES {
        // Lanes of other instances copy a triangle of this one, so that all numbers stay finite.
        let from = if bits >> lane & 1 == 1 { lane } else { fill };
        let triangle = mesh.triangles()[(ids[from] - first_id) as usize];
        for corner in 0..3 {
            let i = triangle[corner] as usize;
            for axis in 0..3 {
                p[corner][axis][lane] = positions[i][axis];
                n[corner][axis][lane] = normals[i][axis];
            }
        }
        if let Some(uvs) = mesh.uvs() {
            for corner in 0..3 {
                let uv = uvs[triangle[corner] as usize];
                (t[corner][0][lane], t[corner][1][lane]) = (uv[0], uv[1]);
            }
        }
    }
    let v3 = |a: &[[f32; LANES]; 3]| V3 { x: load(s, &a[0]), y: load(s, &a[1]), z: load(s, &a[2]) };
    let [a, b, c] = [v3(&p[0]), v3(&p[1]), v3(&p[2])];
    let (ab, ac, ao) = (b.sub(a), c.sub(a), o.sub(a));
    let normal = ab.cross(ac);
    let facing = normal.dot(d);
    let zero = splat(s, 0.0);
    let facing = select(facing.simd_eq(zero), splat(s, 1e-30), facing);
    let depth = -(normal.dot(ao) / facing);
    // Snapping may cover a sample just outside of a triangle seen edge-on, where its plane may be at any depth.
    let z = [a.sub(o).dot(axis), b.sub(o).dot(axis), c.sub(o).dot(axis)];
    let low = min(min(z[0], z[1]), z[2]);
    let high = max(max(z[0], z[1]), z[2]);
    let depth = min(max(depth, low), high);
    let w = ao.add(d.scale(depth));
    let area = normal.dot(normal);
    let inverse = 1.0 / select(area.simd_gt(zero), area, splat(s, 1.0));
    let one = splat(s, 1.0);
    let kb = min(max(w.cross(ac).dot(normal) * inverse, zero), one);
    let kc = min(max(ab.cross(w).dot(normal) * inverse, zero), one - kb);
    let ka = one - kb - kc;
    let [na, nb, nc] = [v3(&n[0]), v3(&n[1]), v3(&n[2])];
    let shading = na.scale(ka).add(nb.scale(kb)).add(nc.scale(kc)).unit(s);
    let mut uv = [zero, zero];
    let mut uv_density = one;
    if mesh.uvs().is_some() {
        let at = |corner: usize, k: usize| load(s, &t[corner][k]);
        uv = [at(0, 0) * ka + at(1, 0) * kb + at(2, 0) * kc, at(0, 1) * ka + at(1, 1) * kb + at(2, 1) * kc];
        let (u1, v1) = (at(1, 0) - at(0, 0), at(1, 1) - at(0, 1));
        let (u2, v2) = (at(2, 0) - at(0, 0), at(2, 1) - at(0, 1));
        let square = u1 * v2 - u2 * v1;
        // Square root of the ratio of areas, in the texture and on the surface.
        uv_density = (max(square, -square) * area.sqrt() * inverse).sqrt();
    }
    TriangleHit { t: depth, normal: normal.unit(s), shading, uv, uv_density, shares: [ka, kb, kc] }
}
