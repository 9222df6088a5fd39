//! Packets: data on its way from the simulation to the writer thread.

use crate::scene_update::SceneUpdate;
use crate::stream::{ElementType, StreamField, StreamSchema};

/// An event of some environments.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Kind of the event.
    pub kind: EventKind,
    /// Recorded environments that the event concerns, in ascending order.
    pub env_ids: Vec<usize>,
    /// Simulation time of each environment after the event \[s\].
    pub times: Vec<f64>,
    /// Physics steps since the recording began.
    pub step: u64,
    /// Time on the clock of the recording \[s\]. The clock starts at the simulation time of environment 0 and continues
    /// over resets.
    pub recorded_time: f64,
    /// Text of a note, or reason of a divergence; else empty.
    pub text: String,
}

/// Reset, write, divergence or note.
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

    /// Number in the array `events/kind` of NumPy archives.
    pub fn number(self) -> u8 {
        match self {
            Self::Reset => 0,
            Self::Written => 1,
            Self::Diverged => 2,
            Self::Note => 3,
        }
    }

    /// True if the event is logged as a warning.
    pub(crate) fn is_warning(self) -> bool {
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
    pub(crate) streams: Vec<StreamRows>,
}

/// Buffer for one row of a stream, in all its environments.
#[derive(Debug)]
pub(crate) struct StreamRows {
    /// True if the buffer has content.
    pub(crate) has_content: bool,
    /// Simulation time of capture in each environment \[s\].
    pub(crate) times: Vec<f64>,
    /// Recorded time of capture in each environment \[s\].
    pub(crate) recorded_times: Vec<f64>,
    /// `times` of the fields with the force time, if the stream has both kinds of fields; else empty.
    pub(crate) force_times: Vec<f64>,
    /// `recorded_times` of the fields with the force time, if the stream has both kinds of fields; else empty.
    pub(crate) recorded_force_times: Vec<f64>,
    /// True for environments with a new row.
    pub(crate) is_new: Vec<bool>,
    pub(crate) values: ValueBuffer,
}

/// Values of one type.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ValueBuffer {
    U8(Vec<u8>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Packet {
    /// Creates an empty packet with capacity for the streams.
    pub(crate) fn new(streams: &[StreamSchema]) -> Self {
        Self { step: 0, event: None, scenes: Vec::new(), streams: streams.iter().map(StreamRows::new).collect() }
    }

    /// Size of the row of a stream \[bytes\].
    pub(crate) fn max_bytes(stream: &StreamSchema) -> u64 {
        let numbers = stream.width().saturating_mul(stream.element_type.bytes());
        // For each environment four times (8 bytes each) and the `is_new` flag.
        (stream.env_ids.len() as u64).saturating_mul((numbers as u64).saturating_add(33))
    }

    /// Clears the packet and keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.event = None;
        self.scenes.clear();
        self.streams.iter_mut().for_each(StreamRows::clear);
    }
}

impl StreamRows {
    fn new(stream: &StreamSchema) -> Self {
        let (envs, numbers) = (stream.env_ids.len(), stream.env_ids.len() * stream.width());
        let values = match stream.element_type {
            ElementType::U8 => ValueBuffer::U8(Vec::with_capacity(numbers)),
            ElementType::I32 => ValueBuffer::I32(Vec::with_capacity(numbers)),
            ElementType::F32 => ValueBuffer::F32(Vec::with_capacity(numbers)),
            ElementType::F64 => ValueBuffer::F64(Vec::with_capacity(numbers)),
        };
        let (times, recorded_times) = (Vec::with_capacity(envs), Vec::with_capacity(envs));
        let forces = if stream.has_two_stamps() { envs } else { 0 };
        let (force_times, recorded_force_times) = (Vec::with_capacity(forces), Vec::with_capacity(forces));
        Self {
            has_content: false,
            times,
            recorded_times,
            force_times,
            recorded_force_times,
            is_new: Vec::with_capacity(envs),
            values,
        }
    }

    /// Recorded time of a field in a row \[s\].
    pub(crate) fn recorded_time(&self, part: &StreamField, row: usize) -> f64 {
        let of_forces = self.recorded_force_times.get(row).filter(|_| part.at_force_time);
        of_forces.copied().unwrap_or(self.recorded_times[row])
    }

    fn clear(&mut self) {
        self.has_content = false;
        self.times.clear();
        self.recorded_times.clear();
        self.force_times.clear();
        self.recorded_force_times.clear();
        self.is_new.clear();
        match &mut self.values {
            ValueBuffer::U8(values) => values.clear(),
            ValueBuffer::I32(values) => values.clear(),
            ValueBuffer::F32(values) => values.clear(),
            ValueBuffer::F64(values) => values.clear(),
        }
    }
}

impl ValueBuffer {
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
    pub(crate) fn append_bytes(&self, range: std::ops::Range<usize>, out: &mut Vec<u8>) {
        match self {
            Self::U8(values) => out.extend_from_slice(&values[range]),
            Self::I32(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F32(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F64(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
        }
    }

    /// The values if they are `F64` (states); else empty.
    pub(crate) fn as_f64s(&self) -> &[f64] {
        if let Self::F64(values) = self { values } else { &[] }
    }

    /// The values if they are `U8` (colors); else empty.
    pub(crate) fn as_u8s(&self) -> &[u8] {
        if let Self::U8(values) = self { values } else { &[] }
    }

    /// The values if they are `F32` (other images); else empty.
    pub(crate) fn as_f32s(&self) -> &[f32] {
        if let Self::F32(values) = self { values } else { &[] }
    }
}
