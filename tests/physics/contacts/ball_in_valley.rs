//! A ball rests in a valley, whose mesh is decomposed into convex pieces. The sides rise at an angle α from a line. Without
//! friction, each side carries m g/(2 cos α), as if the ball had the weight g/(2 cos α) on a plane, into which it sinks by r
//! ([`soft_contact`](crate::rigid_body::soft_contact)). The center of the ball, of radius R, is (R - r)/cos α above the line.
//!
//! Tolerance: MuJoCo finds the depth in a mesh to 1e-6 m (`mjOption`'s tolerance of convex collisions), over cos α. Air
//! alone damps oscillations by e^-10 in the time; contacts damp more.
//!
//! On the convex hull of the mesh, the ball rests on a lid over the valley.

use crate::lab::*;
use crate::rigid_body::soft_contact::depth;
use kinetoscope::scene::mesh::ConvexDecompositionCfg;
use kinetoscope::sim::{FrictionCone, MeshCollision};
use kinetoscope_testkit::worlds::{ball, fixed, object};
use std::fmt::Write as _;

const RADIUS: f64 = 0.05;
const MASS: f64 = 0.5;
/// Half of the width between the rims \[m\].
const HALF_WIDTH: f64 = 0.3;
const SECONDS: f64 = 5.0;
/// MuJoCo's `ccd_tolerance`, called `mpr_tolerance` in 2.2.2 \[m\].
const COLLISION_TOLERANCE: f64 = 1e-6;

/// A prism along y, from -0.5 to 0.5 m, whose upper side is a valley with its line on the y axis.
fn valley(angle: f64) -> String {
    let rim = HALF_WIDTH * angle.tan();
    let outline = [[-HALF_WIDTH, -0.1], [HALF_WIDTH, -0.1], [HALF_WIDTH, rim], [0.0, 0.0], [-HALF_WIDTH, rim]];
    let mut text = String::new();
    for y in [-0.5, 0.5] {
        outline.iter().for_each(|[x, z]| writeln!(text, "v {x} {y} {z}").unwrap());
    }
    text.push_str("f 1 2 3 4 5\nf 10 9 8 7 6\n");
    for (here, next) in [(1, 2), (2, 3), (3, 4), (4, 5), (5, 1)] {
        writeln!(text, "f {here} {} {} {next}", here + 5, next + 5).unwrap();
    }
    text
}

fn resting_height(angle: f64, mesh_collision: MeshCollision) -> f64 {
    let mut lab = Lab::new(SimulationManagerCfg { cone: FrictionCone::Elliptic, friction: [0.0; 3], ..earth() });
    let mesh = ObjectShape::mesh(lab.file("valley.obj", &valley(angle)));
    lab.object(RigidObjectCfg { mesh_collision, ..fixed(object("valley", mesh, [0.0; 3])) });
    let start = [0.05, 0.0, HALF_WIDTH * angle.tan() + 2.0 * RADIUS];
    let falling = RigidObjectCfg { linear_damping: 4.0 * MASS, ..ball("ball", RADIUS, MASS, start) };
    let id = lab.object(falling);
    assert_eq!(lab.sim.diagnostics(), []);
    lab.run(SECONDS);
    lab.body(id).position.z
}

#[test]
fn ball_in_valley() {
    law(module_path!(), "z = (R - r)/cos α on the convex pieces of a valley", |m| {
        m.versions_differ("4.x finds the depth in a mesh by another algorithm, which is more accurate");
        for degrees in [30.0, 45.0, 60.0] {
            let angle = f64::to_radians(degrees);
            let quantity = format!("height of the ball between sides of {degrees}°");
            let pieces = MeshCollision::Pieces(ConvexDecompositionCfg::default());
            let expected = (RADIUS - depth(G / (2.0 * angle.cos()))) / angle.cos();
            let tolerance = (COLLISION_TOLERANCE / angle.cos(), "depth in a mesh");
            m.row(&quantity, "m", expected, resting_height(angle, pieces), tolerance);
            m.control(&quantity, "on the convex hull of the valley", resting_height(angle, MeshCollision::Hull));
        }
    });
}
