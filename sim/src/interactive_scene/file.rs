//! Scenes as TOML or YAML files. Reading is strict: an unknown key is an error with its line.

use super::entity::EntityCfg;
use super::types::EntityTypes;
use super::value::{Value, ValueError};
use super::yaml;
use super::{ExclusionCfg, SceneCfg, strip_env_prefix};
use crate::error::{Error, Result};
use crate::objects::mjcf_file::MjcfFile;
use crate::objects::shape::ObjectShape;
use crate::pattern::closest_names;
use crate::simulation_cfg::SimulationManagerCfg;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::input_file;
use kinetoscope_scene::source_location::SourceLocation;
use kinetoscope_scene::yaml::{YamlError, parse};
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Top-level keys of a file.
const SECTIONS: [&str; 3] = ["simulation", "entities", EXCLUSIONS];

/// Key of the collision exclusions.
pub(super) const EXCLUSIONS: &str = "exclude_collisions";

/// Constructor of a set of defaults.
pub(super) type Preset = fn() -> SimulationManagerCfg;

/// Sets of defaults by their name in files.
pub(super) const PRESETS: [(&str, Preset); 3] = [
    ("default", SimulationManagerCfg::default),
    ("manipulation", SimulationManagerCfg::manipulation),
    ("legged", SimulationManagerCfg::legged),
];

impl SceneCfg {
    /// Reads a scene file with the built-in entity types. The extension `.yaml`, `.yml` or `.json` selects YAML, of
    /// which JSON is a subset; all other files are TOML.
    ///
    /// # Errors
    /// As [`from_toml`](Self::from_toml) and [`from_yaml`](Self::from_yaml); [`Error::File`] if the file cannot be
    /// read.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self> {
        Self::from_file_with(path, &EntityTypes::default())
    }

    /// Reads a scene file with custom entity types.
    ///
    /// # Errors
    /// As [`from_file`](Self::from_file).
    pub fn from_file_with(path: impl AsRef<Path>, types: &EntityTypes) -> Result<Self> {
        let path = path.as_ref();
        let text = input_file::read_named_text(path).map_err(|error| Error::File { path: path.into(), error })?;
        let yaml = ["yaml", "yml", "json"];
        let is_yaml = path.extension().is_some_and(|end| yaml.iter().any(|yaml| end.eq_ignore_ascii_case(yaml)));
        if is_yaml { Self::from_yaml(&text, path, types) } else { Self::from_toml(&text, path, types) }
    }

    /// Reads the text of a scene file. Paths in it, except those of sensors, are relative to the folder of `file`,
    /// which need not exist.
    ///
    /// # Errors
    /// [`Error::SceneFile`] with file and line: the text is not TOML, a key or an entity type is unknown (the message
    /// lists the known ones), an entity has no `type` or has a `uid`, a value has the wrong type, or the generator of a
    /// terrain rejects its parameters. All other numbers and names are checked when the scene is built.
    pub fn from_toml(text: &str, file: impl AsRef<Path>, types: &EntityTypes) -> Result<Self> {
        let reader = Reader { text: Some(text), file: file.as_ref(), types };
        let root = DeTable::parse(text).map_err(|e| reader.toml_error(&e, 0..0))?;
        reader.scene(root.into_inner())
    }

    /// As [`from_toml`](Self::from_toml), for YAML 1.2 with the same tables, lists and keys.
    ///
    /// # Errors
    /// As [`from_toml`](Self::from_toml); in addition, several documents, tags and `null` are rejected.
    pub fn from_yaml(text: &str, file: impl AsRef<Path>, types: &EntityTypes) -> Result<Self> {
        let reader = Reader { text: None, file: file.as_ref(), types };
        let wrong = |error: YamlError| reader.error_at(error.line..error.line, error.message);
        let root = parse(text, &yaml::DIALECT).map_err(wrong)?;
        reader.scene(yaml::table(root.as_ref()).map_err(wrong)?)
    }

    /// Writes the scene as the text of a TOML scene file, with the entity types of `types`. Paths are written
    /// unchanged.
    ///
    /// # Errors
    /// [`Error::SceneFileWrite`]: `types` lacks the type of a sensor, or TOML cannot represent a value (a seed above
    /// 2^63 - 1, a path that is not Unicode). [`Error::DuplicateUid`]: two entities have the same name.
    pub fn to_toml(&self, types: &EntityTypes) -> Result<String> {
        let fail = |what: &str, reason: String| Error::SceneFileWrite { what: what.into(), reason };
        let simulation = toml::Table::try_from(&self.simulation);
        let mut scene = toml::Table::new();
        scene.insert("simulation".into(), simulation.map_err(|e| fail("simulation", e.to_string()))?.into());
        let mut entities = toml::Table::new();
        for (name, entity) in &self.entities {
            let name = strip_env_prefix(name);
            let (kind, table) = types.write(entity).ok_or_else(|| {
                let known: Vec<&str> = types.names().collect();
                fail(name, format!("its type is not one of {}; add it with EntityTypes::with_sensor", known.join(", ")))
            })?;
            let mut written = toml::Table::new();
            written.insert("type".into(), kind.into());
            // The key of the table is the name.
            let fields = table
                .map_err(|e| fail(name, e.to_string()))?
                .into_iter()
                .filter(|(key, _)| !is_name_field(entity, key));
            written.extend(fields);
            if entities.insert(name.into(), written.into()).is_some() {
                return Err(Error::DuplicateUid(name.into()));
            }
        }
        scene.insert("entities".into(), entities.into());
        if !self.exclusions.is_empty() {
            let pair = |exclusion: &ExclusionCfg| toml::Value::from(exclusion.pair.to_vec());
            scene.insert(EXCLUSIONS.into(), self.exclusions.iter().map(pair).collect::<Vec<_>>().into());
        }
        toml::to_string(&scene).map_err(|e| fail("the scene", e.to_string()))
    }
}

/// True if the field is the name of an entity, which files give as the key of its table.
fn is_name_field(entity: &EntityCfg, field: &str) -> bool {
    field == "uid" && !matches!(entity, EntityCfg::Sensor(_))
}

/// Reader of one scene file.
struct Reader<'a> {
    /// Text that the spans index; `None` for YAML, whose spans are lines.
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
                        let source = SourceLocation::new(self.file, self.line(name.span()));
                        scene.sources.insert(strip_env_prefix(name.get_ref()).to_owned(), source);
                        scene.entities.push((name.into_inner().into_owned(), entity));
                    }
                }
                EXCLUSIONS => scene.exclusions = self.exclusions(value)?,
                other => {
                    let known = closest_names(other, SECTIONS).join("`, `");
                    return Err(self.error_at(key.span(), format!("unknown key `{other}`, expected one of `{known}`")));
                }
            }
        }
        Ok(scene)
    }

    /// Reads the table of the simulation over the defaults of its preset.
    fn simulation(&self, value: Spanned<DeValue<'a>>) -> Result<SimulationManagerCfg> {
        let (mut table, span) = self.table(value, "simulation")?;
        let mut defaults = SimulationManagerCfg::default();
        if let Some(preset) = table.remove("preset") {
            let found = PRESETS.iter().find(|(name, _)| preset.get_ref().as_str() == Some(name));
            let (_, make) = found.ok_or_else(|| {
                let names: Vec<&str> = PRESETS.iter().map(|(name, _)| *name).collect();
                self.error_at(preset.span(), format!("unknown preset, expected one of `{}`", names.join("`, `")))
            })?;
            defaults = make();
        }
        let defaults = toml::to_string(&defaults)
            .map_err(|e| Error::SceneFileWrite { what: "preset".into(), reason: e.to_string() })?;
        let mut merged = DeTable::parse(&defaults).map_err(|e| self.toml_error(&e, span.clone()))?.into_inner();
        for (key, value) in table {
            // Replacing a key keeps the span of the old key, which does not exist in the user's file.
            merged.remove(key.get_ref().as_ref());
            merged.insert(key, value);
        }
        let value = Spanned::new(span.clone(), DeValue::Table(merged));
        SimulationManagerCfg::deserialize(Value(value)).map_err(|e| self.value_error(e, span))
    }

    /// Reads pairs of names, each with its position in the file.
    fn exclusions(&self, value: Spanned<DeValue<'a>>) -> Result<Vec<ExclusionCfg>> {
        let span = value.span();
        let DeValue::Array(pairs) = value.into_inner() else {
            return Err(self.error_at(span, format!("`{EXCLUSIONS}` is a list of pairs: [[\"ball\", \"table\"], ...]")));
        };
        let read = |pair: Spanned<DeValue<'a>>| {
            let at = pair.span();
            let source = SourceLocation::new(self.file, self.line(at.clone()));
            let between = <[String; 2]>::deserialize(Value(pair)).map_err(|e| self.value_error(e, at))?;
            Ok(ExclusionCfg { pair: between, at: Some(source) })
        };
        pairs.into_iter().map(read).collect()
    }

    /// Reads one entity: the type reads the table without `type`.
    fn entity(&self, name: &str, value: Spanned<DeValue<'a>>, at: Range<usize>) -> Result<EntityCfg> {
        let (mut table, span) = self.table(value, name)?;
        let known = || self.types.names().collect::<Vec<_>>().join("`, `");
        let Some(kind) = table.remove("type") else {
            return Err(self.error_at(at, format!("entity {name:?} has no `type`, expected one of `{}`", known())));
        };
        let found = kind.get_ref().as_str().and_then(|kind| self.types.get(kind)).ok_or_else(|| {
            self.error_at(kind.span(), format!("entity {name:?} is of an unknown type, expected one of `{}`", known()))
        })?;
        let uid = table.get_key_value("uid").map(|(key, _)| key.span());
        let value = Spanned::new(span, DeValue::Table(table));
        let mut entity = (found.read)(Value(value)).map_err(|e| self.value_error(e, at))?;
        if let Some(uid) = uid.filter(|_| is_name_field(&entity, "uid")) {
            return Err(self.error_at(uid, format!("the uid of an entity is its name, {name:?}; leave `uid` out")));
        }
        self.set_name_and_paths(&mut entity, name);
        Ok(entity)
    }

    /// Sets the name of an entity, and makes its paths relative to the file. Sensors have neither.
    fn set_name_and_paths(&self, entity: &mut EntityCfg, name: &str) {
        let uid = strip_env_prefix(name).to_owned();
        match entity {
            EntityCfg::Robot(robot) => {
                robot.uid = uid;
                self.resolve_urdf_paths(&mut robot.urdf);
                self.resolve_mjcf_paths(&mut robot.mjcf);
            }
            EntityCfg::Articulation(articulation) => {
                articulation.uid = uid;
                self.resolve_urdf_paths(&mut articulation.urdf);
                self.resolve_mjcf_paths(&mut articulation.mjcf);
            }
            EntityCfg::RigidObject(object) => {
                object.uid = uid;
                self.resolve_shape_path(&mut object.shape);
            }
            EntityCfg::Group(group) => {
                group.uid = uid;
                group.objects.iter_mut().for_each(|object| self.resolve_shape_path(&mut object.shape));
            }
            EntityCfg::Terrain(terrain) => terrain.uid = uid,
            EntityCfg::Mjcf(part) => {
                part.uid = uid;
                part.resolve_path(|path| self.resolve(path));
            }
            EntityCfg::Weld(weld) => weld.uid = uid,
            EntityCfg::Sensor(_) => {}
        }
    }

    /// Makes the path of a mesh relative to the scene file.
    fn resolve_shape_path(&self, shape: &mut ObjectShape) {
        if let ObjectShape::Mesh { path, .. } = shape {
            *path = self.resolve(path);
        }
    }

    /// Makes the paths of URDF files relative to the scene file.
    fn resolve_urdf_paths(&self, urdf: &mut UrdfCfg) {
        let components = urdf.components.iter_mut().map(|component| &mut component.urdf);
        for path in components.chain(urdf.packages.values_mut()).chain(urdf.asset_root.as_mut()) {
            *path = self.resolve(path);
        }
    }

    /// Makes the path of an MJCF file relative to the scene file.
    fn resolve_mjcf_paths(&self, mjcf: &mut Option<MjcfFile>) {
        if let Some(file) = mjcf {
            file.resolve_path(|path| self.resolve(path));
        }
    }

    /// Joins a relative path with the folder of the scene file; returns an absolute path unchanged.
    fn resolve(&self, path: &Path) -> PathBuf {
        self.file.parent().map_or_else(|| path.into(), |folder| folder.join(path))
    }

    fn table(&self, value: Spanned<DeValue<'a>>, name: &str) -> Result<(DeTable<'a>, Range<usize>)> {
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => Ok((table, span)),
            other => Err(self.error_at(span, format!("`{name}` is a {}, expected a table", other.type_str()))),
        }
    }

    /// Error of a value, at its own position or at `fallback`.
    fn value_error(&self, error: ValueError, fallback: Range<usize>) -> Error {
        self.error_at(error.span.unwrap_or(fallback), error.message)
    }

    /// Error of the TOML parser, at its own position or at `fallback`.
    fn toml_error(&self, error: &toml::de::Error, fallback: Range<usize>) -> Error {
        self.error_at(error.span().unwrap_or(fallback), error.message().into())
    }

    fn error_at(&self, span: Range<usize>, reason: String) -> Error {
        Error::SceneFile { at: SourceLocation::new(self.file, self.line(span)), reason }
    }

    /// Line of a span, counted from 1.
    fn line(&self, span: Range<usize>) -> u32 {
        let line = match self.text {
            None => span.start,
            Some(text) => 1 + text.as_bytes().iter().take(span.start).filter(|byte| **byte == b'\n').count(),
        };
        u32::try_from(line).unwrap_or(u32::MAX)
    }
}
