//! Frames and episodes as they are expected of a run, for the datasets that have them.

use ndarray::Axis;
use sensors::Sampled;

/// What a row of an environment is expected to be.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    pub(crate) positions: Vec<f64>,
    pub(crate) velocities: Vec<f64>,
    pub(crate) efforts: Vec<f64>,
    /// Of positions, velocities and efforts.
    pub(crate) targets: [Vec<f64>; 3],
    pub(crate) cube: Vec<f64>,
    /// Measured last since the environment was reset; red, green and blue as hexadecimal numbers.
    pub(crate) picture: Option<String>,
    pub(crate) acceleration: Option<Vec<f64>>,
    joints: bool,
}

impl Row {
    /// Everything that a frame needs.
    fn is_whole(&self) -> bool {
        self.picture.is_some() && self.acceleration.is_some() && self.joints
    }
}

/// What is expected of a run.
pub(crate) struct Expected {
    /// Rows of each environment, from one reset to the next, in the order in which they began.
    runs: Vec<(usize, Vec<Row>)>,
    were: Vec<[u64; 3]>,
}

fn counts(world: &World, env: usize) -> [u64; 3] {
    [
        world.sim.sensor(world.camera).unwrap().frame_counts()[env],
        world.sim.sensor(world.imu).unwrap().sample_counts()[env],
        world.sim.sensor(world.joints).unwrap().sample_counts()[env],
    ]
}

impl Expected {
    /// The rows of the beginning.
    pub(crate) fn new(world: &World) -> Self {
        let envs = 0..world.sim.num_envs();
        let mut all = Self { runs: Vec::new(), were: envs.clone().map(|env| counts(world, env)).collect() };
        envs.for_each(|env| all.begin(world, env));
        all
    }

    /// An environment was reset, or there is one now.
    pub(crate) fn begin(&mut self, world: &World, env: usize) {
        self.were[env] = counts(world, env);
        let row = self.row(world, env, &Row::default());
        self.runs.push((env, vec![row]));
    }

    /// A step was done.
    pub(crate) fn stepped(&mut self, world: &World) {
        for env in 0..world.sim.num_envs() {
            let last = self.runs.iter().rposition(|(of, _)| *of == env).unwrap();
            let before = self.runs[last].1.last().unwrap().clone();
            let row = self.row(world, env, &before);
            self.runs[last].1.push(row);
        }
    }

    fn row(&mut self, world: &World, env: usize, before: &Row) -> Row {
        let robot = world.sim.robot(world.arm);
        let (now, were) = (counts(world, env), self.were[env]);
        let color = || {
            let camera = world.sim.sensor(world.camera).unwrap();
            let color = camera.color().unwrap().index_axis(Axis(0), env).to_owned();
            color.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]]).map(|byte| format!("{byte:02x}")).collect()
        };
        let imu = world.sim.sensor(world.imu).unwrap();
        let of = |values: ndarray::Array2<f64>| values.row(env).to_vec();
        self.were[env] = now;
        Row {
            positions: of(robot.get_qpos()),
            velocities: of(robot.get_qvel()),
            efforts: of(robot.get_qf()),
            targets: [of(robot.get_target_qpos()), of(robot.get_target_qvel()), of(robot.get_target_qf())],
            cube: of(world.sim.rigid_object(world.cube).get_pose()),
            picture: if now[0] == were[0] { before.picture.clone() } else { Some(color()) },
            acceleration: match now[1] == were[1] {
                true => before.acceleration.clone(),
                false => Some(imu.lin_acc_b().row(env).to_vec()),
            },
            joints: before.joints || now[2] != were[2],
        }
    }

    /// The environment of each episode, and its frames, with the row after each, which has its action: the last row has none.
    pub(crate) fn episodes(&self) -> Vec<(usize, Vec<[&Row; 2]>)> {
        let of = |(env, rows): &'_ (usize, Vec<Row>)| -> (usize, Vec<[usize; 2]>) {
            let whole = (1..rows.len()).filter(|next| rows[next - 1].is_whole()).map(|next| [next - 1, next]);
            let frames: Vec<[usize; 2]> = whole.collect();
            assert!(frames.len() > 5 && frames.len() + 1 < rows.len(), "frames, and rows before the first");
            (*env, frames)
        };
        let places = self.runs.iter().map(of).zip(&self.runs);
        places
            .map(|((env, frames), (_, rows))| (env, frames.into_iter().map(|pair| pair.map(|k| &rows[k])).collect()))
            .collect()
    }
}
