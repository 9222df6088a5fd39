//! Mutations of camera images, rays and rendered meshes.

use super::Mutation;

pub(super) const RENDERER: &[Mutation] = &[
    Mutation::of(
        "kinetoscope-render",
        "tangential coefficients of a lens exchanged",
        "render/src/lens/open_cv.rs",
        [
            "x * g + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x) + r * (s1 + r * s2),",
            "x * g + 2.0 * p2 * x * y + p1 * (r + 2.0 * x * x) + r * (s1 + r * s2),",
        ],
        &["tests::lenses::opencv_numbers"],
    ),
    Mutation::of(
        "kinetoscope-render",
        "optical flow to the left, not to the right",
        "render/src/shade/motion_vectors.rs",
        ["let right = u - (there.x * nearness * fx + cx);", "let right = (there.x * nearness * fx + cx) - u;"],
        &["tests::flow::homography", "tests::flow::random_scenes"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "right eye of a pair on the left",
        "sensors/src/camera/stereo/rectify.rs",
        ["projection[(0, 3)] = 0.0 - pixels.fx * beside;", "projection[(0, 3)] = pixels.fx * beside;"],
        &["camera::tests::stereo::opencv_stereo_cameras"],
    ),
    Mutation::of(
        "kinetoscope-render",
        "rolling shutter from the bottom up",
        "render/src/shutter.rs",
        ["self.last_row.saturating_sub(row) as f64 * self.row", "row as f64 * self.row"],
        &["tests::shutter::shear"],
    ),
    Mutation::of(
        "kinetoscope-scene",
        "negative index of an OBJ one vertex too far",
        "scene/src/mesh/obj.rs",
        [".checked_add(index).filter", ".checked_add(index + 1).filter"],
        &["mesh::obj::tests::faces"],
    ),
    Mutation::of(
        "kinetoscope-scene",
        "every second triangle of a strip inside out",
        "scene/src/mesh/glb.rs",
        ["5 => [t + 1, t, t + 2],", "5 => [t, t + 1, t + 2],"],
        &["mesh::glb::tests::square"],
    ),
    Mutation::of(
        "kinetoscope-scene",
        "transforms of a COLLADA node in the wrong order",
        "scene/src/mesh/dae.rs",
        ["here = product(&here, &step);", "here = product(&step, &here);"],
        &["mesh::dae::tests::transforms"],
    ),
];
