//! MP4 files (ISO/IEC 14496-12, video as in 14496-15): the frames in sequence, then the table of their offsets and
//! durations. The file is not readable without the table, which is written at the end.

use super::h264::{BT709, H264Encoder, ParameterSets, StreamCfg, is_idr};
use super::{Encoder, Output, duration};
use crate::writer::{WriteError, WriteResult};
use std::io::{Seek, SeekFrom, Write};

/// Units of time per second: integers for a frame at 24, 25, 30, 50, 60 and 100 Hz.
const PER_SECOND: u32 = 90_000;

/// Number of frames from one IDR frame to the next.
const IDR_INTERVAL: u32 = 120;

/// Encoder of an animation.
struct Mp4 {
    stream: H264Encoder,
    file: Mp4Writer,
}

/// Writer of a file with coded frames.
pub(crate) struct Mp4Writer {
    cfg: StreamCfg,
    /// Units of time per second.
    per_second: u32,
    frames: Vec<Sample>,
    /// File offset of the data length, which is written at the end.
    length_at: u64,
    /// File offset of the next frame.
    offset: u64,
}

struct Sample {
    offset: u64,
    bytes: u32,
    duration: u32,
    is_sync: bool,
}

pub(super) fn begin(size: [usize; 2]) -> Result<Box<dyn Encoder>, String> {
    let cfg = StreamCfg { size, colors: &BT709, idr_interval: IDR_INTERVAL };
    Ok(Box::new(Mp4 { stream: H264Encoder::new(cfg)?, file: Mp4Writer::new(&cfg, PER_SECOND) }))
}

/// A box: its length, including the header, its type and its content.
fn make_box(kind: &[u8; 4], parts: &[&[u8]]) -> Vec<u8> {
    let length = 8 + parts.iter().map(|part| part.len()).sum::<usize>();
    // The largest box has some bytes for each frame.
    let mut all = u32::try_from(length).unwrap_or(u32::MAX).to_be_bytes().to_vec();
    all.extend_from_slice(kind);
    parts.iter().for_each(|part| all.extend_from_slice(part));
    all
}

/// A box with a version and flags.
fn full_box(kind: &[u8; 4], version: u8, flags: u32, parts: &[&[u8]]) -> Vec<u8> {
    let mut head = flags.to_be_bytes();
    head[0] = version;
    make_box(kind, &[&[&head[..]], parts].concat())
}

/// Concatenates big-endian numbers.
fn be_bytes<const B: usize>(numbers: impl IntoIterator<Item = [u8; B]>) -> Vec<u8> {
    numbers.into_iter().flatten().collect()
}

fn u32s(numbers: &[u32]) -> Vec<u8> {
    be_bytes(numbers.iter().map(|number| number.to_be_bytes()))
}

/// The identity matrix in fixed point: no rotation, no scale.
const IDENTITY_MATRIX: [u32; 9] = [1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30];

impl Mp4Writer {
    /// Begins a file for a stream, with `per_second` units of time per second.
    pub(crate) fn new(cfg: &StreamCfg, per_second: u32) -> Self {
        Self { cfg: *cfg, per_second, frames: Vec::new(), length_at: 0, offset: 0 }
    }

    /// Writes a frame: NAL units of [`H264Encoder::encode`], and the duration in units of time.
    pub(crate) fn add(&mut self, out: &mut Output, units: &[u8], duration: u32) -> WriteResult {
        if self.frames.is_empty() {
            let brands = make_box(b"ftyp", &[b"isom", &u32s(&[0x200]), b"isomiso2avc1mp41"]);
            out.write_all(&brands)?;
            // The length has eight bytes and is not known yet.
            out.write_all(&u32s(&[1]))?;
            out.write_all(b"mdat\0\0\0\0\0\0\0\0")?;
            self.length_at = brands.len() as u64 + 8;
            self.offset = self.length_at + 8;
        }
        let too_large = |_| WriteError::limit("a frame of an MP4 file has less than 4 GiB; use smaller images");
        let bytes = u32::try_from(units.len()).map_err(too_large)?;
        out.write_all(units)?;
        self.frames.push(Sample { offset: self.offset, bytes, duration, is_sync: is_idr(units) });
        self.offset += u64::from(bytes);
        Ok(())
    }

    /// Completes the file. `sets` are the parameter sets of the stream.
    pub(crate) fn finish(&self, out: &mut Output, sets: &ParameterSets) -> WriteResult {
        out.write_all(&self.movie_box(sets))?;
        out.seek(SeekFrom::Start(self.length_at))?;
        // The length includes the header of sixteen bytes.
        Ok(out.write_all(&(self.offset - self.length_at + 8).to_be_bytes())?)
    }

    /// Movie metadata (8.2).
    fn movie_box(&self, sets: &ParameterSets) -> Vec<u8> {
        let length: u64 = self.frames.iter().map(|frame| u64::from(frame.duration)).sum();
        let length = length.to_be_bytes();
        // Without times of creation and modification, equal recordings give equal files.
        let never = [0; 16];
        let scale = self.per_second.to_be_bytes();
        let [upright, next] = [u32s(&IDENTITY_MATRIX), u32s(&[2])];
        let loudness = u32s(&[1 << 16, 1 << 24, 0, 0]);
        let header = full_box(b"mvhd", 1, 0, &[&never, &scale, &length, &loudness, &upright, &[0; 24], &next]);
        let sides = u32s(&self.cfg.size.map(|side| (side as u32) << 16));
        // Enabled, in the movie, in its preview; track 1.
        let track = full_box(b"tkhd", 1, 7, &[&never, &u32s(&[1, 0]), &length, &[0; 16], &upright, &sides]);
        // Language `und` (undetermined), five bits per letter.
        let media = full_box(b"mdhd", 1, 0, &[&never, &scale, &length, &[0x55, 0xc4, 0, 0]]);
        let handler = full_box(b"hdlr", 0, 0, &[&[0; 4], b"vide", &[0; 12], b"video\0"]);
        let here = full_box(b"dref", 0, 0, &[&u32s(&[1]), &full_box(b"url ", 0, 1, &[])]);
        let video = full_box(b"vmhd", 0, 1, &[&[0; 8]]);
        let info = make_box(b"minf", &[&video, &make_box(b"dinf", &[&here]), &self.sample_table(sets)]);
        let track = make_box(b"trak", &[&track, &make_box(b"mdia", &[&media, &handler, &info])]);
        make_box(b"moov", &[&header, &track])
    }

    /// Sample table (8.5).
    fn sample_table(&self, sets: &ParameterSets) -> Vec<u8> {
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX).to_be_bytes();
        let mut shown: Vec<[u32; 2]> = Vec::new();
        for frame in &self.frames {
            match shown.last_mut() {
                Some([frames, duration]) if *duration == frame.duration => *frames += 1,
                _ => shown.push([1, frame.duration]),
            }
        }
        let times = be_bytes(shown.iter().flatten().map(|number| number.to_be_bytes()));
        let times = full_box(b"stts", 0, 0, &[&count(shown.len()), &times]);
        let alone: Vec<u32> = (1..).zip(&self.frames).filter(|(_, frame)| frame.is_sync).map(|(k, _)| k).collect();
        let alone = full_box(b"stss", 0, 0, &[&count(alone.len()), &u32s(&alone)]);
        // Each frame is a chunk.
        let chunks = full_box(b"stsc", 0, 0, &[&u32s(&[1, 1, 1, 1])]);
        let sizes = be_bytes(self.frames.iter().map(|frame| frame.bytes.to_be_bytes()));
        let sizes = full_box(b"stsz", 0, 0, &[&[0; 4], &count(self.frames.len()), &sizes]);
        let places = be_bytes(self.frames.iter().map(|frame| frame.offset.to_be_bytes()));
        let places = full_box(b"co64", 0, 0, &[&count(self.frames.len()), &places]);
        let kinds = full_box(b"stsd", 0, 0, &[&u32s(&[1]), &self.sample_entry(sets)]);
        make_box(b"stbl", &[&kinds, &times, &alone, &chunks, &sizes, &places])
    }

    /// Sample description.
    fn sample_entry(&self, sets: &ParameterSets) -> Vec<u8> {
        let mut sets = sets.clone();
        sets.set_level(self.cfg.size, self.per_second, self.frames.iter().map(|frame| [frame.duration, frame.bytes]));
        let ParameterSets { sequence, image } = &sets;
        let length = |unit: &[u8]| (unit.len() as u16).to_be_bytes();
        // Lengths of units have four bytes; one parameter set of each kind. Profile and level are those of the sequence
        // parameter set.
        let profile = sequence.get(1..4).unwrap_or_default();
        let avc = [&[1], profile, &[0xff, 0xe1], &length(sequence), sequence, &[1], &length(image), image];
        let avc = make_box(b"avcC", &avc);
        // The stream has no color description: primaries of BT.709, transfer function of sRGB, the matrix, limited
        // range.
        let color = make_box(b"colr", &[b"nclx", &[0, 1, 0, 13, 0, self.cfg.colors.code, 0]]);
        let sides = be_bytes(self.cfg.size.map(|side| (side as u16).to_be_bytes()));
        let inch = u32s(&[72 << 16, 72 << 16, 0]);
        let head: [&[u8]; 8] = [&[0; 6], &[0, 1], &[0; 16], &sides, &inch, &[0, 1], &[0; 32], &[0, 24, 0xff, 0xff]];
        make_box(b"avc1", &[&head[..], &[&avc, &color]].concat())
    }
}

impl Encoder for Mp4 {
    fn frame(&mut self, out: &mut Output, rgba: &[u8], shown: [f64; 2]) -> WriteResult {
        let units = self.stream.encode(rgba).map_err(WriteError::limit)?;
        self.file.add(out, units, duration(shown, PER_SECOND.into(), u32::MAX.into())?)
    }

    fn finish(&mut self, out: &mut Output) -> WriteResult {
        self.file.finish(out, self.stream.parameter_sets())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use mp4parse::{
        CodecType, MediaTimeScale, SampleEntry, TrackScaledTime, TrackTimeScale, TrackType, VideoCodecSpecific,
    };
    use std::fs::File;
    use std::io::BufWriter;

    /// Reference: the demuxer of Firefox, which refuses boxes of wrong sizes. Frames are found by its offsets and sizes.
    #[test]
    fn demuxed_by_mp4parse() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mp4");
        let size = [64, 48];
        let mut out: Output = BufWriter::new(Box::new(File::create(&path).unwrap()));
        let mut encoder = begin(size).unwrap();
        // 200 frames at 30 Hz, then 50 at 60 Hz.
        let times: Vec<f64> = (0..=250).map(|k| f64::from(2 * k.min(200) + (k - k.min(200))) / 60.0).collect();
        for (k, shown) in times.windows(2).enumerate() {
            let rgba: Vec<u8> = (0..4 * 64 * 48).map(|at| (at / 4 % 64 * 3 + k) as u8).collect();
            encoder.frame(&mut out, &rgba, [shown[0], shown[1]]).unwrap();
        }
        encoder.finish(&mut out).unwrap();
        out.flush().unwrap();

        let file = std::fs::read(&path).unwrap();
        let movie = mp4parse::read_mp4(&mut file.as_slice()).unwrap();
        assert_eq!(movie.timescale, Some(MediaTimeScale(90_000)));
        let [track] = movie.tracks.as_slice() else { panic!("{} tracks", movie.tracks.len()) };
        assert!(track.track_type == TrackType::Video && track.track_id == Some(1), "{track:?}");
        assert_eq!(track.timescale, Some(TrackTimeScale(90_000, 0)));
        let seconds = TrackScaledTime(90_000 * 450 / 60, 0);
        assert_eq!((track.duration, track.empty_duration, track.media_time), (Some(seconds), None, None));
        let header = track.tkhd.as_ref().unwrap();
        assert_eq!((header.disabled, header.duration), (false, 675_000));
        assert_eq!([header.width, header.height], [64 << 16, 48 << 16]);
        let [SampleEntry::Video(entry)] = track.stsd.as_ref().unwrap().descriptions.as_slice() else {
            panic!("{:?}", track.stsd)
        };
        assert_eq!((entry.codec_type, [entry.width, entry.height]), (CodecType::H264, [64, 48]));
        let VideoCodecSpecific::AVCConfig(sets) = &entry.codec_specific else { panic!("{entry:?}") };
        // Version 1, constrained baseline (the second flag), four bytes of length before each unit.
        assert_eq!((&sets[..3], sets[4] & 3), (&[1, 66, 0x40][..], 3));

        let shown = &track.stts.as_ref().unwrap().samples;
        let shown: Vec<[u32; 2]> = shown.iter().map(|some| [some.sample_count, some.sample_delta]).collect();
        assert_eq!(shown, [[200, 3_000], [50, 1_500]]);
        assert_eq!(track.stss.as_ref().unwrap().samples.as_slice(), [1, 121, 241]);
        let chunks = track.stsc.as_ref().unwrap().samples.as_slice();
        assert_eq!(chunks.iter().map(|c| [c.first_chunk, c.samples_per_chunk]).collect::<Vec<_>>(), [[1, 1]]);
        let (sizes, offsets) = (&track.stsz.as_ref().unwrap().sample_sizes, &track.stco.as_ref().unwrap().offsets);
        assert_eq!((sizes.len(), offsets.len()), (250, 250));
        for (k, (offset, size)) in offsets.iter().zip(sizes.iter()).enumerate() {
            let mut units = &file[*offset as usize..][..*size as usize];
            while !units.is_empty() {
                let (length, rest) = units.split_first_chunk().unwrap();
                let (unit, rest) = rest.split_at(u32::from_be_bytes(*length) as usize);
                // Slices of pictures: 5 of IDR pictures, 1 of others.
                assert_eq!(unit[0] & 31, if k % 120 == 0 { 5 } else { 1 }, "frame {k}");
                units = rest;
            }
        }
    }
}
