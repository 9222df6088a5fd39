//! Scenes as TOML or YAML files, read strictly: a key that nobody knows is an error that names its line.

use super::entity::EntityCfg;
use super::types::EntityTypes;
use super::value::{Value, ValueError};
use super::yaml;
use super::{ExclusionCfg, SceneCfg, in_every_env};
use crate::error::{Error, Result};
use crate::objects::robot_file::MjcfFile;
use crate::objects::shape::ObjectShape;
use crate::pattern::closest;
use crate::simulation_cfg::SimulationManagerCfg;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::source::Source;
use kinetoscope_scene::yaml::{YamlError, parse};
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What a file may hold at its top.
const SECTIONS: [&str; 3] = ["simulation", "entities", EXCLUSIONS];

/// Key of the pairs that never collide.
const EXCLUSIONS: &str = "exclude_collisions";

/// Makes a set of defaults.
type Preset = fn() -> SimulationManagerCfg;

/// Sets of defaults by the name that files give them.
const PRESETS: [(&str, Preset); 3] = [
    ("default", SimulationManagerCfg::default),
    ("manipulation", SimulationManagerCfg::manipulation),
    ("legged", SimulationManagerCfg::legged),
];

impl SceneCfg {
    /// Reads a scene file with the built-in kinds of entities: YAML where its name ends in `.yaml` or `.yml`, JSON, which is
    /// YAML too, where it ends in `.json`, TOML otherwise.
    ///
    /// # Errors
    /// As [`from_toml`](Self::from_toml) and [`from_yaml`](Self::from_yaml), and where the file cannot be read.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self> {
        Self::from_file_with(path, &EntityTypes::default())
    }

    /// Reads a scene file with kinds of entities of your own.
    ///
    /// # Errors
    /// As [`from_file`](Self::from_file).
    pub fn from_file_with(path: impl AsRef<Path>, types: &EntityTypes) -> Result<Self> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|error| Error::File { path: path.into(), error })?;
        let yaml = ["yaml", "yml", "json"];
        let is_yaml = path.extension().is_some_and(|end| yaml.iter().any(|yaml| end.eq_ignore_ascii_case(yaml)));
        if is_yaml { Self::from_yaml(&text, path, types) } else { Self::from_toml(&text, path, types) }
    }

    /// Reads the text of a scene file; paths in it are relative to the folder of `file`, which need not exist.
    ///
    /// # Errors
    /// [`Error::SceneFile`] with file and line: no TOML, a key or a type that nobody knows (with those there are), a value of
    /// another form, a terrain that its generator refuses. All other numbers and names are checked when the scene is built.
    pub fn from_toml(text: &str, file: impl AsRef<Path>, types: &EntityTypes) -> Result<Self> {
        let reader = Reader { text: Some(text), file: file.as_ref(), types };
        let root = DeTable::parse(text).map_err(|e| reader.located(&e, 0..0))?;
        reader.scene(root.into_inner())
    }

    /// As [`from_toml`](Self::from_toml), of YAML 1.2: the same tables and lists, in the same words.
    ///
    /// # Errors
    /// As [`from_toml`](Self::from_toml); several documents, tags, and `null`, too.
    pub fn from_yaml(text: &str, file: impl AsRef<Path>, types: &EntityTypes) -> Result<Self> {
        let reader = Reader { text: None, file: file.as_ref(), types };
        let wrong = |error: YamlError| reader.at(error.line..error.line, error.message);
        let root = parse(text, &yaml::DIALECT).map_err(wrong)?;
        reader.scene(yaml::table(root.as_ref()).map_err(wrong)?)
    }

    /// The text of a scene file that declares this scene, with the kinds of entities of `types`. Paths are written as they
    /// are.
    ///
    /// # Errors
    /// [`Error::SceneFileWrite`]: a sensor of a kind that `types` has not, or a value that TOML has not (a seed above
    /// 2^63 - 1, a path that is no Unicode).
    pub fn to_toml(&self, types: &EntityTypes) -> Result<String> {
        let fail = |what: &str, reason: String| Error::SceneFileWrite { what: what.into(), reason };
        let simulation = toml::Table::try_from(&self.simulation);
        let mut scene = toml::Table::new();
        scene.insert("simulation".into(), simulation.map_err(|e| fail("simulation", e.to_string()))?.into());
        let mut entities = toml::Table::new();
        for (name, entity) in &self.entities {
            let name = in_every_env(name);
            let (kind, table) = types.write(entity).ok_or_else(|| {
                let known: Vec<&str> = types.names().collect();
                fail(name, format!("its kind is none of {}; add it with EntityTypes::with_sensor", known.join(", ")))
            })?;
            let mut written = toml::Table::new();
            written.insert("type".into(), kind.into());
            // The name says it.
            let fields =
                table.map_err(|e| fail(name, e.to_string()))?.into_iter().filter(|(key, _)| !has_name(entity, key));
            written.extend(fields);
            if entities.insert(name.into(), written.into()).is_some() {
                return Err(Error::DuplicateUid(name.into()));
            }
        }
        scene.insert("entities".into(), entities.into());
        if !self.exclusions.is_empty() {
            let pair = |exclusion: &ExclusionCfg| toml::Value::from(exclusion.between.to_vec());
            scene.insert(EXCLUSIONS.into(), self.exclusions.iter().map(pair).collect::<Vec<_>>().into());
        }
        toml::to_string(&scene).map_err(|e| fail("the scene", e.to_string()))
    }
}

/// Whether a field of an entity is its name, which files give as the key of its table.
fn has_name(entity: &EntityCfg, field: &str) -> bool {
    field == "uid" && !matches!(entity, EntityCfg::Sensor(_))
}

/// One file that is being read.
struct Reader<'a> {
    /// The text that spans are places of; `None` where spans are lines, as of YAML.
    text: Option<&'a str>,
    file: &'a Path,
    types: &'a EntityTypes,
}

impl<'a> Reader<'a> {
    fn scene(&self, root: DeTable<'a>) -> Result<SceneCfg> {
        let mut scene = SceneCfg::default();
        for (key, value) in root {
            match key.get_ref().as_ref() {
                "simulation" => scene.simulation = self.simulation(value)?,
                "entities" => {
                    let (table, _) = self.table(value, "entities")?;
                    for (name, entity) in table {
                        let entity = self.entity(name.get_ref(), entity, name.span())?;
                        let source = Source::new(self.file, self.line(name.span()));
                        scene.sources.insert(in_every_env(name.get_ref()).to_owned(), source);
                        scene.entities.push((name.into_inner().into_owned(), entity));
                    }
                }
                EXCLUSIONS => scene.exclusions = self.exclusions(value)?,
                other => {
                    let known = closest(other, SECTIONS).join("`, `");
                    return Err(self.at(key.span(), format!("unknown key `{other}`, expected one of `{known}`")));
                }
            }
        }
        Ok(scene)
    }

    /// The simulation: what the table says, on top of a preset.
    fn simulation(&self, value: Spanned<DeValue<'a>>) -> Result<SimulationManagerCfg> {
        let (mut table, span) = self.table(value, "simulation")?;
        let mut defaults = SimulationManagerCfg::default();
        if let Some(preset) = table.remove("preset") {
            let found = PRESETS.iter().find(|(name, _)| preset.get_ref().as_str() == Some(name));
            let (_, make) = found.ok_or_else(|| {
                let names: Vec<&str> = PRESETS.iter().map(|(name, _)| *name).collect();
                self.at(preset.span(), format!("unknown preset, expected one of `{}`", names.join("`, `")))
            })?;
            defaults = make();
        }
        let defaults = toml::to_string(&defaults)
            .map_err(|e| Error::SceneFileWrite { what: "preset".into(), reason: e.to_string() })?;
        let mut merged = DeTable::parse(&defaults).map_err(|e| self.located(&e, span.clone()))?.into_inner();
        for (key, value) in table {
            // A key that is there keeps its old place, which is none in the user's file.
            merged.remove(key.get_ref().as_ref());
            merged.insert(key, value);
        }
        let value = Spanned::new(span.clone(), DeValue::Table(merged));
        SimulationManagerCfg::deserialize(Value(value)).map_err(|e| self.wrong(e, span))
    }

    /// Pairs of names, each with its place.
    fn exclusions(&self, value: Spanned<DeValue<'a>>) -> Result<Vec<ExclusionCfg>> {
        let span = value.span();
        let DeValue::Array(pairs) = value.into_inner() else {
            return Err(self.at(span, format!("`{EXCLUSIONS}` is a list of pairs: [[\"ball\", \"table\"], ...]")));
        };
        let read = |pair: Spanned<DeValue<'a>>| {
            let at = pair.span();
            let source = Source::new(self.file, self.line(at.clone()));
            let between = <[String; 2]>::deserialize(Value(pair)).map_err(|e| self.wrong(e, at))?;
            Ok(ExclusionCfg { between, at: Some(source) })
        };
        pairs.into_iter().map(read).collect()
    }

    /// One entity: its kind reads what is left of the table without `type`.
    fn entity(&self, name: &str, value: Spanned<DeValue<'a>>, at: Range<usize>) -> Result<EntityCfg> {
        let (mut table, span) = self.table(value, name)?;
        let known = || self.types.names().collect::<Vec<_>>().join("`, `");
        let Some(kind) = table.remove("type") else {
            return Err(self.at(at, format!("entity {name:?} has no `type`, expected one of `{}`", known())));
        };
        let found = kind.get_ref().as_str().and_then(|kind| self.types.get(kind)).ok_or_else(|| {
            self.at(kind.span(), format!("entity {name:?} is of an unknown type, expected one of `{}`", known()))
        })?;
        let uid = table.get_key_value("uid").map(|(key, _)| key.span());
        let value = Spanned::new(span, DeValue::Table(table));
        let mut entity = (found.read)(Value(value)).map_err(|e| self.wrong(e, at))?;
        if let Some(uid) = uid.filter(|_| has_name(&entity, "uid")) {
            return Err(self.at(uid, format!("the uid of an entity is its name, {name:?}; leave `uid` out")));
        }
        self.name_and_place(&mut entity, name);
        Ok(entity)
    }

    /// Gives an entity its name, and makes its paths relative to the file.
    fn name_and_place(&self, entity: &mut EntityCfg, name: &str) {
        let uid = in_every_env(name).to_owned();
        match entity {
            EntityCfg::Robot(robot) => {
                robot.uid = uid;
                self.place_urdf(&mut robot.urdf);
                self.place_mjcf(&mut robot.mjcf);
            }
            EntityCfg::Articulation(articulation) => {
                articulation.uid = uid;
                self.place_urdf(&mut articulation.urdf);
                self.place_mjcf(&mut articulation.mjcf);
            }
            EntityCfg::RigidObject(object) => {
                object.uid = uid;
                self.place_shape(&mut object.shape);
            }
            EntityCfg::Group(group) => {
                group.uid = uid;
                group.objects.iter_mut().for_each(|object| self.place_shape(&mut object.shape));
            }
            EntityCfg::Terrain(terrain) => terrain.uid = uid,
            EntityCfg::Mjcf(part) => {
                part.uid = uid;
                part.place_beside(|path| self.beside(path));
            }
            EntityCfg::Weld(weld) => weld.uid = uid,
            EntityCfg::Sensor(_) => {}
        }
    }

    /// Makes the path of a mesh relative to the file.
    fn place_shape(&self, shape: &mut ObjectShape) {
        if let ObjectShape::Mesh { path, .. } = shape {
            *path = self.beside(path);
        }
    }

    /// Makes the paths of URDF files relative to the file.
    fn place_urdf(&self, urdf: &mut UrdfCfg) {
        let components = urdf.components.iter_mut().map(|component| &mut component.urdf);
        for path in components.chain(urdf.packages.values_mut()).chain(urdf.asset_root.as_mut()) {
            *path = self.beside(path);
        }
    }

    /// Makes the path of an MJCF file relative to the file.
    fn place_mjcf(&self, mjcf: &mut Option<MjcfFile>) {
        if let Some(file) = mjcf {
            file.place_beside(|path| self.beside(path));
        }
    }

    /// A path of the file, relative to its folder; an absolute one stays.
    fn beside(&self, path: &Path) -> PathBuf {
        self.file.parent().map_or_else(|| path.into(), |folder| folder.join(path))
    }

    fn table(&self, value: Spanned<DeValue<'a>>, name: &str) -> Result<(DeTable<'a>, Range<usize>)> {
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => Ok((table, span)),
            other => Err(self.at(span, format!("`{name}` is a {}, expected a table", other.type_str()))),
        }
    }

    /// An error of a value, at its own place or at `fallback`.
    fn wrong(&self, error: ValueError, fallback: Range<usize>) -> Error {
        self.at(error.span.unwrap_or(fallback), error.message)
    }

    /// An error of TOML, at its own place or at `fallback`.
    fn located(&self, error: &toml::de::Error, fallback: Range<usize>) -> Error {
        self.at(error.span().unwrap_or(fallback), error.message().into())
    }

    fn at(&self, span: Range<usize>, reason: String) -> Error {
        Error::SceneFile { at: Source::new(self.file, self.line(span)), reason }
    }

    /// The line of a place, counted from 1.
    fn line(&self, span: Range<usize>) -> u32 {
        let line = match self.text {
            None => span.start,
            Some(text) => 1 + text.as_bytes().iter().take(span.start).filter(|byte| **byte == b'\n').count(),
        };
        u32::try_from(line).unwrap_or(u32::MAX)
    }
}
