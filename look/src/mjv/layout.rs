//! Byte offsets of the fields of `mjvGeom` and `mjvLight`.

use crate::{LightType, LightValues};

/// Error of a layout.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// A field ends behind its structure.
    #[error("the field `{field}` at byte {offset} ends behind its structure of {stride} bytes")]
    Outside {
        /// Name of the field.
        field: &'static str,
        /// First byte of the field.
        offset: usize,
        /// Size of the structure \[bytes\].
        stride: usize,
    },
    /// Memory does not consist of whole structures.
    #[error("{bytes} bytes are not a whole number of structures of {stride} bytes")]
    Length {
        /// Number of bytes.
        bytes: usize,
        /// Size of the structure \[bytes\].
        stride: usize,
    },
}

/// Values of `mjvGeom.type` for skins and flexes. They differ between versions of MuJoCo; `None` for a type that the
/// version lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SoftTypes {
    /// Skin.
    pub skin: Option<i32>,
    /// Flex.
    pub flex: Option<i32>,
}

/// Values of `mjvGeom.type` for signed distance fields and decoration. They differ between versions of MuJoCo; `None`
/// for a type that the version lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecorTypes {
    /// Signed distance field, which is drawn as its mesh.
    pub sdf: Option<i32>,
    /// Arrow.
    pub arrow: Option<i32>,
    /// Arrow whose head is as wide as its shaft.
    pub arrow1: Option<i32>,
    /// Arrow in both directions.
    pub arrow2: Option<i32>,
    /// Line.
    pub line: Option<i32>,
    /// Edges of a box.
    pub line_box: Option<i32>,
    /// Triangle.
    pub triangle: Option<i32>,
}

/// Byte offsets of the fields of `mjvGeom`, and the size of the structure. Each field is a 4-byte number or an array of
/// 4-byte numbers. Optional fields exist in some versions of MuJoCo only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeomLayout {
    /// Size of the structure \[bytes\].
    pub stride: usize,
    /// `type`.
    pub kind: usize,
    /// `dataid`.
    pub dataid: usize,
    /// `objtype`.
    pub objtype: usize,
    /// `objid`.
    pub objid: usize,
    /// `category`.
    pub category: usize,
    /// `matid`.
    pub matid: Option<usize>,
    /// `texid`.
    pub texid: Option<usize>,
    /// `texuniform`.
    pub texuniform: Option<usize>,
    /// `texrepeat`, two numbers.
    pub texrepeat: Option<usize>,
    /// `segid`.
    pub segid: usize,
    /// `size`, three numbers.
    pub size: usize,
    /// `pos`, three numbers.
    pub pos: usize,
    /// `mat`, nine numbers.
    pub mat: usize,
    /// `rgba`, four numbers.
    pub rgba: usize,
    /// `emission`.
    pub emission: usize,
    /// `specular`.
    pub specular: usize,
    /// `shininess`.
    pub shininess: usize,
    /// `reflectance`.
    pub reflectance: usize,
    /// Values of `type` for skins and flexes, not offsets.
    pub soft: SoftTypes,
    /// Values of `type` for signed distance fields and decoration, not offsets.
    pub decor: DecorTypes,
}

impl GeomLayout {
    /// Checks that all fields are inside the structure.
    ///
    /// # Errors
    /// [`LayoutError::Outside`] for the first field that ends behind the structure.
    pub fn validate(&self) -> Result<(), LayoutError> {
        let required = [
            ("type", self.kind, 4),
            ("dataid", self.dataid, 4),
            ("objtype", self.objtype, 4),
            ("objid", self.objid, 4),
            ("category", self.category, 4),
            ("segid", self.segid, 4),
            ("size", self.size, 12),
            ("pos", self.pos, 12),
            ("mat", self.mat, 36),
            ("rgba", self.rgba, 16),
            ("emission", self.emission, 4),
            ("specular", self.specular, 4),
            ("shininess", self.shininess, 4),
            ("reflectance", self.reflectance, 4),
        ];
        let optional = [
            ("matid", self.matid, 4),
            ("texid", self.texid, 4),
            ("texuniform", self.texuniform, 4),
            ("texrepeat", self.texrepeat, 8),
        ];
        let optional = optional.into_iter().filter_map(|(field, offset, size)| Some((field, offset?, size)));
        check_fields(self.stride, required.into_iter().chain(optional))
    }
}

/// Byte offsets of the fields of `mjvLight`, and the size of the structure. Each field is a 4-byte number or an array
/// of 4-byte numbers, unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightLayout {
    /// Size of the structure \[bytes\].
    pub stride: usize,
    /// `pos`, three numbers.
    pub pos: usize,
    /// `dir`, three numbers.
    pub dir: usize,
    /// `type`, a number of `mjtLightType`; `None` for versions with `directional`.
    pub kind: Option<usize>,
    /// `directional`, one byte; `None` for versions with `type`.
    pub directional: Option<usize>,
    /// `attenuation`, three numbers.
    pub attenuation: usize,
    /// `cutoff`.
    pub cutoff: usize,
    /// `exponent`.
    pub exponent: usize,
    /// `ambient`, three numbers.
    pub ambient: usize,
    /// `diffuse`, three numbers.
    pub diffuse: usize,
    /// `specular`, three numbers.
    pub specular: usize,
    /// `headlight`, one byte.
    pub headlight: usize,
    /// `castshadow`, one byte.
    pub castshadow: usize,
}

/// A light of a scene: its values and its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PosedLight {
    pub(super) values: LightValues,
    pub(super) position: [f32; 3],
    pub(super) direction: [f32; 3],
    /// True for the headlight, whose direction some versions leave to the renderer.
    pub(super) is_headlight: bool,
}

impl LightLayout {
    /// Checks that all fields are inside the structure.
    ///
    /// # Errors
    /// [`LayoutError::Outside`] for the first field that ends behind the structure.
    pub fn validate(&self) -> Result<(), LayoutError> {
        let required = [
            ("pos", self.pos, 12),
            ("dir", self.dir, 12),
            ("attenuation", self.attenuation, 12),
            ("cutoff", self.cutoff, 4),
            ("exponent", self.exponent, 4),
            ("ambient", self.ambient, 12),
            ("diffuse", self.diffuse, 12),
            ("specular", self.specular, 12),
            ("headlight", self.headlight, 1),
            ("castshadow", self.castshadow, 1),
        ];
        let optional = [("type", self.kind, 4), ("directional", self.directional, 1)];
        let optional = optional.into_iter().filter_map(|(field, offset, size)| Some((field, offset?, size)));
        check_fields(self.stride, required.into_iter().chain(optional))
    }

    pub(super) fn read(&self, row: &[u8]) -> PosedLight {
        let kind = match (self.kind, self.directional) {
            (Some(at), _) => match int(row, at) {
                1 => LightType::Directional,
                2 => LightType::Point,
                3 => LightType::Image,
                _ => LightType::Spot,
            },
            (None, Some(at)) if row[at] != 0 => LightType::Directional,
            (None, _) => LightType::Spot,
        };
        let values = LightValues {
            kind,
            active: true,
            // The headlight is at the camera: its shadows are invisible.
            cast_shadow: row[self.castshadow] != 0 && row[self.headlight] == 0,
            attenuation: floats(row, self.attenuation),
            cutoff_deg: float(row, self.cutoff),
            exponent: float(row, self.exponent),
            ambient: floats(row, self.ambient),
            diffuse: floats(row, self.diffuse),
            specular: floats(row, self.specular),
            radius: 0.0,
        };
        let is_headlight = row[self.headlight] != 0;
        PosedLight { values, position: floats(row, self.pos), direction: floats(row, self.dir), is_headlight }
    }
}

fn check_fields(stride: usize, fields: impl Iterator<Item = (&'static str, usize, usize)>) -> Result<(), LayoutError> {
    for (field, offset, size) in fields {
        if offset.checked_add(size).is_none_or(|end| end > stride) {
            return Err(LayoutError::Outside { field, offset, stride });
        }
    }
    Ok(())
}

/// Number at byte `at` of a structure; 0 behind its end.
pub(super) fn int(row: &[u8], at: usize) -> i32 {
    row.get(at..).and_then(|bytes| bytes.first_chunk()).map_or(0, |bytes| i32::from_ne_bytes(*bytes))
}

/// Number at byte `at` of a structure; 0 behind its end.
pub(super) fn float(row: &[u8], at: usize) -> f32 {
    f32::from_bits(int(row, at) as u32)
}

/// Consecutive numbers at byte `at` of a structure.
pub(super) fn floats<const N: usize>(row: &[u8], at: usize) -> [f32; N] {
    std::array::from_fn(|k| float(row, at + 4 * k))
}
