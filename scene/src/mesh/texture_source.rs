//! Pixels of a mesh's texture.

use crate::input_file::{self, MAX_BINARY};
use image::{ImageReader, Limits, RgbImage};
use std::borrow::Cow;
use std::io::Cursor;
use std::path::PathBuf;

/// Largest width and height \[pixels\], as on common GPUs.
const MAX_SIDE: u32 = 16_384;

/// Number of pixels of an image that any file may hold: 4096 x 4096.
const FREE_PIXELS: u64 = 4096 * 4096;

/// Pixels per byte of a larger file: what deflate, the compression of PNG, yields at most for pixels of one byte (1032 to
/// 1). A few kilobytes must not ask for gigabytes.
const PIXELS_PER_BYTE: u64 = 1032;

/// Largest memory of the decoder \[bytes\].
const MAX_DECODED: u64 = 1 << 30;

/// Source of a texture's pixels.
#[derive(Clone, Debug, PartialEq)]
pub enum TextureSource {
    /// An image file, with its path resolved relative to the mesh file. It may not exist.
    File(PathBuf),
    /// An image inside the mesh file (GLB, or a `data:` URI of glTF): its bytes, usually PNG or JPEG.
    Embedded(Vec<u8>),
}

impl TextureSource {
    /// Returns the file content of the image.
    ///
    /// # Errors
    /// The reason as text, with the path: the file cannot be read, or is no regular file.
    pub fn bytes(&self) -> Result<Cow<'_, [u8]>, String> {
        match self {
            Self::File(path) => input_file::read_referenced(path, MAX_BINARY)
                .map(Cow::Owned)
                .map_err(|error| format!("{}: {error}", path.display())),
            Self::Embedded(bytes) => Ok(Cow::Borrowed(bytes)),
        }
    }

    /// Reads and decodes the image (PNG or JPEG).
    ///
    /// # Errors
    /// The reason as text, with the path: the file cannot be read, is no image, or is larger than 16,384 pixels along
    /// a side. Images of more than 4096 x 4096 pixels must hold at least a byte per 1032 pixels.
    pub fn decode(&self) -> Result<RgbImage, String> {
        self.decode_from(&self.bytes()?)
    }

    /// Decodes the image from what [`bytes`](Self::bytes) returned.
    ///
    /// # Errors
    /// As [`decode`](Self::decode).
    pub fn decode_from(&self, bytes: &[u8]) -> Result<RgbImage, String> {
        decode(bytes).map_err(|reason| match self {
            Self::File(path) => format!("{}: {reason}", path.display()),
            Self::Embedded(_) => format!("an image in the mesh file: {reason}"),
        })
    }
}

fn decode(bytes: &[u8]) -> Result<RgbImage, String> {
    let reader = || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|error| error.to_string());
    let (width, height) = reader()?.into_dimensions().map_err(|error| error.to_string())?;
    if width.max(height) > MAX_SIDE {
        return Err(format!("{width} x {height} pixels; expected at most {MAX_SIDE} along each side"));
    }
    let most = FREE_PIXELS.max(PIXELS_PER_BYTE * bytes.len() as u64);
    if u64::from(width) * u64::from(height) > most {
        let size = bytes.len();
        return Err(format!("{width} x {height} pixels in {size} bytes; expected at most {most} pixels for that size"));
    }
    let mut reader = reader()?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_DECODED);
    reader.limits(limits);
    reader.decode().map(image::DynamicImage::into_rgb8).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageFormat, Rgb};

    fn png(width: u32, height: u32) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        RgbImage::from_pixel(width, height, Rgb([9, 8, 7])).write_to(&mut file, ImageFormat::Png).unwrap();
        file.into_inner()
    }

    /// The file with another size in its header, whose checksum is corrected.
    fn announced(mut png: Vec<u8>, width: u32, height: u32) -> Vec<u8> {
        png[16..20].copy_from_slice(&width.to_be_bytes());
        png[20..24].copy_from_slice(&height.to_be_bytes());
        let sum = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&sum.to_be_bytes());
        png
    }

    /// The checksum of PNG chunks (ISO 3309).
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |sum, byte| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ (0xedb8_8320 * (sum & 1)))
        })
    }

    #[test]
    fn images() {
        let whole = TextureSource::Embedded(png(3, 2)).decode().unwrap();
        assert_eq!((whole.dimensions(), whole[(2, 1)]), ((3, 2), Rgb([9, 8, 7])));
        let refused = [
            (announced(png(3, 2), 16_385, 1), "16385 x 1 pixels; expected at most 16384"),
            (announced(png(3, 2), 16_384, 16_384), "16384 x 16384 pixels in"),
            (announced(png(3, 2), 0, 2), ""),
            (b"no image".to_vec(), ""),
            (png(30, 20)[..60].to_vec(), ""),
        ];
        for (bytes, message) in refused {
            let reason = TextureSource::Embedded(bytes).decode().unwrap_err();
            assert!(reason.starts_with("an image in the mesh file: ") && reason.contains(message), "{reason}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn devices() {
        let reason = TextureSource::File("/dev/zero".into()).decode().unwrap_err();
        assert_eq!(reason, "/dev/zero: a device or a pipe; expected a regular file");
    }
}
