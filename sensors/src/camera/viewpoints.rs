//! Viewpoints of camera sensors: pose, intrinsics and lens in each environment.

use super::env_rows::EnvRows;
use super::error::CameraError;
use super::extrinsics::{CameraConvention, Poses};
use super::placement::PoseFrame;
use kinetoscope_render::lens::LensRayTables;
use kinetoscope_render::lens::{Lens, LensRays};
use kinetoscope_render::{Intrinsics, PixelIntrinsics};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use ndarray::Array2;
use std::sync::Arc;

/// Pose and intrinsics of one camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viewpoint {
    /// Pose of the optical frame in the frame of the parent, or of the environment for a free camera.
    pub(crate) parent_from_camera: Pose,
    pub(crate) pixels: PixelIntrinsics,
}

/// Viewpoints of a camera sensor, one row per environment that it sees. A setter that fails changes nothing.
#[derive(Clone, Debug)]
pub(crate) struct Viewpoints {
    pub(crate) envs: EnvRows,
    /// Index, on the body axis of the state, of the body that the cameras are attached to; `None` for free cameras.
    pub(crate) parent: Option<usize>,
    /// Width and height \[pixels\].
    size: [usize; 2],
    configured: Viewpoint,
    rows: Vec<Viewpoint>,
    rays: LensRayTables,
}

impl Viewpoints {
    /// The same viewpoint in every row, with the rays of its lens.
    pub(crate) fn new(
        viewpoint: Viewpoint,
        size: [usize; 2],
        rays: LensRayTables,
        envs: EnvRows,
        parent: Option<usize>,
    ) -> Self {
        Self { rows: vec![viewpoint; envs.len()], configured: viewpoint, size, rays, envs, parent }
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    #[track_caller]
    pub(crate) fn row(&self, row: usize) -> &Viewpoint {
        &self.rows[row]
    }

    /// Lens shared by all rows.
    pub(crate) fn lens(&self) -> Lens {
        self.rays.lens()
    }

    /// Rays of the lens of a row; `None` for a pinhole.
    #[track_caller]
    pub(crate) fn rays(&self, row: usize) -> Option<&Arc<LensRays>> {
        self.rays.shared(row)
    }

    /// Memory of the rays of the lens \[bytes\].
    pub(crate) fn ray_bytes(&self) -> usize {
        self.rays.bytes()
    }

    /// Frees rays without users, except those of the configured intrinsics. Rays that pending frames reference stay in
    /// memory.
    pub(crate) fn free_unused_rays(&mut self) {
        self.rays.drop_unused();
    }

    /// Returns the pose of the optical frame of a viewpoint in the environment; `None` if the pose of the parent is
    /// needed but unknown.
    pub(crate) fn world_from(&self, viewpoint: &Viewpoint, world_from_parent: Option<Pose>) -> Option<Pose> {
        let local = viewpoint.parent_from_camera;
        match self.parent {
            None => Some(local),
            Some(_) => world_from_parent.map(|world_from_parent| world_from_parent * local),
        }
    }

    /// Poses in the frame of the parent, rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (rows, 7).
    pub(crate) fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        let local = |viewpoint: &Viewpoint| to_row(&convention.pose_from_optical(&viewpoint.parent_from_camera));
        Array2::from(self.rows.iter().map(local).collect::<Vec<[f64; 7]>>())
    }

    /// Sets poses of optical frames: one for each of `rows`, or one for all. `world_from_parent` returns the pose of
    /// the parent of a row, if known; after an error no pose is set.
    pub(crate) fn place(
        &mut self,
        rows: &[usize],
        poses: &[Pose],
        frame: PoseFrame,
        world_from_parent: impl Fn(usize) -> Option<Pose>,
    ) -> Result<(), CameraError> {
        let local = |row: usize, pose: &Pose| -> Result<Pose, CameraError> {
            match (frame, self.parent) {
                (PoseFrame::Parent, _) | (PoseFrame::Environment, None) => Ok(*pose),
                (PoseFrame::Environment, Some(_)) => {
                    let unknown = CameraError::NothingCaptured { env: self.envs.env_ids()[row] };
                    Ok(world_from_parent(row).ok_or(unknown)?.inverse() * pose)
                }
            }
        };
        let each = one_each("poses", poses, rows.len())?;
        let placed: Vec<Pose> = rows.iter().zip(each).map(|(&row, pose)| local(row, pose)).collect::<Result<_, _>>()?;
        // The pose of a parent may be invalid.
        for (&row, pose) in rows.iter().zip(placed.to_poses()?) {
            self.rows[row].parent_from_camera = pose;
        }
        Ok(())
    }

    /// Sets intrinsics: one for each of `rows`, or one for all. `check` rejects intrinsics that the sensor cannot use.
    pub(crate) fn set_intrinsics(
        &mut self,
        rows: &[usize],
        intrinsics: &[Intrinsics],
        check: impl Fn(&PixelIntrinsics) -> Result<(), CameraError>,
    ) -> Result<(), CameraError> {
        let [width, height] = self.size;
        let pixels: Result<Vec<_>, _> = intrinsics.iter().map(|lens| lens.to_pixels(width, height)).collect();
        let pixels = pixels?;
        let made = self.rays.compute(&pixels)?;
        pixels.iter().try_for_each(check)?;
        for (&row, pixels) in rows.iter().zip(one_each("intrinsics", &pixels, rows.len())?) {
            self.rows[row].pixels = *pixels;
        }
        self.rays.set(made, rows, |row| self.rows[row].pixels);
        Ok(())
    }

    /// Restores the configured poses and intrinsics.
    pub(crate) fn restore(&mut self, rows: &[usize]) {
        rows.iter().for_each(|&row| self.rows[row] = self.configured);
        self.rays.set(Vec::new(), rows, |row| self.rows[row].pixels);
    }
}

/// Returns values for `count` environments: one each, or one for all; an error for another number of values.
pub(crate) fn one_each<'a, T>(
    what: &'static str,
    values: &'a [T],
    count: usize,
) -> Result<impl Iterator<Item = &'a T> + use<'a, T>, CameraError> {
    match values.len() {
        1 => Ok(values.iter().cycle().take(count)),
        found if found == count => Ok(values.iter().cycle().take(count)),
        found => Err(CameraError::Count { what, expected: count, found }),
    }
}
