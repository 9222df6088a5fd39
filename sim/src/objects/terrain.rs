//! Terrain: uneven ground as a height field.

use crate::error::{Error, Result};
use crate::objects::robot_data::check_pose;
use crate::objects::terrain_file::{TerrainFile, rows};
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_scene::Pose;
use kinetoscope_scene::terrain::{MAX_POINTS, TerrainGenerator};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Configuration of a terrain: a height field that is fixed in every environment.
///
/// Contact sensors treat it as part of the `world`. [`kinetoscope_scene::terrain`] has generators of heights. The
/// ground plane at z = 0 hides everything below it: leave the plane out (`ground: None`) or place the terrain above it.
///
/// ```
/// use kinetoscope_scene::terrain::RoughTerrain;
/// use kinetoscope_sim::{SimulationManager, SimulationManagerCfg, TerrainCfg};
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() })?;
/// let rough = RoughTerrain { seed: 7, ..RoughTerrain::default() };
/// let heights = rough.heights()?;
/// let terrain = sim.add_terrain(TerrainCfg { heights: heights.clone(), size: rough.size, ..Default::default() })?;
/// // Points are 0.2 m apart; the middle of 41 has index 20.
/// let height = sim.entities().terrain(terrain).height_at([0.2, -0.4]).unwrap_or(f64::NAN);
/// assert!((height - heights[(18, 21)]).abs() < 1e-9);
/// # Ok::<(), kinetoscope_sim::Error>(())
/// ```
///
/// In a file, `heights` is a list of rows with `size` beside it, or a generator: `heights.rough = { seed = 7 }`. Files
/// are always written with rows, each number with all its digits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TerrainFile")]
pub struct TerrainCfg {
    /// Name of the terrain, unique in the simulation.
    pub uid: String,
    /// Heights above the origin of the terrain frame \[m\], over a regular grid, rows along y, columns along x,
    /// starting at -y and -x. Between the points the surface consists of two triangles per cell, which meet in the
    /// diagonal from (-x, -y) to (+x, +y). MuJoCo stores heights in single precision, as fractions of the range from
    /// the lowest to the highest.
    #[serde(serialize_with = "rows")]
    pub heights: Array2<f64>,
    /// Lengths along x and y, from the first point to the last \[m\].
    pub size: [f64; 2],
    /// Depth of the ground below its lowest point \[m\]; it keeps fast bodies from falling through.
    pub thickness: f64,
    /// Pose of the terrain frame in the environment. The frame is in the middle of the field, at height 0.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\] (MuJoCo's three); `None` for the simulation's
    /// default.
    pub friction: Option<[f64; 3]>,
    /// RGBA color (sRGB) in 0..=1.
    pub rgba: [f64; 4],
    /// Surface properties besides the color, for rendering only.
    pub surface: SurfaceCfg,
}

impl Default for TerrainCfg {
    /// Flat ground of 10 m by 10 m.
    fn default() -> Self {
        Self {
            uid: "terrain".into(),
            heights: Array2::zeros((2, 2)),
            size: [10.0; 2],
            thickness: 1.0,
            init_pose: Pose::identity(),
            friction: None,
            rgba: [0.52, 0.47, 0.4, 1.0],
            surface: SurfaceCfg::default(),
        }
    }
}

impl TerrainCfg {
    /// Creates the configuration of a terrain called `uid`, with the heights and the size of a generator. All other
    /// fields have their defaults.
    ///
    /// # Errors
    /// [`Error::Terrain`] for an error of the generator.
    pub fn generated(uid: impl Into<String>, generator: impl Into<TerrainGenerator>) -> Result<Self> {
        let generator = generator.into();
        let (heights, size) = (generator.heights()?, generator.size());
        Ok(Self { uid: uid.into(), heights, size, ..Self::default() })
    }
}

/// Terrain of a simulation. It does not change while the simulation runs.
#[derive(Debug)]
pub struct Terrain {
    cfg: TerrainCfg,
    mask_id: i32,
    /// Lowest and highest height \[m\].
    range: [f64; 2],
}

impl Terrain {
    /// Checks every number.
    pub(crate) fn new(cfg: TerrainCfg, mask_id: i32) -> Result<Self> {
        let fail = |field, value: &dyn std::fmt::Debug, expected| {
            Err(Error::Config { field, value: format!("{value:?}"), expected })
        };
        cfg.surface.validate()?;
        let (rows, columns) = cfg.heights.dim();
        if rows < 2 || columns < 2 {
            return fail("heights", &[rows, columns], "there must be at least 2 rows and 2 columns");
        }
        if cfg.heights.len() > MAX_POINTS {
            return fail("heights", &[rows, columns], "there can be at most 4194304 points");
        }
        for ((row, column), &value) in cfg.heights.indexed_iter() {
            if !value.is_finite() {
                let item = format!("terrain {:?}", cfg.uid);
                return Err(Error::NotFinite { argument: "heights", row, column, item, value });
            }
        }
        let range = [
            cfg.heights.iter().copied().fold(f64::INFINITY, f64::min),
            cfg.heights.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ];
        if range.iter().any(|height| height.abs() > 1e6) {
            return fail("heights", &range, "every height must be between -1e6 m and 1e6 m");
        }
        let length = |x: &f64| x.is_finite() && (1e-6..=1e6).contains(x);
        if !cfg.size.iter().all(length) {
            return fail("size", &cfg.size, "both lengths must be 1e-6 to 1e6 m");
        }
        if !length(&cfg.thickness) {
            return fail("thickness", &cfg.thickness, "it must be 1e-6 to 1e6 m");
        }
        if let Some(friction) = cfg.friction
            && !friction.iter().all(|f| f.is_finite() && *f >= 0.0)
        {
            return fail("friction", &friction, "the three coefficients must be >= 0");
        }
        if !cfg.rgba.iter().all(|c| (0.0..=1.0).contains(c)) {
            return fail("rgba", &cfg.rgba, "each component must be 0 to 1");
        }
        check_pose("init_pose", &cfg.init_pose)?;
        Ok(Self { cfg, mask_id, range })
    }

    /// Name of the terrain.
    pub fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// Configuration that the terrain was added with.
    pub fn cfg(&self) -> &TerrainCfg {
        &self.cfg
    }

    /// Value of the mask channel of cameras for the terrain, the same in every environment.
    pub fn mask_id(&self) -> i32 {
        self.mask_id
    }

    /// Lowest and highest height of its points \[m\], in its frame.
    pub fn height_range(&self) -> [f64; 2] {
        self.range
    }

    /// Height of the surface at (x, y) \[m\], all in the terrain's frame; `None` outside of the terrain.
    pub fn height_at(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let (rows, columns) = self.cfg.heights.dim();
        let cell = |at: f64, length: f64, points: usize| {
            let u = (at / length + 0.5) * (points - 1) as f64;
            let within = (0.0..=(points - 1) as f64).contains(&u);
            within.then(|| {
                let cell = (u as usize).min(points - 2);
                (cell, u - cell as f64)
            })
        };
        let (c, u) = cell(x, self.cfg.size[0], columns)?;
        let (r, v) = cell(y, self.cfg.size[1], rows)?;
        let corner = |dr: usize, dc: usize| self.cfg.heights[(r + dr, c + dc)];
        let (low, high) = (corner(0, 0), corner(1, 1));
        Some(if u >= v {
            low + u * (corner(0, 1) - low) + v * (high - corner(0, 1))
        } else {
            low + v * (corner(1, 0) - low) + u * (high - corner(1, 0))
        })
    }

    /// Height difference between the elevations 0 and 1 \[m\]. MuJoCo requires a positive value for flat ground too.
    pub(crate) fn elevation_scale(&self) -> f64 {
        let rise = self.range[1] - self.range[0];
        if rise > 0.0 { rise } else { 1e-3 }
    }

    /// Height field in MuJoCo's binary format: numbers of rows and columns, then elevations of 0 to 1, in single
    /// precision.
    pub(crate) fn file(&self) -> Vec<u8> {
        let (rows, columns) = self.cfg.heights.dim();
        // `MAX_POINTS` bounds both numbers, so they fit into 32 bits.
        let mut bytes: Vec<u8> = [rows, columns].iter().flat_map(|&n| (n as i32).to_le_bytes()).collect();
        let elevation = |height: &f64| ((height - self.range[0]) / self.elevation_scale()) as f32;
        bytes.extend(self.cfg.heights.iter().flat_map(|height| elevation(height).to_le_bytes()));
        bytes
    }
}
