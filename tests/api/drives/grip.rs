//! A finger that presses on a fixed block pushes with the force that follows from its effort limit, and does not
//! penetrate the block.
//!
//! A finger of 45 g turns about x. Its round tip, 90 mm from the axis, meets a block whose face is normal to the tip's
//! path at 0.3 rad. The drive (1e3 / 1e2) has the target 0.8 rad and a limit of 2 N m. At rest the limit balances the
//! contact: F = 2 N m / 0.09 m = 22.2 N. Tolerance 5 %: the tip rests slightly inside the face, and the four edges of
//! the friction pyramid tilt the force. The finger is at rest (1 mrad/s) with the center of its tip in front of the
//! face: its depth is that of MuJoCo's default contact, 2.5 mm of the tip's radius of 8 mm.
//!
//! Control: the same drive as a precomputed torque (the implicit law without the contact, clamped and applied
//! externally) holds with less than half of that force.

use crate::drives::worlds::*;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sim::FrictionCone;
use kinetoscope_testkit::urdf::{TempFiles, collision, robot};

const KP: f64 = 1e3;
const KD: f64 = 1e2;
const LIMIT: f64 = 2.0;
const LEVER: f64 = 0.09;
const AIM: f64 = 0.8;
const FACE: f64 = 0.3;
/// Moment of inertia about the joint \[kg m²\].
const MOMENT: f64 = 3e-5 + 0.045 * 0.045 * 0.045;

fn scene(drive: DriveCfg, cone: FrictionCone) -> World {
    let finger = Joint {
        axis: [1.0, 0.0, 0.0],
        mass: 0.045,
        com: [0.0, 0.0, 0.045],
        inertia: [3e-5, 3e-5, 1e-6],
        collision: collision("<sphere radius=\"0.008\"/>", [0.0, 0.0, 0.09]),
        ..Joint::new("finger", "continuous")
    };
    let mut world = world(&[finger.effort(LIMIT)], drive, SimulationManagerCfg { cone, ..weightless() });
    let shape = collision("<box size=\"0.1 0.04 0.1\"/>", [0.0; 3]);
    let block = robot("block", &format!("<link name=\"block\">{shape}</link>"));
    let (files, init_pose) = (TempFiles::default(), from_xyz_rpy([0.0, -0.0556, 0.0846], [FACE, 0.0, 0.0]));
    let block = RobotCfg { init_pose, ..kinetoscope_testkit::worlds::text_robot(&files, "block", &block) };
    world.sim.add_robot(block).unwrap_or_else(|e| panic!("{e}"));
    world
}

/// Mean normal force over the last 0.2 of 1 s, position, velocity and the drive's effort.
fn press(world: &World, mut outside: impl FnMut(&mj::Data) -> f64) -> [f64; 4] {
    let (model, mut drives) = world.sim.batch().read(0, |env| (env.data().model().clone(), env.drives.clone()));
    drives.position.fill(AIM);
    let mut data = mj::Data::new(&model).unwrap();
    let (mut sum, mut efforts) = (0.0, Vec::new());
    for k in 0..100 {
        data.step1().unwrap();
        drives.applied[0] = outside(&data);
        drives.apply(&mut data);
        data.step2().unwrap();
        drives.read_efforts(&data, &mut efforts);
        if k >= 80 {
            sum += (0..data.contact().len()).map(|i| data.contact_force(i)[0]).sum::<f64>();
        }
    }
    [sum / 20.0, data.qpos()[0], data.qvel()[0], efforts.first().copied().unwrap_or(0.0)]
}

#[test]
fn limit_at_the_tip() {
    for cone in [FrictionCone::Pyramidal, FrictionCone::Elliptic] {
        let [force, q, v, effort] = press(&scene(gains(KP, KD), cone), |_| 0.0);
        assert!((force / (LIMIT / LEVER) - 1.0).abs() < 0.05, "{cone:?}: {force} N");
        assert_eq!(effort, LIMIT);
        assert!(v.abs() < 1e-3 && (q - FACE).abs() * LEVER < 8e-3, "{cone:?}: {q} {v}");
    }
}

#[test]
fn torque_computed_without_the_contact() {
    let [force, ..] = press(&scene(no_drive(), FrictionCone::Pyramidal), |data| {
        let (q, v) = (data.qpos()[0], data.qvel()[0]);
        let a = (KP * (AIM - q - H * v) - KD * v) / (MOMENT + H * KD + H * H * KP);
        (KP * (AIM - q - H * v - H * H * a) - KD * (v + H * a)).clamp(-LIMIT, LIMIT)
    });
    assert!(force < 0.5 * LIMIT / LEVER, "{force}");
}
