//! Strange and still robots: they are simulated, or reported as diverged; never a panic, never NaN in what is read.

use super::support::{INERTIAL, cfg, hinge_with, robot};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

const LIMIT: &str = r#"<limit lower="-1" upper="1" effort="10" velocity="1"/>"#;

fn mass(mass: &str, moment: &str) -> String {
    format!(
        "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" \
         izz=\"{moment}\"/></inertial>"
    )
}

fn joint(kind: &str, parent: &str, child: &str, more: &str) -> String {
    format!(
        "<joint name=\"{child}_joint\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
         <origin xyz=\"0.1 0 0.2\" rpy=\"0.1 0.2 0.3\"/><axis xyz=\"0 0.6 0.8\"/>{more}</joint>"
    )
}

fn links(names: &[&str]) -> String {
    names.iter().map(|n| format!("<link name=\"{n}\">{INERTIAL}</link>")).collect()
}

fn rows() -> Vec<(String, String)> {
    let mut rows: Vec<(&str, String)> = vec![
        ("mass 1e-300", hinge_with(&mass("1e-300", "1e-300"), LIMIT)),
        ("mass 1e300", hinge_with(&mass("1e300", "1e300"), LIMIT)),
        ("inertia 1e300", hinge_with(&mass("1", "1e300"), LIMIT)),
        ("inertia of nothing", hinge_with(&mass("1", "0"), LIMIT)),
        ("no mass", hinge_with("", LIMIT)),
        ("mass 0", hinge_with(&mass("0", "0"), LIMIT)),
        (
            "limits 1e308",
            hinge_with(INERTIAL, r#"<limit lower="-1e308" upper="1e308" effort="1e308" velocity="1e308"/>"#),
        ),
        ("effort 1e-308", hinge_with(INERTIAL, r#"<limit lower="-1" upper="1" effort="1e-308" velocity="1"/>"#)),
        ("limits equal", hinge_with(INERTIAL, r#"<limit lower="0.5" upper="0.5" effort="10" velocity="1"/>"#)),
        (
            "limits nearly equal",
            hinge_with(INERTIAL, r#"<limit lower="0.5" upper="0.50000000000000011" effort="10" velocity="1"/>"#),
        ),
        (
            "limits in the wrong order",
            hinge_with(INERTIAL, r#"<limit lower="1" upper="-1" effort="10" velocity="1"/>"#),
        ),
        ("only a lower limit, above 0", hinge_with(INERTIAL, r#"<limit lower="1" effort="10" velocity="1"/>"#)),
        (
            "efforts of nothing, actuator",
            hinge_with(INERTIAL, r#"<limit lower="-1" upper="1" effort="1e-300" velocity="1"/>"#),
        ),
        ("only an upper limit, below 0", hinge_with(INERTIAL, r#"<limit upper="-1" effort="10" velocity="1"/>"#)),
        ("only a lower limit", hinge_with(INERTIAL, r#"<limit lower="-1" effort="10" velocity="1"/>"#)),
        ("damping 1e300", hinge_with(INERTIAL, &format!("{LIMIT}<dynamics damping=\"1e300\" friction=\"1e300\"/>"))),
        ("far away", hinge_with(INERTIAL, LIMIT).replace("0 0 1\"", "1e300 0 1\"")),
        ("one link", format!("<robot name=\"r\"><link name=\"l\">{INERTIAL}</link></robot>")),
        ("one link of nothing", "<robot name=\"r\"><link name=\"l\"/></robot>".into()),
        (
            "only fixed joints",
            format!(
                "<robot name=\"r\">{}{}{}</robot>",
                links(&["a", "b", "c"]),
                joint("fixed", "a", "b", ""),
                joint("fixed", "b", "c", "")
            ),
        ),
        (
            "tiny and huge shapes",
            hinge_with(
                &format!(
                    "{INERTIAL}<collision><geometry><sphere radius=\"1e-300\"/></geometry></collision>\
                     <collision><geometry><box size=\"1e300 1e-10 1\"/></geometry></collision>"
                ),
                LIMIT,
            ),
        ),
    ];
    let mimic = |multiplier: &str, offset: &str| {
        format!(
            "<robot name=\"r\">{}{}{}</robot>",
            links(&["a", "b", "c"]),
            joint("revolute", "a", "b", LIMIT),
            joint(
                "revolute",
                "b",
                "c",
                &format!("{LIMIT}<mimic joint=\"b_joint\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>")
            )
        )
    };
    for (multiplier, offset) in
        [("0", "0"), ("0", "5"), ("1e308", "0"), ("1e-308", "1e308"), ("-1e-320", "3"), ("-1", "1e300")]
    {
        rows.push(("mimic", mimic(multiplier, offset)));
    }
    for kind in ["planar", "floating"] {
        // In the middle, at the root, at the end, twice in a row.
        for joints in [
            ["revolute", kind, "revolute"],
            [kind, "revolute", "prismatic"],
            ["fixed", "continuous", kind],
            [kind, kind, kind],
        ] {
            let limit = |k: &str| if ["revolute", "prismatic"].contains(&k) { LIMIT } else { "" };
            let [a, b, c] = joints;
            rows.push((
                kind,
                format!(
                    "<robot name=\"r\">{}{}{}{}</robot>",
                    links(&["a", "b", "c", "d"]),
                    joint(a, "a", "b", limit(a)),
                    joint(b, "b", "c", limit(b)),
                    joint(c, "c", "d", limit(c))
                ),
            ));
        }
    }
    rows.into_iter().enumerate().map(|(i, (what, urdf))| (format!("{i} ({what})"), urdf)).collect()
}

#[test]
fn strange_robots_are_simulated_or_reported() {
    let dir = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for (what, urdf) in rows() {
        for fix_base in [true, false] {
            let what = format!("{what}, fix_base {fix_base}");
            let mut sim = SimulationManager::new(cfg(2)).unwrap();
            let mut robot = robot(dir.path(), "r", &urdf);
            robot.fix_base = fix_base;
            robot.init_pose.translation.z = 1.0;
            let checked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| use_it(&mut sim, robot, &what)));
            match checked {
                Ok(Ok(())) => {}
                Ok(Err(message)) => wrong.push(format!("{what}: {message}")),
                Err(panic) => {
                    let text = panic.downcast_ref::<String>().cloned().unwrap_or_default();
                    wrong.push(format!("{what}: panicked: {text}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn use_it(sim: &mut SimulationManager, robot: RobotCfg, what: &str) -> Result<(), String> {
    let id = sim.add_robot(robot).map_err(|e| format!("refused: {e}"))?;
    let dof = sim.robot(id).dof();
    sim.robot_mut(id).set_qpos(&Array2::from_elem((1, dof), 0.7), None, None).map_err(|e| e.to_string())?;
    sim.robot_mut(id).write_qpos(&Array2::from_elem((1, dof), 0.3), None, None).map_err(|e| e.to_string())?;
    sim.update(30);
    if !sim.diverged().is_empty() && !["1e300", "1e308", "mimic", "far", "huge"].iter().any(|w| what.contains(w)) {
        return Err(format!("diverged: {:?}", sim.diverged()));
    }
    let view = sim.robot(id);
    for values in [view.get_qpos(), view.get_qvel(), view.get_qf(), view.get_target_qpos()] {
        if !values.iter().all(|x| x.is_finite()) {
            return Err(format!("not finite: {values}"));
        }
    }
    for link in view.link_names() {
        let poses = view.link_pose(link).map_err(|e| e.to_string())?;
        if !poses.iter().all(|x| x.is_finite()) {
            return Err(format!("{link} is at {poses}"));
        }
    }
    if !view.qpos_limits().iter().all(|x| !x.is_nan()) || view.qpos_limits().rows().into_iter().any(|r| r[0] > r[1]) {
        return Err(format!("limits {}", view.qpos_limits()));
    }
    // Plain MuJoCo has no quarantine: its compiler takes a step, which must succeed.
    if ["1e300", "far"].iter().any(|w| what.contains(w)) {
        return Ok(());
    }
    let out = tempfile::tempdir().map_err(|e| e.to_string())?;
    sim.dump(out.path()).map_err(|e| format!("dump: {e}"))?;
    let file = out.path().join(match kinetoscope::sim::mj::TARGET {
        kinetoscope::sim::mj::Target::V2 => "robot.mjcf2.xml",
        kinetoscope::sim::mj::Target::V4 => "robot.mjcf4.xml",
    });
    kinetoscope::sim::mj::compile_file(&file).map_err(|e| format!("the export: {e}"))?;
    sim.reset(None).map_err(|e| e.to_string())?;
    sim.update(1);
    Ok(())
}
