//! Visual elements of a compiled model as plain slices and numbers, in the same form for all versions of MuJoCo.

/// A compiled mesh. Triangle corners have separate indices of positions, normals and texture coordinates.
#[derive(Clone, Copy, Debug)]
pub struct MeshArrays<'a> {
    /// Vertices in the frame of a geom with this mesh \[m\]; MuJoCo's compiler aligns this frame with the center of
    /// mass and the principal axes of the mesh.
    pub positions: &'a [[f32; 3]],
    /// Unit normals: those of the file, or computed by MuJoCo.
    pub normals: &'a [[f32; 3]],
    /// Texture coordinates, with v downward, if the mesh has any.
    pub texcoords: Option<&'a [[f32; 2]]>,
    /// Indices in [`positions`](Self::positions) of each triangle's corners.
    pub faces: &'a [[i32; 3]],
    /// Indices in [`normals`](Self::normals) of each triangle's corners.
    pub face_normals: &'a [[i32; 3]],
    /// Indices in [`texcoords`](Self::texcoords) of each triangle's corners.
    pub face_texcoords: &'a [[i32; 3]],
}

/// Size and elevations of a height field.
#[derive(Clone, Copy, Debug)]
pub struct HeightFieldArrays<'a> {
    /// Half length along x, half length along y, height of elevation 1, depth of the base below zero \[m\].
    pub size: [f64; 4],
    /// Number of rows, along y.
    pub rows: usize,
    /// Number of columns, along x.
    pub columns: usize,
    /// Elevation in 0..=1, row by row: the first row is at the lowest y, each row begins at the lowest x.
    pub elevation: &'a [f32],
}

/// Type of a texture: its mapping onto surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureType {
    /// Mapped by texture coordinates.
    TwoD,
    /// Mapped onto a cube around the shape: six square images, one below the other, or one square image for all sides.
    Cube,
    /// Mapped onto the sky, with the layout of a cube.
    Skybox,
}

/// A texture image.
#[derive(Clone, Copy, Debug)]
pub struct TextureArrays<'a> {
    /// Type of the texture: 2D, cube or skybox.
    pub kind: TextureType,
    /// Width \[pixels\].
    pub width: usize,
    /// Height \[pixels\].
    pub height: usize,
    /// Bytes per pixel.
    pub channels: usize,
    /// True if the color space of the compiled texture is sRGB (`tex_colorspace`, MuJoCo 3.3.3 and later): by the
    /// attribute `colorspace` of `<texture>`, or with `auto` by the image file. MuJoCo's renderer converts such an
    /// image of two dimensions to linear light. It uses all others as they are.
    pub is_srgb: bool,
    /// Pixels, row by row from the top left.
    pub pixels: &'a [u8],
}

/// A material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialValues {
    /// Color and opacity, 0..=1.
    pub rgba: [f32; 4],
    /// Index of the color texture; `None` without one.
    pub texture: Option<usize>,
    /// Number of repetitions of the texture along its two axes.
    pub tex_repeat: [f32; 2],
    /// MuJoCo's `texuniform`: true if [`tex_repeat`](Self::tex_repeat) counts repetitions per 2 m, as in MuJoCo's
    /// renderer; false if it counts repetitions per shape.
    pub tex_uniform: bool,
    /// Emitted light, as a factor of the color.
    pub emission: f32,
    /// Strength of highlights, 0..=1.
    pub specular: f32,
    /// Sharpness of highlights, 0..=1: the exponent is 128 times this.
    pub shininess: f32,
    /// Mirror reflectance, 0..=1.
    pub reflectance: f32,
    /// Metallic share, 0..=1 (4.x); `None` if the model does not set it.
    pub metallic: Option<f32>,
    /// Roughness, 0..=1 (4.x); `None` if the model does not set it.
    pub roughness: Option<f32>,
}

/// Light types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightType {
    /// A spotlight with a cone.
    Spot,
    /// Parallel rays.
    Directional,
    /// A light in all directions (4.x).
    Point,
    /// An environment image (4.x).
    Image,
}

/// Properties of a light. Its world position changes with the state, and is in `light_xpos` of MuJoCo's data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightValues {
    /// Light type.
    pub kind: LightType,
    /// True if the light is on.
    pub active: bool,
    /// True if the light casts shadows.
    pub cast_shadow: bool,
    /// Constant, linear \[1/m\] and quadratic \[1/m²\] attenuation c, l, q: the intensity at distance d is divided by c
    /// + l d + q d².
    pub attenuation: [f32; 3],
    /// Half angle of a spot's cone \[deg\].
    pub cutoff_deg: f32,
    /// Exponent of a spotlight's falloff from its axis: 0 gives uniform light in the cone.
    pub exponent: f32,
    /// Ambient color, RGB as in the model.
    pub ambient: [f32; 3],
    /// Diffuse color, RGB as in the model.
    pub diffuse: [f32; 3],
    /// Specular color, RGB as in the model.
    pub specular: [f32; 3],
    /// Radius of the bulb \[m\] (4.x, 0.02 by default); 0 on 2.2.2.
    pub radius: f32,
}

/// The headlight: a light at every camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadlightValues {
    /// True if the headlight is on; true for "auto" of 4.x.
    pub active: bool,
    /// Ambient color, RGB as in the model.
    pub ambient: [f32; 3],
    /// Diffuse color, RGB as in the model.
    pub diffuse: [f32; 3],
    /// Specular color, RGB as in the model.
    pub specular: [f32; 3],
}
