//! Random reachable poses of whole arms are found from a cold start, and MuJoCo says that they are.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use std::time::Instant;

const TARGETS: usize = 1000;

/// Targets are where MuJoCo puts `link` at uniformly random positions; each search starts from the default positions;
/// what it finds is written into the simulation, and MuJoCo says where the link is.
fn check(name: &str, cfg: RobotCfg, link: &str) {
    let (mut sim, id) = simulation(1, cfg);
    let reachable = random_qpos(&sim, id, TARGETS, 21);
    let start = sim.robot(id).get_default_qpos();
    let write = |sim: &mut SimulationManager, qpos: &Array2<f64>, row: usize| {
        let row = qpos.select(kinetoscope::ndarray::Axis(0), &[row]);
        sim.robot_mut(id).write_qpos(&row, None, None).unwrap();
        sim.robot(id).link_pose(link).unwrap()
    };
    let cfg = IkCfg::default();
    let (mut solved, mut claimed, mut times, mut from_start, mut steps) = (0, 0, Vec::new(), 0, 0);
    let limits = sim.robot(id).qpos_limits();
    for row in 0..TARGETS {
        let target = write(&mut sim, &reachable, row);
        write(&mut sim, &start, 0);
        let clock = Instant::now();
        let found = sim.robot(id).compute_ik(&target, Tip::of_part("arm").at(link), &cfg, None, None).unwrap();
        times.push(clock.elapsed().as_secs_f64());
        for (joint, &q) in found.qpos.iter().enumerate() {
            assert!(q >= limits[(0, joint, 0)] && q <= limits[(0, joint, 1)], "{name}: joint {joint} at {q}");
        }
        let (far, turned) = apart(&write(&mut sim, &found.qpos, 0), &target);
        // What it says is what MuJoCo says, whether it is success or not.
        assert!((far - found.position_error[0]).abs() < 1e-12 && (turned - found.rotation_error[0]).abs() < 1e-12);
        let right = far <= 1e-4 && turned <= 1e-3;
        assert_eq!(right, found.success[0], "{name}, target {row}: {far} m, {turned} rad");
        solved += usize::from(right);
        claimed += usize::from(found.success[0]);
        from_start += usize::from(found.seed[0] == 0);
        steps += found.iterations[0];
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{name}: {solved} of {TARGETS} solved ({from_start} by the first start, {:.1} steps each), median {:.0} us, mean \
         {:.0} us, 99 % below {:.0} us",
        f64::from(steps) / TARGETS as f64,
        1e6 * times[TARGETS / 2],
        1e6 * times.iter().sum::<f64>() / TARGETS as f64,
        1e6 * times[TARGETS * 99 / 100],
    );
    assert!(solved >= TARGETS * 99 / 100 && claimed == solved, "{name}: {solved} of {TARGETS}");
    // The control: the default position itself is no solution of these.
    let (far, _) = apart(&write(&mut sim, &start, 0), &write(&mut sim, &reachable, 0));
    assert!(far > 0.01, "{name}: {far}");
}

#[test]
fn poses_of_the_bundled_arm_are_found() {
    check("SR5", sr5(), "ee_link");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn poses_of_the_vendors_arm_are_found() {
    check("the vendor's SR5", vendors_sr5(), "xMateSR5_link6");
}

#[test]
fn poses_of_an_arm_of_seven_axes_are_found() {
    check("seven axes", seven_axes(), "link8");
}

#[test]
fn poses_of_an_arm_with_three_parallel_axes_are_found() {
    check("six axes", six_axes(), "tool0");
}
