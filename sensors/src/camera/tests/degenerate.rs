//! Bad input and odd scenes.

use super::super::{Channels, Frame, FrameMut, RasterCfg, Rasterizer, Shot};
use super::scenes::every_shape;
use crate::visibility::{RenderError, View};
use scene::mesh::TriMesh;
use scene::shape::{Box, Mesh, Plane, Sphere};
use scene::{Instance, Material, PoseF32, RenderMesh, RenderScene, RenderSceneError};
use std::sync::Arc;

fn view() -> View {
    View::look_at([32, 24], 1.0, [3., 0., 1.], [0., 0., 0.], [0., 0., 1.]).unwrap()
}

fn ball() -> RenderScene {
    RenderScene::new(vec![Instance::new(Sphere { radius: 0.5 }, Material::default(), 3)]).unwrap()
}

fn draw(scene: &RenderScene, poses: &[PoseF32], view: &View) -> Result<Frame, RenderError> {
    let mut frame = Frame::new(view.width, view.height, Channels::ALL);
    Rasterizer::default().render(scene, poses, view, &mut frame).map(|()| frame)
}

#[test]
fn bad_views_poses_and_buffers_are_errors() {
    let (scene, at, view) = (ball(), [PoseF32::IDENTITY], view());
    assert!(draw(&scene, &at, &view).is_ok());
    let bad = |v: View| draw(&scene, &at, &v).unwrap_err();
    assert!(matches!(bad(View { width: 0, ..view }), RenderError::Size { .. }));
    assert!(matches!(bad(View { height: 10_000, ..view }), RenderError::Size { .. }));
    assert!(matches!(bad(View { fx: f32::NAN, ..view }), RenderError::Intrinsics { .. }));
    assert!(matches!(bad(View { fy: -1.0, ..view }), RenderError::Intrinsics { .. }));
    assert!(matches!(bad(View { near: 2.0, far: 2.0, ..view }), RenderError::Range { .. }));
    assert!(matches!(bad(View { far: f32::INFINITY, ..view }), RenderError::Range { .. }));
    let nowhere = PoseF32::from_translation([f32::NAN, 0., 0.]);
    assert!(matches!(bad(View { world_from_camera: nowhere, ..view }), RenderError::CameraPose { .. }));
    assert!(matches!(draw(&scene, &[nowhere], &view), Err(RenderError::InstancePose { instance: 0, .. })));
    assert!(matches!(draw(&scene, &[], &view), Err(RenderError::PoseCount { expected: 1, found: 0 })));
    let squashed = PoseF32 { rotation: [[0.0; 3]; 3], ..PoseF32::IDENTITY };
    assert!(matches!(draw(&scene, &[squashed], &view), Err(RenderError::InstancePose { .. })));
    let mut short = vec![0.0; 5];
    let mut frame = FrameMut { depth: Some(&mut short), ..FrameMut::default() };
    let shot = Shot { scene: &scene, poses: &at, view: &view, lights: None, lens: None, before: None };
    let error = Rasterizer::default().render_shot(&shot, &mut frame).unwrap_err();
    assert_eq!(error.to_string(), "the depth buffer has 5 numbers; the picture needs 768");
    let mut three = Rasterizer::new(RasterCfg { samples: 3, ..RasterCfg::default() });
    let mut frame = Frame::new(32, 24, Channels::ALL);
    assert_eq!(three.render(&scene, &at, &view, &mut frame), Err(RenderError::Samples { samples: 3 }));
    assert_eq!(View::look_at([8, 8], 1.0, [1.; 3], [1.; 3], [0., 0., 1.]), Err(RenderError::LookAt));
}

#[test]
fn bad_scenes_are_errors() {
    let with = |shape: scene::Shape, id| RenderScene::new(vec![Instance::new(shape, Material::default(), id)]);
    assert!(matches!(with(Sphere { radius: 1.0 }.into(), 0), Err(RenderSceneError::ZeroMaskId { instance: 0 })));
    let error = with(Box { half: [1., 0., 1.] }.into(), 1).unwrap_err();
    assert_eq!(error.to_string(), "instance 0, a box, has a size of 0; sizes are positive and finite");
}

#[test]
fn odd_meshes_and_empty_scenes_are_drawn() {
    let view = view();
    let empty = RenderScene::new(vec![]).unwrap();
    assert!(draw(&empty, &[], &view).unwrap().mask.unwrap().iter().all(|&m| m == 0));
    let flat = TriMesh::from_triangles(
        vec![[0.; 3], [1., 0., 0.], [2., 0., 0.], [0., 1e30, 0.]],
        vec![[0, 1, 2], [0, 0, 1], [1, 1, 1], [0, 1, 3]],
    );
    for mesh in [TriMesh::default(), flat] {
        let mesh = Arc::new(RenderMesh::new(&mesh, RenderMesh::CREASE));
        let scene = RenderScene::new(vec![Instance::new(Mesh { mesh }, Material::default(), 1)]).unwrap();
        draw(&scene, &[PoseF32::IDENTITY], &view).unwrap();
    }
}

#[test]
fn looking_straight_up_or_down_has_an_answer() {
    for (eye, down) in [([0., 0., 2.], true), ([0., 0., -2.], false)] {
        let view = View::look_at([16, 16], 1.0, eye, [0.; 3], [0., 0., 1.]).unwrap();
        let plane = RenderScene::new(vec![Instance::new(Plane::INFINITE, Material::default(), 1)]).unwrap();
        let mask = draw(&plane, &[PoseF32::IDENTITY], &view).unwrap().mask.unwrap();
        assert!(mask.iter().all(|&m| m == i32::from(down)), "a plane is seen from above only");
        assert!(view.world_from_camera.is_rigid());
    }
}

#[test]
fn transparency_is_for_the_colour() {
    let glass = |alpha: f32| Material { rgba: [0.2, 0.9, 0.2, alpha], ..Material::default() };
    let wall = || Instance::new(Box { half: [0.1, 2.0, 2.0] }, Material::from_rgba([0.9, 0.1, 0.1, 1.0]), 2);
    let scene = |alpha| {
        let pane = Instance::new(Box { half: [0.05, 0.3, 0.3] }, glass(alpha), 1);
        RenderScene::new(vec![pane, wall()]).unwrap()
    };
    let poses = [PoseF32::from_translation([1., 0., 0.33]), PoseF32::IDENTITY];
    let view = View { cx: 16.5, cy: 12.5, ..view() };
    let middle = 12 * 32 + 16;
    let at = |alpha| {
        let frame = draw(&scene(alpha), &poses, &view).unwrap();
        let color = &frame.color.unwrap()[middle * 4..middle * 4 + 3];
        ([color[0], color[1], color[2]], frame.mask.unwrap()[middle])
    };
    let (none, thin, thick, full) = (at(0.0), at(0.4), at(0.6), at(1.0));
    assert_eq!((none.1, thin.1, thick.1, full.1), (2, 2, 1, 1), "channels see alpha of a half and more");
    assert!(none.0[0] > thin.0[0] && thin.0[0] > thick.0[0] && thick.0[0] > full.0[0], "less and less of the wall");
    assert!(none.0[1] < thin.0[1] && thin.0[1] < thick.0[1] && thick.0[1] < full.0[1]);
}

#[test]
fn hidden_groups_are_not_drawn() {
    let mut instances: Vec<_> =
        every_shape().into_iter().zip(1..).map(|(s, id)| Instance::new(s, Material::default(), id)).collect();
    instances.iter_mut().for_each(|i| i.group = 2);
    instances[1].visible = false;
    instances[0].group = 1;
    let count = instances.len();
    let scene = RenderScene::new(instances).unwrap();
    let mut frame = Frame::new(32, 24, Channels::ALL);
    let mut rasterizer = Rasterizer::new(RasterCfg { groups: 1 << 2, ..RasterCfg::default() });
    rasterizer.render(&scene, &vec![PoseF32::IDENTITY; count], &view(), &mut frame).unwrap();
    let mask = frame.mask.unwrap();
    assert!(!mask.contains(&1) && !mask.contains(&2) && mask.iter().any(|&m| m > 2));
}

#[test]
fn a_lamp_casts_a_shadow() {
    let (mut scene, poses) = (ball(), [PoseF32::from_translation([0., 0., 0.8]), PoseF32::IDENTITY]);
    let mut instances = scene.instances().to_vec();
    instances.push(Instance::new(Plane::INFINITE, Material::default(), 9));
    let spot = scene::LightKind::Spot { cutoff_deg: 45.0, exponent: 1.0 };
    for kind in [scene::LightKind::Directional, spot] {
        scene = RenderScene::new(instances.clone()).unwrap();
        scene.lights[0].kind = kind;
        let mut view = View::look_at([33, 33], 1.0, [2., 0., 0.6], [0., 0., 0.], [0., 0., 1.]).unwrap();
        view.cx = 16.5;
        view.cy = 16.5;
        let under = |shadows| {
            let mut frame = Frame::new(33, 33, Channels::ALL);
            let cfg = RasterCfg { shadows, ..RasterCfg::default() };
            Rasterizer::new(cfg).render(&scene, &poses, &view, &mut frame).unwrap();
            assert_eq!(frame.mask.as_ref().unwrap()[16 * 33 + 16], 9);
            let color = frame.color.unwrap();
            (i32::from(color[(16 * 33 + 16) * 4]), i32::from(color[(32 * 33 + 16) * 4]))
        };
        let (with, without) = (under(true), under(false));
        assert!(with.0 + 40 < without.0, "dark under the ball: {with:?} {without:?} {kind:?}");
        assert_eq!(with.1, without.1, "lit elsewhere");
    }
}
