//! Message definitions, in ROS 2's `ros2msg` format.

/// Encoding of messages, and of their definitions.
pub(crate) const ENCODING: &str = "cdr";
pub(crate) const SCHEMA_ENCODING: &str = "ros2msg";

/// Types of recorded messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Schema {
    AccelStamped,
    CameraInfo,
    CompressedImage,
    Float64MultiArray,
    Image,
    Imu,
    JointState,
    Log,
    PointCloud2,
    SceneUpdate,
    TfMessage,
    TwistStamped,
}

const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const VECTOR: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
/// Fields of `Twist` and `Accel`.
const LINEAR_ANGULAR: &str = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n";
const QUATERNION: (&str, &str) = ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
const TRANSFORM: (&str, &str) =
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n");
const TRANSFORM_STAMPED: (&str, &str) = (
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
);
const REGION: (&str, &str) = (
    "sensor_msgs/RegionOfInterest",
    "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
);
const POINT_FIELD: (&str, &str) =
    ("sensor_msgs/PointField", "string name\nuint32 offset\nuint8 datatype\nuint32 count\n");
const LAYOUT: (&str, &str) = ("std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n");
const DIMENSION: (&str, &str) = ("std_msgs/MultiArrayDimension", "string label\nuint32 size\nuint32 stride\n");

/// Type of scene messages, which have no numbers over time.
pub(crate) const SCENE_UPDATE: &str = "foxglove_msgs/msg/SceneUpdate";
/// Nested types of `SceneUpdate`.
const SCENE_TYPES: [(&str, &str); 18] = [
    TIME,
    VECTOR,
    QUATERNION,
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("foxglove_msgs/Color", "float64 r\nfloat64 g\nfloat64 b\nfloat64 a\n"),
    ("foxglove_msgs/KeyValuePair", "string key\nstring value\n"),
    (
        "foxglove_msgs/SceneEntityDeletion",
        "uint8 MATCHING_ID=0\nuint8 ALL=1\nbuiltin_interfaces/Time timestamp\nuint8 type\nstring id\n",
    ),
    (
        "foxglove_msgs/SceneEntity",
        "builtin_interfaces/Time timestamp\nstring frame_id\nstring id\nbuiltin_interfaces/Duration lifetime\n\
         bool frame_locked\nfoxglove_msgs/KeyValuePair[] metadata\nfoxglove_msgs/ArrowPrimitive[] arrows\n\
         foxglove_msgs/CubePrimitive[] cubes\nfoxglove_msgs/SpherePrimitive[] spheres\n\
         foxglove_msgs/CylinderPrimitive[] cylinders\nfoxglove_msgs/LinePrimitive[] lines\n\
         foxglove_msgs/TriangleListPrimitive[] triangles\nfoxglove_msgs/TextPrimitive[] texts\n\
         foxglove_msgs/ModelPrimitive[] models\n",
    ),
    (
        "foxglove_msgs/ArrowPrimitive",
        "geometry_msgs/Pose pose\nfloat64 shaft_length\nfloat64 shaft_diameter\nfloat64 head_length\n\
         float64 head_diameter\nfoxglove_msgs/Color color\n",
    ),
    ("foxglove_msgs/CubePrimitive", "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfoxglove_msgs/Color color\n"),
    (
        "foxglove_msgs/SpherePrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfoxglove_msgs/Color color\n",
    ),
    (
        "foxglove_msgs/CylinderPrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfloat64 bottom_scale\nfloat64 top_scale\n\
         foxglove_msgs/Color color\n",
    ),
    (
        "foxglove_msgs/LinePrimitive",
        "uint8 LINE_STRIP=0\nuint8 LINE_LOOP=1\nuint8 LINE_LIST=2\nuint8 type\ngeometry_msgs/Pose pose\n\
         float64 thickness\nbool scale_invariant\ngeometry_msgs/Point[] points\nfoxglove_msgs/Color color\n\
         foxglove_msgs/Color[] colors\nuint32[] indices\n",
    ),
    (
        "foxglove_msgs/TriangleListPrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Point[] points\nfoxglove_msgs/Color color\n\
         foxglove_msgs/Color[] colors\nuint32[] indices\n",
    ),
    (
        "foxglove_msgs/TextPrimitive",
        "geometry_msgs/Pose pose\nbool billboard\nfloat64 font_size\nbool scale_invariant\n\
         foxglove_msgs/Color color\nstring text\n",
    ),
    (
        "foxglove_msgs/ModelPrimitive",
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nfoxglove_msgs/Color color\nbool override_color\n\
         string url\nstring media_type\nuint8[] data\n",
    ),
];

impl Schema {
    /// Name of the type.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::AccelStamped => "geometry_msgs/msg/AccelStamped",
            Self::CameraInfo => "sensor_msgs/msg/CameraInfo",
            Self::CompressedImage => "sensor_msgs/msg/CompressedImage",
            Self::Float64MultiArray => "std_msgs/msg/Float64MultiArray",
            Self::Image => "sensor_msgs/msg/Image",
            Self::Imu => "sensor_msgs/msg/Imu",
            Self::JointState => "sensor_msgs/msg/JointState",
            Self::Log => "rcl_interfaces/msg/Log",
            Self::PointCloud2 => "sensor_msgs/msg/PointCloud2",
            Self::SceneUpdate => SCENE_UPDATE,
            Self::TfMessage => "tf2_msgs/msg/TFMessage",
            Self::TwistStamped => "geometry_msgs/msg/TwistStamped",
        }
    }

    /// Definition: its fields, then those of the nested types.
    pub(crate) fn text(self) -> String {
        let (own, others): (&str, &[(&str, &str)]) = match self {
            Self::AccelStamped => (
                "std_msgs/Header header\ngeometry_msgs/Accel accel\n",
                &[HEADER, TIME, ("geometry_msgs/Accel", LINEAR_ANGULAR), VECTOR],
            ),
            Self::TwistStamped => (
                "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
                &[HEADER, TIME, ("geometry_msgs/Twist", LINEAR_ANGULAR), VECTOR],
            ),
            Self::CameraInfo => (
                "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n\
                 float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n\
                 sensor_msgs/RegionOfInterest roi\n",
                &[HEADER, TIME, REGION],
            ),
            Self::CompressedImage => ("std_msgs/Header header\nstring format\nuint8[] data\n", &[HEADER, TIME]),
            Self::Float64MultiArray => ("std_msgs/MultiArrayLayout layout\nfloat64[] data\n", &[LAYOUT, DIMENSION]),
            Self::Image => (
                "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n\
                 uint32 step\nuint8[] data\n",
                &[HEADER, TIME],
            ),
            Self::Imu => (
                "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
                 float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n\
                 float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n\
                 float64[9] linear_acceleration_covariance\n",
                &[HEADER, TIME, QUATERNION, VECTOR],
            ),
            Self::JointState => (
                "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
                &[HEADER, TIME],
            ),
            Self::Log => (
                "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n\
                 string function\nuint32 line\n",
                &[TIME],
            ),
            Self::PointCloud2 => (
                "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n\
                 bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
                &[HEADER, TIME, POINT_FIELD],
            ),
            Self::SceneUpdate => {
                ("foxglove_msgs/SceneEntityDeletion[] deletions\nfoxglove_msgs/SceneEntity[] entities\n", &SCENE_TYPES)
            }
            Self::TfMessage => (
                "geometry_msgs/TransformStamped[] transforms\n",
                &[TRANSFORM_STAMPED, HEADER, TIME, TRANSFORM, VECTOR, QUATERNION],
            ),
        };
        let line = "=".repeat(80);
        let other = |(name, fields): &(&str, &str)| format!("{line}\nMSG: {name}\n{fields}");
        std::iter::once(own.to_string()).chain(others.iter().map(other)).collect()
    }
}
