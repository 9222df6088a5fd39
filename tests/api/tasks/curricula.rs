//! Curricula: numbers that change at the ends of episodes, and terrain levels.

use super::bundled::{cfg, idle, world};
use kinetoscope::ndarray::{Array2, Axis, s};
use kinetoscope::prelude::*;
use kinetoscope::scene::terrain::{TerrainGrid, TerrainTile};
use kinetoscope::tasks::terms::{RootRanges, TerrainLevelsCfg, reset_root_on_terrain, terrain_levels};
use kinetoscope::tasks::{
    AutoresetMode, CurriculumTerm, Env, EnvBuilder, EnvCfg, EnvError, EventMode, EventTerm, ObservationTerm,
    TerminationTerm,
};
use kinetoscope_testkit::worlds::{mjcf_robot, passive};
use std::sync::{Arc, Mutex};

fn level(name: &str) -> ObservationTerm {
    let name = name.to_string();
    ObservationTerm::new("level", ["k"], move |now| Ok(now.curriculum(&name)?.to_owned().insert_axis(Axis(1))))
}

/// Levels of each reset event.
type Log = Arc<Mutex<Vec<(usize, f64)>>>;

/// Environment e ends its episodes after e + 2 steps; each end adds 1 to its level, which starts at 10 (e + 1).
fn counting(autoreset: AutoresetMode) -> (Env, Log) {
    let (sim, _) = world(cfg(3, 1), false);
    let log = Log::default();
    let seen = Arc::clone(&log);
    let env = EnvBuilder::new(sim, EnvCfg { autoreset, ..EnvCfg::default() })
        .action(idle())
        .curriculum(CurriculumTerm::new(
            "ends",
            |rng| 10.0 * (rng.env().0 + 1) as f64,
            |_, rngs, levels| Ok(rngs.iter().map(|rng| levels[rng.env().0] + 1.0).collect()),
        ))
        .event(EventTerm::with_context("log", EventMode::Reset, move |now, rngs| {
            let levels = now.curriculum("ends")?;
            seen.lock().unwrap().extend(rngs.iter().map(|rng| (rng.env().0, levels[rng.env().0])));
            Ok(())
        }))
        .observation(level("ends"))
        .termination(TerminationTerm::new("end", |now| {
            Ok(now.episode_steps().iter().enumerate().map(|(e, k)| *k >= e as u64 + 2).collect())
        }))
        .build()
        .unwrap();
    (env, log)
}

#[test]
fn ends_of_episodes() {
    for mode in AutoresetMode::ALL {
        let (mut env, log) = counting(mode);
        assert_eq!(env.reset(None, Some(1)).unwrap().column(0).to_vec(), [10.0, 20.0, 30.0]);
        assert_eq!(env.curriculum_names(), ["ends"]);
        let mut ends = [0; 3];
        let mut over = vec![false; 3];
        for _ in 0..20 {
            if mode == AutoresetMode::Disabled && over.contains(&true) {
                env.reset(Some(&over), None).unwrap();
            }
            let step = env.step(&Array2::zeros((3, 1))).unwrap();
            over = step.terminated.to_vec();
            for e in (0..3).filter(|&e| over[e]) {
                ends[e] += 1;
            }
            let expected: Vec<f64> = (0..3).map(|e| 10.0 * (e + 1) as f64 + f64::from(ends[e])).collect();
            assert_eq!(env.context().curriculum("ends").unwrap().to_vec(), expected, "{mode}");
        }
        assert!(ends.iter().all(|ends| *ends >= 4), "{ends:?}");
        // Reset events get the new number.
        let of_first: Vec<f64> = log.lock().unwrap().iter().filter(|(e, _)| *e == 0).map(|(_, level)| *level).collect();
        assert!(of_first.windows(2).all(|pair| pair[1] == pair[0] + 1.0) && of_first.len() > 4, "{of_first:?}");
        // A reset without an end keeps the number; a seed starts anew.
        let before = env.context().curriculum("ends").unwrap().to_vec();
        assert_eq!(env.reset(None, None).unwrap().column(0).to_vec(), before);
        let again = env.reset(Some(&[true, false, false]), Some(1)).unwrap();
        assert_eq!(again.column(0).to_vec(), [10.0, before[1], before[2]]);
        env.set_curriculum("ends", &[1.0, 2.0, 3.0]).unwrap();
        assert_eq!(env.reset(None, None).unwrap().column(0).to_vec(), [1.0, 2.0, 3.0]);
    }
    let (mut env, _) = counting(AutoresetMode::SameStep);
    assert!(
        matches!(env.set_curriculum("end", &[0.0; 3]), Err(EnvError::UnknownName { candidates, .. }) if candidates == ["ends"])
    );
    assert!(matches!(env.set_curriculum("ends", &[0.0; 2]), Err(EnvError::Shape { .. })));
    assert!(matches!(env.set_curriculum("ends", &[0.0, f64::NAN, 0.0]), Err(EnvError::NotFinite { env: 1, .. })));
}

/// A grid of three rows and two columns: slopes up, and slopes down. Tiles are 4 m wide, platforms 1 m.
fn grid() -> TerrainGrid {
    let [up, down] = ["slope_up", "slope_down"]
        .map(|name| TerrainTile::all().into_iter().find(|tile| tile.name() == name).unwrap().into());
    TerrainGrid {
        rows: 3,
        columns: 2,
        tile_size: [4.0, 4.0],
        platform: 1.0,
        border: 0.0,
        tiles: vec![up, down],
        ..Default::default()
    }
}

/// A floating box without gravity, 0.7 m above the platform of a tile. Episodes have one step.
fn walkers(num_envs: usize, cfg: TerrainLevelsCfg) -> (Env, RobotId) {
    let walker = r#"<mujoco><worldbody><body name="trunk" pos="0 0 0"><freejoint name="float"/>
        <geom type="box" size="0.05 0.05 0.05" mass="2"/><body><joint name="hinge"/><geom size="0.03" mass="0.1"/></body>
        </body></worldbody></mujoco>"#;
    let settings = SimulationManagerCfg { gravity: nalgebra::Vector3::zeros(), ..super::bundled::cfg(num_envs, 1) };
    let mut sim = SimulationManager::new(settings).unwrap();
    sim.add_terrain(TerrainCfg::generated("grid", grid()).unwrap()).unwrap();
    let robot = RobotCfg { fix_base: false, ..passive(mjcf_robot("walker", walker)) };
    let robot = sim.add_robot(robot).unwrap();
    let above = RootRanges { position: [[0.0; 2], [0.0; 2], [0.7, 0.7]], ..RootRanges::default() };
    let env = EnvBuilder::new(sim, EnvCfg { episode_steps: Some(1), ..EnvCfg::default() })
        .action(idle())
        .curriculum(terrain_levels("level", robot, &grid(), cfg).unwrap())
        .event(reset_root_on_terrain("start", robot, &grid(), "level", above).unwrap())
        .observation(level("level"))
        .build()
        .unwrap();
    (env, robot)
}

/// A robot starts above the platform of its tile, by the closed form of slopes and by `mj_ray`.
#[test]
fn starts() {
    let (mut env, robot) = walkers(12, TerrainLevelsCfg::default());
    let levels = env.reset(None, Some(5)).unwrap();
    let poses = env.sim().robot(robot).root_pose();
    let mut seen = [0; 3];
    for e in 0..12 {
        let (row, column) = (levels[(e, 0)] as usize, e % 2);
        seen[row] += 1;
        let [x, y] = [4.0 * row as f64 - 4.0, 4.0 * column as f64 - 2.0];
        // 1.5 m of slope, up to 0.4 m per meter.
        let top = [1.5, -1.5][column] * 0.4 * row as f64 / 2.0;
        // The highest point of a platform that lies in a hollow is its edge, which is as low as its middle.
        let expected = [x, y, top + 0.7];
        for k in 0..3 {
            assert!((poses[(e, k)] - expected[k]).abs() < 1e-9, "{e}: {}, not {expected:?}", poses.slice(s![e, ..3]));
        }
        let from = [x + 0.2, y + 0.1, 5.0];
        let ray = env.sim().batch().read(e, |env| env.data().ray(from, [0.0, 0.0, -1.0], 0b111)).unwrap().unwrap();
        assert!((5.0 - ray.distance - top).abs() < 1e-6, "{e}: {} m", ray.distance);
    }
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
    // Environments keep their numbers in other batches.
    assert_eq!(walkers(5, TerrainLevelsCfg::default()).0.reset(None, Some(5)).unwrap(), levels.slice(s![..5, ..]));
    let (mut low, _) = walkers(12, TerrainLevelsCfg { max_initial_level: Some(0), ..Default::default() });
    assert!(low.reset(None, Some(5)).unwrap().iter().all(|level| *level == 0.0));
}

/// Robots that walked far move up, those that walked little move down.
#[test]
fn levels() {
    let (mut env, robot) = walkers(5, TerrainLevelsCfg::default());
    env.reset(None, Some(1)).unwrap();
    env.set_curriculum("level", &[1.0, 1.0, 1.0, 0.0, 2.0]).unwrap();
    env.reset(None, None).unwrap();
    let mut poses = env.sim().robot(robot).root_pose();
    // Half a tile is 2 m, a quarter 1 m.
    for (e, walked) in [2.1, 1.5, 0.9, 0.0, 3.0].into_iter().enumerate() {
        poses[(e, 1)] += walked;
        poses[(e, 2)] = 4.0;
    }
    env.sim_mut().robot_mut(robot).write_root_pose(&poses, None).unwrap();
    let next = env.step(&Array2::zeros((5, 1))).unwrap().observations;
    assert_eq!(next.slice(s![..4, 0]).to_vec(), [2.0, 1.0, 0.0, 0.0]);
    // Beyond the last row, in a random one.
    assert!([0.0, 1.0, 2.0].contains(&next[(4, 0)]), "{next}");
    let mut random = [0; 3];
    for _ in 0..60 {
        env.set_curriculum("level", &[2.0; 5]).unwrap();
        env.reset(None, None).unwrap();
        let mut poses = env.sim().robot(robot).root_pose();
        poses.column_mut(1).iter_mut().for_each(|y| *y += 2.5);
        poses.column_mut(2).fill(4.0);
        env.sim_mut().robot_mut(robot).write_root_pose(&poses, None).unwrap();
        let next = env.step(&Array2::zeros((5, 1))).unwrap().observations;
        next.iter().for_each(|level| random[*level as usize] += 1);
    }
    // 300 draws of three: 100 ± 6 * 8.2.
    assert!(random.iter().all(|count| (51..150).contains(count)), "{random:?}");
}

#[test]
fn refused() {
    let (_, robot) = walkers(1, TerrainLevelsCfg::default());
    for cfg in [
        TerrainLevelsCfg { max_initial_level: Some(3), ..Default::default() },
        TerrainLevelsCfg { episode_seconds: 0.0, ..Default::default() },
    ] {
        let error = terrain_levels("level", robot, &grid(), cfg).map(drop).unwrap_err();
        assert!(matches!(&error, EnvError::Config { field, .. } if field.contains("\"level\"")), "{error}");
    }
    let (sim, _) = world(cfg(1, 1), false);
    let nan = CurriculumTerm::new("nan", |_| f64::NAN, |_, _, _| Ok(Vec::new()));
    let build =
        EnvBuilder::new(sim, EnvCfg::default()).action(idle()).curriculum(nan).observation(level("nan")).build();
    assert!(matches!(build, Err(EnvError::NotFinite { .. })));
}
