//! Output and exit codes of `check`, `convert`, `render`, `bench` and the help.

use super::support::{ARM, CommandFolder};
use super::view::SCENE;

const PENDULUM: &str = r#"<mujoco><worldbody><body name="rod" pos="0 0 1">
  <joint name="pin" type="hinge" axis="0 1 0" range="-90 90" limited="true"/>
  <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.5" mass="1"/></body></worldbody></mujoco>"#;

#[test]
fn check() {
    let shell = CommandFolder::with_arm();
    let out = shell.run_ok("check arm.urdf --qpos hinge=-0.5 --json arm.json");
    assert!(out.contains("total mass 2 kg") && out.contains("hinge"), "{out}");
    let json = std::fs::read_to_string(shell.path("arm.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    // Torque that holds 2 kg, half a meter along the rod and 0.5 rad from upright, against gravity.
    let torque = report["gravity_torque"][0].as_f64().unwrap();
    assert!((torque - 2.0 * 9.81 * 0.5 * 0.5f64.sin()).abs() < 1e-9, "{torque}");

    // Principal moments: `[[a, b], [b, a]]` has the moments `a - b` and `a + b`.
    let turned = "ixx=\"0.1\" iyy=\"0.1\" izz=\"0.05\" ixy=\"0.02\"";
    shell.write("turned.urdf", &ARM.replace("ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\"", turned));
    let out = shell.run_ok("check turned.urdf");
    let mut after = out.lines().skip_while(|line| !line.contains("Principal moments"));
    assert!(after.next().is_some_and(|line| line.contains("kg m²")), "{out}");
    let row = after.find(|line| line.starts_with("rod")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
    assert_eq!(numbers, [0.05, 0.08, 0.12], "{row}");
}

/// Ignored settings are warnings, with exit code 1. The time step and the friction cone of an MJCF file apply.
///
/// Regression: an MJCF file was stepped with the time step of simulations, 0.01 s, with a warning.
#[test]
fn check_warnings() {
    let shell = CommandFolder::with(&[
        ("unlimited.urdf", &ARM.replace("effort=\"50\"", "effort=\"0\"")),
        ("pendulum.xml", PENDULUM),
        // Robots are not stepped with RK4.
        (
            "rk4.xml",
            &PENDULUM.replacen(
                "<mujoco>",
                "<mujoco><option integrator=\"RK4\" timestep=\"0.0005\" cone=\"elliptic\" gravity=\"0 0 -1\"/>",
                1,
            ),
        ),
    ]);
    shell.run_ok("check pendulum.xml");
    let (_, err, _) = shell.run("check rk4.xml");
    let (out, ..) = shell.run("bench rk4.xml --num-envs 1 --seconds 0.05 --width 32");
    assert!(out.contains("0.0005 s") || out.contains("0.5 ms"), "{out}");
    // Values that a simulation does not accept are not used, with a warning.
    shell.write("odd.xml", &PENDULUM.replacen("<mujoco>", "<mujoco><option iterations=\"0\"/>", 1));
    let (_, odd, code) = shell.run("check odd.xml");
    assert!(code == 1 && odd.contains("option iterations is 0"), "{code} {odd}");
    assert!(!["timestep", "cone", "gravity"].iter().any(|setting| err.contains(&format!("option {setting}"))), "{err}");
    for (file, listed, warned) in [
        ("unlimited.urdf", ["hinge", ""], ["warning[effort-unlimited]", "9 |"]),
        ("rk4.xml", ["pin", "-1.5708"], ["warning[setting-ignored]", "integrator"]),
    ] {
        let (out, err, code) = shell.run(&format!("check {file}"));
        assert!(code == 1 && listed.iter().all(|words| out.contains(words)), "{file}: {code} {out}");
        assert!(warned.iter().all(|words| err.contains(words)), "{file}: {err}");
    }
}

/// Deviations from URDF are warnings with their lines, and errors with --strict; messages name the flags.
#[test]
fn strict_and_packages() {
    let twice = "<material name=\"\"/><material name=\"\"/></visual>";
    let mesh = |uri: &str| ARM.replace("<box size=\"0.1 0.1 1\"/>", &format!("<mesh filename=\"{uri}\"/>"));
    let collides = |uri: &str| mesh(uri).replace("visual>", "collision>");
    let shell = CommandFolder::with(&[
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
        ("check none.urdf --asset-root assets", "set its folder with --package NAME=DIR or ROS_PACKAGE_PATH"),
        ("check root.urdf --asset-root none", "none is not a folder"),
        ("check pendulum.xml --strict", "--strict: pendulum.xml is an MJCF file"),
        ("check pendulum.xml --asset-root assets", "--asset-root: pendulum.xml is an MJCF file"),
    ]);
    for file in ["root.urdf", "package.urdf"] {
        shell.run_ok(&format!("check {file} --asset-root assets"));
    }
}

/// Every command that reads a file shows the line of an error in it.
#[test]
fn line_of_error() {
    let hinge = "type=\"hinge\" axis=\"0 1 0\" range=\"-90 90\" limited=\"true\"";
    let shell = CommandFolder::with(&[
        ("unknown.xml", &PENDULUM.replace("size=", "sise=")),
        // A mass that the MuJoCo compiler rejects.
        ("mass.xml", &PENDULUM.replace("mass=\"1\"", "mass=\"-1\"")),
        // An attribute that ball joints do not have.
        ("ball.xml", &PENDULUM.replace(hinge, "type=\"ball\" no_such=\"1\"")),
        ("arm.urdf", &ARM.replace("xyz=\"0 1 0\"", "xyz=\"0 x 0\"")),
    ]);
    for line in ["check", "view", "bench", "render -o a.png", "convert -o a.png"] {
        let err = shell.run_refused(&format!("{line} unknown.xml"));
        assert!(err.starts_with("error: ") && err.contains("unknown.xml:3"), "{line}: {err}");
        let lines: Vec<&str> = err.lines().collect();
        let at = lines.iter().position(|line| line.contains("3 |   <geom")).unwrap_or_else(|| panic!("{err}"));
        assert_eq!(lines[at + 1].find('^'), lines[at].find("sise"), "{line}: {err}");
    }
    for (place, text) in [("mass.xml:3", "3 |"), ("ball.xml:2", "2 |"), ("arm.urdf:8", "8 |     <parent")] {
        let err = shell.run_refused(&format!("check {}", place.split(':').next().unwrap()));
        assert!(err.starts_with("error: ") && err.contains(place), "{err}");
        assert!(err.contains(text) && err.contains('^'), "{err}");
    }
}

#[test]
fn convert() {
    let shell = CommandFolder::with_arm();
    let out = shell.run_ok("convert arm.urdf -o out");
    assert!(out.lines().all(|file| shell.path(file).is_file()), "{out}");
    // MuJoCo loads the written file.
    let version =
        if kinetoscope::mujoco::BUILD_VERSION == kinetoscope::mujoco::SupportedVersion::V2 { "2" } else { "4" };
    let mjcf = format!("out/robot.mjcf{version}.xml");
    assert!(out.contains(&mjcf), "{out}");
    let (_, err, code) = shell.run(&format!("render {mjcf} -o a.png --width 64"));
    assert_eq!(code, 0, "{err}");
    let err = shell.run_refused("convert arm.urdf -o out");
    assert!(err.contains("not empty") && err.contains("--force"), "{err}");
    assert_eq!(shell.run("convert arm.urdf --force -o out").2, 0);
}

#[test]
fn render_channels() {
    let shell = CommandFolder::with_arm();
    let images = ["color", "depth", "mask", "normal"].map(|channel| {
        let view = "--width 120 --height 80 --eye 3,0,0.5 --target 0,0,0.5";
        let (out, err, code) = shell.run(&format!("render arm.urdf -o arm.png --channel {channel} {view}"));
        assert!(code == 0 && out.contains("120 x 80"), "{out}{err}");
        let image = shell.image("arm.png");
        assert_eq!(image.dimensions(), (120, 80));
        assert_ne!(image.get_pixel(60, 40), image.get_pixel(5, 40), "{channel}: the rod is not in the middle");
        image
    });
    // 0.1 m at 2.95 m from the camera, with 80 pixels for 45 degrees, are 3.3 pixels: 3 or 4 columns of the middle row.
    let ground = images[2].get_pixel(5, 40);
    let across = (0..120).filter(|&x| images[2].get_pixel(x, 40) != ground).count();
    assert!((3..=4).contains(&across), "{across}");
}

#[test]
fn bench() {
    let (out, err, code) = CommandFolder::with_arm().run("bench arm.urdf --num-envs 3 --seconds 0.05 --width 64");
    assert_eq!(code, 0, "{err}");
    let rate = |words: &str| -> f64 {
        let line = out.lines().find(|line| line.contains(words)).unwrap_or_else(|| panic!("{words}: {out}"));
        line.split_whitespace().next().unwrap().parse().unwrap()
    };
    // Both rates are rounded to integers.
    let (all, each) = (rate("environment steps per second"), rate("steps of all environments"));
    assert!((all - 3.0 * each).abs() <= 2.0 && each > 0.0, "{out}");
    assert!(rate("per second") > 0.0);
}

#[test]
fn refusals() {
    let shell = CommandFolder::with(&[
        ("arm.urdf", ARM),
        ("pendulum.xml", PENDULUM),
        ("scene.toml", "[entities.arm]\ntype = \"robot\"\nurdf = \"arm.urdf\"\n"),
        ("broken.toml", "[entities.arm]\ntype = \"robott\"\n"),
        ("image.png", "\u{89}PNG"),
        ("mesh.stl", "solid"),
        ("run.mcap", ""),
    ]);
    shell.assert_refused(&[
        ("unknown", "unknown"),
        ("check no_such.urdf", "no such file"),
        ("check arm.urdf pendulum.xml", "an MJCF file is a complete model: give it alone"),
        ("check arm.urdf scene.toml", "a scene file is a complete scene: give it alone"),
        ("check scene.toml --qpos hinge=1", "--qpos hinge"),
        ("check scene.toml --package a=.", "--package a"),
        ("bench scene.toml --floating-base", "--floating-base"),
        ("bench scene.toml --spawn-height 1", "--spawn-height"),
        ("bench arm.urdf --spawn-height nan", "--spawn-height NaN"),
        ("view image.png", "image.png is an image; this command takes URDF files"),
        ("render mesh.stl -o a.png", "mesh.stl is a mesh; this command takes URDF files"),
        ("bench run.mcap", "run.mcap is a recording; this command takes URDF files"),
        ("render broken.toml -o a.png", "broken.toml:2"),
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

/// Every command, including future ones, has examples of its own and explains its exit codes.
#[test]
fn help() {
    let shell = CommandFolder::with(&[]);
    let out = shell.run_ok("--help");
    assert!(out.contains("kinetoscope check") && out.contains("Exit codes: 0"), "{out}");
    let listed = out.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() >= 8, "{commands:?}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        for flag in ["-h", "--help"] {
            let out = shell.run_ok(&format!("{command} {flag}"));
            let examples = out.lines().filter(|line| line.starts_with(&format!("  kinetoscope {command} "))).count();
            assert!(out.contains("Examples:") && examples >= 2, "{command} {flag}: {out}");
            assert!(out.contains("Exit codes: 0"), "{command} {flag}: {out}");
        }
    }
}

/// A box of 1 kg with its origin at the center, and a leg below.
const BOX: &str = r#"<robot name="box"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><box size="0.4 0.4 0.2"/></geometry></visual>
  <collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link>
  <link name="leg"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.25"/><geometry><cylinder radius="0.05" length="0.5"/></geometry></collision></link>
  <joint name="hip" type="revolute"><parent link="body"/><child link="leg"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="1"/></joint></robot>"#;

/// A robot on a free base starts on the ground; a robot fixed below the ground is reported with its depth and flags.
///
/// Cause: the root link was placed at height 0 regardless of lower links, so legged robots started inside the ground.
#[test]
fn starts_on_the_ground() {
    let shell = CommandFolder::with(&[("box.urdf", BOX)]);
    // The leg ends 0.5 m below the root link.
    let start = |flags: &str| -> f64 {
        let line =
            format!("view box.urdf {flags} --serve 127.0.0.1:0 --speed 1000 --steps 1 --record a.mcap --overwrite");
        let (out, err, code) = shell.run(&line);
        assert_eq!(code, 0, "{line}: {out}{err}");
        let scene = kinetoscope::record::Recording::open(shell.path("a.mcap")).unwrap();
        let (mut playback, mut sim) = kinetoscope::record::Playback::open(&scene, None).unwrap();
        playback.seek(&mut sim, 0).unwrap();
        // A recorded scene is a single MJCF entity.
        let part = sim.mjcf_part(sim.entities().mjcf_id("scene").unwrap());
        part.body_pose("robot/body").unwrap()[(0, 2)]
    };
    for (flags, height) in
        [("--floating-base", 0.5), ("--floating-base --spawn-height 0.25", 0.75), ("--spawn-height 1", 1.5)]
    {
        let found = start(flags);
        assert!((found - height).abs() < 1e-9, "{flags}: {found}");
    }
    let bench = "bench box.urdf --num-envs 1 --seconds 0.01 --width 64";
    let (_, err, code) = shell.run(bench);
    assert_eq!(code, 1, "{err}");
    for words in ["\"leg\"", "0.500 m below the ground", "--spawn-height 0", "--floating-base", "--no-ground"] {
        assert!(err.contains(words), "{words}: {err}");
    }
    for flag in ["--spawn-height 0", "--no-ground", "--floating-base"] {
        shell.run_ok(&format!("{bench} {flag}"));
    }
}

/// A robot below an empty root link with a floating joint stands on the ground, with and without `--floating-base`. A
/// real base with a floating payload (the control) stays fixed.
///
/// Regression: it started in the ground with the advice to use `--floating-base`, which added a second free joint to
/// the empty link, and the simulation diverged.
#[test]
fn floating_joint_of_the_file() {
    let empty = BOX.replacen("<link name=\"body\">", "<link name=\"root\"/><link name=\"body\">", 1);
    let joint = |parent: &str, child: &str| {
        format!(
            "<joint name=\"free\" type=\"floating\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint></robot>"
        )
    };
    let floating = empty.replace("</robot>", &joint("root", "body"));
    let inertial = "<inertial><mass value=\"1\"/><inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\"/></inertial>";
    let payload = BOX.replace("</robot>", &format!("<link name=\"load\">{inertial}</link>{}", joint("body", "load")));
    let shell = CommandFolder::with(&[("floating.urdf", &floating), ("payload.urdf", &payload)]);
    for flag in ["", "--floating-base"] {
        let (_, err, _) = shell.run(&format!("bench floating.urdf {flag} --num-envs 1 --seconds 0.05 --width 64"));
        assert!(!err.contains("below the ground") && !err.contains("diverged"), "{flag}: {err}");
        let (_, err, code) = shell.run(&format!("check floating.urdf {flag}"));
        assert!(code < 2, "{flag}: {err}");
    }
    let (_, err, _) = shell.run("bench payload.urdf --num-envs 1 --seconds 0.05 --width 64");
    assert!(err.contains("\"leg\" starts 0.500 m below the ground"), "{err}");
}

/// An image without a shape in view is reported; an MJCF file is rendered as it is, so `--floating-base` is refused.
#[test]
fn empty_images() {
    let nothing = "<mujoco><worldbody><light pos='0 0 1'/></worldbody></mujoco>";
    let shell = CommandFolder::with(&[("nothing.xml", nothing), ("pendulum.xml", PENDULUM)]);
    let (_, err, code) = shell.run("render nothing.xml -o a.png --width 32 --height 32");
    assert!(code == 1 && err.contains("the image shows only the background"), "{code} {err}");
    shell.run_ok("render pendulum.xml -o b.png --width 32 --height 32");
    let (_, err, code) = shell.run("render pendulum.xml -o b.png --width 32 --height 32 --eye 5,5,5 --target 9,9,9");
    assert!(code == 1 && err.contains("no visible shape is in view"), "{code} {err}");
    shell.assert_refused(&[(
        "render pendulum.xml -o b.png --floating-base",
        "--floating-base: pendulum.xml is rendered",
    )]);
}

/// A simulation that diverges in all environments reports no rate.
///
/// Cause: steps were counted even for environments that had diverged and no longer stepped.
#[test]
fn bench_of_a_diverged_simulation() {
    // 1e-5 kg m² on a spring of -1e15 N m/rad: MuJoCo reports instability in the first steps.
    let wild = r#"<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" stiffness="-1e15"/>
      <geom size="0.01" pos="0.1 0 0" mass="0.001"/></body></worldbody></mujoco>"#;
    let shell = CommandFolder::with(&[("wild.xml", wild)]);
    let (out, err, code) = shell.run("bench wild.xml --num-envs 2 --seconds 0.2 --width 64");
    assert_eq!((out.as_str(), code), ("", 2), "{err}");
    assert!(err.contains("diverged in all 2 environments") && err.contains("step "), "{err}");
    assert!(!err.contains("environment steps per second"), "{err}");
}

/// Every command accepts scene files, and MJCF files that are not robots.
///
/// Cause: only `view` and `render` accepted MJCF files that are not robots, and no command accepted scene files.
#[test]
fn scenes() {
    let toml = "[simulation]\nnum_envs = 3\n[entities.arm]\ntype = \"robot\"\nurdf = \"arm.urdf\"\n\
                [entities.cube]\ntype = \"rigid_object\"\nshape.box.size = [0.1, 0.1, 0.1]\ninit_pose.pos = [1, 0, 0.05]\n";
    let yaml = "simulation: {num_envs: 3}\nentities:\n  arm: {type: robot, urdf: arm.urdf}\n  \
                cube: {type: rigid_object, shape: {box: {size: [0.1, 0.1, 0.1]}}, init_pose: {pos: [1, 0, 0.05]}}\n";
    let json = r#"{"simulation": {"num_envs": 3}, "entities": {"arm": {"type": "robot", "urdf": "arm.urdf"},
      "cube": {"type": "rigid_object", "shape": {"box": {"size": [0.1, 0.1, 0.1]}}, "init_pose": {"pos": [1, 0, 0.05]}}}}"#;
    let mocap = SCENE.replace("<freejoint/>", "").replace("pos=\"1 0 1\"", "pos=\"1 0 1\" mocap=\"true\"");
    let still = "<mujoco><option timestep=\"0.01\"/><worldbody><geom size=\"1\"/></worldbody></mujoco>";
    let files = [
        ("arm.urdf", ARM),
        ("s.toml", toml),
        ("s.yaml", yaml),
        ("s.json", json),
        ("b.xml", SCENE),
        ("m.xml", &mocap),
        ("n.xml", still),
    ];
    let shell = CommandFolder::with(&files);
    for (file, _) in &files[1..] {
        let out = shell.run_ok(&format!("bench {file} --seconds 0.01 --width 64"));
        let envs = if file.ends_with(".xml") { "64 environments" } else { "3 environments" };
        assert!(out.starts_with(envs), "{file}: {out}");
        shell.run_ok(&format!("view {file} --serve 127.0.0.1:0 --speed 1000 --steps 2"));
        shell.run_ok(&format!("render {file} -o {file}.png --width 64"));
        assert_eq!(shell.image(&format!("{file}.png")).width(), 64);
        shell.run_ok(&format!("convert {file} -o {file}.d"));
        let out = shell.run_ok(&format!("check {file} --json {file}.json"));
        assert!(out.contains("a scene"), "{file}: {out}");
        let report = std::fs::read_to_string(shell.path(&format!("{file}.json"))).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        if file.ends_with(".xml") {
            let mass = if *file == "n.xml" { 0.0 } else { 2.0 };
            assert_eq!(report["total_mass"].as_f64().unwrap(), mass, "{file}");
        } else {
            assert_eq!(report["robots"]["arm"]["total_mass"].as_f64().unwrap(), 2.0, "{file}");
            assert!(out.contains("hinge") && out.contains("cube") && out.contains("rigid object"), "{file}: {out}");
        }
    }
}

/// For an MJCF file that needs a newer MuJoCo than 2.2.2, the error names the required version and the line, even of an
/// included file; with MuJoCo 4, the file is loaded.
///
/// Cause: MuJoCo's message ("Schema violation") does not distinguish an old MuJoCo from an invalid file. For defaults
/// and included files, it reports line 0, or a line of an unnamed file.
#[test]
fn newer_mjcf() {
    let with = |joint: &str| PENDULUM.replace("<joint ", &format!("<joint {joint} "));
    let included = "<mujocoinclude>\n <default>\n  <joint actuatorfrcrange=\"-1 1\"/></default></mujocoinclude>";
    let main = PENDULUM.replace("<worldbody>", "\n<include file=\"part.xml\"/><worldbody>");
    let shell = CommandFolder::with(&[
        ("force.xml", &with("actuatorfrcrange=\"-1 1\"")),
        ("main.xml", &main),
        ("part.xml", included),
        ("wrong.xml", &with("actuatorfrcrang=\"-1 1\"")),
    ]);
    let is_old = kinetoscope::mujoco::BUILD_VERSION == kinetoscope::mujoco::SupportedVersion::V2;
    for (file, place, since) in [("force.xml", "force.xml:2", "2.3.7"), ("main.xml", "part.xml:3", "2.3.7")] {
        if is_old {
            let err = shell.run_refused(&format!("render {file} -o a.png"));
            for words in [place, "actuatorfrcrange", since, "MUJOCO_DIR"] {
                assert!(err.contains(words), "{file}: {words}: {err}");
            }
            assert!(!err.contains("; ;"), "{err}");
        } else {
            shell.run_ok(&format!("render {file} -o a.png --width 64"));
        }
    }
    // Control: a keyword that no supported MuJoCo version has.
    let err = shell.run_refused("render wrong.xml -o a.png");
    assert!(err.contains("wrong.xml:2") && err.contains("If the keyword is correct") == is_old, "{err}");
}
