//! The JSON Schema of scene files agrees with the reader: checked by the Python package `jsonschema`.

use super::groups_and_welds::TEXT;
use super::round_trip::every_kind;
use super::terrain;
use kinetoscope::prelude::*;
use kinetoscope::sim::EntityTypes;
use kinetoscope_testkit::test_resources::{files_below, python_readers, read_json};
use kinetoscope_testkit::urdf::TempFiles;
use std::path::Path;
use toml::{Table, Value};

/// True for each text that the schema accepts.
fn validate(texts: &[String]) -> Vec<bool> {
    let files = TempFiles::default();
    let schema = SceneCfg::json_schema(&EntityTypes::default());
    let task = serde_json::json!({ "schema": schema, "texts": texts });
    let task = files.write("task.json", task.to_string());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/api/scene/validate_schema.py");
    let valid: Vec<bool> = serde_json::from_value(read_json(&python_readers(), &script, &task)).unwrap();
    assert_eq!(valid.len(), texts.len());
    valid
}

fn is_readable(text: &str) -> bool {
    SceneCfg::from_toml(text, "scene.toml", &EntityTypes::default()).is_ok()
}

/// All complete scenes of the tree: files, texts of tests, blocks of the pages that declare entities.
fn scenes() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    // Other files of this kind are tasks.
    let is_scene = |text: &String| text.contains("[entities.");
    let mut texts: Vec<String> =
        files_below(&root.join("assets"), "toml").iter().map(|path| read(path)).filter(is_scene).collect();
    texts.extend([TEXT.into(), terrain::FILE.into(), every_kind().to_toml(&EntityTypes::default()).unwrap()]);
    for page in files_below(&root.join("docs"), "md") {
        let page = read(&page);
        let blocks = page.split("```toml\n").skip(1).filter_map(|rest| rest.split_once("```"));
        texts.extend(blocks.map(|(block, _)| block.to_owned()).filter(is_scene));
    }
    texts
}

/// Copies of a table in which one key is misspelt; keys at all depths.
fn misspelt(table: &Table) -> Vec<Table> {
    let mut all = Vec::new();
    for (key, value) in table {
        let mut renamed = table.clone();
        renamed.remove(key);
        renamed.insert(format!("{key}x"), value.clone());
        all.push(renamed);
        let inside: Vec<Value> = match value {
            Value::Table(inner) => misspelt(inner).into_iter().map(Value::Table).collect(),
            Value::Array(items) => {
                let with = |i: usize, item: Table| {
                    let mut items = items.clone();
                    items[i] = Value::Table(item);
                    Value::Array(items)
                };
                let tables = items.iter().enumerate().filter_map(|(i, item)| Some((i, item.as_table()?)));
                tables.flat_map(|(i, item)| misspelt(item).into_iter().map(move |item| with(i, item))).collect()
            }
            _ => Vec::new(),
        };
        all.extend(inside.into_iter().map(|value| {
            let mut changed = table.clone();
            changed.insert(key.clone(), value);
            changed
        }));
    }
    all
}

/// Each scene of the tree is valid. With a misspelt key, it is valid only if the reader accepts it too: names of
/// entities and patterns of joints are free.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn agrees_with_the_reader() {
    let scenes = scenes();
    assert!(scenes.len() > 5, "{} scenes", scenes.len());
    let mut texts = scenes.clone();
    for scene in &scenes {
        let table: Table = toml::from_str(scene).unwrap();
        texts.extend(misspelt(&table).iter().map(|table| toml::to_string(table).unwrap()));
    }
    let readable: Vec<bool> = texts.iter().map(|text| is_readable(text)).collect();
    assert!(readable[..scenes.len()].iter().all(|readable| *readable));
    let refused = readable.iter().filter(|readable| !**readable).count();
    assert!(refused > 300, "{refused} of {} are misspelt", texts.len());
    let valid = validate(&texts);
    let different: Vec<&String> = (0..texts.len()).filter(|&i| valid[i] != readable[i]).map(|i| &texts[i]).collect();
    assert!(different.is_empty(), "{} of {}; the first: {}", different.len(), texts.len(), different[0]);
}

/// Values that the reader refuses, and similar ones that it accepts.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn values() {
    let rows = [
        ("[simulation]\nnum_envs = 2", true),
        ("[simulation]\nnum_envs = -2", false),
        ("[simulation]\nnum_envs = \"two\"", false),
        ("[simulation]\npreset = \"legged\"", true),
        ("[simulation]\npreset = \"flying\"", false),
        ("[simulation]\nground = false", true),
        ("[simulation]\nground = true", false),
        ("[simulation]\ngravity = [0, 0, -9.81]", true),
        ("[simulation]\ngravity = [0, 0]", false),
        ("[simulation]\nintegrator = \"implicitfast\"", true),
        ("[simulation]\nintegrator = \"rk5\"", false),
        ("exclude_collisions = [[\"a\", \"b\"]]", true),
        ("exclude_collisions = [[\"a\"]]", false),
        ("[entities.a]\ntype = \"camera\"\nchannels = [\"rgb\", \"distance_to_image_plane\"]", true),
        ("[entities.a]\ntype = \"camera\"\nchannels = [\"rgbx\"]", false),
        ("[entities.a]\ntype = \"camera\"\nlens = \"equidistant\"\nrenderer = \"fast-rt\"", true),
        ("[entities.a]\ntype = \"camera\"\nlens.opencv = { k1 = 0.1 }\nrenderer.ray_traced = { samples = 4 }", true),
        ("[entities.a]\ntype = \"camera\"\nlens.opencv = { k1x = 0.1 }", false),
        ("[entities.a]\ntype = \"camera\"\nlens = \"fish\"", false),
        ("[entities.a]\ntype = \"camera\"\nrenderer = \"opengl\"", false),
        ("[entities.a]\ntype = \"camera\"\naperture = { focal_length = 0.05, f_number = 2.0 }", false),
        ("[entities.a]\ntype = \"imu\"\noffset = [0, 0, 0, 1, 0, 0, 0]", true),
        ("[entities.a]\ntype = \"imu\"\noffset = { pos = [0, 0, 1], rpy_deg = [0, 0, 90] }", true),
        ("[entities.a]\ntype = \"imu\"\noffset = [0, 0, 0]", false),
        ("[entities.a]\ntype = \"rigid_object\"\nshape.sphere.radius = 1", true),
        ("[entities.a]\ntype = \"rigid_object\"\nshape.sphere = {}", false),
        ("[entities.a]\ntype = \"rigid_object\"\nuid = \"b\"", false),
        ("[entities.a]\ntype = \"robot\"\nurdf = \"a.urdf\"\ndrive.stiffness = 1", true),
        ("[entities.a]\ntype = \"robot\"\nurdf.components = [{ name = \"arm\" }]", false),
        ("[entities.a]\ntype = \"robot\"\ndrive.stiffness.arm = 1", true),
        ("[entities.a]\ntype = \"robot\"\ndrive.stiffness = \"stiff\"", false),
        ("[entities.a]\nurdf = \"a.urdf\"", false),
        ("[entities.a]\ntype = \"robt\"", false),
    ];
    for (text, readable) in rows {
        assert_eq!(is_readable(text), readable, "{text}");
    }
    let valid = validate(&rows.map(|(text, _)| text.to_owned()));
    for ((text, readable), valid) in rows.into_iter().zip(valid) {
        assert_eq!(valid, readable, "{text}");
    }
}
