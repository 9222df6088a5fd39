//! Bodies and sites of a file are frames: where MuJoCo says.

use super::{empty, machine};
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, from_xyz_rpy};
use kinetoscope::sim::mj::ObjectKind;
use nalgebra::{Matrix3, UnitQuaternion};

const SITES: [&str; 6] = ["hook", "elbow", "plate.site", "palm", "axle", "inside"];

#[test]
fn sites_are_where_mujoco_has_them() {
    let mut sim = empty(2);
    let pose = from_xyz_rpy([0.3, -0.2, 0.1], [0.1, 0.2, -0.4]);
    let part = sim.add_mjcf(MjcfCfg { init_pose: pose, ..MjcfCfg::text("m", machine()) }).unwrap();
    assert!(sim.diagnostics().iter().any(|d| d.to_string().contains("the site \"plate\" is called as a body")));
    let targets = SITES.iter().map(|site| TargetFrameCfg::of(format!("m/{site}"))).collect();
    let frames = sim.add_sensor("frames", FrameTransformerCfg::from("m/elbow", targets)).unwrap();
    let camera = CameraCfg {
        width: 8,
        height: 8,
        extrinsics: Extrinsics { parent: Some("m/palm".into()), ..Default::default() },
        ..Default::default()
    };
    let camera = sim.add_sensor("camera", camera).unwrap();
    let imu = sim.add_sensor("imu", ImuCfg::on("palm")).unwrap();
    sim.update(120);
    let model = sim.batch().model().clone();
    for env in 0..2 {
        let data = |read: &mut dyn FnMut(&kinetoscope::sim::mj::Data)| sim.batch().read(env, |e| read(e.data()));
        let transformer = sim.sensor(frames).unwrap();
        for (m, site) in SITES.iter().enumerate() {
            let name = format!("m/{}", site.trim_end_matches(".site"));
            let id = model.id(ObjectKind::Site, &name).unwrap();
            let (mut position, mut rotation) = ([0.0; 3], Matrix3::identity());
            data(&mut |data| {
                position.copy_from_slice(&data.site_xpos()[3 * id..3 * id + 3]);
                rotation = Matrix3::from_row_slice(&data.site_xmat()[9 * id..9 * id + 9]);
            });
            let seen = transformer.target_pos_w().index_axis(Axis(0), env).index_axis(Axis(0), m).to_vec();
            // A few operations on numbers of about 1: 1e-14.
            for k in 0..3 {
                assert!((seen[k] - position[k]).abs() < 1e-12, "{site}: {seen:?} is not {position:?}");
            }
            let quat = transformer.target_quat_w().index_axis(Axis(0), env).index_axis(Axis(0), m).to_vec();
            let row = from_row(&[0.0, 0.0, 0.0, quat[0], quat[1], quat[2], quat[3]]);
            let matrix: Matrix3<f64> = row.rotation.to_rotation_matrix().into_inner();
            assert!((matrix - rotation).norm() < 1e-12, "{site}");
            if *site == "palm" {
                let at = sim.sensor(camera).unwrap().pose_w(CameraConvention::World);
                for k in 0..3 {
                    assert!((at[(env, k)] - position[k]).abs() < 1e-12, "the camera stands on the site");
                }
                // Without a placement of its own it looks along the site's z axis.
                let axes = sim.sensor(camera).unwrap().pose_w(CameraConvention::Ros);
                let axes = from_row(&std::array::from_fn(|k| axes[(env, k)])).rotation.to_rotation_matrix();
                assert!((axes.into_inner() - rotation).norm() < 1e-12, "and is turned as the site");
                let handle = sim.mjcf_part(part).site_pose("palm").unwrap();
                assert!((0..3).all(|k| (handle[(env, k)] - position[k]).abs() < 1e-12));
            }
        }
        assert_ne!(transformer.target_pos_w()[(env, 1, 0)], transformer.target_pos_w()[(env, 3, 0)]);
    }
    // Another site is another place, and turned: the comparison above can fail.
    let rows = sim.mjcf_part(part).site_pose("hook").unwrap();
    let hook = from_row(&std::array::from_fn(|k| rows[(0, k)]));
    assert!(hook.rotation.angle_to(&UnitQuaternion::identity()) > 0.1);
    let expected = pose.transform_point(&nalgebra::Point3::new(0.1, -0.2, 0.9));
    assert!((hook.translation.vector - expected.coords).norm() < 1e-12);
    assert!(sim.sensor(imu).unwrap().ang_vel_b().iter().any(|w| w.abs() > 1e-3), "it is read");
}

/// A site, and a body that no joint moves, are moved by the body that has one.
#[test]
fn what_is_welded_is_carried() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    for (link, carrier) in [("m/elbow", "m/arm"), ("m/plate", "m/arm"), ("m/plate.site", "m/arm"), ("m/palm", "m/hand")]
    {
        let cfg = JointWrenchCfg { links: vec![link.into()], ..Default::default() };
        let error = sim.add_sensor("w", cfg).unwrap_err().to_string();
        assert!(error.contains(link) && error.contains(carrier), "{error}");
    }
    assert!(sim.add_sensor("w", JointWrenchCfg { links: vec!["m/arm".into()], ..Default::default() }).is_ok());
    let unknown = FrameTransformerCfg::from("m/elbwo", vec![]);
    let error = sim.add_sensor("f", unknown).unwrap_err().to_string();
    assert!(error.contains("known are \"m/elbow\""), "{error}");
}
