//! Several environments in one scene, side by side.

use super::VisualScene;
use crate::entity_set::GROUND_MASK_ID;
use crate::error::{Error, Result};
use kinetoscope_scene::{Marker, PoseF32, RenderScene};

/// Environment in the overview.
pub(super) struct OverviewEnv<'a> {
    /// Position of the environment \[m\].
    pub(super) origin: [f32; 3],
    /// Scene of the environment.
    pub(super) scene: &'a RenderScene,
    /// Poses of its instances, in the frame of the environment.
    pub(super) poses: &'a [PoseF32],
    pub(super) markers: Vec<Marker>,
}

/// Joins the instances of all `places`, moved to their origins, with their markers. The ground is included once and not
/// moved. Everything else is that of `visible`.
pub(super) fn side_by_side(visible: &VisualScene, places: &[OverviewEnv<'_>]) -> Result<(VisualScene, Vec<PoseF32>)> {
    let (mut instances, mut poses) = (Vec::new(), Vec::new());
    for (index, OverviewEnv { origin, scene, poses: own, markers }) in places.iter().enumerate() {
        let moved = |pose: &PoseF32| {
            let t = pose.translation;
            PoseF32 { translation: [t[0] + origin[0], t[1] + origin[1], t[2] + origin[2]], ..*pose }
        };
        for (instance, pose) in scene.instances().iter().zip(*own) {
            let ground = instance.mask_id == GROUND_MASK_ID;
            if index == 0 || !ground {
                instances.push(instance.clone());
                poses.push(if ground { *pose } else { moved(pose) });
            }
        }
        for (instance, pose) in markers.iter().flat_map(Marker::instances) {
            instances.push(instance);
            poses.push(moved(&pose));
        }
    }
    let visible = visible.with_instances(instances).map_err(|error| Error::Overview(error.to_string()))?;
    Ok((visible, poses))
}
