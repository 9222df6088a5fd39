//! Topics and numbers of NumPy archives, by environment.

use super::{FieldSelector, RecordedTopic, TimeSeries};
use crate::error::Result;
use crate::recorded_arrays::RecordedArrays;
use serde_json::Value;

/// Names of the numbers of a pose.
const POSE: [&str; 7] = ["x", "y", "z", "qw", "qx", "qy", "qz"];

/// A field of a stream.
struct ArrayField<'a> {
    /// Name of the array.
    array: &'a str,
    /// Names of its numbers in an environment, in order.
    fields: Vec<String>,
    at_force_time: bool,
}

/// A stream, as described in `recording.json`.
struct RecordedStream<'a> {
    name: &'a str,
    env_ids: Vec<usize>,
    parts: Vec<ArrayField<'a>>,
}

fn streams(archive: &RecordedArrays) -> Vec<RecordedStream<'_>> {
    let all = archive.metadata["streams"].as_array().into_iter().flatten();
    all.filter_map(|stream| {
        let name = stream["name"].as_str()?;
        let columns = stream["columns"].as_array().into_iter().flatten();
        let columns: Vec<String> = columns.map(|of| of.as_str().unwrap_or_default().to_string()).collect();
        let envs = stream["env_ids"].as_array().into_iter().flatten().filter_map(Value::as_u64);
        let parts = stream["arrays"].as_array().into_iter().flatten().filter_map(|part| {
            // Arrays of images were not listed in the archive.
            let array = part["name"].as_str().filter(|array| archive.shape(array).is_some())?;
            // Uses the shape of the array, not the declared one.
            let shape = archive.shape(array)?.get(2..)?;
            let own = array.strip_prefix(name).unwrap_or(array).trim_start_matches('/');
            let at_force_time = part["of_forces"].as_bool().unwrap_or(false);
            Some(ArrayField { array, fields: fields(own, &columns, shape), at_force_time })
        });
        let env_ids = envs.filter_map(|env| usize::try_from(env).ok()).collect();
        Some(RecordedStream { name, env_ids, parts: parts.collect() })
    })
    .collect()
}

/// Names of the numbers of a field: by column if each column has one number (joints as in messages), poses by frame,
/// others by index.
fn fields(own: &str, columns: &[String], shape: &[usize]) -> Vec<String> {
    let named = match own {
        "positions" => "position",
        "velocities" => "velocity",
        "efforts" => "effort",
        "" => "value",
        other => other,
    };
    match shape {
        [count] if *count == columns.len() => columns.iter().map(|of| format!("{named}[{of}]")).collect(),
        [count, 7] if *count == columns.len() => {
            columns.iter().flat_map(|of| POSE.map(|number| format!("pose[{of}].{number}"))).collect()
        }
        shape => (0..shape.iter().product()).map(|k| format!("{named}[{k}]")).collect(),
    }
}

/// Lists the topics of an archive.
pub(super) fn topics(archive: &RecordedArrays) -> Result<Vec<RecordedTopic>> {
    let mut topics = Vec::new();
    for stream in streams(archive) {
        let count = archive.shape(&format!("{}/step", stream.name)).and_then(|shape| shape.first()).copied();
        let count =
            count.ok_or_else(|| archive.malformed(format!("the array {}/step is missing", stream.name)))? as u64;
        let fields: Vec<String> = stream.parts.iter().flat_map(|part| part.fields.iter().cloned()).collect();
        for env in &stream.env_ids {
            let kind = if fields.is_empty() { "images" } else { "numbers" };
            let name = format!("/env_{env}/{}", stream.name);
            topics.push(RecordedTopic { name, kind: kind.into(), count, fields: fields.clone() });
        }
    }
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(topics)
}

/// Reads the selected numbers. Skips rows in which an environment repeats its last time without an event, because they
/// have no new value.
pub(super) fn samples(archive: &RecordedArrays, wanted: &[FieldSelector]) -> Result<Vec<TimeSeries>> {
    let streams = streams(archive);
    let mut samples = Vec::with_capacity(wanted.len());
    for FieldSelector { topic, field } in wanted {
        let missing = || archive.malformed(format!("{topic} has no {field}"));
        let of_env = |stream: &RecordedStream<'_>| {
            stream.env_ids.iter().position(|env| *topic == format!("/env_{env}/{}", stream.name))
        };
        let (stream, row) = streams.iter().find_map(|stream| Some((stream, of_env(stream)?))).ok_or_else(missing)?;
        let place = |part: &ArrayField<'_>| part.fields.iter().position(|known| known == field);
        let (part, column) = stream.parts.iter().find_map(|part| Some((part, place(part)?))).ok_or_else(missing)?;
        let times = times(archive, stream, row, part.at_force_time)?;
        let mut found = TimeSeries::default();
        for (k, time) in times.into_iter().enumerate() {
            let Some(time) = time else { continue };
            let number = archive.rows(part.array, k)?.get((row, column)).copied().ok_or_else(missing)?;
            found.times.push(time);
            found.values.push(number);
        }
        samples.push(found);
    }
    Ok(samples)
}

/// Recorded times \[s\] of the rows of a stream in the environment `stream.env_ids[row]`, continuing over resets;
/// `None` for a row without a new value. `of_forces` selects `force_time`, if the archive contains it.
fn times(
    archive: &RecordedArrays,
    stream: &RecordedStream<'_>,
    row: usize,
    of_forces: bool,
) -> Result<Vec<Option<f64>>> {
    let forces = format!("{}/force_time", stream.name);
    let array = if of_forces && archive.shape(&forces).is_some() { forces } else { format!("{}/time", stream.name) };
    let steps = archive.steps(stream.name)?;
    let dt = archive.metadata["physics_dt"].as_f64().filter(|dt| *dt > 0.0);
    let dt = dt.ok_or_else(|| archive.malformed("it does not contain its time step".into()))?;
    let env = stream.env_ids.get(row).copied().unwrap_or_default();
    let column = |array: &str| -> Result<Vec<f64>> {
        (0..steps.len()).map(|k| Ok(archive.rows(array, k)?.get((row, 0)).copied().unwrap_or(f64::NAN))).collect()
    };
    let captured = column(&array)?;
    let Some((first, step)) = captured.first().zip(steps.first()) else { return Ok(Vec::new()) };
    // State rows begin at step 0, with an exact time. The first row of a sensor comes at a later step.
    let start = if *step == 0.0 { *first } else { first - step * dt };
    let events = archive.state_changes(env)?;
    let (mut offset, mut next, mut last) = (0.0, 0, None);
    let mut times = Vec::with_capacity(captured.len());
    for (&time, &step) in captured.iter().zip(steps) {
        let now = start + step * dt;
        while let Some((at, after)) = events.get(next) {
            // A row of the same step may precede the event and then has the time before it.
            let renewed = start + at * dt - after;
            let jumps = (after + offset - (start + at * dt)).abs() > 0.5 * dt;
            if *at > step || (*at == step && jumps && (time + offset - now).abs() <= 0.5 * dt) {
                break;
            }
            if jumps {
                offset = renewed;
                last = None;
            }
            next += 1;
        }
        let happened = || events.binary_search_by(|(at, _)| at.total_cmp(&step)).is_ok();
        let is_new = last != Some(time) || happened();
        times.push(is_new.then_some(time + offset));
        last = Some(time);
    }
    Ok(times)
}
