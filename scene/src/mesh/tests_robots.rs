//! Tests of the vendors' meshes against values of independent readers.
#![allow(clippy::excessive_precision, reason = "numbers as the reference reader printed them")]

use kinetoscope_testkit::test_resources::{files_below, robots_dir};
use std::path::PathBuf;

use super::{MeshMaterial, TextureSource, TriMesh, load};
use crate::vector::{cross, dot, sub};

/// A small random generator (xorshift64*), so that every run tests the same data.
pub(super) struct TestRng(pub(super) u64);

impl TestRng {
    pub(super) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Uniform number in 0..1.
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// True if a triangle in the plane of x and y is counter-clockwise from above.
pub(super) fn faces_up([a, b, c]: [[f32; 3]; 3]) -> bool {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
}

/// All files of real robots with an extension, sorted.
pub(super) fn files(extension: &str) -> Vec<PathBuf> {
    files_below(&robots_dir(), extension)
}

/// Loads the first of `files` with this name.
pub(super) fn load_of(files: &[PathBuf], name: &str) -> TriMesh {
    load(files.iter().find(|path| path.ends_with(name)).unwrap()).unwrap()
}

/// ANYmal meshes by pycollada: number of triangles with an area, smallest and largest coordinates \[m\].
#[rustfmt::skip]
const ANYMAL: [(&str, usize, [f32; 3], [f32; 3]); 19] = [
    ("base.dae", 4276, [-0.41459, -0.069633, -0.069794], [0.399738, 0.069633, 0.100456]),
    ("battery.dae", 12, [-0.225881, -0.062499, -0.070139], [0.232213, 0.062499, 0.00396]),
    ("bottom_shell.dae", 10295, [-0.413512, -0.159289, -0.104675], [0.41056, 0.159289, -0.000666]),
    ("depth_camera.dae", 12, [0.0, -0.047, -0.019685], [0.0304, 0.047, 0.019519]),
    ("drive.dae", 196, [-0.137298, -0.044999, -0.044999], [0.0, 0.044999, 0.048499]),
    ("face.dae", 6026, [0.0, -0.154447, -0.106692], [0.111279, 0.154452, 0.07284]),
    ("foot.dae", 848, [-0.021354, -0.032066, -0.008909], [0.040682, 0.032062, 0.375379]),
    ("handle.dae", 140, [0.309053, -0.064838, 0.073003], [0.408862, 0.064838, 0.172918]),
    ("hatch.dae", 46, [-0.091616, -0.064712, 0.0], [0.091616, 0.064712, 0.0055]),
    ("hip_l.dae", 256, [0.0, -0.045433, -0.058592], [0.172, 0.04455, 0.066569]),
    ("hip_r.dae", 256, [0.0, -0.04455, -0.058592], [0.172, 0.045433, 0.066569]),
    ("lidar.dae", 232, [-0.051716, -0.051399, -0.037618], [0.05093, 0.051399, 0.035045]),
    ("lidar_cage.dae", 500, [-0.04691, -0.070702, 0.0], [0.053859, 0.070702, 0.174957]),
    ("remote.dae", 310, [-0.243597, -0.048689, 0.072999], [-0.082997, 0.048696, 0.284477]),
    ("shank_l.dae", 1602, [-0.059911, -0.014772, -0.059831], [0.132828, 0.032198, 0.059998]),
    ("shank_r.dae", 1602, [-0.059911, -0.032198, -0.059831], [0.132828, 0.014772, 0.059998]),
    ("thigh.dae", 1848, [-0.069354, -0.035999, -0.354234], [0.069386, 0.065786, 0.062141]),
    ("top_shell.dae", 9543, [-0.308182, -0.158784, 0.006448], [0.310979, 0.159621, 0.123449]),
    ("wide_angle_camera.dae", 148, [-0.02441, -0.019879, -0.033957], [0.003711, 0.019879, 0.019117]),
];

/// File, number of triangles, number of distinct positions.
type Counts = (&'static str, usize, usize);

/// SR5 and Inspire meshes by trimesh: counts, smallest and largest coordinates in units of the files.
#[rustfmt::skip]
const STL: [(Counts, [f32; 3], [f32; 3]); 9] = [
    (("L_hand_base_link.STL", 28960, 14410), [-0.0274, -0.14155, -0.042769], [0.0274, 0.0, 0.038735]),
    (("Link12_L.STL", 18344, 9152), [-0.003698, -0.039029, -0.017698], [0.059723, 0.01111, 0.001698]),
    (("xMateSR5_base.stl", 23964, 11974), [-166.5, -74.990166, 0.0], [74.96067, 100.0, 104.5]),
    (("xMateSR5_link1.stl", 21026, 10515), [-61.285351, -55.195129, -238.0], [61.285351, 58.0, 61.285351]),
    (("xMateSR5_link2.stl", 41718, 20869), [-61.311024, -152.988403, -61.311047], [106.309265, -40.0, 456.309265]),
    (("xMateSR5_link3.stl", 23836, 11920), [-95.45874, -52.5, -55.686096], [55.674435, 51.016697, 203.0]),
    (("xMateSR5_link4.stl", 14966, 7485), [-44.925362, -77.0, -205.0], [44.925362, 70.0, 44.935219]),
    (("xMateSR5_link5.stl", 21896, 10950), [-45.87941, -72.500801, -86.192772], [45.87941, 44.653809, 75.0]),
    (("xMateSR5_link6.stl", 12230, 6117), [-46.363201, -44.0, -34.5], [43.995171, 44.568966, 0.0]),
];

fn assert_bounds(name: &str, mesh: &TriMesh, lo: [f32; 3], hi: [f32; 3]) {
    mesh.validate().unwrap();
    let found = mesh.bounds().unwrap();
    let size = hi.iter().zip(lo).fold(1.0f32, |s, (h, l)| s.max(h - l));
    for (found, expected) in found.0.iter().chain(&found.1).zip(lo.iter().chain(&hi)) {
        assert!((found - expected).abs() < 1e-5 * size, "{name}: {found} instead of {expected}");
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn anymal_by_pycollada() {
    let files = files("dae");
    for (name, triangles, lo, hi) in ANYMAL {
        let mesh = load_of(&files, name);
        assert_eq!(mesh.triangles.len(), triangles, "{name}");
        assert_bounds(name, &mesh, lo, hi);
        assert!(mesh.normals.is_some() && mesh.uvs.is_some());
        // One textured part each, except for the base.
        let Some(TextureSource::File(image)) = &mesh.materials[0].texture else { panic!("{name} has no texture") };
        assert!(image.is_file(), "{}", image.display());
        let parts = if name == "base.dae" { 6 } else { 1 };
        assert_eq!((mesh.materials.len(), mesh.submeshes.len()), (parts, parts));
        // Most normals agree with the winding.
        let normals = mesh.normals.as_ref().unwrap();
        let agree = mesh.triangles.iter().filter(|t| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].map(f64::from));
            dot(cross(sub(b, a), sub(c, a)), normals[t[0] as usize].map(f64::from)) > 0.0
        });
        let share = agree.count() as f64 / triangles as f64;
        assert!(share > 0.9, "{name}: {share}");
    }
    // Six materials in three instances.
    let mesh = load_of(&files, "base.dae");
    let counts: Vec<usize> = mesh.submeshes.iter().map(|p| p.triangles.len()).collect();
    assert_eq!(counts, [234, 329, 2221, 658, 746, 88]);
    let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["base", "LWL", "Black plastic", "E-Stop red", "E-Stop yellow", "E-Stop green"]);
    let MeshMaterial { rgba, texture, .. } = &mesh.materials[5];
    assert_eq!((*rgba, texture), ([0.05232929, 0.1788523, 0.03373989, 1.0], &None));
    let Some(TextureSource::File(path)) = &mesh.materials[0].texture else { panic!("no texture") };
    let image = image::open(path).unwrap();
    assert_eq!((image.width(), image.height()), (2048, 2048));
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_stl_by_trimesh() {
    let files = files("stl");
    for ((name, triangles, vertices), lo, hi) in STL {
        let mesh = load_of(&files, name);
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (triangles, vertices), "{name}");
        assert_bounds(name, &mesh, lo, hi);
    }
}
