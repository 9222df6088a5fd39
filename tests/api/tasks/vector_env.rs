//! One generic loop over different implementations of batched environments.

use super::bundled::{cart_env, cart_task, cfg, world};
use kinetoscope::ndarray::{Array1, Array2, ArrayView2, Axis, array};
use kinetoscope::tasks::{EnvCfg, EnvError, Space, Step, StepInfo, VectorEnv};

/// The time step of the tests' worlds \[s\].
const DT: f64 = 0.01;

/// Carts on rails by their equation alone: v' = F / m, x' = v, in semi-implicit Euler steps as in MuJoCo.
pub(crate) struct Carts {
    spaces: [Space; 2],
    mass: f64,
    limit: u64,
    /// Position, velocity and step count of each cart; `None` before the first reset.
    carts: Vec<Option<(f64, f64, u64)>>,
}

#[derive(Debug, PartialEq)]
pub(crate) enum CartError {
    Count { found: usize, expected: usize },
    ResetFirst(usize),
}

impl std::fmt::Display for CartError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for CartError {}

impl Carts {
    pub(crate) fn new(num_envs: usize, mass: f64, limit: u64) -> Self {
        let place = Space::uniform(["place/x"], [f64::NEG_INFINITY, f64::INFINITY]).unwrap();
        let push = Space::uniform(["push/slide"], [-10.0, 10.0]).unwrap();
        Self { spaces: [place, push], mass, limit, carts: vec![None; num_envs] }
    }

    fn check(&self, found: usize) -> Result<(), CartError> {
        let expected = self.carts.len();
        if found == expected { Ok(()) } else { Err(CartError::Count { found, expected }) }
    }

    fn seen(&self) -> Array2<f64> {
        self.carts.iter().map(|cart| cart.map_or(0.0, |(x, ..)| x)).collect::<Array1<f64>>().insert_axis(Axis(1))
    }
}

impl VectorEnv for Carts {
    type Error = CartError;
    type Info = ();

    fn num_envs(&self) -> usize {
        self.carts.len()
    }

    fn observation_space(&self) -> &Space {
        &self.spaces[0]
    }

    fn action_space(&self) -> &Space {
        &self.spaces[1]
    }

    fn reset(&mut self, mask: Option<&[bool]>, _: Option<u64>) -> Result<Array2<f64>, CartError> {
        mask.map_or(Ok(()), |mask| self.check(mask.len()))?;
        for k in (0..self.carts.len()).filter(|k| mask.is_none_or(|mask| mask[*k])) {
            self.carts[k] = Some((0.0, 0.0, 0));
        }
        Ok(self.seen())
    }

    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step<()>, CartError> {
        self.check(actions.nrows())?;
        let n = self.carts.len();
        for (k, cart) in self.carts.iter_mut().enumerate() {
            let (x, v, steps) = cart.as_mut().ok_or(CartError::ResetFirst(k))?;
            *v += DT * actions[(k, 0)].clamp(-10.0, 10.0) / self.mass;
            *x += DT * *v;
            *steps += 1;
        }
        let final_observations = self.seen();
        let rewards = -final_observations.column(0).to_owned();
        let over = |cart: &Option<(f64, f64, u64)>| cart.is_some_and(|(.., steps)| steps == self.limit);
        let truncated: Array1<bool> = self.carts.iter().map(over).collect();
        let observations = self.reset(Some(&truncated.to_vec()), None)?;
        let terminated = Array1::from_elem(n, false);
        Ok(Step { observations, final_observations, rewards, terminated, truncated, info: () })
    }
}

/// Results of a loop: observations, rewards and ends.
#[derive(Debug, Default)]
struct Log {
    numbers: Vec<f64>,
    ends: Vec<(usize, usize)>,
}

/// A training loop for any type of environment. The middle cart restarts after 13 steps.
fn run_loop<E: VectorEnv>(env: &mut E, steps: usize) -> Result<Log, E::Error> {
    let mut log = Log::default();
    let n = env.num_envs();
    let mut seen = env.reset(None, Some(1))?;
    for k in 0..steps {
        if k == 13 {
            seen = env.reset(Some(&(0..n).map(|env| env == 1).collect::<Vec<bool>>()), None)?;
        }
        // Some actions exceed the bounds.
        let actions =
            Array2::from_shape_fn((n, env.action_space().len()), |(e, _)| 6.0 * (e + 1) as f64 - 30.0 * seen[(e, 0)]);
        let step = env.step(actions.view())?;
        log.numbers.extend(step.final_observations.iter().chain(&step.observations).chain(&step.rewards));
        log.ends.extend((0..n).filter(|&e| step.truncated[e] || step.terminated[e]).map(|e| (k, e)));
        seen = step.observations;
    }
    Ok(log)
}

#[test]
fn one_loop() {
    let mut task = cart_env(3, Some(20));
    let mut carts = Carts::new(3, 1.0, 20);
    assert_eq!(VectorEnv::observation_space(&task), VectorEnv::observation_space(&carts));
    assert_eq!(VectorEnv::action_space(&task), VectorEnv::action_space(&carts));
    let (of_task, by_hand) = (run_loop(&mut task, 50).unwrap(), run_loop(&mut carts, 50).unwrap());
    assert_eq!(of_task.ends, by_hand.ends);
    assert_eq!(by_hand.ends[..3], [(19, 0), (19, 2), (32, 1)]);
    assert_eq!(of_task.numbers.len(), 50 * 9);
    // 20 steps of sums of numbers below 1 in another order, and a feedback with a gain of at most 1: rounding of 20 x
    // 20 x 2^-53.
    let apart = |a: &Log, b: &Log| a.numbers.iter().zip(&b.numbers).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart(&of_task, &by_hand) < 1e-12, "{}", apart(&of_task, &by_hand));
    // Control: carts with 0.1 % more mass move differently.
    let heavy = run_loop(&mut Carts::new(3, 1.001, 20), 50).unwrap();
    assert!(apart(&of_task, &heavy) > 1e-5);
}

#[test]
fn errors() {
    let mut carts = Carts::new(2, 1.0, 5);
    assert_eq!(carts.step(array![[1.0], [1.0]].view()).unwrap_err(), CartError::ResetFirst(0));
    assert_eq!(carts.reset(Some(&[true]), None).unwrap_err(), CartError::Count { found: 1, expected: 2 });
    // The type of environment can be chosen at run time.
    let (sim, robot) = world(cfg(2, 1), false);
    let task = cart_task(sim, robot, EnvCfg::default()).build().unwrap();
    let mut chosen: Box<dyn VectorEnv<Error = EnvError, Info = StepInfo>> = Box::new(task);
    assert!(matches!(chosen.step(array![[1.0], [1.0]].view()), Err(EnvError::ResetFirst { env: 0 })));
    chosen.reset(None, None).unwrap();
    assert!(matches!(chosen.step(array![[1.0]].view()), Err(EnvError::Shape { .. })));
    assert_eq!(chosen.step(array![[1.0], [1.0]].view()).unwrap().info.reward_terms.dim(), (2, 1));
}
