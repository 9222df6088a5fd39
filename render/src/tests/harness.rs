//! A test scene rendered to an image, to be compared with an analytic answer or another renderer.

use crate::aperture::Aperture;
use crate::frame::{Channels, Frame};
use crate::image_renderer::ImageRenderer;
use crate::lens::LensRays;
use crate::parallel_renderer::ParallelRenderer;
use crate::renderer::Renderer;
use crate::request::{PreviousState, RasterCfg, RenderRequest};
use crate::shade::tone::ToneCurve;
use crate::shutter::{FrameSample, Shutter, ShutterOpenState};
use crate::simd::{SimdLevel, all_levels};
use crate::visibility::{RenderError, View};
use kinetoscope_scene::{Pose, PoseF32, RenderScene};
use kinetoscope_testkit::image_check::ImageCheck;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Every geom group, and meshes at full detail: all renderers agree on these settings.
pub(super) const EXACT: RasterCfg = RasterCfg {
    samples: 4,
    reflections: true,
    shadows: true,
    shadow_size: 0,
    occlusion_rays: 0,
    tone: ToneCurve::Soft,
    groups: u32::MAX,
    lod: false,
};

/// All inputs of an image.
#[derive(Clone, Debug)]
pub(super) struct TestFrame {
    pub(super) scene: RenderScene,
    pub(super) poses: Vec<PoseF32>,
    pub(super) view: View,
    pub(super) channels: Channels,
    pub(super) cfg: RasterCfg,
    pub(super) renderer: Renderer,
    pub(super) stops: f64,
    pub(super) lens: Option<LensRays>,
    /// Poses and view of the previous frame, for flow.
    pub(super) previous: Option<(Vec<PoseF32>, View)>,
    pub(super) aperture: Option<Aperture>,
    pub(super) shutter: Shutter,
    /// Poses of instances and camera at shutter opening, and the time since then \[s\].
    pub(super) shutter_open: Option<(Vec<PoseF32>, PoseF32, f64)>,
}

impl TestFrame {
    /// All channels by the rasterizer with default settings.
    pub(super) fn new((scene, poses): (RenderScene, Vec<PoseF32>), view: View) -> Self {
        Self {
            scene,
            poses,
            view,
            channels: Channels::ALL,
            cfg: RasterCfg::default(),
            renderer: Renderer::Raster,
            stops: 0.0,
            lens: None,
            previous: None,
            aperture: None,
            shutter: Shutter::default(),
            shutter_open: None,
        }
    }

    pub(super) fn request(&self) -> RenderRequest<'_> {
        let previous = self.previous.as_ref().map(|(poses, view)| PreviousState { poses, view });
        let Self { scene, poses, view, .. } = self;
        RenderRequest { scene, poses, view, lights: None, lens: self.lens.as_ref(), previous }
    }

    pub(super) fn sample(&self) -> FrameSample<'_> {
        let opened = self.shutter_open.as_ref();
        let shutter_open =
            opened.map(|(poses, camera, before)| ShutterOpenState { poses, world_from_camera: *camera, age: *before });
        FrameSample { noise: 0, shutter_open }
    }

    pub(super) fn frame(&self) -> Frame {
        Frame::new(self.view.width, self.view.height, self.channels)
    }

    /// The image rendered with an instruction set.
    pub(super) fn draw_on(&self, level: SimdLevel) -> Result<Image, RenderError> {
        self.draw_by(&mut self.rasterizer(level))
    }

    /// A rasterizer with the settings of the still.
    pub(super) fn rasterizer(&self, level: SimdLevel) -> ImageRenderer {
        let mut rasterizer = ImageRenderer::with_level(self.cfg, level);
        (rasterizer.renderer, rasterizer.exposure_compensation) = (self.renderer, self.stops);
        (rasterizer.aperture, rasterizer.shutter) = (self.aperture, self.shutter);
        rasterizer
    }

    /// The image rendered by a rasterizer with these settings, which keeps the BVHs of meshes.
    pub(super) fn draw_by(&self, rasterizer: &mut ImageRenderer) -> Result<Image, RenderError> {
        let mut frame = self.frame();
        rasterizer.render_sample(&self.request(), &self.sample(), &mut frame.as_mut())?;
        Ok(Image { frame, width: self.view.width })
    }

    pub(super) fn try_draw(&self) -> Result<Image, RenderError> {
        self.draw_on(SimdLevel::best())
    }

    #[track_caller]
    pub(super) fn draw(&self) -> Image {
        self.try_draw().unwrap()
    }

    /// The image by another renderer.
    #[track_caller]
    pub(super) fn with_renderer(&self, renderer: Renderer) -> Image {
        self.with(|still| still.renderer = renderer).draw()
    }

    /// The image from another view.
    #[track_caller]
    pub(super) fn draw_view(&self, view: View) -> Image {
        self.with(|still| still.view = view).draw()
    }

    pub(super) fn with(&self, change: impl FnOnce(&mut Self)) -> Self {
        let mut still = self.clone();
        change(&mut still);
        still
    }
}

/// Asserts that stills have the same bits with every instruction set, and in batches of these sizes with these numbers
/// of threads. Larger batches repeat the `kinds` of stills. Scenes are created for each batch, so that threads build
/// assets of meshes concurrently. Returns an image of each kind.
pub(super) fn assert_same_bits(
    what: &str,
    (kinds, make): (usize, &dyn Fn(usize) -> TestFrame),
    threads: &[usize],
    batches: &[usize],
) -> Vec<Image> {
    // The best level is that of the images.
    let best = format!("{:?}", SimdLevel::best());
    let others: Vec<SimdLevel> = all_levels().into_iter().filter(|level| format!("{level:?}") != best).collect();
    let image = |k| {
        let still = make(k);
        let image = still.draw();
        for &level in &others {
            assert!(still.draw_on(level).unwrap().same_bits(&image), "{what}: still {k} by {level:?}");
        }
        image
    };
    let images: Vec<Image> = (0..kinds).map(image).collect();
    for (&threads, &count) in threads.iter().flat_map(|threads| batches.iter().map(move |count| (threads, count))) {
        let made: Vec<TestFrame> = (0..kinds.min(count)).map(make).collect();
        let stills: Vec<&TestFrame> = made.iter().cycle().take(count).collect();
        let TestFrame { cfg, renderer, aperture, shutter, .. } = *stills[0];
        let mut parallel = ParallelRenderer::new(cfg, threads);
        parallel.set_renderer(renderer);
        parallel.set_exposure_optics(aperture, shutter);
        let mut frames: Vec<Frame> = stills.iter().map(|still| still.frame()).collect();
        let mut jobs: Vec<_> =
            stills.iter().map(|still| still.request()).zip(frames.iter_mut().map(Frame::as_mut)).collect();
        let takes: Vec<FrameSample<'_>> = stills.iter().map(|still| still.sample()).collect();
        parallel.render_samples(&mut jobs, &takes).unwrap();
        for (k, frame) in frames.into_iter().enumerate() {
            let image = Image { width: stills[k].view.width, frame };
            assert!(image.same_bits(&images[k % kinds]), "{what}: still {k} of {count}, {threads} threads");
        }
    }
    images
}

/// An image; channels by pixel, row by row.
#[derive(Clone, Debug)]
pub(super) struct Image {
    pub(super) frame: Frame,
    pub(super) width: usize,
}

impl Image {
    pub(super) fn mask(&self) -> &[i32] {
        self.frame.mask.as_ref().unwrap()
    }

    pub(super) fn depth(&self) -> &[f32] {
        self.frame.depth.as_ref().unwrap()
    }

    pub(super) fn distance(&self) -> &[f32] {
        self.frame.distance.as_ref().unwrap()
    }

    pub(super) fn color(&self) -> &[[u8; 4]] {
        self.frame.color.as_ref().unwrap().as_chunks().0
    }

    pub(super) fn albedo(&self) -> &[[u8; 4]] {
        self.frame.albedo.as_ref().unwrap().as_chunks().0
    }

    pub(super) fn normal(&self) -> &[[f32; 3]] {
        self.frame.normal.as_ref().unwrap().as_chunks().0
    }

    pub(super) fn shading_normal(&self) -> &[[f32; 3]] {
        self.frame.shading_normal.as_ref().unwrap().as_chunks().0
    }

    pub(super) fn position(&self) -> &[[f32; 3]] {
        self.frame.position.as_ref().unwrap().as_chunks().0
    }

    pub(super) fn flow(&self) -> &[[f32; 2]] {
        self.frame.flow.as_ref().unwrap().as_chunks().0
    }

    /// Red, green or blue \[bytes\].
    pub(super) fn channel(&self, c: usize) -> Vec<f32> {
        self.color().iter().map(|color| f32::from(color[c])).collect()
    }

    fn check<'a>(&self, name: &'a str, tolerance: f64) -> ImageCheck<'a> {
        ImageCheck { name, size: [self.width, self.color().len() / self.width], tolerance, outliers: 0.0 }
    }

    /// Asserts that all colors of a pixel are the byte of a formula, where it has a value.
    #[track_caller]
    pub(super) fn assert_gray(&self, name: &str, tolerance: f64, expected: impl Fn(usize) -> Option<f64>) {
        let check = self.check(name, tolerance);
        (0..3).for_each(|c| check.assert_matches(&self.channel(c), |x, y| expected(y * self.width + x)));
    }

    /// Number of pixels that differ from the byte of a formula, and number of pixels with a value.
    pub(super) fn count_gray(&self, tolerance: f64, expected: impl Fn(usize) -> Option<f64>) -> [usize; 2] {
        self.check("", tolerance).count(&self.channel(0), |x, y| expected(y * self.width + x))
    }

    /// True if all channels have the same bits: NaN equals itself.
    pub(super) fn same_bits(&self, other: &Self) -> bool {
        self.bits() == other.bits()
    }

    /// All channels as bits, so that NaN equals itself.
    pub(super) fn bits(&self) -> Vec<u32> {
        let Frame { color, albedo, mask, depth, distance, normal, shading_normal, position, flow, .. } = &self.frame;
        let mut out = Vec::new();
        for bytes in [color, albedo].into_iter().flatten() {
            out.extend(bytes.iter().map(|&x| u32::from(x)));
        }
        if let Some(ids) = mask {
            out.extend(ids.iter().map(|&x| x as u32));
        }
        for floats in [depth, distance, normal, shading_normal, position, flow].into_iter().flatten() {
            out.extend(floats.iter().map(|x| x.to_bits()));
        }
        out
    }

    /// [`Self::bits`] without the color.
    pub(super) fn bits_but_color(&self) -> Vec<u32> {
        Self { frame: Frame { color: None, ..self.frame.clone() }, width: self.width }.bits()
    }

    /// Pixels that have eight neighbors.
    pub(super) fn inner(&self) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.mask().len() / self.width);
        (1..height - 1).flat_map(move |y| (1..width - 1).map(move |x| y * width + x))
    }

    /// An inner pixel and its eight neighbors.
    pub(super) fn neighbors(&self, k: usize) -> impl Iterator<Item = usize> + Clone + use<> {
        let width = self.width;
        (0..9).map(move |n| k + (n / 3) * width + n % 3 - width - 1)
    }

    /// True if an inner pixel and its neighbors show the same instance.
    pub(super) fn is_inside_instance(&self, k: usize) -> bool {
        self.neighbors(k).all(|n| self.mask()[n] == self.mask()[k])
    }

    /// True if an inner pixel is off silhouettes: all neighbors show the same instance, at a depth within a tenth.
    pub(super) fn is_off_silhouette(&self, k: usize) -> bool {
        let depth = self.depth();
        let near = |n: usize| depth[n] == depth[k] || (depth[n] - depth[k]).abs() <= 0.1 * depth[k].abs();
        self.is_inside_instance(k) && self.neighbors(k).all(near)
    }
}

/// Number of pixels that differ by more than `bytes` in any color.
pub(super) fn count_different(a: &Image, b: &Image, bytes: u8) -> usize {
    let differ = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|c| a[c].abs_diff(b[c]) > bytes);
    a.color().iter().zip(b.color()).filter(differ).count()
}

/// A camera at `eye` that looks at `target`, z up.
#[track_caller]
pub(super) fn look_at_view(size: [usize; 2], fovy: f32, eye: [f32; 3], target: [f32; 3]) -> View {
    View::look_at(size, fovy, eye, target, [0.0, 0.0, 1.0]).unwrap()
}

/// A pose in double precision.
pub(super) fn to_f64_pose(pose: &PoseF32) -> Pose {
    let r = pose.rotation.map(|row| row.map(f64::from));
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| r[i][j]));
    let translation = Vector3::from(pose.translation.map(f64::from));
    Pose::from_parts(translation.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}
