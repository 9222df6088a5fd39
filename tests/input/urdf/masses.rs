//! Mass properties that URDF files leave out, give incompletely, or give with physically impossible values.
//!
//! References: closed forms of solids, and MuJoCo's own mass properties of a body with the same geoms and density. The
//! relative tolerance is 1e-12: both are a few operations on the same numbers. Meshes are read in single precision:
//! 1e-6.

use kinetoscope::mujoco::compile;
use kinetoscope::prelude::*;
use kinetoscope::robot::description::Inertial;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::robot::urdf::MissingInertia;
use kinetoscope::robot::urdf::write_urdf;
use kinetoscope::sim::OffscreenScene;
use kinetoscope_testkit::error_tables::assert_errors;
use kinetoscope_testkit::urdf::{TempFiles, collision, joint, limit, robot};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A fixed base with a hinged link of this content; the link is in line 3.
fn hinged(link: &str) -> String {
    let joint = joint("hinge", "revolute", ["base", "l"], [0.0; 3], "0 1 0", &limit([-1.0, 1.0], 10.0, 1.0));
    robot("r", &format!("<link name=\"base\"/>\n<link name=\"l\">{link}</link>\n{joint}"))
}

fn loaded(urdf: &str, missing_inertia: MissingInertia) -> (SimulationManager, RobotId) {
    let files = TempFiles::default();
    files.write("brick.obj", BRICK);
    let mut cfg = kinetoscope_testkit::worlds::text_robot(&files, "r", urdf);
    cfg.urdf.missing_inertia = missing_inertia;
    let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::empty_cfg(1));
    let id = sim.add_robot(cfg).unwrap_or_else(|e| panic!("{e}\n{urdf}"));
    (sim, id)
}

const DENSITY: MissingInertia = MissingInertia::Density(1000.0);

fn warnings(sim: &SimulationManager) -> Vec<&'static str> {
    let ignored = DiagnosticKind::EffortUnlimited;
    sim.diagnostics().iter().filter(|d| d.kind != ignored).map(|d| d.kind.name()).collect()
}

fn inertial_of(sim: &SimulationManager, id: RobotId, link: &str) -> Option<Inertial> {
    let description = sim.robot(id).description();
    description.link(description.link_id(link).unwrap()).inertial.clone()
}

/// Mass, center of mass and the inertia tensor about it, all in the frame of the link.
type Mass = (f64, Vector3<f64>, Matrix3<f64>);

fn in_link_frame(inertial: &Inertial) -> Mass {
    let turn = inertial.link_from_com.rotation.to_rotation_matrix();
    let inertia = turn.matrix() * inertial.inertia * turn.matrix().transpose();
    (inertial.mass, inertial.link_from_com.translation.vector, inertia)
}

/// MuJoCo's mass properties of a body with these geoms.
fn by_mujoco(geoms: &str, density: f64) -> Mass {
    let mjcf = format!(
        "<mujoco><compiler eulerseq=\"XYZ\" angle=\"radian\"/><default><geom density=\"{density}\"/></default>\
         <worldbody><body><freejoint/>{geoms}</body></worldbody></mujoco>"
    );
    let model = compile(&mjcf, &[]).unwrap_or_else(|e| panic!("{e}\n{mjcf}")).into_model();
    let [w, x, y, z] = std::array::from_fn(|i| model.body_iquat()[4 + i]);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
    let moments = Matrix3::from_diagonal(&Vector3::from_column_slice(&model.body_inertia()[3..6]));
    let com = Vector3::from_column_slice(&model.body_ipos()[3..6]);
    (model.body_mass()[1], com, turn.matrix() * moments * turn.matrix().transpose())
}

#[track_caller]
fn assert_near(what: &str, found: &Mass, expected: &Mass, tolerance: f64) {
    assert_near_with(what, found, expected, [tolerance; 2]);
}

/// Asserts equality up to two relative tolerances: one for mass, center and principal moments, one for the tensor.
#[track_caller]
fn assert_near_with(what: &str, found: &Mass, expected: &Mass, [tolerance, of_tensor]: [f64; 2]) {
    let (mass, size) = (expected.0, expected.2.amax());
    let moments = |mass: &Mass| {
        let mut moments: Vec<f64> = mass.2.symmetric_eigenvalues().iter().copied().collect();
        moments.sort_by(f64::total_cmp);
        Vector3::from_vec(moments)
    };
    assert!((found.0 - mass).abs() <= tolerance * mass, "{what}: mass {} instead of {mass}", found.0);
    assert!((found.1 - expected.1).amax() <= tolerance, "{what}: center {} instead of {}", found.1, expected.1);
    let (found_moments, expected_moments) = (moments(found), moments(expected));
    let off = (found_moments - expected_moments).amax();
    assert!(off <= tolerance * size, "{what}: moments {found_moments} instead of {expected_moments}");
    assert!((found.2 - expected.2).amax() <= of_tensor * size, "{what}: {} instead of {}", found.2, expected.2);
}

/// MuJoCo stores moments and axes: its axes are only as exact as the square root of the tensor's rounding error.
const AGAINST_MUJOCO: [f64; 2] = [1e-12, 1e-7];

/// A box of 0.1 x 0.2 x 0.4 m as OBJ, with a corner at the origin.
const BRICK: &str = "v 0 0 0\nv 0.1 0 0\nv 0.1 0.2 0\nv 0 0.2 0\nv 0 0 0.4\nv 0.1 0 0.4\nv 0.1 0.2 0.4\nv 0 0.2 0.4\n\
                     f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// Regression: links with shapes and without `<inertial>` had 1e-6 kg, so that Isaac Gym's Panda weighed 9e-6 kg.
#[test]
fn links_without_inertial() {
    let at = |xyz: &str, rpy: &str, shape: &str| {
        format!("<collision><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><geometry>{shape}</geometry></collision>")
    };
    let rows = [
        ("box", at("0 0 0", "0 0 0", "<box size=\"0.1 0.2 0.3\"/>"), "<geom type=\"box\" size=\"0.05 0.1 0.15\"/>"),
        (
            "sphere",
            at("1 2 3", "0 0 0", "<sphere radius=\"0.1\"/>"),
            "<geom type=\"sphere\" size=\"0.1\" pos=\"1 2 3\"/>",
        ),
        (
            "cylinder",
            at("0 0 1", "0.3 -1.1 2", "<cylinder radius=\"0.1\" length=\"0.3\"/>"),
            "<geom type=\"cylinder\" size=\"0.1 0.15\" pos=\"0 0 1\" euler=\"0.3 -1.1 2\"/>",
        ),
        (
            "capsule",
            at("0 1 0", "0 1 0", "<capsule radius=\"0.1\" length=\"0.3\"/>"),
            "<geom type=\"capsule\" size=\"0.1 0.15\" pos=\"0 1 0\" euler=\"0 1 0\"/>",
        ),
        (
            "two",
            at("0.2 0 0", "0.5 0 0", "<box size=\"0.1 0.2 0.3\"/>")
                + &at("0 0 0.4", "0 0 0", "<sphere radius=\"0.1\"/>"),
            "<geom type=\"box\" size=\"0.05 0.1 0.15\" pos=\"0.2 0 0\" euler=\"0.5 0 0\"/>\
             <geom type=\"sphere\" size=\"0.1\" pos=\"0 0 0.4\"/>",
        ),
    ];
    for (what, shapes, geoms) in rows {
        for density in [1000.0, 7800.0] {
            let (sim, id) = loaded(&hinged(&shapes), MissingInertia::Density(density));
            let found = in_link_frame(&inertial_of(&sim, id, "l").unwrap());
            assert_near_with(what, &found, &by_mujoco(geoms, density), AGAINST_MUJOCO);
            assert_eq!(warnings(&sim), ["inertia-from-shapes"], "{what}");
            let warning = sim.diagnostics().iter().find(|d| d.kind == DiagnosticKind::InertiaFromShapes).unwrap();
            assert_eq!(warning.source.as_ref().unwrap().line, 3);
        }
        // Visual shapes count for links without collision shapes.
        let (sim, id) = loaded(&hinged(&shapes.replace("collision", "visual")), DENSITY);
        assert_near_with(
            what,
            &in_link_frame(&inertial_of(&sim, id, "l").unwrap()),
            &by_mujoco(geoms, 1000.0),
            AGAINST_MUJOCO,
        );
        let ball = "<visual><geometry><sphere radius=\"3\"/></geometry></visual>";
        let (sim, id) = loaded(&hinged(&format!("{ball}{shapes}")), DENSITY);
        assert_near_with(
            what,
            &in_link_frame(&inertial_of(&sim, id, "l").unwrap()),
            &by_mujoco(geoms, 1000.0),
            AGAINST_MUJOCO,
        );
        // Control: minimal values are not part of the description.
        let (sim, id) = loaded(&hinged(&shapes), MissingInertia::Minimal);
        assert_eq!((inertial_of(&sim, id, "l"), warnings(&sim)), (None, vec!["massless-link"]), "{what}");
    }
    // Closed forms: m (y² + z²) / 12 of a box of 8 kg, 2 m r² / 5 of a ball.
    let mesh = at("-0.05 -0.1 -0.2", "0 0 0", "<mesh filename=\"brick.obj\"/>");
    let (sim, id) = loaded(&hinged(&mesh), DENSITY);
    let brick = Matrix3::from_diagonal(&(Vector3::new(0.2, 0.17, 0.05) * 8.0 / 12.0));
    assert_near("mesh", &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &(8.0, Vector3::zeros(), brick), 1e-6);
    let (sim, id) = loaded(&hinged(&collision("<sphere radius=\"0.5\"/>", [0.0; 3])), MissingInertia::Density(6.0));
    let mass = std::f64::consts::PI;
    let expected = (mass, Vector3::zeros(), Matrix3::from_diagonal_element(0.1 * mass));
    assert_near("ball", &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &expected, 1e-12);

    // Links without shapes keep minimal values. A link fixed to a link with mass gets no mass of its own, and a fixed
    // base needs none.
    let (sim, _) = loaded(&hinged(""), DENSITY);
    assert_eq!(warnings(&sim), ["massless-link"]);
    let shape = collision("<sphere radius=\"0.1\"/>", [0.0; 3]);
    let heavy = kinetoscope_testkit::urdf::link("heavy", 1.0, 0.01, [0.0; 3], "");
    let weld = joint("weld", "fixed", ["l", "heavy"], [0.0; 3], "0 0 1", "");
    let base = format!("<link name=\"base\">{shape}</link>");
    let urdf =
        hinged(&shape).replace("</robot>", &format!("{heavy}{weld}</robot>")).replace("<link name=\"base\"/>", &base);
    let (sim, id) = loaded(&urdf, DENSITY);
    assert_eq!((sim.robot(id).description().total_mass(), warnings(&sim)), (1.0, vec![]));
    // Control: without the mass of the heavy link, their shapes give them mass.
    let (sim, id) = loaded(&urdf.replace(&heavy, "<link name=\"heavy\"/>"), DENSITY);
    assert!(sim.robot(id).description().total_mass() > 4.0);

    let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::empty_cfg(1));
    let files = TempFiles::default();
    let rows = [0.0, -1.0, f64::NAN, f64::INFINITY].map(|density| {
        let mut cfg = kinetoscope_testkit::worlds::text_robot(&files, "r", &hinged(&shape));
        cfg.urdf.missing_inertia = MissingInertia::Density(density);
        (density, sim.add_robot(cfg), "Config { field: \"missing_inertia\"", ["positive and finite"])
    });
    assert_errors(rows);
}

/// Regression: `<inertial>` without `<mass>` or without `<inertia>` was refused, although Isaac Gym's cubes have
/// `<density>` and airo's cameras only a mass.
#[test]
fn partial_inertials() {
    let shape = collision("<box size=\"0.1 0.2 0.4\"/>", [1.0, 0.0, 0.0]);
    let of = |mass: f64| Matrix3::from_diagonal(&(Vector3::new(0.2, 0.17, 0.05) * mass / 12.0));
    let inertia = "<inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.2\" iyz=\"0\" izz=\"0.25\"/>";
    let given = Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.25));
    let (x, z) = (Vector3::x(), Vector3::z() * 2.0);
    let origin = "<origin xyz=\"0 0 2\" rpy=\"0 0 1\"/>";
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0).to_rotation_matrix();
    let turned = turn.matrix() * given * turn.matrix().transpose();
    let rows = [
        ("mass".to_owned(), "<mass value=\"3\"/>".to_owned(), (3.0, x, of(3.0))),
        ("density".to_owned(), "<density value=\"500\"/>".to_owned(), (4.0, x, of(4.0))),
        ("nothing".to_owned(), String::new(), (8.0, x, of(8.0))),
        ("origin".to_owned(), format!("{origin}<mass value=\"3\"/>"), (3.0, z, of(3.0))),
        ("inertia".to_owned(), inertia.to_owned(), (8.0, Vector3::zeros(), given)),
        ("inertia at an origin".to_owned(), format!("{origin}{inertia}"), (8.0, z, turned)),
    ];
    let files = TempFiles::default();
    for (what, content, expected) in rows {
        let urdf = hinged(&format!("<inertial>{content}</inertial>{shape}"));
        let (sim, id) = loaded(&urdf, DENSITY);
        assert_near(&what, &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &expected, 1e-12);
        assert_eq!(warnings(&sim), ["inertial-incomplete"], "{what}");
        // A URDF written from the assembled file also leaves the missing values out.
        let cfg = kinetoscope_testkit::worlds::text_robot(&files, "r", &urdf);
        let written = write_urdf(&kinetoscope::robot::urdf::assemble(&cfg.urdf).unwrap().description);
        let (sim, id) = loaded(&written, DENSITY);
        assert_near(&what, &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &expected, 1e-12);
    }
    // A mass without shapes counts as a ball of water, 2/5 m r² with r = (3 m / 4 pi rho)^(1/3); without a mass, the
    // inertial is ignored.
    let (sim, id) = loaded(&hinged("<inertial><mass value=\"2\"/></inertial>"), DENSITY);
    let radius = (1.5e-3 / std::f64::consts::PI).cbrt();
    let expected = (2.0, Vector3::zeros(), Matrix3::from_diagonal_element(0.8 * radius * radius));
    assert_near("no shape", &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &expected, 1e-12);
    assert_eq!(warnings(&sim), ["inertial-incomplete", "inertia-from-shapes"]);
    let (sim, id) = loaded(&hinged(&format!("<inertial>{inertia}</inertial>")), DENSITY);
    let ignored = vec!["inertial-incomplete", "inertia-from-shapes", "massless-link"];
    assert_eq!((inertial_of(&sim, id, "l"), warnings(&sim)), (None, ignored));
    let (sim, id) = loaded(&hinged(&format!("<inertial>{inertia}</inertial>{shape}")), MissingInertia::Minimal);
    assert!(inertial_of(&sim, id, "l").is_none() && warnings(&sim).contains(&"massless-link"));
}

/// Regression: implausible inertias.
///
/// Pybullet's random objects have moments (1, 1, 0) for 0.1 kg. Repaired to (1, 1, 1.7e-8) they behaved as needles of 3
/// m, which diverged on the ground. With the inertia of a box of this mass they fall and come to rest. Objects with the
/// inertia of a body many times their size were kept unchanged, and took seconds to tip over.
#[test]
fn absurd_inertias() {
    let object = |mass: f64, [a, b, c]: [f64; 3]| {
        let inertia = format!("<inertia ixx=\"{a}\" ixy=\"0\" ixz=\"0\" iyy=\"{b}\" iyz=\"0\" izz=\"{c}\"/>");
        let inertial = format!("<inertial><mass value=\"{mass}\"/>{inertia}</inertial>");
        let shape = collision("<box size=\"0.1 0.1 0.05\"/>", [0.0; 3]);
        robot("r", &format!("<link name=\"l\">{inertial}{shape}</link>"))
    };
    let load = |urdf: &str| {
        let files = TempFiles::default();
        let cfg = kinetoscope_testkit::worlds::text_robot(&files, "r", urdf);
        let turned = kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.3], [0.4, 0.3, 0.0]);
        let cfg = RobotCfg { fix_base: false, init_pose: turned, ..cfg };
        let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::cfg(1, 1));
        let id = sim.add_robot(cfg).unwrap();
        (sim, id)
    };
    // m (y² + z²) / 12 of the box.
    let of_box = |mass: f64| Matrix3::from_diagonal(&(Vector3::new(0.0125, 0.0125, 0.02) * mass / 12.0));
    for (what, mass, moments, moments_text) in [
        ("(1, 1, 0)", 0.1, [1.0, 1.0, 0.0], "(1, 1, 0)"),
        ("zero", 0.1, [0.0; 3], "(0, 0, 0)"),
        ("no triangle", 0.1, [1.0, 0.1, 0.1], "(1, 0.1, 0.1)"),
        // A rigid body can have these moments, but not with this size. The body has no joint motor, so the moments
        // cannot include a rotor.
        ("a ball of 5 m", 0.1, [1.0; 3], "(1, 1, 1)"),
        ("above the bound", 1.0, [0.57; 3], "(0.57, 0.57, 0.57)"),
    ] {
        let (mut sim, id) = load(&object(mass, moments));
        let found = in_link_frame(&inertial_of(&sim, id, "l").unwrap());
        assert_near(what, &found, &(mass, Vector3::zeros(), of_box(mass)), 1e-12);
        assert_eq!(warnings(&sim), ["inertia-from-shapes"], "{what}");
        let warning = sim.diagnostics()[0].to_string();
        let new = if mass < 1.0 { "(1.667e-4, 1.042e-4, 1.042e-4)" } else { "(0.001667, 0.001042, 0.001042)" };
        for part in [&format!("{moments_text} kg m² were replaced by {new} kg m²"), "r.urdf:2"] {
            assert!(warning.contains(part), "{what}: {warning}");
        }
        sim.update(1000);
        assert_eq!(sim.diverged(), [], "{what}");
        let (height, speed) = (sim.robot(id).root_pose()[(0, 2)], sim.robot(id).root_velocity());
        assert!((height - 0.025).abs() < 1e-3, "{what} lies at {height} m");
        assert!(speed.iter().all(|v| v.abs() < 1e-2), "{what} moves: {speed}");
    }
    // Controls with unchanged inertia: the reach is 0.075 m, so that 10 times that reach gives 0.5625 kg m² for 1 kg. A
    // box of 1 kg and 500 cm³ has 2000 kg/m³; a box of 15 kg would be denser than osmium, so its shape is a
    // placeholder.
    for (what, mass, moments, kinds) in [
        ("below the bound", 1.0, [0.55; 3], vec![]),
        ("no triangle, within the bound", 1.0, [0.1, 0.1, 0.3], vec!["inertia-repaired"]),
        ("placeholder", 15.0, [100.0, 100.0, 0.0], vec!["inertia-repaired"]),
    ] {
        let (sim, id) = load(&object(mass, moments));
        let expected = (mass, Vector3::zeros(), Matrix3::from_diagonal(&Vector3::from(moments)));
        assert_near(what, &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &expected, 1e-12);
        assert_eq!(warnings(&sim), kinds, "{what}");
    }
    // The inertia behind a joint may include the rotor of a geared motor: it is kept with a warning.
    let shape = collision("<box size=\"0.1 0.1 0.05\"/>", [0.0; 3]);
    let inertia = "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>";
    let (sim, id) = loaded(&hinged(&format!("<inertial><mass value=\"1\"/>{inertia}</inertial>{shape}")), DENSITY);
    let expected = (1.0, Vector3::zeros(), Matrix3::identity());
    assert_near("behind a joint", &in_link_frame(&inertial_of(&sim, id, "l").unwrap()), &expected, 1e-12);
    assert_eq!(warnings(&sim), ["inertia-implausible"]);
    // A visual shape that is large enough makes an inertia plausible.
    let large = "<visual><geometry><sphere radius=\"0.5\"/></geometry></visual></link>";
    assert_eq!(warnings(&load(&object(1.0, [0.57; 3]).replace("</link>", large)).0), [""; 0]);
}

/// Regression: a URDF without anything visible gave an empty image without a warning.
#[test]
fn nothing_to_draw() {
    let link = kinetoscope_testkit::urdf::link("l", 1.0, 0.01, [0.0; 3], "");
    let empty = "<visual><geometry><sphere radius=\"0\"/></geometry></visual></link>";
    let ball = "<visual><geometry><sphere radius=\"1\"/></geometry></visual></link>";
    for (content, kinds) in [
        ("</link>", vec!["nothing-to-draw"]),
        (empty, vec!["shape-empty", "nothing-to-draw"]),
        // Control.
        (ball, vec![]),
    ] {
        let (mut sim, _) = loaded(&robot("r", &link.replace("</link>", content)), DENSITY);
        let images = 2;
        for _ in 0..images {
            OffscreenScene::of_env(&mut sim, EnvId(0)).unwrap();
        }
        assert_eq!(warnings(&sim), kinds, "{content}");
    }
}

/// Regression: a missing visual mesh was warned about twice, on reading and on rendering the robot.
#[test]
fn missing_visual_mesh() {
    let mesh = |name: &str| format!("<visual><geometry><mesh filename=\"{name}\"/></geometry></visual></link>");
    let link = kinetoscope_testkit::urdf::link("l", 1.0, 0.01, [0.0; 3], "");
    let (mut sim, _) = loaded(&robot("r", &link.replace("</link>", &mesh("none.obj"))), DENSITY);
    OffscreenScene::of_env(&mut sim, EnvId(0)).unwrap();
    assert_eq!(warnings(&sim), ["visual-mesh-missing"]);
}
