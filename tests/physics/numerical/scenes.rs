//! Scenes for comparisons of different runs: quadrupeds with drives that fall on the ground.

use crate::lab::*;
use crate::law::max_or_nan;

/// A quadruped in each environment that falls from half a meter, with its own rotation and push.
#[derive(Debug)]
pub(super) struct Fall {
    pub(super) sim: SimulationManager,
    robot: RobotId,
}

impl Fall {
    /// Creates the scene; `nudge` is added to the first joint's velocity in environment 0 \[rad/s\].
    pub(super) fn new(cfg: SimulationManagerCfg, nudge: f64) -> Self {
        let mut sim = SimulationManager::new(cfg).unwrap();
        let robot = RobotCfg {
            urdf: UrdfCfg::single(assets::path("quadruped/quadruped.urdf").unwrap()),
            drive: implicit(80.0, 5.0),
            fix_base: false,
            ..RobotCfg::default()
        };
        let robot = sim.add_robot(robot).unwrap();
        for env in 0..sim.num_envs() {
            let k = env as f64;
            let pose = kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.8], [0.3 * k.sin(), 0.2, 0.1 * k]);
            let ids = [EnvId(env)];
            let mut written = sim.robot_mut(robot);
            written.write_root_pose(&pose_row(&pose), Some(&ids)).unwrap();
            let velocity = [0.5 * k.cos(), 0.1, 0.0, 0.0, 1.0, k.sin()];
            written.write_root_velocity(&row(&velocity), Some(&ids)).unwrap();
            let mut v = vec![0.0; written.read().dof()];
            v[0] = if env == 0 { nudge } else { 0.0 };
            written.write_qvel(&row(&v), None, Some(&ids)).unwrap();
        }
        Self { sim, robot }
    }

    /// Adds to the velocity of the first joint of an environment \[rad/s\].
    pub(super) fn add_joint_velocity(&mut self, env: usize, faster: f64) {
        let mut robot = self.sim.robot_mut(self.robot);
        let mut v = robot.read().qvel().row(env).to_vec();
        v[0] += faster;
        robot.write_qvel(&row(&v), None, Some(&[EnvId(env)])).unwrap();
    }

    /// Steps; asserts that no environment diverged and MuJoCo gave no warning.
    #[track_caller]
    pub(super) fn update(&mut self, steps: u32) {
        self.sim.update(steps);
        assert_healthy(&self.sim);
    }

    /// The complete state of one environment.
    pub(super) fn state(&self, env: usize) -> Vec<f64> {
        let robot = self.sim.robot(self.robot);
        let arrays = [robot.root_state(), robot.qpos(), robot.qvel(), robot.qf()];
        arrays.iter().flat_map(|array| array.row(env).to_vec()).collect()
    }

    /// True if every robot touches the ground, so that the comparison includes contacts.
    pub(super) fn has_landed(&self) -> bool {
        // A base below 0.7 m has fallen; without the ground it would be below 0 after half a second.
        (0..self.sim.num_envs()).all(|env| (0.1..0.7).contains(&self.state(env)[2]))
    }
}

/// The legged preset with `threads` threads and `num_envs` environments.
pub(super) fn legged(num_envs: usize, threads: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, threads: Some(threads), lights: Vec::new(), ..SimulationManagerCfg::legged() }
}

/// The largest difference between two states; infinite for equal numbers with different bits.
pub(super) fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let apart = |(a, b): (&f64, &f64)| {
        let apart = (a - b).abs();
        if a.to_bits() != b.to_bits() && apart == 0.0 { f64::INFINITY } else { apart }
    };
    a.iter().zip(b).map(apart).fold(0.0, max_or_nan)
}
