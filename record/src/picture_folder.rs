//! Folders of images.

use crate::error::{RecordError, Result};
use crate::file::{Disk, Storage, part_of};
use crate::folder::PartFolder;
use crate::packet::Packet;
use crate::picture::Png;
use crate::stream::{Kind, Stream};
use crate::writer::{Sink, Written};
use kinetoscope_scene::AtomicFile;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// File with the times of all images. It identifies the folder as that of a recorder.
const TIMES: &str = "times.csv";

/// Writer of a folder of PNG files, such as `camera/color/env_0/000000.png`, with `times.csv`.
///
/// `times.csv` has for each image the physics step since the recording began, and the simulation time and recorded time
/// of capture \[s\]. The folder is called `NAME.part` until it is complete. In a remaining partial folder, every `.png`
/// file is complete, and the last rows of `times.csv` may be missing.
pub(crate) struct PictureFolder {
    folder: PartFolder,
    png: Png,
    /// `times.csv`, locked.
    _lock: File,
    times: BufWriter<Box<dyn Storage>>,
    disk: Disk,
    /// Number of images of each row of each stream.
    counts: Vec<Vec<usize>>,
    bytes: u64,
}

impl PictureFolder {
    /// Creates the folder. With `overwrite`, a folder of a recorder is replaced.
    pub(crate) fn create(path: &Path, overwrite: bool, disk: &Disk) -> Result<Self> {
        let (folder, lock) = PartFolder::create(path, overwrite, TIMES)?;
        let failed = |error| RecordError::file(folder.part(), error);
        let mut times = disk.storage(lock.try_clone().map_err(failed)?);
        times.write_all(b"picture,step,time,recorded_time\n").map_err(failed)?;
        let (times, disk) = (BufWriter::new(times), disk.clone());
        Ok(Self { folder, png: Png::default(), _lock: lock, times, disk, counts: Vec::new(), bytes: 0 })
    }
}

/// Writes a file that gets its name when it is complete.
fn write_whole(disk: &Disk, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = AtomicFile::create_as(path, part_of(path))?;
    disk.storage(file.file().try_clone()?).write_all(bytes)?;
    file.persist()
}

impl Sink for PictureFolder {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written {
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
                let path = self.folder.part().join(&name);
                if let Some(folder) = path.parent().filter(|_| counts[row] == 0) {
                    fs::create_dir_all(folder)?;
                }
                write_whole(&self.disk, &path, file)?;
                let quoted = name.replace('"', "\"\"");
                writeln!(self.times, "\"{quoted}\",{},{},{}", packet.step, block.times[row], block.stamps[row])?;
                counts[row] += 1;
                self.bytes += file.len() as u64;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Written {
        Ok(self.times.flush()?)
    }

    fn finish(&mut self, _streams: &[Stream]) -> Written<u64> {
        self.times.flush()?;
        self.times.get_ref().sync()?;
        self.folder.commit()?;
        Ok(self.bytes)
    }

    fn kept(&self) -> Option<PathBuf> {
        Some(self.folder.part().into())
    }
}
