//! Debug markers of sensors, against closed forms, and the switch for them.

use super::worlds::{G, add_robot, cfg, cube, joint, link, look_at, sim};
use kinetoscope::prelude::*;
use kinetoscope::scene::{Marker, MarkerKind};
use kinetoscope::sensors::ray::RayCasterCameraCfg;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::{FrameTransformerCfg, Imu, JointWrenchCfg, SensorCfg, TargetFrameCfg};
use nalgebra::Vector3;

/// A load that hangs from a crane, and a box at rest on the ground.
fn world() -> SimulationManager {
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("load", 3.0, 0.01, [0.0, 0.0, -0.4], "");
    content += &joint("pivot", "continuous", ["base", "load"], [0.0, 0.0, 2.0], "0 1 0");
    let mut sim = sim(2);
    add_robot(&mut sim, "crane", &content, |_| ());
    sim.add_rigid_object(cube("box", 0.2, 2.0, [1.0, 0.5, 0.1])).unwrap();
    sim.update(400);
    sim
}

/// Returns the markers of one sensor in environment 1; checks that `debug_vis: false` gives no markers.
fn markers_of<C: SensorCfg + Send + 'static>(cfg: impl Fn(bool) -> C) -> Vec<Marker> {
    let mut sim = world();
    sim.add_sensor("quiet", cfg(false)).unwrap();
    sim.update(4);
    assert_eq!(sim.scene().markers(), [], "off is off");
    sim.add_sensor("shown", cfg(true)).unwrap();
    sim.update(4);
    let of = |env| sim.scene().markers().into_iter().filter(move |(of, _)| *of == EnvId(env)).map(|(_, marker)| marker);
    assert_eq!(of(0).count(), of(1).count());
    of(1).collect()
}

fn wrench_of_load(debug_vis: bool) -> JointWrenchCfg {
    JointWrenchCfg { links: vec!["load".into()], debug_vis, ..Default::default() }
}

/// Returns the tail of an arrow and its vector.
fn arrow(marker: &Marker) -> (Vector3<f64>, Vector3<f64>) {
    let MarkerKind::Arrow { length, .. } = marker.kind else { panic!("{marker:?} is no arrow") };
    (position(marker), marker.pose.rotation * (Vector3::z() * f64::from(length)))
}

fn position(marker: &Marker) -> Vector3<f64> {
    marker.pose.translation.vector
}

fn is_axes(marker: &Marker) -> bool {
    matches!(marker.kind, MarkerKind::Axes { .. })
}

/// Lengths are in single precision: 2 m times 6e-8.
#[track_caller]
fn assert_arrow(marker: &Marker, at: [f64; 3], expected: [f64; 3], tolerance: f64) {
    let (tail, vector) = arrow(marker);
    let error = (tail - Vector3::from(at)).norm().max((vector - Vector3::from(expected)).norm());
    assert!(error < tolerance, "{tail} {vector}, not {at:?} {expected:?}");
}

#[test]
fn imu_and_wrench() {
    let offset = Pose::translation(0.1, 0.2, 0.3);
    let markers = markers_of(|debug_vis| ImuCfg { offset, debug_vis, ..ImuCfg::on("base") });
    assert!(markers.len() == 2 && is_axes(&markers[0]), "{markers:?}");
    assert_arrow(&markers[1], [0.1, 0.2, 0.3], [0.0, 0.0, G / 20.0], 1e-6);
    let markers = markers_of(wrench_of_load);
    // The load hangs: the pivot carries its weight, without a torque except for rounding.
    assert_arrow(&markers[0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0 * G / 500.0], 1e-6);
    assert!(markers[1..].iter().all(|torque| arrow(torque).1.norm() < 1e-6), "{markers:?}");
}

/// The load has no contact: its ball is green. The ball of the box is red, with an arrow.
#[test]
fn contacts() {
    let markers = markers_of(|debug_vis| ContactSensorCfg { debug_vis, ..ContactSensorCfg::for_bodies("box|load") });
    let (balls, arrows): (Vec<&Marker>, Vec<&Marker>) =
        markers.iter().partition(|m| matches!(m.kind, MarkerKind::Sphere { .. }));
    let ball = |red: bool| {
        let found: Vec<_> = balls.iter().filter(|m| (m.rgba[0] > m.rgba[1]) == red).collect();
        assert_eq!(found.len(), 1, "{markers:?}");
        position(found[0])
    };
    // The box has sunk into its soft contact by less than a millimeter; the force is its weight to within a thousandth.
    assert!((ball(true) - Vector3::new(1.0, 0.5, 0.1)).norm() < 1e-3, "{markers:?}");
    assert!((ball(false) - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-6, "{markers:?}");
    assert_eq!(arrows.len(), 1, "{markers:?}");
    assert_arrow(arrows[0], [1.0, 0.5, 0.1], [0.0, 0.0, 2.0 * G / 500.0], 1e-3);
}

#[test]
fn frames_and_rays() {
    let targets = || vec![TargetFrameCfg::for_bodies("box"), TargetFrameCfg::for_bodies("load")];
    let frames =
        markers_of(|debug_vis| FrameTransformerCfg { debug_vis, ..FrameTransformerCfg::new("base", targets()) });
    assert_eq!(frames.iter().filter(|marker| is_axes(marker)).count(), 3);
    assert!((position(&frames[2]) - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-9);
    let pattern = RayPattern::from(Grid { resolution: 0.5, size: [0.5; 2], ..Grid::default() });
    let offset = Pose::translation(5.0, 5.0, 1.0);
    let rays =
        markers_of(|debug_vis| RayCasterCfg { offset, pattern: pattern.clone(), debug_vis, ..Default::default() });
    let mut places: Vec<[f64; 3]> = rays.iter().map(|m| position(m).map(|x| (x * 1e6).round() / 1e6).into()).collect();
    places.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(places, [[4.75, 4.75, 0.0], [4.75, 5.25, 0.0], [5.25, 4.75, 0.0], [5.25, 5.25, 0.0]]);
}

/// A raster camera and a ray-cast camera at (1, 0, 1) that look along -x. At unit distance the image corners are at 1/2
/// to the sides and 3/8 up and down; the arrows end 0.3 m in front of the camera.
#[test]
fn cameras() {
    let extrinsics = || look_at([1.0, 0.0, 1.0], [0.0, 0.0, 1.0]);
    let (width, height) = (40, 30);
    let intrinsics = Intrinsics::Pixels { fx: 40.0, fy: 40.0, cx: 20.0, cy: 15.0 };
    let raster = markers_of(|debug_vis| CameraCfg {
        width,
        height,
        intrinsics,
        extrinsics: extrinsics(),
        debug_vis,
        ..Default::default()
    });
    let rays = markers_of(|debug_vis| RayCasterCameraCfg {
        width,
        height,
        intrinsics,
        extrinsics: extrinsics(),
        debug_vis,
        ..Default::default()
    });
    assert_eq!(raster, rays);
    assert!(raster.len() == 5 && is_axes(&raster[0]));
    for (marker, (y, z)) in raster[1..].iter().zip([(-0.5, 0.375), (0.5, 0.375), (0.5, -0.375), (-0.5, -0.375)]) {
        assert_arrow(marker, [1.0, 0.0, 1.0], [-0.3, 0.3 * y, 0.3 * z], 1e-6);
    }
}

/// Enabling markers at run time gives the markers of a sensor that was configured with them, at the current poses of
/// the bodies, and changes no measurement.
#[test]
fn switch() {
    let mut sim = world();
    let contact = |debug_vis| ContactSensorCfg { debug_vis, ..ContactSensorCfg::for_bodies("box") };
    let (off, on) = (sim.add_sensor("off", contact(false)).unwrap(), sim.add_sensor("on", contact(true)).unwrap());
    let load = sim.add_sensor("load", wrench_of_load(false)).unwrap();
    assert_eq!([sim.scene().debug_vis(off).unwrap(), sim.scene().debug_vis(on).unwrap()], [false, true]);
    sim.update(4);
    // Two environments with a ball and an arrow each.
    let of_on = sim.scene().markers();
    assert_eq!(of_on.len(), 4);
    sim.scene_mut().set_debug_vis(on, false).unwrap();
    assert_eq!(sim.scene().markers(), []);
    sim.scene_mut().set_debug_vis(off, true).unwrap();
    assert_eq!(sim.scene().markers(), of_on, "the same, of a sensor that was built without");
    // Markers of all sensors but one.
    assert_eq!(sim.scene().markers_except(off), []);
    assert_eq!(sim.scene().markers_except(load), of_on);
    sim.scene_mut().set_debug_vis(load, true).unwrap();
    let (of_load, all) = (sim.scene().markers_except(off), sim.scene().markers());
    assert!(!of_load.is_empty() && all.len() == of_on.len() + of_load.len());
    assert!(of_load.iter().all(|marker| all.contains(marker) && !of_on.contains(marker)));
    assert_eq!(sim.scene().markers_except(load), of_on);
    sim.scene_mut().set_debug_vis(off, false).unwrap();
    assert_eq!(sim.scene().markers(), of_load);
    assert_eq!(of_load[0].0, EnvId(0));
    assert_arrow(&of_load[0].1, [0.0, 0.0, 2.0], [0.0, 0.0, 3.0 * G / 500.0], 1e-6);
    assert!(sim.sensor(off).unwrap().pos_w().is_none(), "poses are for markers, and not measured");
    assert_eq!(sim.sensor(off).unwrap().sample_counts().to_vec(), [4, 4], "no sensor was restarted");
    // The switch persists when an object is added later, which rebuilds all sensors.
    sim.add_rigid_object(cube("late", 0.2, 1.0, [3.0, 3.0, 0.1])).unwrap();
    assert_eq!([off, on].map(|id| sim.scene().debug_vis(id).unwrap()), [false, false]);
    assert!(sim.scene().debug_vis(load).unwrap());
}

/// In a scene, by the name of the sensor.
#[test]
fn switch_by_name() {
    let scene =
        SceneCfg::new(cfg(1)).with("box", cube("box", 0.2, 2.0, [0.0, 0.0, 0.1])).with("imu", ImuCfg::on("box"));
    let mut scene = InteractiveScene::new(scene).unwrap();
    assert_eq!(scene.sim().scene().markers(), []);
    // The box is at rest: the arrow exists.
    scene.update(50);
    scene.set_debug_vis("{ENV}/imu", true).unwrap();
    assert_eq!(scene.sim().scene().markers().len(), 2);
    assert!(scene.sim().scene().debug_vis(scene.sensor_id::<Imu>("imu").unwrap()).unwrap());
    let text = scene.set_debug_vis("imo", true).unwrap_err().to_string();
    assert!(text.contains("\"imo\"") && text.contains("\"imu\""), "{text}");
    let text = scene.set_debug_vis("box", true).unwrap_err().to_string();
    assert_eq!(text, "\"box\" is a rigid object, not a sensor");
}
