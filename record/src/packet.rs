//! Packets: data on its way from the simulation to the writer thread.

use crate::scene_update::SceneUpdate;
use crate::stream::{Element, Part, Stream};

/// An event of some environments.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Kind of the event.
    pub kind: EventKind,
    /// Environments, in ascending order.
    pub env_ids: Vec<usize>,
    /// Simulation time of each environment after the event \[s\].
    pub times: Vec<f64>,
    /// Physics steps since the recording began.
    pub step: u64,
    /// Time of the recording \[s\].
    pub at: f64,
    /// Text of a note, or reason of a divergence; else empty.
    pub text: String,
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EventKind {
    /// Environments were reset.
    Reset,
    /// The state of environments was written.
    Written,
    /// The simulation of environments diverged: they stay in their last good state.
    Diverged,
    /// A note was added by [`Record::note`](crate::Record::note).
    Note,
}

impl EventKind {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reset => "reset",
            Self::Written => "written",
            Self::Diverged => "diverged",
            Self::Note => "note",
        }
    }

    /// Number in NumPy archives.
    pub fn number(self) -> u8 {
        match self {
            Self::Reset => 0,
            Self::Written => 1,
            Self::Diverged => 2,
            Self::Note => 3,
        }
    }

    /// True if the event is logged as a warning.
    pub(crate) fn is_bad(self) -> bool {
        self == Self::Diverged
    }
}

/// Buffer for one row of every recorded stream.
#[derive(Debug)]
pub(crate) struct Packet {
    /// Physics steps since the recording began.
    pub(crate) step: u64,
    pub(crate) event: Option<Event>,
    /// Changed scenes of environments, for viewers.
    pub(crate) scenes: Vec<SceneUpdate>,
    /// One for each stream.
    pub(crate) blocks: Vec<Block>,
}

/// Buffer for one row of a stream, in all its environments.
#[derive(Debug)]
pub(crate) struct Block {
    /// True if the buffer has content.
    pub(crate) used: bool,
    /// Simulation time of capture in each environment \[s\].
    pub(crate) times: Vec<f64>,
    /// Recorded time of capture in each environment \[s\].
    pub(crate) stamps: Vec<f64>,
    /// `times` of the fields with the force time, if the stream has both kinds of fields; else empty.
    pub(crate) force_times: Vec<f64>,
    /// `stamps` of the fields with the force time, if the stream has both kinds of fields; else empty.
    pub(crate) force_stamps: Vec<f64>,
    /// True for environments with a new row.
    pub(crate) fresh: Vec<bool>,
    pub(crate) values: Values,
}

/// Values of one type.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    U8(Vec<u8>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Packet {
    /// Creates an empty packet with capacity for the streams.
    pub(crate) fn new(streams: &[Stream]) -> Self {
        Self { step: 0, event: None, scenes: Vec::new(), blocks: streams.iter().map(Block::new).collect() }
    }

    /// Size of the row of a stream \[bytes\].
    pub(crate) fn bytes(stream: &Stream) -> u64 {
        let numbers = stream.width().saturating_mul(stream.element.bytes());
        // For each environment four times (8 bytes each) and the `fresh` flag.
        (stream.env_ids.len() as u64).saturating_mul((numbers as u64).saturating_add(33))
    }

    /// Clears the packet and keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.event = None;
        self.scenes.clear();
        self.blocks.iter_mut().for_each(Block::clear);
    }
}

impl Block {
    fn new(stream: &Stream) -> Self {
        let (envs, numbers) = (stream.env_ids.len(), stream.env_ids.len() * stream.width());
        let values = match stream.element {
            Element::U8 => Values::U8(Vec::with_capacity(numbers)),
            Element::I32 => Values::I32(Vec::with_capacity(numbers)),
            Element::F32 => Values::F32(Vec::with_capacity(numbers)),
            Element::F64 => Values::F64(Vec::with_capacity(numbers)),
        };
        let (times, stamps) = (Vec::with_capacity(envs), Vec::with_capacity(envs));
        let forces = if stream.is_mixed() { envs } else { 0 };
        let (force_times, force_stamps) = (Vec::with_capacity(forces), Vec::with_capacity(forces));
        Self { used: false, times, stamps, force_times, force_stamps, fresh: Vec::with_capacity(envs), values }
    }

    /// Recorded time of a field in a row \[s\].
    pub(crate) fn stamp(&self, part: &Part, row: usize) -> f64 {
        let of_forces = self.force_stamps.get(row).filter(|_| part.of_forces);
        of_forces.copied().unwrap_or(self.stamps[row])
    }

    fn clear(&mut self) {
        self.used = false;
        self.times.clear();
        self.stamps.clear();
        self.force_times.clear();
        self.force_stamps.clear();
        self.fresh.clear();
        match &mut self.values {
            Values::U8(values) => values.clear(),
            Values::I32(values) => values.clear(),
            Values::F32(values) => values.clear(),
            Values::F64(values) => values.clear(),
        }
    }
}

impl Values {
    /// Number of values.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::U8(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
        }
    }

    /// Appends a range of the values as little-endian bytes.
    pub(crate) fn put(&self, range: std::ops::Range<usize>, out: &mut Vec<u8>) {
        match self {
            Self::U8(values) => out.extend_from_slice(&values[range]),
            Self::I32(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F32(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F64(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
        }
    }

    /// The values if they are `F64` (states); else empty.
    pub(crate) fn states(&self) -> &[f64] {
        if let Self::F64(values) = self { values } else { &[] }
    }

    /// The values if they are `U8` (colors); else empty.
    pub(crate) fn bytes(&self) -> &[u8] {
        if let Self::U8(values) = self { values } else { &[] }
    }

    /// The values if they are `F32` (other images); else empty.
    pub(crate) fn floats(&self) -> &[f32] {
        if let Self::F32(values) = self { values } else { &[] }
    }
}
