//! Source of the visual arrays of a compiled model.

use crate::{HeightFieldArrays, MaterialValues, MeshArrays, TextureArrays};

/// A compiled MuJoCo model as a source of plain slices. Indices are MuJoCo's ids.
pub trait VisualModel {
    /// Arrays of a mesh.
    ///
    /// # Panics
    /// There is no such mesh.
    fn mesh(&self, mesh: usize) -> MeshArrays<'_>;

    /// Arrays of a height field.
    ///
    /// # Panics
    /// There is no such height field.
    fn height_field(&self, field: usize) -> HeightFieldArrays<'_>;

    /// Number of textures.
    fn ntex(&self) -> usize;

    /// Image of a texture; `None` if the model does not hold its pixels.
    ///
    /// # Panics
    /// There is no such texture.
    fn texture(&self, texture: usize) -> Option<TextureArrays<'_>>;

    /// Number of materials.
    fn nmat(&self) -> usize;

    /// Properties of a material.
    ///
    /// # Panics
    /// There is no such material.
    fn material(&self, material: usize) -> MaterialValues;
}

impl<M: VisualModel + ?Sized> VisualModel for &M {
    fn mesh(&self, mesh: usize) -> MeshArrays<'_> {
        (**self).mesh(mesh)
    }

    fn height_field(&self, field: usize) -> HeightFieldArrays<'_> {
        (**self).height_field(field)
    }

    fn ntex(&self) -> usize {
        (**self).ntex()
    }

    fn texture(&self, texture: usize) -> Option<TextureArrays<'_>> {
        (**self).texture(texture)
    }

    fn nmat(&self) -> usize {
        (**self).nmat()
    }

    fn material(&self, material: usize) -> MaterialValues {
        (**self).material(material)
    }
}
