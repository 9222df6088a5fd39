//! What a camera captured and does not show yet, or no more: pictures on their way, and those of its history.

use super::arrived::Landed;
use super::captures::Captures;
use super::cfg::CameraCfg;
use super::viewpoints::Viewpoint;
use crate::delay::Queues;
use crate::schedule::{Phases, Schedule};
use kinetoscope_render::frame::{Channels, Pictures};
use kinetoscope_render::lens::LensRays;
use kinetoscope_render::ticket::{Stream, Ticket};
use kinetoscope_scene::RenderScene;
use ndarray::Array2;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Captures on their way, and the last ones that have arrived. There is none of it for a camera without latency, history and
/// dropout. All memory is taken at construction.
#[derive(Debug)]
pub(super) struct Memory {
    late: bool,
    dropout: f64,
    queues: Queues,
    /// In the slots of the queues.
    pub(super) waiting: Captures,
    /// Step at which what is shown was last refreshed: what was captured before does not replace it.
    refreshed: Vec<u64>,
    pub(super) past: Past,
}

/// The history: captures of what has arrived, drawn when somebody looks.
#[derive(Debug)]
pub(super) struct Past {
    length: usize,
    /// Of each row `length`, one after the other: that which arrived as number k since the reset is at k modulo `length`.
    pub(super) captures: Captures,
    /// From where, and through which lens, each was captured.
    pub(super) viewpoints: Vec<Viewpoint>,
    pub(super) lenses: Vec<Option<Arc<LensRays>>>,
    arrived: Vec<u64>,
    /// Shape (rows, length), newest first.
    pub(super) stamps: Array2<f64>,
    /// Whether the newest is what the camera shows, from where it shows it.
    pub(super) shown: Vec<bool>,
    /// What arrived last, of a camera with latency.
    pub(super) landed: Option<Landed>,
    pub(super) drawn: OnceLock<Album>,
    /// Who draws it: one reader at a time.
    pub(super) turn: Mutex<()>,
    /// The album while it is not in `drawn`.
    pub(super) shelf: Mutex<Option<Album>>,
}

/// The pictures of the history.
#[derive(Debug)]
pub(super) struct Album {
    /// Of each row `length`, newest first.
    pub(super) pictures: Pictures,
    /// How many of each row had arrived when pictures were moved up last.
    arrived: Vec<u64>,
    /// How many of each row's newest are not drawn.
    pub(super) undrawn: Vec<usize>,
    pub(super) failure: Option<super::CameraError>,
}

impl Memory {
    /// How many captures of an environment `cfg` has on their way at once, with a picture every `period` steps.
    pub(super) fn waiting(cfg: &CameraCfg, schedule: Schedule) -> usize {
        if Self::is_needed(cfg) { Queues::capacity(cfg.latency_steps.into(), schedule.period_steps()) } else { 0 }
    }

    fn is_needed(cfg: &CameraCfg) -> bool {
        cfg.latency_steps > 0 || cfg.history_length > 0 || cfg.dropout > 0.0
    }

    /// The memory that `cfg` asks for, in `rows` environments; `None` where it asks for none.
    pub(super) fn new(
        cfg: &CameraCfg,
        schedule: Schedule,
        rows: usize,
        scene: &RenderScene,
        (viewpoint, ticket): (Viewpoint, Ticket),
    ) -> Option<Box<Self>> {
        let slow = !cfg.shutter.is_instant();
        Self::is_needed(cfg).then(|| {
            let queues = Queues::new(rows, cfg.latency_steps.into(), schedule.period_steps());
            let kept = rows * cfg.history_length;
            Box::new(Self {
                late: cfg.latency_steps > 0,
                dropout: cfg.dropout,
                waiting: Captures::new(queues.slots(), scene, ticket, slow),
                queues,
                refreshed: vec![0; rows],
                past: Past {
                    length: cfg.history_length,
                    captures: Captures::new(kept, scene, ticket, slow),
                    viewpoints: vec![viewpoint; kept],
                    lenses: vec![None; kept],
                    arrived: vec![0; rows],
                    stamps: Array2::zeros((rows, cfg.history_length)),
                    shown: vec![false; rows],
                    landed: (cfg.latency_steps > 0).then(|| Landed::new(rows, scene, ticket, slow)),
                    drawn: OnceLock::new(),
                    turn: Mutex::new(()),
                    shelf: Mutex::new(Some(Album::new(cfg.channels, rows, cfg.history_length, cfg.width, cfg.height))),
                },
            })
        })
    }

    /// The slot of [`waiting`](Self::waiting) for a capture of `row` at `step`; `None` for one that gets lost on its way.
    pub(super) fn send(&mut self, row: usize, step: u64, ticket: &Ticket) -> Option<usize> {
        let lost = self.dropout > 0.0 && ticket.uniforms(Stream::DROPOUT, 0)[0] < self.dropout;
        (!lost).then(|| self.queues.push(row, step))
    }

    /// The slot of the oldest capture that has arrived in `row` by `step`, and whether it is to be shown.
    pub(super) fn receive(&mut self, row: usize, step: u64) -> Option<(usize, bool)> {
        let (slot, captured) = self.queues.take(row, step)?;
        Some((slot, !self.late || captured > self.refreshed[row]))
    }

    /// Puts what arrived in a slot into the history.
    pub(super) fn remember(&mut self, row: usize, slot: usize, look: (&Viewpoint, Option<&Arc<LensRays>>)) {
        self.past.remember(row, &self.waiting, slot, look);
    }

    /// What is shown of `row` was refreshed at `step`.
    pub(super) fn refresh(&mut self, row: usize, step: u64) {
        self.refreshed[row] = step;
        self.past.shown[row] = false;
        if let Some(landed) = &mut self.past.landed {
            landed.outdate();
        }
    }

    /// Forgets what is on its way and what was, in `row`.
    pub(super) fn reset(&mut self, row: usize) {
        self.queues.clear(row);
        self.past.reset(row);
    }

    /// Physics steps until the next arrives, at least 1; `None` where nothing is on its way. `steps` are those of the rows.
    pub(super) fn due_in(&self, steps: impl Iterator<Item = u64>) -> Option<u64> {
        let running = steps.enumerate().filter(|(_, now)| *now != Phases::STANDS);
        running.filter_map(|(row, now)| Some(self.queues.arrival(row)?.saturating_sub(now).max(1))).min()
    }
}

impl Past {
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// How many pictures of `row` are there.
    pub(super) fn filled(&self, row: usize) -> usize {
        usize::try_from(self.arrived[row]).map_or(self.length, |arrived| arrived.min(self.length))
    }

    /// Where the capture of the picture is that is `age` pictures old.
    pub(super) fn place(&self, row: usize, age: usize) -> usize {
        let length = self.length as u64;
        row * self.length + ((self.arrived[row] - 1 - age as u64) % length) as usize
    }

    fn remember(
        &mut self,
        row: usize,
        from: &Captures,
        slot: usize,
        (viewpoint, lens): (&Viewpoint, Option<&Arc<LensRays>>),
    ) {
        self.landed.iter_mut().for_each(|landed| landed.remember(row, from, slot, (viewpoint, lens)));
        if self.length == 0 {
            return;
        }
        self.arrived[row] += 1;
        let to = self.place(row, 0);
        self.captures.copy(to, from, slot);
        self.viewpoints[to] = *viewpoint;
        self.lenses[to] = lens.cloned();
        if let Some(stamps) = self.stamps.row_mut(row).as_slice_mut() {
            stamps.copy_within(..self.length - 1, 1);
            stamps[0] = from.stamps[slot];
        }
        self.outdate();
    }

    fn reset(&mut self, row: usize) {
        self.landed.iter_mut().for_each(|landed| landed.forget(row));
        self.arrived[row] = 0;
        self.stamps.row_mut(row).fill(0.0);
        self.outdate();
        let shelf = self.shelf.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(album) = shelf {
            album.pictures.forget(self.shown.len() * self.length, row * self.length..(row + 1) * self.length);
            (album.arrived[row], album.undrawn[row]) = (0, 0);
        }
    }

    /// The album is not that of what was captured any more.
    fn outdate(&mut self) {
        let shelf = self.shelf.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(album) = self.drawn.take() {
            *shelf = Some(album);
        }
    }

    /// Moves up the pictures of an album that are older than what arrived since.
    pub(super) fn move_up(&self, album: &mut Album) {
        let all = self.arrived.len() * self.length;
        for (row, &arrived) in self.arrived.iter().enumerate() {
            let new = usize::try_from(arrived - album.arrived[row]).unwrap_or(usize::MAX).min(self.length);
            album.pictures.move_up(all, row * self.length..(row + 1) * self.length, new);
            album.undrawn[row] = (album.undrawn[row] + new).min(self.length);
            album.arrived[row] = arrived;
        }
    }
}

impl Album {
    /// Nothing, in `rows` environments.
    pub(super) fn new(channels: Channels, rows: usize, length: usize, width: usize, height: usize) -> Self {
        let pictures = Pictures::new(channels, rows * length, width, height);
        Self { pictures, arrived: vec![0; rows], undrawn: vec![0; rows], failure: None }
    }
}
