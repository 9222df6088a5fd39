//! Robots of the batch tests, and copies of environments.

use kinetoscope::mujoco::Model;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::env::SimEnv;
use kinetoscope_testkit::urdf::{TempFiles, collision, joint, limit, link, robot};
pub(crate) use kinetoscope_testkit::worlds::{all_bits, bits_of, cfg, row, sim};

/// Adds a robot of URDF elements with a floating base.
pub(crate) fn add_free(sim: &mut SimulationManager, uid: &str, elements: &str, at: [f64; 3], rpy: [f64; 3]) -> RobotId {
    let (files, init_pose) = (TempFiles::default(), from_xyz_rpy(at, rpy));
    let cfg = kinetoscope_testkit::worlds::text_robot(&files, uid, &robot(uid, elements));
    sim.add_robot(RobotCfg { fix_base: false, init_pose, ..cfg }).unwrap()
}

/// A box on two driven legs with feet.
pub(crate) fn add_walker(sim: &mut SimulationManager, uid: &str, height: f64) -> RobotId {
    let mut urdf = link("trunk", 4.0, 0.05, [0.0; 3], &collision("<box size=\"0.4 0.2 0.1\"/>", [0.0; 3]));
    for (name, y) in [("left_leg", 0.12), ("right_leg", -0.12)] {
        let more = limit([-1.5, 1.5], 40.0, 10.0) + "<dynamics damping=\"0.1\" friction=\"0.05\"/>";
        urdf += &joint(&format!("{name}_hip"), "revolute", ["trunk", name], [0.0, y, -0.05], "0 1 0", &more);
        let shank = collision("<cylinder radius=\"0.02\" length=\"0.2\"/>", [0.0, 0.0, -0.1]);
        let foot = collision("<sphere radius=\"0.03\"/>", [0.0, 0.0, -0.2]);
        urdf += &link(name, 0.6, 0.002, [0.0, 0.0, -0.1], &(shank + &foot));
    }
    add_free(sim, uid, &urdf, [1.0, 1.0, height], [0.3, 0.2, 0.1])
}

/// A plate with `n` times `n` spheres below it, and `arms` driven arms with a sphere each.
pub(crate) fn add_plate(sim: &mut SimulationManager, [n, arms]: [usize; 2], at: [f64; 3], rpy: [f64; 3]) -> RobotId {
    let place = |i: usize| (i as f64 - (n - 1) as f64 / 2.0) * 0.05;
    let spheres: String =
        (0..n * n).map(|k| collision("<sphere radius=\"0.02\"/>", [place(k / n), place(k % n), 0.0])).collect();
    let mut urdf = link("plate", 3.0, 0.05, [0.0; 3], &spheres);
    for k in 0..arms {
        urdf += &format!(
            "<joint name=\"arm{k}\" type=\"revolute\"><parent link=\"plate\"/><child link=\"arm{k}\"/>\
             <origin xyz=\"0 0 0.1\" rpy=\"0 0 {k}\"/><axis xyz=\"0 1 0\"/>{}</joint>",
            limit([-2.0, 2.0], 20.0, 10.0)
        );
        urdf += &link(
            &format!("arm{k}"),
            0.3,
            0.003,
            [0.2, 0.0, 0.0],
            &collision("<sphere radius=\"0.05\"/>", [0.4, 0.0, 0.0]),
        );
    }
    add_free(sim, "plate", &urdf, at, rpy)
}

/// A single free ball.
pub(crate) fn add_ball(sim: &mut SimulationManager, uid: &str, at: [f64; 3]) -> RobotId {
    let ball = link("ball", 0.5, 0.0008, [0.0; 3], &collision("<sphere radius=\"0.06\"/>", [0.0; 3]));
    add_free(sim, uid, &ball, at, [0.0; 3])
}

/// A wheel on a fixed post at (1, 1, 1): a continuous joint, which `write_qpos` does not clamp.
pub(crate) fn wheel(files: &TempFiles) -> RobotCfg {
    let spin = joint("spin", "continuous", ["post", "disc"], [0.0; 3], "0 1 0", "");
    let urdf = robot("wheel", &format!("<link name=\"post\"/>{spin}{}", link("disc", 1.0, 0.01, [0.1, 0.0, 0.0], "")));
    let init_pose = from_xyz_rpy([1.0; 3], [0.3, 0.2, 0.1]);
    RobotCfg {
        init_pose,
        init_qpos: vec![("spin".into(), 0.7)],
        ..kinetoscope_testkit::worlds::text_robot(files, "wheel", &urdf)
    }
}

/// The largest number of contacts of any environment.
pub(crate) fn most_contacts(batch: &Batch) -> usize {
    let mut most = 0;
    batch.for_each(|_, env| most = most.max(env.data().contact().len()));
    most
}

/// Asserts that MuJoCo gave no warning and no environment diverged.
#[track_caller]
pub(crate) fn assert_quiet(sim: &SimulationManager) {
    let mujoco: Vec<_> = sim.warnings().counts().into_keys().filter(|name| name.starts_with("mujoco")).collect();
    assert!(mujoco.is_empty() && sim.diverged().is_empty(), "{mujoco:?} {:?}", sim.diverged());
}

/// An environment of `model` with the state and the targets of `other`.
pub(crate) fn copy_of(model: &Model, other: &SimEnv) -> SimEnv {
    let mut env = SimEnv::new(model, other.drives.table()).unwrap();
    env.reset(|data, drives| {
        data.qpos_mut().copy_from_slice(other.data().qpos());
        data.qvel_mut().copy_from_slice(other.data().qvel());
        drives.position.copy_from_slice(&other.drives.position);
    });
    env
}
