//! Layouts of MuJoCo's structures, from dictionaries of Python.

use kinetoscope_look::mjv::{DecorTypes, GeomLayout, LightLayout, SoftTypes};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Layout of `mjvGeom`: `stride`, the byte offsets of fields by name, and the numbers of the types of skins, flexes,
/// signed distance fields and decoration.
pub(crate) fn geom_layout(fields: &Bound<'_, PyDict>) -> PyResult<GeomLayout> {
    let get = |name| required(fields, name);
    Ok(GeomLayout {
        stride: get("stride")?,
        kind: get("type")?,
        dataid: get("dataid")?,
        objtype: get("objtype")?,
        objid: get("objid")?,
        category: get("category")?,
        matid: optional(fields, "matid")?,
        texid: optional(fields, "texid")?,
        texuniform: optional(fields, "texuniform")?,
        texrepeat: optional(fields, "texrepeat")?,
        segid: get("segid")?,
        size: get("size")?,
        pos: get("pos")?,
        mat: get("mat")?,
        rgba: get("rgba")?,
        emission: get("emission")?,
        specular: get("specular")?,
        shininess: get("shininess")?,
        reflectance: get("reflectance")?,
        soft: SoftTypes { skin: optional(fields, "mjGEOM_SKIN")?, flex: optional(fields, "mjGEOM_FLEX")? },
        decor: DecorTypes {
            sdf: optional(fields, "mjGEOM_SDF")?,
            arrow: optional(fields, "mjGEOM_ARROW")?,
            arrow1: optional(fields, "mjGEOM_ARROW1")?,
            arrow2: optional(fields, "mjGEOM_ARROW2")?,
            line: optional(fields, "mjGEOM_LINE")?,
            line_box: optional(fields, "mjGEOM_LINEBOX")?,
            triangle: optional(fields, "mjGEOM_TRIANGLE")?,
        },
    })
}

/// Layout of `mjvLight`: `stride`, and the byte offsets of fields by name.
pub(crate) fn light_layout(fields: &Bound<'_, PyDict>) -> PyResult<LightLayout> {
    let get = |name| required(fields, name);
    Ok(LightLayout {
        stride: get("stride")?,
        pos: get("pos")?,
        dir: get("dir")?,
        kind: optional(fields, "type")?,
        directional: optional(fields, "directional")?,
        attenuation: get("attenuation")?,
        cutoff: get("cutoff")?,
        exponent: get("exponent")?,
        ambient: get("ambient")?,
        diffuse: get("diffuse")?,
        specular: get("specular")?,
        headlight: get("headlight")?,
        castshadow: get("castshadow")?,
    })
}

fn optional<'py, T>(fields: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<T>>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    fields.get_item(name)?.map(|value| value.extract()).transpose()
}

fn required<'py, T>(fields: &Bound<'py, PyDict>, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    optional(fields, name)?.ok_or_else(|| PyKeyError::new_err(format!("the layout has no field {name:?}")))
}
