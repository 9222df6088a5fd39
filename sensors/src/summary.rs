//! What a sensor is, in a few lines: the same for all that have a [`Sampler`].

use crate::sampling::Sampler;
use std::fmt;

/// Writes a title, what all of them have, and lines of a label and what it says.
pub(crate) fn write(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    sampler: &Sampler,
    lines: &[(&str, &dyn fmt::Display)],
) -> fmt::Result {
    let shared: [(&str, &dyn fmt::Display); 3] = [
        ("environments", &sampler.num_envs()),
        ("update period (s)", &sampler.period()),
        ("history length", &sampler.history_length()),
    ];
    f.write_str(title)?;
    for (label, value) in shared.iter().chain(lines) {
        write!(f, "\n  {label:<17}: {value}")?;
    }
    Ok(())
}

/// Names beside each other.
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
            carriers: [0, 1].into(),
            joints: ["arm/elbow".to_string()].into(),
            ..SensorContext::default()
        };
        let sampling = SamplingCfg { update_period: 0.02, history_length: 4, ..SamplingCfg::default() };
        let imu = ImuCfg { sampling: sampling.clone(), ..ImuCfg::on("tip") };
        let imu = imu.build(&context).expect("good").to_string();
        let expected = ["Imu", "  environments     : 3", "  update period (s): 0.02", "  history length   : 4"];
        assert_eq!(imu.lines().take(4).collect::<Vec<_>>(), expected);
        assert_eq!(imu.lines().last(), Some("  body             : arm/tip"));
        let wrench = JointWrenchCfg { links: vec!["tip".into()], sampling: sampling.clone(), ..Default::default() };
        let wrench = wrench.build(&context).expect("good").to_string();
        assert!(wrench.starts_with("Joint wrench\n") && wrench.ends_with("links            : arm/tip"), "{wrench}");
        let joints = JointStateCfg { sampling, ..JointStateCfg::default() }.build(&context).expect("good").to_string();
        assert!(joints.starts_with("Joint state\n") && joints.ends_with("joints           : arm/elbow"), "{joints}");
    }
}
