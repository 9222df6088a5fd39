//! Folders of images.

use crate::error::{RecordError, Result};
use crate::file::{Storage, StorageFactory, partial_path_of};
use crate::folder::PartialFolder;
use crate::packet::Packet;
use crate::png::PngWriter;
use crate::stream::{StreamKind, StreamSchema};
use crate::writer::{FormatWriter, WriteResult};
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
pub(crate) struct ImageFolderWriter {
    folder: PartialFolder,
    png: PngWriter,
    /// `times.csv`, locked.
    _lock: File,
    times: BufWriter<Box<dyn Storage>>,
    disk: StorageFactory,
    /// Number of images of each row of each stream.
    counts: Vec<Vec<usize>>,
    bytes: u64,
}

impl ImageFolderWriter {
    /// Creates the folder. With `overwrite`, a folder of a recorder is replaced.
    pub(crate) fn create(path: &Path, overwrite: bool, disk: &StorageFactory) -> Result<Self> {
        let (folder, lock) = PartialFolder::create(path, overwrite, TIMES)?;
        let failed = |error| RecordError::file(folder.partial_path(), error);
        let mut times = disk.storage(lock.try_clone().map_err(failed)?);
        times.write_all(b"picture,step,time,recorded_time\n").map_err(failed)?;
        let (times, disk) = (BufWriter::new(times), disk.clone());
        Ok(Self { folder, png: PngWriter::default(), _lock: lock, times, disk, counts: Vec::new(), bytes: 0 })
    }
}

/// Writes a file that gets its name when it is complete.
fn write_atomic(disk: &StorageFactory, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = AtomicFile::create_as(path, partial_path_of(path))?;
    disk.storage(file.file().try_clone()?).write_all(bytes)?;
    file.persist()
}

impl FormatWriter for ImageFolderWriter {
    fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        self.counts.resize_with(streams.len(), Vec::new);
        for ((stream, block), counts) in streams.iter().zip(&packet.streams).zip(&mut self.counts) {
            counts.resize(stream.env_ids.len(), 0);
            let StreamKind::Image { height, width, .. } = stream.kind else { continue };
            for (row, env) in
                stream.env_ids.iter().enumerate().filter(|(row, _)| block.has_content && block.is_new[*row])
            {
                let range = row * stream.width()..(row + 1) * stream.width();
                let file = match block.values.as_f32s().get(range.clone()) {
                    Some(depths) => self.png.encode_depth(depths, [width, height])?,
                    None => self.png.encode_rgb(block.values.as_u8s().get(range).unwrap_or(&[]), [width, height])?,
                };
                let name = format!("{}/env_{env}/{:06}.png", stream.name, counts[row]);
                let path = self.folder.partial_path().join(&name);
                if let Some(folder) = path.parent().filter(|_| counts[row] == 0) {
                    fs::create_dir_all(folder)?;
                }
                write_atomic(&self.disk, &path, file)?;
                let quoted = name.replace('"', "\"\"");
                writeln!(
                    self.times,
                    "\"{quoted}\",{},{},{}",
                    packet.step, block.times[row], block.recorded_times[row]
                )?;
                counts[row] += 1;
                self.bytes += file.len() as u64;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> WriteResult {
        Ok(self.times.flush()?)
    }

    fn finish(&mut self, _streams: &[StreamSchema]) -> WriteResult<u64> {
        self.times.flush()?;
        self.times.get_ref().sync()?;
        self.folder.commit()?;
        Ok(self.bytes)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        Some(self.folder.partial_path().into())
    }
}
