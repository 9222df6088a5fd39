//! The commands as somebody types them: what they print, what they write, and how they end.

use super::support::{ARM, kinetoscope, said, write};
use std::path::Path;

const PENDULUM: &str = r#"<mujoco><worldbody><body name="rod" pos="0 0 1">
  <joint name="pin" type="hinge" axis="0 1 0" range="-90 90" limited="true"/>
  <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.5" mass="1"/></body></worldbody></mujoco>"#;

#[test]
fn check_lists_the_robot_and_ends_with_0() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let json = folder.path().join("arm.json");
    let (out, err, code) =
        said(&kinetoscope(&["check", &arm, "--qpos", "hinge=-0.5", "--json", json.to_str().unwrap()]));
    assert_eq!((err.as_str(), code), ("", 0));
    assert!(out.contains("total mass 2 kg") && out.contains("hinge"), "{out}");
    let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    // The torque that holds 2 kg half a metre along the rod, 0.5 rad from upright, against gravity.
    let torque = report["gravity_torque"][0].as_f64().unwrap();
    assert!((torque - 2.0 * 9.81 * 0.5 * 0.5f64.sin()).abs() < 1e-9, "{torque}");
}

/// A rod of which one axis is turned by an eighth of a turn: `[[a, b], [b, a]]` has the moments `a - b` and `a + b`.
#[test]
fn check_lists_principal_moments() {
    let folder = tempfile::tempdir().unwrap();
    let turned = "ixx=\"0.1\" iyy=\"0.1\" izz=\"0.05\" ixy=\"0.02\"";
    let arm = write(folder.path(), "arm.urdf", &ARM.replace("ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\"", turned));
    let (out, err, code) = said(&kinetoscope(&["check", &arm]));
    assert_eq!((err.as_str(), code), ("", 0));
    let mut after = out.lines().skip_while(|line| !line.contains("Principal moments"));
    assert!(after.next().is_some_and(|line| line.contains("kg m²")), "{out}");
    let row = after.find(|line| line.starts_with("rod")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
    assert_eq!(numbers, [0.05, 0.08, 0.12], "{row}");
}

/// What MuJoCo or a robot does not take of an MJCF file is shown in its line, by every command that reads one.
#[test]
fn an_error_of_an_mjcf_file_is_shown_in_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let bad = |name: &str, from: &str, to: &str| write(folder.path(), name, &PENDULUM.replace(from, to));
    let picture = folder.path().join("a.png");
    let picture = picture.to_str().unwrap();
    let unknown = bad("unknown.xml", "size=", "sise=");
    for args in [
        vec!["check", &unknown],
        vec!["view", &unknown],
        vec!["bench", &unknown],
        vec!["render", &unknown, "-o", picture],
        vec!["convert", &unknown, "-o", picture],
    ] {
        let (out, err, code) = said(&kinetoscope(&args));
        assert_eq!((out.as_str(), code), ("", 2), "{args:?}");
        assert!(err.starts_with("error: ") && err.contains("unknown.xml:3"), "{args:?}: {err}");
        let lines: Vec<&str> = err.lines().collect();
        let line = lines.iter().position(|line| line.contains("3 |   <geom")).unwrap_or_else(|| panic!("{err}"));
        assert_eq!(lines[line + 1].find('^'), lines[line].find("sise"), "{args:?}: {err}");
    }
    // A mass that the compiler refuses; a joint that robots do not have.
    for (name, from, to, line) in [
        ("mass.xml", "mass=\"1\"", "mass=\"-1\"", 3),
        ("ball.xml", "type=\"hinge\" axis=\"0 1 0\" range=\"-90 90\" limited=\"true\"", "type=\"ball\"", 2),
    ] {
        let (_, err, code) = said(&kinetoscope(&["check", &bad(name, from, to)]));
        assert!(code == 2 && err.contains(&format!("{name}:{line}")) && err.contains('^'), "{name}: {err}");
    }
}

#[test]
fn check_shows_the_line_of_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", &ARM.replace("xyz=\"0 1 0\"", "xyz=\"0 x 0\""));
    let (out, err, code) = said(&kinetoscope(&["check", &arm]));
    assert_eq!((out.as_str(), code), ("", 2));
    assert!(err.starts_with("error: ") && err.contains(&format!("{arm}:8")), "{err}");
    assert!(err.contains("8 |     <parent") && err.contains('^'), "{err}");
}

#[test]
fn check_ends_with_1_where_something_was_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", &ARM.replace("effort=\"50\"", "effort=\"0\""));
    let (out, err, code) = said(&kinetoscope(&["check", &arm]));
    assert!(out.contains("hinge"), "{out}");
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("warning[effort-unlimited]") && err.contains("9 |"), "{err}");
    let mjcf = write(folder.path(), "pendulum.xml", PENDULUM);
    let (out, err, code) = said(&kinetoscope(&["check", &mjcf]));
    assert!(out.contains("pin") && out.contains("-1.5708"), "{out}");
    // Its time step is not that of a scene.
    assert!(code == 1 && err.contains("warning[setting-ignored]") && err.contains("timestep"), "{code} {err}");
}

#[test]
fn convert_writes_what_it_says_and_nothing_over_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let to = folder.path().join("out");
    let (out, err, code) = said(&kinetoscope(&["convert", &arm, "-o", to.to_str().unwrap()]));
    assert_eq!(code, 0, "{err}");
    for file in out.lines() {
        assert!(Path::new(file).is_file(), "{file}");
    }
    // MuJoCo reads what was written.
    let name = if kinetoscope::sim::mj::TARGET == kinetoscope::sim::mj::Target::V2 { "2" } else { "4" };
    let mjcf = to.join(format!("robot.mjcf{name}.xml"));
    assert!(out.contains(mjcf.to_str().unwrap()), "{out}");
    let picture = folder.path().join("a.png");
    let (_, err, code) =
        said(&kinetoscope(&["render", mjcf.to_str().unwrap(), "-o", picture.to_str().unwrap(), "--width", "64"]));
    assert_eq!(code, 0, "{err}");
    let (_, err, code) = said(&kinetoscope(&["convert", &arm, "-o", to.to_str().unwrap()]));
    assert_eq!(code, 2);
    assert!(err.contains("not empty") && err.contains("--force"), "{err}");
    assert_eq!(said(&kinetoscope(&["convert", &arm, "--force", "-o", to.to_str().unwrap()])).2, 0);
}

#[test]
fn render_draws_each_channel() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let picture = folder.path().join("arm.png");
    let path = picture.to_str().unwrap();
    let mut pictures = Vec::new();
    for channel in ["color", "depth", "mask", "normal"] {
        let look = ["--width", "120", "--height", "80", "--eye", "3,0,0.5", "--target", "0,0,0.5"];
        let (out, err, code) =
            said(&kinetoscope(&[&["render", &arm, "-o", path, "--channel", channel], &look[..]].concat()));
        assert_eq!(code, 0, "{err}");
        assert!(out.contains("120 x 80"), "{out}");
        let image = image::open(&picture).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (120, 80));
        assert_ne!(image.get_pixel(60, 40), image.get_pixel(5, 40), "{channel}: the rod is not in the middle");
        pictures.push(image);
    }
    // 0.1 m at 2.95 m from the eye, 80 pixels for 45 degrees: 3.3 pixels, so 3 or 4 columns of the middle row.
    let ground = pictures[2].get_pixel(5, 40);
    let across = (0..120).filter(|&x| pictures[2].get_pixel(x, 40) != ground).count();
    assert!((3..=4).contains(&across), "{across}");
}

#[test]
fn bad_input_is_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let mjcf = write(folder.path(), "pendulum.xml", PENDULUM);
    let picture = folder.path().join("a.png");
    let picture = picture.to_str().unwrap();
    for (args, words) in [
        (vec!["check", "no_such.urdf"], "no such file"),
        (vec!["check", &arm, &mjcf], "MJCF file is a model of its own"),
        (vec!["check", &arm, "--qpos", "hing=1"], "hinge"),
        (vec!["check", &mjcf, "--qpos", "pi=1"], "pin"),
        (vec!["render", &arm, "-o", "a.gif"], ".png"),
        (vec!["render", &mjcf, "-o", picture, "--camera", "no_such"], "no_such"),
        (vec!["render", &arm, "-o", picture, "--eye", "1,2"], "--eye"),
        (vec!["render", &arm, "-o", picture, "--width", "0"], "0"),
        (vec!["render", &arm, "-o", picture, "--renderer", "rt", "--samples", "0"], "0"),
        (vec!["bench", &arm, "--num-envs", "0"], "num_envs"),
        (vec!["bench", &arm, "--seconds", "nan"], "--seconds"),
        (vec!["convert", &arm], "--out"),
        (vec!["unknown"], "unknown"),
    ] {
        let (out, err, code) = said(&kinetoscope(&args));
        assert_eq!(code, 2, "{args:?}: {out}{err}");
        assert!(err.contains(words), "{args:?}: {err}");
        assert!(!Path::new(picture).exists());
    }
}

#[test]
fn bench_measures() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let (out, err, code) =
        said(&kinetoscope(&["bench", &arm, "--num-envs", "3", "--seconds", "0.05", "--width", "64"]));
    assert_eq!(code, 0, "{err}");
    let rate = |words: &str| -> f64 {
        let line = out.lines().find(|line| line.contains(words)).unwrap_or_else(|| panic!("{words}: {out}"));
        line.split_whitespace().next().unwrap().parse().unwrap()
    };
    // Both are rounded to whole numbers.
    let (all, each) = (rate("environment steps per second"), rate("steps of all environments"));
    assert!((all - 3.0 * each).abs() <= 2.0 && each > 0.0, "{out}");
    assert!(rate("per second") > 0.0);
}

/// Every command, with those to come: examples that are of the command, and what exit codes mean.
#[test]
fn help_has_examples_and_exit_codes() {
    let help = |args: &[&str]| {
        let (out, err, code) = said(&kinetoscope(args));
        assert_eq!((err.as_str(), code), ("", 0), "{args:?}");
        out
    };
    let out = help(&["--help"]);
    assert!(out.contains("kinetoscope check") && out.contains("Exit codes: 0"), "{out}");
    let listed = out.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() >= 8, "{commands:?}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        for flag in ["-h", "--help"] {
            let out = help(&[command, flag]);
            let examples = out.lines().filter(|line| line.starts_with(&format!("  kinetoscope {command} "))).count();
            assert!(out.contains("Examples:") && examples >= 2, "{command} {flag}: {out}");
            assert!(out.contains("Exit codes: 0"), "{command} {flag}: {out}");
        }
    }
}
