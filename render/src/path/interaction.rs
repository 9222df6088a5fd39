//! Surface interaction of a path: the point that a ray hit.

use super::bsdf::Bsdf;
use super::texel;
use crate::geometry::interpolation::interpolate_triangle;
use crate::trace::Hit;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::vector::{V3, add_scaled, dot, normalize, scale, sub};
use kinetoscope_scene::{Instance, RenderScene, TextureKind};

/// A point of a surface, with its material. Positions are in the world \[m\], directions in world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceInteraction {
    pub(super) position: V3,
    /// The point on the smooth surface that the normals describe: for a round object made of triangles, outside of
    /// them. Shadow rays start there, so that the edge of its dark side is not cut triangle by triangle. Source:
    /// Hanika, Hacking the shadow terminator, Ray Tracing Gems II, 2021.
    pub(super) smooth_position: V3,
    /// Geometric unit normal, facing the ray's origin.
    pub(super) geometric_normal: V3,
    /// Shading unit normal, on the same side.
    pub(super) shading_normal: V3,
    /// True if the ray came from outside.
    pub(super) front: bool,
    pub(super) bsdf: Bsdf,
    pub(super) emission: V3,
    pub(super) alpha: f64,
}

impl SurfaceInteraction {
    /// Creates the point of a hit. `footprint` is the width of the pixel at the surface, if seen straight on \[m\].
    /// `None` if the scene does not contain the instance of the hit.
    pub(super) fn new(scene: &RenderScene, ray: &Ray, hit: &Hit, footprint: f64) -> Option<Self> {
        let index = hit.instance as usize;
        let (instance, pose) = (scene.instances().get(index)?, &hit.world_from_instance);
        let position = ray.at(hit.distance);
        let front = dot(hit.normal, ray.direction) < 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let geometric_normal = scale(hit.normal, side);
        let rotation = pose.rotation;
        let from = sub(position, pose.translation);
        let local = [0, 1, 2].map(|j| (0..3).map(|i| rotation[i][j] * from[i]).sum::<f64>());
        let corner = instance.mesh().map(|mesh| interpolate_triangle(mesh, hit.triangle as usize, local, side));
        let normal = corner.and_then(|c| {
            let turned = rotation.map(|row| side * dot(row, c.normal));
            // A smooth normal may face away although the flat surface is visible.
            normalize(turned).filter(|n| dot(*n, ray.direction) < -1e-3 && dot(*n, geometric_normal) > 0.0)
        });
        let slant = (-dot(geometric_normal, ray.direction)).max(0.02).sqrt();
        let uv = corner.and_then(|c| c.uv);
        let texel = texture(scene, index, instance, local, uv, footprint / slant);
        let albedo = [0, 1, 2].map(|k| f64::from(scene.linear_colors()[index][k]) * texel[k]);
        let material = &instance.material;
        let reflectance = if mirrors(instance, hit) { material.reflectance } else { 0.0 };
        let emission = scale(albedo, f64::from(material.emission.max(0.0)));
        let alpha = f64::from(material.rgba[3].clamp(0.0, 1.0));
        let lift = corner.map_or([0.0; 3], |c| rotation.map(|row| dot(row, c.lift)));
        let smooth_position = add_scaled(position, 1.0, lift);
        let shading_normal = normal.unwrap_or(geometric_normal);
        let bsdf = Bsdf::new(material, reflectance, albedo, front);
        Some(Self { position, smooth_position, geometric_normal, shading_normal, front, bsdf, emission, alpha })
    }
}

/// True if the reflectance of a material applies at a hit: of boxes, only the +z face mirrors.
fn mirrors(instance: &Instance, hit: &Hit) -> bool {
    let up = hit.world_from_instance.rotation.map(|row| row[2]);
    !matches!(instance.shape, Shape::Box(_)) || dot(hit.normal, up) > 0.5
}

/// Linear color of an instance's texture at a point in the frame of the instance; white without a texture.
fn texture(
    scene: &RenderScene,
    index: usize,
    instance: &Instance,
    local: V3,
    uv: Option<([f64; 2], f64)>,
    width: f64,
) -> V3 {
    let Some(image) = instance.material.texture.as_deref() else { return [1.0; 3] };
    let by = scene.texture_scales()[index].map(f64::from);
    if image.kind() == TextureKind::Cube {
        let largest = by.iter().fold(0.0f64, |m, &x| m.max(x));
        return texel::at_cube(image, [0, 1, 2].map(|k| local[k] * by[k]), width * largest);
    }
    let offset = scene.texture_offsets()[index].map(f64::from);
    let projected = ([0, 1].map(|k| local[k] * by[k] + offset[k]), by[0].abs().max(by[1].abs()));
    let on_faces = match (&instance.shape, scene.face_images()[index]) {
        (Shape::Box(cuboid), Some(images)) => Some(cuboid.face_coordinates(local, images)),
        _ => None,
    };
    let (at, density) = uv.or(on_faces).unwrap_or(projected);
    texel::at(image, at, width * density)
}
