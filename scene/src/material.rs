//! Surface materials and textures.

use crate::light::LightingSpace;
use std::sync::Arc;
use std::sync::OnceLock;

/// A surface material, with MuJoCo's parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Color and opacity in 0..=1. The color is a display color (sRGB) and multiplies the texture.
    pub rgba: [f32; 4],
    /// Texture on the surface; `None` for a uniform color.
    pub texture: Option<Arc<Texture>>,
    /// Repetitions of a 2D texture over the shape, or over 2 m with `tex_uniform` and on infinite planes, as in
    /// MuJoCo's renderer. Unused for meshes with texture coordinates; 0 and negative numbers act as 1.
    pub tex_repeat: [f32; 2],
    /// True if `tex_repeat` counts images per 2 m, as in MuJoCo's renderer; false if it counts images per shape.
    pub tex_uniform: bool,
    /// Emitted light, as a multiple of the color.
    pub emission: f32,
    /// Strength of highlights in 0..=1.
    pub specular: f32,
    /// Sharpness of highlights in 0..=1: the exponent is 128 times this. Unused with `roughness`.
    pub shininess: f32,
    /// Mirror reflectance in 0..=1. Opaque planes and the +z faces of boxes reflect in all renderers, other shapes only
    /// in path-traced images.
    pub reflectance: f32,
    /// Metallic share in 0..=1. A metal has no diffuse reflection, and its specular reflection has its color. The
    /// rasterizer ignores it in [`LightingSpace::Display`](crate::LightingSpace::Display).
    pub metallic: f32,
    /// Roughness in 0..=1; the alpha of the GGX distribution is its square. `None` derives alpha from
    /// [`exponent`](Self::exponent): `alpha² = 2 / (exponent + 2)`.
    pub roughness: Option<f32>,
    /// Fraction in 0..=1 of the light not mirrored by `reflectance` that meets smooth glass, which refracts it, or
    /// mirrors it by Fresnel's equations. Only the path tracer transmits light, through closed shapes; other renderers
    /// draw the surface. The opacity of `rgba` is transparency without refraction.
    pub transmission: f32,
    /// Refractive index of the interior, at least 1: 1.5 for glass, 1.33 for water.
    pub refractive_index: f32,
}

impl Default for Material {
    /// MuJoCo's defaults for a geom without a material: gray, half glossy.
    fn default() -> Self {
        Self {
            rgba: [0.5, 0.5, 0.5, 1.0],
            texture: None,
            tex_repeat: [1.0, 1.0],
            tex_uniform: false,
            emission: 0.0,
            specular: 0.5,
            shininess: 0.5,
            reflectance: 0.0,
            metallic: 0.0,
            roughness: None,
            transmission: 0.0,
            refractive_index: 1.5,
        }
    }
}

impl Material {
    /// A material with a plain color.
    pub fn from_rgba(rgba: [f32; 4]) -> Self {
        Self { rgba, ..Self::default() }
    }

    /// Exponent of the highlights in Blinn's and Phong's models, clamped to 1..=128: 128 times `shininess`, or 2 /
    /// alpha² - 2 for a roughness. Source: Walter et al., Microfacet models for refraction through rough surfaces,
    /// 2007, section 5.2.
    pub fn exponent(&self) -> f32 {
        let exponent = match self.roughness {
            Some(roughness) => 2.0 / roughness.clamp(0.0, 1.0).powi(4) - 2.0,
            None => 128.0 * self.shininess,
        };
        exponent.clamp(1.0, 128.0)
    }
}

/// Mapping of a texture onto a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TextureKind {
    /// Mapped by texture coordinates, or by x and y of the shape.
    TwoD,
    /// Mapped by direction from the center of the shape. The image is six squares from top to bottom: +x, -x, +y, -y,
    /// +z, -z.
    Cube,
}

/// A texture with its mip chain, which is averaged in linear light or, for [`LightingSpace::Display`], as bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    kind: TextureKind,
    levels: Vec<MipLevel>,
}

/// Mip level of a texture: its size and its pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct MipLevel {
    width: u32,
    height: u32,
    bytes: Vec<u8>,
}

/// Error of [`Texture::new`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TextureError {
    /// The sizes are zero, too large or do not fit the number of bytes.
    #[error("a texture of {width} x {height} pixels with {channels} channels cannot have {bytes} bytes")]
    Size {
        /// Width \[pixels\].
        width: u32,
        /// Height \[pixels\].
        height: u32,
        /// Bytes per pixel: 3 or 4 are allowed.
        channels: u32,
        /// Number of bytes given.
        bytes: usize,
    },
    /// A cube texture is not six squares.
    #[error("a cube texture must be six squares from top to bottom; this image is {width} x {height}")]
    NotSixSquares {
        /// Width \[pixels\].
        width: u32,
        /// Height \[pixels\].
        height: u32,
    },
}

impl Texture {
    /// Creates a texture from sRGB pixels of `channels` (3 or 4) bytes, from the top left. Opacity is ignored. The mip
    /// levels are averaged in linear light.
    ///
    /// # Errors
    ///
    /// The sizes are zero, above 65536 or do not fit the number of bytes, or a cube texture is not six squares.
    pub fn new(kind: TextureKind, width: u32, height: u32, channels: u32, data: &[u8]) -> Result<Self, TextureError> {
        Self::averaged_in(LightingSpace::Linear, kind, width, height, channels, data)
    }

    /// As [`new`](Self::new), with mip levels that are averaged in a lighting space. Those of
    /// [`LightingSpace::Display`] are the levels of MuJoCo's renderer: means of bytes, down to one pixel for the faces
    /// of every cube.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn averaged_in(
        space: LightingSpace,
        kind: TextureKind,
        width: u32,
        height: u32,
        channels: u32,
        data: &[u8],
    ) -> Result<Self, TextureError> {
        let expected = u64::from(width) * u64::from(height) * u64::from(channels);
        if !(3..=4).contains(&channels) || expected == 0 || expected != data.len() as u64 || width.max(height) > 1 << 16
        {
            return Err(TextureError::Size { width, height, channels, bytes: data.len() });
        }
        if kind == TextureKind::Cube && u64::from(height) != 6 * u64::from(width) {
            return Err(TextureError::NotSixSquares { width, height });
        }
        let pixels: Vec<_> = data.chunks_exact(channels as usize).map(|p| [p[0], p[1], p[2], 255]).collect();
        let mut levels = vec![MipLevel::new(width, height, &pixels)];
        let is_cube = kind == TextureKind::Cube;
        // The faces of a cube must not mix, so only levels with an even side are halved as a whole.
        let shrinks = |l: &MipLevel| match kind {
            TextureKind::TwoD => l.width > 1 || l.height > 1,
            TextureKind::Cube if space == LightingSpace::Display => l.width > 1,
            TextureKind::Cube => l.width.is_multiple_of(2),
        };
        while let Some(last) = levels.last().filter(|l| shrinks(l)) {
            let next = match space {
                LightingSpace::Linear => last.half_size(),
                LightingSpace::Display => last.half_size_of_bytes(if is_cube { 6 } else { 1 }),
            };
            levels.push(next);
        }
        Ok(Self { kind, levels })
    }

    /// A checkerboard of 2 x 2 squares in two sRGB colors, as MuJoCo's builtin "checker"; `a` is the color of the top
    /// left square.
    ///
    /// `size` is the side of the image \[pixels\], clamped to 2..=4096 and rounded down to an even number.
    pub fn checker(size: u32, a: [u8; 3], b: [u8; 3]) -> Self {
        let size = size.clamp(2, 4096) & !1;
        let pick = |k: u32| if (k % size < size / 2) == (k / size < size / 2) { a } else { b };
        let data: Vec<u8> = (0..size * size).flat_map(pick).collect();
        let pixels: Vec<_> = data.chunks_exact(3).map(|p| [p[0], p[1], p[2], 255]).collect();
        let mut levels = vec![MipLevel::new(size, size, &pixels)];
        while let Some(last) = levels.last().filter(|l| l.width > 1) {
            let next = last.half_size();
            levels.push(next);
        }
        Self { kind: TextureKind::TwoD, levels }
    }

    /// Mapping of the texture onto a surface.
    pub fn kind(&self) -> TextureKind {
        self.kind
    }

    /// Mip levels, the largest first. The last level of a 2D texture has 1 x 1 pixel. The levels of a cube texture end
    /// at the first level with an odd face side; with [`LightingSpace::Display`], they end at faces of 1 pixel.
    pub fn mip_levels(&self) -> &[MipLevel] {
        &self.levels
    }
}

impl MipLevel {
    fn new(width: u32, height: u32, pixels: &[[u8; 4]]) -> Self {
        let rows = pixels.chunks_exact(width as usize);
        let bytes = rows.clone().chain(rows.take(1)).flat_map(|row| row.iter().chain(&row[..1]).flatten().copied());
        Self { width, height, bytes: bytes.collect() }
    }

    /// Width of this mip level \[pixels\].
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of this mip level \[pixels\].
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Colors (sRGB) from the top left, four bytes each; the fourth byte is unused.
    ///
    /// A row has [`width`](Self::width) + 1 pixels, and there are [`height`](Self::height) + 1 rows. The last column
    /// and the last row repeat the first ones, so that the four pixels around any point are two pairs in memory.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Color of a pixel inside the image, as sRGB bytes; the fourth byte is unused.
    ///
    /// # Panics
    ///
    /// If the pixel is out of range.
    #[track_caller]
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) of {} x {}", self.width, self.height);
        let at = 4 * (y as usize * (self.width as usize + 1) + x as usize);
        [0, 1, 2, 3].map(|k| self.bytes[at + k])
    }

    /// Level of half the size, for an image of `faces` parts, one below the other: each pixel is interpolated at its
    /// center between four bytes of its part, as Mesa's `glGenerateMipmap` does. For even sizes that is their mean.
    fn half_size_of_bytes(&self, faces: u32) -> Self {
        let side = self.height / faces;
        let (width, height) = ((self.width / 2).max(1), (side / 2).max(1));
        let pixel = |k: u32| {
            let (face, in_face) = (k / (width * height), k % (width * height));
            // The first of two neighbors, and the weight of the second.
            let place = |k: u32, from: u32, to: u32| {
                let twice = (2 * k + 1) * from;
                let (first, rest) = ((twice - to) / (2 * to), (twice - to) % (2 * to));
                (first, f64::from(rest) / f64::from(2 * to))
            };
            let ((x, fx), (y, fy)) = (place(in_face % width, self.width, width), place(in_face / width, side, height));
            let at = |x: u32, y: u32| self.pixel(x.min(self.width - 1), face * side + y.min(side - 1));
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
            let mean = |k: usize| {
                let [a, b, c, d] = [a, b, c, d].map(|pixel| f64::from(pixel[k]));
                let (top, bottom) = (a + (b - a) * fx, c + (d - c) * fx);
                (top + (bottom - top) * fy + 0.5) as u8
            };
            [mean(0), mean(1), mean(2), 255]
        };
        Self::new(width, faces * height, &(0..faces * width * height).map(pixel).collect::<Vec<_>>())
    }

    /// Level of half the size; each pixel is the mean of four in linear light. An odd last row or column is left out.
    fn half_size(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let table = srgb_to_linear();
        let at = |x: u32, y: u32| self.pixel(x.min(self.width - 1), y.min(self.height - 1));
        let pixel = |k: u32| {
            let (x, y) = (2 * (k % width), 2 * (k / width));
            let four = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
            let mean = |c: usize| four.iter().map(|p| table[p[c] as usize]).sum::<f32>() / 4.0;
            [linear_to_srgb8(mean(0)), linear_to_srgb8(mean(1)), linear_to_srgb8(mean(2)), 255]
        };
        Self::new(width, height, &(0..width * height).map(pixel).collect::<Vec<_>>())
    }
}

/// Linear light of each sRGB byte.
fn srgb_to_linear() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|k| decode_srgb(k as f32 / 255.0)))
}

/// Converts an sRGB value, clamped to 0..=1, to linear light. Source: IEC 61966-2-1.
pub fn decode_srgb(x: f32) -> f32 {
    let x = f64::from(x.clamp(0.0, 1.0));
    (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
}

/// Converts linear light, clamped to 0..=1, to an sRGB byte. Source: IEC 61966-2-1.
fn linear_to_srgb8(x: f32) -> u8 {
    let x = f64::from(x.clamp(0.0, 1.0));
    let y = if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (y * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// IEC 61966-2-1: a value on the linear segment and one beyond it, the ends, and byte 188, which is half of the
    /// light (0.5029).
    #[test]
    fn srgb() {
        let table = srgb_to_linear();
        assert_eq!((table[0], table[255]), (0.0, 1.0));
        assert!((table[188] - 0.5029).abs() < 5e-5, "{}", table[188]);
        assert!((table[10] - 10.0 / 255.0 / 12.92).abs() < 1e-9, "on the line: {}", table[10]);
        assert!((decode_srgb(0.5) - 0.214_041).abs() < 1e-6, "{}", decode_srgb(0.5));
        assert_eq!((decode_srgb(-1.0), decode_srgb(7.0)), (0.0, 1.0), "clamped to 0..=1");
        // Round trip of every byte.
        assert!((0..=255).all(|byte: u8| linear_to_srgb8(table[byte as usize]) == byte));
        assert!(table.windows(2).all(|pair| pair[0] < pair[1]), "the table must increase");
    }

    /// A white column, the second of each face of a cube with a side of 5. The centers of the two columns of the next
    /// level are at 1.25 and 3.75 texels: the first is interpolated between columns 0 and 1 with weights of 1/4 and 3/4.
    /// The last level is the mean of both. With a side of 3, the middle column stays as it is. In linear light, such
    /// cubes have one level.
    #[test]
    fn mip_levels_of_bytes() {
        let bytes = |side: usize, white: usize| -> Vec<u8> {
            (0..6 * side * side).flat_map(|k| if k % side == white { [255; 3] } else { [0; 3] }).collect()
        };
        let cube = |space, side: u32, white: usize| {
            let data = bytes(side as usize, white);
            Texture::averaged_in(space, TextureKind::Cube, side, 6 * side, 3, &data).expect("six squares")
        };
        let row = |texture: &Texture, level: usize, y: u32| -> Vec<u8> {
            let level = &texture.mip_levels()[level];
            (0..level.width()).map(|x| level.pixel(x, y)[0]).collect()
        };
        let five = cube(LightingSpace::Display, 5, 1);
        let sizes: Vec<_> = five.mip_levels().iter().map(|level| [level.width(), level.height()]).collect();
        assert_eq!(sizes, [[5, 30], [2, 12], [1, 6]]);
        for y in 0..12 {
            assert_eq!(row(&five, 1, y), [191, 0], "row {y}: three quarters of 255");
        }
        assert_eq!(row(&five, 2, 3), [96], "half of 191");
        assert_eq!(row(&cube(LightingSpace::Display, 3, 1), 1, 5), [255]);
        assert_eq!(cube(LightingSpace::Linear, 5, 1).mip_levels().len(), 1);
        let even = &bytes(4, 1)[..3 * 4];
        let plane = |space| Texture::averaged_in(space, TextureKind::TwoD, 2, 2, 3, even).expect("a texture");
        assert_eq!(plane(LightingSpace::Display).mip_levels()[1].pixel(0, 0)[0], 64);
        assert_eq!(plane(LightingSpace::Linear), Texture::new(TextureKind::TwoD, 2, 2, 3, even).expect("a texture"));
    }

    #[test]
    fn from_rgba() {
        let red = Material::from_rgba([0.9, 0.1, 0.2, 0.5]);
        assert_eq!(red.rgba, [0.9, 0.1, 0.2, 0.5]);
        assert_eq!(Material { rgba: Material::default().rgba, ..red.clone() }, Material::default());
        assert_ne!(red, Material::default());
    }
}
