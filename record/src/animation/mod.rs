//! Animations: the images of one camera in one environment as a video file. Each format has one file here, and one
//! entry in the list of [`Format`]. Datasets use the H.264 encoder and the writer of MP4 files, too.

mod gif;
pub(crate) mod h264;
mod level;
pub(crate) mod mp4;

use crate::error::{RecordError, Result};
use crate::file::{PartialFile, Storage};
use crate::format::Format;
use crate::packet::Packet;
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteError, WriteResult};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Output of encoders.
pub(crate) type Output = BufWriter<Box<dyn Storage>>;

/// Encoder of a format.
trait Encoder: Send {
    /// Encodes the next frame: RGBA pixels, and begin and end of its display \[s\], relative to the first frame.
    fn frame(&mut self, out: &mut Output, rgba: &[u8], shown: [f64; 2]) -> WriteResult;

    /// Writes the end of the file, and the parts of its beginning that are known only now.
    fn finish(&mut self, out: &mut Output) -> WriteResult;
}

/// Creates an encoder for frames of this width and height; the error describes the supported sizes.
type CreateEncoder = fn([usize; 2]) -> std::result::Result<Box<dyn Encoder>, String>;

fn encoder(format: Format) -> Option<CreateEncoder> {
    match format {
        Format::Gif => Some(gif::begin),
        Format::Mp4 => Some(mp4::begin),
        _ => None,
    }
}

/// Duration of a frame that is the only one \[s\].
const SINGLE_FRAME_DURATION: f64 = 0.04;

/// Writer of an animation.
pub(crate) struct Animation {
    part: PartialFile,
    file: Option<Output>,
    encoder: Box<dyn Encoder>,
    /// The last frame, whose duration is not known yet, and its time \[s\].
    pending: Option<(Vec<u8>, f64)>,
    /// Time of the first frame \[s\]; `None` until it is encoded.
    first: Option<f64>,
    /// Duration of the previous frame \[s\].
    last_duration: f64,
}

/// Checks that a format supports frames of this width and height.
pub(crate) fn check_size(path: &Path, format: Format, size: [usize; 2]) -> Result<()> {
    create_encoder(path, format, size).map(|_| ())
}

fn create_encoder(path: &Path, format: Format, size: [usize; 2]) -> Result<Box<dyn Encoder>> {
    // Callers use animation formats only.
    let begin = encoder(format).ok_or_else(|| RecordError::NothingToRecord { path: path.into(), format })?;
    let [width, height] = size;
    begin(size).map_err(|supported| RecordError::UnsupportedSize {
        path: path.into(),
        format,
        width,
        height,
        supported,
    })
}

impl Animation {
    pub(crate) fn create(
        part: PartialFile,
        storage: Box<dyn Storage>,
        format: Format,
        size: [usize; 2],
    ) -> Result<Self> {
        let encoder = create_encoder(part.path(), format, size)?;
        let file = Some(BufWriter::with_capacity(1 << 16, storage));
        Ok(Self { part, file, encoder, pending: None, first: None, last_duration: SINGLE_FRAME_DURATION })
    }

    /// Encodes the pending frame, which ends at `next` \[s\]. Without a next frame, it has the duration of the previous
    /// one. Returns the pixel buffer for reuse, or an empty one if no frame is pending.
    fn encode_pending(&mut self, next: Option<f64>) -> WriteResult<Vec<u8>> {
        let (Some((rgba, time)), Some(out)) = (self.pending.take(), &mut self.file) else { return Ok(Vec::new()) };
        self.last_duration = next.map_or(self.last_duration, |next| next - time);
        let first = *self.first.get_or_insert(time);
        self.encoder.frame(out, &rgba, [time - first, time + self.last_duration - first])?;
        Ok(rgba)
    }
}

impl FormatWriter for Animation {
    fn write(&mut self, _streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        let Some(block) = packet.streams.iter().find(|block| block.has_content) else { return Ok(()) };
        // The time is on the clock of the recording, which continues over resets.
        let time = block.recorded_times.first().copied().unwrap_or(0.0);
        let mut rgba = self.encode_pending(Some(time))?;
        rgba.clear();
        rgba.extend_from_slice(block.values.as_u8s());
        self.pending = Some((rgba, time));
        Ok(())
    }

    fn finish(&mut self, _streams: &[StreamSchema]) -> WriteResult<u64> {
        self.encode_pending(None)?;
        let Some(mut file) = self.file.take().filter(|_| self.first.is_some()) else {
            return Err(WriteError::NoFrame("the camera captured no image"));
        };
        self.encoder.finish(&mut file)?;
        file.flush()?;
        Ok(self.part.commit()?)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        self.part.kept_path()
    }
}

/// Converts a time to a whole number of units. Durations are differences of these numbers, so that rounding errors do
/// not accumulate.
fn units(time: f64, per_second: f64) -> u64 {
    // Negative times become 0: none precedes the first frame.
    (time * per_second).round() as u64
}

/// Duration of a frame in units, at least one and at most `most`.
///
/// # Errors
/// The frame is longer than the format supports.
fn duration<N: TryFrom<u64>>([from, until]: [f64; 2], per_second: f64, most: u64) -> WriteResult<N> {
    let found = units(until, per_second).saturating_sub(units(from, per_second)).max(1);
    let fits = N::try_from(found).ok().filter(|_| found <= most);
    let longest = most as f64 / per_second;
    fits.ok_or_else(|| {
        WriteError::limit(format!("a frame of this format lasts at most {longest} s; record more often"))
    })
}

/// Copies pixels without their alpha channel.
fn rgb_of(rgba: &[u8], rgb: &mut Vec<u8>) {
    rgb.clear();
    for pixel in rgba.as_chunks::<4>().0 {
        rgb.extend_from_slice(&pixel[..3]);
    }
}

/// Width and height, if both are from 1 to `most`.
fn check_sides<N: TryFrom<usize>>(size: [usize; 2], most: usize) -> std::result::Result<[N; 2], String> {
    let side = |side: usize| N::try_from(side).ok().filter(|_| (1..=most).contains(&side));
    match size.map(side) {
        [Some(width), Some(height)] => Ok([width, height]),
        _ => Err(format!("both sides must be from 1 to {most} pixels")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations() {
        // 30 frames per second in units of 10 ms: 3, 4, 3, 3, 4, ...
        let shown = |k: u32| [f64::from(k) / 30.0, f64::from(k + 1) / 30.0];
        let all: Vec<u64> = (0..30).map(|k| duration(shown(k), 100.0, 9).unwrap()).collect();
        assert_eq!((all[..3].to_vec(), all.iter().sum::<u64>()), (vec![3, 4, 3], 100));
        assert_eq!(duration::<u16>([1.0, 1.0], 100.0, 9).unwrap(), 1, "every frame is shown");
        assert_eq!(duration::<u16>([1.0, 656.35], 100.0, 65_535).unwrap(), 65_535);
        let error = duration::<u16>([1.0, 656.36], 100.0, 65_535).unwrap_err().to_string();
        assert!(error.contains("at most 655.35 s"), "{error}");
    }
}
