//! ROS calibration files: `camera_info` as written by `camera_calibration` and `camera_info_manager`.
//!
//! Source: ROS, package `camera_calibration_parsers` (`parse_yml.cpp`), and the message `sensor_msgs/CameraInfo`.

mod error;
mod write;
mod yaml;

use super::cfg::CameraCfg;
use super::error::CameraError;
use super::sensor::Camera;
use crate::error::SensorError;
pub use error::CalibrationError;
use kinetoscope_render::Renderer;
use kinetoscope_render::lens::{Lens, LensModel};
use kinetoscope_render::lens::{OpenCv, OpenCvFisheye};
use kinetoscope_render::{Intrinsics, PixelIntrinsics};
use kinetoscope_scene::input_file;
use kinetoscope_scene::pattern::closest_names;
use kinetoscope_scene::yaml::{Node, Scalar, Value};
use nalgebra::{Matrix3, Matrix3x4};
use std::fmt;
use std::path::Path;

/// Tolerance of rotation matrices: files have six digits or more.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Distortion model of ROS. Files may also use the names of other tools, see [`Lens::from_name`]: `radtan`, `fisheye`,
/// `kannala_brandt4` and more. `equidistant` has its ROS meaning, OpenCV's fisheye model.
///
/// `plumb_bob` and `rational_polynomial` describe the same lens. Both accept as many coefficients as OpenCV: 0, 4, 5,
/// 8, 12 or 14. The last two of 14 must be 0, because tilted sensors are not supported. If a file names no model, up to
/// 5 coefficients mean `plumb_bob`, more mean `rational_polynomial`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DistortionModel {
    /// k1, k2, p1, p2, k3 of [`OpenCv`].
    PlumbBob,
    /// k1, k2, p1, p2, k3, k4, k5, k6 of [`OpenCv`], and s1 to s4.
    RationalPolynomial,
    /// k1, k2, k3, k4 of [`OpenCvFisheye`].
    Equidistant,
}

impl DistortionModel {
    const ALL: [Self; 3] = [Self::PlumbBob, Self::RationalPolynomial, Self::Equidistant];

    /// Name in calibration files.
    pub fn name(self) -> &'static str {
        match self {
            Self::PlumbBob => "plumb_bob",
            Self::RationalPolynomial => "rational_polynomial",
            Self::Equidistant => "equidistant",
        }
    }

    /// Accepted numbers of coefficients.
    fn counts(self) -> &'static [usize] {
        match self {
            Self::PlumbBob | Self::RationalPolynomial => &[0, 4, 5, 8, 12, 14],
            Self::Equidistant => &[4],
        }
    }

    /// Returns the model of OpenCV's lens with `count` coefficients.
    fn for_coefficient_count(count: usize) -> Self {
        if count > 5 { Self::RationalPolynomial } else { Self::PlumbBob }
    }

    /// Finds the model by its name in a file with `count` coefficients; `None` for an unknown name, and for a lens that
    /// calibration files do not describe.
    fn from_name(name: &str, count: usize) -> Option<Self> {
        let own = Self::ALL.into_iter().find(|model| model.name() == name);
        own.or_else(|| match Lens::from_name(name).ok()? {
            Lens::OpenCv(_) => Some(Self::for_coefficient_count(count)),
            Lens::OpenCvFisheye(_) => Some(Self::Equidistant),
            _ => None,
        })
    }

    /// Returns all names accepted in files.
    fn names() -> impl Iterator<Item = &'static str> {
        let lenses = [OpenCv::NAME, OpenCvFisheye::NAME].into_iter();
        let aliases = [OpenCv::ALIASES, OpenCvFisheye::ALIASES].into_iter().flatten().copied();
        Self::ALL
            .map(Self::name)
            .into_iter()
            .chain(lenses)
            .chain(aliases.filter(|alias| Self::ALL.iter().all(|model| model.name() != *alias)))
    }
}

/// Calibration of a camera, with the numbers of a calibration file.
///
/// In a file, the *center* of the first pixel is at (0, 0), as in OpenCV. In [`Intrinsics`] and [`Lens`], the corner of
/// the first pixel is at (0, 0). So principal points of this type are half a pixel less: cx of a centered camera with
/// 640 columns is 319.5. [`from_intrinsics`](Self::from_intrinsics), [`intrinsics`](Self::intrinsics) and
/// [`apply_to`](Self::apply_to) convert between the two.
///
/// ```
/// use kinetoscope_sensors::camera::{CameraCfg, CameraInfo};
///
/// let text = "
/// image_width: 640
/// image_height: 480
/// camera_name: wrist
/// camera_matrix: { rows: 3, cols: 3, data: [610.2, 0, 324.1, 0, 611.0, 238.7, 0, 0, 1] }
/// distortion_model: plumb_bob
/// distortion_coefficients: { rows: 1, cols: 5, data: [-0.31, 0.11, 0.0004, -0.0002, 0] }
/// rectification_matrix: { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1] }
/// projection_matrix: { rows: 3, cols: 4, data: [580.1, 0, 323.0, 0, 0, 592.3, 238.0, 0, 0, 0, 1, 0] }
/// ";
/// let info = CameraInfo::parse(text, "wrist.yaml")?;
/// // The simulated camera with this calibration: raw images, as its driver publishes them.
/// let mut cfg = CameraCfg::default();
/// info.apply_to(&mut cfg);
/// assert_eq!((cfg.width, cfg.lens.name()), (640, "opencv"));
/// // The same point of the image, counted from the corner of the first pixel.
/// assert_eq!(info.intrinsics().to_pixels(640, 480)?.cx, 324.6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CameraInfo {
    /// Name of the camera; may be empty.
    pub name: String,
    /// Image width \[pixels\].
    pub width: usize,
    /// Image height \[pixels\].
    pub height: usize,
    /// K: `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` of raw images \[pixels\], cx and cy from the center of the first
    /// pixel.
    pub camera_matrix: Matrix3<f64>,
    /// Model of the coefficients D.
    pub distortion_model: DistortionModel,
    /// D, in the order of the model; missing ones are 0.
    pub distortion_coefficients: Vec<f64>,
    /// R: rotation from the camera frame to the frame of the rectified images, as in ROS. Raw images do not depend on
    /// R.
    pub rectification_matrix: Matrix3<f64>,
    /// P: projection from the frame of the rectified images to their pixels, counted from the center of the first
    /// pixel. Raw images do not depend on P.
    pub projection_matrix: Matrix3x4<f64>,
}

impl CameraInfo {
    /// Center of the first pixel in [`Intrinsics`] \[pixels\], along both axes of the image; in a file it is at 0.
    pub const FIRST_PIXEL_CENTER: f64 = 0.5;

    /// Reads a calibration file.
    ///
    /// # Errors
    ///
    /// The first problem, with file and line, or field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CalibrationError> {
        let path = path.as_ref();
        let text = input_file::read_named_text(path)
            .map_err(|error| CalibrationError::File { path: path.into(), error: error.to_string() })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses the text of a calibration file; errors name it `file`. Fields other than those of `camera_info` are
    /// ignored.
    ///
    /// A file without `distortion_model` uses OpenCV's lens, as in ROS. Without coefficients it has no distortion, see
    /// [`DistortionModel`]. `binning_x`, `binning_y` and `roi` must describe the full images of the calibration.
    ///
    /// # Errors
    ///
    /// Same as [`read`](Self::read).
    pub fn parse(text: &str, file: &str) -> Result<Self, CalibrationError> {
        let root = yaml::parse(text, file)?;
        let reader = Reader { file };
        let Value::Table(fields) = &root.value else {
            let problem = format!("is {}, not a table of fields", root.value.describe());
            return Err(reader.field_error(root.line, "the file", problem));
        };
        let find = |name: &str| fields.iter().find(|(key, _)| key == name).map(|(_, node)| node);
        let get = |name: &'static str| {
            find(name).ok_or_else(|| CalibrationError::Missing { file: file.into(), field: name.into() })
        };
        let width = reader.size("image_width", get("image_width")?)?;
        let height = reader.size("image_height", get("image_height")?)?;
        let name = match find("camera_name") {
            Some(node) => reader.text("camera_name", node)?.to_owned(),
            None => String::new(),
        };
        let k = get("camera_matrix")?;
        let camera_matrix = Matrix3::from_row_slice(&reader.matrix("camera_matrix", k, [3, 3])?);
        Intrinsics::from_matrix(&camera_matrix).map_err(|error| {
            reader.field_error(k.line, "camera_matrix", format!("is not a valid camera matrix: {error}"))
        })?;
        let (distortion_model, distortion_coefficients) =
            reader.distortion(find("distortion_model"), get("distortion_coefficients")?)?;
        reader.reject_binning(["binning_x", "binning_y"].map(|name| (name, find(name))))?;
        find("roi").map_or(Ok(()), |roi| reader.reject_partial_roi(roi, [width, height]))?;
        let r = get("rectification_matrix")?;
        let rectification_matrix = Matrix3::from_row_slice(&reader.matrix("rectification_matrix", r, [3, 3])?);
        let off = (rectification_matrix * rectification_matrix.transpose() - Matrix3::identity()).amax();
        if off > ROTATION_TOLERANCE || rectification_matrix.determinant() < 0.0 {
            let determinant = rectification_matrix.determinant();
            let problem = format!("is not a rotation: its determinant is {determinant:.4}, its rows are {off:.4} off");
            return Err(reader.field_error(r.line, "rectification_matrix", problem));
        }
        let p = get("projection_matrix")?;
        let projection_matrix = Matrix3x4::from_row_slice(&reader.matrix("projection_matrix", p, [3, 4])?);
        let determinant = projection_matrix.fixed_columns::<3>(0).determinant();
        if determinant == 0.0 {
            let problem = "is singular: the determinant of its first three columns is 0".into();
            return Err(reader.field_error(p.line, "projection_matrix", problem));
        }
        Ok(Self {
            name,
            width,
            height,
            camera_matrix,
            distortion_model,
            distortion_coefficients,
            rectification_matrix,
            projection_matrix,
        })
    }

    /// Returns the calibration of a simulated camera: R is the identity and P is K, as for a single camera. The end of
    /// the lens (`max_angle`) is not represented: K and D are the same, and some pixels are dark.
    ///
    /// The lens [`Equidistant`](kinetoscope_render::lens::Equidistant) becomes `equidistant` with four zeros.
    /// `cv::fisheye` reads that correctly. ROS's `image_geometry` takes zeros of any model for no distortion, and does
    /// not rectify.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Lens`] if `camera_info` has no model for the lens; [`CalibrationError::Camera`] for invalid
    /// intrinsics.
    pub fn from_intrinsics(
        name: &str,
        [width, height]: [usize; 2],
        pixels: &PixelIntrinsics,
        lens: &Lens,
    ) -> Result<Self, CalibrationError> {
        let (distortion_model, distortion_coefficients) = distortion_of(lens)?;
        let mut camera_matrix = Intrinsics::from(*pixels).matrix(width, height).map_err(CameraError::from)?;
        (0..2).for_each(|axis| camera_matrix[(axis, 2)] -= Self::FIRST_PIXEL_CENTER);
        let mut projection_matrix = Matrix3x4::zeros();
        projection_matrix.fixed_columns_mut::<3>(0).copy_from(&camera_matrix);
        Ok(Self {
            name: name.into(),
            width,
            height,
            camera_matrix,
            distortion_model,
            distortion_coefficients,
            rectification_matrix: Matrix3::identity(),
            projection_matrix,
        })
    }

    /// Focal lengths and principal point of raw images, counted from the corner of the first pixel.
    pub fn intrinsics(&self) -> Intrinsics {
        let k = &self.camera_matrix;
        let [cx, cy] = [0, 1].map(|axis| k[(axis, 2)] + Self::FIRST_PIXEL_CENTER);
        Intrinsics::Pixels { fx: k[(0, 0)], fy: k[(1, 1)], cx, cy }
    }

    /// Lens of raw images.
    pub fn lens(&self) -> Lens {
        let d = &self.distortion_coefficients;
        match self.distortion_model {
            DistortionModel::PlumbBob | DistortionModel::RationalPolynomial => OpenCv::from_coefficients(d).into(),
            DistortionModel::Equidistant => {
                let k = |i: usize| d.get(i).copied().unwrap_or(0.0);
                OpenCvFisheye { k1: k(0), k2: k(1), k3: k(2), k4: k(3), max_angle: None }.into()
            }
        }
    }

    /// Sets size, intrinsics and lens of a camera configuration to this calibration. [`Renderer::Raster`], the default,
    /// cannot render a lens that bends lines: it is replaced by [`Renderer::FastRayTraced`], which has the same
    /// lighting. Other renderers stay.
    pub fn apply_to(&self, cfg: &mut CameraCfg) {
        (cfg.width, cfg.height) = (self.width, self.height);
        (cfg.intrinsics, cfg.lens) = (self.intrinsics(), self.lens());
        if cfg.renderer == Renderer::Raster && !cfg.lens.is_pinhole() {
            cfg.renderer = Renderer::FastRayTraced;
        }
    }
}

impl Camera {
    /// Returns the calibration of the camera in environment `env`, named `name`, with its current intrinsics. R is the
    /// identity and P is K, as in [`CameraInfo::from_intrinsics`].
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see, and [`CalibrationError::Lens`].
    pub fn camera_info(&self, name: &str, env: usize) -> Result<CameraInfo, SensorError> {
        let (optics, (height, width)) = (self.optics(env)?, self.image_shape());
        Ok(CameraInfo::from_intrinsics(name, [width, height], &optics.pixels(), &optics.lens())?)
    }
}

/// Returns the ROS distortion model of a lens and its coefficients; an error for a lens that `camera_info` has no model
/// for.
fn distortion_of(lens: &Lens) -> Result<(DistortionModel, Vec<f64>), CalibrationError> {
    match *lens {
        Lens::Pinhole(_) => Ok((DistortionModel::PlumbBob, vec![0.0; 5])),
        Lens::OpenCv(lens) => {
            let all = lens.coefficients();
            let used = all.iter().rposition(|&c| c != 0.0).map_or(0, |last| last + 1);
            Ok(match used {
                0..=5 => (DistortionModel::PlumbBob, all[..5].to_vec()),
                6..=8 => (DistortionModel::RationalPolynomial, all[..8].to_vec()),
                _ => (DistortionModel::RationalPolynomial, all.to_vec()),
            })
        }
        Lens::OpenCvFisheye(lens) => Ok((DistortionModel::Equidistant, vec![lens.k1, lens.k2, lens.k3, lens.k4])),
        Lens::Equidistant(_) => Ok((DistortionModel::Equidistant, vec![0.0; 4])),
        _ => Err(CalibrationError::Lens {
            lens: lens.name(),
            reason: "the models of camera_info are plumb_bob, rational_polynomial (opencv) and equidistant (opencv_fisheye, \
                     equidistant)",
        }),
    }
}

/// Reads fields; errors name the file.
struct Reader<'a> {
    file: &'a str,
}

impl Reader<'_> {
    fn field_error(&self, line: usize, field: &str, problem: String) -> CalibrationError {
        CalibrationError::Field { file: self.file.into(), line, field: field.into(), problem }
    }

    fn text<'n>(&self, field: &str, node: &'n Node) -> Result<&'n str, CalibrationError> {
        match &node.value {
            Value::Scalar(Scalar { text, .. }) => Ok(text),
            other => Err(self.field_error(node.line, field, format!("is {}, not a string", other.describe()))),
        }
    }

    fn size(&self, field: &str, node: &Node) -> Result<usize, CalibrationError> {
        let text = self.text(field, node)?;
        text.parse::<usize>().ok().filter(|&n| n > 0).ok_or_else(|| {
            self.field_error(node.line, field, format!("is {text:?}; it must be a whole number of pixels, at least 1"))
        })
    }

    fn number(&self, field: &str, node: &Node) -> Result<f64, CalibrationError> {
        let text = self.text(field, node)?;
        text.parse::<f64>()
            .ok()
            .filter(|x| x.is_finite())
            .ok_or_else(|| self.field_error(node.line, field, format!("has {text:?}; it must be a finite number")))
    }

    /// Returns `[rows, cols]` and the `data` of a matrix, row by row; an error if the number of values differs from
    /// rows x cols. `field` names the matrix in errors.
    fn numbers(&self, field: &str, node: &Node) -> Result<([usize; 2], Vec<f64>), CalibrationError> {
        let Value::Table(parts) = &node.value else {
            let problem = format!("is {}, not a table of rows, cols and data", node.value.describe());
            return Err(self.field_error(node.line, field, problem));
        };
        let part = |name: &str| {
            parts.iter().find(|(key, _)| key == name).map(|(_, node)| node).ok_or_else(|| {
                let problem = format!("has no {name}; a matrix has rows, cols and data");
                self.field_error(node.line, field, problem)
            })
        };
        let size = |name: &str| {
            let node = part(name)?;
            let text = self.text(&format!("{field}.{name}"), node)?;
            text.parse::<usize>().map_err(|_| {
                self.field_error(
                    node.line,
                    &format!("{field}.{name}"),
                    format!("is {text:?}; it must be a whole number"),
                )
            })
        };
        let (shape, data) = ([size("rows")?, size("cols")?], part("data")?);
        let name = format!("{field}.data");
        let Value::List(list) = &data.value else {
            return Err(self.field_error(
                data.line,
                &name,
                format!("is {}, not a list of numbers", data.value.describe()),
            ));
        };
        let numbers = list.iter().map(|node| self.number(&name, node)).collect::<Result<Vec<f64>, _>>()?;
        if shape[0].checked_mul(shape[1]) != Some(numbers.len()) {
            let problem =
                format!("has {} numbers, not the {} x {} of rows and cols", numbers.len(), shape[0], shape[1]);
            return Err(self.field_error(data.line, &name, problem));
        }
        Ok((shape, numbers))
    }

    /// Reads a matrix of the expected shape, in row-major order.
    fn matrix(&self, field: &str, node: &Node, expected: [usize; 2]) -> Result<Vec<f64>, CalibrationError> {
        let (shape, numbers) = self.numbers(field, node)?;
        if shape != expected {
            let [[rows, cols], [r, c]] = [shape, expected];
            return Err(self.field_error(node.line, field, format!("is {rows} x {cols}; it must be {r} x {c}")));
        }
        Ok(numbers)
    }

    fn distortion(&self, model: Option<&Node>, d: &Node) -> Result<(DistortionModel, Vec<f64>), CalibrationError> {
        let field = "distortion_coefficients";
        let (_, numbers) = self.numbers(field, d)?;
        let found = numbers.len();
        let named = match model {
            Some(node) => Some((node, self.text("distortion_model", node)?)).filter(|(_, name)| !yaml::is_null(name)),
            None => None,
        };
        let known = match named {
            None => DistortionModel::for_coefficient_count(found),
            Some((node, name)) => DistortionModel::from_name(name, found).ok_or_else(|| CalibrationError::Model {
                file: self.file.into(),
                line: node.line,
                model: name.into(),
                candidates: closest_names(name, DistortionModel::names()),
            })?,
        };
        let counts = known.counts();
        if let Some((last, others)) = counts.split_last().filter(|_| !counts.contains(&found)) {
            let name = named.map_or(DistortionModel::PlumbBob.name(), |(_, name)| name);
            let others: Vec<String> = others.iter().map(usize::to_string).collect();
            let or = if others.is_empty() { "" } else { " or " };
            let problem = format!("has {found} numbers; {name} has {}{or}{last}", others.join(", "));
            return Err(self.field_error(d.line, field, problem));
        }
        if let [tau_x, tau_y] = numbers[found.min(12)..]
            && [tau_x, tau_y] != [0.0; 2]
        {
            let problem = format!(
                "tilts the sensor (tau_x = {tau_x}, tau_y = {tau_y}): tilted sensors are not supported; the last two of 14 numbers \
                 have to be 0"
            );
            return Err(self.field_error(d.line, field, problem));
        }
        Ok((known, numbers))
    }

    fn count(&self, field: &str, node: &Node) -> Result<usize, CalibrationError> {
        let text = self.text(field, node)?;
        text.parse().map_err(|_| {
            self.field_error(node.line, field, format!("is {text:?}; it must be a whole number of pixels"))
        })
    }

    /// Rejects pixels that combine several pixels of the calibration.
    fn reject_binning(&self, fields: [(&str, Option<&Node>); 2]) -> Result<(), CalibrationError> {
        for (field, node) in fields {
            let Some(node) = node else { continue };
            let count = self.count(field, node)?;
            if count > 1 {
                let problem = format!(
                    "is {count}: binning is not supported; give image_width, image_height and camera_matrix of the binned \
                     images, and remove {field}"
                );
                return Err(self.field_error(node.line, field, problem));
            }
        }
        Ok(())
    }

    /// Rejects a region that is only a part of the calibrated image. A width or height of 0 reaches to the edge of the
    /// image. A `roi` that is not a table is an error too.
    fn reject_partial_roi(&self, roi: &Node, [width, height]: [usize; 2]) -> Result<(), CalibrationError> {
        let Value::Table(parts) = &roi.value else {
            let problem =
                format!("is {}, not a table of x_offset, y_offset, height, width and do_rectify", roi.value.describe());
            return Err(self.field_error(roi.line, "roi", problem));
        };
        let part = |name: &str| match parts.iter().find(|(key, _)| key == name) {
            Some((_, node)) => self.count(&format!("roi.{name}"), node),
            None => Ok(0),
        };
        let [x, y, w, h] = [part("x_offset")?, part("y_offset")?, part("width")?, part("height")?];
        // A size of 0 reaches to the edge of the image.
        let [w, h] =
            [(w, width, x), (h, height, y)].map(|(size, all, at)| if size > 0 { size } else { all.saturating_sub(at) });
        if [x, y, w, h] != [0, 0, width, height] {
            let problem = format!(
                "is {w} x {h} at ({x}, {y}), a region of {width} x {height}, which is not supported; give the values of the \
                 region and remove roi: image_width: {w}, image_height: {h}, cx minus {x}, cy minus {y}"
            );
            return Err(self.field_error(roi.line, "roi", problem));
        }
        Ok(())
    }
}

impl fmt::Display for DistortionModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
