//! Animations: the pictures of one camera in one environment as a file that is played. A format is one file here, and one line in
//! the list of [`Format`].

mod apng;
mod gif;
mod h264;
mod level;
mod mp4;
mod webp;

use crate::error::{RecordError, Result};
use crate::file::{PartFile, Storage};
use crate::format::Format;
use crate::packet::Packet;
use crate::stream::Stream;
use crate::writer::{Fault, Sink, Written};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// What frames are written to.
type Out = BufWriter<Box<dyn Storage>>;

/// Writes frames as a format has them.
trait Encoder: Send {
    /// The next frame: its pixels, red, green, blue and opacity, and since when until when it is shown \[s\], from the first frame
    /// on.
    fn frame(&mut self, out: &mut Out, rgba: &[u8], shown: [f64; 2]) -> Written;

    /// What follows the last frame, and what of the beginning is known only then.
    fn finish(&mut self, out: &mut Out) -> Written;
}

/// How a format begins: pictures of some width and height; or what they would have to be.
type Begin = fn([usize; 2]) -> std::result::Result<Box<dyn Encoder>, String>;

fn encoder(format: Format) -> Option<Begin> {
    match format {
        Format::Apng => Some(apng::begin),
        Format::Gif => Some(gif::begin),
        Format::Webp => Some(webp::begin),
        Format::Mp4 => Some(mp4::begin),
        _ => None,
    }
}

/// How long a frame is shown that is the only one \[s\].
const ALONE: f64 = 0.04;

/// An animation on its way.
pub(crate) struct Animation {
    part: PartFile,
    file: Option<Out>,
    encoder: Box<dyn Encoder>,
    /// The frame that waits to know how long it is shown, and its time \[s\].
    waiting: Option<(Vec<u8>, f64)>,
    /// The time of the first frame \[s\].
    first: Option<f64>,
    /// How long the frame before was shown \[s\].
    last: f64,
}

/// Checks that a format has pictures of this width and height.
pub(crate) fn check(path: &Path, format: Format, size: [usize; 2]) -> Result<()> {
    begin(path, format, size).map(|_| ())
}

fn begin(path: &Path, format: Format, size: [usize; 2]) -> Result<Box<dyn Encoder>> {
    // Nobody asks for an animation of another format.
    let begin = encoder(format).ok_or_else(|| RecordError::Nothing { path: path.into(), format })?;
    let [width, height] = size;
    begin(size).map_err(|fits| RecordError::Size { path: path.into(), format, width, height, fits })
}

impl Animation {
    pub(crate) fn create(part: PartFile, storage: Box<dyn Storage>, format: Format, size: [usize; 2]) -> Result<Self> {
        let encoder = begin(part.path(), format, size)?;
        let file = Some(BufWriter::with_capacity(1 << 16, storage));
        Ok(Self { part, file, encoder, waiting: None, first: None, last: ALONE })
    }

    /// Writes the frame that waits, which is shown until `next` \[s\]; where there is no next one, as long as the one before.
    /// Gives its memory.
    fn show(&mut self, next: Option<f64>) -> Written<Vec<u8>> {
        let (Some((rgba, time)), Some(out)) = (self.waiting.take(), &mut self.file) else { return Ok(Vec::new()) };
        self.last = next.map_or(self.last, |next| next - time);
        let first = *self.first.get_or_insert(time);
        self.encoder.frame(out, &rgba, [time - first, time + self.last - first])?;
        Ok(rgba)
    }
}

impl Sink for Animation {
    fn write(&mut self, _streams: &[Stream], packet: &Packet) -> Written {
        let Some(block) = packet.blocks.iter().find(|block| block.used) else { return Ok(()) };
        // On the clock of the recording, which goes on over resets.
        let time = block.stamps.first().copied().unwrap_or(0.0);
        let mut rgba = self.show(Some(time))?;
        rgba.clear();
        rgba.extend_from_slice(block.values.bytes());
        self.waiting = Some((rgba, time));
        Ok(())
    }

    fn flush(&mut self) -> Written {
        // Nobody can read it before the end.
        Ok(())
    }

    fn finish(&mut self, _streams: &[Stream]) -> Written<u64> {
        self.show(None)?;
        let Some(mut file) = self.file.take().filter(|_| self.first.is_some()) else {
            return Err(Fault::NoFrame("the camera has measured nothing"));
        };
        self.encoder.finish(&mut file)?;
        file.flush()?;
        Ok(self.part.commit()?)
    }

    fn kept(&self) -> Option<PathBuf> {
        self.part.kept()
    }
}

/// A moment as a whole number of units, of which a second has `per_second`. What is shown from one moment to the next is the
/// difference of two of them, so that nothing adds up.
fn units(time: f64, per_second: f64) -> u64 {
    // Negative ones become 0: there is none before the first frame.
    (time * per_second).round() as u64
}

/// How long a frame is shown, in such units: at least one, and `most` at most.
///
/// # Errors
/// It was shown for longer than the format can say.
fn duration<N: TryFrom<u64>>([from, until]: [f64; 2], per_second: f64, most: u64) -> Written<N> {
    let found = units(until, per_second).saturating_sub(units(from, per_second)).max(1);
    let fits = N::try_from(found).ok().filter(|_| found <= most);
    let longest = most as f64 / per_second;
    fits.ok_or_else(|| {
        Fault::limit(format!("a frame of this format is shown for {longest} s at most: record more often"))
    })
}

/// Pixels without their opacity.
fn rgb_of(rgba: &[u8], rgb: &mut Vec<u8>) {
    rgb.clear();
    for pixel in rgba.as_chunks::<4>().0 {
        rgb.extend_from_slice(&pixel[..3]);
    }
}

/// Width and height, where both are from 1 to `most`.
fn sides<N: TryFrom<usize>>(size: [usize; 2], most: usize) -> std::result::Result<[N; 2], String> {
    let side = |side: usize| N::try_from(side).ok().filter(|_| (1..=most).contains(&side));
    match size.map(side) {
        [Some(width), Some(height)] => Ok([width, height]),
        _ => Err(format!("1 to {most} pixels would do for both")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations() {
        // 30 frames a second in hundredths of a second: 3, 4, 3, 3, 4, ...
        let shown = |k: u32| [f64::from(k) / 30.0, f64::from(k + 1) / 30.0];
        let all: Vec<u64> = (0..30).map(|k| duration(shown(k), 100.0, 9).unwrap()).collect();
        assert_eq!((all[..3].to_vec(), all.iter().sum::<u64>()), (vec![3, 4, 3], 100));
        assert_eq!(duration::<u16>([1.0, 1.0], 100.0, 9).unwrap(), 1, "there is no frame that is not shown");
        assert_eq!(duration::<u16>([1.0, 656.35], 100.0, 65_535).unwrap(), 65_535);
        let error = duration::<u16>([1.0, 656.36], 100.0, 65_535).unwrap_err().to_string();
        assert!(error.contains("655.35 s at most"), "{error}");
    }
}
