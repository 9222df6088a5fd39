//! MuJoCo's own sample models, where the library's package brings them: each is a part of a scene.

use super::empty;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{self, Data, Model, TARGET, Target, words};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn models_below(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            models_below(&path, found);
        } else if path.extension().is_some_and(|e| e == "xml") {
            found.push(path);
        }
    }
}

/// The file with the options of [`empty`] behind its own: what MuJoCo makes of it without us.
fn plainly(file: &Path) -> Model {
    let flags = if TARGET == Target::V2 { r#"passive="enable""# } else { r#"spring="enable" damper="enable""# };
    let name = file.file_name().unwrap().to_str().unwrap();
    let text = format!(
        r#"<mujoco><include file="{name}"/>
        <option timestep="0.002" gravity="0 0 -9.81" wind="0 0 0" magnetic="0 -0.5 0" density="0" viscosity="0"
            integrator="Euler" cone="pyramidal" jacobian="auto" solver="Newton" iterations="100" tolerance="1e-8"
            impratio="1" noslip_iterations="0">
        <flag constraint="enable" equality="enable" frictionloss="enable" limit="enable" contact="enable" {flags}
            gravity="enable" actuation="enable"/></option></mujoco>"#
    );
    // Beside the file, so that its own includes and meshes are found; a copy of the folder, which is not ours.
    let dir = tempfile::tempdir().unwrap();
    copy(file.parent().unwrap(), dir.path());
    std::fs::write(dir.path().join("plainly.xml"), text).unwrap();
    mj::compile_file(&dir.path().join("plainly.xml")).unwrap().into_model()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() { copy(&entry.path(), &target) } else { drop(std::fs::copy(entry.path(), target)) }
    }
}

/// Largest difference of two rows, relative to the larger of 1 and their largest number.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let scale = a.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / scale
}

/// The sample models of Debian's package of 2.2.2.
const SAMPLES: [&str; 18] = [
    "adhesion/active_adhesion.xml",
    "composite/cloth.xml",
    "composite/grid2pin.xml",
    "composite/loop.xml",
    "composite/particle.xml",
    "composite/rope.xml",
    "composite/scene.xml",
    "composite/softbox.xml",
    "flag/flag.xml",
    "hammock/hammock.xml",
    "hammock/humanoid_body.xml",
    "humanoid/22_humanoids.xml",
    "humanoid/humanoid.xml",
    "humanoid100/humanoid100.xml",
    "humanoid100/humanoid_body.xml",
    "mug/mug.xml",
    "slider_crank/slider_crank.xml",
    "tendon_arm/arm26.xml",
];

/// Those of them that 4.x refuses, and its words for the reason: of most, the element that it does not know any more.
const REFUSED_BY_4: [(&str, &str); 10] = [
    ("adhesion/active_adhesion.xml", "Element 'composite', line 97"),
    ("composite/cloth.xml", "Element 'composite', line 27"),
    ("composite/grid2pin.xml", "Element 'composite', line 22"),
    ("composite/loop.xml", "Element 'composite', line 26"),
    ("composite/particle.xml", "Element 'composite', line 41"),
    ("composite/rope.xml", "Element 'composite', line 26"),
    ("composite/softbox.xml", "Element 'composite', line 30"),
    ("flag/flag.xml", "Element 'composite', line 34"),
    ("hammock/hammock.xml", "Element 'composite', line 52"),
    ("tendon_arm/arm26.xml", "Lengthrange computation did not converge in actuator 1"),
];

/// Mass, sizes and the motion of 100 steps are those of the file alone. Where the package brought no models the test says that
/// it was skipped; where it did, which of them are parts and which are refused, and why, is exactly known.
#[test]
fn every_sample_model_is_a_part_that_moves_as_the_file_alone() {
    let dir = Path::new("/usr/share/mujoco/model");
    if !dir.is_dir() {
        // Past the harness, which keeps what passing tests print.
        let _ = writeln!(std::io::stderr(), "SKIPPED: {} is not here, no sample model was loaded", dir.display());
        return;
    }
    let mut files = Vec::new();
    models_below(dir, &mut files);
    files.sort();
    let (mut moved, mut refused) = (Vec::new(), Vec::new());
    for file in &files {
        let name = file.strip_prefix(dir).unwrap().display().to_string();
        let mut sim = empty(1);
        let part = match sim.add_mjcf(MjcfCfg::file("part", file)) {
            Ok(part) => part,
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains(&name) && matches!(error, Error::MjcfFile { .. }), "{text}");
                refused.push((name, text));
                continue;
            }
        };
        let start = Instant::now();
        let plain = plainly(file);
        let model = sim.batch().model();
        assert_eq!(plain.option_differences(model), [], "{name}: the judge has other options");
        assert_eq!((model.nq(), model.nv(), model.nu()), (plain.nq(), plain.nv(), plain.nu()), "{name}");
        let mass = |m: &Model| m.body_mass().iter().sum::<f64>();
        assert!((mass(model) - mass(&plain)).abs() <= 1e-12 * mass(&plain), "{name}");
        assert!((sim.mjcf_part(part).total_mass() - mass(&plain)).abs() <= 1e-12 * mass(&plain), "{name}");
        // Many bodies that are all in contact take minutes; ten steps of them say as much.
        let steps = if plain.nv() > 400 { 10 } else { 100 };
        let controls = Array2::from_elem((1, plain.nu()), 0.2);
        sim.mjcf_part_mut(part).set_ctrl(&controls, None, None).unwrap();
        sim.update(steps);
        assert!(sim.diverged().is_empty(), "{name}: {:?}", sim.diverged());
        // Room enough for the same contacts: MuJoCo alone drops what has none.
        let buffers = sim.batch().read(0, |env| env.data().model().buffers());
        let mut data = Data::new(&plain.with_buffers(buffers)).unwrap();
        data.ctrl_mut().fill(0.2);
        for _ in 0..steps {
            data.step().unwrap();
            assert_eq!(data.take_warnings().overflow(), None, "{name}");
        }
        let (qpos, qvel) = (sim.mjcf_part(part).get_qpos(), sim.mjcf_part(part).get_qvel());
        let far = apart(data.qpos(), qpos.as_slice().unwrap()).max(apart(data.qvel(), qvel.as_slice().unwrap()));
        let travelled = apart(plain.qpos0(), data.qpos());
        println!(
            "{name}: nv {}, {far:.1e} after {steps} steps and {travelled:.1e}, {:.1?}",
            plain.nv(),
            start.elapsed()
        );
        moved.push((name, far, travelled, plain.nv()));
        let kinds: Vec<_> = (0..plain.nsensor()).map(|s| words::sensor(plain.sensor_type()[s])).collect();
        assert!(kinds.iter().all(Option::is_some));
    }
    println!("{} refused: {refused:#?}", refused.len());
    for (name, far, travelled, nv) in &moved {
        assert!(*far <= 1e-9, "{name} is {far} from the file alone");
        assert!(*travelled > 1e-6 || *nv == 0, "{name} does not move: {travelled}");
    }
    let expected: &[(&str, &str)] = if TARGET == Target::V2 { &[] } else { &REFUSED_BY_4 };
    let names: Vec<&str> = refused.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, expected.iter().map(|(name, _)| *name).collect::<Vec<_>>(), "refused: {refused:#?}");
    for ((_, text), (_, reason)) in refused.iter().zip(expected) {
        assert!(text.contains(reason), "{reason}: {text}");
    }
    let parts: Vec<&str> = moved.iter().map(|(name, ..)| name.as_str()).collect();
    let others = SAMPLES.iter().copied().filter(|name| !names.contains(name)).collect::<Vec<_>>();
    assert_eq!(parts, others, "models that are parts");
}
