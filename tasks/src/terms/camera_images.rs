//! Images of cameras as observations.

use crate::context::TermContext;
use crate::error::{EnvError, Result, TermResult};
use crate::image::{ImageBatch, ImageElement, ImageSpace, ImageTerm};
use kinetoscope_sensors::camera::Camera;
use kinetoscope_sim::{SensorId, SimulationManager};
use ndarray::{Axis, Slice};

/// Creates images with the color of a camera (sRGB, without opacity), u8, 3 components. The camera needs the channel
/// `color`.
///
/// # Errors
/// The camera does not see every environment.
///
/// # Panics
/// The camera belongs to another manager.
pub fn camera_rgb(sim: &SimulationManager, name: &str, camera: SensorId<Camera>) -> Result<ImageTerm> {
    image(sim, name, camera, 3, ImageElement::U8, [0.0, 255.0], move |camera| {
        Ok(ImageBatch::U8(camera.color()?.slice_axis(Axis(3), Slice::from(..3)).to_owned()))
    })
}

/// Creates images with the depth of a camera \[m\], f32, clipped to `range` (nearest and farthest); a miss is the
/// farthest depth. The camera needs the channel `depth`.
///
/// # Errors
/// The range is not finite or not in order, or the camera does not see every environment.
///
/// # Panics
/// The camera belongs to another manager.
pub fn camera_depth(
    sim: &SimulationManager,
    name: &str,
    camera: SensorId<Camera>,
    range: [f32; 2],
) -> Result<ImageTerm> {
    let [near, far] = range;
    if !(near.is_finite() && far.is_finite() && near <= far) {
        let (field, value) = (format!("the range of the image term {name:?}"), format!("{near} to {far}"));
        return Err(EnvError::Config { field, value, expected: "both numbers must be finite, in order" });
    }
    image(sim, name, camera, 1, ImageElement::F32, range.map(f64::from), move |camera| {
        // With `DepthMiss::Zero` a miss is 0, which is no distance.
        let clip = |depth: f32| if depth > 0.0 { depth.clamp(near, far) } else { far };
        Ok(ImageBatch::F32(camera.depth()?.mapv(clip).insert_axis(Axis(3))))
    })
}

/// Creates images with the mask ids of a camera, i32; 0 where no surface was hit. The camera needs the channel `mask`.
///
/// # Errors
/// The camera does not see every environment.
///
/// # Panics
/// The camera belongs to another manager.
pub fn camera_mask(sim: &SimulationManager, name: &str, camera: SensorId<Camera>) -> Result<ImageTerm> {
    image(sim, name, camera, 1, ImageElement::I32, [0.0, f64::from(i32::MAX)], |camera| {
        Ok(ImageBatch::I32(camera.mask()?.to_owned().insert_axis(Axis(3))))
    })
}

/// Creates images of a camera that sees every environment. `read` returns those of all environments.
fn image(
    sim: &SimulationManager,
    name: &str,
    camera: SensorId<Camera>,
    components: usize,
    element: ImageElement,
    bounds: [f64; 2],
    read: impl Fn(&Camera) -> TermResult<ImageBatch> + Send + 'static,
) -> Result<ImageTerm> {
    let sensor = sim.sensor(camera)?;
    if sensor.env_ids().len() != sim.num_envs() {
        let (found, expected) = (vec![sensor.env_ids().len()], vec![sim.num_envs()]);
        let what = format!("the camera of the image term {name:?}");
        return Err(EnvError::Shape { what, found, expected, meaning: "environments that the camera sees" });
    }
    let (height, width) = sensor.image_shape();
    let space = ImageSpace { height, width, components, element, bounds };
    Ok(ImageTerm::new(name, space, move |now: &TermContext<'_>| read(now.sim().sensor(camera)?)))
}
