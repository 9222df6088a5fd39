//! Arrays of the user's `mujoco.MjModel`.

use kinetoscope_look::mjv::SkinFaces;
use kinetoscope_look::{HeightFieldArrays, MaterialValues, MeshArrays, TextureArrays, TextureType, VisualModel};
use numpy::{Element, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Declares the arrays: their names and element types.
macro_rules! arrays {
    ($($name:ident: $type:ty,)*) => {
        /// Copies of the arrays of a model that define its appearance, each flat.
        #[derive(Clone, Debug)]
        pub(crate) struct ModelArrays {
            $($name: Vec<$type>,)*
        }

        impl ModelArrays {
            /// Copies the arrays of a dictionary with the names of `MjModel`.
            pub(crate) fn from_dict(arrays: &Bound<'_, PyDict>) -> PyResult<Self> {
                Ok(Self { $($name: array(arrays, stringify!($name))?,)* })
            }
        }
    };
}

arrays! {
    mesh_vert: f32,
    mesh_texcoord: f32,
    mesh_face: i32,
    mesh_facetexcoord: i32,
    mesh_vertadr: i64,
    mesh_vertnum: i64,
    mesh_faceadr: i64,
    mesh_facenum: i64,
    mesh_texcoordadr: i64,
    mesh_texcoordnum: i64,
    mesh_normal: f32,
    mesh_facenormal: i32,
    mesh_normaladr: i64,
    mesh_normalnum: i64,
    hfield_size: f64,
    hfield_nrow: i64,
    hfield_ncol: i64,
    hfield_adr: i64,
    hfield_data: f32,
    tex_type: i32,
    tex_width: i64,
    tex_height: i64,
    tex_nchannel: i64,
    tex_adr: i64,
    tex_colorspace: i32,
    tex_data: u8,
    mat_rgba: f32,
    mat_texid: i32,
    mat_texrepeat: f32,
    mat_texuniform: i32,
    mat_emission: f32,
    mat_specular: f32,
    mat_shininess: f32,
    mat_reflectance: f32,
    skin_face: i32,
    skin_texcoord: f32,
    skin_vertadr: i64,
    skin_vertnum: i64,
    skin_faceadr: i64,
    skin_facenum: i64,
    skin_texcoordadr: i64,
}

fn array<T: Element + Clone>(arrays: &Bound<'_, PyDict>, name: &str) -> PyResult<Vec<T>> {
    let missing = || PyKeyError::new_err(format!("the model has no array {name}"));
    let value = arrays.get_item(name)?.ok_or_else(missing)?;
    let array: PyReadonlyArray1<'_, T> = value
        .extract()
        .map_err(|_| PyTypeError::new_err(format!("{name} must be a flat array of {}", std::any::type_name::<T>())))?;
    Ok(array.as_array().to_vec())
}

/// `count` elements from index `first`; empty if the range is invalid.
fn checked_slice<T>(values: &[T], first: i64, count: i64) -> &[T] {
    let (Ok(first), Ok(count)) = (usize::try_from(first), usize::try_from(count)) else { return &[] };
    first.checked_add(count).and_then(|end| values.get(first..end)).unwrap_or(&[])
}

/// Element of an array; 0 behind its end.
fn at<T: Copy + Default>(values: &[T], index: usize) -> T {
    values.get(index).copied().unwrap_or_default()
}

impl ModelArrays {
    /// Checks that the lengths of the arrays agree.
    ///
    /// # Errors
    /// `ValueError` for lengths that do not belong to one model.
    pub(crate) fn validate(&self) -> PyResult<()> {
        let lengths = [
            ("mesh_vertnum", self.mesh_vertnum.len(), self.mesh_vertadr.len()),
            ("mesh_facenum", self.mesh_facenum.len(), self.mesh_vertadr.len()),
            ("hfield_size", self.hfield_size.len(), 4 * self.hfield_adr.len()),
            ("tex_width", self.tex_width.len(), self.tex_type.len()),
            ("mat_rgba", self.mat_rgba.len(), 4 * self.mat_emission.len()),
            ("mat_texid", self.mat_texid.len(), self.mat_emission.len()),
        ];
        match lengths.into_iter().find(|(_, found, expected)| found != expected) {
            Some((name, found, expected)) => Err(PyValueError::new_err(format!(
                "{name} has {found} numbers, but the other arrays of the model need {expected}"
            ))),
            None => Ok(()),
        }
    }
}

impl ModelArrays {
    /// Faces of all skins.
    pub(crate) fn skins(&self) -> Vec<SkinFaces> {
        let skin = |index: usize| {
            let (vertex, vertices) = (at(&self.skin_vertadr, index), at(&self.skin_vertnum, index));
            let (face, faces) = (at(&self.skin_faceadr, index), at(&self.skin_facenum, index));
            let texcoord = self.skin_texcoordadr.get(index).copied().unwrap_or(-1);
            SkinFaces {
                first_vertex: usize::try_from(vertex).unwrap_or(0),
                vertices: usize::try_from(vertices).unwrap_or(0),
                faces: checked_slice(self.skin_face.as_chunks().0, face, faces).to_vec(),
                texcoords: checked_slice(self.skin_texcoord.as_chunks().0, texcoord, vertices).to_vec(),
            }
        };
        (0..self.skin_vertadr.len()).map(skin).collect()
    }
}

impl VisualModel for ModelArrays {
    fn mesh(&self, mesh: usize) -> MeshArrays<'_> {
        let rows = |name: &[i64]| at(name, mesh);
        let (vertex, vertices) = (rows(&self.mesh_vertadr), rows(&self.mesh_vertnum));
        let (face, faces) = (rows(&self.mesh_faceadr), rows(&self.mesh_facenum));
        let (texcoord, texcoords) = (rows(&self.mesh_texcoordadr), rows(&self.mesh_texcoordnum));
        let triangles = checked_slice(self.mesh_face.as_chunks().0, face, faces);
        let corners = checked_slice(self.mesh_facetexcoord.as_chunks().0, face, faces);
        let has_texcoords = mesh < self.mesh_texcoordadr.len() && texcoord >= 0;
        let texcoords = checked_slice(self.mesh_texcoord.as_chunks().0, texcoord, texcoords);
        MeshArrays {
            positions: checked_slice(self.mesh_vert.as_chunks().0, vertex, vertices),
            normals: checked_slice(
                self.mesh_normal.as_chunks().0,
                rows(&self.mesh_normaladr),
                rows(&self.mesh_normalnum),
            ),
            texcoords: (has_texcoords && !texcoords.is_empty()).then_some(texcoords),
            faces: triangles,
            face_normals: checked_slice(self.mesh_facenormal.as_chunks().0, face, faces),
            face_texcoords: if corners.is_empty() { triangles } else { corners },
        }
    }

    fn height_field(&self, field: usize) -> HeightFieldArrays<'_> {
        let [rows, columns] = [at(&self.hfield_nrow, field), at(&self.hfield_ncol, field)];
        HeightFieldArrays {
            size: self.hfield_size.as_chunks().0.get(field).copied().unwrap_or_default(),
            rows: usize::try_from(rows).unwrap_or(0),
            columns: usize::try_from(columns).unwrap_or(0),
            elevation: checked_slice(&self.hfield_data, at(&self.hfield_adr, field), rows.saturating_mul(columns)),
        }
    }

    fn ntex(&self) -> usize {
        self.tex_type.len()
    }

    fn texture(&self, texture: usize) -> Option<TextureArrays<'_>> {
        let kind = match at(&self.tex_type, texture) {
            0 => TextureType::TwoD,
            1 => TextureType::Cube,
            _ => TextureType::Skybox,
        };
        let [width, height] = [at(&self.tex_width, texture), at(&self.tex_height, texture)];
        let channels = at(&self.tex_nchannel, texture);
        let bytes = width.saturating_mul(height).saturating_mul(channels);
        let pixels = checked_slice(&self.tex_data, at(&self.tex_adr, texture), bytes);
        let size = |n: i64| usize::try_from(n).unwrap_or(0);
        let [width, height, channels] = [size(width), size(height), size(channels)];
        // mjCOLORSPACE_SRGB
        let is_srgb = at(&self.tex_colorspace, texture) == 2;
        (!pixels.is_empty()).then_some(TextureArrays { kind, width, height, channels, is_srgb, pixels })
    }

    fn nmat(&self) -> usize {
        self.mat_emission.len()
    }

    fn material(&self, material: usize) -> MaterialValues {
        MaterialValues {
            rgba: self.mat_rgba.as_chunks().0.get(material).copied().unwrap_or_default(),
            texture: usize::try_from(self.mat_texid.get(material).copied().unwrap_or(-1)).ok(),
            tex_repeat: self.mat_texrepeat.as_chunks().0.get(material).copied().unwrap_or([1.0; 2]),
            tex_uniform: at(&self.mat_texuniform, material) != 0,
            emission: at(&self.mat_emission, material),
            specular: at(&self.mat_specular, material),
            shininess: at(&self.mat_shininess, material),
            reflectance: at(&self.mat_reflectance, material),
            // MuJoCo's OpenGL renderer has no metals and no roughness.
            metallic: None,
            roughness: None,
        }
    }
}
