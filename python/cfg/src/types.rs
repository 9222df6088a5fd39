//! The configuration types of the Python package, each with its source file and its default value.

use kinetoscope::record;
use kinetoscope::render;
use kinetoscope::robot;
use kinetoscope::scene;
use kinetoscope::sensors;
use kinetoscope::sensors::camera::imperfection;
use kinetoscope::sim;
use kinetoscope::tasks;
use kinetoscope::viewer;
use serde::Serialize;
use toml::{Table, Value};

/// A struct that becomes a dataclass.
#[derive(Debug)]
pub(crate) struct Struct {
    pub(crate) file: &'static str,
    /// Name in Rust.
    pub(crate) name: &'static str,
    /// Name in Python.
    pub(crate) class: &'static str,
    /// Type in scene files, for entities.
    pub(crate) entity: Option<&'static str>,
    /// Serialized default, or an example of a struct without a default.
    pub(crate) default: Table,
    /// Names and values of other constructors.
    pub(crate) presets: Vec<(&'static str, Table)>,
    /// For structs that a reader of files fills in instead of serde: names of fields in Rust and in files; `None` for fields that
    /// files do not have.
    pub(crate) names_in_files: Vec<(&'static str, Option<&'static str>)>,
}

/// An enumeration, which becomes a class of constructors, or a literal type if no variant has fields.
#[derive(Debug)]
pub(crate) struct Enum {
    pub(crate) file: &'static str,
    pub(crate) name: &'static str,
}

/// An enumeration that a macro declares: its module, its name and documentation, its variants with their content.
#[derive(Debug)]
pub(crate) struct DeclaredEnum {
    pub(crate) area: &'static str,
    pub(crate) name: &'static str,
    pub(crate) doc: &'static str,
    pub(crate) variants: &'static [(&'static str, Declared)],
}

/// Content of a variant of a declared enumeration.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Declared {
    /// No content: the name alone. With its documentation.
    Name(&'static str),
    /// A table without keys. With its documentation.
    Empty(&'static str),
    /// An object of a class, which also has the documentation.
    Class(&'static str),
}

/// A method of a configuration that the extension module computes, by its function `_class_method`.
#[derive(Debug)]
pub(crate) struct Method {
    /// Name of the type in Rust, which is that in Python, too.
    pub(crate) owner: &'static str,
    pub(crate) name: &'static str,
    /// Arguments with their types, without the configuration.
    pub(crate) arguments: &'static [(&'static str, &'static str)],
    pub(crate) result: &'static str,
}

/// All methods of configurations. Those of an enumeration are static; [`FROM`] makes one from other values.
pub(crate) const METHODS: &[Method] = &[
    method("TerrainGrid", "heights", &[], "NDArray[Any]"),
    method("TerrainGrid", "size", &[], "tuple[float, float]"),
    method("TerrainGrid", "tile_center", &[("row", "int"), ("column", "int")], "tuple[float, float]"),
    method("TerrainGrid", "tile_at", &[("x", "float"), ("y", "float")], "tuple[int, int] | None"),
    method("TerrainGrid", "row_difficulty", &[("row", "int")], "float"),
    method("TerrainGrid", "platform_heights", &[], "NDArray[Any]"),
    method("SimulationManagerCfg", "env_origins", &[], "NDArray[Any]"),
    method("Intrinsics", "from_matrix", &[("matrix", "ArrayLike")], "dict[str, Any]"),
    method("Intrinsics", "matrix", &[("width", "int"), ("height", "int")], "NDArray[Any]"),
];

/// Beginning of the names of static methods that do not take a configuration.
pub(crate) const FROM: &str = "from_";

const fn method(
    owner: &'static str,
    name: &'static str,
    arguments: &'static [(&'static str, &'static str)],
    result: &'static str,
) -> Method {
    Method { owner, name, arguments, result }
}

/// The modules of the package `cfg`, and the items of each in words. A module uses those before it.
pub(crate) const AREAS: [(&str, &str); 14] = [
    ("shapes", "shapes, surfaces and collision geometry"),
    ("simulation", "simulations, the ground, lights and shards"),
    ("robots", "robots, articulations, their files and drives"),
    ("kinematics", "inverse kinematics"),
    ("objects", "rigid objects, groups, terrains, MJCF parts and welds"),
    ("sampling", "the rate, latency and noise of sensors"),
    ("rendering", "renderers, lenses, apertures and shutters"),
    ("cameras", "cameras and their imperfections"),
    ("sensors", "sensors other than cameras"),
    ("scenes", "declared scenes"),
    ("randomization", "random properties of environments"),
    ("tasks", "tasks for learning agents"),
    ("views", "windows, browser views and screenshots"),
    ("recordings", "recordings and live streams"),
];

/// The module of a type, by the source file of the type.
pub(crate) fn area(file: &str) -> &'static str {
    const PREFIXES: [(&str, &str); 18] = [
        ("scene/src/mesh/", "shapes"),
        ("sim/src/surface_cfg.rs", "shapes"),
        ("sim/src/objects/shape.rs", "shapes"),
        ("sim/src/objects/mesh_collision.rs", "shapes"),
        ("robot/src/kinematics/", "kinematics"),
        ("robot/", "robots"),
        ("sim/src/drive/", "robots"),
        ("sim/src/objects/robot_cfg.rs", "robots"),
        ("sim/src/objects/articulation.rs", "robots"),
        ("sim/src/objects/mjcf_file.rs", "robots"),
        ("sim/src/inspect/", "robots"),
        ("sim/src/interactive_scene/", "scenes"),
        ("sim/src/randomization/", "randomization"),
        ("sim/src/objects/", "objects"),
        ("scene/src/terrain/", "objects"),
        ("sensors/src/noise.rs", "sampling"),
        ("sensors/src/sampling.rs", "sampling"),
        ("sensors/src/camera/", "cameras"),
    ];
    let known = PREFIXES.iter().find(|(prefix, _)| file.starts_with(prefix)).map(|(_, area)| *area);
    known.unwrap_or(match file.split('/').next() {
        Some("render") => "rendering",
        Some("sensors") => "sensors",
        Some("tasks") => "tasks",
        Some("viewer") => "views",
        Some("record") => "recordings",
        _ => "simulation",
    })
}

fn table<T: Serialize>(value: &T) -> Table {
    match Value::try_from(value) {
        Ok(Value::Table(table)) => table,
        other => panic!("a configuration is a table, not {other:?}"),
    }
}

/// Lists structs: file, Rust path, Python name, entity type.
macro_rules! structs {
    ($($file:literal $class:ident = $default:expr, $name:ident $(, $entity:literal)?;)*) => {
        vec![$(Struct {
            file: $file,
            name: stringify!($name),
            class: stringify!($class),
            entity: [$($entity,)? ""].first().copied().filter(|kind: &&str| !kind.is_empty()),
            default: table(&$default),
            presets: Vec::new(),
            names_in_files: Vec::new(),
        },)*]
    };
}

/// Default of the type of an expression's context.
fn new<T: Default>() -> T {
    T::default()
}

/// All structs, those that others contain first.
pub(crate) fn structs() -> Vec<Struct> {
    let mut all = structs! {
        "sim/src/shard.rs" Shard = new::<sim::Shard>(), Shard;
        "sim/src/surface_cfg.rs" SurfaceCfg = new::<sim::SurfaceCfg>(), SurfaceCfg;
        "sim/src/simulation_cfg.rs" GroundCfg = new::<sim::GroundCfg>(), GroundCfg;
        "sim/src/light_cfg.rs" LightCfg = new::<sim::LightCfg>(), LightCfg;
        "sim/src/simulation_cfg.rs" SimulationManagerCfg = new::<sim::SimulationManagerCfg>(), SimulationManagerCfg;
        "scene/src/mesh/hull.rs" HullCfg = new::<scene::mesh::HullCfg>(), HullCfg;
        "scene/src/mesh/convex_decomposition.rs" ConvexDecompositionCfg = new::<scene::mesh::ConvexDecompositionCfg>(), ConvexDecompositionCfg;
        "robot/src/urdf/config.rs" NameCaseCfg = new::<robot::urdf::NameCaseCfg>(), NameCaseCfg;
        "robot/src/urdf/config.rs" ComponentCfg = robot::urdf::ComponentCfg::new("arm", "arm.urdf"), ComponentCfg;
        "robot/src/urdf/config.rs" UrdfCfg = new::<robot::urdf::UrdfCfg>(), UrdfCfg;
        "sim/src/objects/mjcf_file.rs" MjcfFile = new::<sim::MjcfFile>(), MjcfFile;
        "sim/src/drive/models/dc_motor.rs" DcMotor = sim::DcMotor { saturation_effort: 1.0 }, DcMotor;
        "sim/src/drive/models/delayed_pd.rs" DelayedPd = new::<sim::DelayedPd>(), DelayedPd;
        "sim/src/drive/cfg.rs" DriveCfg = new::<sim::DriveCfg>(), DriveCfg;
        "sim/src/objects/robot_cfg.rs" RobotCfg = new::<sim::RobotCfg>(), RobotCfg, "robot";
        "sim/src/objects/articulation.rs" ArticulationCfg = new::<sim::ArticulationCfg>(), ArticulationCfg, "articulation";
        "sim/src/inspect/mod.rs" InspectCfg = new::<sim::inspect::InspectCfg>(), InspectCfg;
        "sim/src/objects/rigid_object_data.rs" RigidObjectCfg = new::<sim::RigidObjectCfg>(), RigidObjectCfg, "rigid_object";
        "sim/src/objects/object_group_data.rs" RigidObjectGroupCfg = new::<sim::RigidObjectGroupCfg>(), RigidObjectGroupCfg, "rigid_object_group";
        "scene/src/terrain/rough.rs" RoughTerrain = new::<scene::terrain::RoughTerrain>(), RoughTerrain;
        "scene/src/terrain/slope.rs" SlopeTerrain = new::<scene::terrain::Slope>(), Slope;
        "scene/src/terrain/stairs.rs" PyramidStairsTerrain = new::<scene::terrain::PyramidStairs>(), PyramidStairs;
        "scene/src/terrain/flat.rs" FlatTerrain = new::<scene::terrain::Flat>(), Flat;
        "scene/src/terrain/pyramid_slope.rs" PyramidSlopeTerrain = new::<scene::terrain::PyramidSlope>(), PyramidSlope;
        "scene/src/terrain/boxes.rs" BoxesTerrain = new::<scene::terrain::Boxes>(), Boxes;
        "scene/src/terrain/stepping_stones.rs" SteppingStonesTerrain = new::<scene::terrain::SteppingStones>(), SteppingStones;
        "scene/src/terrain/gap.rs" GapTerrain = new::<scene::terrain::Gap>(), Gap;
        "scene/src/terrain/waves.rs" WavesTerrain = new::<scene::terrain::Waves>(), Waves;
        "scene/src/terrain/obstacles.rs" DiscreteObstaclesTerrain = new::<scene::terrain::DiscreteObstacles>(), DiscreteObstacles;
        "scene/src/terrain/tile.rs" RoughTile = new::<scene::terrain::RoughTile>(), RoughTile;
        "scene/src/terrain/tile.rs" SlopeTile = new::<scene::terrain::SlopeTile>(), SlopeTile;
        "scene/src/terrain/tile.rs" StairsTile = new::<scene::terrain::StairsTile>(), StairsTile;
        "scene/src/terrain/tile.rs" BoxesTile = new::<scene::terrain::BoxesTile>(), BoxesTile;
        "scene/src/terrain/tile.rs" SteppingStonesTile = new::<scene::terrain::SteppingStonesTile>(), SteppingStonesTile;
        "scene/src/terrain/tile.rs" GapTile = new::<scene::terrain::GapTile>(), GapTile;
        "scene/src/terrain/tile.rs" WavesTile = new::<scene::terrain::WavesTile>(), WavesTile;
        "scene/src/terrain/tile.rs" ObstaclesTile = new::<scene::terrain::ObstaclesTile>(), ObstaclesTile;
        "scene/src/terrain/grid.rs" TileShare = scene::terrain::TileShare::from(scene::terrain::TerrainTile::Flat {}), TileShare;
        "scene/src/terrain/grid.rs" TerrainGrid = new::<scene::terrain::TerrainGrid>(), TerrainGrid;
        "sim/src/objects/terrain.rs" TerrainCfg = new::<sim::TerrainCfg>(), TerrainCfg, "terrain";
        "sim/src/objects/mjcf_part_data.rs" MjcfPartCfg = new::<sim::MjcfPartCfg>(), MjcfPartCfg, "mjcf";
        "sim/src/objects/weld_data.rs" WeldCfg = new::<sim::WeldCfg>(), WeldCfg, "weld";
        "sensors/src/noise.rs" NoiseCfg = new::<sensors::NoiseCfg>(), NoiseCfg;
        "sensors/src/sampling.rs" SamplingCfg = new::<sensors::SamplingCfg>(), SamplingCfg;
        "render/src/shutter.rs" Shutter = new::<render::Shutter>(), Shutter;
        "render/src/aperture.rs" Aperture = render::Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 1.0 }, Aperture;
        "render/src/request.rs" RasterCfg = new::<render::RasterCfg>(), RasterCfg;
        "render/src/lens/open_cv.rs" OpenCvLens = new::<render::lens::OpenCv>(), OpenCv;
        "render/src/lens/open_cv_fisheye.rs" OpenCvFisheyeLens = new::<render::lens::OpenCvFisheye>(), OpenCvFisheye;
        "render/src/lens/equidistant.rs" EquidistantLens = new::<render::lens::Equidistant>(), Equidistant;
        "render/src/lens/equisolid.rs" EquisolidLens = new::<render::lens::Equisolid>(), Equisolid;
        "render/src/lens/orthographic.rs" OrthographicLens = new::<render::lens::Orthographic>(), Orthographic;
        "render/src/lens/stereographic.rs" StereographicLens = new::<render::lens::Stereographic>(), Stereographic;
        "render/src/lens/f_theta.rs" FThetaLens = new::<render::lens::FTheta>(), FTheta;
        "sensors/src/camera/imperfection/vignetting.rs" Vignetting = new::<imperfection::Vignetting>(), Vignetting;
        "sensors/src/camera/imperfection/exposure.rs" Exposure = new::<imperfection::Exposure>(), Exposure;
        "sensors/src/camera/imperfection/shot_noise.rs" ShotNoise = new::<imperfection::ShotNoise>(), ShotNoise;
        "sensors/src/camera/imperfection/read_noise.rs" ReadNoise = new::<imperfection::ReadNoise>(), ReadNoise;
        "sensors/src/camera/imperfection/holes.rs" Holes = new::<imperfection::Holes>(), Holes;
        "sensors/src/camera/imperfection/depth_noise.rs" DepthNoise = new::<imperfection::DepthNoise>(), DepthNoise;
        "sensors/src/camera/imperfection/mod.rs" Imperfections = new::<imperfection::Imperfections>(), Imperfections;
        "sensors/src/camera/extrinsics.rs" Extrinsics = new::<sensors::camera::Extrinsics>(), Extrinsics;
        "sensors/src/camera/cfg.rs" CameraCfg = new::<sensors::camera::CameraCfg>(), CameraCfg, "camera";
        "sensors/src/camera/stereo/cfg.rs" StereoCameraCfg = new::<sensors::camera::StereoCameraCfg>(), StereoCameraCfg, "stereo_camera";
        "sensors/src/camera/segmentation/labels.rs" SegmentationCfg = new::<sensors::camera::SegmentationCfg>(), SegmentationCfg;
        "sensors/src/ray/pattern/grid.rs" GridPattern = new::<sensors::ray::pattern::Grid>(), Grid;
        "sensors/src/ray/pattern/lidar.rs" LidarPattern = new::<sensors::ray::pattern::Lidar>(), Lidar;
        "sensors/src/ray/pattern/bpearl.rs" BpearlPattern = new::<sensors::ray::pattern::Bpearl>(), Bpearl;
        "sensors/src/ray/pattern/pinhole.rs" PinholePattern = new::<sensors::ray::pattern::Pinhole>(), Pinhole;
        "sensors/src/ray/pattern/custom.rs" CustomPattern = new::<sensors::ray::pattern::Custom>(), Custom;
        "sensors/src/ray/caster/cfg.rs" RayCasterCfg = new::<sensors::ray::RayCasterCfg>(), RayCasterCfg, "ray_caster";
        "sensors/src/ray/camera/cfg.rs" RayCasterCameraCfg = new::<sensors::ray::RayCasterCameraCfg>(), RayCasterCameraCfg, "ray_caster_camera";
        "sensors/src/contact_sensor/cfg.rs" ContactSensorCfg = new::<sensors::ContactSensorCfg>(), ContactSensorCfg, "contact_sensor";
        "sensors/src/imu.rs" ImuCfg = new::<sensors::ImuCfg>(), ImuCfg, "imu";
        "sensors/src/frame_transformer.rs" TargetFrameCfg = sensors::TargetFrameCfg::for_bodies("link"), TargetFrameCfg;
        "sensors/src/frame_transformer.rs" FrameTransformerCfg = sensors::FrameTransformerCfg::new("base", Vec::new()), FrameTransformerCfg, "frame_transformer";
        "sensors/src/joint_state.rs" JointStateCfg = new::<sensors::JointStateCfg>(), JointStateCfg, "joint_state";
        "sensors/src/actuator_state.rs" ActuatorStateCfg = new::<sensors::ActuatorStateCfg>(), ActuatorStateCfg, "actuator_state";
        "sensors/src/joint_wrench.rs" JointWrenchCfg = new::<sensors::JointWrenchCfg>(), JointWrenchCfg, "joint_wrench";
        "sensors/src/mujoco_sensor.rs" MujocoSensorCfg = new::<sensors::MujocoSensorCfg>(), MujocoSensorCfg, "mujoco_sensor";
        "robot/src/kinematics/cfg.rs" NullSpacePosture = robot::kinematics::NullSpacePosture::at(Vec::new()), NullSpacePosture;
        "robot/src/kinematics/cfg.rs" IkCfg = new::<robot::kinematics::IkCfg>(), IkCfg;
        "sim/src/randomization/terms.rs" RandomizationTerm = example_term(), RandomizationTerm;
        "sim/src/randomization/terms.rs" Randomization = new::<sim::Randomization>(), Randomization;
        "tasks/src/task_cfg.rs" TaskCfg = new::<tasks::TaskCfg>(), TaskCfg;
        "viewer/src/scene_view/orbit_camera.rs" OrbitCamera = new::<viewer::OrbitCamera>(), OrbitCamera;
        "viewer/src/scene_view/overlay.rs" Overlays = new::<viewer::Overlays>(), Overlays;
        "viewer/src/serve/mod.rs" ServeCfg = new::<viewer::ServeCfg>(), ServeCfg;
        "viewer/src/window/mod.rs" WindowCfg = new::<viewer::WindowCfg>(), WindowCfg;
        "viewer/src/screenshot.rs" ScreenshotCfg = new::<viewer::ScreenshotCfg>(), ScreenshotCfg;
        "record/src/overview.rs" OverviewCfg = new::<record::OverviewCfg>(), OverviewCfg;
        "record/src/cfg.rs" RecorderCfg = new::<record::RecorderCfg>(), RecorderCfg;
        "record/src/live.rs" FoxgloveCfg = new::<record::FoxgloveCfg>(), FoxgloveCfg;
    };
    let scenes = [
        (
            "sim/src/interactive_scene/exclusion.rs",
            "ExclusionCfg",
            Table::new(),
            vec![("pair", Some("pair")), ("at", None)],
        ),
        (
            "sim/src/interactive_scene/mod.rs",
            "SceneCfg",
            empty_scene(),
            vec![
                ("simulation", Some("simulation")),
                ("entities", Some("entities")),
                ("exclusions", Some("exclude_collisions")),
                ("sources", None),
            ],
        ),
    ];
    all.extend(scenes.map(|(file, name, default, names_in_files)| Struct {
        file,
        name,
        class: name,
        entity: None,
        default,
        presets: Vec::new(),
        names_in_files,
    }));
    // The tile of a share is required.
    all.iter_mut().filter(|known| known.class == "TileShare").for_each(|share| drop(share.default.remove("tile")));
    if let Some(simulation) = all.iter_mut().find(|known| known.class == "SimulationManagerCfg") {
        simulation.presets = vec![
            ("manipulation", table(&sim::SimulationManagerCfg::manipulation())),
            ("legged", table(&sim::SimulationManagerCfg::legged())),
        ];
    }
    all
}

/// The scene that an empty file declares.
fn empty_scene() -> Table {
    let simulation = table(&sim::SimulationManagerCfg::default());
    Table::from_iter([
        ("simulation".to_string(), Value::Table(simulation)),
        ("entities".to_string(), Value::Table(Table::new())),
        ("exclude_collisions".to_string(), Value::Array(Vec::new())),
    ])
}

/// A term whose fields are all required.
fn example_term() -> sim::RandomizationTerm {
    let draw = sim::RandomizationOp::Scale([1.0, 1.0]);
    sim::RandomizationTerm { property: sim::Property::Mass, pattern: String::new(), draw }
}

/// All enumerations that a source file declares directly.
pub(crate) const ENUMS: &[Enum] = &[
    Enum { file: "sim/src/mjcf/document.rs", name: "Integrator" },
    Enum { file: "sim/src/mjcf/document.rs", name: "FrictionCone" },
    Enum { file: "sim/src/light_cfg.rs", name: "LightKindCfg" },
    Enum { file: "sim/src/objects/rigid_object_data.rs", name: "BodyType" },
    Enum { file: "sim/src/objects/mesh_collision.rs", name: "MeshCollision" },
    Enum { file: "sim/src/objects/shape.rs", name: "ObjectShape" },
    Enum { file: "scene/src/terrain/tile.rs", name: "TerrainTile" },
    Enum { file: "robot/src/urdf/config.rs", name: "Strictness" },
    Enum { file: "robot/src/urdf/config.rs", name: "MissingInertia" },
    Enum { file: "robot/src/urdf/config.rs", name: "NameCase" },
    Enum { file: "sim/src/drive/mod.rs", name: "DriveModel" },
    Enum { file: "render/src/intrinsics.rs", name: "Intrinsics" },
    Enum { file: "render/src/renderer.rs", name: "Renderer" },
    Enum { file: "sensors/src/camera/extrinsics.rs", name: "Placement" },
    Enum { file: "sensors/src/camera/extrinsics.rs", name: "CameraConvention" },
    Enum { file: "sensors/src/camera/cfg.rs", name: "DepthMiss" },
    Enum { file: "sensors/src/camera/stereo/cfg.rs", name: "StereoOrigin" },
    Enum { file: "render/src/shade/tone.rs", name: "ToneCurve" },
    Enum { file: "sensors/src/ray/pattern/grid.rs", name: "GridOrder" },
    Enum { file: "sensors/src/ray/caster/alignment.rs", name: "RayAlignment" },
    Enum { file: "sensors/src/ray/targets.rs", name: "HitTargets" },
    Enum { file: "robot/src/kinematics/cfg.rs", name: "IkTask" },
    Enum { file: "sim/src/randomization/property.rs", name: "Property" },
    Enum { file: "sim/src/randomization/terms.rs", name: "RandomizationOp" },
    Enum { file: "viewer/src/control/mod.rs", name: "Speed" },
    Enum { file: "viewer/src/scene_view/snapshot.rs", name: "EnvSelection" },
    Enum { file: "record/src/format.rs", name: "Format" },
];

/// Name of an enumeration in Python. `Renderer` is the class of kinetoscope-render.
pub(crate) fn python_name(name: &str) -> &str {
    if name == "Renderer" { "CameraRenderer" } else { name }
}

/// Values of an enumeration whose fields may be left out in files, by variant.
pub(crate) fn variant_defaults(name: &str) -> Table {
    match name {
        "Renderer" => table(&render::Renderer::RAY_TRACED),
        _ => Table::new(),
    }
}

/// Enumerations that macros declare. The tests of the package read each variant.
pub(crate) const DECLARED_ENUMS: &[DeclaredEnum] = &[
    DeclaredEnum {
        area: "robots",
        name: "DriveType",
        doc: "Meaning of stiffness and damping of drives.",
        variants: &[("force", Declared::Name("")), ("acceleration", Declared::Name("")), ("none", Declared::Name(""))],
    },
    DeclaredEnum {
        area: "robots",
        name: "ActuatorModel",
        doc: "An explicit actuator model with its parameters.",
        variants: &[
            ("ideal_pd", Declared::Empty("Ideal PD controller with an effort limit.")),
            ("dc_motor", Declared::Class("DcMotor")),
            ("delayed_pd", Declared::Class("DelayedPd")),
        ],
    },
    DeclaredEnum {
        area: "rendering",
        name: "Lens",
        doc: "A lens model. The name alone, such as ``\"equidistant\"``, is the lens with its default numbers.",
        variants: &[
            ("pinhole", Declared::Name("The pinhole, without distortion: straight lines stay straight.")),
            ("opencv", Declared::Class("OpenCvLens")),
            ("opencv_fisheye", Declared::Class("OpenCvFisheyeLens")),
            ("equidistant", Declared::Class("EquidistantLens")),
            ("equisolid", Declared::Class("EquisolidLens")),
            ("orthographic", Declared::Class("OrthographicLens")),
            ("stereographic", Declared::Class("StereographicLens")),
            ("ftheta", Declared::Class("FThetaLens")),
            (
                "panorama",
                Declared::Name("The equirectangular panorama: longitudes along rows, latitudes along columns."),
            ),
        ],
    },
    DeclaredEnum {
        area: "objects",
        name: "TerrainGenerator",
        doc: "Generator of the heights of a terrain, which also defines its size.",
        variants: &[
            ("rough", Declared::Class("RoughTerrain")),
            ("slope", Declared::Class("SlopeTerrain")),
            ("pyramid_stairs", Declared::Class("PyramidStairsTerrain")),
            ("flat", Declared::Class("FlatTerrain")),
            ("pyramid_slope", Declared::Class("PyramidSlopeTerrain")),
            ("boxes", Declared::Class("BoxesTerrain")),
            ("stepping_stones", Declared::Class("SteppingStonesTerrain")),
            ("gap", Declared::Class("GapTerrain")),
            ("waves", Declared::Class("WavesTerrain")),
            ("discrete_obstacles", Declared::Class("DiscreteObstaclesTerrain")),
            ("grid", Declared::Class("TerrainGrid")),
        ],
    },
    DeclaredEnum {
        area: "sensors",
        name: "RayPattern",
        doc: "Starts and directions of the rays of a ray caster.",
        variants: &[
            ("grid", Declared::Class("GridPattern")),
            ("lidar", Declared::Class("LidarPattern")),
            ("bpearl", Declared::Class("BpearlPattern")),
            ("pinhole", Declared::Class("PinholePattern")),
            ("custom", Declared::Class("CustomPattern")),
        ],
    },
];
