//! Pictures of a late camera as they arrive, whether it shows them or not.
//!
//! After somebody wrote to the state, a camera shows what there is then. Pictures that were on their way arrive later, are counted,
//! and are not shown: they are older. Who wants every picture that was taken, such as a recorder, reads them here.

use super::captures::Captures;
use super::error::CameraError;
use super::extrinsics::CameraConvention;
use super::sensor::Camera;
use super::viewpoints::Viewpoint;
use crate::error::SensorError;
use kinetoscope_render::frame::{Listed, PictureView, Pictures};
use kinetoscope_render::lens::LensRays;
use kinetoscope_render::ticket::Ticket;
use kinetoscope_scene::RenderScene;
use kinetoscope_scene::pose::to_row;
use ndarray::{Array1, Array2, Array3};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// What arrived last, in each row. All memory but that of pictures that are not shown is taken at construction.
#[derive(Debug)]
pub(super) struct Landed {
    captures: Captures,
    /// From where, and through which lens, each was captured; `None` before the first since the reset.
    looks: Vec<Option<(Viewpoint, Option<Arc<LensRays>>)>>,
    /// The pictures, once somebody looked.
    drawn: OnceLock<Result<Pictures, CameraError>>,
    /// Who draws: one reader at a time.
    turn: Mutex<()>,
}

impl Landed {
    pub(super) fn new(rows: usize, scene: &RenderScene, ticket: Ticket, slow: bool) -> Self {
        let captures = Captures::new(rows, scene, ticket, slow);
        Self { captures, looks: vec![None; rows], drawn: OnceLock::new(), turn: Mutex::new(()) }
    }

    pub(super) fn remember(
        &mut self,
        row: usize,
        from: &Captures,
        slot: usize,
        (viewpoint, lens): (&Viewpoint, Option<&Arc<LensRays>>),
    ) {
        self.captures.copy(row, from, slot);
        self.looks[row] = Some((*viewpoint, lens.cloned()));
        self.drawn = OnceLock::new();
    }

    /// What is shown has changed.
    pub(super) fn outdate(&mut self) {
        self.drawn = OnceLock::new();
    }

    pub(super) fn forget(&mut self, row: usize) {
        self.looks[row] = None;
        self.drawn = OnceLock::new();
    }
}

impl Camera {
    /// What arrived last in a row, where the camera shows something else.
    fn unseen(&self, row: usize) -> Option<(&Captures, &Viewpoint, Option<&LensRays>)> {
        let past = self.past()?;
        let landed = past.landed.as_ref()?;
        let (viewpoint, lens) = landed.looks.get(row)?.as_ref().filter(|_| !past.shown[row])?;
        Some((&landed.captures, viewpoint, lens.as_deref()))
    }

    /// Time of the instant that the pictures show which arrived last \[s\], shape (N): as [`stamps`](Self::stamps), except with a
    /// latency after somebody wrote to the state or moved the camera. Before the first one arrives, that of the reset.
    pub fn arrived_stamps(&self) -> Array1<f64> {
        let shown = self.stamps();
        Array1::from_shape_fn(shown.len(), |row| match self.unseen(row) {
            Some((captures, ..)) => captures.stamps[row],
            None => shown[row],
        })
    }

    /// Poses at that instant, as [`pose_w`](Self::pose_w).
    pub fn arrived_pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let mut poses = self.pose_w(convention);
        for (row, mut pose) in poses.rows_mut().into_iter().enumerate() {
            if let Some((captures, viewpoint, _)) = self.unseen(row)
                && let Some(world) = self.viewpoints.world_from(viewpoint, captures.world_from_parent[row])
            {
                pose.iter_mut().zip(to_row(&convention.of_optical(&world))).for_each(|(to, x)| *to = x);
            }
        }
        poses
    }

    /// Intrinsic matrices of these pictures, as [`intrinsic_matrices`](Self::intrinsic_matrices).
    pub fn arrived_intrinsic_matrices(&self) -> Array3<f64> {
        let shown = self.intrinsic_matrices();
        Array3::from_shape_fn(shown.raw_dim(), |(row, i, j)| match self.unseen(row) {
            Some((_, viewpoint, _)) => viewpoint.pixels.matrix()[(i, j)],
            None => shown[(row, i, j)],
        })
    }

    /// The pictures of one channel that arrived last, in the shape of [`channel`](Self::channel). Those that are not shown are drawn
    /// when somebody looks, with the noise that they would have been shown with.
    ///
    /// # Errors
    ///
    /// As [`channel`](Self::channel).
    pub fn arrived<C: Listed>(&self) -> Result<PictureView<'_, C>, SensorError> {
        let unseen = (0..self.env_ids().len()).any(|row| self.unseen(row).is_some());
        let Some(landed) = self.past().and_then(|past| past.landed.as_ref()).filter(|_| unseen) else {
            return self.channel::<C>();
        };
        let off = || CameraError::ChannelOff { channel: C::NAME, enabled: self.channels().names() };
        if !self.channels().has::<C>() {
            return Err(off().into());
        }
        // Of what is shown only some rows may be wanted, and drawing it is what the reader would have done anyway.
        let shown = self.pictures()?;
        let drawn = match landed.drawn.get() {
            Some(drawn) => drawn,
            None => {
                // One reader draws, the others wait.
                let _turn = landed.turn.lock().unwrap_or_else(PoisonError::into_inner);
                match landed.drawn.get() {
                    Some(drawn) => drawn,
                    None => match self.draw_landed(landed, shown) {
                        // What was broken off is drawn again by the next reader.
                        Err(error) if error.is_cancelled() => return Err(error.into()),
                        new => landed.drawn.get_or_init(|| new),
                    },
                }
            }
        };
        match drawn {
            Ok(pictures) => pictures.get::<C>().ok_or_else(|| off().into()),
            Err(error) => Err(error.clone().into()),
        }
    }

    fn draw_landed(&self, landed: &Landed, shown: &Pictures) -> Result<Pictures, CameraError> {
        let (rows, (height, width)) = (self.env_ids().len(), self.image_shape());
        let mut pictures = Pictures::new(self.channels(), rows, width, height);
        let looks: Vec<_> =
            (0..rows).map(|row| self.unseen(row).map(|(_, viewpoint, lens)| (viewpoint, lens))).collect();
        let unseen = |row: &usize| looks[*row].is_some();
        for row in (0..rows).filter(|row| !unseen(row)) {
            pictures.copy_view((rows, row), shown, (rows, row));
        }
        // Whoever calls has seen that there is one.
        let Some(first) = looks.iter().flatten().next().copied() else { return Ok(pictures) };
        let frames = pictures.frames_mut(rows).enumerate().filter(|(row, _)| unseen(row)).map(|(_, frame)| frame);
        let places = (0..rows).filter(unseen).map(|row| (row, row));
        let result = self.develop(&landed.captures, |row| looks[row].unwrap_or(first), places.clone(), frames);
        result.map_err(|(job, error)| {
            let row = places.clone().nth(job).map_or(0, |(row, _)| row);
            CameraError::Draw { env: self.env_ids()[row], error }
        })?;
        Ok(pictures)
    }
}
