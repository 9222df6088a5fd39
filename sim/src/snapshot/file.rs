//! Snapshot files.
//!
//! ```text
//! magic (8 bytes) | length of the file (u64) | format (u32) | content | SHA-256 of all before (32 bytes)
//! ```
//!
//! All numbers are little-endian. Magic, length and checksum have these positions in every format, so that a damaged
//! file can be distinguished from one of another version. The content of format 3: MuJoCo's version, the lines of the
//! layout, the environments, each with its properties.

use super::bytes::{ByteReader, ByteWriter, Malformed};
use super::layout::StateLayout;
use super::{EnvEntry, SavedProperties, Snapshot, SnapshotError};
use crate::drive::table::flat_error;
use crate::env::{Divergence, EnvState, EnvStatus};
use crate::error::{Error, Result};
use crate::randomization::{NamedValue, Property};
use crate::wrenches::Wrenches;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{Buffers, EngineError, IntegrationState, UserInputs, Warning, Weld};
use kinetoscope_scene::{AtomicFile, input_file};
use sha2::{Digest, Sha256};
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

/// Like the signature of PNG: a byte outside of text, a name, and line ends that text-mode programs change.
const MAGIC: [u8; 8] = *b"\x89KTS\r\n\x1a\n";
const FORMAT: u32 = 3;
const CHECKSUM: usize = 32;
/// Length of magic, length and format \[bytes\].
const HEADER: usize = 8 + 8 + 4;

impl Snapshot {
    /// Writes the snapshot to a file. On an error, nothing is written, and an existing file stays.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let failed = |error| Error::File { path: path.into(), error };
        let mut file = AtomicFile::create(path).map_err(failed)?;
        file.file().write_all(&self.to_bytes()).map_err(failed)?;
        // Before the rename: a machine that stops in between leaves the old file, not an empty one.
        file.file().sync_all().map_err(failed)?;
        file.persist().map_err(failed)
    }

    /// Reads a file that [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read. A [`SnapshotError`] if it is not a complete, undamaged snapshot of
    /// this format and this MuJoCo version, with a variant for each case. The scene is checked when the snapshot is
    /// restored.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let bytes =
            input_file::read_referenced(path, u64::MAX).map_err(|error| Error::File { path: path.into(), error })?;
        Ok(Self::decode(&bytes, path)?)
    }

    /// Content of the file that [`save`](Self::save) writes, for other storage such as a pickle.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.encode(FORMAT, &mj::version_string())
    }

    /// Reads the content of a file, as [`load`](Self::load) does.
    ///
    /// # Errors
    /// A [`SnapshotError`] as in [`load`](Self::load). The path in its message is `<memory>`.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Ok(Self::decode(bytes, Path::new("<memory>"))?)
    }

    fn encode(&self, format: u32, mujoco: &str) -> Vec<u8> {
        let mut out = ByteWriter::default();
        out.0.extend_from_slice(&MAGIC);
        out.u64(0);
        out.u32(format);
        out.text(mujoco);
        out.u64(self.layout.lines().len() as u64);
        self.layout.lines().iter().for_each(|line| out.text(line));
        out.u64(self.entries.len() as u64);
        for entry in self.entries.iter() {
            write_entry(entry, &mut out);
        }
        let mut bytes = out.0;
        let length = (bytes.len() + CHECKSUM) as u64;
        bytes[8..16].copy_from_slice(&length.to_le_bytes());
        let sum = Sha256::digest(&bytes);
        bytes.extend_from_slice(&sum);
        bytes
    }

    fn decode(bytes: &[u8], path: &Path) -> Result<Self, SnapshotError> {
        let known = bytes.len().min(MAGIC.len());
        if bytes[..known] != MAGIC[..known] {
            return Err(SnapshotError::NotASnapshot { path: path.into() });
        }
        let damaged = || SnapshotError::Damaged { path: path.into() };
        let length = bytes.get(8..16).and_then(|b| b.first_chunk::<8>()).map(|b| u64::from_le_bytes(*b));
        let least = (HEADER + CHECKSUM) as u64;
        let expected = length.unwrap_or(least);
        if (bytes.len() as u64) < expected {
            return Err(SnapshotError::Truncated { path: path.into(), bytes: bytes.len() as u64, expected });
        }
        if bytes.len() as u64 > expected || expected < least {
            return Err(damaged());
        }
        let (content, sum) = bytes.split_last_chunk::<CHECKSUM>().ok_or_else(damaged)?;
        if Sha256::digest(content)[..] != sum[..] {
            return Err(damaged());
        }
        let malformed = |Malformed(what)| SnapshotError::Malformed { path: path.into(), what };
        let mut reader = ByteReader(&content[16..]);
        let found = reader.u32().map_err(malformed)?;
        if found != FORMAT {
            return Err(SnapshotError::Format { path: path.into(), found, supported: FORMAT });
        }
        let (found, running) = (reader.text().map_err(malformed)?, mj::version_string());
        if found != running {
            return Err(SnapshotError::MujocoVersion { path: path.into(), found, running });
        }
        read_content(&mut reader).map_err(malformed)
    }
}

fn read_content(reader: &mut ByteReader<'_>) -> Result<Snapshot, Malformed> {
    // The length of a text takes 8 bytes.
    let lines = (0..reader.count(8)?).map(|_| reader.text()).collect::<Result<Vec<_>, _>>()?;
    let layout = StateLayout::from_lines(lines);
    let entries = (0..reader.count(8)?).map(|_| read_entry(reader, layout.drives())).collect::<Result<Vec<_>, _>>()?;
    if !reader.0.is_empty() {
        return Err(Malformed("data follows the last environment"));
    }
    if !entries.iter().all(|entry| entry.state.has_same_lengths(&entries[0].state)) {
        return Err(Malformed("environments have states of different sizes"));
    }
    Ok(Snapshot { layout: Arc::new(layout), entries: entries.into() })
}

fn write_entry(entry: &EnvEntry, out: &mut ByteWriter) {
    let EnvState { motion, inputs, drives, wrenches, welds, steps, diverged } = &entry.state;
    let (values, active) = inputs.values();
    out.u64(entry.env as u64);
    out.u64(*steps);
    out.numbers(motion.values());
    out.numbers(values);
    out.flags(active);
    out.numbers(drives);
    out.numbers(&wrenches.to_flat());
    out.u64(welds.len() as u64);
    for weld in welds {
        out.u64(weld.equality as u64);
        out.numbers(&weld.pose);
    }
    let SavedProperties { values, randomizations } = &*entry.overrides;
    out.u64(*randomizations);
    out.u64(values.len() as u64);
    for NamedValue { property, name, nth, value } in values {
        out.text(property.name());
        out.text(name);
        out.u32(*nth);
        out.numbers(value);
    }
    let Some(EnvStatus::Diverged { step, reason }) = diverged.as_deref() else { return out.u8(0) };
    match reason {
        Divergence::Warning(warning) => {
            out.u8(1);
            out.text(warning.name());
        }
        Divergence::Engine(error) => {
            out.u8(2);
            out.text(&error.message);
        }
        Divergence::BuffersExhausted { buffers: Buffers { contacts, constraints, arena_bytes }, bodies: _ } => {
            out.u8(3);
            [contacts, constraints, arena_bytes].iter().for_each(|size| out.u64(**size as u64));
        }
    }
    out.u64(*step);
}

/// Maximum number of steps, far from overflow and beyond any run: a step of a microsecond for 285 years.
const MAX_STEPS: u64 = 1 << 53;

/// Reads an environment of a scene with this many drives.
fn read_entry(reader: &mut ByteReader<'_>, drive_count: usize) -> Result<EnvEntry, Malformed> {
    let finite = |reader: &mut ByteReader<'_>, what| {
        let numbers = reader.numbers()?;
        if numbers.iter().all(|number| number.is_finite()) { Ok(numbers) } else { Err(Malformed(what)) }
    };
    let steps = |reader: &mut ByteReader<'_>| match reader.u64()? {
        steps if steps <= MAX_STEPS => Ok(steps),
        _ => Err(Malformed("a step count is out of range")),
    };
    let size = |reader: &mut ByteReader<'_>| {
        usize::try_from(reader.u64()?).map_err(|_| Malformed("a number is too large for this machine"))
    };
    let env = size(reader)?;
    let done = steps(reader)?;
    let motion = IntegrationState::from_values(finite(reader, "a time, position or velocity is not finite")?);
    let (values, active) = (finite(reader, "a control or an applied force is not finite")?, reader.flags()?);
    let drives = reader.numbers()?;
    if let Some(what) = flat_error(&drives, drive_count) {
        return Err(Malformed(what));
    }
    let wrenches = finite(reader, "a wrench is not finite")?;
    let wrenches = Wrenches::from_flat(&wrenches).ok_or(Malformed("a wrench is incomplete"))?;
    // An index, and a list of seven numbers with its length.
    let welds = (0..reader.count(8 * 9)?).map(|_| read_weld(reader)).collect::<Result<Vec<_>, _>>()?;
    let randomizations = match reader.u64()? {
        draws if draws <= MAX_STEPS => draws,
        _ => return Err(Malformed("a randomization count is out of range")),
    };
    // Two texts and a list with their lengths, and a number.
    let own = (0..reader.count(8 + 8 + 4 + 8)?).map(|_| read_property(reader)).collect::<Result<Vec<_>, _>>()?;
    let overrides = Arc::new(SavedProperties { values: own, randomizations });
    let reason = match reader.u8()? {
        0 => None,
        1 => {
            let name = reader.text()?;
            let warning = Warning::ALL.into_iter().find(|warning| warning.name() == name);
            Some(Divergence::Warning(warning.ok_or(Malformed("a warning is unknown"))?))
        }
        2 => Some(Divergence::Engine(EngineError { message: reader.text()? })),
        3 => {
            let (contacts, constraints, arena_bytes) = (size(reader)?, size(reader)?, size(reader)?);
            let buffers = Buffers { contacts, constraints, arena_bytes };
            Some(Divergence::BuffersExhausted { buffers, bodies: Vec::new() })
        }
        _ => return Err(Malformed("a status is unknown")),
    };
    let diverged = match reason {
        None => None,
        Some(reason) => Some(Box::new(EnvStatus::Diverged { step: steps(reader)?, reason })),
    };
    let inputs = UserInputs::from_values(values, active);
    let state = EnvState { motion, inputs, drives, wrenches, welds, steps: done, diverged };
    Ok(EnvEntry { env, state, overrides })
}

fn read_property(reader: &mut ByteReader<'_>) -> Result<NamedValue, Malformed> {
    let word = reader.text()?;
    let property = Property::ALL.into_iter().find(|property| property.name() == word);
    let property = property.ok_or(Malformed("a property is unknown"))?;
    let (name, nth, value) = (reader.text()?, reader.u32()?, reader.numbers()?);
    if value.len() != property.width() {
        return Err(Malformed("a property is incomplete"));
    }
    // The scene decides which numbers of a size must be 0.
    match property.invalid_reason(&value, &value) {
        None => Ok(NamedValue { property, name, nth, value: value.into() }),
        Some(_) => Err(Malformed("a property has an invalid value")),
    }
}

fn read_weld(reader: &mut ByteReader<'_>) -> Result<Weld, Malformed> {
    let equality = usize::try_from(reader.u64()?).map_err(|_| Malformed("a number is too large for this machine"))?;
    let pose: [f64; 7] = reader.numbers()?.try_into().map_err(|_| Malformed("a weld is incomplete"))?;
    let length = pose[3..].iter().map(|q| q * q).sum::<f64>();
    if pose.iter().all(|number| number.is_finite()) && (length - 1.0).abs() < 1e-6 {
        Ok(Weld { equality, pose })
    } else {
        Err(Malformed("the pose of a weld is invalid"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::gains::{DriveSetting, Gains};
    use crate::drive::table::{Drive, DriveTable, Realization};
    use crate::drive::{DelayedPd, DriveType};
    use crate::env::SimEnv;

    /// Environment of a small model, with a joint that a delayed drive moves.
    fn env() -> (SimEnv, StateLayout) {
        let text = r#"<mujoco><worldbody><body name="b"><joint name="j" type="ball"/><geom size="0.1"/>
            <body name="c"><joint name="k" axis="0 1 0"/><geom size="0.1" pos="0.1 0 0"/></body></body></worldbody>
            <actuator><motor name="m" joint="k"/></actuator></mujoco>"#;
        let model = mj::compile(text, &[]).expect("compiles").into_model();
        let initial = Gains { kp: 3.0, kd: 1.0, max_effort: f64::INFINITY, max_velocity: 9.0 };
        let setting = DriveSetting { drive_type: DriveType::Force, stiffness: 3.0, damping: 1.0, inertia: None };
        let (realization, range) = (Realization::Actuator, [f64::NEG_INFINITY, 1.0]);
        let drive = Drive { qpos: 4, dof: 3, ctrl: 0, realization, initial, setting, range };
        let mut table = DriveTable { drives: vec![drive], ..DriveTable::default() };
        table.push_model(0, DelayedPd { delay: 2, max_delay: 3 }.into());
        let layout = StateLayout::of(&model, &table, 1);
        (SimEnv::new(&model, &Arc::new(table)).expect("small"), layout)
    }

    /// Snapshot of two such environments, one of which has diverged for `reason`.
    fn snapshot(reason: Divergence) -> Snapshot {
        let (mut env, layout) = env();
        env.write(|data| data.qvel_mut()[1] = 0.3);
        env.step(7);
        let value = |property: Property, nth, value: &[f64]| {
            let name = format!("größe/{nth}");
            NamedValue { property, name, nth, value: value.into() }
        };
        let values = vec![
            value(Property::Mass, 0, &[0.7]),
            value(Property::Size, 2, &[0.1, 0.2, 0.0]),
            value(Property::MaxEffort, 0, &[f64::INFINITY]),
        ];
        let own = [Arc::new(SavedProperties { values, randomizations: 5 }), Arc::default()];
        let mut entries: Vec<EnvEntry> = own
            .into_iter()
            .zip([3, 0])
            .map(|(overrides, at)| EnvEntry { env: at, state: env.save_state(), overrides })
            .collect();
        entries[1].state.diverged = Some(Box::new(EnvStatus::Diverged { step: 7, reason }));
        Snapshot { layout: Arc::new(layout), entries: entries.into() }
    }

    fn decode(bytes: &[u8]) -> Result<Snapshot, SnapshotError> {
        Snapshot::decode(bytes, Path::new("file"))
    }

    fn bytes() -> Vec<u8> {
        snapshot(Divergence::Warning(Warning::BadVelocity)).encode(FORMAT, &mj::version_string())
    }

    #[test]
    fn round_trip() {
        let buffers = Buffers { contacts: 1, constraints: 2, arena_bytes: 3 };
        for reason in [
            Divergence::Warning(Warning::BadAcceleration),
            Divergence::Engine(EngineError { message: "stäck".into() }),
            Divergence::BuffersExhausted { buffers, bodies: Vec::new() },
        ] {
            let snapshot = snapshot(reason);
            let read = decode(&snapshot.encode(FORMAT, &mj::version_string())).expect("whole");
            assert_eq!(read.entries, snapshot.entries);
            assert_eq!(read.layout, snapshot.layout);
        }
    }

    #[test]
    fn truncated_files() {
        let bytes = bytes();
        for end in 0..bytes.len() {
            let error = decode(&bytes[..end]).expect_err("too short");
            assert!(matches!(error, SnapshotError::Truncated { bytes, .. } if bytes == end as u64), "{end}: {error}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(matches!(decode(&longer), Err(SnapshotError::Damaged { .. })));
    }

    #[test]
    fn flipped_bits() {
        let good = bytes();
        for bit in 0..8 * good.len() {
            let mut bytes = good.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let error = decode(&bytes).expect_err("damaged");
            match (bit / 8, &error) {
                (0..8, SnapshotError::NotASnapshot { .. }) => {}
                // An increased length cannot be distinguished from a truncated file.
                (8..16, SnapshotError::Truncated { .. } | SnapshotError::Damaged { .. }) => {}
                (16.., SnapshotError::Damaged { .. }) => {}
                _ => panic!("bit {bit}: {error}"),
            }
        }
    }

    #[test]
    fn foreign_files() {
        assert!(matches!(decode(b"PK\x03\x04 something else"), Err(SnapshotError::NotASnapshot { .. })));
        let snapshot = snapshot(Divergence::Warning(Warning::BadVelocity));
        let other = decode(&snapshot.encode(2, &mj::version_string()));
        assert!(matches!(other, Err(SnapshotError::Format { found: 2, supported: 3, .. })));
        let other = decode(&snapshot.encode(FORMAT, "3.9.9"));
        assert!(matches!(other, Err(SnapshotError::MujocoVersion { found, .. }) if found == "3.9.9"));
    }

    /// Changes every byte of the content, and corrects the checksum. The result is an error or another snapshot, never
    /// a panic or an allocation beyond the file. An environment that continues from another snapshot steps, or
    /// diverges.
    #[test]
    fn right_checksum_of_wrong_content() {
        let good = bytes();
        let (mut refused, mut stepped) = (0, 0);
        let (mut env, _) = env();
        let like = env.save_state();
        for at in HEADER..good.len() - CHECKSUM {
            for value in [0, 1, 0x7f, 0xff] {
                let mut bytes = good[..good.len() - CHECKSUM].to_vec();
                bytes[at] = value;
                let sum = Sha256::digest(&bytes);
                bytes.extend_from_slice(&sum);
                match decode(&bytes) {
                    Ok(snapshot) => {
                        for entry in snapshot.entries.iter().filter(|entry| entry.state.has_same_lengths(&like)) {
                            env.load_state(&entry.state);
                            env.step(3);
                            assert!(env.data().qpos().iter().all(|q| q.is_finite()), "byte {at}: {value}");
                            stepped += 1;
                        }
                    }
                    Err(error) => refused += usize::from(matches!(error, SnapshotError::Malformed { .. })),
                }
            }
        }
        assert!(refused > 100 && stepped > 1000, "{refused} {stepped}");
        env.load_state(&like);
        assert_eq!(env.save_state(), like, "restoring leaves no trace of the intermediate state");
    }

    /// Error of a snapshot with changed entries.
    fn fault(change: &dyn Fn(&mut Vec<EnvEntry>)) -> Option<String> {
        let mut snapshot = snapshot(Divergence::Warning(Warning::BadVelocity));
        let mut entries = snapshot.entries.to_vec();
        change(&mut entries);
        snapshot.entries = entries.into();
        match decode(&snapshot.encode(FORMAT, &mj::version_string())) {
            Ok(_) => None,
            Err(SnapshotError::Malformed { what, .. }) => Some(what.to_string()),
            Err(other) => panic!("{other}"),
        }
    }

    #[test]
    fn impossible_numbers() {
        let fault = |change: &dyn Fn(&mut EnvState)| fault(&|entries| change(&mut entries[1].state));
        // Control: unchanged entries are read.
        assert_eq!(fault(&|_| {}), None);
        let motion = |value| {
            move |state: &mut EnvState| {
                let mut values = state.motion.values().to_vec();
                values[3] = value;
                state.motion = IntegrationState::from_values(values);
            }
        };
        let input = |value| {
            move |state: &mut EnvState| {
                let (values, active) = state.inputs.values();
                let (mut values, active) = (values.to_vec(), active.to_vec());
                values[0] = value;
                state.inputs = UserInputs::from_values(values, active);
            }
        };
        let drive = |index: usize, value| move |state: &mut EnvState| state.drives[index] = value;
        let (nan, infinite) = (f64::NAN, f64::INFINITY);
        assert!(fault(&motion(nan)).is_some_and(|what| what.contains("position")));
        assert!(fault(&motion(infinite)).is_some());
        assert!(fault(&input(nan)).is_some_and(|what| what.contains("control")));
        // Gains, limits, drive type, stiffness, damping, inertia, range; targets; memory of the delay.
        let bad: [(usize, &[f64]); 15] = [
            (0, &[nan, -1.0, infinite]),
            (1, &[-1.0]),
            (2, &[-1.0, nan]),
            (3, &[-1.0]),
            (4, &[0.5, 9.0]),
            (5, &[nan, -1.0]),
            (6, &[-1.0]),
            (7, &[-1.0, infinite]),
            (8, &[nan, 2.0]),
            (9, &[nan]),
            (10, &[nan]),
            (11, &[infinite]),
            (12, &[nan]),
            (16, &[nan]),
            (20, &[infinite]),
        ];
        for (index, value) in
            bad.into_iter().flat_map(|(index, values)| values.iter().map(move |&value| (index, value)))
        {
            assert!(fault(&drive(index, value)).is_some(), "number {index}: {value}");
        }
        for (index, value) in [(2, infinite), (3, infinite), (4, 1.0), (8, -2.0), (9, infinite), (10, -3.0)] {
            assert_eq!(fault(&drive(index, value)), None, "number {index}: {value}");
        }
        assert!(fault(&|state| state.drives.truncate(5)).is_some());
        assert!(fault(&|state| state.steps = MAX_STEPS + 1).is_some_and(|what| what.contains("step count")));
        assert_eq!(fault(&|state| state.steps = MAX_STEPS), None);
    }

    #[test]
    fn impossible_properties() {
        let fault =
            |change: &dyn Fn(&mut SavedProperties)| fault(&|entries| change(Arc::make_mut(&mut entries[0].overrides)));
        assert_eq!(fault(&|_| {}), None, "control");
        for bad in [vec![], vec![1.0, 2.0], vec![0.0], vec![f64::NAN], vec![-1.0]] {
            assert!(fault(&|own| own.values[0].value = bad.clone().into()).is_some(), "{bad:?}");
        }
        assert!(fault(&|own| own.values[1].value = [0.1, -0.2, 0.0].into()).is_some());
        assert!(
            fault(&|own| own.randomizations = MAX_STEPS + 1).is_some_and(|what| what.contains("randomization count"))
        );
    }

    #[test]
    fn most_steps() {
        let (mut env, _) = env();
        let mut state = env.save_state();
        for (steps, then) in [(MAX_STEPS, MAX_STEPS + 2), (u64::MAX, u64::MAX)] {
            state.steps = steps;
            env.load_state(&state);
            env.step(2);
            assert_eq!((env.steps(), env.status()), (then, &EnvStatus::Running));
        }
    }
}
