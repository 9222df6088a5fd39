//! Mistakes in scene files: each names the file, the line, and what would be right.

use kinetoscope::prelude::*;

fn error(text: &str) -> String {
    SceneCfg::from_toml(text, "dir/scene.toml", &EntityTypes::default()).unwrap_err().to_string()
}

#[test]
fn a_mistake_is_named_with_its_line() {
    let mut wrong = Vec::new();
    for (text, line, parts) in [
        // Keys that nobody knows, at every depth.
        ("[simulation]\nnum_envs = 2\nphysics_td = 0.01\n", 3, &["physics_td", "physics_dt"][..]),
        ("\n\n[simulatoin]\n", 3, &["simulatoin", "simulation", "entities"]),
        ("[entities.cube]\ntype = \"rigid_object\"\n\nmas = 1.0", 4, &["mas", "`mass`", "`density`"]),
        (
            "[entities.r]\ntype = \"robot\"\nurdf = \"a.urdf\"\n[entities.r.drive]\nstiffness = 1\ndampin = 2",
            6,
            &["dampin", "`damping`"],
        ),
        (
            "[entities.c]\ntype = \"camera\"\nextrinsics.placement.look_at = { eye = [1, 0, 0], tarket = [0, 0, 0] }",
            3,
            &["tarket", "`target`"],
        ),
        ("[entities.i]\ntype = \"imu\"\n[entities.i.sampling.noise.lin_acc_b]\nstdd = 0.1", 4, &["stdd", "`std`"]),
        // Kinds that nobody knows.
        ("[entities.c]\n# first\ntype = \"camara\"", 3, &["\"c\"", "`camera`", "`ray_caster`"]),
        ("\n[entities.c]\nwidth = 2", 2, &["\"c\"", "type", "`camera`"]),
        ("[entities.s]\ntype = \"ray_caster\"\npattern.gird.resolution = 0.1", 3, &["gird", "`grid`"]),
        ("[simulation]\npreset = \"walking\"", 2, &["`legged`", "`manipulation`"]),
        ("[entities.c]\ntype = \"camera\"\nchannels = [\n\"rgb\",\n\"deph\"]", 3, &["deph", "depth"]),
        ("[simulation]\nintegrator = \"eular\"", 2, &["eular", "`euler`"]),
        // Values of another form.
        ("[simulation]\nnum_envs = \"two\"", 2, &["two", "usize"]),
        ("[simulation]\nnum_envs = -1", 2, &["-1"]),
        ("[simulation]\n\ngravity = [0, 1]", 3, &["array of length 3"]),
        ("[simulation]\nground = true", 2, &["true", "false for none"]),
        ("simulation = 3", 1, &["`simulation`", "integer", "table"]),
        ("entities = []", 1, &["`entities`", "array", "table"]),
        ("[entities]\ncube = 1", 2, &["`cube`", "integer", "table"]),
        ("[entities.r]\ntype = \"robot\"\ndrive.stiffness = \"high\"", 3, &["high", "a number for all joints"]),
        // A motor has no number that would do for others.
        (
            "[entities.r]\ntype = \"robot\"\nurdf = \"a.urdf\"\ndrive.actuators.\".*\".dc_motor = {}",
            4,
            &["missing field `saturation_effort`"],
        ),
        ("[entities.r]\ntype = \"robot\"\nurdf = 3", 3, &["3", "URDF"]),
        ("[entities.r]\ntype = \"robot\"\nurdf.components = [{ name = \"arm\" }]", 3, &["urdf"]),
        ("[entities.o]\ntype = \"rigid_object\"\ninit_pose = [0, 0, 0, 0, 0, 0, 0]", 3, &["no rotation"]),
        // A terrain of no generator, of two, of one that nobody knows, of nothing.
        (
            "[entities.t]\ntype = \"terrain\"\nheights = {}",
            3,
            &["no generator is named", "`rough`", "`slope`", "`pyramid_stairs`"],
        ),
        ("[entities.t]\ntype = \"terrain\"\nheights = { rough = {}, slope = {} }", 3, &["one generator", "two"]),
        ("[entities.t]\ntype = \"terrain\"\nheights.hills = {}", 3, &["hills", "`rough`"]),
        ("[entities.t]\ntype = \"terrain\"\nheights = 3", 3, &["rows of heights", "generator"]),
        // One of several kinds is to be named: by its name alone, or as a table of one.
        (
            "[entities.s]\ntype = \"ray_caster\"\npattern = {}",
            3,
            &["nothing is named", "`grid`", "`lidar`", "`pinhole`"],
        ),
        ("[entities.s]\ntype = \"ray_caster\"\npattern = \"grid\"", 3, &["`grid`", "too little", "{ grid = ... }"]),
        ("[entities.s]\ntype = \"ray_caster\"\npattern = \"gird\"", 3, &["`gird`", "one of `grid`"]),
        ("[entities.s]\ntype = \"ray_caster\"\npattern = 3", 3, &["integer `3`", "one of `grid`"]),
        (
            "[entities.s]\ntype = \"ray_caster\"\npattern = { grid = {},\n lidar = {} }",
            3,
            &["`grid`, `lidar` are 2", "one of"],
        ),
        (
            "[entities.s]\ntype = \"ray_caster\"\npattern.grid = 1",
            3,
            &["integer `1`", "a table of `resolution`", "`size`"],
        ),
        ("[entities.s]\ntype = \"ray_caster\"\npattern.grid.order = \"zz\"", 3, &["zz", "`xy`", "`yx`"]),
        (
            "[entities.s]\ntype = \"ray_caster\"\n\nalignment = {}",
            4,
            &["nothing is named", "`base`", "`yaw`", "`world`"],
        ),
        ("[entities.s]\ntype = \"ray_caster\"\nalignment = { yaw = 3 }", 3, &["`yaw`", "its name alone"]),
        ("[entities.s]\ntype = \"ray_caster\"\ntargets = {}", 3, &["`static_only`", "`named`", "`everything`"]),
        ("[entities.s]\ntype = \"ray_caster\"\n[entities.s.targets]\nnammed = [\"a\"]", 4, &["nammed", "`named`"]),
        ("[entities.s]\ntype = \"camera\"\nintrinsics = {}", 3, &["`pixels`", "`aperture`", "`fovy`"]),
        ("[entities.s]\ntype = \"camera\"\nintrinsics.fovi = {}", 3, &["fovi", "`fovy`"]),
        ("[entities.s]\ntype = \"camera\"\nintrinsics.pixels = { fx = 1.0 }", 3, &["missing field `fy`"]),
        (
            "[entities.s]\ntype = \"camera\"\n\nextrinsics.placement = {}",
            4,
            &["nothing is named", "`pose`", "`look_at`"],
        ),
        ("[entities.s]\ntype = \"camera\"\ndepth_miss = \"infinity\"", 3, &["infinity", "`inf`", "`far`", "`zero`"]),
        ("[entities.s]\ntype = \"camera\"\nraster = 4", 3, &["integer `4`", "a table of `samples`"]),
        ("[entities.s]\ntype = \"imu\"\nsampling.noise = { lin_acc_b = 3 }", 3, &["integer `3`", "a table of `std`"]),
        (
            "[entities.s]\ntype = \"frame_transformer\"\nsource = \"a\"\ntargets = [\n{},\n]",
            5,
            &["missing field `bodies`"],
        ),
        (
            "[entities.s]\ntype = \"frame_transformer\"\nsource = \"a\"\ntargets = [\n\"b\"]",
            5,
            &["\"b\"", "a table of `bodies`"],
        ),
        (
            "[entities.s]\ntype = \"rigid_object\"\nshape = {}",
            3,
            &["nothing is named", "`box`", "`sphere`", "`capsule`"],
        ),
        ("[entities.s]\ntype = \"rigid_object\"\nshape = \"box\"", 3, &["`box`", "too little", "{ box = ... }"]),
        ("[entities.s]\ntype = \"rigid_object\"\nshape.box = {}", 3, &["missing field `size`"]),
        ("[entities.s]\ntype = \"rigid_object\"\nshape.box.size = [1, 2]", 3, &["array of length 3"]),
        ("[entities.r]\ntype = \"robot\"\nurdf = \"a\"\ndrive.model = {}", 4, &["`implicit`", "`actuator`"]),
        ("[entities.r]\ntype = \"robot\"\nurdf = \"a\"\ndrive.actuators.\".*\" = {}", 4, &["`ideal_pd`", "`dc_motor`"]),
        (
            "[entities.r]\ntype = \"robot\"\nurdf = \"a\"\ndrive.actuators.\".*\" = \"dc_motor\"",
            4,
            &["{ dc_motor = ... }"],
        ),
        ("[simulation]\ncone = {}", 2, &["nothing is named", "`pyramidal`", "`elliptic`"]),
        ("[simulation]\nlights = [{ direction = 3 }]", 2, &["integer `3`", "array of length 3"]),
        // Numbers that are none, and dates.
        ("[simulation]\nphysics_dt = 1e999", 2, &["1e999", "beyond"]),
        ("[simulation]\nseed = 99999999999999999999", 2, &["99999999999999999999", "beyond"]),
        ("[simulation]\nphysics_dt = 2026-01-01", 2, &["2026-01-01", "nowhere"]),
        // Names stand in one place only.
        ("[entities.o]\ntype = \"rigid_object\"\nuid = \"o\"", 3, &["\"o\"", "uid"]),
        // What is no TOML.
        ("[simulation]\nnum_envs = 1\nnum_envs = 2", 3, &["duplicate"]),
        ("[entities.a]\ntype = \"imu\"\n[entities.a]\ntype = \"imu\"", 3, &["duplicate"]),
        ("a b", 1, &[]),
    ] {
        let message = error(text);
        let said = message.strip_prefix(&format!("dir/scene.toml:{line}: ")).unwrap_or_default();
        if said.is_empty() || parts.iter().any(|part| !said.contains(part)) {
            wrong.push(format!("{text}\n  {message}\n  is not at line {line} with {parts:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// Whatever stands in a file, reading it ends with a scene or an error.
#[test]
fn no_text_ends_the_process() {
    let good = std::fs::read_to_string(assets::path("scenes/quadruped.toml").unwrap()).unwrap();
    let read = |text: &str| SceneCfg::from_toml(text, "scene.toml", &EntityTypes::default());
    assert!(read(&good).is_ok());
    let (mut wrong, mut tried) = (0, 0);
    for (at, _) in good.char_indices().step_by(7) {
        let (before, after) = good.split_at(at);
        for text in [before.to_owned(), format!("{before}]{after}"), format!("{before}9{after}")] {
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

#[test]
fn a_file_that_is_not_there_is_named() {
    let message = SceneCfg::from_file("no/such/scene.toml").unwrap_err().to_string();
    assert!(message.starts_with("no/such/scene.toml: "), "{message}");
}

/// What only building finds out is named with the line of the entity.
#[test]
fn what_cannot_be_built_is_named_with_its_line() {
    for (text, line, parts) in [
        ("# a ball\n[entities.ball]\ntype = \"rigid_object\"\nmass = 0.0", 2, &["\"ball\"", "mass"][..]),
        (
            "[entities.eye]\ntype = \"camera\"\nextrinsics.parent = \"bal\"\n[entities.ball]\ntype = \"rigid_object\"",
            1,
            &["\"eye\"", "\"bal\"", "known are \"ball\""],
        ),
        ("[entities.eye]\ntype = \"camera\"\n\n[entities.\"{ENV}/arm\"]\ntype = \"robot\"", 4, &["\"arm\""]),
        ("[entities.arm]\ntype = \"robot\"\nurdf = \"arm.urdf\"", 1, &["\"arm\"", "dir/arm.urdf"]),
        ("[entities.imu]\ntype = \"imu\"\nsampling.update_period = 0.0101", 1, &["\"imu\""]),
    ] {
        let cfg = SceneCfg::from_toml(text, "dir/scene.toml", &EntityTypes::default()).unwrap();
        let error = InteractiveScene::new(cfg).unwrap_err();
        assert!(matches!(error, Error::Entity { .. }));
        let message = error.to_string();
        assert!(message.starts_with(&format!("dir/scene.toml:{line}: entity ")), "{text}\n{message}");
        for part in parts {
            assert!(message.contains(part), "{text}\n{message}: no {part}");
        }
    }
}

/// A kind that has nothing to set may be named alone or with an empty table; all that a kind has a default for may be left
/// out.
#[test]
fn kinds_may_be_named_either_way() {
    let text =
        "[entities.s]\ntype = \"ray_caster\"\npattern.grid = {}\nalignment = { world = {} }\ntargets = \"static_only\"";
    let cfg = SceneCfg::from_toml(text, "scene.toml", &EntityTypes::default()).unwrap();
    let EntityCfg::Sensor(sensor) = &cfg.entities[0].1 else { panic!("no sensor") };
    let any: &dyn std::any::Any = sensor.as_ref();
    let expected =
        RayCasterCfg { alignment: RayAlignment::World, targets: HitTargets::StaticOnly, ..RayCasterCfg::default() };
    assert_eq!(any.downcast_ref::<RayCasterCfg>(), Some(&expected));
}
