//! Invalid input and degenerate scenes.

use super::harness::{TestFrame, look_at_view};
use crate::frame::FrameMut;
use crate::image_renderer::ImageRenderer;
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::visibility::{RenderError, View};
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{Box, Mesh, Plane, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Instance, Material, PoseF32, RenderScene, RenderSceneError};
use kinetoscope_testkit::scenes::{every_shape, instances, translation};
use std::sync::Arc;

fn view() -> View {
    look_at_view([32, 24], 1.0, [3., 0., 1.], [0.; 3])
}

fn of(shape: impl Into<Shape>) -> TestFrame {
    TestFrame::new(instances([(shape, Material::default(), PoseF32::IDENTITY)]), view())
}

#[test]
fn invalid_input() {
    let good = of(Sphere { radius: 0.5 });
    good.draw();
    let paths = |samples, max_bounces| Renderer::RayTraced { samples, max_bounces, denoise: false, seed: 0 };
    type Row = (&'static str, fn(&mut TestFrame), fn(&RenderError) -> bool);
    let rows: [Row; 12] = [
        ("width", |s| s.view.width = 0, |e| matches!(e, RenderError::Size { .. })),
        ("height", |s| s.view.height = 10_000, |e| matches!(e, RenderError::Size { .. })),
        ("fx", |s| s.view.fx = f32::NAN, |e| matches!(e, RenderError::Intrinsics { .. })),
        ("fy", |s| s.view.fy = -1.0, |e| matches!(e, RenderError::Intrinsics { .. })),
        ("near", |s| (s.view.near, s.view.far) = (2.0, 2.0), |e| matches!(e, RenderError::Range { .. })),
        ("far", |s| s.view.far = f32::INFINITY, |e| matches!(e, RenderError::Range { .. })),
        (
            "camera",
            |s| s.view.world_from_camera.translation[0] = f32::NAN,
            |e| matches!(e, RenderError::CameraPose { .. }),
        ),
        (
            "pose",
            |s| s.poses[0].translation[0] = f32::NAN,
            |e| matches!(e, RenderError::InstancePose { instance: 0, .. }),
        ),
        ("rotation", |s| s.poses[0].rotation = [[0.0; 3]; 3], |e| matches!(e, RenderError::InstancePose { .. })),
        ("poses", |s| s.poses.clear(), |e| *e == RenderError::PoseCount { expected: 1, found: 0 }),
        ("samples", |s| s.cfg.samples = 3, |e| *e == RenderError::Samples { samples: 3 }),
        (
            "bounces",
            |s| s.renderer = Renderer::RayTraced { samples: 1, max_bounces: 65, denoise: false, seed: 0 },
            |e| *e == RenderError::Bounces { max_bounces: 65, limit: 64 },
        ),
    ];
    for (what, change, expected) in rows {
        let error = good.with(change).try_draw().unwrap_err();
        assert!(expected(&error), "{what}: {error}");
    }
    for samples in [0, 1 << 17] {
        let error = good.with(|still| still.renderer = paths(samples, 1)).try_draw().unwrap_err();
        assert_eq!(error, RenderError::Paths { samples, limit: Renderer::MAX_SAMPLES });
        assert_eq!(error.to_string(), format!("invalid number of paths per pixel: {samples}; it must be 1 to 65536"));
    }
    let mut short = vec![0.0; 5];
    let mut frame = FrameMut { depth: Some(&mut short), ..FrameMut::default() };
    let error = ImageRenderer::default().render_request(&good.request(), &mut frame).unwrap_err();
    assert_eq!(error.to_string(), "the depth buffer has 5 elements; the image needs 768");
    assert_eq!(View::look_at([8, 8], 1.0, [1.; 3], [1.; 3], [0., 0., 1.]), Err(RenderError::LookAt));
}

#[test]
fn invalid_scenes() {
    let with = |shape: Shape, id| RenderScene::new(vec![Instance::new(shape, Material::default(), id)]);
    assert!(matches!(with(Sphere { radius: 1.0 }.into(), 0), Err(RenderSceneError::ZeroMaskId { instance: 0 })));
    let error = with(Box { half: [1., 0., 1.] }.into(), 1).unwrap_err();
    assert_eq!(error.to_string(), "instance 0, a box, has a size of 0; sizes must be positive and finite");
}

#[test]
fn odd_scenes() {
    let empty = TestFrame::new((RenderScene::new(vec![]).unwrap(), vec![]), view());
    let empty = TestFrame { previous: Some((vec![], view())), ..empty }.draw();
    assert!(empty.mask().iter().all(|&m| m == 0) && empty.flow().iter().flatten().all(|&x| x == f32::INFINITY));
    let flat = TriMesh::from_triangles(
        vec![[0.; 3], [1., 0., 0.], [2., 0., 0.], [0., 1e30, 0.]],
        vec![[0, 1, 2], [0, 0, 1], [1, 1, 1], [0, 1, 3]],
    );
    for mesh in [TriMesh::default(), flat] {
        of(Mesh { mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)) }).draw();
    }
    // Straight up and down: a plane is visible from above only.
    for z in [2.0, -2.0] {
        let view = look_at_view([16, 16], 1.0, [0., 0., z], [0.; 3]);
        assert!(of(Plane::INFINITE).draw_view(view).mask().iter().all(|&m| m == i32::from(z > 0.0)), "{z}");
        assert!(view.world_from_camera.is_rigid());
    }
}

/// A pane in front of a wall: the color changes with alpha. The other channels contain the pane whatever its alpha,
/// unless that is 0.
#[test]
fn transparency() {
    let view = View { cx: 16.5, cy: 12.5, ..view() };
    let seen = [0.0, 0.4, 0.6, 1.0].map(|alpha| {
        let scene = instances([
            (Box { half: [0.05, 0.3, 0.3] }, Material::from_rgba([0.2, 0.9, 0.2, alpha]), translation(1., 0., 0.33)),
            (Box { half: [0.1, 2.0, 2.0] }, Material::from_rgba([0.9, 0.1, 0.1, 1.0]), PoseF32::IDENTITY),
        ]);
        let image = TestFrame::new(scene, view).draw();
        (image.color()[12 * 32 + 16], image.mask()[12 * 32 + 16])
    });
    assert_eq!(seen.map(|seen| seen.1), [2, 1, 1, 1]);
    assert!(seen.windows(2).all(|pair| pair[0].0[0] > pair[1].0[0] && pair[0].0[1] < pair[1].0[1]), "{seen:?}");
}

#[test]
fn hidden_groups() {
    let thing = |(shape, id)| Instance { group: 2, ..Instance::new(shape, Material::default(), id) };
    let mut instances: Vec<_> = every_shape().into_iter().zip(1..).map(thing).collect();
    instances[1].visible = false;
    instances[0].group = 1;
    let poses = vec![PoseF32::IDENTITY; instances.len()];
    let still = TestFrame::new((RenderScene::new(instances).unwrap(), poses), view());
    let image = TestFrame { cfg: RasterCfg { groups: 1 << 2, ..RasterCfg::default() }, ..still }.draw();
    assert!(!image.mask().contains(&1) && !image.mask().contains(&2) && image.mask().iter().any(|&m| m > 2));
}
