//! Folders of pictures.

use crate::error::{RecordError, Result};
use crate::file::{lock_left, part_of, sync_folder};
use crate::packet::Packet;
use crate::picture::Png;
use crate::stream::{Kind, Stream};
use crate::writer::Sink;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// The file with the times of all pictures. A folder that has one is that of a recorder.
const TIMES: &str = "times.csv";

/// A folder of PNG files: `camera/color/env_0/000000.png`, and `times.csv` with the physics step since the recording began, the
/// simulation time of capture and the same on the clock of the recording \[s\] of each. It is called `NAME.part` until it is
/// whole; in a folder that was left, all pictures but perhaps the last are whole.
#[derive(Debug)]
pub(crate) struct PictureFolder {
    path: PathBuf,
    part: PathBuf,
    overwrite: bool,
    png: Png,
    /// Locked as long as there is a recorder.
    times: BufWriter<File>,
    /// Pictures of every row of every stream.
    counts: Vec<Vec<usize>>,
    bytes: u64,
}

impl PictureFolder {
    /// Makes the folder, which must be new or empty, or may be replaced: only a folder of a recorder is.
    pub(crate) fn create(path: &Path, overwrite: bool) -> Result<Self> {
        // Without a separator at the end.
        let path: PathBuf = path.components().collect();
        if path.file_name().is_none() {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "a folder of pictures needs a name of its own");
            return Err(RecordError::file(&path, error));
        }
        if !is_free(&path, overwrite).map_err(|error| RecordError::file(&path, error))? {
            return Err(RecordError::Exists { path });
        }
        let part = part_of(&path);
        let failed = |error| RecordError::file(&part, error);
        let left = lock_left(&part.join(TIMES)).map_err(|error| match error {
            RecordError::Busy { .. } => RecordError::Busy { part: part.clone() },
            other => other,
        })?;
        if !is_free(&part, overwrite).map_err(failed)? {
            return Err(RecordError::Unfinished { part, recoverable: false });
        }
        // Its lock would keep the folder on some systems.
        drop(left);
        let begin = || {
            take_away(&part)?;
            fs::create_dir_all(&part)?;
            let mut times = File::create_new(part.join(TIMES))?;
            times.try_lock()?;
            times.write_all(b"picture,step,time,recorded_time\n")?;
            Ok(BufWriter::new(times))
        };
        let times = begin().map_err(failed)?;
        Ok(Self { path, part, overwrite, png: Png::default(), times, counts: Vec::new(), bytes: 0 })
    }
}

/// Whether a folder may be made at a place: nothing is there, or an empty folder, or one of a recorder that may be replaced.
fn is_free(path: &Path, overwrite: bool) -> io::Result<bool> {
    match fs::read_dir(path) {
        Ok(mut entries) => Ok(entries.next().is_none() || (overwrite && path.join(TIMES).is_file())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(error),
    }
}

/// Takes away a folder that [`is_free`].
fn take_away(path: &Path) -> io::Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

impl Sink for PictureFolder {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> io::Result<()> {
        self.counts.resize_with(streams.len(), Vec::new);
        for ((stream, block), counts) in streams.iter().zip(&packet.blocks).zip(&mut self.counts) {
            counts.resize(stream.env_ids.len(), 0);
            let Kind::Picture { height, width, .. } = stream.kind else { continue };
            for (row, env) in stream.env_ids.iter().enumerate().filter(|(row, _)| block.used && block.fresh[*row]) {
                let range = row * stream.width()..(row + 1) * stream.width();
                let file = match block.values.floats().get(range.clone()) {
                    Some(depths) => self.png.millimetres(depths, [width, height])?,
                    None => self.png.rgb(block.values.bytes().get(range).unwrap_or(&[]), [width, height])?,
                };
                let name = format!("{}/env_{env}/{:06}.png", stream.name, counts[row]);
                let path = self.part.join(&name);
                if let Some(folder) = path.parent().filter(|_| counts[row] == 0) {
                    fs::create_dir_all(folder)?;
                }
                fs::write(path, file)?;
                let quoted = name.replace('"', "\"\"");
                writeln!(self.times, "\"{quoted}\",{},{},{}", packet.step, block.times[row], block.stamps[row])?;
                counts[row] += 1;
                self.bytes += file.len() as u64;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.times.flush()
    }

    fn finish(&mut self, _streams: &[Stream]) -> io::Result<u64> {
        self.times.flush()?;
        self.times.get_ref().sync_all()?;
        if !is_free(&self.path, self.overwrite)? {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "a folder of that name has appeared meanwhile"));
        }
        take_away(&self.path)?;
        fs::rename(&self.part, &self.path)?;
        sync_folder(&self.path);
        Ok(self.bytes)
    }

    fn kept(&self) -> Option<PathBuf> {
        Some(self.part.clone())
    }
}
