//! Unusual robots: they are simulated, or reported as diverged; no panic, and no NaN in the state that is read.

use super::support::{INERTIAL, LIMIT, exported, hinge_with, robot, sim};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};

fn mass(mass: &str, moment: &str) -> String {
    let moments = format!("ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" izz=\"{moment}\"");
    hinge_with(&format!("<inertial><mass value=\"{mass}\"/><inertia {moments}/></inertial>"), LIMIT)
}

/// A chain of links `a`, `b`, ... with these joints.
fn chain(joints: &[(&str, String)]) -> String {
    let name = |i: usize| char::from(b'a' + i as u8);
    let mut text = format!("<robot name=\"r\"><link name=\"a\">{INERTIAL}</link>");
    for (i, (kind, more)) in joints.iter().enumerate() {
        let (parent, child) = (name(i), name(i + 1));
        text += &format!(
            "<link name=\"{child}\">{INERTIAL}</link><joint name=\"{child}_joint\" type=\"{kind}\"><parent \
             link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"0.1 0 0.2\" rpy=\"0.1 0.2 0.3\"/><axis \
             xyz=\"0 0.6 0.8\"/>{more}</joint>"
        );
    }
    text + "</robot>"
}

fn rows() -> Vec<(String, String)> {
    let limits = |limits: &str| hinge_with(INERTIAL, &format!("<limit {limits}/>"));
    let shapes = "<collision><geometry><sphere radius=\"1e-300\"/></geometry></collision>\
                  <collision><geometry><box size=\"1e300 1e-10 1\"/></geometry></collision>";
    let dynamics = format!("{LIMIT}<dynamics damping=\"1e300\" friction=\"1e300\"/>");
    let mut rows: Vec<(&str, String)> = vec![
        ("mass 1e-300", mass("1e-300", "1e-300")),
        ("mass 1e300", mass("1e300", "1e300")),
        ("inertia 1e300", mass("1", "1e300")),
        ("inertia of nothing", mass("1", "0")),
        ("no mass", hinge_with("", LIMIT)),
        ("mass 0", mass("0", "0")),
        ("limits 1e308", limits(r#"lower="-1e308" upper="1e308" effort="1e308" velocity="1e308""#)),
        ("effort 1e-308", limits(r#"lower="-1" upper="1" effort="1e-308" velocity="1""#)),
        ("effort 1e-300", limits(r#"lower="-1" upper="1" effort="1e-300" velocity="1""#)),
        ("limits equal", limits(r#"lower="0.5" upper="0.5" effort="10" velocity="1""#)),
        ("limits nearly equal", limits(r#"lower="0.5" upper="0.50000000000000011" effort="10" velocity="1""#)),
        ("limits in the wrong order", limits(r#"lower="1" upper="-1" effort="10" velocity="1""#)),
        ("only a lower limit, above 0", limits(r#"lower="1" effort="10" velocity="1""#)),
        ("only an upper limit, below 0", limits(r#"upper="-1" effort="10" velocity="1""#)),
        ("only a lower limit", limits(r#"lower="-1" effort="10" velocity="1""#)),
        ("damping 1e300", hinge_with(INERTIAL, &dynamics)),
        ("far away", hinge_with(INERTIAL, LIMIT).replace("0 0 1\"", "1e300 0 1\"")),
        ("one link", chain(&[])),
        ("one link of nothing", "<robot name=\"r\"><link name=\"l\"/></robot>".into()),
        ("only fixed joints", chain(&[("fixed", String::new()), ("fixed", String::new())])),
        ("tiny and huge shapes", hinge_with(&format!("{INERTIAL}{shapes}"), LIMIT)),
    ];
    let mimics = [("0", "0"), ("0", "5"), ("1e308", "0"), ("1e-308", "1e308"), ("-1e-320", "3"), ("-1", "1e300")];
    for (multiplier, offset) in mimics {
        let mimic = format!("{LIMIT}<mimic joint=\"b_joint\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>");
        rows.push(("mimic", chain(&[("revolute", LIMIT.into()), ("revolute", mimic)])));
    }
    for free in ["planar", "floating"] {
        // In the middle, at the root, at the end, and three in a row.
        let kinds = [
            ["revolute", free, "revolute"],
            [free, "revolute", "prismatic"],
            ["fixed", "continuous", free],
            [free, free, free],
        ];
        let limit = |kind: &str| if ["revolute", "prismatic"].contains(&kind) { LIMIT.into() } else { String::new() };
        rows.extend(kinds.map(|kinds| (free, chain(&kinds.map(|kind| (kind, limit(kind)))))));
    }
    rows.into_iter().enumerate().map(|(i, (what, urdf))| (format!("{i} ({what})"), urdf)).collect()
}

#[test]
fn strange_robots() {
    let dir = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for (what, urdf) in rows() {
        for fix_base in [true, false] {
            let what = format!("{what}, fix_base {fix_base}");
            let init_pose = Pose::translation(0.0, 0.0, 1.0);
            let robot = RobotCfg { fix_base, init_pose, ..robot(dir.path(), "r", &urdf) };
            match catch_unwind(AssertUnwindSafe(|| exercise(robot, &what))) {
                Ok(Ok(())) => {}
                Ok(Err(message)) => wrong.push(format!("{what}: {message}")),
                Err(panic) => wrong.push(format!("{what}: panicked: {:?}", panic.downcast_ref::<String>())),
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn exercise(robot: RobotCfg, what: &str) -> Result<(), String> {
    let text = |error: Error| error.to_string();
    let is = |words: &[&str]| words.iter().any(|word| what.contains(word));
    let mut sim = sim(2);
    let id = sim.add_robot(robot).map_err(|e| format!("refused: {e}"))?;
    let dof = sim.robot(id).dof();
    sim.robot_mut(id).set_qpos_target(&Array2::from_elem((1, dof), 0.7), None, None).map_err(text)?;
    sim.robot_mut(id).write_qpos(&Array2::from_elem((1, dof), 0.3), None, None).map_err(text)?;
    sim.update(30);
    if !sim.diverged().is_empty() && !is(&["1e300", "1e308", "mimic", "far", "huge"]) {
        return Err(format!("diverged: {:?}", sim.diverged()));
    }
    let view = sim.robot(id);
    let mut numbers = vec![view.qpos(), view.qvel(), view.qf(), view.qpos_target()];
    for link in view.link_names() {
        numbers.push(view.link_pose(link).map_err(text)?);
    }
    if let Some(bad) = numbers.iter().find(|values| !values.iter().all(|x| x.is_finite())) {
        return Err(format!("not finite: {bad}"));
    }
    let limits = view.qpos_limits();
    if limits.iter().any(|x| x.is_nan()) || limits.rows().into_iter().any(|r| r[0] > r[1]) {
        return Err(format!("limits {limits}"));
    }
    // MuJoCo without Kinetoscope has no quarantine: its compiler takes a step, which must succeed.
    if is(&["1e300", "far"]) {
        return Ok(());
    }
    let out = tempfile::tempdir().map_err(|e| e.to_string())?;
    sim.dump(out.path()).map_err(|e| format!("dump: {e}"))?;
    match exported(out.path()) {
        // Robots may have such lengths, but files of MJCF have a limit.
        Err(message) if is(&["huge"]) && message.contains("`size` of <geom> has 5e299") => {}
        other => drop(other?),
    }
    sim.reset(None).map_err(text)?;
    sim.update(1);
    Ok(())
}
