//! Sites for rendering.

use super::identity::ElementIdentity;
use kinetoscope_look::shape_from_size;
use kinetoscope_mujoco::Model;
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::{Instance, Material};

/// Instance of a site; `None` for a type of shape that sites do not have.
pub(super) fn instance(model: &Model, site: usize, identity: &ElementIdentity, material: Material) -> Option<Instance> {
    let shape = shape_from_size(model.site_type()[site], &model.site_size()[3 * site..3 * site + 3])?;
    let body = model.site_bodyid()[site] as usize;
    let [x, y, z] = [0, 1, 2].map(|k| model.site_pos()[3 * site + k]);
    let [qw, qx, qy, qz] = [0, 1, 2, 3].map(|k| model.site_quat()[4 * site + k]);
    let frame_from_instance =
        if body > 0 { from_row(&[x, y, z, qw, qx, qy, qz]) } else { kinetoscope_scene::Pose::identity() };
    let ElementIdentity { mask_id, name, body: of } = identity.clone();
    Some(Instance {
        shape,
        material,
        mask_id,
        group: u8::try_from(model.site_group()[site].clamp(0, 31)).unwrap_or(0),
        visible: true,
        name,
        body: of,
        fixed: model.is_fixed(body),
        is_deformable: false,
        frame_from_instance,
    })
}
