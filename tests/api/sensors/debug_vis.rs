//! What sensors show, against closed forms, and the switch for it.

use crate::sensors::worlds::{G, cfg, cube, joint, link, robot};
use kinetoscope::prelude::*;
use kinetoscope::scene::{Marker, MarkerKind};
use kinetoscope::sensors::SensorCfg;
use kinetoscope::sensors::ray::pattern::Grid;
use nalgebra::Vector3;

/// A load that hangs from a crane, and a box that has come to rest on the ground.
fn world() -> SimulationManager {
    let files = tempfile::tempdir().unwrap();
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("load", 3.0, 0.01, [0.0, 0.0, -0.4], "");
    content += &joint("pivot", "continuous", "load", [0.0, 0.0, 2.0], "0 1 0");
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    sim.add_robot(robot(files.path(), "crane", &content, true)).unwrap();
    sim.add_rigid_object(cube("box", 2.0, 0.2, [1.0, 0.5, 0.1])).unwrap();
    sim.update(400);
    sim
}

/// What one sensor shows in environment 1; nothing where it is not told to.
fn shown<C: SensorCfg + Send + 'static>(cfg: impl Fn(bool) -> C) -> Vec<Marker> {
    let mut sim = world();
    sim.add_sensor("quiet", cfg(false)).unwrap();
    sim.update(4);
    assert_eq!(sim.markers(), [], "off is off");
    sim.add_sensor("shown", cfg(true)).unwrap();
    sim.update(4);
    let [first, second] = [0, 1].map(|env| {
        let markers = sim.markers();
        markers.into_iter().filter(|(of, _)| *of == EnvId(env)).map(|(_, m)| m).collect::<Vec<Marker>>()
    });
    assert_eq!(first.len(), second.len());
    second
}

/// An arrow's tail and what it points out.
fn arrow(marker: &Marker) -> (Vector3<f64>, Vector3<f64>) {
    let MarkerKind::Arrow { length, .. } = marker.kind else { panic!("{marker:?} is no arrow") };
    (marker.pose.translation.vector, marker.pose.rotation * (Vector3::z() * f64::from(length)))
}

/// Lengths are in single precision: 2 m times 6e-8.
#[track_caller]
fn near((tail, vector): (Vector3<f64>, Vector3<f64>), at: [f64; 3], expected: [f64; 3], tolerance: f64) {
    let apart = (tail - Vector3::from(at)).norm().max((vector - Vector3::from(expected)).norm());
    assert!(apart < tolerance, "{tail} {vector}, not {at:?} {expected:?}");
}

#[test]
fn an_imu_shows_its_frame_and_what_it_feels() {
    let on = |debug_vis| {
        let offset = Pose::translation(0.1, 0.2, 0.3);
        ImuCfg { offset, debug_vis, ..ImuCfg::on("base") }
    };
    let markers = shown(on);
    assert!(markers.len() == 2 && matches!(markers[0].kind, MarkerKind::Axes { .. }), "{markers:?}");
    near(arrow(&markers[1]), [0.1, 0.2, 0.3], [0.0, 0.0, G / 20.0], 1e-6);
}

#[test]
fn a_wrench_shows_what_carries_the_load() {
    let on = |debug_vis| JointWrenchCfg { links: vec!["load".into()], debug_vis, ..Default::default() };
    let markers = shown(on);
    // The load hangs: a force of its weight in the pivot, and no torque but what rounding leaves.
    near(arrow(&markers[0]), [0.0, 0.0, 2.0], [0.0, 0.0, 3.0 * G / 500.0], 1e-6);
    assert!(markers[1..].iter().all(|torque| arrow(torque).1.norm() < 1e-6), "{markers:?}");
}

#[test]
fn a_contact_sensor_shows_who_is_touched() {
    let markers = shown(|debug_vis| ContactSensorCfg { debug_vis, ..ContactSensorCfg::of("box|load") });
    // Nothing touches the load: red is the ball of the box, which has an arrow, green that of the load.
    let (balls, arrows): (Vec<&Marker>, Vec<&Marker>) =
        markers.iter().partition(|m| matches!(m.kind, MarkerKind::Sphere { .. }));
    let ball = |red: bool| {
        let mut found = balls.iter().filter(|m| (m.rgba[0] > m.rgba[1]) == red);
        let ball = found.next().expect("a ball of this colour");
        assert!(found.next().is_none(), "{markers:?}");
        ball.pose.translation.vector
    };
    // The box has sunk into its soft contact by less than a millimetre, and rests to a thousandth of its weight.
    assert!((ball(true) - Vector3::new(1.0, 0.5, 0.1)).norm() < 1e-3, "{markers:?}");
    assert!((ball(false) - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-6, "{markers:?}");
    assert_eq!(arrows.len(), 1, "{markers:?}");
    near(arrow(arrows[0]), [1.0, 0.5, 0.1], [0.0, 0.0, 2.0 * G / 500.0], 1e-3);
}

#[test]
fn frames_and_rays_show_where_they_are() {
    let targets = || vec![TargetFrameCfg::of("box"), TargetFrameCfg::of("load")];
    let frames = shown(|debug_vis| FrameTransformerCfg { debug_vis, ..FrameTransformerCfg::from("base", targets()) });
    assert_eq!(frames.iter().filter(|m| matches!(m.kind, MarkerKind::Axes { .. })).count(), 3);
    assert!((frames[2].pose.translation.vector - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-9);
    let grid = Grid { resolution: 0.5, size: [0.5; 2], ..Grid::default() };
    let rays = shown(|debug_vis| RayCasterCfg {
        offset: Pose::translation(5.0, 5.0, 1.0),
        pattern: grid.into(),
        debug_vis,
        ..Default::default()
    });
    let mut places: Vec<[f64; 3]> = rays.iter().map(|m| m.pose.translation.vector.into()).collect();
    places.iter_mut().flatten().for_each(|x| *x = (*x * 1e6).round() / 1e6);
    places.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(places, [[4.75, 4.75, 0.0], [4.75, 5.25, 0.0], [5.25, 4.75, 0.0], [5.25, 5.25, 0.0]]);
}

/// A camera that looks at the origin from (1, 0, 1) along -x, drawn or made of rays.
const EYE: Placement = Placement::LookAt { eye: [1.0, 0.0, 1.0], target: [0.0, 0.0, 1.0], up: [0.0, 0.0, 1.0] };

/// A lens whose corners are half as far to the sides and three eighths as far up and down as they are away: the arrows end
/// 0.3 m before the eye.
#[test]
fn cameras_show_what_their_pictures_cover() {
    let extrinsics = || Extrinsics { placement: EYE, ..Default::default() };
    let (width, height) = (40, 30);
    let intrinsics = Intrinsics::Pixels { fx: 40.0, fy: 40.0, cx: 20.0, cy: 15.0 };
    let raster = shown(|debug_vis| {
        let (extrinsics, rest) = (extrinsics(), CameraCfg::default());
        CameraCfg { width, height, intrinsics, extrinsics, debug_vis, ..rest }
    });
    let rays = shown(|debug_vis| {
        let (extrinsics, rest) = (extrinsics(), RayCasterCameraCfg::default());
        RayCasterCameraCfg { width, height, intrinsics, extrinsics, debug_vis, ..rest }
    });
    assert_eq!(raster, rays, "placed alike, shown alike");
    assert!(raster.len() == 5 && matches!(raster[0].kind, MarkerKind::Axes { .. }));
    for (marker, (y, z)) in raster[1..].iter().zip([(-0.5, 0.375), (0.5, 0.375), (0.5, -0.375), (-0.5, -0.375)]) {
        near(arrow(marker), [1.0, 0.0, 1.0], [-0.3, 0.3 * y, 0.3 * z], 1e-6);
    }
}

/// The switch is at hand while the simulation runs: what is shown is what a sensor shows that was configured so, wherever
/// the bodies have come to meanwhile, and nothing of what is measured changes.
#[test]
fn what_is_shown_can_be_switched_while_it_runs() {
    let mut sim = world();
    let contact = |debug_vis| ContactSensorCfg { debug_vis, ..ContactSensorCfg::of("box") };
    let wrench = |debug_vis| JointWrenchCfg { links: vec!["load".into()], debug_vis, ..Default::default() };
    let (off, on) = (sim.add_sensor("off", contact(false)).unwrap(), sim.add_sensor("on", contact(true)).unwrap());
    let load = sim.add_sensor("load", wrench(false)).unwrap();
    assert_eq!([sim.debug_vis(off).unwrap(), sim.debug_vis(on).unwrap()], [false, true]);
    sim.update(4);
    // Two environments with a ball and an arrow each.
    let of_on = sim.markers();
    assert_eq!(of_on.len(), 4);
    sim.set_debug_vis(on, false).unwrap();
    assert_eq!(sim.markers(), []);
    sim.set_debug_vis(off, true).unwrap();
    assert_eq!(sim.markers(), of_on, "the same, of a sensor that was built without");
    // What all but one show: without itself where it shows anything, all of them where it does not.
    assert_eq!(sim.markers_beside(off), []);
    assert_eq!(sim.markers_beside(load), of_on);
    sim.set_debug_vis(load, true).unwrap();
    let (of_load, all) = (sim.markers_beside(off), sim.markers());
    assert!(!of_load.is_empty() && all.len() == of_on.len() + of_load.len());
    assert!(of_load.iter().all(|marker| all.contains(marker) && !of_on.contains(marker)));
    assert_eq!(sim.markers_beside(load), of_on);
    sim.set_debug_vis(off, false).unwrap();
    assert_eq!(sim.markers(), of_load);
    let (first, marker) = &sim.markers()[0];
    assert_eq!(*first, EnvId(0));
    near(arrow(marker), [0.0, 0.0, 2.0], [0.0, 0.0, 3.0 * G / 500.0], 1e-6);
    assert!(sim.sensor(off).unwrap().pos_w().is_none(), "poses are for show, and not measured");
    assert_eq!(sim.sensor(off).unwrap().sample_counts().to_vec(), [4, 4], "nothing started anew");
    // The switch stays where a robot is added later, and all is built anew.
    sim.add_rigid_object(cube("late", 1.0, 0.2, [3.0, 3.0, 0.1])).unwrap();
    assert_eq!([off, on].map(|id| sim.debug_vis(id).unwrap()), [false, false]);
    assert!(sim.debug_vis(load).unwrap());
}

/// In a scene, by the name of the sensor, whatever its kind.
#[test]
fn what_is_shown_can_be_switched_by_name() {
    let mut scene = InteractiveScene::new(
        SceneCfg::new(cfg(1)).with("box", cube("box", 2.0, 0.2, [0.0, 0.0, 0.1])).with("imu", ImuCfg::on("box")),
    )
    .unwrap();
    assert_eq!(scene.sim().markers(), []);
    // It stands: the arrow is there.
    scene.update(50);
    scene.set_debug_vis("{ENV}/imu", true).unwrap();
    assert_eq!(scene.sim().markers().len(), 2);
    assert!(scene.sim().debug_vis(scene.sensor_id::<Imu>("imu").unwrap()).unwrap());
    let text = scene.set_debug_vis("imo", true).unwrap_err().to_string();
    assert!(text.contains("\"imo\"") && text.contains("\"imu\""), "{text}");
    let text = scene.set_debug_vis("box", true).unwrap_err().to_string();
    assert_eq!(text, "\"box\" is a rigid object, not a sensor");
}
