//! MuJoCo's own sample models, each as a part of a scene.

use super::*;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion, mjcf_keywords};
use kinetoscope::ndarray::Array2;
use kinetoscope::sim::Error;
use kinetoscope_testkit::test_resources::{files_below, sample_model};
use std::path::Path;

/// The file compiled by MuJoCo alone, with the options of [`empty`] after its own.
fn compiled_alone(file: &Path) -> Model {
    let flags = if BUILD_VERSION == SupportedVersion::V2 {
        r#"passive="enable""#
    } else {
        r#"spring="enable" damper="enable""#
    };
    let name = file.file_name().unwrap().to_str().unwrap();
    let text = format!(
        r#"<mujoco><include file="{name}"/>
        <option timestep="0.002" gravity="0 0 -9.81" wind="0 0 0" magnetic="0 -0.5 0" density="0" viscosity="0"
            integrator="Euler" cone="pyramidal" jacobian="auto" solver="Newton" iterations="100" tolerance="1e-8"
            impratio="1" noslip_iterations="0">
        <flag constraint="enable" equality="enable" frictionloss="enable" limit="enable" contact="enable" {flags}
            gravity="enable" actuation="enable"/></option></mujoco>"#
    );
    // In a copy of the file's folder, so that its includes and meshes are found and the original folder is not
    // modified.
    let dir = tempfile::tempdir().unwrap();
    copy(file.parent().unwrap(), dir.path());
    std::fs::write(dir.path().join("plainly.xml"), text).unwrap();
    mj::compile_file(dir.path().join("plainly.xml")).unwrap().into_model()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() { copy(&entry.path(), &target) } else { drop(std::fs::copy(entry.path(), target)) }
    }
}

/// Largest difference between two rows, relative to the larger of 1 and their largest number.
fn relative_difference(a: &[f64], b: &[f64]) -> f64 {
    let scale = a.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / scale
}

/// The sample models of Debian's package of 2.2.2, and the error text of 4.x for models that it refuses.
const SAMPLES: [(&str, &str); 18] = [
    ("adhesion/active_adhesion.xml", "Element 'composite', line 97"),
    ("composite/cloth.xml", "Element 'composite', line 27"),
    ("composite/grid2pin.xml", "Element 'composite', line 22"),
    ("composite/loop.xml", "Element 'composite', line 26"),
    ("composite/particle.xml", "Element 'composite', line 41"),
    ("composite/rope.xml", "Element 'composite', line 26"),
    ("composite/scene.xml", ""),
    ("composite/softbox.xml", "Element 'composite', line 30"),
    ("flag/flag.xml", "Element 'composite', line 34"),
    ("hammock/hammock.xml", "Element 'composite', line 52"),
    ("hammock/humanoid_body.xml", ""),
    ("humanoid/22_humanoids.xml", ""),
    ("humanoid/humanoid.xml", ""),
    ("humanoid100/humanoid100.xml", ""),
    ("humanoid100/humanoid_body.xml", ""),
    ("mug/mug.xml", ""),
    ("slider_crank/slider_crank.xml", ""),
    ("tendon_arm/arm26.xml", "Lengthrange computation did not converge in actuator 1"),
];

/// Mass, sizes and the motion of 100 steps equal those of the file alone. The test lists the accepted models and, for
/// each refused model, the reason.
#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn every_sample() {
    let dir = sample_model("");
    let files = files_below(&dir, "xml");
    let (mut parts, mut refused) = (Vec::new(), Vec::new());
    for file in &files {
        let name = file.strip_prefix(&dir).unwrap().display().to_string();
        let mut sim = empty(1);
        let part = match sim.add_mjcf(MjcfPartCfg::file("part", file)) {
            Ok(part) => part,
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains(&name) && matches!(error, Error::MjcfFile { .. }), "{text}");
                refused.push((name, text));
                continue;
            }
        };
        let plain = compiled_alone(file);
        let model = sim.batch().model();
        assert_eq!(plain.option_differences(model), [], "{name}: the reference has other options");
        assert_eq!((model.nq(), model.nv(), model.nu()), (plain.nq(), plain.nv(), plain.nu()), "{name}");
        let mass = |m: &Model| m.body_mass().iter().sum::<f64>();
        for found in [mass(model), sim.mjcf_part(part).total_mass()] {
            assert!((found - mass(&plain)).abs() <= 1e-12 * mass(&plain), "{name}: {found}");
        }
        // Models with many bodies in contact take minutes, so they run for ten steps only.
        let steps = if plain.nv() > 400 { 10 } else { 100 };
        let controls = Array2::from_elem((1, plain.nu()), 0.2);
        sim.mjcf_part_mut(part).set_ctrl(&controls, None, None).unwrap();
        sim.update(steps);
        assert!(sim.diverged().is_empty(), "{name}: {:?}", sim.diverged());
        let mut data = data_of(&sim, &plain, controls.as_slice().unwrap());
        for _ in 0..steps {
            data.step().unwrap();
            assert_eq!(data.take_warnings().overflow(), None, "{name}");
        }
        let (qpos, qvel) = (sim.mjcf_part(part).qpos(), sim.mjcf_part(part).qvel());
        let far = relative_difference(data.qpos(), qpos.as_slice().unwrap())
            .max(relative_difference(data.qvel(), qvel.as_slice().unwrap()));
        let distance = relative_difference(plain.qpos0(), data.qpos());
        assert!(far <= 1e-9, "{name} is {far} from the file alone after {steps} steps");
        assert!(distance > 1e-6 || plain.nv() == 0, "{name} does not move: {distance}");
        assert!((0..plain.nsensor()).all(|s| mjcf_keywords::sensor(plain.sensor_type()[s]).is_some()), "{name}");
        parts.push(name);
    }
    let (good, bad): (Vec<_>, Vec<_>) =
        SAMPLES.into_iter().partition(|(_, reason)| BUILD_VERSION == SupportedVersion::V2 || reason.is_empty());
    assert_eq!(parts, good.iter().map(|(name, _)| *name).collect::<Vec<_>>(), "models that are parts");
    let names: Vec<&str> = refused.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, bad.iter().map(|(name, _)| *name).collect::<Vec<_>>(), "refused: {refused:#?}");
    for ((_, text), (_, reason)) in refused.iter().zip(bad) {
        assert!(text.contains(reason), "{reason}: {text}");
    }
}
