//! MJCF files as parts of a scene: from the model that MuJoCo compiled of the file to lines of the scene's document.
//!
//! What is written is what MuJoCo made of the file, in full precision: includes, default classes, angles, local or global
//! coordinates, composite bodies and the compiler's settings are resolved then, and none of them touches the rest of the
//! scene. Every name gets the part's uid and a slash before it. What stands in the file's world and the bodies of it
//! are in the scene's, moved by the pose of the part; a body that does not move and is called by the uid is its frame.

mod actuators;
mod assets;
mod bodies;
mod constraints;
mod names;
mod rig;
mod sensors;
mod settings;

pub(crate) use names::PartNames;
pub(crate) use rig::{Base, Passive, Rig};
pub(crate) use sensors::left_out as sensors_left_out;
pub(crate) use settings::compare;

use kinetoscope_mujoco::{Asset, Model, Target};
use kinetoscope_scene::Pose;
use kinetoscope_scene::source::Source;
use std::cell::RefCell;
use std::fmt;

/// Lines of a part for both lines of MuJoCo.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfPart {
    uid: String,
    v2: PartLines,
    v4: PartLines,
    /// Sensors of the file that are in neither, by their numbers.
    sensors_left_out: Vec<(usize, LeftOut)>,
}

/// Lines of a part, by the section of the document where they belong.
#[derive(Clone, Debug, PartialEq)]
pub struct PartLines {
    /// The file.
    pub source: Source,
    /// Meshes, height fields, textures, materials.
    pub assets: Vec<String>,
    /// Bodies of the world.
    pub bodies: Vec<String>,
    /// Pairs of geoms with contact parameters, pairs of bodies that never collide.
    pub contacts: Vec<String>,
    /// Equalities.
    pub equalities: Vec<String>,
    /// Tendons.
    pub tendons: Vec<String>,
    /// Actuators without an activation.
    pub actuators: Vec<String>,
    /// Actuators with an activation.
    pub actuators_with_state: Vec<String>,
    /// Sensors.
    pub sensors: Vec<String>,
    /// What these lines do not say of the file, because this line of MuJoCo does not know it.
    pub left_out: Vec<LeftOut>,
}

/// Something of a file that is not written, and that the rest is written without.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The kind of element, as MJCF calls it.
    pub element: &'static str,
    /// Its name in the file, or one made up for it.
    pub name: String,
    /// What of it, and why.
    pub what: String,
}

/// `body "arm": gravcomp`.
impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}: {}", self.element, self.name, self.what)
    }
}

/// Something of a file that cannot be written back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{element} {name:?} has {what}, which a part of a scene cannot have")]
pub struct PartError {
    /// The kind of element, as MJCF calls it.
    pub element: &'static str,
    /// Its name in the file; its number where it has none.
    pub name: String,
    /// What it has.
    pub what: String,
}

/// A file, and how it becomes a part.
#[derive(Clone, Copy, Debug)]
pub struct PartOf<'a> {
    /// What MuJoCo made of it.
    pub model: &'a Model,
    /// Names of everything in it.
    pub names: &'a PartNames,
    /// Name of the part.
    pub uid: &'a str,
    /// Pose of its world in the scene's.
    pub pose: &'a Pose,
    /// Beginning of the names of its files.
    pub stem: &'a str,
    /// What differs from the file, in a part that is a robot.
    pub rig: Option<&'a Rig>,
}

/// A file that is being written as a part.
struct Writing<'a> {
    model: &'a Model,
    names: &'a PartNames,
    uid: &'a str,
    pose: &'a Pose,
    stem: &'a str,
    rig: Option<&'a Rig>,
    /// The line of MuJoCo that is to read it, which need not be the one that compiled the file.
    target: Target,
    sensors_left_out: &'a [(usize, LeftOut)],
    left_out: RefCell<Vec<LeftOut>>,
}

impl MjcfPart {
    /// The part that a file becomes, without the sensors `sensors_left_out`.
    ///
    /// # Errors
    /// Something of the model is not written back.
    pub fn new(of: &PartOf<'_>, sensors_left_out: Vec<(usize, LeftOut)>, source: &Source) -> Result<Self, PartError> {
        of.check()?;
        let lines = |target| of.writing(target, &sensors_left_out).lines(source);
        let (v2, v4) = (lines(Target::V2)?, lines(Target::V4)?);
        Ok(Self { uid: of.uid.into(), v2, v4, sensors_left_out })
    }

    /// Name of the part.
    pub fn uid(&self) -> &str {
        &self.uid
    }

    /// Sensors of the file that a scene has without them, by their numbers.
    pub(crate) fn sensors_left_out(&self) -> &[(usize, LeftOut)] {
        &self.sensors_left_out
    }

    /// The lines for a line of MuJoCo.
    pub fn lines(&self, target: Target) -> &PartLines {
        match target {
            Target::V2 => &self.v2,
            Target::V4 => &self.v4,
        }
    }
}

impl<'a> PartOf<'a> {
    /// Checks that the model has nothing that nobody writes back.
    ///
    /// # Errors
    /// It has.
    pub fn check(&self) -> Result<(), PartError> {
        match self.model.beyond() {
            None => Ok(()),
            Some(beyond) => {
                let name = self.names.of(beyond.element, beyond.index);
                Err(PartError { element: beyond.element, name, what: beyond.what.into() })
            }
        }
    }

    /// The files that the lines of the part name.
    ///
    /// # Errors
    /// A texture cannot be written.
    pub fn files(&self) -> Result<Vec<Asset>, PartError> {
        self.writing(Target::V2, &[]).files()
    }

    fn writing(&self, target: Target, sensors_left_out: &'a [(usize, LeftOut)]) -> Writing<'a> {
        let Self { model, names, uid, pose, stem, rig } = *self;
        Writing { model, names, uid, pose, stem, rig, target, sensors_left_out, left_out: RefCell::default() }
    }
}

impl Writing<'_> {
    fn lines(self, source: &Source) -> Result<PartLines, PartError> {
        let [actuators, actuators_with_state] = self.actuators()?;
        let lines = PartLines {
            source: source.clone(),
            assets: self.assets(),
            bodies: self.bodies()?,
            contacts: self.contacts(),
            equalities: self.equalities()?,
            tendons: self.tendons()?,
            actuators,
            actuators_with_state,
            sensors: self.sensors()?,
            left_out: Vec::new(),
        };
        Ok(PartLines { left_out: self.left_out.into_inner(), ..lines })
    }

    /// Whether 4.x is to read what is written. If not, notes that `what` of something is left out: only models of 4.x have it.
    fn newer(&self, element: &'static str, index: usize, what: &str) -> bool {
        if self.target == Target::V2 {
            let (name, what) = (self.names.of(element, index), what.into());
            self.left_out.borrow_mut().push(LeftOut { element, name, what });
        }
        self.target == Target::V4
    }

    /// Name in the scene of something of the file.
    fn full(&self, name: &str) -> String {
        format!("{}/{name}", self.uid)
    }

    /// Name in the scene of a body of the file; the world is what stands still.
    fn body(&self, body: usize) -> String {
        if body == 0 { self.uid.into() } else { self.full(&self.names.bodies[body]) }
    }

    /// An error about something of the file.
    fn beyond(&self, element: &'static str, index: usize, what: impl Into<String>) -> PartError {
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

/// An index of MuJoCo's, where -1 is none.
fn some(index: i32) -> Option<usize> {
    usize::try_from(index).ok()
}

/// Single precision numbers with the shortest text that reads back as the same.
fn singles(values: &[f32]) -> String {
    values.iter().map(f32::to_string).collect::<Vec<_>>().join(" ")
}
