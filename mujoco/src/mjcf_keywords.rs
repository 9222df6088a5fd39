//! MJCF keywords of MuJoCo's enum values; `None` for values that the MJCF writer does not support.

use mujoco_sys as mj;

/// Keyword of a code in a list of codes and keywords; `None` if the list does not contain the code.
fn keyword(list: &[(u32, &'static str)], code: i32) -> Option<&'static str> {
    list.iter().find(|(known, _)| *known as i32 == code).map(|(_, word)| *word)
}

/// Keyword of a joint type; `None` for other codes.
pub fn joint(code: i32) -> Option<&'static str> {
    let list =
        [(mj::mjJNT_FREE, "free"), (mj::mjJNT_BALL, "ball"), (mj::mjJNT_SLIDE, "slide"), (mj::mjJNT_HINGE, "hinge")];
    keyword(&list, code)
}

/// Keyword of a geom or site type, and the number of values in its `size` attribute; `None` for other codes.
pub fn geom(code: i32) -> Option<(&'static str, usize)> {
    let list = [
        (mj::mjGEOM_PLANE, "plane", 3),
        (mj::mjGEOM_HFIELD, "hfield", 0),
        (mj::mjGEOM_SPHERE, "sphere", 1),
        (mj::mjGEOM_CAPSULE, "capsule", 2),
        (mj::mjGEOM_ELLIPSOID, "ellipsoid", 3),
        (mj::mjGEOM_CYLINDER, "cylinder", 2),
        (mj::mjGEOM_BOX, "box", 3),
        (mj::mjGEOM_MESH, "mesh", 0),
    ];
    list.into_iter().find(|(known, _, _)| *known as i32 == code).map(|(_, word, sizes)| (word, sizes))
}

/// Keyword of the tracking mode of a camera or light; `None` for other codes.
pub fn tracking_mode(code: i32) -> Option<&'static str> {
    let list = [
        (mj::mjCAMLIGHT_FIXED, "fixed"),
        (mj::mjCAMLIGHT_TRACK, "track"),
        (mj::mjCAMLIGHT_TRACKCOM, "trackcom"),
        (mj::mjCAMLIGHT_TARGETBODY, "targetbody"),
        (mj::mjCAMLIGHT_TARGETBODYCOM, "targetbodycom"),
    ];
    keyword(&list, code)
}

/// Keyword of an equality type; `None` for other codes.
pub fn equality(code: i32) -> Option<&'static str> {
    let list = [
        (mj::mjEQ_CONNECT, "connect"),
        (mj::mjEQ_WELD, "weld"),
        (mj::mjEQ_JOINT, "joint"),
        (mj::mjEQ_TENDON, "tendon"),
    ];
    keyword(&list, code)
}

/// A point of a tendon's path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrapType {
    /// A joint with a coefficient.
    Joint,
    /// A pulley with a divisor.
    Pulley,
    /// A site.
    Site,
    /// A geom that the tendon wraps around, with a side site or -1.
    Geom,
}

/// Type of a point on a tendon's path, from MuJoCo's `wrap_type` code; `None` for other codes. Spheres and cylinders
/// are both [`WrapType::Geom`].
pub fn wrap_type(code: i32) -> Option<WrapType> {
    let list = [
        (mj::mjWRAP_JOINT, WrapType::Joint),
        (mj::mjWRAP_PULLEY, WrapType::Pulley),
        (mj::mjWRAP_SITE, WrapType::Site),
        (mj::mjWRAP_SPHERE, WrapType::Geom),
        (mj::mjWRAP_CYLINDER, WrapType::Geom),
    ];
    list.into_iter().find(|(known, _)| *known as i32 == code).map(|(_, point)| point)
}

/// Attribute that names the target of an actuator's transmission, such as `joint`; `None` for other codes.
pub fn transmission(code: i32) -> Option<&'static str> {
    let list = [
        (mj::mjTRN_JOINT, "joint"),
        (mj::mjTRN_JOINTINPARENT, "jointinparent"),
        (mj::mjTRN_SLIDERCRANK, "cranksite"),
        (mj::mjTRN_TENDON, "tendon"),
        (mj::mjTRN_SITE, "site"),
        (mj::mjTRN_BODY, "body"),
    ];
    keyword(&list, code)
}

/// Keyword of the activation dynamics of an actuator; `None` for other codes.
pub fn dynamics(code: i32) -> Option<&'static str> {
    #[cfg(mj4)]
    if code == mj::mjDYN_FILTEREXACT as i32 {
        return Some("filterexact");
    }
    let list = [
        (mj::mjDYN_NONE, "none"),
        (mj::mjDYN_INTEGRATOR, "integrator"),
        (mj::mjDYN_FILTER, "filter"),
        (mj::mjDYN_MUSCLE, "muscle"),
    ];
    keyword(&list, code)
}

/// Keyword of the gain of an actuator; `None` for other codes.
pub fn gain(code: i32) -> Option<&'static str> {
    let list = [(mj::mjGAIN_FIXED, "fixed"), (mj::mjGAIN_AFFINE, "affine"), (mj::mjGAIN_MUSCLE, "muscle")];
    keyword(&list, code)
}

/// Keyword of the bias of an actuator; `None` for other codes.
pub fn bias(code: i32) -> Option<&'static str> {
    let list = [(mj::mjBIAS_NONE, "none"), (mj::mjBIAS_AFFINE, "affine"), (mj::mjBIAS_MUSCLE, "muscle")];
    keyword(&list, code)
}

/// Keyword of the kind of object that a sensor observes; `None` for other codes. MuJoCo's `body` is the frame at the
/// center of mass, `xbody` the body's own frame.
pub fn object_type(code: i32) -> Option<&'static str> {
    let list = [
        (mj::mjOBJ_BODY, "body"),
        (mj::mjOBJ_XBODY, "xbody"),
        (mj::mjOBJ_GEOM, "geom"),
        (mj::mjOBJ_SITE, "site"),
        (mj::mjOBJ_CAMERA, "camera"),
        (mj::mjOBJ_JOINT, "joint"),
        (mj::mjOBJ_TENDON, "tendon"),
        (mj::mjOBJ_ACTUATOR, "actuator"),
    ];
    keyword(&list, code)
}

/// Form in which MJCF names the object of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorObjectSyntax {
    /// No object.
    None,
    /// An attribute with the name of the object's kind.
    Named,
    /// `objtype` and `objname`, optionally `reftype` and `refname`.
    Frame,
}

/// A type of MuJoCo's own sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorKeyword {
    /// MJCF keyword.
    pub keyword: &'static str,
    /// Form in which MJCF names the object.
    pub object_syntax: SensorObjectSyntax,
    /// Unit of the values, `1` without a dimension; `None` if it depends on the object.
    pub unit: Option<&'static str>,
    /// True if the values are a quaternion w x y z (`ballquat`, `framequat`).
    pub quaternion: bool,
}

/// Keyword, unit and syntax of a type of MuJoCo's own sensors; `None` if it is not supported.
pub fn sensor(code: i32) -> Option<SensorKeyword> {
    use SensorObjectSyntax::{Frame, Named, None as Nothing};
    let list = [
        (mj::mjSENS_TOUCH, "touch", Named, "N"),
        (mj::mjSENS_ACCELEROMETER, "accelerometer", Named, "m/s²"),
        (mj::mjSENS_VELOCIMETER, "velocimeter", Named, "m/s"),
        (mj::mjSENS_GYRO, "gyro", Named, "rad/s"),
        (mj::mjSENS_FORCE, "force", Named, "N"),
        (mj::mjSENS_TORQUE, "torque", Named, "N m"),
        (mj::mjSENS_MAGNETOMETER, "magnetometer", Named, "T"),
        (mj::mjSENS_RANGEFINDER, "rangefinder", Named, "m"),
        (mj::mjSENS_JOINTPOS, "jointpos", Named, ""),
        (mj::mjSENS_JOINTVEL, "jointvel", Named, ""),
        (mj::mjSENS_TENDONPOS, "tendonpos", Named, ""),
        (mj::mjSENS_TENDONVEL, "tendonvel", Named, ""),
        (mj::mjSENS_ACTUATORPOS, "actuatorpos", Named, ""),
        (mj::mjSENS_ACTUATORVEL, "actuatorvel", Named, ""),
        (mj::mjSENS_ACTUATORFRC, "actuatorfrc", Named, ""),
        (mj::mjSENS_BALLQUAT, "ballquat", Named, "1"),
        (mj::mjSENS_BALLANGVEL, "ballangvel", Named, "rad/s"),
        (mj::mjSENS_JOINTLIMITPOS, "jointlimitpos", Named, ""),
        (mj::mjSENS_JOINTLIMITVEL, "jointlimitvel", Named, ""),
        (mj::mjSENS_JOINTLIMITFRC, "jointlimitfrc", Named, ""),
        (mj::mjSENS_TENDONLIMITPOS, "tendonlimitpos", Named, ""),
        (mj::mjSENS_TENDONLIMITVEL, "tendonlimitvel", Named, ""),
        (mj::mjSENS_TENDONLIMITFRC, "tendonlimitfrc", Named, ""),
        (mj::mjSENS_FRAMEPOS, "framepos", Frame, "m"),
        (mj::mjSENS_FRAMEQUAT, "framequat", Frame, "1"),
        (mj::mjSENS_FRAMEXAXIS, "framexaxis", Frame, "1"),
        (mj::mjSENS_FRAMEYAXIS, "frameyaxis", Frame, "1"),
        (mj::mjSENS_FRAMEZAXIS, "framezaxis", Frame, "1"),
        (mj::mjSENS_FRAMELINVEL, "framelinvel", Frame, "m/s"),
        (mj::mjSENS_FRAMEANGVEL, "frameangvel", Frame, "rad/s"),
        (mj::mjSENS_FRAMELINACC, "framelinacc", Frame, "m/s²"),
        (mj::mjSENS_FRAMEANGACC, "frameangacc", Frame, "rad/s²"),
        (mj::mjSENS_SUBTREECOM, "subtreecom", Named, "m"),
        (mj::mjSENS_SUBTREELINVEL, "subtreelinvel", Named, "m/s"),
        (mj::mjSENS_SUBTREEANGMOM, "subtreeangmom", Named, "kg m²/s"),
        (mj::mjSENS_CLOCK, "clock", Nothing, "s"),
        #[cfg(mj4)]
        (mj::mjSENS_JOINTACTFRC, "jointactuatorfrc", Named, ""),
        #[cfg(mj4)]
        (mj::mjSENS_TENDONACTFRC, "tendonactuatorfrc", Named, ""),
        #[cfg(mj4)]
        (mj::mjSENS_E_POTENTIAL, "e_potential", Nothing, "J"),
        #[cfg(mj4)]
        (mj::mjSENS_E_KINETIC, "e_kinetic", Nothing, "J"),
    ];
    list.into_iter().find(|(known, ..)| *known as i32 == code).map(|(_, keyword, object_syntax, unit)| SensorKeyword {
        keyword,
        object_syntax,
        unit: (!unit.is_empty()).then_some(unit),
        quaternion: keyword.ends_with("quat"),
    })
}

/// MJCF keyword of a sensor type that [`sensor`] does not support; `None` for other codes.
pub fn unsupported_sensor(code: i32) -> Option<&'static str> {
    let list = [
        (mj::mjSENS_USER, "user"),
        #[cfg(mj4)]
        (mj::mjSENS_CAMPROJECTION, "camprojection"),
        #[cfg(mj4)]
        (mj::mjSENS_INSIDESITE, "insidesite"),
        #[cfg(mj4)]
        (mj::mjSENS_GEOMDIST, "distance"),
        #[cfg(mj4)]
        (mj::mjSENS_GEOMNORMAL, "normal"),
        #[cfg(mj4)]
        (mj::mjSENS_GEOMFROMTO, "fromto"),
        #[cfg(mj4)]
        (mj::mjSENS_CONTACT, "contact"),
        #[cfg(mj4)]
        (mj::mjSENS_TACTILE, "tactile"),
        #[cfg(mj4)]
        (mj::mjSENS_PLUGIN, "plugin"),
    ];
    keyword(&list, code)
}

/// True if the stage of a sensor ([`Model::sensor_needstage`](crate::Model::sensor_needstage)) is `mjSTAGE_ACC`: it
/// measures accelerations or forces, not only positions and velocities.
pub fn needs_acceleration_stage(stage: i32) -> bool {
    stage == mj::mjSTAGE_ACC as i32
}
