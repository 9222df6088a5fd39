//! MJCF files as parts of a scene: from the compiled model of a file to XML lines of the scene's document.
//!
//! The lines have the values of the compiled model in full precision. MuJoCo has resolved includes, default classes,
//! angle units, local or global coordinates, composite bodies and compiler settings, so they do not affect the rest of
//! the scene. Every name is prefixed by the part's uid and a slash. Geoms and bodies of the file's world are in the
//! scene's world, at the pose of the part. A static body, named by the uid, is the frame of the part.

mod actuators;
mod assets;
mod bodies;
mod constraints;
mod names;
mod robot_overrides;
mod sensors;
mod settings;

pub(crate) use names::PartNames;
pub(crate) use robot_overrides::{PassiveJointProperties, RobotOverrides, RootAttachment};
pub(crate) use sensors::unsupported_sensors as sensors_left_out;
pub(crate) use settings::setting_warnings;

use kinetoscope_mujoco::{Asset, Model, SupportedVersion};
use kinetoscope_scene::Pose;
use kinetoscope_scene::source_location::SourceLocation;
use std::cell::RefCell;
use std::fmt;

/// XML lines of a part for both supported MuJoCo versions.
#[derive(Clone, Debug, PartialEq)]
pub struct PartDocument {
    uid: String,
    v2: PartLines,
    v4: PartLines,
    /// Sensors of the file that are left out for both versions, with their indices.
    omitted_sensors: Vec<(usize, OmittedElement)>,
}

/// XML lines of a part for one MuJoCo version, by section of the document.
#[derive(Clone, Debug, PartialEq)]
pub struct PartLines {
    /// Location of the MJCF file.
    pub source: SourceLocation,
    /// Textures, materials, meshes and height fields.
    pub assets: Vec<String>,
    /// Elements of the scene's world: geoms of the file's world, bodies, and the static body of the part.
    pub bodies: Vec<String>,
    /// Geom pairs with their own contact parameters, and body pairs that never collide.
    pub contacts: Vec<String>,
    /// Equality constraints.
    pub equalities: Vec<String>,
    /// Tendons.
    pub tendons: Vec<String>,
    /// Actuators without an activation.
    pub actuators: Vec<String>,
    /// Actuators with an activation.
    pub stateful_actuators: Vec<String>,
    /// Sensors.
    pub sensors: Vec<String>,
    /// Elements and attributes that are omitted, because the MuJoCo version of these lines does not support them.
    /// Sensors omitted for both versions are not included.
    pub omitted: Vec<OmittedElement>,
}

/// Element or attribute of a file that is left out of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OmittedElement {
    /// Kind of the element, as in MJCF.
    pub element: &'static str,
    /// Name in the file, or a generated name.
    pub name: String,
    /// Omitted property and the reason.
    pub property: String,
}

/// Formatted as `body "arm": gravcomp`.
impl fmt::Display for OmittedElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}: {}", self.element, self.name, self.property)
    }
}

/// Error: an element of an MJCF file cannot be imported into a scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{element} {name:?} cannot be imported into a scene: {what}")]
pub struct PartError {
    /// Kind of the element, as in MJCF.
    pub element: &'static str,
    /// Name in the file, or a generated name (`body3`); the index for an element of a kind without names.
    pub name: String,
    /// Unsupported property.
    pub what: String,
}

/// Compiled MJCF file with the settings that turn it into a part.
#[derive(Clone, Copy, Debug)]
pub struct PartSource<'a> {
    /// Model that MuJoCo compiled from the file.
    pub model: &'a Model,
    /// Names of all elements of the file.
    pub names: &'a PartNames,
    /// Name of the part.
    pub uid: &'a str,
    /// Pose of the file's world in the scene's world.
    pub pose: &'a Pose,
    /// Prefix of the names of the part's asset files.
    pub stem: &'a str,
    /// Changes to the file, for a part that is a robot.
    pub rig: Option<&'a RobotOverrides>,
}

/// Writer of a file as a part, for one MuJoCo version.
struct PartWriter<'a> {
    model: &'a Model,
    names: &'a PartNames,
    uid: &'a str,
    pose: &'a Pose,
    stem: &'a str,
    rig: Option<&'a RobotOverrides>,
    /// MuJoCo version that reads the lines; another version may have compiled the file.
    target: SupportedVersion,
    sensors_left_out: &'a [(usize, OmittedElement)],
    left_out: RefCell<Vec<OmittedElement>>,
}

impl PartDocument {
    /// Converts a file to a part, without the sensors in `omitted_sensors`.
    ///
    /// # Errors
    /// The model has an element that a part cannot represent.
    pub fn new(
        of: &PartSource<'_>,
        omitted_sensors: Vec<(usize, OmittedElement)>,
        source: &SourceLocation,
    ) -> Result<Self, PartError> {
        of.check()?;
        let lines = |target| of.writer(target, &omitted_sensors).lines(source);
        let (v2, v4) = (lines(SupportedVersion::V2)?, lines(SupportedVersion::V4)?);
        Ok(Self { uid: of.uid.into(), v2, v4, omitted_sensors })
    }

    /// Name of the part.
    pub fn uid(&self) -> &str {
        &self.uid
    }

    /// Sensors of the file that the scene does not have, with their indices.
    pub(crate) fn sensors_left_out(&self) -> &[(usize, OmittedElement)] {
        &self.omitted_sensors
    }

    /// Returns the XML lines for a MuJoCo version.
    pub fn lines(&self, target: SupportedVersion) -> &PartLines {
        match target {
            SupportedVersion::V2 => &self.v2,
            SupportedVersion::V4 => &self.v4,
        }
    }
}

impl<'a> PartSource<'a> {
    /// Checks that a part can represent every element of the model.
    ///
    /// # Errors
    /// The model has an element that a part cannot represent.
    pub fn check(&self) -> Result<(), PartError> {
        match self.model.unsupported_feature() {
            None => Ok(()),
            Some(beyond) => {
                let name = self.names.of(beyond.element, beyond.index);
                Err(PartError { element: beyond.element, name, what: beyond.feature.into() })
            }
        }
    }

    /// Returns the asset files of the part as names and bytes: PNG textures, and height fields in MuJoCo's format.
    ///
    /// # Errors
    /// A texture cannot be written.
    pub fn files(&self) -> Result<Vec<Asset>, PartError> {
        self.writer(SupportedVersion::V2, &[]).files()
    }

    fn writer(&self, target: SupportedVersion, sensors_left_out: &'a [(usize, OmittedElement)]) -> PartWriter<'a> {
        let Self { model, names, uid, pose, stem, rig } = *self;
        PartWriter { model, names, uid, pose, stem, rig, target, sensors_left_out, left_out: RefCell::default() }
    }
}

impl PartWriter<'_> {
    fn lines(self, source: &SourceLocation) -> Result<PartLines, PartError> {
        let [actuators, stateful_actuators] = self.actuators()?;
        let lines = PartLines {
            source: source.clone(),
            assets: self.assets(),
            bodies: self.bodies()?,
            contacts: self.contacts(),
            equalities: self.equalities()?,
            tendons: self.tendons()?,
            actuators,
            stateful_actuators,
            sensors: self.sensors()?,
            omitted: Vec::new(),
        };
        Ok(PartLines { omitted: self.left_out.into_inner(), ..lines })
    }

    /// Returns true if the target is MuJoCo 4.x. Otherwise records that the property `what` of an element is left out,
    /// since only models of 4.x have it.
    fn supports_v4(&self, element: &'static str, index: usize, what: &str) -> bool {
        if self.target == SupportedVersion::V2 {
            let (name, property) = (self.names.of(element, index), what.into());
            self.left_out.borrow_mut().push(OmittedElement { element, name, property });
        }
        self.target == SupportedVersion::V4
    }

    /// Name in the scene of an element of the file.
    fn scoped_name(&self, name: &str) -> String {
        format!("{}/{name}", self.uid)
    }

    /// Name in the scene of a body of the file; the file's world is the static body of the part.
    fn body(&self, body: usize) -> String {
        if body == 0 { self.uid.into() } else { self.scoped_name(&self.names.bodies[body]) }
    }

    /// Creates an error about an element of the file.
    fn unsupported(&self, element: &'static str, index: usize, what: impl Into<String>) -> PartError {
        PartError { element, name: self.names.of(element, index), what: what.into() }
    }
}

/// Row `index` of an array with rows of `width`.
fn row<T>(values: &[T], width: usize, index: usize) -> &[T] {
    &values[width * index..width * (index + 1)]
}

/// Row `index` of an array with `count` rows.
fn row_of<T>(values: &[T], count: usize, index: usize) -> &[T] {
    row(values, values.len() / count.max(1), index)
}

/// Converts an index of MuJoCo; `None` for -1, which stands for no object.
fn mj_index(index: i32) -> Option<usize> {
    usize::try_from(index).ok()
}

/// Formats single-precision numbers with the shortest text that reads back to the same values.
fn format_f32s(values: &[f32]) -> String {
    values.iter().map(f32::to_string).collect::<Vec<_>>().join(" ")
}
