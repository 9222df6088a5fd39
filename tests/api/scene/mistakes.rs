//! Mistakes in scene files: each error names the file, the line, and the valid alternatives.

use super::groups_and_welds;
use super::round_trip::QUADRUPED;
use kinetoscope::prelude::*;
use kinetoscope::sim::{EntityTypes, Error, Result};

fn toml(text: &str) -> Result<SceneCfg> {
    SceneCfg::from_toml(text, "dir/scene.toml", &EntityTypes::default())
}

fn yaml(text: &str) -> Result<SceneCfg> {
    SceneCfg::from_yaml(text, "dir/scene.yaml", &EntityTypes::default())
}

/// The line, the text, and parts of the message, separated by `|`. A text that begins with `@kind` is an entity of this
/// type, whose keys begin in line 3.
type Rows<'a> = &'a [(u32, &'a str, &'a str)];

/// Asserts that each text gives an error with its line and all parts of its message.
fn assert_rows(file: &str, read: fn(&str) -> Result<SceneCfg>, rows: Rows<'_>) {
    let mut wrong = Vec::new();
    for &(line, text, parts) in rows {
        let text = match text.strip_prefix('@').and_then(|entity| entity.split_once('\n')) {
            Some((kind, keys)) => format!("[entities.s]\ntype = \"{kind}\"\n{keys}"),
            None => text.to_owned(),
        };
        let message = read(&text).unwrap_err().to_string();
        let said = message.strip_prefix(&format!("{file}:{line}: ")).unwrap_or_default();
        if said.is_empty() || parts.split('|').any(|part| !said.contains(part)) {
            wrong.push(format!("{text}\n  {message}\n  is not at line {line} with {parts:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn keys() {
    let rows: Rows<'_> = &[
        (3, "[simulation]\nnum_envs = 2\nphysics_td = 0.01\n", "physics_td|physics_dt"),
        (3, "\n\n[simulatoin]\n", "simulatoin|simulation|entities"),
        (4, "@rigid_object\n\nmas = 1.0", "mas|`mass`|`density`"),
        (6, "@robot\nurdf = \"a.urdf\"\n[entities.s.drive]\nstiffness = 1\ndampin = 2", "dampin|`damping`"),
        (3, "@camera\nextrinsics.placement.look_at = { eye = [1, 0, 0], tarket = [0, 0, 0] }", "tarket|`target`"),
        (4, "@imu\n[entities.s.sampling.noise.lin_acc_b]\nstdd = 0.1", "stdd|`std`"),
        (3, "@camera\nimperfections.vigneting = {}", "vigneting|`vignetting`"),
        (4, "@terrain\n\nthicknes = 1", "thicknes|`thickness`"),
        (4, "@terrain\nheights.rough = { size = [8, 8],\nsede = 7 }", "sede|`seed`"),
        (4, "@terrain\n[entities.s.heights.slope]\ngradiant = [0, 1]", "gradiant|`gradient`"),
        (3, "@ray_caster_camera\nwidht = 3", "widht|`width`"),
        (3, "@ray_caster_camera\nupdate_period = 0.1", "update_period|`sampling`"),
        (1, "exclude_collision = []", "`exclude_collision`|`exclude_collisions`"),
        (3, "@weld\nfrist = \"a\"", "frist|`first`|`second`"),
        (4, "@rigid_object_group\nobjects = [\n{ uid = \"a\", mas = 1 }]", "mas|`mass`"),
        // The name is only in the table header.
        (3, "@rigid_object\nuid = \"o\"", "\"s\"|uid"),
        (3, "@weld\nuid = \"a\"", "\"s\"|uid"),
        (3, "@terrain\nuid = \"t\"", "uid"),
        // Invalid TOML.
        (3, "[simulation]\nnum_envs = 1\nnum_envs = 2", "duplicate"),
        (3, "[entities.a]\ntype = \"imu\"\n[entities.a]\ntype = \"imu\"", "duplicate"),
        (1, "a b", ""),
    ];
    assert_rows("dir/scene.toml", toml, rows);
}

#[test]
fn kinds() {
    let rows: Rows<'_> = &[
        (3, "[entities.c]\n# first\ntype = \"camara\"", "\"c\"|`camera`|`ray_caster`"),
        (2, "\n[entities.c]\nwidth = 2", "\"c\"|type|`camera`"),
        // Regression: numbers beyond the length of an array were ignored.
        (3, "@rigid_object\nshape.box.size = [1, 1, 1, 2]", "invalid length 4|an array of length 3"),
        (3, "@ray_caster\npattern.gird.resolution = 0.1", "gird|`grid`"),
        (2, "[simulation]\npreset = \"walking\"", "`legged`|`manipulation`"),
        (3, "@camera\nchannels = [\n\"rgb\",\n\"deph\"]", "deph|depth"),
        (2, "[simulation]\nintegrator = \"eular\"", "eular|`euler`"),
        // A terrain without a generator, with two generators, with an unknown generator.
        (3, "@terrain\nheights = {}", "names no generator|rough|slope|pyramid_stairs|stepping_stones|grid"),
        (3, "@terrain\nheights = { rough = {}, slope = {} }", "names two generators"),
        (3, "@terrain\nheights = { slope = {}, rough = {} }", "names two generators"),
        (3, "@terrain\nheights.hills = {}", "hills|`rough`"),
        (3, "@terrain\nheights.stairs = {}", "stairs|`pyramid_stairs`"),
        (3, "@terrain\nheights = 3", "rows of heights|generator"),
        // A variant must be named: by its name alone, or as a table with one key.
        (3, "@ray_caster\npattern = {}", "empty table|`grid`|`lidar`|`pinhole`"),
        (3, "@ray_caster\npattern = \"grid\"", "`grid`|needs a value|{ grid = ... }"),
        (3, "@ray_caster\npattern = \"gird\"", "`gird`|one of `grid`"),
        (3, "@ray_caster\npattern = 3", "integer `3`|one of `grid`"),
        (3, "@ray_caster\npattern = { grid = {},\n lidar = {} }", "2 keys (`grid`, `lidar`)|one of"),
        (3, "@ray_caster\npattern.grid = 1", "integer `1`|a table of `resolution`|`size`"),
        (3, "@ray_caster\npattern.grid.order = \"zz\"", "zz|`xy`|`yx`"),
        (4, "@ray_caster\n\nalignment = {}", "empty table|`base`|`yaw`|`world`"),
        (3, "@ray_caster\nalignment = { yaw = 3 }", "`yaw`|its name alone"),
        (3, "@ray_caster\ntargets = {}", "`static_only`|`named`|`everything`"),
        (4, "@ray_caster\n[entities.s.targets]\nnammed = [\"a\"]", "nammed|`named`"),
        (3, "@camera\nintrinsics = {}", "`pixels`|`aperture`|`fovy`"),
        (3, "@camera\nintrinsics.fovi = {}", "fovi|`fovy`"),
        (3, "@camera\nintrinsics.pixels = { fx = 1.0 }", "missing field `fy`"),
        (4, "@camera\n\nextrinsics.placement = {}", "empty table|`pose`|`look_at`"),
        (3, "@camera\ndepth_miss = \"infinity\"", "infinity|`inf`|`far`|`zero`"),
        (3, "@camera\nraster = 4", "integer `4`|a table of `samples`"),
        (3, "@imu\nsampling.noise = { lin_acc_b = 3 }", "integer `3`|a table of `std`"),
        (5, "@frame_transformer\nsource = \"a\"\ntargets = [\n{},\n]", "missing field `bodies`"),
        (5, "@frame_transformer\nsource = \"a\"\ntargets = [\n\"b\"]", "\"b\"|a table of `bodies`"),
        (3, "@rigid_object\nshape = {}", "empty table|`box`|`sphere`|`capsule`"),
        (3, "@rigid_object\nshape = \"box\"", "`box`|needs a value|{ box = ... }"),
        (3, "@rigid_object\nshape.box = {}", "missing field `size`"),
        (3, "@rigid_object\nshape.box.size = [1, 2]", "array of length 3"),
        (4, "@robot\nurdf = \"a\"\ndrive.model = {}", "`implicit`|`actuator`"),
        (4, "@robot\nurdf = \"a\"\ndrive.actuators.\".*\" = {}", "`ideal_pd`|`dc_motor`"),
        (4, "@robot\nurdf = \"a\"\ndrive.actuators.\".*\" = \"dc_motor\"", "{ dc_motor = ... }"),
        // A motor has no default that fits other motors.
        (4, "@robot\nurdf = \"a\"\ndrive.actuators.\".*\".dc_motor = {}", "missing field `saturation_effort`"),
        (2, "[simulation]\ncone = {}", "empty table|`pyramidal`|`elliptic`"),
    ];
    assert_rows("dir/scene.toml", toml, rows);
}

#[test]
fn values() {
    let rows: Rows<'_> = &[
        (2, "[simulation]\nnum_envs = \"two\"", "two|usize"),
        (2, "[simulation]\nnum_envs = -1", "-1"),
        (4, "@imu\n[entities.s.sampling]\nhistory_length = -1", "-1"),
        (3, "[simulation]\n\ngravity = [0, 1]", "array of length 3"),
        (2, "[simulation]\nground = true", "true|false to disable it"),
        (2, "[simulation]\nlights = [{ direction = 3 }]", "integer `3`|array of length 3"),
        (1, "simulation = 3", "`simulation`|integer|table"),
        (1, "entities = []", "`entities`|array|table"),
        (2, "[entities]\ncube = 1", "`cube`|integer|table"),
        (3, "@robot\ndrive.stiffness = \"high\"", "high|a number for all joints"),
        (3, "@robot\nurdf = 3", "3|URDF"),
        (3, "@robot\nurdf.components = [{ name = \"arm\" }]", "urdf"),
        (
            3,
            "@rigid_object\ninit_pose = [0, 0, 0, 0, 0, 0, 0]",
            "is not a rotation: a quaternion w, x, y, z must be finite and not zero",
        ),
        (3, "@terrain\nheights = [[0, 1], [0]]", "row 1 has 1 heights|has 2"),
        // The error belongs to the whole table, so it has the line of the entity.
        (2, "\n[entities.t]\ntype = \"terrain\"\nheights.rough.cell = 0", "rough terrain|cell is 0"),
        (2, "\n[entities.t]\ntype = \"terrain\"\nsize = [1, 1]\nheights.slope = {}", "remove the `size`"),
        (1, "exclude_collisions = 3", "list of pairs"),
        (3, "exclude_collisions = [\n[\"a\", \"b\"],\n[\"a\"]]", "array of length 2"),
        (1, "exclude_collisions = [[\"a\", 3]]", "integer `3`|string"),
        // Numbers out of range, and dates.
        (2, "[simulation]\nphysics_dt = 1e999", "1e999|out of range"),
        (2, "[simulation]\nseed = 99999999999999999999", "99999999999999999999|out of range"),
        (2, "[simulation]\nphysics_dt = 2026-01-01", "2026-01-01|unexpected date"),
    ];
    assert_rows("dir/scene.toml", toml, rows);
}

#[test]
fn in_yaml() {
    let rows: Rows<'_> = &[
        (20, QUADRUPED, "sampling.history_length"),
        (3, "simulation:\n  num_envs: 2\n  physics_td: 0.01\n", "physics_td|physics_dt"),
        (3, "\n\nsimulatoin: {}\n", "simulatoin|simulation|entities"),
        (4, "entities:\n  cube:\n    type: rigid_object\n    mas: 1.0\n", "mas|`mass`|`density`"),
        (4, "entities:\n  c:\n    # first\n    type: camara\n", "\"c\"|`camera`|`ray_caster`"),
        (2, "entities:\n  c:\n    width: 2\n", "\"c\"|type"),
        (2, "simulation:\n  num_envs: two\n", "two"),
        (2, "simulation:\n  num_envs:\n", "the value is null"),
        (3, "simulation:\n  num_envs: 1\n  num_envs: 2\n", "duplicate"),
        (2, "simulation:\n  physics_dt: 1e999\n", "out of range"),
        (3, "simulation:\n  lights:\n    - {kind: spott}\n", "`directional`|`point`|`spot`"),
        (2, "simulation:\n\tnum_envs: 1\n", ""),
        (2, "simulation: [1, 2\n", ""),
    ];
    assert_rows("dir/scene.yaml", yaml, rows);
}

/// Errors of scene construction have the line of the entity.
#[test]
fn in_building() {
    let text = |from: &str, to: &str| groups_and_welds::TEXT.replace(from, to);
    let rows: [(&str, String, &str); 12] = [
        ("2: entity ", "# a ball\n[entities.ball]\ntype = \"rigid_object\"\nmass = 0.0".into(), "\"ball\"|mass"),
        (
            "1: entity ",
            "[entities.eye]\ntype = \"camera\"\nextrinsics.parent = \"bal\"\n[entities.ball]\ntype = \"rigid_object\""
                .into(),
            "\"eye\"|\"bal\"|known names: \"ball\"",
        ),
        (
            "4: entity ",
            "[entities.eye]\ntype = \"camera\"\n\n[entities.\"{ENV}/arm\"]\ntype = \"robot\"".into(),
            "\"arm\"",
        ),
        ("1: entity ", "[entities.arm]\ntype = \"robot\"\nurdf = \"arm.urdf\"".into(), "\"arm\"|dir/arm.urdf"),
        ("1: entity ", "[entities.imu]\ntype = \"imu\"\nsampling.update_period = 0.0101".into(), "\"imu\""),
        ("2: entity ", "\n[entities.t]\ntype = \"terrain\"\nheights = [[0, 1]]".into(), "\"t\"|at least 2 rows"),
        ("3: ", text("\"block\"],", "\"blok\"],"), "\"blok\"|\"block\""),
        ("3: ", text("\"block\"],", "\"ball\"],"), "exclude_collision|different"),
        ("10: ", text("cubes.red", "cubes.rod"), "\"nail\"|\"cubes.red\""),
        ("10: ", text("\"world\"", "\"cubes.red\""), "\"nail\"|different"),
        ("30: ", text("\"blue\"", "\"red\""), "\"cubes\"|cubes.red"),
        ("1: ", "[entities.g]\ntype = \"rigid_object_group\"".into(), "\"g\"|at least 1 object"),
    ];
    for (location, text, parts) in rows {
        let error = InteractiveScene::new(toml(&text).unwrap()).unwrap_err();
        let message = error.to_string();
        assert!(message.starts_with(&format!("dir/scene.toml:{location}")), "{text}\n{message}");
        assert!(parts.split('|').all(|part| message.contains(part)), "{text}\n{message}");
        assert!(matches!(error, Error::Entity { .. }) || !location.ends_with("entity "), "{error:?}");
    }
    let message = SceneCfg::from_file("no/such/scene.toml").unwrap_err().to_string();
    assert!(message.starts_with("no/such/scene.toml: "), "{message}");
}

/// Any text gives a scene or an error with a line of the file. The texts are truncated files, and files with inserted
/// characters.
#[test]
fn any_text() {
    let file = std::fs::read_to_string(assets::path("scenes/quadruped.toml").unwrap()).unwrap();
    assert!(toml(&file).is_ok());
    type Format<'a> = (fn(&str) -> Result<SceneCfg>, &'a str, usize, &'a [&'a str]);
    let formats: [Format<'_>; 2] = [(toml, &file, 7, &["]", "9"]), (yaml, QUADRUPED, 1, &["]", ": ", "*a"])];
    for (read, good, step, insertions) in formats {
        let (mut wrong, mut tried) = (0, 0);
        for (at, _) in good.char_indices().step_by(step) {
            let (before, after) = good.split_at(at);
            let with = insertions.iter().map(|sign| format!("{before}{sign}{after}"));
            for text in with.chain([before.to_owned()]) {
                tried += 1;
                match read(&text) {
                    Ok(_) => {}
                    Err(Error::SceneFile { at, .. }) => {
                        wrong += 1;
                        assert!(at.line >= 1 && at.line as usize <= text.lines().count() + 1, "{at}");
                    }
                    Err(other) => panic!("{other}"),
                }
            }
        }
        assert!(wrong > tried / 4, "{wrong} of {tried}");
    }
}
