//! Values of sensors by channel name.

use crate::errors::{Class, Failure};
use crate::values::Values;
use kinetoscope::ndarray::{ArrayView, Dimension};
use kinetoscope::render::frame::Channel as _;
use kinetoscope::scene::pattern::closest_names;
use kinetoscope::sensors::camera::{Camera, StereoCamera};
use kinetoscope::sensors::ray::{RayCaster, RayCasterCamera};
use kinetoscope::sensors::{ContactSensor, FrameTransformer, JointWrench, Sampled, Sensor};
use std::any::Any;

/// Instant of the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Instant {
    /// The current measurement.
    Current,
    /// Past measurements, newest first, on the second axis.
    History,
    /// The latest delivered images of a camera.
    Delivered,
}

/// Names of all channels of a sensor.
pub(crate) fn names(sensor: &dyn Sensor) -> Vec<String> {
    let any: &dyn Any = sensor;
    if let Some(camera) = any.downcast_ref::<Camera>() {
        return owned(&camera.channels().names());
    }
    if let Some(camera) = any.downcast_ref::<StereoCamera>() {
        let side = |side: &str, camera: &Camera| -> Vec<String> {
            camera.channels().names().iter().map(|name| format!("{side}/{name}")).collect()
        };
        let disparity = camera.has_disparity().then(|| "disparity".to_string());
        return side("left", camera.left()).into_iter().chain(side("right", camera.right())).chain(disparity).collect();
    }
    if any.is::<RayCasterCamera>() {
        return owned(&["depth", "distance", "normal", "mask"]);
    }
    let mut names: Vec<String> = sensor.sampled().map_or_else(Vec::new, |sampled| {
        sampled.sampler().channels().filter(|channel| channel.width > 0).map(|channel| channel.name.into()).collect()
    });
    if any.is::<RayCaster>() {
        names.extend(owned(&["hits", "hit_mask", "ray_starts", "ray_directions"]));
    }
    if let Some(contact) = any.downcast_ref::<ContactSensor>()
        && contact.first_contact().is_some()
    {
        names.extend(owned(&["first_contact", "first_air"]));
    }
    names
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(ToString::to_string).collect()
}

/// Values of the channel `name` of a sensor.
pub(crate) fn values<'s>(sensor: &'s dyn Sensor, name: &str, instant: Instant) -> Result<Values<'s>, Failure> {
    let any: &dyn Any = sensor;
    let unknown = || {
        let known = names(sensor);
        if instant != Instant::Current && known.iter().any(|known| known == name) {
            let missing = if instant == Instant::History { "no history" } else { "no delivered images" };
            return Failure::new(Class::UnknownName, format!("the channel {name:?} of this sensor has {missing}"));
        }
        let candidates = closest_names(name, known.iter().map(String::as_str));
        let candidates: Vec<String> = candidates.into_iter().map(|name| format!("{name:?}")).collect();
        Failure::new(Class::UnknownName, format!("unknown channel {name:?}; known channels: {}", candidates.join(", ")))
    };
    if let Some(camera) = any.downcast_ref::<Camera>() {
        return image(camera, name, instant)?.ok_or_else(unknown);
    }
    if let Some(camera) = any.downcast_ref::<StereoCamera>() {
        let side = match name.split_once('/') {
            Some(("left", channel)) => image(camera.left(), channel, instant)?,
            Some(("right", channel)) => image(camera.right(), channel, instant)?,
            _ if name == "disparity" && instant == Instant::Current && camera.has_disparity() => {
                Some(camera.disparity()?.into())
            }
            _ if name == "disparity" && instant == Instant::Delivered && camera.has_disparity() => {
                Some(camera.latest_delivered_disparity()?.into())
            }
            _ => None,
        };
        return side.ok_or_else(unknown);
    }
    if let Some(camera) = any.downcast_ref::<RayCasterCamera>() {
        return match (name, instant) {
            ("depth" | "distance_to_image_plane", Instant::Current) => Ok(camera.depth().into()),
            ("distance" | "distance_to_camera", Instant::Current) => Ok(camera.distance().into()),
            ("distance" | "distance_to_camera", Instant::History) => Ok(camera.distance_history().into()),
            ("normal" | "normals", Instant::Current) => Ok(camera.normal().into()),
            ("mask", Instant::Current) => Ok(camera.mask().into()),
            _ => Err(unknown()),
        };
    }
    if let Some(caster) = any.downcast_ref::<RayCaster>()
        && instant == Instant::Current
    {
        match name {
            "hits" => return Ok(caster.hits().into()),
            "hit_mask" => return Ok(caster.hit_mask().into()),
            "ids" => return Ok(caster.hit_ids().into()),
            "ray_starts" => return Ok(caster.ray_starts().into()),
            "ray_directions" => return Ok(caster.ray_directions().into()),
            _ => {}
        }
    }
    if let Some(contact) = any.downcast_ref::<ContactSensor>()
        && instant == Instant::Current
    {
        let event = match name {
            "first_contact" => contact.first_contact(),
            "first_air" => contact.first_air(),
            _ => None,
        };
        if let Some(event) = event {
            return Ok(event.into());
        }
    }
    let sampled = sensor.sampled().ok_or_else(unknown)?;
    let known = sampled.sampler().channels().any(|channel| channel.name == name && channel.width > 0);
    if !known {
        return Err(unknown());
    }
    let items = axes_of(any, sampled, name, sampled.sampler().values(name).ncols());
    let sampler = sampled.sampler();
    let shape = |leading: &[usize]| leading.iter().chain(&items).copied().collect();
    let (envs, past) = (sampler.num_envs(), sampler.history_length());
    Ok(match instant {
        Instant::Current => shaped(sampler.values(name), shape(&[envs])),
        Instant::History => shaped(sampler.history(name), shape(&[envs, past])),
        Instant::Delivered => return Err(unknown()),
    })
}

/// Images of a channel of a camera; `None` if the camera does not have it.
fn image<'s>(camera: &'s Camera, name: &str, instant: Instant) -> Result<Option<Values<'s>>, Failure> {
    macro_rules! by_name {
        ($($(#[$doc:meta])* $module:ident :: $Channel:ident,)*) => {{
            use kinetoscope::render::frame;
            $(if (name == frame::$Channel::NAME || frame::$Channel::ALIASES.contains(&name))
                && camera.channels().has::<frame::$Channel>()
            {
                return Ok(Some(match instant {
                    Instant::Current => camera.channel::<frame::$Channel>()?.into(),
                    Instant::History => camera.history::<frame::$Channel>()?.into(),
                    Instant::Delivered => camera.latest_delivered::<frame::$Channel>()?.into(),
                }));
            })*
        }};
    }
    kinetoscope::render::with_channels!(by_name);
    Ok(None)
}

/// Axes of a channel after the environments: one per kind of item, and one of the components of an item.
fn axes_of(sensor: &dyn Any, sampled: &dyn Sampled, name: &str, width: usize) -> Vec<usize> {
    let items = sampled.columns().len();
    let axes = |first: &[usize]| {
        let count: usize = first.iter().product();
        let components = width.checked_div(count).unwrap_or(0);
        let components = if components == 1 { None } else { Some(components) };
        first.iter().copied().chain(components).collect::<Vec<usize>>()
    };
    if sensor.is::<ContactSensor>() {
        return if name.contains("matrix") { axes(&[items, sampled.filters().len()]) } else { axes(&[items]) };
    }
    if sensor.is::<JointWrench>() || (sensor.is::<FrameTransformer>() && name.starts_with("target_")) {
        return axes(&[items]);
    }
    if sensor.is::<RayCaster>() && name == "normals" {
        return vec![width / 3, 3];
    }
    vec![width]
}

/// Values in a shape with the same number of values.
fn shaped<'s, D: Dimension>(values: ArrayView<'s, f64, D>, shape: Vec<usize>) -> Values<'s> {
    let values = values.into_dyn();
    // The buffers of samplers are contiguous, and `axes` divides the width.
    match values.clone().into_shape_with_order(shape) {
        Ok(shaped) => shaped.into(),
        Err(_) => values.into(),
    }
}
