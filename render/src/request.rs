//! Inputs of a rendered frame, and options of the rasterizer.

use crate::lens::LensRays;
use crate::shade::tone::ToneCurve;
use crate::visibility::View;
use kinetoscope_scene::{Light, PoseF32, RenderScene};
use serde::{Deserialize, Serialize};

/// Options of a renderer. The rasterizer uses all options except `occlusion_rays`. Each option lists the other
/// renderers that ignore it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RasterCfg {
    /// Samples per pixel for color: 1 or 4. Path tracing ignores them. All other channels sample the pixel's center.
    pub samples: u8,
    /// True if lights with [`cast_shadow`](Light::cast_shadow) cast shadows. With shadow maps
    /// ([`Renderer::Raster`](crate::renderer::Renderer::Raster) and
    /// [`FastRayTraced`](crate::renderer::Renderer::FastRayTraced)) these are the first four directional lights and
    /// spots that have casters; with the other renderers, all lights.
    pub shadows: bool,
    /// True if planar mirrors (material `reflectance` of opaque planes and of the +z face of opaque boxes) reflect the
    /// scene: one ray from each sample on a mirror, shaded at its hit. In MuJoCo's light model, only the first mirror
    /// of the scene reflects. Path tracing always reflects.
    pub reflections: bool,
    /// Texels along the side of a shadow map, for the renderers with shadow maps (see [`shadows`](Self::shadows)). 0
    /// selects 128 to 1024 by the image size, or 512 to 2048 for scenes in MuJoCo's look, such as those of the Python
    /// package `kinetoscope-render`, whose shadows have sharp edges. Other values are clamped to 64..=8192 and rounded up
    /// to a multiple of 8.
    pub shadow_size: usize,
    /// Rays per color sample for ambient occlusion, in [`Renderer::Hybrid`](crate::renderer::Renderer::Hybrid) only; 0
    /// disables it. Path tracing ignores this number; with the other renderers, a number above 0 is an error. With
    /// ambient occlusion, ambient light is the part of [`RenderScene::ambient`] that is not occluded, as in
    /// [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced) without bounces. The result is exact on unoccluded
    /// flat surfaces. (With smooth normals, the mesh below a facet may occlude it.) Elsewhere the result has the noise of
    /// this number of rays, which depends only on the surface point.
    pub occlusion_rays: u16,
    /// Tone curve from light to color bytes.
    pub tone: ToneCurve,
    /// Geom groups that are rendered: bit k is group k. Instances of other groups cast no shadows either.
    pub groups: u32,
    /// True to render dense meshes at a lower level of detail where that is hardly visible. Only
    /// [`Renderer::Raster`](crate::renderer::Renderer::Raster) and shadow maps use lower levels.
    ///
    /// A continuous map joins the simplified surface to the mesh. It moves no point by more than 1 mm, nor by more than
    /// half a pixel anywhere in the image (both are proven, see [`kinetoscope_scene::shape::RenderMesh::levels`];
    /// vertices are snapped to 1/256 pixel besides, with or without levels). So:
    /// - the surface visible at a pixel is visible within half a pixel of it at full detail; of surfaces less than 2 mm
    ///   behind each other, either may be visible;
    /// - depth, distance and position are those of a point not farther than 1 mm from a point of the mesh that is
    ///   visible within half a pixel. On slanted surfaces and near silhouettes, depth changes by more than that within
    ///   half a pixel, and may differ by as much;
    /// - flat normals are those of the larger triangles: on smooth surfaces within some degrees of the mesh's, and
    ///   arbitrary on features smaller than half a pixel or 1 mm. Shading normals are interpolated from normals of the
    ///   mesh's own vertices, and no new triangle faces more than 40° away from them;
    /// - shadow maps follow the same rule in texels.
    ///
    /// Scenes in MuJoCo's look, such as those of the Python package `kinetoscope-render`, are compared with images at full
    /// detail: the limit in their images is a tenth of a pixel instead of half a pixel. Their shadow maps follow the rule of
    /// other scenes.
    ///
    /// The level depends only on the mesh, its pose and the view. Terrain is rendered at full detail. So are meshes
    /// with fewer than 1000 triangles, with texture coordinates, or that reach behind the near plane. The levels of a
    /// mesh are built on first use, and shared by all environments.
    pub lod: bool,
}

impl Default for RasterCfg {
    /// Four samples, shadows, reflections, levels of detail and the soft tone curve; geom groups 0, 1 and 2, as in
    /// MuJoCo's own viewers: collision shapes are in group 3.
    fn default() -> Self {
        Self {
            samples: 4,
            shadows: true,
            reflections: true,
            shadow_size: 0,
            occlusion_rays: 0,
            tone: ToneCurve::Soft,
            groups: 0b111,
            lod: true,
        }
    }
}

/// Inputs of one rendered frame. The renderer and its settings are those of the
/// [`ImageRenderer`](crate::ImageRenderer).
#[derive(Clone, Copy, Debug)]
pub struct RenderRequest<'a> {
    /// Scene to render: instances, meshes, materials and lights.
    pub scene: &'a RenderScene,
    /// Pose of each instance, in the order of the scene: world from instance.
    pub poses: &'a [PoseF32],
    /// Camera: pose, image size, focal lengths, principal point, and near and far limits.
    pub view: &'a View,
    /// Lights of this frame, used instead of the lights of the scene if lights move; `None` for the lights of the
    /// scene.
    pub lights: Option<&'a [Light]>,
    /// Rays of a lens, used instead of the view's focal lengths and principal point; `None` is a pinhole. They must
    /// have been computed for the image size of the view.
    pub lens: Option<&'a LensRays>,
    /// The previous frame, used by [`Flow`](crate::frame::Flow) only; without it, the flow is +inf.
    pub previous: Option<PreviousState<'a>>,
}

/// Poses and camera of the previous frame.
#[derive(Clone, Copy, Debug)]
pub struct PreviousState<'a> {
    /// Pose of each instance in the previous frame: world from instance.
    pub poses: &'a [PoseF32],
    /// Camera of the previous frame. With a [lens](RenderRequest::lens), the previous frame has the same lens model,
    /// with the focal lengths and the principal point of this view.
    pub view: &'a View,
}
