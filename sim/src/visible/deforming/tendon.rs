//! Segments of spatial tendons, rendered as in MuJoCo's viewers.
//!
//! Source: `addSpatialTendonGeoms` of `engine_vis_visualize.c`, without two features: a tendon without a material and a
//! color of its own stays gray at its limit, and colors do not show islands or activations.

use super::{Segment, catenary};
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{Data, Model};

/// Spatial tendon, with the maximum size of its path.
#[derive(Clone, Debug)]
pub(super) struct Tendon {
    tendon: usize,
    /// Largest possible number of points of the path.
    max_points: usize,
    /// True if it hangs like a string when it is slack.
    may_hang: bool,
}

/// True for a tendon with a path in space: other tendons are sums of joint positions.
pub(super) fn is_spatial(model: &Model, tendon: usize) -> bool {
    let first = model.tendon_adr()[tendon] as usize;
    model.wrap_type().get(first).is_some_and(|kind| *kind as u32 != mj::mjWRAP_JOINT)
}

/// MuJoCo's object number of a pulley in a path; geoms have numbers from 0.
const PULLEY: i32 = -2;

impl Tendon {
    pub(super) fn of(model: &Model, tendon: usize) -> Self {
        // Every element of a path gives at most two points: the tangent points on a geom.
        Self {
            tendon,
            max_points: 2 * model.tendon_num()[tendon] as usize,
            may_hang: catenary::may_hang(model, tendon),
        }
    }

    /// Largest possible number of segments of the path.
    pub(super) fn max_segments(&self) -> usize {
        let hanging = if self.may_hang { catenary::SEGMENTS } else { 0 };
        self.max_points.saturating_sub(1).max(hanging)
    }

    /// Segments of the path in `data`, in order.
    pub(super) fn segments(&self, data: &Data, each: &mut dyn FnMut(Segment)) {
        let model = data.model();
        let radius = model.tendon_width()[self.tendon];
        let first = data.ten_wrapadr()[self.tendon];
        let count = data.ten_wrapnum()[self.tendon];
        let (Ok(first), Ok(count)) = (usize::try_from(first), usize::try_from(count)) else { return };
        let points = data.wrap_xpos().as_chunks::<3>().0.get(first..first + count).unwrap_or(&[]);
        let objects = data.wrap_obj().get(first..first + count).unwrap_or(&[]);
        if self.may_hang
            && let Some(length) = catenary::hanging_length(data, self.tendon)
            && let [from, to] = *points
        {
            return catenary::segments([from, to], model.gravity(), length, &mut |ends| each(Segment { ends, radius }));
        }
        for (ends, objects) in points.array_windows::<2>().zip(objects.array_windows::<2>()) {
            if objects.contains(&PULLEY) {
                continue;
            }
            // Thinner inside the geom that the tendon wraps around.
            let inside = objects.iter().all(|object| *object >= 0);
            each(Segment { ends: *ends, radius: if inside { 0.5 * radius } else { radius } });
        }
    }
}
