//! What travels from the simulation to the thread of the file.

use crate::scene_update::SceneUpdate;
use crate::stream::{Element, Part, Stream};

/// Something that happened to environments.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// What.
    pub kind: EventKind,
    /// To which environments, in ascending order.
    pub env_ids: Vec<usize>,
    /// Simulation time of each of them afterwards \[s\].
    pub times: Vec<f64>,
    /// Physics steps of the simulation since the recording began.
    pub step: u64,
    /// The time of the recording \[s\].
    pub at: f64,
    /// What there is to say of it: of a note its text, of a divergence the reason; else empty.
    pub text: String,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EventKind {
    /// Environments were reset.
    Reset,
    /// Somebody wrote to the state of environments.
    Written,
    /// A step could not be done in environments: they stand still in their last good state.
    Diverged,
    /// Somebody had something to say: see [`Record::note`](crate::Record::note).
    Note,
}

impl EventKind {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reset => "reset",
            Self::Written => "written",
            Self::Diverged => "diverged",
            Self::Note => "note",
        }
    }

    /// Its number in NumPy archives.
    pub fn number(self) -> u8 {
        match self {
            Self::Reset => 0,
            Self::Written => 1,
            Self::Diverged => 2,
            Self::Note => 3,
        }
    }

    /// Whether it is told as a warning.
    pub(crate) fn is_bad(self) -> bool {
        self == Self::Diverged
    }
}

/// Room for one row of everything that is recorded.
#[derive(Debug)]
pub(crate) struct Packet {
    /// Physics steps of the simulation since the recording began.
    pub(crate) step: u64,
    pub(crate) event: Option<Event>,
    /// What environments look like from now on, where that is another look than before.
    pub(crate) scenes: Vec<SceneUpdate>,
    /// One for each stream.
    pub(crate) blocks: Vec<Block>,
}

/// Room for one row of a stream, of all its environments.
#[derive(Debug)]
pub(crate) struct Block {
    /// Whether there is something in it.
    pub(crate) used: bool,
    /// Simulation time of capture \[s\], for each environment.
    pub(crate) times: Vec<f64>,
    /// The same on the clock of the recording, which goes on over a reset \[s\].
    pub(crate) stamps: Vec<f64>,
    /// As `times`, of the parts that are of forces, where the others are of another instant; else empty.
    pub(crate) force_times: Vec<f64>,
    /// As `stamps`, likewise.
    pub(crate) force_stamps: Vec<f64>,
    /// Which environments have something new.
    pub(crate) fresh: Vec<bool>,
    pub(crate) values: Values,
}

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    U8(Vec<u8>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Packet {
    /// Empty, with room for the streams.
    pub(crate) fn new(streams: &[Stream]) -> Self {
        Self { step: 0, event: None, scenes: Vec::new(), blocks: streams.iter().map(Block::new).collect() }
    }

    /// What the row of a stream takes \[bytes\].
    pub(crate) fn bytes(stream: &Stream) -> u64 {
        let numbers = stream.width().saturating_mul(stream.element.bytes());
        // Four times and whether it is fresh.
        (stream.env_ids.len() as u64).saturating_mul((numbers as u64).saturating_add(33))
    }

    /// Forgets what is in it, and keeps the memory.
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

    /// The recorded time of a part in a row \[s\].
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
    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::U8(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
        }
    }

    /// Appends a range of them as bytes, lowest first.
    pub(crate) fn put(&self, range: std::ops::Range<usize>, out: &mut Vec<u8>) {
        match self {
            Self::U8(values) => out.extend_from_slice(&values[range]),
            Self::I32(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F32(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F64(values) => values[range].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
        }
    }

    /// The states among them; nothing where they are of another type.
    pub(crate) fn states(&self) -> &[f64] {
        if let Self::F64(values) = self { values } else { &[] }
    }

    /// The bytes among them; nothing where they are of another type.
    pub(crate) fn bytes(&self) -> &[u8] {
        if let Self::U8(values) = self { values } else { &[] }
    }

    /// The numbers of pictures among them; nothing where they are of another type.
    pub(crate) fn floats(&self) -> &[f32] {
        if let Self::F32(values) = self { values } else { &[] }
    }
}
