//! Our images against those of MuJoCo's own renderer, drawn by a Python with MuJoCo 4
//! (`cargo xtask test --mujoco 4` makes it).
//!
//! Pixels at silhouettes are left out: where the 3 by 3 pixels around one do not all show the same geom, or where depth
//! has a step or a kink among them. The renderers differ in what they round: MuJoCo draws round shapes as polyhedra and
//! pixels through a depth buffer.

use super::view;
use kinetoscope::prelude::*;
use kinetoscope::scene::PoseF32;
use kinetoscope::sensors::camera::{Frame, Rasterizer, Shot, look_at_pose};
use kinetoscope::sim::Visible;
use kinetoscope::sim::mj::{self, ObjectKind};
use kinetoscope_testkit::needs::{python_renderer, robot, sample_model};
use kinetoscope_testkit::urdf::Files;
use nalgebra::Vector3;
use std::path::Path;
use std::process::Command;

const SIZE: [usize; 2] = [640, 480];
const FOVY_DEG: f64 = 45.0;

/// Images of a renderer.
struct Images {
    depth: Vec<f32>,
    /// The geom that MuJoCo's renderer shows, or -1; of ours, the mask.
    ids: Vec<i32>,
    color: Vec<[u8; 3]>,
}

fn theirs(model: &Path, folder: &Path) -> Images {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images/camera/mujoco_renderer.py");
    let [width, height] = SIZE.map(|n| n.to_string());
    let mut command = Command::new(python_renderer());
    let status = command.arg(script).arg(model).args(["judge", &width, &height]).arg(folder).status();
    assert!(status.unwrap().success(), "MuJoCo's renderer did not draw");
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    Images {
        depth: bytes("depth").as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
        ids: bytes("geom").as_chunks().0.iter().map(|b| i32::from_le_bytes(*b)).collect(),
        color: bytes("color").as_chunks().0.to_vec(),
    }
}

/// Ours of the same file, with a table that turns the number of a geom into its mask id.
fn ours(model: &Path, eye: [f64; 3], target: [f64; 3]) -> (Images, Vec<i32>) {
    let model = mj::compile_file(model).unwrap().into_model();
    let mut data = mj::Data::new(&model).unwrap();
    data.forward().unwrap();
    let visible = Visible::of_model(&model);
    let scene = visible.scene();
    let (mut poses, mut lights) = (vec![PoseF32::IDENTITY; scene.instances().len()], scene.lights.clone());
    visible.read(&data, &mut poses, &mut lights);
    let pose = look_at_pose(eye, target, [0.0, 0.0, 1.0]).unwrap();
    let view = view(SIZE, FOVY_DEG.to_radians(), &pose, model.clip());
    let channels = Channels { color: true, depth: true, mask: true, ..Channels::default() };
    let mut frame = Frame::new(SIZE[0], SIZE[1], channels);
    let cfg = RasterCfg { shadows: false, samples: 1, lod: false, ..RasterCfg::default() };
    let shot = Shot { scene, poses: &poses, view: &view, lights: Some(&lights), lens: None, before: None };
    Rasterizer::new(cfg).render_shot(&shot, &mut frame.as_mut()).unwrap();
    let color = frame.color.unwrap().as_chunks::<4>().0.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
    let images = Images { depth: frame.depth.unwrap(), ids: frame.mask.unwrap(), color };
    let mask_of = |geom: usize| {
        let name = model.name(ObjectKind::Geom, geom).unwrap_or_else(|| format!("geom {geom}"));
        visible.ids().iter().find(|id| id.geoms.contains(&name)).map_or(0, |id| id.id)
    };
    (images, (0..model.ngeom()).map(mask_of).collect())
}

/// The MJCF with a camera "judge" in its world.
fn with_camera(mjcf: &str, eye: [f64; 3], target: [f64; 3]) -> String {
    let rotation = look_at_pose(eye, target, [0.0, 0.0, 1.0]).unwrap().rotation;
    // MuJoCo's cameras look along -z, with y up.
    let (right, up) = (rotation * Vector3::x(), rotation * -Vector3::y());
    let words = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let [eye, right, up] = [&eye[..], right.as_slice(), up.as_slice()].map(words);
    let camera = format!("<camera name=\"judge\" pos=\"{eye}\" xyaxes=\"{right} {up}\" fovy=\"{FOVY_DEG}\"/>\n");
    let (world, end) = mjcf.split_at(mjcf.rfind("</worldbody>").unwrap());
    format!("{world}{camera}{end}")
}

/// The colours of a pixel in two images.
type Pair = ([f64; 3], [f64; 3]);

/// How two images of one scene agree.
#[derive(Debug)]
struct Agreement {
    /// Pixels that show something, and those of them that are off silhouettes.
    seen: usize,
    compared: usize,
    /// Share of the compared pixels where masks are the same and depths differ by less than [`DEPTH`] of them.
    same: f64,
    /// Correlation of the brightness of the compared pixels.
    brightness: f64,
    /// Mean distance of their colors when both are made equally bright, 0..=1, of pixels that are not nearly black ([`DARK`]).
    hue: f64,
}

/// MuJoCo draws a circle as a polygon of 256 corners, which is up to r (1 - cos(pi / 256)) = 7.5e-5 r inside of it: 0.02 mm
/// for the largest shapes here. A slanted surface shows it longer, at 20 times at most where the neighbours still agree with
/// a plane: 0.4 mm, of depths above 1 m.
const DEPTH: f64 = 5e-4;

/// Brightness below which a pixel has no hue to compare: rounding to whole numbers moves a channel by up to 0.5, which is more
/// than 3 % of the brightness there.
const DARK: f64 = 16.0;

fn compare(theirs: &Images, ours: &Images, mask_of: &[i32]) -> Agreement {
    let [width, height] = SIZE;
    let (mut seen, mut compared, mut same) = (0, 0, 0);
    let mut pairs: Vec<Pair> = Vec::new();
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let k = y * width + x;
            seen += usize::from(theirs.ids[k] >= 0);
            let around: Vec<usize> =
                [0, 1, 2].iter().flat_map(|r| [0, 1, 2].map(|c| k + r * width + c - width - 1)).collect();
            if !around.iter().all(|&n| theirs.ids[n] == theirs.ids[k]) {
                continue;
            }
            let Ok(geom) = usize::try_from(theirs.ids[k]) else {
                compared += 1;
                same += usize::from(ours.ids[k] == 0 && ours.depth[k].is_infinite());
                continue;
            };
            // Inverse depth of a plane is linear in the image.
            let inverse = |n: usize| 1.0 / f64::from(theirs.depth[n]);
            let bend = |a: usize, b: usize| (inverse(a) + inverse(b) - 2.0 * inverse(k)).abs() / inverse(k);
            let bent = (0..4).any(|i| bend(around[i], around[8 - i]) > 2e-3);
            let slope =
                (0..4).map(|i| (inverse(around[i]) - inverse(around[8 - i])).abs() / inverse(k)).fold(0.0, f64::max);
            if bent || slope > 0.05 {
                continue;
            }
            compared += 1;
            let near = (f64::from(ours.depth[k]) / f64::from(theirs.depth[k]) - 1.0).abs() < DEPTH;
            same += usize::from(ours.ids[k] == mask_of[geom] && near);
            pairs.push((theirs.color[k].map(f64::from), ours.color[k].map(f64::from)));
        }
    }
    let luma = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&Pair) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (a, b) = (mean(&|p| luma(p.0)), mean(&|p| luma(p.1)));
    let covariance = mean(&|p| (luma(p.0) - a) * (luma(p.1) - b));
    let (va, vb) = (mean(&|p| (luma(p.0) - a).powi(2)), mean(&|p| (luma(p.1) - b).powi(2)));
    let hues = pairs.iter().filter(|p| luma(p.0) >= DARK && luma(p.1) >= DARK).map(|p| {
        let [t, o] = [p.0, p.1].map(|c| c.map(|x| x / luma(c)));
        (0..3).map(|i| (t[i] - o[i]).powi(2)).sum::<f64>().sqrt()
    });
    let hues: Vec<f64> = hues.collect();
    assert!(4 * hues.len() > pairs.len(), "a quarter of the pixels is not black: {} of {}", hues.len(), pairs.len());
    let hue = hues.iter().sum::<f64>() / hues.len() as f64;
    Agreement { seen, compared, same: same as f64 / compared as f64, brightness: covariance / (va * vb).sqrt(), hue }
}

/// `files` has what the model refers to.
fn check(name: &str, files: &Files, mjcf: &str, eye: [f64; 3], target: [f64; 3]) {
    let file = files.write("judged.xml", with_camera(mjcf, eye, target));
    let theirs = theirs(&file, files.folder());
    let (images, mask_of) = ours(&file, eye, target);
    let agreement = compare(&theirs, &images, &mask_of);
    println!("{name}: {agreement:?}");
    assert!(agreement.seen > 20_000 && agreement.compared > SIZE[0] * SIZE[1] / 2, "{name}: {agreement:?}");
    assert!(agreement.same >= 0.999, "{name}: {agreement:?}");
    // Light differs: ours bends what is bright, and shades pixels, not vertices. Bright and dark areas and hues must be alike.
    assert!(agreement.brightness > 0.97 && agreement.hue < 0.06, "{name}: {agreement:?}");
    let exchanged = Images { color: images.color.iter().map(|&[r, g, b]| [b, r, g]).collect(), ..images };
    let wrong = compare(&theirs, &exchanged, &mask_of);
    assert!(wrong.hue > 1.5 * agreement.hue, "{name}: exchanged colours go unnoticed: {wrong:?}");
    // The control: a camera that looks 5 mm past the target.
    let aside = ours(&file, eye, [target[0] + 0.005, target[1], target[2] + 0.005]).0;
    let wrong = compare(&theirs, &aside, &mask_of);
    assert!(wrong.same < 0.99, "{name}: a turned camera goes unnoticed: {wrong:?}");
}

#[test]
#[ignore = "needs MuJoCo's own renderer: cargo xtask test --mujoco 4"]
fn humanoid() {
    let mjcf = std::fs::read_to_string(sample_model("humanoid/humanoid.xml")).unwrap();
    check("humanoid", &Files::default(), &mjcf, [2.5, -2.0, 1.8], [0.0, 0.0, 0.9]);
}

/// The vendor's arm with its real meshes, as it is exported.
#[test]
#[ignore = "needs MuJoCo's own renderer: cargo xtask test --mujoco 4"]
fn arm() {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg::default());
    sim.add_robot(kinetoscope_testkit::worlds::urdf_robot("robot", robot("rokae_description/urdf/SR5.urdf"))).unwrap();
    let files = Files::default();
    sim.dump(files.folder()).unwrap();
    let mjcf = std::fs::read_to_string(files.folder().join("robot.mjcf4.xml")).unwrap();
    check("vendor SR5", &files, &mjcf, [1.5, -1.1, 1.1], [0.1, 0.0, 0.5]);
}
