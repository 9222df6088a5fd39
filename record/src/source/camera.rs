//! Camera sensors as sources: channels, stereo pairs, intrinsics and distortion.

use super::{BufferElement, SourceKind, StreamSource, sim_error};
use crate::error::Result;
use crate::packet::ValueBuffer;
use crate::stream::{Distortion, ElementType, StreamKind};
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_render::frame::Channel;
use kinetoscope_render::frame::{self, Depth, Distance, Mask, Normal};
use kinetoscope_sensors::camera::{Camera, StereoCamera};
use kinetoscope_sensors::camera::{CameraConvention, CameraError, DistortionModel, Rectification};
use kinetoscope_sensors::ray::RayCasterCamera;
use kinetoscope_sim::SimulationManager;
use ndarray::{Array2, Array3, Axis};
use std::any::Any;

/// Name of the channel that both cameras of a stereo pair provide together.
pub(super) const DISPARITY: &str = "disparity";

/// A camera of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StereoSide {
    /// The sensor itself.
    Mono,
    /// Left camera of a stereo pair.
    Left,
    Right,
}

impl StereoSide {
    /// Returns the cameras of a sensor: both sides of a stereo camera, `Mono` for a camera or ray-caster camera, none
    /// for other sensors.
    pub(super) fn of(sensor: &dyn Any) -> &'static [Self] {
        if sensor.is::<StereoCamera>() {
            &[Self::Left, Self::Right]
        } else if sensor.is::<Camera>() || sensor.is::<RayCasterCamera>() {
            &[Self::Mono]
        } else {
            &[]
        }
    }

    /// Name of the camera, for the sensor `uid`.
    pub(super) fn name(self, uid: &str) -> String {
        match self {
            Self::Mono => uid.into(),
            Self::Left => format!("{uid}/left"),
            Self::Right => format!("{uid}/right"),
        }
    }

    /// Splits a channel name such as `left/depth` into the camera and the channel.
    pub(super) fn split_channel(channel: &str) -> (Self, &str) {
        let of = |prefix| channel.strip_prefix(prefix);
        let left = of("left/").map(|rest| (Self::Left, rest));
        left.or_else(|| of("right/").map(|rest| (Self::Right, rest))).unwrap_or((Self::Mono, channel))
    }

    /// Rendered camera of this side; `None` for other sensors and for ray-caster cameras.
    pub(super) fn camera(self, sensor: &dyn Any) -> Option<&Camera> {
        let pair = sensor.downcast_ref::<StereoCamera>();
        match self {
            Self::Mono => sensor.downcast_ref(),
            Self::Left => pair.map(StereoCamera::left),
            Self::Right => pair.map(StereoCamera::right),
        }
    }

    /// Image channels of the camera: name, element type, components per pixel.
    pub(super) fn channels(self, sensor: &dyn Any) -> Vec<(&'static str, ElementType, usize)> {
        match self.camera(sensor) {
            Some(camera) => {
                let wanted = camera.channels().names();
                CAMERA.iter().copied().filter(|(name, ..)| wanted.contains(name)).collect()
            }
            None if self == Self::Mono && sensor.is::<RayCasterCamera>() => RAY_CASTER_CAMERA_CHANNELS.to_vec(),
            None => Vec::new(),
        }
    }

    /// Height and width of the images \[pixels\]; 0 for other sensors.
    pub(super) fn image_shape(self, sensor: &dyn Any) -> (usize, usize) {
        let camera = self.camera(sensor).map(Camera::image_shape);
        camera.or_else(|| sensor.downcast_ref::<RayCasterCamera>().map(RayCasterCamera::image_shape)).unwrap_or((0, 0))
    }

    /// Lens distortion, which is the same in all environments; `None` if ROS has no model for the lens. A ray-caster
    /// camera has zero coefficients.
    pub(super) fn distortion(self, sensor: &dyn Any) -> Option<Distortion> {
        let Some(camera) = self.camera(sensor) else {
            // Ray-caster cameras are pinhole cameras.
            return Some(Distortion { model: DistortionModel::PlumbBob.name().into(), coefficients: vec![0.0; 5] });
        };
        let info = camera.camera_info("", *camera.env_ids().first()?).ok()?;
        Some(Distortion { model: info.distortion_model.name().into(), coefficients: info.distortion_coefficients })
    }

    /// Rectification matrices R (3 x 3) and P (3 x 4) of the last arrived images, row-major, 21 numbers per row; see
    /// [`Rectification`]. `None` for single cameras and for pairs that cannot be rectified.
    pub(super) fn rectification(self, sensor: &dyn Any) -> Option<Array2<f64>> {
        let eye = usize::from(self == Self::Right);
        let rows = rectifications(sensor)?.ok()?.into_iter().map(|Rectification { rotations, projections }| {
            // `iter` of the transposed matrix is row-major.
            let (r, p) = (rotations[eye].transpose(), projections[eye].transpose());
            let mut numbers = [0.0; 21];
            numbers.iter_mut().zip(r.iter().chain(p.iter())).for_each(|(to, from)| *to = *from);
            numbers
        });
        Some(Array2::from(rows.collect::<Vec<_>>()))
    }

    /// Intrinsic matrices and poses, with ROS camera axes, of the last arrived images; `None` if the sensor is not a
    /// camera.
    pub(super) fn intrinsics_and_poses(self, sensor: &dyn Any) -> Option<(Array3<f64>, Array2<f64>)> {
        if let Some(camera) = self.camera(sensor) {
            return Some((
                camera.latest_delivered_intrinsic_matrices(),
                camera.latest_delivered_pose_w(CameraConvention::Ros),
            ));
        }
        let images = sensor.downcast_ref::<RayCasterCamera>().map(RayCasterCamera::latest_delivered);
        images.map(|taken| (taken.intrinsic_matrices(), taken.pose_w(CameraConvention::Ros)))
    }
}

/// Rectification of the last arrived images of a stereo camera, row by row; `None` for other sensors.
fn rectifications(sensor: &dyn Any) -> Option<std::result::Result<Vec<Rectification>, CameraError>> {
    let pair = sensor.downcast_ref::<StereoCamera>()?;
    let matrices = [pair.left(), pair.right()].map(Camera::latest_delivered_intrinsic_matrices);
    let rows = 0..matrices[0].len_of(Axis(0));
    let of = |row| {
        let eye = |k: &Array3<f64>| PixelIntrinsics {
            fx: k[(row, 0, 0)],
            fy: k[(row, 1, 1)],
            cx: k[(row, 0, 2)],
            cy: k[(row, 1, 2)],
        };
        Rectification::new(&pair.left_from_right(), matrices.each_ref().map(eye))
    };
    Some(rows.map(of).collect())
}

/// The camera whose timing applies to a camera sensor. Both cameras of a stereo pair capture together. `None` for other
/// sensors, ray-caster cameras included.
pub(super) fn timing_camera(sensor: &dyn Any) -> Option<&Camera> {
    StereoSide::of(sensor).first().and_then(|eye| eye.camera(sensor))
}

/// Generates the list of the camera's channels (name, type, components per pixel) and the function that copies them.
macro_rules! cameras {
    ($($(#[$doc:meta])* $field:ident :: $Channel:ident,)*) => {
        const CAMERA: &[(&str, ElementType, usize)] = &[$(
            (
                frame::$Channel::NAME,
                <<frame::$Channel as Channel>::Element as BufferElement>::ELEMENT,
                frame::$Channel::COMPONENTS,
            ),
        )*];

        fn copy(source: &StreamSource, camera: &Camera, channel: &str, values: &mut ValueBuffer) -> Result<()> {
            match channel {
                $(_ if channel == frame::$Channel::NAME => {
                    source.append_rows(values, &camera.latest_delivered::<frame::$Channel>().map_err(sim_error(source))?);
                })*
                _ => return Err(source.changed()),
            }
            Ok(())
        }
    };
}

kinetoscope_render::with_channels!(cameras);

/// Channels of ray-caster cameras: name, type, components per pixel.
const RAY_CASTER_CAMERA_CHANNELS: [(&str, ElementType, usize); 4] = [
    (Depth::NAME, ElementType::F32, 1),
    (Distance::NAME, ElementType::F32, 1),
    (Normal::NAME, ElementType::F32, 3),
    (Mask::NAME, ElementType::I32, 1),
];

impl StreamSource {
    /// Describes what ROS's `CameraInfo` message cannot express for this camera, and the reason; `None` if nothing is
    /// missing.
    pub(crate) fn camera_info_gap(&self, sim: &SimulationManager) -> Option<String> {
        let (StreamKind::CameraInfo { camera, distortion, .. }, SourceKind::CameraInfo(uid, _)) =
            (&self.stream.kind, &self.kind)
        else {
            return None;
        };
        if distortion.is_none() {
            return Some(format!("{camera}/camera_info (ROS has no model of its lens)"));
        }
        let error = rectifications(sim.entities().sensor_by_uid(uid).ok()?)?.err()?;
        Some(format!("R and P of {camera}/camera_info ({error})"))
    }

    pub(super) fn copy_image(
        &self,
        sensor: &dyn Any,
        eye: StereoSide,
        channel: &str,
        values: &mut ValueBuffer,
    ) -> Result<()> {
        if let Some(pair) = sensor.downcast_ref::<StereoCamera>()
            && channel == DISPARITY
        {
            self.append_rows(values, &pair.latest_delivered_disparity().map_err(sim_error(self))?);
            return Ok(());
        }
        if let Some(camera) = eye.camera(sensor) {
            return copy(self, camera, channel, values);
        }
        let camera = sensor.downcast_ref::<RayCasterCamera>().ok_or_else(|| self.changed())?;
        let taken = camera.latest_delivered();
        match channel {
            _ if channel == Depth::NAME => self.append_rows(values, &taken.depth()),
            _ if channel == Distance::NAME => self.append_rows(values, &taken.distance()),
            _ if channel == Normal::NAME => self.append_rows(values, &taken.normal()),
            _ if channel == Mask::NAME => self.append_rows(values, &taken.mask()),
            _ => return Err(self.changed()),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_render::frame::Channels;

    /// Root cause: a second, handwritten list of the channels lacked two of them.
    #[test]
    fn channels() {
        let recorded: Vec<&str> = CAMERA.iter().map(|(name, ..)| *name).collect();
        assert_eq!(recorded, Channels::NAMES);
        let bytes: usize = CAMERA.iter().map(|(_, element, components)| element.bytes() * components).sum();
        assert_eq!(bytes, Channels::ALL.bytes_per_pixel());
    }
}
