//! Writing of messages, field by field.

use super::cdr::CdrWriter;
use crate::stream::Distortion;
use kinetoscope_sensors::camera::CameraInfo;

/// Time and frame of a message.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RosHeader<'a> {
    /// Time \[ns\].
    pub(crate) nanos: u64,
    /// The reference frame.
    pub(crate) frame: &'a str,
}

const NANOS: u64 = 1_000_000_000;
/// Log levels of information and warnings.
const INFO: u8 = 20;
const WARN: u8 = 30;
/// Data types of point fields.
const FLOAT32: u8 = 7;
const INT32: u8 = 5;

pub(super) fn time(to: &mut CdrWriter, nanos: u64) {
    to.i32(i32::try_from(nanos / NANOS).unwrap_or(i32::MAX));
    to.u32((nanos % NANOS) as u32);
}

fn header(to: &mut CdrWriter, stamp: RosHeader<'_>) {
    time(to, stamp.nanos);
    to.string(stamp.frame);
}

/// Writes a quaternion `[w, x, y, z]` in ROS's order.
fn quaternion(to: &mut CdrWriter, wxyz: &[f64]) {
    if let [w, x, y, z] = wxyz {
        to.f64s(&[*x, *y, *z, *w]);
    }
}

/// `sensor_msgs/msg/JointState`: `rows` are positions, velocities and efforts, concatenated.
pub(crate) fn joint_state(to: &mut CdrWriter, stamp: RosHeader<'_>, names: &[String], rows: &[f64]) {
    header(to, stamp);
    to.length(names.len());
    names.iter().for_each(|name| to.string(name));
    // Three lists, even without joints.
    let count = names.len();
    (0..3).for_each(|k| to.f64_sequence(rows.get(k * count..(k + 1) * count).unwrap_or(&[])));
}

/// `tf2_msgs/msg/TFMessage`: poses `[x, y, z, qw, qx, qy, qz]` of `frames`, with `prefix` added to their names.
pub(crate) fn transforms(to: &mut CdrWriter, stamp: RosHeader<'_>, prefix: &str, frames: &[String], poses: &[f64]) {
    to.length(frames.len());
    for (frame, pose) in frames.iter().zip(poses.chunks_exact(7)) {
        header(to, stamp);
        to.string(&format!("{prefix}{frame}"));
        to.f64s(&pose[..3]);
        quaternion(to, &pose[3..]);
    }
}

/// `sensor_msgs/msg/CompressedImage` of a PNG file.
pub(crate) fn compressed_image(to: &mut CdrWriter, stamp: RosHeader<'_>, png: &[u8]) {
    header(to, stamp);
    to.string("png");
    to.octet_sequence(png);
}

/// `sensor_msgs/msg/Image` with `row_bytes` bytes per row, which `put` appends.
pub(crate) fn image(
    to: &mut CdrWriter,
    stamp: RosHeader<'_>,
    encoding: &str,
    height: usize,
    width: usize,
    row_bytes: usize,
    put: impl FnOnce(&mut Vec<u8>),
) {
    header(to, stamp);
    to.length(height);
    to.length(width);
    to.string(encoding);
    to.u8(0);
    to.length(row_bytes);
    to.octet_sequence_with(height * row_bytes, put);
}

/// `sensor_msgs/msg/CameraInfo`.
///
/// `k` is the 3 x 3 camera matrix, row-major. `r` (3 x 3) and `p` (3 x 4) are the rectification of a camera of a stereo
/// pair. They are empty for a single camera; then R is the identity and P is K. ROS measures pixel coordinates from the
/// center of the first pixel, not from its corner.
pub(crate) fn camera_info(
    to: &mut CdrWriter,
    stamp: RosHeader<'_>,
    height: usize,
    width: usize,
    [k, r, p]: [&[f64]; 3],
    distortion: &Distortion,
) {
    header(to, stamp);
    to.length(height);
    to.length(width);
    to.string(&distortion.model);
    to.f64_sequence(&distortion.coefficients);
    // The principal point is in the third column of the first two rows of K and P.
    let counted = |matrix: &[f64], columns: usize| -> Vec<f64> {
        let at =
            |(i, x): (usize, &f64)| if i == 2 || i == columns + 2 { x - CameraInfo::FIRST_PIXEL_CENTER } else { *x };
        matrix.iter().enumerate().map(at).collect()
    };
    to.f64s(&counted(k, 3));
    const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let alone: Vec<f64> = k.chunks_exact(3).flat_map(|row| [row[0], row[1], row[2], 0.0]).collect();
    let (r, p) = if p.is_empty() { (&IDENTITY[..], &alone[..]) } else { (r, p) };
    to.f64s(r);
    to.f64s(&counted(p, 4));
    // No binning, no region of interest.
    (0..6).for_each(|_| to.u32(0));
    to.u8(0);
}

/// `sensor_msgs/msg/Imu`: orientation w x y z, angular velocity and acceleration in its own axes.
pub(crate) fn imu(to: &mut CdrWriter, stamp: RosHeader<'_>, wxyz: &[f64], angular: &[f64], acceleration: &[f64]) {
    // All zeros: unknown.
    const COVARIANCE: [f64; 9] = [0.0; 9];
    header(to, stamp);
    quaternion(to, wxyz);
    to.f64s(&COVARIANCE);
    to.f64s(angular);
    to.f64s(&COVARIANCE);
    to.f64s(acceleration);
    to.f64s(&COVARIANCE);
}

/// `geometry_msgs/msg/TwistStamped` or `geometry_msgs/msg/AccelStamped`, which have the same fields: linear, then
/// angular.
pub(crate) fn twist_or_accel(to: &mut CdrWriter, stamp: RosHeader<'_>, linear: &[f64], angular: &[f64]) {
    header(to, stamp);
    to.f64s(linear);
    to.f64s(angular);
}

/// Hits of rays: for each ray three coordinates of the point, the distance, three of the normal, and the mask id.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayHits<'a> {
    pub(crate) points: &'a [f64],
    pub(crate) distances: &'a [f64],
    pub(crate) normals: &'a [f64],
    pub(crate) ids: &'a [f64],
}

/// Fields of a point, four bytes each.
const FIELDS: [(&str, u8); 8] = [
    ("x", FLOAT32),
    ("y", FLOAT32),
    ("z", FLOAT32),
    ("distance", FLOAT32),
    ("normal_x", FLOAT32),
    ("normal_y", FLOAT32),
    ("normal_z", FLOAT32),
    ("id", INT32),
];

/// `sensor_msgs/msg/PointCloud2` of the rays that hit a surface.
pub(crate) fn point_cloud(to: &mut CdrWriter, stamp: RosHeader<'_>, hits: RayHits<'_>) {
    let RayHits { points, distances, normals, ids } = hits;
    let rays = points.chunks_exact(3).zip(distances).zip(normals.chunks_exact(3).zip(ids));
    let finite = || rays.clone().filter(|((point, _), _)| point.iter().all(|x| x.is_finite()));
    let (count, size) = (finite().count(), 4 * FIELDS.len());
    header(to, stamp);
    to.u32(1);
    to.length(count);
    to.length(FIELDS.len());
    for (k, (name, kind)) in FIELDS.into_iter().enumerate() {
        to.string(name);
        to.length(4 * k);
        to.u8(kind);
        to.u32(1);
    }
    to.u8(0);
    to.length(size);
    to.length(size * count);
    to.octet_sequence_with(size * count, |bytes| {
        for ((point, distance), (normal, id)) in finite() {
            let floats = point.iter().chain([distance]).chain(normal);
            floats.for_each(|x| bytes.extend_from_slice(&(*x as f32).to_le_bytes()));
            bytes.extend_from_slice(&(*id as i32).to_le_bytes());
        }
    });
    to.u8(1);
}

/// `std_msgs/msg/Float64MultiArray` of a shape.
pub(crate) fn float64_multi_array(to: &mut CdrWriter, label: &str, shape: &[usize], values: &[f64]) {
    to.length(shape.len());
    for (k, length) in shape.iter().enumerate() {
        to.string(label);
        to.length(*length);
        to.length(shape[k..].iter().product());
    }
    to.u32(0);
    to.f64_sequence(values);
}

/// Writes `rcl_interfaces/msg/Log` with the level WARN if `bad`, else INFO.
pub(crate) fn log(to: &mut CdrWriter, nanos: u64, bad: bool, name: &str, message: &str) {
    time(to, nanos);
    to.u8(if bad { WARN } else { INFO });
    to.string(name);
    to.string(message);
    to.string("");
    to.string("");
    to.u32(0);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Root cause: lists were written as often as there were rows of as many numbers as joints. Without joints there
    /// were none, and the message ended before its lists.
    #[test]
    fn no_joints() {
        let of = |names: &[String], rows: &[f64]| {
            let mut cdr = CdrWriter::default();
            cdr.begin();
            joint_state(&mut cdr, RosHeader { nanos: 0, frame: "" }, names, rows);
            cdr.bytes().to_vec()
        };
        // The encoding has four bytes, the time eight, the empty text with its zero and padding to a multiple of four
        // eight, and four counts follow.
        assert_eq!(of(&[], &[]), [&[0, 1, 0, 0][..], &[0; 8], &[1, 0, 0, 0, 0, 0, 0, 0], &[0; 16]].concat());
        // Control: three numbers for one joint.
        let one = of(&["j".into()], &[1.0, 2.0, 3.0]);
        assert!(one.ends_with(&3.0_f64.to_le_bytes()));
    }
}
