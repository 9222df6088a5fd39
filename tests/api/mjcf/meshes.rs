//! Meshes of a file: where they collide, and where their pictures are.

use super::empty;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{Data, Model, compile_file};

/// A slanted wedge with a picture on it, whose origin is far from its middle.
const WEDGE: &str = "v 0.1 0.1 0.1\nv 0.5 0.1 0.1\nv 0.1 0.4 0.1\nv 0.1 0.1 0.4\nvt 0.1 0.2\nvt 0.9 0.3\nvt 0.4 0.8\nvt 0.7 0.6\n\
                     f 1/1 3/3 2/2\nf 1/1 2/2 4/4\nf 1/1 4/3 3/2\nf 2/1 3/2 4/4\n";

const FILE: &str = r#"<mujoco><asset><mesh name="wedge" file="wedge.obj"/></asset><worldbody>
    <geom type="plane" size="1 1 1"/>
    <body pos="0 0 -0.08"><freejoint/><geom type="mesh" mesh="wedge" density="500"/></body></worldbody></mujoco>"#;

/// Position and texture coordinate of every corner, triangle by triangle, in the frame of its geom's body.
fn corners(model: &Model) -> Vec<([f64; 3], [f32; 2])> {
    let mesh = model.mesh(0);
    let geom = (0..model.ngeom()).find(|&g| model.geom_dataid()[g] == 0).unwrap();
    let (p, q) = (&model.geom_pos()[3 * geom..], &model.geom_quat()[4 * geom..]);
    let pose = kinetoscope::scene::pose::from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]);
    let corner = |(face, texture): (&[i32; 3], &[i32; 3])| {
        [0, 1, 2].map(|k| {
            let at = mesh.positions[face[k] as usize].map(f64::from);
            let at = pose.transform_point(&nalgebra::Point3::from(at));
            ([at.x, at.y, at.z], mesh.texcoords.unwrap()[texture[k] as usize])
        })
    };
    mesh.faces.iter().zip(mesh.face_texcoords).flat_map(corner).collect()
}

#[test]
fn a_mesh_is_where_it_was_and_falls_as_it_did() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("wedge.obj"), WEDGE).unwrap();
    let file = dir.path().join("wedge.xml");
    std::fs::write(&file, FILE).unwrap();
    let alone = compile_file(&file).unwrap().into_model();
    let mut sim = empty(1);
    let part = sim.add_mjcf(MjcfCfg::file("part", &file)).unwrap();
    let (here, there) = (corners(sim.batch().model()), corners(&alone));
    assert_eq!((here.len(), there.len()), (12, 12));
    for ((at, picture), (expected_at, expected_picture)) in here.iter().zip(&there) {
        // Single precision of half a metre: 3e-8; centred once by MuJoCo, once more in the scene.
        assert!(at.iter().zip(expected_at).all(|(a, b)| (a - b).abs() < 2e-7), "{at:?} is not {expected_at:?}");
        assert_eq!(picture, expected_picture);
    }
    assert!(here.iter().any(|(_, picture)| *picture != here[0].1));
    sim.update(200);
    let buffers = sim.batch().read(0, |env| env.data().model().buffers());
    let mut data = Data::new(&alone.with_buffers(buffers)).unwrap();
    (0..200).for_each(|_| data.step().unwrap());
    let qpos = sim.mjcf_part(part).get_qpos();
    // It rests on a face: what its corners differ by, and no more.
    for (a, b) in qpos.iter().zip(data.qpos()) {
        assert!((a - b).abs() < 1e-5, "{qpos} is not {:?}", data.qpos());
    }
    assert!((data.qpos()[2] + 0.08).abs() > 1e-3, "it moved: {:?}", data.qpos());
    assert!(!data.contact().is_empty());
}
