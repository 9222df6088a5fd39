//! Curriculum of terrain levels, and starts on the tiles of these levels.

use super::reset_root_uniform::{RootRanges, write_roots};
use crate::curriculum::CurriculumTerm;
use crate::error::{EnvError, Result};
use crate::event::{EventMode, EventTerm};
use kinetoscope_scene::terrain::TerrainGrid;
use kinetoscope_sim::RobotId;
use serde::{Deserialize, Serialize};

/// Rules of [`terrain_levels`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TerrainLevelsCfg {
    /// Highest row of the grid in which environments start, uniformly distributed from row 0; `None` for all rows.
    pub max_initial_level: Option<usize>,
    /// Command term with a target velocity in its first two columns \[m/s\]. An environment that walked less than half
    /// of what its command asked for moves down; `None` for an environment that walked less than a quarter of a tile's
    /// length along x.
    pub command: Option<String>,
    /// Duration for which a command is followed \[s\]: the longest duration of an episode.
    pub episode_seconds: f64,
}

impl Default for TerrainLevelsCfg {
    /// Starts in all rows, and no command.
    fn default() -> Self {
        Self { max_initial_level: None, command: None, episode_seconds: 20.0 }
    }
}

/// Creates a curriculum with the row of a [`TerrainGrid`] in which each environment starts its episodes.
/// [`reset_root_on_terrain`] puts a robot there.
///
/// At the end of an episode, an environment whose robot is farther from the center of its tile than half the length of
/// a tile along x moves up a row. One that walked too little moves down ([`TerrainLevelsCfg::command`]), but not below
/// row 0. Beyond the last row, it continues in a random one. Distances are horizontal. Isaac Lab's `terrain_levels_vel`
/// has the same rules.
///
/// # Errors
/// A number is out of range.
pub fn terrain_levels(name: &str, robot: RobotId, grid: &TerrainGrid, cfg: TerrainLevelsCfg) -> Result<CurriculumTerm> {
    let wrong = |field: &str, value: String, expected| {
        let field = format!("{field} of the curriculum term {name:?}");
        Err(EnvError::Config { field, value, expected })
    };
    let rows = grid.rows;
    if rows == 0 || grid.columns == 0 {
        return wrong("the grid", format!("{rows} x {}", grid.columns), "it must have at least one tile");
    }
    if let Some(level) = cfg.max_initial_level.filter(|level| *level >= rows) {
        return wrong("max_initial_level", level.to_string(), "it must be a row of the grid, from 0");
    }
    if !(cfg.episode_seconds.is_finite() && cfg.episode_seconds > 0.0) {
        return wrong("episode_seconds", cfg.episode_seconds.to_string(), "it must be above 0 s");
    }
    let highest = cfg.max_initial_level.unwrap_or(rows - 1);
    let grid = grid.clone();
    let draw =
        |rng: &mut crate::EpisodeRng, count: usize| ((rng.uniform() * count as f64) as usize).min(count - 1) as f64;
    Ok(CurriculumTerm::new(
        name,
        move |rng| draw(rng, highest + 1),
        move |now, rngs, levels| {
            let poses = now.robot(robot).root_pose();
            let commands = cfg.command.as_deref().map(|command| now.command(command)).transpose()?;
            let next = rngs.iter_mut().map(|rng| {
                let (env, level) = (rng.env().0, levels[rng.env().0]);
                let [x, y] = grid.tile_center(level as usize, column(&grid, rng.global_env()));
                let walked = (poses[(env, 0)] - x).hypot(poses[(env, 1)] - y);
                let asked = match &commands {
                    Some(commands) => {
                        let speed = commands[(env, 0)].hypot(commands[(env, 1)]);
                        0.5 * speed * cfg.episode_seconds
                    }
                    None => 0.25 * grid.tile_size[0],
                };
                if walked > 0.5 * grid.tile_size[0] {
                    if level + 1.0 < rows as f64 { level + 1.0 } else { draw(rng, rows) }
                } else if walked < asked {
                    (level - 1.0).max(0.0)
                } else {
                    level
                }
            });
            Ok(next.collect())
        },
    ))
}

/// Grid column of an environment: its global index modulo the number of columns. The column does not depend on the
/// number of environments.
fn column(grid: &TerrainGrid, global_env: usize) -> usize {
    global_env % grid.columns
}

/// Creates an event that puts the root link above the center of a tile when an episode begins. The row of the tile is
/// the number of the curriculum term called `curriculum`, its column the global index of the environment modulo the
/// number of columns. The default root pose and `ranges` are offsets from the highest point of the tile's platform.
/// With a fixed base, or without that curriculum term, the event returns an error.
///
/// The frame of the terrain must be that of the environment (the default [`init_pose`] of the terrain).
///
/// [`init_pose`]: kinetoscope_sim::TerrainCfg::init_pose
///
/// # Errors
/// [`kinetoscope_sim::Error::Terrain`] for a grid that has no heights, and [`EnvError::Config`] for a range whose ends are
/// not finite or not in order.
pub fn reset_root_on_terrain(
    name: &str,
    robot: RobotId,
    grid: &TerrainGrid,
    curriculum: impl Into<String>,
    ranges: RootRanges,
) -> Result<EventTerm> {
    ranges.check(name)?;
    let origins = grid.platform_heights().map_err(kinetoscope_sim::Error::from)?;
    let (grid, curriculum) = (grid.clone(), curriculum.into());
    Ok(EventTerm::with_context(name, EventMode::Reset, move |now, rngs| {
        let levels = now.curriculum(&curriculum)?.to_owned();
        write_roots(now.sim_mut(), robot, ranges, rngs, |rng| {
            let row = (levels[rng.env().0].max(0.0) as usize).min(grid.rows - 1);
            let column = column(&grid, rng.global_env());
            let [x, y] = grid.tile_center(row, column);
            [x, y, origins[(row, column)]]
        })
    }))
}
