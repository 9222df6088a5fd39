//! Configuration of a simulation: sizes, physics, ground and lights of every environment.

use crate::device::Device;
use crate::error::{Error, Result};
use crate::light_cfg::LightCfg;
use crate::mjcf::document::{FrictionCone, Integrator, PhysicsOption};
use crate::shard::Shard;
use crate::surface_cfg::SurfaceCfg;
use nalgebra::Vector3;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Configuration of a simulation. `Default` has the values of EmbodiChain: 100 Hz, gravity, ground and one light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationManagerCfg {
    /// Number of environments.
    pub num_envs: usize,
    /// Device of the physics: `cpu`, `cuda`, `cuda:N` with the number of a GPU, or `warp-cpu`.
    pub device: Device,
    /// Physics time step \[s\]; MuJoCo's time step is `physics_dt / substeps`.
    pub physics_dt: f64,
    /// MuJoCo steps per `physics_dt`.
    pub substeps: u32,
    /// Gravity in world axes \[m/s²\].
    #[serde(with = "kinetoscope_scene::file_format::vector")]
    pub gravity: Vector3<f64>,
    /// Integrator of MuJoCo.
    pub integrator: Integrator,
    /// Friction cone of contacts.
    pub cone: FrictionCone,
    /// Ratio of frictional to normal contact impedance; larger values slip less.
    pub impratio: f64,
    /// Largest number of solver iterations in a step.
    pub solver_iterations: u32,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\] (MuJoCo's three) of shapes that set none.
    pub friction: [f64; 3],
    /// Seed of random numbers. The physics uses no random numbers. Sensor noise and randomized properties use random
    /// streams keyed by this seed, the global index of the environment, and their purpose.
    pub seed: u64,
    /// Number of threads; every core for `None`. All render and cast rays; at most one per environment steps.
    pub threads: Option<usize>,
    /// Distance between neighboring environments in the overview \[m\]. Physics does not depend on it.
    pub arena_space: f64,
    /// Rank of this process and number of processes, if several processes simulate together.
    pub shard: Shard,
    /// Ground plane at z = 0; `None` for a scene without ground.
    #[serde(with = "kinetoscope_scene::file_format::or_false")]
    pub ground: Option<GroundCfg>,
    /// Lights of every environment.
    pub lights: Vec<LightCfg>,
}

/// A ground plane at z = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GroundCfg {
    /// Half of the side length of the rendered plane \[m\]; for collisions the plane is infinite.
    pub half_size: f64,
    /// RGB display color (sRGB), 0..=1.
    pub color: [f64; 3],
    /// True if cameras see a checker pattern with squares of 0.5 m, slightly lighter and darker than the color.
    pub checker: bool,
    /// Surface properties for rendering besides the color, such as reflectance and roughness. They do not affect
    /// friction.
    pub surface: SurfaceCfg,
}

impl Default for GroundCfg {
    fn default() -> Self {
        Self { half_size: 50.0, color: [0.45, 0.47, 0.5], checker: true, surface: SurfaceCfg::default() }
    }
}

impl Default for SimulationManagerCfg {
    fn default() -> Self {
        Self {
            num_envs: 1,
            device: Device::Cpu,
            physics_dt: 0.01,
            substeps: 1,
            gravity: Vector3::new(0.0, 0.0, -9.81),
            integrator: Integrator::Euler,
            cone: FrictionCone::Pyramidal,
            impratio: 1.0,
            solver_iterations: 100,
            friction: [1.0, 0.005, 0.0001],
            seed: 0,
            threads: None,
            arena_space: 5.0,
            shard: Shard::default(),
            ground: Some(GroundCfg::default()),
            lights: vec![LightCfg::default()],
        }
    }
}

impl SimulationManagerCfg {
    /// Preset for grasping: elliptic friction cones with a tangential stiffness of ten times the default, so that
    /// grasped objects hardly slip.
    pub fn manipulation() -> Self {
        Self { cone: FrictionCone::Elliptic, impratio: 10.0, ..Self::default() }
    }

    /// Preset for legged robots: 200 Hz, and elliptic friction cones with a tangential stiffness of a hundred times the
    /// default. With the default, loaded feet creep apart until the robot kneels.
    pub fn legged() -> Self {
        Self { physics_dt: 0.005, cone: FrictionCone::Elliptic, impratio: 100.0, ..Self::default() }
    }

    /// Origins of the environments in the overview \[m\], shape (N, 3): a grid with `arena_space` between neighbors.
    ///
    /// rows = ceil(n / floor(sqrt n)), cols = ceil(n / rows); environment k is in row k div cols, column k mod cols.
    /// Rows follow each other along -x, columns along +y. The center of the grid is the origin.
    pub fn env_origins(&self) -> Array2<f64> {
        let n = self.num_envs;
        let rows = n.div_ceil(n.isqrt().max(1)).max(1);
        let cols = n.div_ceil(rows);
        let space = self.arena_space;
        let mut origins = Array2::zeros((n, 3));
        for (k, mut origin) in origins.rows_mut().into_iter().enumerate() {
            let (i, j) = ((k / cols) as f64, (k % cols) as f64);
            origin[0] = -(i - (rows - 1) as f64 / 2.0) * space;
            origin[1] = (j - (cols - 1) as f64 / 2.0) * space;
        }
        origins
    }

    /// Number of physics steps in a time \[s\], which must be a whole number of `physics_dt`.
    ///
    /// # Errors
    /// The time is negative, is not a whole number of steps, or is more than `u32::MAX` steps.
    pub fn steps_in(&self, seconds: f64) -> Result<u32> {
        let steps = seconds / self.physics_dt;
        let whole = steps.round();
        // Tolerance for the quotient of two rounded numbers: 0.1 / 0.005 need not be 20.
        if !((steps - whole).abs() <= 1e-6 && (0.0..=f64::from(u32::MAX)).contains(&whole)) {
            return Err(Error::Config {
                field: "seconds",
                value: seconds.to_string(),
                expected: "it must be a whole number of physics_dt, at most 4294967295 of them",
            });
        }
        Ok(whole as u32)
    }

    /// Number of threads for rendering and ray casting: [`threads`](Self::threads), or the number of cores. Stepping
    /// uses at most one thread per environment.
    pub fn num_threads(&self) -> usize {
        self.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get))
    }

    /// Checks every number.
    ///
    /// # Errors
    /// A field is out of range; the first one is reported.
    pub fn validate(&self) -> Result<()> {
        let fail = |field, value: &dyn std::fmt::Display, expected| {
            Err(Error::Config { field, value: value.to_string(), expected })
        };
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if self.num_envs == 0 {
            return fail("num_envs", &0, "a simulation needs at least 1 environment");
        }
        if self.num_envs > MAX_ENVS {
            return fail("num_envs", &self.num_envs, "one process can hold at most 1048576 environments");
        }
        let Shard { rank, world } = self.shard;
        let shard = format!("rank {rank} of {world}");
        if rank >= world {
            return fail("shard", &shard, "the rank must be 0 to the number of processes - 1");
        }
        if world.checked_mul(self.num_envs).is_none() {
            return fail("shard", &shard, "the environments of all processes must be fewer than 2^64");
        }
        if !positive(self.physics_dt) || self.physics_dt > 1.0 {
            return fail("physics_dt", &self.physics_dt, "it must be above 0 and at most 1 second, such as 0.01");
        }
        if self.substeps == 0 || self.substeps > 10_000 {
            return fail("substeps", &self.substeps, "it must be 1 to 10000");
        }
        if self.physics_dt / f64::from(self.substeps) < 1e-9 {
            return fail("physics_dt", &self.physics_dt, "physics_dt / substeps must be at least 1e-9 seconds");
        }
        if !self.gravity.iter().all(|g| g.is_finite()) {
            return fail(
                "gravity",
                &format!("{:?}", self.gravity.as_slice()),
                "it must be finite, such as (0, 0, -9.81)",
            );
        }
        if !positive(self.impratio) {
            return fail("impratio", &self.impratio, "it must be above 0");
        }
        if self.solver_iterations == 0 || self.solver_iterations > 1_000_000 {
            return fail("solver_iterations", &self.solver_iterations, "it must be 1 to 1000000");
        }
        if !self.friction.iter().all(|f| f.is_finite() && *f >= 0.0) {
            return fail("friction", &format!("{:?}", self.friction), "the three coefficients must be >= 0");
        }
        if let Some(threads) = self.threads
            && !(1..=1024).contains(&threads)
        {
            return fail("threads", &threads, "it must be 1 to 1024; leave it out to use every core");
        }
        if !(self.arena_space.is_finite() && self.arena_space >= 0.0) {
            return fail("arena_space", &self.arena_space, "it must be a distance >= 0 in meters");
        }
        if let Some(ground) = &self.ground
            && !positive(ground.half_size)
        {
            return fail("ground.half_size", &ground.half_size, "it must be above 0 meters");
        }
        if let Some(ground) = &self.ground
            && !ground.color.iter().all(|c| (0.0..=1.0).contains(c))
        {
            return fail("ground.color", &format!("{:?}", ground.color), "each component must be 0 to 1");
        }
        self.ground.iter().try_for_each(|ground| ground.surface.validate())?;
        self.lights.iter().try_for_each(LightCfg::validate)?;
        Ok(())
    }

    /// Global index of the first environment of this process.
    pub fn first_env(&self) -> usize {
        self.shard.rank * self.num_envs
    }

    pub(crate) fn physics_option(&self) -> PhysicsOption {
        PhysicsOption {
            timestep: self.physics_dt / f64::from(self.substeps),
            gravity: self.gravity,
            integrator: self.integrator,
            cone: self.cone,
            impratio: self.impratio,
            iterations: self.solver_iterations,
            friction: self.friction,
        }
    }
}

/// Upper limit that catches typing errors before they fill the memory; no machine steps this many environments.
const MAX_ENVS: usize = 1 << 20;
