//! `check`, `convert`, `render`, `bench` and the help: what they print and write, and their exit codes.

use super::support::{ARM, Shell};

const PENDULUM: &str = r#"<mujoco><worldbody><body name="rod" pos="0 0 1">
  <joint name="pin" type="hinge" axis="0 1 0" range="-90 90" limited="true"/>
  <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.5" mass="1"/></body></worldbody></mujoco>"#;

#[test]
fn check() {
    let shell = Shell::with_arm();
    let out = shell.ok("check arm.urdf --qpos hinge=-0.5 --json arm.json");
    assert!(out.contains("total mass 2 kg") && out.contains("hinge"), "{out}");
    let json = std::fs::read_to_string(shell.path("arm.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    // The torque that holds 2 kg half a metre along the rod, 0.5 rad from upright, against gravity.
    let torque = report["gravity_torque"][0].as_f64().unwrap();
    assert!((torque - 2.0 * 9.81 * 0.5 * 0.5f64.sin()).abs() < 1e-9, "{torque}");

    // Principal moments: `[[a, b], [b, a]]` has the moments `a - b` and `a + b`.
    let turned = "ixx=\"0.1\" iyy=\"0.1\" izz=\"0.05\" ixy=\"0.02\"";
    shell.write("turned.urdf", &ARM.replace("ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\"", turned));
    let out = shell.ok("check turned.urdf");
    let mut after = out.lines().skip_while(|line| !line.contains("Principal moments"));
    assert!(after.next().is_some_and(|line| line.contains("kg m²")), "{out}");
    let row = after.find(|line| line.starts_with("rod")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
    assert_eq!(numbers, [0.05, 0.08, 0.12], "{row}");
}

/// Ignored settings are warnings, and the exit code is 1.
#[test]
fn check_warnings() {
    let shell = Shell::with(&[
        ("unlimited.urdf", &ARM.replace("effort=\"50\"", "effort=\"0\"")),
        // Its time step is not that of a scene.
        ("pendulum.xml", PENDULUM),
    ]);
    for (file, listed, warned) in [
        ("unlimited.urdf", ["hinge", ""], ["warning[effort-unlimited]", "9 |"]),
        ("pendulum.xml", ["pin", "-1.5708"], ["warning[setting-ignored]", "timestep"]),
    ] {
        let (out, err, code) = shell.run(&format!("check {file}"));
        assert!(code == 1 && listed.iter().all(|words| out.contains(words)), "{file}: {code} {out}");
        assert!(warned.iter().all(|words| err.contains(words)), "{file}: {err}");
    }
}

/// Departures from URDF are warnings with their lines, and errors with --strict; flags are called by their names.
#[test]
fn strict_and_packages() {
    let twice = "<material name=\"\"/><material name=\"\"/></visual>";
    let mesh = |uri: &str| ARM.replace("<box size=\"0.1 0.1 1\"/>", &format!("<mesh filename=\"{uri}\"/>"));
    let collides = |uri: &str| mesh(uri).replace("visual>", "collision>");
    let shell = Shell::with(&[
        ("arm.urdf", &ARM.replace("</visual>", twice)),
        ("pendulum.xml", PENDULUM),
        ("assets/cube/a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"),
        ("root.urdf", &collides("cube/a.obj")),
        ("package.urdf", &collides("package://cube/a.obj")),
        ("none.urdf", &collides("package://none/a.obj")),
    ]);
    let (_, err, code) = shell.run("check arm.urdf");
    assert!(code == 1 && err.contains("warning[element-repeated]") && err.contains("5 |"), "{code} {err}");
    shell.assert_refused(&[
        ("check arm.urdf --strict", "error: link \"rod\": a second <material>, the first is at arm.urdf:5"),
        ("render arm.urdf -o a.png --strict", "a second <material>"),
        ("check root.urdf", "does not exist"),
        ("check none.urdf --asset-root assets", "give its folder by --package NAME=DIR or ROS_PACKAGE_PATH"),
        ("check root.urdf --asset-root none", "none is no folder"),
        ("check pendulum.xml --strict", "--strict: pendulum.xml is an MJCF file"),
        ("check pendulum.xml --asset-root assets", "--asset-root: pendulum.xml is an MJCF file"),
    ]);
    for file in ["root.urdf", "package.urdf"] {
        shell.ok(&format!("check {file} --asset-root assets"));
    }
}

/// An error of a file is shown with its line, by every command that reads one.
#[test]
fn line_of_error() {
    let hinge = "type=\"hinge\" axis=\"0 1 0\" range=\"-90 90\" limited=\"true\"";
    let shell = Shell::with(&[
        ("unknown.xml", &PENDULUM.replace("size=", "sise=")),
        // A mass that the compiler refuses; a joint that robots do not have.
        ("mass.xml", &PENDULUM.replace("mass=\"1\"", "mass=\"-1\"")),
        ("ball.xml", &PENDULUM.replace(hinge, "type=\"ball\"")),
        ("arm.urdf", &ARM.replace("xyz=\"0 1 0\"", "xyz=\"0 x 0\"")),
    ]);
    for line in ["check", "view", "bench", "render -o a.png", "convert -o a.png"] {
        let err = shell.refused(&format!("{line} unknown.xml"));
        assert!(err.starts_with("error: ") && err.contains("unknown.xml:3"), "{line}: {err}");
        let lines: Vec<&str> = err.lines().collect();
        let at = lines.iter().position(|line| line.contains("3 |   <geom")).unwrap_or_else(|| panic!("{err}"));
        assert_eq!(lines[at + 1].find('^'), lines[at].find("sise"), "{line}: {err}");
    }
    for (place, text) in [("mass.xml:3", "3 |"), ("ball.xml:2", "2 |"), ("arm.urdf:8", "8 |     <parent")] {
        let err = shell.refused(&format!("check {}", place.split(':').next().unwrap()));
        assert!(err.starts_with("error: ") && err.contains(place), "{err}");
        assert!(err.contains(text) && err.contains('^'), "{err}");
    }
}

#[test]
fn convert() {
    let shell = Shell::with_arm();
    let out = shell.ok("convert arm.urdf -o out");
    assert!(out.lines().all(|file| shell.path(file).is_file()), "{out}");
    // MuJoCo reads what was written.
    let version = if kinetoscope::sim::mj::TARGET == kinetoscope::sim::mj::Target::V2 { "2" } else { "4" };
    let mjcf = format!("out/robot.mjcf{version}.xml");
    assert!(out.contains(&mjcf), "{out}");
    let (_, err, code) = shell.run(&format!("render {mjcf} -o a.png --width 64"));
    assert_eq!(code, 0, "{err}");
    let err = shell.refused("convert arm.urdf -o out");
    assert!(err.contains("not empty") && err.contains("--force"), "{err}");
    assert_eq!(shell.run("convert arm.urdf --force -o out").2, 0);
}

#[test]
fn render_channels() {
    let shell = Shell::with_arm();
    let images = ["color", "depth", "mask", "normal"].map(|channel| {
        let view = "--width 120 --height 80 --eye 3,0,0.5 --target 0,0,0.5";
        let (out, err, code) = shell.run(&format!("render arm.urdf -o arm.png --channel {channel} {view}"));
        assert!(code == 0 && out.contains("120 x 80"), "{out}{err}");
        let image = shell.image("arm.png");
        assert_eq!(image.dimensions(), (120, 80));
        assert_ne!(image.get_pixel(60, 40), image.get_pixel(5, 40), "{channel}: the rod is not in the middle");
        image
    });
    // 0.1 m at 2.95 m from the eye, 80 pixels for 45 degrees: 3.3 pixels, so 3 or 4 columns of the middle row.
    let ground = images[2].get_pixel(5, 40);
    let across = (0..120).filter(|&x| images[2].get_pixel(x, 40) != ground).count();
    assert!((3..=4).contains(&across), "{across}");
}

#[test]
fn bench() {
    let (out, err, code) = Shell::with_arm().run("bench arm.urdf --num-envs 3 --seconds 0.05 --width 64");
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

#[test]
fn refusals() {
    let shell = Shell::with(&[("arm.urdf", ARM), ("pendulum.xml", PENDULUM)]);
    shell.assert_refused(&[
        ("unknown", "unknown"),
        ("check no_such.urdf", "no such file"),
        ("check arm.urdf pendulum.xml", "MJCF file is a model of its own"),
        ("check arm.urdf --qpos hing=1", "hinge"),
        ("check pendulum.xml --qpos pi=1", "pin"),
        ("render arm.urdf -o a.gif", ".png"),
        ("render pendulum.xml -o a.png --camera no_such", "no_such"),
        ("render arm.urdf -o a.png --eye 1,2", "--eye"),
        ("render arm.urdf -o a.png --width 0", "0"),
        ("render arm.urdf -o a.png --renderer rt --samples 0", "0"),
        ("bench arm.urdf --num-envs 0", "num_envs"),
        ("bench arm.urdf --seconds nan", "--seconds"),
        ("convert arm.urdf", "--out"),
        ("view no_such.urdf", "no such file"),
        ("view", "FILE.urdf|FILE.xml"),
        ("view arm.urdf --speed 0", "1 is real time"),
        ("view arm.urdf --speed nan", "--speed"),
        ("view arm.urdf --num-envs 0", "num_envs"),
        ("view arm.urdf --serve robot:80", "127.0.0.1:80"),
    ]);
}

/// Every command, future ones included, has examples of its own and says what exit codes mean.
#[test]
fn help() {
    let shell = Shell::with(&[]);
    let out = shell.ok("--help");
    assert!(out.contains("kinetoscope check") && out.contains("Exit codes: 0"), "{out}");
    let listed = out.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() >= 8, "{commands:?}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        for flag in ["-h", "--help"] {
            let out = shell.ok(&format!("{command} {flag}"));
            let examples = out.lines().filter(|line| line.starts_with(&format!("  kinetoscope {command} "))).count();
            assert!(out.contains("Examples:") && examples >= 2, "{command} {flag}: {out}");
            assert!(out.contains("Exit codes: 0"), "{command} {flag}: {out}");
        }
    }
}
