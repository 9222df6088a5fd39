//! Colors of a model's elements.

use kinetoscope_look::element_color;
use kinetoscope_mujoco::Model;

/// Color and opacity of a geom. A color of the geom's own overrides that of its material, as in MuJoCo's viewer.
pub(crate) fn of_geom(model: &Model, geom: usize) -> [f32; 4] {
    color(model, &model.geom_rgba()[4 * geom..4 * geom + 4], model.geom_matid()[geom])
}

/// Color and opacity of a site, by the rule for geoms.
pub(super) fn of_site(model: &Model, site: usize) -> [f32; 4] {
    color(model, &model.site_rgba()[4 * site..4 * site + 4], model.site_matid()[site])
}

/// Color and opacity of an element with the color `own`, by the rule for geoms.
pub(super) fn color(model: &Model, own: &[f32], material: i32) -> [f32; 4] {
    let material = usize::try_from(material).ok().filter(|&material| material < model.nmat());
    element_color(own, material.map(|material| model.material(material).rgba))
}
