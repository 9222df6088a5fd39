//! When the camera captures and when it draws.

use super::super::{CameraCfg, CameraConvention, Channels, Extrinsics, Intrinsics};
use super::stage::{DT, bits, built, cfg, context, state};
use crate::sensor::{Requires, Sensor, SensorCfg};
use ndarray::{Axis, array};
use scene::Pose;

#[test]
fn it_draws_when_read_once_and_only_what_changed() {
    let context = context(3);
    let mut camera = built(&cfg(), &context);
    assert_eq!(camera.draws(), 0, "nobody looked");
    camera.depth().unwrap();
    camera.color().unwrap();
    camera.point_cloud(1, Default::default()).unwrap();
    assert_eq!(camera.draws(), 3);
    for step in 1..=5 {
        camera.update(&state(&[step; 3])).unwrap();
    }
    assert_eq!((camera.draws(), camera.frame_counts()), (3, array![5, 5, 5].view()));
    camera.color().unwrap();
    assert_eq!(camera.draws(), 6);
    // An environment that stands still is not drawn again.
    camera.update(&state(&[6, 5, 6])).unwrap();
    camera.color().unwrap();
    assert_eq!((camera.draws(), camera.frame_counts()), (8, array![6, 5, 6].view()));
    camera.update(&state(&[6, 5, 6])).unwrap();
    camera.color().unwrap();
    assert_eq!(camera.draws(), 8);
    // A setter makes the environments that it changes be drawn again, of the same instant.
    camera.set_local_pose(&Pose::identity(), Some(&[2]), CameraConvention::World).unwrap();
    camera.set_intrinsics(&[Intrinsics::ISAAC], Some(&[2])).unwrap();
    camera.color().unwrap();
    assert_eq!((camera.draws(), camera.stamps()), (9, array![6.0 * DT, 5.0 * DT, 6.0 * DT].view()));
    camera.set_intrinsics(&[], Some(&[])).unwrap();
    camera.color().unwrap();
    assert_eq!(camera.draws(), 9);
}

#[test]
fn pictures_show_the_instant_of_capture_however_late_they_are_read() {
    let context = context(2);
    let period = CameraCfg { update_period: 0.02, ..cfg() };
    let (mut lazy, mut eager) = (built(&period, &context), built(&CameraCfg { lazy: false, ..period }, &context));
    assert_eq!(eager.draws(), 2);
    let mut due = Vec::new();
    for step in 1..=11 {
        due.push(lazy.due_in(&[step - 1, step - 1]));
        lazy.update(&state(&[step, step])).unwrap();
        eager.update(&state(&[step, step])).unwrap();
    }
    assert_eq!(due, [4, 3, 2, 1, 4, 3, 2, 1, 4, 3, 2]);
    assert_eq!((lazy.draws(), eager.draws()), (0, 6));
    let place = lazy.color().unwrap().as_ptr();
    assert_eq!(bits(&lazy, 0..2), bits(&eager, 0..2));
    assert_eq!((lazy.draws(), eager.draws()), (2, 6));
    assert_eq!(lazy.stamps(), array![8.0 * DT, 8.0 * DT]);
    assert_eq!(lazy.schedule().period_steps(), 4);
    let mut fresh = built(&cfg(), &context);
    fresh.refresh(&[0, 1], &state(&[8, 8])).unwrap();
    assert_eq!(bits(&lazy, 0..2), bits(&fresh, 0..2), "what was seen at step 8");
    lazy.update(&state(&[12, 12])).unwrap();
    assert_eq!(lazy.color().unwrap().as_ptr(), place, "memory stays where it is");
}

#[test]
fn reset_and_refresh_show_the_state_and_count_nothing() {
    let context = context(2);
    let mut camera = built(&CameraCfg { update_period: 0.02, ..cfg() }, &context);
    for step in 1..=6 {
        camera.update(&state(&[step, step])).unwrap();
    }
    assert_eq!(camera.frame_counts(), array![1, 1]);
    let before = bits(&camera, [0]);
    camera.reset(&[1], &state(&[6, 0])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()), (array![1, 0].view(), array![4.0 * DT, 0.0].view()));
    assert_eq!(bits(&camera, [0]), before);
    assert_eq!(bits(&camera, [1]), bits(&built(&cfg(), &context), [1]), "as at step 0");
    camera.refresh(&[0], &state(&[7, 9])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()), (array![1, 0].view(), array![7.0 * DT, 0.0].view()));
    camera.update(&state(&[8, 2])).unwrap();
    camera.update(&state(&[10, 4])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()), (array![2, 1].view(), array![8.0 * DT, 4.0 * DT].view()));
}

#[test]
fn places_stay_over_a_reset_until_they_are_restored() {
    let context = context(2);
    let mut camera = built(&cfg(), &context);
    let configured = camera.local_pose(CameraConvention::OpenGl);
    let moved = scene::pose::from_xyz_rpy([0.0, 0.0, 3.0], [0.1, 0.2, 0.3]);
    camera.set_local_pose(&[moved, moved], None, CameraConvention::OpenGl).unwrap();
    let there = camera.local_pose(CameraConvention::OpenGl);
    camera.reset(&[0, 1], &state(&[0, 0])).unwrap();
    assert_eq!(camera.local_pose(CameraConvention::OpenGl), there);
    camera.restore(Some(&[1])).unwrap();
    let now = camera.local_pose(CameraConvention::OpenGl);
    assert_eq!((now.row(0), now.row(1)), (there.row(0), configured.row(1)));
}

#[test]
fn some_environments_are_those_of_all() {
    let context = context(4);
    let mut all = built(&cfg(), &context);
    let mut some = built(&CameraCfg { env_ids: Some(vec![3, 1]), ..cfg() }, &context);
    for camera in [&mut all, &mut some] {
        camera.update(&state(&[1, 2, 3, 4])).unwrap();
        camera.reset(&[0, 1], &state(&[1, 2, 3, 4])).unwrap();
    }
    assert_eq!(bits(&some, 0..2), bits(&all, [3, 1]));
    assert_eq!((some.stamps(), some.frame_counts()), (array![4.0 * DT, 2.0 * DT].view(), array![1, 0].view()));
    assert_eq!((some.draws(), some.env_ids()), (2, [3, 1].as_slice()));
    some.set_intrinsics(&[Intrinsics::Fovy { radians: 0.5 }], Some(&[1])).unwrap();
    all.set_intrinsics(&[Intrinsics::Fovy { radians: 0.5 }], Some(&[1])).unwrap();
    assert_eq!(bits(&some, 0..2), bits(&all, [3, 1]));
    let alone = built(&CameraCfg { env_ids: Some(vec![2]), ..cfg() }, &context);
    assert_eq!(bits(&alone, [0]), bits(&built(&cfg(), &context), [2]), "alone or among others");
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut context = context(5);
    let pictures: Vec<Vec<u32>> = (0..4)
        .map(|threads| {
            context.threads = threads;
            let mut camera = built(&cfg(), &context);
            camera.update(&state(&[1, 2, 3, 4, 5])).unwrap();
            bits(&camera, 0..5)
        })
        .collect();
    assert!(pictures.iter().all(|other| *other == pictures[0]));
}

#[test]
fn readers_on_several_threads_see_one_drawing() {
    let context = context(2);
    let camera = built(&cfg(), &context);
    std::thread::scope(|scope| {
        let readers: Vec<_> = (0..4).map(|_| scope.spawn(|| camera.depth().unwrap().sum().to_bits())).collect();
        let sums: Vec<u32> = readers.into_iter().map(|reader| reader.join().unwrap()).collect();
        assert!(sums.iter().all(|sum| *sum == sums[0]));
    });
    assert_eq!(camera.draws(), 2);
}

#[test]
fn it_asks_for_no_more_than_it_needs() {
    assert_eq!(cfg().requires(), Requires::VISIBLE);
    let attached = CameraCfg { extrinsics: Extrinsics { parent: Some("tip".into()), ..Default::default() }, ..cfg() };
    assert_eq!(attached.requires(), Requires::VISIBLE | Requires::POSES);
    let mut context = context(1);
    context.bodies = Vec::new().into();
    let mut bare = state(&[0]);
    bare.body_poses = None;
    let mut free = cfg().build(&context).unwrap();
    free.reset(&[0], &bare).unwrap();
    free.color().unwrap();
}

#[test]
fn hidden_groups_are_not_drawn() {
    let mut context = context(1);
    let scene = context.scene.as_ref().unwrap();
    let mut instances = scene.instances().to_vec();
    instances[1].group = 3;
    context.scene = Some(scene::RenderScene::new(instances).unwrap().into());
    let hidden = built(&cfg(), &context);
    assert!(hidden.mask().unwrap().iter().all(|&id| id != super::stage::BALL));
    let mut everything = cfg();
    everything.raster.groups = u32::MAX;
    assert!(built(&everything, &context).mask().unwrap().iter().any(|&id| id == super::stage::BALL));
}

#[test]
fn lamps_are_those_of_the_environment() {
    let context = context(2);
    let mut state = state(&[0, 0]);
    let visible = state.visible.as_mut().unwrap();
    visible.instance_poses[(1, 1)] = visible.instance_poses[(0, 1)];
    let mut camera = built(&cfg(), &context);
    let same = |camera: &super::super::Camera| {
        let color = camera.color().unwrap();
        color.index_axis(Axis(0), 0) == color.index_axis(Axis(0), 1)
    };
    camera.refresh(&[0, 1], &state).unwrap();
    assert!(!same(&camera), "the lamps shine differently");
    let visible = state.visible.as_mut().unwrap();
    visible.lights[(1, 0)] = visible.lights[(0, 0)];
    camera.refresh(&[0, 1], &state).unwrap();
    assert!(same(&camera));
}

#[test]
fn channels_have_other_names() {
    let wanted = Channels { color: true, depth: true, distance: true, mask: true, normal: true, ..Channels::default() };
    let names = ["rgb", "distance_to_image_plane", "distance_to_camera", "semantic_segmentation", "normals"];
    assert_eq!(Channels::from_names(&names).unwrap(), wanted);
    assert_eq!(Channels::from_names(Channels::NAMES).unwrap(), Channels::ALL);
    assert_eq!(
        Channels::from_names(&["rgba".to_string(), "instance_segmentation".into()]).unwrap().names(),
        ["color", "mask"]
    );
    assert_eq!(Channels::from_names::<&str>(&[]).unwrap(), Channels::default());
    let error = Channels::from_names(&["depth", "distance_to_image"]).unwrap_err().to_string();
    assert!(error.starts_with("there is no channel \"distance_to_image\"; known are \"distance_to_"), "{error}");
    assert!(Channels::from_names(&["RGB"]).unwrap_err().to_string().contains("\"rgb\""));
    assert_eq!(Channels::ALL.bytes_per_pixel(), 4 + 4 + 4 + 4 + 12 + 12 + 12 + 4 + 8);
}
