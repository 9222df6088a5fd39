//! Camera rays of path tracing: origins and directions.

use kinetoscope_scene::basis::OrthonormalBasis;

use crate::aperture::Aperture;
use crate::lens::rays::LensRays;
use crate::visibility::Projection;
use kinetoscope_scene::PoseF64;
use kinetoscope_scene::Ray;
use kinetoscope_scene::sampling::sample_disk;
use kinetoscope_scene::vector::{add_scaled, dot, scale, sub};

/// Generator of camera rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraRayGenerator<'a> {
    pub(crate) projection: &'a Projection,
    /// Rays of the lens, used instead of the projection's; `None` for a pinhole.
    pub(crate) lens: Option<&'a LensRays>,
    pub(crate) thin_lens: Option<ThinLens>,
}

/// Aperture of a thin lens.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThinLens {
    /// Radius of the aperture \[m\].
    radius: f64,
    /// Focus distance \[m\].
    focus: f64,
}

/// A camera ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraRay {
    /// Starts at the near plane.
    pub(super) ray: Ray,
    /// Distance from the camera to the start of the ray \[m\].
    pub(super) near_distance: f64,
    /// Length of the ray, up to the far plane \[m\].
    pub(super) limit: f64,
    /// Width of a pixel at the start of the ray \[m\], and its growth per meter.
    pub(super) footprint: f64,
    pub(super) footprint_growth: f64,
}

impl ThinLens {
    /// Creates the thin lens of an aperture; `None` for an aperture without a diameter (a pinhole).
    pub(crate) fn from_aperture(aperture: &Aperture) -> Option<Self> {
        let radius = 0.5 * aperture.diameter();
        (radius > 0.0).then_some(Self { radius, focus: aperture.focus_distance })
    }
}

impl CameraRayGenerator<'_> {
    /// The camera ray through a point of the image and a sampled point of the aperture, for a camera at `pose`.
    /// `choice` gives two random numbers in 0..1. `None` outside of the image circle.
    pub(super) fn camera_ray(
        &self,
        [u, v]: [f64; 2],
        pose: &PoseF64,
        choice: impl Fn() -> [f64; 2],
    ) -> Option<CameraRay> {
        let (view, wide) = (self.projection, f64::from);
        let (c, f) = match self.lens {
            None => {
                let c = [(u - wide(view.cx)) / wide(view.fx), (v - wide(view.cy)) / wide(view.fy), 1.0];
                (c, wide(view.fx))
            }
            Some(lens) => (lens.optics().ray([u, v])?, 1.0 / lens.pixel_spacing()),
        };
        let (c, from) = match self.thin_lens {
            None => (c, pose.translation),
            Some(ThinLens { radius, focus }) => {
                let [x, y] = sample_disk(choice()).map(|x| radius * x);
                // The aperture faces forward; for lenses whose rays do not all go forward, it faces each ray.
                let forward = self.lens.is_none_or(LensRays::is_forward);
                let off = if forward { [x, y, 0.0] } else { OrthonormalBasis::from_normal(c).to_world([x, y, 0.0]) };
                (sub(c, scale(off, 1.0 / focus)), pose.apply(off))
            }
        };
        let d = pose.rotation.map(|r| dot(r, c));
        let length = dot(d, d).sqrt();
        let direction = scale(d, 1.0 / length);
        let (near, far) = (wide(view.near) * length, wide(view.far) * length);
        Some(CameraRay {
            ray: Ray { origin: add_scaled(from, near, direction), direction },
            near_distance: near,
            limit: far - near,
            footprint: wide(view.near) / f,
            footprint_growth: 1.0 / (f * length),
        })
    }
}
