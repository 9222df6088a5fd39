//! Where the cameras of all environments are mounted, and their lenses: what rasterized cameras and cameras of rays have in
//! common.

use super::error::CameraError;
use super::extrinsics::{CameraConvention, Poses, look_at_pose};
use crate::error::SensorError;
use kinetoscope_render::intrinsics::{Intrinsics, PixelIntrinsics};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use ndarray::Array2;

/// How one camera is placed, and its lens.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viewpoint {
    /// Of the optical frame.
    pub(crate) parent_from_camera: Pose,
    pub(crate) pixels: PixelIntrinsics,
}

/// The viewpoints of all rows of a camera. Whatever fails changes nothing.
#[derive(Clone, Debug)]
pub(crate) struct Viewpoints {
    configured: Viewpoint,
    rows: Vec<Viewpoint>,
}

impl Viewpoints {
    /// The same viewpoint in every row.
    pub(crate) fn new(viewpoint: Viewpoint, rows: usize) -> Self {
        Self { configured: viewpoint, rows: vec![viewpoint; rows] }
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    #[track_caller]
    pub(crate) fn row(&self, row: usize) -> &Viewpoint {
        &self.rows[row]
    }

    /// Poses in the frame of the parent, shape (rows, 7).
    pub(crate) fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        let local = |viewpoint: &Viewpoint| to_row(&convention.of_optical(&viewpoint.parent_from_camera));
        Array2::from(self.rows.iter().map(local).collect::<Vec<[f64; 7]>>())
    }

    /// Places cameras in the frame of their parent: a pose for each of `rows`, or one for all.
    pub(crate) fn set_local(
        &mut self,
        rows: &[usize],
        poses: &(impl Poses + ?Sized),
        convention: CameraConvention,
    ) -> Result<(), CameraError> {
        self.place(rows, &poses.to_poses()?, |_, pose| Ok(convention.to_optical(pose)))
    }

    /// Places cameras in the environment, where `world_from_parent` says where the parent of a row is.
    pub(crate) fn set_world(
        &mut self,
        rows: &[usize],
        poses: &(impl Poses + ?Sized),
        convention: CameraConvention,
        world_from_parent: impl Fn(usize) -> Result<Option<Pose>, CameraError>,
    ) -> Result<(), CameraError> {
        self.place(rows, &poses.to_poses()?, |row, pose| {
            let optical = convention.to_optical(pose);
            Ok(world_from_parent(row)?.map_or(optical, |world_from_parent| world_from_parent.inverse() * optical))
        })
    }

    /// Gives the cameras of `rows` the local poses that `local` makes of `poses`, one each or one for all.
    fn place(
        &mut self,
        rows: &[usize],
        poses: &[Pose],
        local: impl Fn(usize, &Pose) -> Result<Pose, CameraError>,
    ) -> Result<(), CameraError> {
        let each = one_each("poses", poses, rows.len())?;
        let placed: Vec<Pose> = rows.iter().zip(each).map(|(&row, pose)| local(row, pose)).collect::<Result<_, _>>()?;
        // The pose of a parent may be no good.
        for (&row, pose) in rows.iter().zip(placed.to_poses()?) {
            self.rows[row].parent_from_camera = pose;
        }
        Ok(())
    }

    /// Turns cameras to something: one `eye`, `target` and `up` for each of `rows`, or one for all.
    pub(crate) fn look_at(
        &mut self,
        rows: &[usize],
        eye: &[[f64; 3]],
        target: &[[f64; 3]],
        up: &[[f64; 3]],
    ) -> Result<(), CameraError> {
        let n = rows.len();
        let points = one_each("eyes", eye, n)?.zip(one_each("targets", target, n)?).zip(one_each("ups", up, n)?);
        let poses: Result<Vec<Pose>, _> = points.map(|((eye, target), up)| look_at_pose(*eye, *target, *up)).collect();
        for (&row, pose) in rows.iter().zip(poses?) {
            self.rows[row].parent_from_camera = pose;
        }
        Ok(())
    }

    /// Changes lenses of pictures of `width` by `height`: one for each of `rows`, or one for all; `check` says what else is
    /// wrong with one.
    pub(crate) fn set_intrinsics(
        &mut self,
        rows: &[usize],
        intrinsics: &[Intrinsics],
        (width, height): (usize, usize),
        check: impl Fn(&PixelIntrinsics) -> Result<(), CameraError>,
    ) -> Result<(), CameraError> {
        let pixels: Result<Vec<_>, _> = intrinsics.iter().map(|lens| lens.to_pixels(width, height)).collect();
        let pixels = pixels?;
        pixels.iter().try_for_each(check)?;
        for (&row, pixels) in rows.iter().zip(one_each("intrinsics", &pixels, rows.len())?) {
            self.rows[row].pixels = *pixels;
        }
        Ok(())
    }

    /// Places and lenses as they were configured.
    pub(crate) fn restore(&mut self, rows: &[usize]) {
        for &row in rows {
            self.rows[row] = self.configured;
        }
    }
}

/// The rows of the environments that somebody chose (`None` is all `count` of them), each once; `row` gives that of an
/// environment.
pub(crate) fn chosen_rows(
    count: usize,
    env_ids: Option<&[usize]>,
    row: impl Fn(usize) -> Result<usize, SensorError>,
) -> Result<Vec<usize>, SensorError> {
    let Some(env_ids) = env_ids else { return Ok((0..count).collect()) };
    let mut taken = vec![false; count];
    let mut rows = Vec::with_capacity(env_ids.len());
    for &env in env_ids {
        let row = row(env)?;
        if std::mem::replace(&mut taken[row], true) {
            return Err(CameraError::DuplicateEnvironment { env }.into());
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Values for `count` environments: one each, or one for all.
fn one_each<'a, T>(
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
