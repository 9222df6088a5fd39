//! Environments take turns in the `mjData` of a thread: nothing of one environment may reach another one.

use super::support::{add_walker, all_bits, cfg, sim};
use kinetoscope::mujoco::{self as mj, Data, ModelEditor};
use kinetoscope::ndarray::{Array2, Array3, s};
use kinetoscope::prelude::*;
use kinetoscope::sim::Error;

/// Walkers at different heights, some of which touch the ground after a while.
fn walkers(num_envs: usize, threads: usize) -> (SimulationManager, RobotId) {
    let mut sim = sim(cfg(num_envs, threads));
    let robot = add_walker(&mut sim, "walker", 0.3);
    let mut poses = sim.robot(robot).root_pose();
    poses.column_mut(2).iter_mut().enumerate().for_each(|(i, z)| *z += 0.01 * i as f64);
    sim.robot_mut(robot).write_root_pose(&poses, None).unwrap();
    (sim, robot)
}

fn blow_up(data: &mut Data) {
    data.xfrc_applied_mut()[8] = 1e300;
    data.step().unwrap();
}

/// A closure of `with_mujoco` in which MuJoCo warns of divergence. On 2.2.2, MuJoCo then replaces the state by a finite
/// one. The warning stayed in the data, and the next environment of the thread was marked as diverged.
#[test]
fn warnings_of_a_closure() {
    for threads in [1, 3] {
        let ((mut sim, _), (mut calm, _)) = (walkers(3, threads), walkers(3, threads));
        sim.update(10);
        calm.update(10);
        sim.scene_mut().with_mujoco(EnvId(1), blow_up).unwrap();
        let diverged = sim.diverged();
        assert!(diverged.len() == 1 && diverged[0].env == EnvId(1), "{threads} threads: {diverged:?}");
        assert!(diverged[0].to_string().contains("bad-acceleration"), "{}", diverged[0]);
        assert_eq!(all_bits(&sim), all_bits(&calm), "{threads} threads: the state before");
        let last_good = all_bits(&calm)[1].clone();
        sim.update(10);
        calm.update(10);
        let (mine, undisturbed) = (all_bits(&sim), all_bits(&calm));
        assert_eq!([&mine[0], &mine[1], &mine[2]], [&undisturbed[0], &last_good, &undisturbed[2]], "{threads} threads");
        assert_ne!(undisturbed[1], last_good, "control");
        let counts = [0, 1, 2].map(|k| sim.warnings().env_counts(EnvId(k)).unwrap());
        assert!(counts[0].is_empty() && counts[2].is_empty(), "{counts:?}");
        assert_eq!(counts[1].get("mujoco-bad-acceleration"), Some(&1), "{counts:?}");
    }
}

/// A closure that sets another model, or exchanges the data, changed every environment of the thread.
#[test]
fn another_model_in_a_closure() {
    for threads in [1, 3] {
        let ((mut sim, _), (mut calm, _)) = (walkers(3, threads), walkers(3, threads));
        sim.update(10);
        calm.update(10);
        sim.scene_mut()
            .with_mujoco(EnvId(1), |data| {
                let mut editor = ModelEditor::new(data.model()).unwrap();
                editor.body_mass_mut()[1] = 77.0;
                editor.set_constants().unwrap();
                let heavy = editor.model(data.model());
                data.set_model(heavy);
                assert_eq!(data.model().body_mass()[1], 77.0);
            })
            .unwrap();
        // The environment of the closure comes first: the next one that the thread takes gets its own model in any case.
        let masses = [1, 0, 2].map(|k| sim.with_mujoco(EnvId(k), |model, _| model.body_mass()[1]).unwrap());
        assert!(masses.iter().all(|&mass| (mass - 4.0).abs() < 1e-12), "{masses:?}");
        let own = sim.with_mujoco(EnvId(1), |model, _| model.with_buffers(model.buffers())).unwrap();
        let larger = own.with_buffers(own.buffers().enlarged(mj::Overflow::Constraints));
        let ball =
            mj::compile("<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>", &[]);
        for foreign in [ball.unwrap().into_model(), larger] {
            let mut other = Data::new(&foreign).unwrap();
            let exchanged = sim.scene_mut().with_mujoco(EnvId(1), |data| {
                data.qvel_mut()[0] = 5.0;
                std::mem::swap(data, &mut other);
            });
            assert!(matches!(exchanged, Err(Error::ExchangedData { env: 1 })), "{exchanged:?}");
        }
        // Data of the same model may be exchanged: it is written like any other.
        let mut same = Data::new(&own).unwrap();
        let state = calm.with_mujoco(EnvId(1), |_, data| [data.qpos().to_vec(), data.qvel().to_vec()]).unwrap();
        sim.scene_mut().with_mujoco(EnvId(1), |data| std::mem::swap(data, &mut same)).unwrap();
        sim.scene_mut()
            .with_mujoco(EnvId(1), |data| {
                data.qpos_mut().copy_from_slice(&state[0]);
                data.qvel_mut().copy_from_slice(&state[1]);
            })
            .unwrap();
        sim.update(10);
        calm.update(10);
        let (mine, undisturbed) = (all_bits(&sim), all_bits(&calm));
        assert_eq!([&mine[0], &mine[2]], [&undisturbed[0], &undisturbed[2]], "{threads} threads");
        assert!(sim.diverged().is_empty());
    }
}

/// A panic of a closure leaves the state before.
#[test]
fn panic_in_a_closure() {
    let ((mut sim, _), (mut calm, _)) = (walkers(3, 1), walkers(3, 1));
    sim.update(10);
    calm.update(10);
    let mut scene = sim.scene_mut();
    let panicking = std::panic::AssertUnwindSafe(|| {
        scene.with_mujoco(EnvId(1), |data| {
            data.qpos_mut()[0] = 3.0;
            panic!("expected");
        })
    });
    assert!(std::panic::catch_unwind(panicking).is_err());
    sim.update(10);
    calm.update(10);
    assert_eq!(all_bits(&sim), all_bits(&calm));
}

/// Results of the last solve that environments do not keep were those of the environment that the thread stepped last.
#[test]
fn results_of_other_environments() {
    let (mut few, _) = walkers(3, 3);
    let (mut many, _) = walkers(3, 1);
    for sim in [&mut few, &mut many] {
        sim.update(60);
        for env in (0..3).map(EnvId) {
            let (constraints, contacts) = sim
                .with_mujoco(env, |_, data| {
                    let zeros = [data.efc_force(), data.cacc(), data.cfrc_int()];
                    assert!(zeros.into_iter().flatten().all(|x| *x == 0.0), "{env:?}");
                    let forces = (0..data.contact().len()).flat_map(|i| data.contact_force(i));
                    assert!(forces.into_iter().all(|x| x == 0.0), "{env:?}");
                    (data.efc_force().len(), data.contact().len())
                })
                .unwrap();
            assert!(constraints > 0 && (contacts > 0 || env != EnvId(0)), "{constraints} {contacts}");
        }
    }
    let results = |sim: &SimulationManager| -> Vec<Vec<u64>> {
        let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let of =
            |k| sim.with_mujoco(EnvId(k), |_, d| [d.qacc(), d.qfrc_constraint(), d.qfrc_bias()].map(bits).concat());
        (0..3).map(|k| of(k).unwrap()).collect()
    };
    assert_eq!(results(&few), results(&many));
    assert_ne!(results(&few)[0], results(&few)[1], "environments differ");
    // The zeros do not change the next step.
    few.update(20);
    many.update(20);
    let (mut unread, _) = walkers(3, 2);
    unread.update(80);
    assert_eq!(all_bits(&few), all_bits(&unread));
    assert_eq!(all_bits(&many), all_bits(&unread));
}

/// Poses and velocities of all links, read in MuJoCo's data: bodies 1 to 3 are the links.
fn of_data(sim: &SimulationManager) -> (Array3<f64>, Array3<f64>) {
    let n = sim.num_envs();
    let (mut poses, mut velocities) = (Array3::zeros((n, 3, 7)), Array3::zeros((n, 3, 6)));
    for env in 0..n {
        sim.with_mujoco(EnvId(env), |model, data| {
            for body in 1..=3 {
                let position = &data.xpos()[3 * body..3 * body + 3];
                let pose = position.iter().chain(&data.xquat()[4 * body..4 * body + 4]);
                poses.slice_mut(s![env, body - 1, ..]).iter_mut().zip(pose).for_each(|(to, from)| *to = *from);
                // The velocity of a point is v + w x (point - reference), with the center of mass of the tree.
                let cvel = &data.cvel()[6 * body..6 * body + 6];
                let root = model.body_rootid()[body] as usize;
                let arm: Vec<f64> = (0..3).map(|k| position[k] - data.subtree_com()[3 * root + k]).collect();
                let cross = |k: usize| cvel[(k + 1) % 3] * arm[(k + 2) % 3] - cvel[(k + 2) % 3] * arm[(k + 1) % 3];
                for k in 0..3 {
                    velocities[(env, body - 1, k)] = cvel[3 + k] + cross(k);
                    velocities[(env, body - 1, 3 + k)] = cvel[k];
                }
            }
        })
        .unwrap();
    }
    (poses, velocities)
}

fn farthest(one: &Array3<f64>, other: &Array3<f64>) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[track_caller]
fn compare_reads(sim: &SimulationManager, robot: RobotId, what: &str) {
    // The first read of a state computes, the second one copies.
    for read in 0..2 {
        let (poses, velocities) = (sim.robot(robot).link_poses(), sim.robot(robot).link_velocities());
        let (expected_poses, expected_velocities) = of_data(sim);
        // A quaternion passes a normalization, and sums have another order.
        assert!(farthest(&poses, &expected_poses) < 1e-14, "{what}, read {read}");
        assert!(farthest(&velocities, &expected_velocities) < 1e-13, "{what}, read {read}");
        assert_eq!(sim.robot(robot).root_pose(), poses.slice(s![.., 0, ..]), "{what}");
    }
}

/// Reads of poses and velocities after steps, writes and resets of single environments belong to the current state of
/// each environment, for any number of threads.
#[test]
fn reads_between_changes() {
    let mut reference: Option<(Array3<f64>, Array3<f64>)> = None;
    for (num_envs, threads) in [(5, 1), (5, 2), (5, 8), (150, 2)] {
        let (mut sim, robot) = walkers(num_envs, threads);
        compare_reads(&sim, robot, "at the start");
        sim.update(7);
        compare_reads(&sim, robot, "after steps");
        let before = sim.robot(robot).link_poses();
        sim.robot_mut(robot).write_qpos(&Array2::from_elem((1, 2), 0.4), None, Some(&[EnvId(3)])).unwrap();
        compare_reads(&sim, robot, "after a write");
        let after = sim.robot(robot).link_poses();
        let moved: Vec<usize> =
            (0..num_envs).filter(|&i| before.slice(s![i, .., ..]) != after.slice(s![i, .., ..])).collect();
        assert_eq!(moved, [3]);
        sim.reset(Some(&[EnvId(1)])).unwrap();
        compare_reads(&sim, robot, "after a reset");
        sim.robot_mut(robot).set_qpos_target(&Array2::from_elem((1, 2), 0.2), None, Some(&[EnvId(2)])).unwrap();
        compare_reads(&sim, robot, "after a target");
        let snapshot = sim.snapshot(None).unwrap();
        sim.update(5);
        sim.restore(&snapshot, None).unwrap();
        compare_reads(&sim, robot, "after a snapshot");
        sim.update(9);
        compare_reads(&sim, robot, "at the end");
        let (poses, velocities) = (sim.robot(robot).link_poses(), sim.robot(robot).link_velocities());
        let first = |all: &Array3<f64>| all.slice(s![..5, .., ..]).to_owned();
        let mine = (first(&poses), first(&velocities));
        assert_eq!(reference.get_or_insert_with(|| mine.clone()), &mine, "{num_envs} environments, {threads} threads");
    }
}

/// A closure that reads MuJoCo's data may read all environments, its own one included.
#[test]
fn nested_reads() {
    for (num_envs, threads) in [(1, 1), (3, 1), (3, 2), (200, 2)] {
        let (mut sim, robot) = walkers(num_envs, threads);
        sim.update(5);
        let outside = sim.robot(robot).link_poses();
        sim.update(5);
        sim.update(5);
        let (inside, again, growths) = sim
            .with_mujoco(EnvId(0), |_, data| {
                let inside = sim.robot(robot).link_poses();
                let again = sim.with_mujoco(EnvId(0), |_, data| data.qpos().to_vec()).unwrap();
                assert_eq!(data.qpos(), again, "the data of the closure stays");
                (inside, sim.robot(robot).link_poses(), sim.warnings().buffer_growths())
            })
            .unwrap();
        assert_eq!(inside, again);
        assert_eq!(inside, sim.robot(robot).link_poses());
        assert_ne!(inside, outside, "control");
        assert_eq!(growths, sim.warnings().buffer_growths());
    }
}
