//! Mistakes in images of cameras, in rays, and in the meshes they show.

use super::Mutation;

const fn unit(
    name: &'static str,
    file: &'static str,
    [search, replacement]: [&'static str; 2],
    tests: &'static [&'static str],
) -> Mutation {
    Mutation { name, file, search, replacement, tests: ("kinetoscope-sensors", tests) }
}

const fn scene(
    name: &'static str,
    file: &'static str,
    [search, replacement]: [&'static str; 2],
    tests: &'static [&'static str],
) -> Mutation {
    Mutation { name, file, search, replacement, tests: ("kinetoscope-scene", tests) }
}

pub(super) const RENDERER: &[Mutation] = &[
    unit(
        "tangential coefficients of a lens exchanged",
        "sensors/src/camera/lens/open_cv.rs",
        [
            "x * g + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x) + r * (s1 + r * s2),",
            "x * g + 2.0 * p2 * x * y + p1 * (r + 2.0 * x * x) + r * (s1 + r * s2),",
        ],
        &["camera::tests::lenses::opencv_numbers"],
    ),
    unit(
        "optical flow to the left, not to the right",
        "sensors/src/resolve/moves.rs",
        ["let right = u - (there.x * nearness * fx + cx);", "let right = (there.x * nearness * fx + cx) - u;"],
        &["camera::tests::flow::homography", "camera::tests::flow::random_scenes"],
    ),
    unit(
        "right eye of a pair on the left",
        "sensors/src/camera/stereo/rectify.rs",
        ["projection[(0, 3)] = 0.0 - pixels.fx * beside;", "projection[(0, 3)] = pixels.fx * beside;"],
        &["camera::tests::stereo::opencv_pairs"],
    ),
    unit(
        "rolling shutter from the bottom up",
        "sensors/src/camera/shutter.rs",
        ["self.last_row.saturating_sub(row) as f64 * self.row", "row as f64 * self.row"],
        &["camera::tests::shutter::shear"],
    ),
    unit(
        "horizontal edges belong to no triangle",
        "sensors/src/visibility/raster/triangle.rs",
        ["let owns_edge = dy < 0 || (dy == 0 && dx > 0);", "let owns_edge = dy < 0;"],
        &["camera::tests::reference::watertight_edges"],
    ),
    unit(
        "cosine of the light forgotten in path tracing",
        "sensors/src/resolve/path/lobe.rs",
        ["(1.0 - out[k]) * i[2] / PI)", "(1.0 - out[k]) / PI)"],
        &["resolve::path::lobe::tests::energy"],
    ),
    unit(
        "boxes of a BVH left on the near side",
        "sensors/src/ray/bvh/mod.rs",
        ["smaller((fx[k] - ox) * ix, (fy[k] - oy) * iy)", "smaller((nx[k] - ox) * ix, (fy[k] - oy) * iy)"],
        &["ray::tests::trees::brute_force"],
    ),
    unit(
        "linear and quadratic attenuation of lights exchanged",
        "sensors/src/resolve/shade.rs",
        ["square * quadratic + distance * linear + constant", "square * linear + distance * quadratic + constant"],
        &["camera::tests::light::attenuation"],
    ),
    unit(
        "depth noise that ignores its offset",
        "sensors/src/camera/imperfection/depth_noise.rs",
        ["(z - self.offset).powi(2)", "z.powi(2)"],
        &["camera::imperfection::tests::depth_noise"],
    ),
    unit(
        "shadow of a projector on the other side",
        "sensors/src/camera/imperfection/holes.rs",
        ["let pixel = if reach > 0.0 {", "let pixel = if reach < 0.0 {"],
        &["camera::imperfection::tests::projector_shadow"],
    ),
    unit(
        "points of pixels at their corners",
        "sensors/src/camera/point_cloud.rs",
        ["(x as f64 + 0.5, y as f64 + 0.5)", "(x as f64, y as f64)"],
        &["camera::tests::sensor::points"],
    ),
    scene(
        "negative index of an OBJ one vertex too far",
        "scene/src/mesh/obj.rs",
        [".checked_add(index).filter", ".checked_add(index + 1).filter"],
        &["mesh::obj::tests::faces"],
    ),
    scene(
        "every second triangle of a strip inside out",
        "scene/src/mesh/glb.rs",
        ["5 => [t + 1, t, t + 2],", "5 => [t, t + 1, t + 2],"],
        &["mesh::glb::tests::square"],
    ),
    scene(
        "transforms of a COLLADA node in the wrong order",
        "scene/src/mesh/dae.rs",
        ["here = product(&here, &step);", "here = product(&step, &here);"],
        &["mesh::dae::tests::transforms"],
    ),
];
