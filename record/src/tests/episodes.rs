//! Expected frames and episodes of datasets.

use super::*;

/// Expected values of a row of an environment.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExpectedRow {
    pub(crate) positions: Vec<f64>,
    pub(crate) velocities: Vec<f64>,
    pub(crate) efforts: Vec<f64>,
    /// Targets of positions, velocities and efforts.
    pub(crate) targets: [Vec<f64>; 3],
    pub(crate) cube: Vec<f64>,
    /// Last image since the reset of the environment: red, green and blue as hexadecimal numbers.
    pub(crate) image: Option<String>,
    pub(crate) acceleration: Option<Vec<f64>>,
    joints: bool,
}

impl ExpectedRow {
    /// True if it has everything that a frame needs.
    fn is_whole(&self) -> bool {
        self.image.is_some() && self.acceleration.is_some() && self.joints
    }
}

/// Expected rows of a run.
pub(crate) struct Expected {
    /// Rows of each environment, from one reset to the next, in the order in which they began.
    runs: Vec<(usize, Vec<ExpectedRow>)>,
    last_counts: Vec<[u64; 3]>,
}

fn counts(world: &World, env: usize) -> [u64; 3] {
    [
        world.sim.sensor(world.camera).unwrap().frame_counts()[env],
        world.sim.sensor(world.imu).unwrap().sample_counts()[env],
        world.sim.sensor(world.joints).unwrap().sample_counts()[env],
    ]
}

impl Expected {
    /// Records a run in which environment 1 is reset after a step, and collects what is expected of it.
    pub(crate) fn record(cfgs: &[RecorderCfg], steps: u32, reset_after: u32) -> (World, Self, Vec<RecordingSummary>) {
        let mut world = World::new(2, 2);
        let recorders: Vec<_> = cfgs.iter().map(|cfg| world.sim.record(cfg.clone()).unwrap()).collect();
        let mut all = Self { runs: Vec::new(), last_counts: vec![[0; 3]; 2] };
        (0..2).for_each(|env| all.begin(&world, env));
        for step in 0..steps {
            world.step(step);
            for env in 0..2 {
                let last = all.runs.iter().rposition(|(of, _)| *of == env).unwrap();
                let before = all.runs[last].1.last().unwrap().clone();
                let row = all.row(&world, env, &before);
                all.runs[last].1.push(row);
            }
            if step == reset_after {
                world.sim.reset(Some(&[EnvId(1)])).unwrap();
                all.begin(&world, 1);
            }
        }
        assert!(cfgs.iter().all(|cfg| !cfg.path.exists()), "a dataset has its name when it is whole");
        let recorded = recorders.into_iter().map(|recorder| world.sim.finish_recording(recorder).unwrap()).collect();
        (world, all, recorded)
    }

    fn begin(&mut self, world: &World, env: usize) {
        self.last_counts[env] = counts(world, env);
        let row = self.row(world, env, &ExpectedRow::default());
        self.runs.push((env, vec![row]));
    }

    fn row(&mut self, world: &World, env: usize, before: &ExpectedRow) -> ExpectedRow {
        let robot = world.sim.robot(world.arm);
        let (now, were) = (counts(world, env), self.last_counts[env]);
        let color = || {
            let color = world.sim.sensor(world.camera).unwrap().color().unwrap().index_axis(Axis(0), env).to_owned();
            rgb(&color).iter().map(|byte| format!("{byte:02x}")).collect()
        };
        let imu = world.sim.sensor(world.imu).unwrap();
        let of = |values: Array2<f64>| values.row(env).to_vec();
        self.last_counts[env] = now;
        ExpectedRow {
            positions: of(robot.qpos()),
            velocities: of(robot.qvel()),
            efforts: of(robot.qf()),
            targets: [of(robot.qpos_target()), of(robot.qvel_target()), of(robot.qf_target())],
            cube: of(world.sim.rigid_object(world.cube).pose()),
            image: if now[0] == were[0] { before.image.clone() } else { Some(color()) },
            acceleration: match now[1] == were[1] {
                true => before.acceleration.clone(),
                false => Some(imu.lin_acc_b().row(env).to_vec()),
            },
            joints: before.joints || now[2] != were[2],
        }
    }

    /// Environment and frames of each episode. Each frame is paired with the next row, which has its action. The last
    /// row is no frame.
    pub(crate) fn episodes(&self) -> Vec<(usize, Vec<[&ExpectedRow; 2]>)> {
        let of = |(env, rows): &'_ (usize, Vec<ExpectedRow>)| -> (usize, Vec<[usize; 2]>) {
            let whole = (1..rows.len()).filter(|next| rows[next - 1].is_whole()).map(|next| [next - 1, next]);
            let frames: Vec<[usize; 2]> = whole.collect();
            assert!(frames.len() > 5 && frames.len() + 1 < rows.len(), "frames, and rows before the first");
            (*env, frames)
        };
        let indices = self.runs.iter().map(of).zip(&self.runs);
        indices
            .map(|((env, frames), (_, rows))| (env, frames.into_iter().map(|pair| pair.map(|k| &rows[k])).collect()))
            .collect()
    }
}
