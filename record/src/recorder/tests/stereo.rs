//! Recorded calibration of stereo cameras.

use super::*;
use crate::{FieldSelector, Recording};
use kinetoscope_sensors::camera::StereoCameraCfg;
use kinetoscope_sensors::camera::{CameraPlacement, StereoCamera};

/// A stereo pair of small cameras, the right one toed in and rotated.
fn toed_in(left_to_right_pos: [f64; 3]) -> StereoCameraCfg {
    let camera = CameraCfg {
        width: 16,
        height: 12,
        intrinsics: Intrinsics::Pixels { fx: 20.0, fy: 21.0, cx: 8.5, cy: 5.5 },
        channels: Channels { depth: true, ..Channels::default() },
        ..CameraCfg::default()
    };
    let left_to_right_rot = kinetoscope_scene::pose::from_xyz_rpy([0.0; 3], [0.02, -0.1, 0.03]).rotation;
    StereoCameraCfg { camera, left_to_right_pos, left_to_right_rot, ..StereoCameraCfg::default() }
}

/// Root cause: R and P were computed from the baseline alone, which was zero for pairs that are not parallel.
#[test]
fn calibrations() {
    let folder = tempfile::tempdir().unwrap();
    let (archive, messages) = (folder.path().join("run.npz"), folder.path().join("run.mcap"));
    let mut sim = falling(2);
    let id: SensorId<StereoCamera> = sim.add_sensor("eyes", toed_in([0.1, 0.01, -0.02])).unwrap();
    let recorders = [&archive, &messages].map(|path| sim.record(RecorderCfg::new(path)).unwrap());
    sim.update(1);
    // Changes the intrinsics in this environment only.
    let wide = [Intrinsics::Pixels { fx: 15.0, fy: 14.0, cx: 7.0, cy: 6.0 }];
    sim.sensor_mut(id).unwrap().set_intrinsics(&wide, Some(&[1])).unwrap();
    sim.update(1);
    let expected = [0, 1].map(|env| sim.sensor(id).unwrap().camera_info("eyes", env).unwrap());
    for recorder in recorders {
        assert!(sim.finish_recording(recorder).unwrap().left_out.iter().all(|what| !what.contains("camera_info")));
    }
    assert_ne!(expected[0], expected[1]);
    let recording = Recording::open(&messages).unwrap();
    for (k, eye) in ["left", "right"].into_iter().enumerate() {
        for (env, infos) in expected.iter().enumerate() {
            let (r, p) = (infos[k].rectification_matrix.transpose(), infos[k].projection_matrix.transpose());
            let topic = format!("/env_{env}/eyes/{eye}/camera_info");
            let read = |field: &str, count: usize| -> Vec<f64> {
                let wanted: Vec<FieldSelector> =
                    (0..count).map(|i| FieldSelector::new(&topic, format!("{field}[{i}]"))).collect();
                let last = |samples: &crate::TimeSeries| *samples.values.last().unwrap();
                recording.time_series(&wanted).unwrap().iter().map(last).collect()
            };
            assert_eq!((read("r", 9), read("p", 12)), (r.as_slice().to_vec(), p.as_slice().to_vec()), "{topic}");
        }
        // Archives use the pixel coordinates of cameras.
        let [r, p] =
            ["rectification", "projection"].map(|part| numbers_of(&archive, &format!("eyes/{eye}/lens/{part}")));
        let (last_r, last_p) = (&r[r.len() - 9..], &p[p.len() - 12..]);
        let found = sim.sensor(id).unwrap().rectification(1).unwrap();
        assert_eq!(last_r, found.rotations[k].transpose().as_slice());
        assert_eq!(last_p, found.projections[k].transpose().as_slice());
    }
    // Control: baseline and rotation are in the matrices.
    assert!(
        expected[1][1].projection_matrix[(0, 3)] < -1.0 && expected[1][1].rectification_matrix[(0, 2)].abs() > 0.01
    );
}

/// A pair that cannot be rectified is recorded as two single cameras.
#[test]
fn no_rectification() {
    let (_folder, path) = scratch("run.mcap");
    let mut sim = falling(1);
    sim.add_sensor("eyes", toed_in([-0.1, 0.0, 0.0])).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(1);
    let left_out = sim.finish_recording(recorder).unwrap().left_out;
    for eye in ["left", "right"] {
        let said = format!("R and P of eyes/{eye}/camera_info (this stereo camera cannot be rectified: the x offset");
        assert!(left_out.iter().any(|what| what.starts_with(&said)), "{left_out:?}");
    }
    let recording = Recording::open(&path).unwrap();
    let wanted =
        ["r[0]", "p[0]", "p[2]", "p[3]"].map(|field| FieldSelector::new("/env_0/eyes/right/camera_info", field));
    let found: Vec<f64> = recording.time_series(&wanted).unwrap().iter().map(|samples| samples.values[0]).collect();
    assert_eq!(found, [1.0, 20.0, 8.0, 0.0]);
}
