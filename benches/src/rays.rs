//! Height scans: our ray caster compared with MuJoCo's, on the same rough terrain of 100 000 triangles, as a mesh and
//! as a height field. Both sides use one thread, and a check before the benchmark ensures that they measure the same
//! distances.
//!
//! Our side is the whole sensor as a simulation updates it: frames, 187 rays in each of 64 environments, distances,
//! points, normals and ids. MuJoCo measures distances only. There are three comparisons:
//!
//! - Vertical rays from 20 m above, against `mj_ray`, one ray at a time.
//! - The same rays against `mj_multiRay`. That function casts all of its rays from one point and cannot cast parallel
//!   rays. It gets its best case of the same task: one call for each environment, from the middle of the scanner to the
//!   points hit by the parallel rays. (2.2.2 has no `mj_multiRay`.)
//! - A fan of rays from that point to a level grid of the scanner's size: the same rays on both sides.

use crate::interleave::{Contender, MeasurementCfg, in_both_orders, measure};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{BUILD_VERSION, Data, SupportedVersion};
use kinetoscope::ndarray::{Array2, Array3, Axis};
use kinetoscope::scene::mesh::write_binary_stl;
use kinetoscope::scene::shape::HeightField;
use kinetoscope::scene::{Pose, PoseF64, SceneState, pose};
use kinetoscope::sensors::ray::pattern::{Custom, Grid};
use kinetoscope::sensors::ray::{HitTargets, RayAlignment, RayCaster, RayCasterCfg, RayPattern};
use kinetoscope::sensors::{Sensor, SensorCfg, SensorContext};
use kinetoscope::sim::VisualScene;
use std::time::{Duration, Instant};

const ENVS: usize = 64;
/// Points along a side: 224 x 224 cells of two triangles.
const SIDE: usize = 225;
/// Half of a side \[m\]: cells of 0.1 m.
const HALF: f64 = 11.2;
const HEIGHT: f64 = 1.0;
const FLOOR: f64 = 0.5;
/// Height of the sensor above its body \[m\].
const SENSOR_HEIGHT: f64 = 20.0;
/// Target of the speed ratio.
const TARGET_RATIO: f64 = 5.0;
/// Tolerance of distances \[m\]: mesh coordinates are in single precision on both sides, rounded in different frames.
const DISTANCE_TOLERANCE: f64 = 1e-4;

/// Terrain as a mesh, or as a height field.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Terrain {
    Mesh,
    Field,
}

impl Terrain {
    fn name(self) -> &'static str {
        match self {
            Self::Mesh => "mesh",
            Self::Field => "height field",
        }
    }

    /// Number of baseline rays per step; 2.2.2 tests every triangle of a mesh.
    fn baseline_rays(self) -> usize {
        if self == Self::Mesh && BUILD_VERSION == SupportedVersion::V2 { 16 } else { 4096 }
    }

    fn data(self) -> BenchResult<Data> {
        let elevation: Vec<f32> = (0..SIDE * SIDE).map(|k| rough(k % SIDE, k / SIDE) as f32).collect();
        let (asset, geom, file) = match self {
            Self::Mesh => {
                let field = HeightField::new([HALF, HALF, HEIGHT, FLOOR], SIDE, SIDE, &elevation);
                let field = field.ok_or("terrain without points")?;
                // The surface alone: the long triangles of the floor make MuJoCo thirty times slower.
                let mut mesh = field.mesh().to_tri_mesh();
                let is_surface = |t: &[u32; 3]| t.iter().all(|&i| mesh.positions[i as usize][2] >= 0.0);
                mesh.triangles.retain(is_surface);
                if mesh.triangles.len() != 2 * (SIDE - 1) * (SIDE - 1) {
                    return Err("terrain has two triangles in each cell".into());
                }
                let mut bytes = Vec::new();
                write_binary_stl(&mesh, &mut bytes)?;
                // The surface has no volume; only MuJoCo 4 checks this.
                let inertia = if BUILD_VERSION == SupportedVersion::V4 { "inertia='shell'" } else { "" };
                (format!("<mesh name='t' file='t.stl' {inertia}/>"), "type='mesh' mesh='t'", ("t.stl", bytes))
            }
            Self::Field => {
                let side = SIDE as i32;
                let mut bytes: Vec<u8> = [side, side].iter().flat_map(|n| n.to_le_bytes()).collect();
                bytes.extend(elevation.iter().flat_map(|e| e.to_le_bytes()));
                let asset = format!("<hfield name='t' file='t.bin' size='{HALF} {HALF} {HEIGHT} {FLOOR}'/>");
                (asset, "type='hfield' hfield='t'", ("t.bin", bytes))
            }
        };
        let xml = format!(
            "<mujoco><asset>{asset}</asset><worldbody><geom name='terrain' {geom} contype='0' conaffinity='0'/></worldbody></mujoco>"
        );
        let assets = [mj::Asset { name: file.0.into(), bytes: file.1 }];
        let mut data = Data::new(&mj::compile(&xml, &assets)?.into_model())?;
        data.step1()?;
        Ok(data)
    }
}

/// Hills with noise between 0 and 1. The first samples of the first two rows are 0 and 1, because MuJoCo normalizes the
/// field to that range.
fn rough(i: usize, j: usize) -> f64 {
    let mut hash = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    hash = (hash ^ (hash >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let noise = (hash >> 40) as f64 / f64::from(1u32 << 24);
    match (i, j) {
        (0, 0) => 0.0,
        (0, 1) => 1.0,
        _ => 0.5 + 0.3 * (0.13 * i as f64).sin() * (0.17 * j as f64).cos() + 0.2 * (noise - 0.5),
    }
}

/// Our side: the sensor, and the state that it reads.
struct Ours {
    caster: RayCaster,
    state: SceneState,
}

impl Ours {
    fn new(data: &Data, pattern: RayPattern) -> BenchResult<Self> {
        let visible = VisualScene::of_model(data.model());
        let instances = visible.scene().instances().len();
        let mut poses = vec![PoseF64::IDENTITY; instances];
        visible.read_poses_f64(data, &mut poses);
        let mut bodies = Array3::zeros((ENVS, 1, 7));
        for (env, mut rows) in bodies.axis_iter_mut(Axis(0)).enumerate() {
            let (x, y) = (1.1 * (env % 8) as f64 - 3.9, 1.1 * (env / 8) as f64 - 3.9);
            let pose = pose::from_xyz_rpy([2.0 * x + 0.013, 2.0 * y + 0.029, 1.5], [0.1, -0.2, 0.7 * env as f64]);
            rows.iter_mut().zip(pose::to_row(&pose)).for_each(|(to, from)| *to = from);
        }
        let state = SceneState {
            body_poses: Some(bodies),
            instance_poses: Some(Array2::from_shape_fn((ENVS, instances), |(_, k)| poses[k])),
            ..SceneState::new(ENVS)
        };
        let context = SensorContext {
            num_envs: ENVS,
            dt: 0.005,
            name: "scanner".into(),
            bodies: ["base".to_string()].into(),
            scene: Some(visible.scene().clone()),
            threads: 1,
            ..SensorContext::default()
        };
        let cfg = RayCasterCfg {
            parent: Some("base".into()),
            offset: Pose::translation(0.0, 0.0, SENSOR_HEIGHT),
            alignment: RayAlignment::Yaw,
            targets: HitTargets::StaticOnly,
            pattern,
            ..RayCasterCfg::default()
        };
        let mut caster = cfg.build(&context)?;
        caster.reset(&(0..ENVS).collect::<Vec<_>>(), &state)?;
        Ok(Self { caster, state })
    }

    fn rays(&self) -> usize {
        ENVS * self.caster.num_rays()
    }

    /// Origins and directions of the rays.
    fn lines(&self) -> Vec<([f64; 3], [f64; 3])> {
        let (starts, directions) = (self.caster.ray_starts(), self.caster.ray_directions());
        let row = |a: &Array3<f64>, env, k| [0, 1, 2].map(|axis| a[(env, k, axis)]);
        let all = (0..ENVS).flat_map(|env| (0..self.caster.num_rays()).map(move |k| (env, k)));
        all.map(|(env, k)| (row(&starts, env, k), row(&directions, env, k))).collect()
    }
}

/// A pattern of rays from one point to the usual grid at half the height of the terrain.
fn fan() -> BenchResult<RayPattern> {
    let down = 1.5 + SENSOR_HEIGHT - 0.5 * HEIGHT;
    let directions: Vec<_> =
        RayPattern::from(Grid::default()).rays()?.iter().map(|ray| [ray.origin[0], ray.origin[1], -down]).collect();
    Ok(Custom { starts: vec![[0.0; 3]; directions.len()], directions }.into())
}

impl Contender for Ours {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.state.step.iter_mut().for_each(|step| *step += 1);
            self.caster.update(&self.state)?;
        }
        Ok(start.elapsed())
    }
}

/// The `mj_ray` baseline: one ray after the other, a part of all rays in every step.
struct SingleRays<'d> {
    data: &'d Data,
    rays: Vec<([f64; 3], [f64; 3])>,
    distances: Vec<f64>,
    per_step: usize,
    next: usize,
}

impl<'d> SingleRays<'d> {
    fn new(data: &'d Data, ours: &Ours, per_step: usize) -> Self {
        let rays = ours.lines();
        Self { data, distances: vec![0.0; rays.len()], rays, per_step, next: 0 }
    }

    fn cast(&mut self, count: usize) -> BenchResult<()> {
        for _ in 0..count {
            let (origin, direction) = self.rays[self.next];
            let hit = self.data.ray(origin, direction, 1)?;
            self.distances[self.next] = hit.map_or(f64::INFINITY, |hit| hit.distance);
            self.next = (self.next + 1) % self.rays.len();
        }
        Ok(())
    }

    /// Checks that distances agree. Slow baselines check only every 37th ray, to finish within seconds.
    fn check_agreement(&mut self, ours: &Ours) -> BenchResult<()> {
        let (every, rays) = (if self.per_step < 1000 { 37 } else { 1 }, ours.caster.num_rays());
        for k in (0..self.rays.len()).step_by(every) {
            self.next = k;
            self.cast(1)?;
            let (a, b) = (ours.caster.distances()[(k / rays, k % rays)], self.distances[k]);
            if a.is_nan() || a.is_infinite() || (a - b).abs() > DISTANCE_TOLERANCE {
                return Err(format!("ray {k}: ours measures {a} m, mj_ray {b} m").into());
            }
        }
        self.next = 0;
        Ok(())
    }
}

impl Contender for SingleRays<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.cast(self.per_step)?;
        }
        Ok(start.elapsed())
    }
}

/// The `mj_multiRay` baseline: one call for each environment, with all of its rays.
struct MultiRays {
    data: Data,
    points: Vec<[f64; 3]>,
    directions: Vec<[f64; 3]>,
    distances: Vec<f64>,
}

impl MultiRays {
    /// Rays from the middle of each scanner to all points that our rays hit.
    fn new(data: &Data, ours: &Ours) -> BenchResult<Self> {
        let mut data = Data::new(data.model())?;
        data.step1()?;
        let rays = ours.caster.num_rays();
        let lines = ours.lines();
        let mut together = Self { data, points: vec![], directions: vec![], distances: vec![0.0; lines.len()] };
        for scan in lines.chunks(rays) {
            let middle = [0, 1, 2].map(|k| 0.5 * (scan[0].0[k] + scan[rays - 1].0[k]));
            together.points.push(middle);
        }
        for (k, (start, direction)) in lines.iter().enumerate() {
            let (env, ray) = (k / rays, k % rays);
            let distance = ours.caster.distances()[(env, ray)];
            let to = [0, 1, 2].map(|k| start[k] + distance * direction[k] - together.points[env][k]);
            let length = to.iter().map(|x| x * x).sum::<f64>().sqrt();
            together.directions.push(to.map(|x| x / length));
        }
        Ok(together)
    }

    fn cast(&mut self) -> BenchResult<()> {
        let rays = self.directions.len() / ENVS;
        let scans = self.directions.chunks(rays).zip(self.distances.chunks_mut(rays));
        for (point, (directions, distances)) in self.points.iter().zip(scans) {
            self.data.multi_ray(*point, directions, 1, distances)?;
        }
        Ok(())
    }

    /// Checks that both hit the same points, or that the terrain blocks the ray from the middle earlier.
    fn check_agreement(&mut self, ours: &Ours) -> BenchResult<()> {
        self.cast()?;
        let rays = ours.caster.num_rays();
        let mut before = 0;
        for (k, (&distance, direction)) in self.distances.iter().zip(&self.directions).enumerate() {
            let (env, ray) = (k / rays, k % rays);
            let hit = [0, 1, 2].map(|axis| self.points[env][axis] + distance * direction[axis]);
            let off = (0..3).map(|axis| hit[axis] - ours.caster.hits()[(env, ray, axis)]);
            let off = off.map(|x| x * x).sum::<f64>().sqrt();
            let full = (0..3).map(|axis| ours.caster.hits()[(env, ray, axis)] - self.points[env][axis]);
            let full = full.map(|x| x * x).sum::<f64>().sqrt();
            if distance < full - DISTANCE_TOLERANCE && distance > 0.0 {
                before += 1;
            } else if off.is_nan() || off > DISTANCE_TOLERANCE {
                return Err(format!("ray {k}: mj_multiRay hits {off} m beside ours").into());
            }
        }
        if before * 100 > self.distances.len() {
            return Err(format!("{before} of {} rays of mj_multiRay hit something else", self.distances.len()).into());
        }
        Ok(())
    }
}

impl Contender for MultiRays {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.cast()?;
        }
        Ok(start.elapsed())
    }
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for terrain in [Terrain::Mesh, Terrain::Field] {
        let data = terrain.data()?;
        let plan = MeasurementCfg { seconds: 0.5 * settings.seconds, restart_after: u32::MAX };
        let down = format!("{ENVS} scans of 187 rays, {}", terrain.name());
        eprintln!("  {down}");
        rows.push(against_mj_ray(plan, &data, terrain, &down)?);
        rows.push(against_mj_multi_ray(plan, &data, &down, &Grid::default().into())?);
        let fans = format!("{ENVS} fans of 187 rays, {}", terrain.name());
        eprintln!("  {fans}");
        rows.push(against_mj_multi_ray(plan, &data, &fans, &fan()?)?);
    }
    Ok(rows)
}

/// Vertical rays against `mj_ray`.
fn against_mj_ray(plan: MeasurementCfg, data: &Data, terrain: Terrain, name: &str) -> BenchResult<Row> {
    let count = [ENVS * 187, terrain.baseline_rays()].map(|n| n as f64);
    let times = in_both_orders(|_| {
        let mut ours = Ours::new(data, Grid::default().into())?;
        let mut bare = SingleRays::new(data, &ours, terrain.baseline_rays());
        if ours.rays() != ENVS * 187 {
            return Err("a scan has 187 rays".into());
        }
        bare.check_agreement(&ours)?;
        measure(plan, &mut [&mut ours, &mut bare])
    })?;
    let per_ray = |t: &[f64]| [t[0] / count[0], t[1] / count[1]];
    let ratio = times.mean_of(|t| per_ray(t)[1] / per_ray(t)[0]);
    let rate = |side: usize| times.rate(side, count[side] as usize);
    Ok(Row::new("rays", name, "rays/s", 1, rate(0)).against("mj_ray", rate(1), ratio).with_target_ratio(TARGET_RATIO))
}

/// Rays of a pattern against `mj_multiRay`; only our side on versions without that function.
fn against_mj_multi_ray(plan: MeasurementCfg, data: &Data, name: &str, pattern: &RayPattern) -> BenchResult<Row> {
    let has_rival = BUILD_VERSION == SupportedVersion::V4;
    let times = in_both_orders(|_| {
        let mut ours = Ours::new(data, pattern.clone())?;
        if !has_rival {
            return measure(plan, &mut [&mut ours]);
        }
        let mut together = MultiRays::new(data, &ours)?;
        together.check_agreement(&ours)?;
        measure(plan, &mut [&mut ours, &mut together])
    })?;
    let rate = |side: usize| times.rate(side, ENVS * 187);
    let row = Row::new("rays", name, "rays/s", 1, rate(0));
    Ok(match has_rival {
        true => row.against("mj_multiRay", rate(1), times.ratio(0, 1)).with_target_ratio(TARGET_RATIO),
        false => row.without("mj_multiRay"),
    })
}
