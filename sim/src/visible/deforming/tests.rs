//! Tests of tendons, skins and flexes against closed forms.

use super::super::VisualScene;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{Data, Model};
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::{Instance, PoseF32, RenderScene};
use std::sync::Arc;

/// Model and its state at `qpos`.
fn state(mjcf: &str, qpos: &[f64]) -> (Model, Data) {
    let model = mj::compile(mjcf, &[]).expect("compiles").into_model();
    let mut data = Data::new(&model).expect("data");
    data.qpos_mut().copy_from_slice(qpos);
    data.forward().expect("forward");
    (model, data)
}

/// Scene of a state, with its poses.
fn seen(visible: &VisualScene, data: &Data) -> (Arc<RenderScene>, Vec<PoseF32>) {
    let scene = visible.scene_at(data);
    let (mut poses, mut lights) = (vec![PoseF32::IDENTITY; scene.instances().len()], scene.lights.clone());
    visible.read_poses(data, &mut poses, &mut lights);
    (scene, poses)
}

fn is_shown(instance: &Instance) -> bool {
    instance.is_deformable && instance.visible
}

/// Ends and radii of the visible capsules.
fn capsules(visible: &VisualScene, data: &Data) -> Vec<([[f64; 3]; 2], f64)> {
    let (scene, poses) = seen(visible, data);
    let shown = scene.instances().iter().zip(&poses).filter(|(instance, _)| is_shown(instance));
    shown
        .map(|(instance, pose)| {
            let Shape::Capsule(capsule) = &instance.shape else { panic!("{:?} is not a capsule", instance.shape) };
            let end = |z: f32| pose.apply([0.0, 0.0, z]).map(f64::from);
            ([end(-capsule.half_length), end(capsule.half_length)], f64::from(capsule.radius))
        })
        .collect()
}

fn near(found: &[([[f64; 3]; 2], f64)], expected: &[([[f64; 3]; 2], f64)]) {
    let numbers = |list: &[([[f64; 3]; 2], f64)]| -> Vec<f64> {
        list.iter()
            .flat_map(|(ends, radius)| ends.as_flattened().iter().copied().chain([*radius]).collect::<Vec<_>>())
            .collect()
    };
    let (a, b) = (numbers(found), numbers(expected));
    // Single precision, of lengths below 2 m.
    assert!(
        a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6),
        "found {found:?}, expected {expected:?}"
    );
}

const PATHS: &str = r#"<mujoco><compiler autolimits="true"/><worldbody>
    <site name="left" pos="-1 0 0"/><site name="right" pos="1 0 0"/>
    <geom name="drum" type="cylinder" size="0.5 0.2" zaxis="0 1 0"/>
    <site name="above" pos="0 0 1"/>
    <body name="load"><joint name="lift" type="slide" axis="0 0 1"/><geom size="0.1" pos="0 0 -1"/>
      <site name="hook" pos="0 0 -1"/></body>
    <body name="free" pos="2 0 0"><joint name="up" type="slide" axis="0 0 1"/><geom size="0.01"/><site name="ball"/></body>
  </worldbody><tendon>
    <spatial name="over" width="0.02" rgba="1 0 0 1"><site site="left"/><geom geom="drum" sidesite="above"/>
      <site site="right"/></spatial>
    <spatial name="parts" width="0.01"><site site="left"/><site site="above"/><pulley divisor="2"/><site site="above"/>
      <site site="hook"/></spatial>
    <spatial name="unseen" group="3"><site site="left"/><site site="hook"/></spatial>
    <spatial name="clear" rgba="1 0 0 0"><site site="left"/><site site="hook"/></spatial>
    <spatial name="string" width="0.005" range="0 2"><site site="right"/><site site="ball"/></spatial>
    <fixed name="sum"><joint joint="lift" coef="1"/></fixed></tendon></mujoco>"#;

/// The rods of a slider-crank are not rendered: a message names the actuator. Control: the same model with a motor at the
/// joint.
///
/// Root cause once: rods were missing from images without a message.
#[test]
fn slider_crank() {
    let model = |actuator: &str| {
        let mjcf = format!(
            r#"<mujoco><worldbody><site name="slider"/><body pos="0 0 1"><joint name="turn"/><geom size="0.1"/>
               <site name="crank" pos="0.1 0 0"/></body></worldbody><actuator>{actuator}</actuator></mujoco>"#
        );
        VisualScene::of_model(&mj::compile(&mjcf, &[]).expect("compiles").into_model())
    };
    let rods = model(r#"<general name="piston" cranksite="crank" slidersite="slider" cranklength="1"/>"#);
    assert_eq!(rods.omitted(), ["the rods of the slider-crank of actuator piston are not rendered"]);
    assert_eq!(model(r#"<motor joint="turn"/>"#).omitted(), [""; 0]);
}

/// A tendon around a cylinder touches it at tangent points: at 60 degrees from the axis to a point two radii away.
/// Between these points it is half as wide. A pulley has no segment. Tendons of group 3, transparent tendons and sums
/// of joint positions are not rendered. A taut string is straight.
///
/// Regression: cameras rendered geoms only.
#[test]
fn tendons() {
    // The string from x = 1 to x = 2 is 2 m long.
    let rise = 3.0_f64.sqrt();
    let (model, data) = state(PATHS, &[0.25, rise]);
    let visible = VisualScene::of_model(&model);
    // The point at 60 degrees from the x axis.
    let tangent = |side: f64| [side * 0.25, 0.0, 0.25 * 3.0_f64.sqrt()];
    let (left, right, above, hook) = ([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -0.75]);
    let (on, off) = (tangent(-1.0), tangent(1.0));
    let over = [([left, on], 0.02), ([on, off], 0.01), ([off, right], 0.02)];
    let parts = [([left, above], 0.01), ([above, hook], 0.01)];
    let string = [([right, [2.0, 0.0, rise]], 0.005)];
    near(&capsules(&visible, &data), &[&over[..], &parts, &string].concat());
    let (scene, _) = seen(&visible, &data);
    let names = |scene: &RenderScene| {
        let mut names: Vec<String> =
            scene.instances().iter().filter(|i| i.is_deformable).map(|i| i.name.to_string()).collect();
        names.dedup();
        names
    };
    assert_eq!(names(&scene), ["over", "parts", "string"]);
    let red = scene.instances().iter().find(|i| i.is_deformable).expect("a tendon").material.rgba;
    assert_eq!(red, [1.0, 0.0, 0.0, 1.0]);
    // The scene of all environments has no visible capsule.
    assert!(!visible.scene().instances().iter().any(is_shown), "unused capsules are hidden");
}

/// A string of 2 m between two points that are 1 m apart at the same height hangs as y = a cosh(x / a), where 2 a
/// sinh(1 / 2a) is 2. A string that is lifted on one side keeps its length. A string between points above each other
/// hangs straight down. The ends of every segment lie on the curve.
#[test]
fn slack_strings() {
    let string = |qpos: f64| {
        let (model, data) = state(PATHS, &[0.0, qpos]);
        let all = capsules(&VisualScene::of_model(&model), &data);
        all.into_iter().filter(|(_, radius)| (radius - 0.005).abs() < 1e-6).map(|(ends, _)| ends).collect::<Vec<_>>()
    };
    let level = string(0.0);
    // By bisection.
    let (mut low, mut high) = (0.1_f64, 10.0_f64);
    for _ in 0..100 {
        let a = 0.5 * (low + high);
        if 2.0 * a * (0.5 / a).sinh() > 2.0 { low = a } else { high = a }
    }
    let height = |x: f64| low * (((x - 1.5) / low).cosh() - (0.5 / low).cosh());
    assert_eq!(level.len(), super::catenary::SEGMENTS);
    for [x, y, z] in level.iter().flatten() {
        assert!(y.abs() < 1e-6 && (z - height(*x)).abs() < 2e-6, "({x}, {z}) is not on the curve: {}", height(*x));
    }
    let length = |pieces: &[[[f64; 3]; 2]]| -> f64 {
        pieces.iter().map(|[a, b]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()).sum()
    };
    for (rise, pieces) in [0.0, 0.5, 1.5, -1.0].map(|rise| (rise, string(rise))) {
        let ends = [pieces[0][0], pieces[pieces.len() - 1][1]];
        near(&[(ends, 0.0)], &[([[1.0, 0.0, 0.0], [2.0, 0.0, rise]], 0.0)]);
        // A polygon inscribed in the curve is a little shorter.
        let length = length(&pieces);
        assert!((1.99..2.0001).contains(&length), "{rise}: {length}");
    }
    let mut steep = Vec::new();
    let ends = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    super::catenary::segments(ends, [0.0, 0.0, -9.81], 3.0, &mut |ends| steep.push((ends, 0.0)));
    near(&steep, &[([ends[0], [0.0, 0.0, -1.0]], 0.0), ([[0.0, 0.0, -1.0], ends[1]], 0.0)]);
    // Control: a taut string is straight.
    assert_eq!(string(3.0).len(), 1);
}

/// Two bodies and a strip over both. The second body rotates about -y at x = 1.
const STRIP: &str = r#"<mujoco><compiler angle="radian"/><worldbody>
    <body name="first"><geom size="0.1"/>
      <body name="second" pos="1 0 0"><joint type="hinge" axis="0 -1 0"/><geom size="0.1"/></body></body>
  </worldbody><PLACE><skin name="strip" rgba="0 1 0 1" inflate="INFLATE"
      vertex="0 -1 0  0 1 0  1 -1 0  1 1 0  2 -1 0  2 1 0"
      face="0 2 1  1 2 3  2 4 3  3 4 5">
    <bone body="first" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3" vertweight="1 1 0.5 0.5"/>
    <bone body="second" bindpos="1 0 0" bindquat="1 0 0 0" vertid="2 3 4 5" vertweight="0.5 0.5 1 1"/>
  </skin></PLACE></mujoco>"#;

/// A skin over two bones. Vertices of one bone move with it. Vertices at the joint stay, since both bones put them
/// there. Inflation moves the ends along the normals of their triangles.
///
/// Regression: cameras rendered geoms only.
#[test]
fn skin_of_two_bones() {
    // x and z of each vertex at y = -1.
    let line = |inflate: &str, angle: f64| {
        let place = if mj::BUILD_VERSION == mj::SupportedVersion::V4 { "deformable" } else { "asset" };
        let (model, data) = state(&STRIP.replace("PLACE", place).replace("INFLATE", inflate), &[angle]);
        let (scene, poses) = seen(&VisualScene::of_model(&model), &data);
        let index = scene.instances().iter().position(is_shown).expect("a skin");
        assert_eq!((poses[index], &*scene.instances()[index].name), (PoseF32::IDENTITY, "strip"));
        let mesh = scene.instances()[index].mesh().expect("a mesh");
        assert_eq!(mesh.positions().len(), 6);
        let mut list: Vec<_> = mesh.positions().iter().filter(|p| p[1] < 0.0).map(|p| [p[0], p[2]]).collect();
        list.sort_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1])));
        list
    };
    let close = |found: &[[f32; 2]], expected: &[[f32; 2]]| {
        let far = found.iter().flatten().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(found.len() == expected.len() && far < 1e-6, "found {found:?}, expected {expected:?}");
    };
    let up = std::f64::consts::FRAC_PI_2;
    close(&line("0", 0.0), &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
    // The second body rotates its x axis to z.
    close(&line("0", up), &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
    let inflated = line("0.1", up);
    close(&[inflated[0], inflated[2]], &[[0.0, 0.1], [0.9, 1.0]]);
}

/// Copies of a scene are reused when no camera holds them, and not before. Copies for an environment with a scene of
/// its own are made from that scene.
#[test]
fn memory_of_scenes() {
    use kinetoscope_scene::EnvScene;
    let (model, mut data) = state(PATHS, &[0.0, 2.0]);
    let visible = VisualScene::of_model(&model);
    let none = EnvScene(None);
    let mut shape = |z: f64, held: &mut EnvScene, own: &EnvScene| {
        data.qpos_mut()[0] = z;
        data.forward().expect("forward");
        visible.update_shapes(&data, 3, own, held);
        held.0.clone().expect("a scene")
    };
    let mut now = EnvScene(None);
    let first = Arc::as_ptr(&shape(0.0, &mut now, &none));
    assert_eq!(Arc::as_ptr(&shape(0.1, &mut now, &none)), first, "used again");
    let held = shape(0.2, &mut now, &none);
    let second = shape(0.3, &mut now, &none);
    assert!(!Arc::ptr_eq(&held, &second), "a camera still shows it");
    let half_length = |scene: &RenderScene| {
        let hook = scene.instances().iter().rfind(|i| is_shown(i) && &*i.name == "parts").expect("parts");
        let Shape::Capsule(capsule) = &hook.shape else { panic!("no capsule") };
        2.0 * capsule.half_length
    };
    // From z = 1 to the hook.
    assert!((half_length(&held) - 1.8).abs() < 1e-6 && (half_length(&second) - 1.7).abs() < 1e-6);
    let own = EnvScene(Some(Arc::new((**visible.scene()).clone())));
    let own_copy = shape(0.4, &mut now, &own);
    assert!(!Arc::ptr_eq(&own_copy, &second) && (half_length(&own_copy) - 1.6).abs() < 1e-6);
}
