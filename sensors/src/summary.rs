//! Summaries of sensors, in the form of Isaac Lab: a title with the sensor's path, and one property per line.

use crate::sampling::Sampler;
use crate::sensor::SensorContext;
use std::fmt;

/// Labels and values of the properties of a sensor.
type Properties<'a> = [(&'a str, &'a dyn fmt::Display)];

/// Writes `title @ "path":` and the properties.
pub(crate) fn write(f: &mut fmt::Formatter<'_>, title: &str, path: &str, lines: &Properties<'_>) -> fmt::Result {
    write!(f, "{title} @ {path:?}:")?;
    lines.iter().try_for_each(|(label, value)| write!(f, "\n\t{label:<21}: {value}"))
}

/// Writes the summary of a sensor with a sampler; its path is its name.
pub(crate) fn write_sampled(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    sampler: &Sampler,
    lines: &Properties<'_>,
) -> fmt::Result {
    let shared: [(&str, &dyn fmt::Display); 3] = [
        ("update period (s)", &sampler.period()),
        ("history length", &sampler.history_length()),
        ("number of sensors", &sampler.num_envs()),
    ];
    let lines: Vec<_> = shared.into_iter().chain(lines.iter().copied()).collect();
    write(f, title, sampler.name(), &lines)
}

/// Returns the path of a sensor: `uid/link/name` on a body, else its name.
pub(crate) fn path(context: &SensorContext, parent: Option<usize>) -> String {
    match parent.and_then(|body| context.bodies.get(body)) {
        Some(body) => format!("{body}/{}", context.name),
        None => context.name.to_string(),
    }
}

/// Joins names with commas; `none` for an empty list.
pub(crate) fn list(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use crate::{ImuCfg, JointStateCfg, JointWrenchCfg, SamplingCfg, SensorCfg, SensorContext};

    #[test]
    fn summaries() {
        let context = SensorContext {
            num_envs: 3,
            dt: 0.005,
            bodies: ["arm/base".to_string(), "arm/tip".to_string()].into(),
            moving_bodies: [0, 1].into(),
            joints: ["arm/elbow".to_string()].into(),
            name: "mine".into(),
            ..SensorContext::default()
        };
        let sampling = SamplingCfg { update_period: 0.02, history_length: 4, ..SamplingCfg::default() };
        let imu = ImuCfg { sampling: sampling.clone(), ..ImuCfg::on("tip") };
        let imu = imu.build(&context).expect("good").to_string();
        let expected = [
            "Imu @ \"mine\":",
            "\tupdate period (s)    : 0.02",
            "\thistory length       : 4",
            "\tnumber of sensors    : 3",
        ];
        assert_eq!(imu.lines().take(4).collect::<Vec<_>>(), expected);
        assert_eq!(imu.lines().last(), Some("\tbody                 : arm/tip"));
        let wrench = JointWrenchCfg { links: vec!["tip".into()], sampling: sampling.clone(), ..Default::default() };
        let wrench = wrench.build(&context).expect("good").to_string();
        assert!(
            wrench.starts_with("Joint wrench @ \"mine\":\n") && wrench.ends_with("links                : arm/tip"),
            "{wrench}"
        );
        let joints = JointStateCfg { sampling, ..JointStateCfg::default() }.build(&context).expect("good").to_string();
        assert!(
            joints.starts_with("Joint state @ \"mine\":\n") && joints.ends_with("joints               : arm/elbow"),
            "{joints}"
        );
    }
}
