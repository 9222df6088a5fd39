//! Mistakes are typed errors, and change nothing.

use super::super::lens::Lens;
use super::super::{CameraCfg, CameraConvention, CameraError, Channels, Extrinsics, Intrinsics, Placement};
use super::super::{Imperfections, Renderer};
use super::stage::{bits, built, cfg, context, state};
use crate::error::SensorError;
use crate::sensor::{Sensor, SensorCfg};
use crate::visibility::RenderError;
use nalgebra::{Quaternion, UnitQuaternion};
use ndarray::array;
use scene::{Pose, PoseF32};

fn refused(cfg: &CameraCfg) -> SensorError {
    cfg.build(&context(2)).unwrap_err()
}

#[test]
fn configurations_are_checked() {
    use SensorError::Camera;
    for (width, height) in [(0, 32), (48, 0), (usize::MAX, 2), (10_000, 10_000), (1 << 40, 1 << 40)] {
        let error = refused(&CameraCfg { width, height, ..cfg() });
        assert!(matches!(error, Camera(CameraError::View(RenderError::Size { .. }))), "{error}");
    }
    for (near, far) in
        [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (1.0, 1.0), (f64::NAN, 1.0), (0.1, f64::INFINITY), (0.1, 1e300)]
    {
        let error = refused(&CameraCfg { near, far, ..cfg() });
        assert!(matches!(error, Camera(CameraError::View(RenderError::Range { .. }))), "{error}");
    }
    for fx in [0.0, -5.0, f64::NAN, f64::INFINITY] {
        let error = refused(&CameraCfg { intrinsics: Intrinsics::Pixels { fx, fy: 1.0, cx: 0.0, cy: 0.0 }, ..cfg() });
        assert!(matches!(error, Camera(CameraError::Lens { what: "fx", .. })), "{error}");
    }
    let huge = Intrinsics::Pixels { fx: 1e30, fy: 1.0, cx: 0.0, cy: 0.0 };
    assert!(matches!(refused(&CameraCfg { intrinsics: huge, ..cfg() }), Camera(CameraError::View(_))));
    let mut samples = cfg();
    samples.raster.samples = 3;
    assert!(matches!(refused(&samples), Camera(CameraError::View(RenderError::Samples { samples: 3 }))));
    assert_eq!(refused(&CameraCfg { channels: Channels::default(), ..cfg() }), CameraError::NoChannels.into());

    let flow = CameraCfg { channels: Channels { flow: true, ..Channels::NONE }, ..cfg() };
    for past in [
        CameraCfg { latency_steps: 1, ..flow.clone() },
        CameraCfg { history_length: 1, ..flow.clone() },
        CameraCfg { dropout: 0.1, ..flow.clone() },
    ] {
        assert_eq!(refused(&past), CameraError::FlowOfThePast.into());
    }
    let rays = |lens| CameraCfg {
        lens: Lens::from_name(lens).unwrap(),
        renderer: Renderer::FastRayTraced,
        channels: Channels { color: true, depth: true, ..Channels::NONE },
        ..cfg()
    };
    let imperfections = Imperfections { vignetting: Some(Default::default()), ..Default::default() };
    let all_around = CameraCfg { imperfections, ..rays("panorama") };
    assert_eq!(refused(&all_around), CameraError::NoAxis { what: "vignetting", lens: "panorama" }.into());
    let imperfections = Imperfections { holes: Some(Default::default()), ..Default::default() };
    let error = refused(&CameraCfg { imperfections, ..rays("equidistant") });
    let what = "shadows of a projector (holes with a baseline other than 0)";
    assert_eq!(error, CameraError::PinholeOnly { what, lens: "equidistant" }.into());

    let place = |placement| CameraCfg { extrinsics: Extrinsics { placement, ..Default::default() }, ..cfg() };
    let nan = Placement::Pose { pos: [0.0, f64::NAN, 0.0], rotation: UnitQuaternion::identity() };
    assert!(matches!(refused(&place(nan)), Camera(CameraError::Pose { .. })));
    let zero = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 0.0, 0.0));
    let none = Placement::Pose { pos: [0.0; 3], rotation: zero };
    assert!(matches!(refused(&place(none)), Camera(CameraError::Pose { .. })));
    let same = Placement::LookAt { eye: [1.0; 3], target: [1.0; 3], up: [0.0, 0.0, 1.0] };
    assert!(matches!(refused(&place(same)), Camera(CameraError::LookAt { .. })));

    let parent = Extrinsics { parent: Some("tpi".into()), ..Default::default() };
    let error = refused(&CameraCfg { extrinsics: parent, ..cfg() }).to_string();
    assert!(error.starts_with("there is no body \"tpi\"; known are \"arm/tip\""), "{error}");

    let some = |env_ids: &[usize]| refused(&CameraCfg { env_ids: Some(env_ids.to_vec()), ..cfg() });
    assert_eq!(some(&[]), CameraError::NoEnvironments.into());
    assert_eq!(some(&[1, 1]), CameraError::DuplicateEnvironment { env: 1 }.into());
    assert_eq!(some(&[0, 2]), SensorError::IndexOutOfRange { what: "environment", index: 2, count: 2 });
    assert!(matches!(refused(&CameraCfg { update_period: 0.007, ..cfg() }), SensorError::PeriodNotMultiple { .. }));
    assert!(CameraCfg { update_period: 0.007, round_period: true, ..cfg() }.build(&context(2)).is_ok());
    let mut nothing = context(2);
    nothing.scene = None;
    assert_eq!(cfg().build(&nothing).unwrap_err(), CameraError::NoScene.into());
}

#[test]
fn pictures_that_do_not_fit_into_memory_are_refused() {
    let cfg = CameraCfg { width: 8000, height: 8000, ..cfg() };
    let error = cfg.build(&context(100)).unwrap_err();
    let text = "pictures of 100 environments with 8000 x 8000 pixels of 56 bytes do not fit into memory";
    assert!(error.to_string().starts_with(text), "{error}");
    // Path tracing keeps what it found of a picture, and what the smoothing looks at: 64 bytes of a pixel.
    let error = CameraCfg { renderer: Renderer::RAY_TRACED, ..cfg }.build(&context(100)).unwrap_err();
    let text = "pictures of 100 environments with 8000 x 8000 pixels of 56 bytes, with 4096000000 bytes for paths, do";
    assert!(error.to_string().starts_with(text), "{error}");
}

#[test]
fn readings_are_checked() {
    let context = context(2);
    let mut camera = CameraCfg { channels: Channels { depth: true, mask: true, ..Default::default() }, ..cfg() }
        .build(&context)
        .unwrap();
    assert_eq!(camera.depth().unwrap_err(), CameraError::NothingCaptured { env: 0 }.into());
    camera.reset(&[0], &state(&[0, 0])).unwrap();
    let error = camera.depth().unwrap_err().to_string();
    assert_eq!(error, "the camera has not seen environment 1 yet; it does after the first reset or update");
    camera.reset(&[1], &state(&[0, 0])).unwrap();
    camera.depth().unwrap();
    assert_eq!(camera.color().unwrap_err().to_string(), "the camera does not measure color; it measures depth, mask");
    assert_eq!(camera.draws(), 2, "nothing was drawn for the mistake");
    assert!(matches!(camera.point_cloud(2, Default::default()), Err(SensorError::IndexOutOfRange { index: 2, .. })));
}

#[test]
fn states_are_checked() {
    let context = context(2);
    let attached = CameraCfg { extrinsics: Extrinsics { parent: Some("tip".into()), ..Default::default() }, ..cfg() };
    let mut camera = built(&attached, &context);
    let before = bits(&camera, 0..2);
    let refuse = |camera: &mut super::super::Camera, change: &dyn Fn(&mut scene::SceneState)| {
        let mut bad = state(&[1, 1]);
        change(&mut bad);
        camera.update(&bad).unwrap_err().to_string()
    };
    let text = refuse(&mut camera, &|s| s.body_poses = None);
    assert_eq!(text, "the camera sensor was given a state without poses");
    let text = refuse(&mut camera, &|s| s.visible = None);
    assert_eq!(text, "the camera sensor was given a state without visible");
    let text = refuse(&mut camera, &|s| *s = state(&[1, 1, 1]));
    assert_eq!(text, "the state has 3 environments, the sensor was built for 2");
    let text = refuse(&mut camera, &|s| s.visible.as_mut().unwrap().lights = Default::default());
    assert_eq!(text, "the state has 0 environments with lamps, the sensor was built for 2");
    let text = refuse(&mut camera, &|s| s.body_poses = Some(ndarray::Array3::zeros((2, 1, 7))));
    assert_eq!(text, "the state has 1 bodies, the sensor was built for 3");
    assert!(matches!(camera.reset(&[0, 5], &state(&[0, 0])), Err(SensorError::IndexOutOfRange { index: 5, .. })));
    assert!(matches!(camera.refresh(&[5], &state(&[0, 0])), Err(SensorError::IndexOutOfRange { index: 5, .. })));
    assert_eq!((bits(&camera, 0..2), camera.frame_counts().sum()), (before, 0));
}

#[test]
fn an_environment_that_cannot_be_drawn_says_so_until_it_can() {
    let context = context(3);
    let mut camera = built(&CameraCfg { lazy: false, ..cfg() }, &context);
    let mut bad = state(&[1, 1, 1]);
    bad.visible.as_mut().unwrap().instance_poses[(1, 1)] = PoseF32::from_translation([f32::NAN; 3]);
    camera.update(&bad).unwrap();
    let error = camera.depth().unwrap_err();
    let expected = |e: &SensorError| matches!(e, SensorError::Camera(CameraError::Draw { env: 1, .. }));
    assert!(expected(&error), "{error}");
    assert!(camera.color().is_err_and(|e| expected(&e)));
    camera.update(&state(&[1, 2, 1])).unwrap();
    let mut good = built(&cfg(), &context);
    good.update(&state(&[1, 2, 1])).unwrap();
    assert_eq!(bits(&camera, 0..3), bits(&good, 0..3));
}

#[test]
fn setters_change_all_or_nothing() {
    let context = context(3);
    let some = CameraCfg { env_ids: Some(vec![2, 0]), ..cfg() };
    let mut camera = built(&some, &context);
    let before = bits(&camera, 0..2);
    let ros = CameraConvention::Ros;
    let good = Pose::translation(0.0, 0.0, 1.0);
    let broken = Pose::translation(f64::NAN, 0.0, 0.0);
    let mistakes: Vec<Result<(), SensorError>> = vec![
        camera.set_local_pose(&[good, broken], None, ros),
        camera.set_world_poses(&[good, broken], None, ros),
        camera.set_local_pose(&[good; 3], None, ros),
        camera.set_local_pose(&[good; 2], Some(&[0]), ros),
        camera.set_local_pose(&good, Some(&[0, 1]), ros),
        camera.set_local_pose(&good, Some(&[0, 3]), ros),
        camera.set_local_pose(&good, Some(&[0, 0]), ros),
        camera.set_local_pose(&array![[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]], None, ros),
        camera.set_local_pose(&array![[0.0, 0.0, 1.0]], None, ros),
        camera.look_at(&[[1.0; 3]], &[[0.0; 3], [1.0; 3]], &[[0.0, 0.0, 1.0]], None),
        camera.look_at(&[[1.0; 3]], &[], &[[0.0, 0.0, 1.0]], None),
        camera.set_intrinsics(&[Intrinsics::ISAAC, Intrinsics::Fovy { radians: 4.0 }], None),
        camera.set_intrinsics(&[Intrinsics::Pixels { fx: 1e-9, fy: 1.0, cx: 0.0, cy: 0.0 }], None),
        camera.set_intrinsics(&[Intrinsics::ISAAC; 3], None),
        camera.restore(Some(&[1])),
    ];
    let kinds = mistakes.into_iter().map(Result::unwrap_err).collect::<Vec<_>>();
    assert_eq!(kinds[2], CameraError::Count { what: "poses", expected: 2, found: 3 }.into());
    assert_eq!(kinds[4], CameraError::NotSeen { env: 1, seen: vec![2, 0] }.into());
    assert_eq!(kinds[5], SensorError::IndexOutOfRange { what: "environment", index: 3, count: 3 });
    assert_eq!(kinds[6], CameraError::DuplicateEnvironment { env: 0 }.into());
    assert_eq!(kinds[4].to_string(), "the camera does not see environment 1; it sees 2, 0");
    assert_eq!((bits(&camera, 0..2), camera.draws()), (before, 2), "not even drawn again");

    let parent = Extrinsics { parent: Some("ball".into()), ..Default::default() };
    let mut unborn = CameraCfg { extrinsics: parent, ..cfg() }.build(&context).unwrap();
    assert_eq!(unborn.set_world_poses(&good, None, ros), Err(CameraError::NothingCaptured { env: 0 }.into()));
    assert!(unborn.pose_w(ros).iter().all(|x| x.is_nan()));
    unborn.set_local_pose(&good, None, ros).unwrap();
}
