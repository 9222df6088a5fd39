//! Comparison with images of MuJoCo's own renderer, made by a Python with MuJoCo 4 (installed by `cargo xtask test
//! --mujoco 4`).
//!
//! Pixels at silhouettes are excluded: pixels whose 3 x 3 neighborhood shows several geoms, or a step or a kink of the
//! depth. The renderers differ in their approximations: MuJoCo tessellates round shapes and quantizes depth in a depth
//! buffer.

use super::view;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::prelude::*;
use kinetoscope::render::frame::Frame;
use kinetoscope::render::{ImageRenderer, RenderRequest};
use kinetoscope::scene::PoseF32;
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::VisualScene;
use kinetoscope_testkit::test_resources::{python_renderer, robot, sample_model};
use kinetoscope_testkit::urdf::TempFiles;
use nalgebra::Vector3;
use std::path::Path;
use std::process::Command;

const SIZE: [usize; 2] = [640, 480];
const FOVY_DEG: f64 = 45.0;

/// Images of a renderer.
struct Images {
    depth: Vec<f32>,
    /// Element number of MuJoCo's renderer (see the script), or -1; the mask id for our renderer.
    ids: Vec<i32>,
    color: Vec<[u8; 3]>,
}

fn mujoco_images(model: &Path, folder: &Path) -> Images {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images/camera/mujoco_renderer.py");
    let [width, height] = SIZE.map(|n| n.to_string());
    let mut command = Command::new(python_renderer());
    command.arg(script).arg(model).args(["judge", &width, &height]).arg(folder);
    // MuJoCo writes its warning log to the working directory.
    let status = command.current_dir(folder).status();
    assert!(status.unwrap().success(), "MuJoCo's renderer did not draw");
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    Images {
        depth: bytes("depth").as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
        ids: bytes("element").as_chunks().0.iter().map(|b| i32::from_le_bytes(*b)).collect(),
        color: bytes("color").as_chunks().0.to_vec(),
    }
}

/// Mask ids of the elements: of geoms by index; of tendons, skins and flexes by class.
struct MaskIds {
    geoms: Vec<i32>,
    deformables: [Vec<i32>; 3],
}

impl MaskIds {
    fn of(&self, element: usize) -> i32 {
        let (multiple, number) = (element / 1_000_000, element % 1_000_000);
        let list = multiple.checked_sub(1).map_or(&self.geoms, |kind| &self.deformables[kind]);
        list[number]
    }
}

/// Our images of the same file, with the mask ids of its elements.
fn our_images(model: &Path, eye: [f64; 3], target: [f64; 3]) -> (Images, MaskIds) {
    let model = mj::compile_file(model).unwrap().into_model();
    let mut data = mj::Data::new(&model).unwrap();
    data.forward().unwrap();
    let visible = VisualScene::of_model(&model);
    let scene = &visible.scene_at(&data);
    let (mut poses, mut lights) = (vec![PoseF32::IDENTITY; scene.instances().len()], scene.lights.clone());
    visible.read_poses(&data, &mut poses, &mut lights);
    let pose = look_at_pose(eye, target, [0.0, 0.0, 1.0]).unwrap();
    let view = view(SIZE, FOVY_DEG.to_radians(), &pose, model.clip_distances());
    let channels = Channels { color: true, depth: true, mask: true, ..Channels::default() };
    let mut frame = Frame::new(SIZE[0], SIZE[1], channels);
    let cfg = RasterCfg { shadows: false, samples: 1, lod: false, ..RasterCfg::default() };
    let request =
        RenderRequest { scene, poses: &poses, view: &view, lights: Some(&lights), lens: None, previous: None };
    ImageRenderer::new(cfg).render_request(&request, &mut frame.as_mut()).unwrap();
    let color = frame.color.unwrap().as_chunks::<4>().0.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
    let images = Images { depth: frame.depth.unwrap(), ids: frame.mask.unwrap(), color };
    let mask_of = |geom: usize| {
        let name = model.name(ObjectKind::Geom, geom).unwrap_or_else(|| format!("geom {geom}"));
        visible.mask_ids().iter().find(|id| id.geoms.contains(&name)).map_or(0, |id| id.id)
    };
    // In MuJoCo's order; the model renders all of them.
    let of_class = |class: &str| visible.mask_ids().iter().filter(|id| id.class == class).map(|id| id.id).collect();
    let deformables = ["tendon", "skin", "flex"].map(of_class);
    (images, MaskIds { geoms: (0..model.ngeom()).map(mask_of).collect(), deformables })
}

/// The MJCF with a camera named "judge" in its world body.
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

/// Colors of one pixel in two images.
type ColorPair = ([f64; 3], [f64; 3]);

/// Agreement of two images of one scene.
#[derive(Debug)]
struct Agreement {
    /// Number of pixels with an object, and of those the number off silhouettes.
    covered: usize,
    compared: usize,
    /// Share of the compared pixels with the same mask and a relative depth difference below [`DEPTH_TOLERANCE`].
    same: f64,
    /// Correlation of the brightness of the compared pixels.
    brightness: f64,
    /// Mean color distance at equal brightness, 0..=1, over the pixels that are not nearly black ([`MIN_BRIGHTNESS`]).
    hue: f64,
}

/// Largest relative difference of depths.
///
/// MuJoCo renders a circle as a polygon of 256 corners, which is up to r (1 - cos(pi / 256)) = 7.5e-5 r inside of the
/// circle: 0.02 mm for the largest shapes here. On a slanted surface the depth error grows by a factor of at most 20,
/// where the neighbors still agree with a plane: 0.4 mm, for depths above 1 m.
const DEPTH_TOLERANCE: f64 = 5e-4;

/// Brightness below which the hue of a pixel is ignored: rounding to integers changes a channel by up to 0.5, which is
/// more than 3 % of the brightness there.
const MIN_BRIGHTNESS: f64 = 16.0;

fn compare(theirs: &Images, ours: &Images, mask_of: &MaskIds) -> Agreement {
    let [width, height] = SIZE;
    let (mut covered, mut compared, mut same) = (0, 0, 0);
    let mut pairs: Vec<ColorPair> = Vec::new();
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let k = y * width + x;
            covered += usize::from(theirs.ids[k] >= 0);
            let around: Vec<usize> =
                [0, 1, 2].iter().flat_map(|r| [0, 1, 2].map(|c| k + r * width + c - width - 1)).collect();
            if !around.iter().all(|&n| theirs.ids[n] == theirs.ids[k]) {
                continue;
            }
            let Ok(element) = usize::try_from(theirs.ids[k]) else {
                compared += 1;
                same += usize::from(ours.ids[k] == 0 && ours.depth[k].is_infinite());
                continue;
            };
            // The inverse depth of a plane is linear in the image.
            let inverse = |n: usize| 1.0 / f64::from(theirs.depth[n]);
            let bend = |a: usize, b: usize| (inverse(a) + inverse(b) - 2.0 * inverse(k)).abs() / inverse(k);
            let bent = (0..4).any(|i| bend(around[i], around[8 - i]) > 2e-3);
            let slope =
                (0..4).map(|i| (inverse(around[i]) - inverse(around[8 - i])).abs() / inverse(k)).fold(0.0, f64::max);
            if bent || slope > 0.05 {
                continue;
            }
            compared += 1;
            let near = (f64::from(ours.depth[k]) / f64::from(theirs.depth[k]) - 1.0).abs() < DEPTH_TOLERANCE;
            same += usize::from(ours.ids[k] == mask_of.of(element) && near);
            pairs.push((theirs.color[k].map(f64::from), ours.color[k].map(f64::from)));
        }
    }
    let luma = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&ColorPair) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (a, b) = (mean(&|p| luma(p.0)), mean(&|p| luma(p.1)));
    let covariance = mean(&|p| (luma(p.0) - a) * (luma(p.1) - b));
    let (va, vb) = (mean(&|p| (luma(p.0) - a).powi(2)), mean(&|p| (luma(p.1) - b).powi(2)));
    let hues = pairs.iter().filter(|p| luma(p.0) >= MIN_BRIGHTNESS && luma(p.1) >= MIN_BRIGHTNESS).map(|p| {
        let [t, o] = [p.0, p.1].map(|c| c.map(|x| x / luma(c)));
        (0..3).map(|i| (t[i] - o[i]).powi(2)).sum::<f64>().sqrt()
    });
    let hues: Vec<f64> = hues.collect();
    assert!(4 * hues.len() > pairs.len(), "a quarter of the pixels is not black: {} of {}", hues.len(), pairs.len());
    let hue = hues.iter().sum::<f64>() / hues.len() as f64;
    Agreement { covered, compared, same: same as f64 / compared as f64, brightness: covariance / (va * vb).sqrt(), hue }
}

/// Checks one scene; `files` holds the assets of the model.
fn check(name: &str, files: &TempFiles, mjcf: &str, eye: [f64; 3], target: [f64; 3]) {
    let file = files.write("judged.xml", with_camera(mjcf, eye, target));
    let theirs = mujoco_images(&file, files.folder());
    let (images, mask_of) = our_images(&file, eye, target);
    let agreement = compare(&theirs, &images, &mask_of);
    println!("{name}: {agreement:?}");
    assert!(agreement.covered > 20_000 && agreement.compared > SIZE[0] * SIZE[1] / 2, "{name}: {agreement:?}");
    assert!(agreement.same >= 0.999, "{name}: {agreement:?}");
    // Lighting differs: our renderer tone-maps highlights, and shades per pixel instead of per vertex. Bright and dark
    // areas and hues must agree.
    assert!(agreement.brightness > 0.97 && agreement.hue < 0.06, "{name}: {agreement:?}");
    let exchanged = Images { color: images.color.iter().map(|&[r, g, b]| [b, r, g]).collect(), ..images };
    let wrong = compare(&theirs, &exchanged, &mask_of);
    assert!(wrong.hue > 1.5 * agreement.hue, "{name}: exchanged colors go unnoticed: {wrong:?}");
    // Control: a camera that looks 5 mm past the target.
    let aside = our_images(&file, eye, [target[0] + 0.005, target[1], target[2] + 0.005]).0;
    let wrong = compare(&theirs, &aside, &mask_of);
    assert!(wrong.same < 0.99, "{name}: a turned camera goes unnoticed: {wrong:?}");
}

#[test]
#[ignore = "needs MuJoCo's own renderer: cargo xtask test --mujoco 4"]
fn humanoid() {
    let mjcf = std::fs::read_to_string(sample_model("humanoid/humanoid.xml")).unwrap();
    check("humanoid", &TempFiles::default(), &mjcf, [2.5, -2.0, 1.8], [0.0, 0.0, 0.9]);
}

/// The vendor's arm with its original meshes, as exported.
#[test]
#[ignore = "needs MuJoCo's own renderer: cargo xtask test --mujoco 4"]
fn arm() {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg::default());
    sim.add_robot(kinetoscope_testkit::worlds::urdf_robot("robot", robot("rokae_description/urdf/SR5.urdf"))).unwrap();
    let files = TempFiles::default();
    sim.dump(files.folder()).unwrap();
    let mjcf = std::fs::read_to_string(files.folder().join("robot.mjcf4.xml")).unwrap();
    check("vendor SR5", &files, &mjcf, [1.5, -1.1, 1.1], [0.1, 0.0, 0.5]);
}

/// Tendons with and without wrapping, and slack ones; a skin over two bones; a cloth, a cable and a solid flex.
const DEFORMING: &str = r#"<mujoco>
  <visual><headlight ambient="0.3 0.3 0.3" diffuse="0.6 0.6 0.6"/></visual>
  <worldbody>
    <geom type="plane" size="3 3 0.1" rgba="0.3 0.5 0.7 1"/>
    <site name="left" pos="-0.8 0 0.6"/><site name="right" pos="0.2 0 0.6"/><site name="above" pos="-0.3 0 2"/>
    <geom name="drum" type="cylinder" size="0.2 0.1" pos="-0.3 0 0.6" zaxis="0 1 0" rgba="0.8 0.7 0.2 1"/>
    <site name="peg" pos="-0.5 0.8 1.2"/><site name="hook" pos="0.5 0.8 1"/>
    <body name="lower" pos="0.9 0 0.2"><geom size="0.05"/>
      <body name="upper" pos="0 0 0.4" euler="0 50 0"><joint type="hinge" axis="0 1 0"/><geom size="0.05"/></body></body>
    <flexcomp name="cloth" type="grid" dim="2" count="6 6 1" spacing="0.15 0.15 0.1" pos="-1 -0.8 0.4" radius="0.02"
      rgba="0.2 0.7 0.3 1" euler="30 20 0" mass="1"><contact selfcollide="none"/></flexcomp>
    <flexcomp name="block" type="grid" dim="3" count="4 4 4" spacing="0.12 0.12 0.12" pos="0.3 -0.8 0.4" radius="0.01"
      rgba="0.7 0.2 0.6 1" euler="10 0 30" mass="1"><contact selfcollide="none"/></flexcomp>
    <flexcomp name="cable" type="grid" dim="1" count="8 1 1" spacing="0.1 0.1 0.1" pos="1 0.7 0.5" radius="0.04"
      rgba="0.9 0.3 0.1 1" mass="1"><contact selfcollide="none"/></flexcomp>
  </worldbody>
  <tendon>
    <spatial width="0.03" rgba="0.9 0.1 0.1 1"><site site="left"/><geom geom="drum" sidesite="above"/><site site="right"/>
    </spatial>
    <spatial width="0.025" limited="true" range="0 1.6" rgba="0.1 0.8 0.8 1"><site site="peg"/><site site="hook"/></spatial>
  </tendon>
  <deformable><skin rgba="0.9 0.8 0.3 1" inflate="0.01"
      vertex="-0.15 -0.15 0  0.15 -0.15 0  0.15 0.15 0  -0.15 0.15 0
        -0.15 -0.15 0.4  0.15 -0.15 0.4  0.15 0.15 0.4  -0.15 0.15 0.4
        -0.15 -0.15 0.8  0.15 -0.15 0.8  0.15 0.15 0.8  -0.15 0.15 0.8"
      face="0 2 1 0 3 2 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7
        4 5 9 4 9 8 5 6 10 5 10 9 6 7 11 6 11 10 7 4 8 7 8 11 8 9 10 8 10 11">
    <bone body="lower" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3 4 5 6 7" vertweight="1 1 1 1 0.5 0.5 0.5 0.5"/>
    <bone body="upper" bindpos="0 0 0.4" bindquat="1 0 0 0" vertid="4 5 6 7 8 9 10 11"
      vertweight="0.5 0.5 0.5 0.5 1 1 1 1"/>
  </skin></deformable></mujoco>"#;

/// Regression: cameras rendered only geoms and sites.
#[test]
#[ignore = "needs MuJoCo's own renderer: cargo xtask test --mujoco 4"]
fn tendons_skins_and_flexes() {
    check("deforming", &TempFiles::default(), DEFORMING, [0.3, -3.0, 2.2], [0.0, 0.0, 0.5]);
}
