"""Generated configurations: defaults, names, documentation."""

import ast
import dataclasses
import inspect
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import kinetoscope as ks
from kinetoscope import _sim, cfg

PROJECT = Path(__file__).parents[2]
CLASSES = [cls for _, cls in inspect.getmembers(cfg, inspect.isclass) if dataclasses.is_dataclass(cls)]
ENTITIES = [cls for cls in CLASSES if hasattr(cls, "_type")]


def grid(*tiles):
    """A terrain of a row of tiles, of medium difficulty."""
    sizes = {"rows": 1, "columns": 4, "difficulty": [0.5, 0.5], "border": 0}
    return {"type": "terrain", "heights": {"grid": {**sizes, "tiles": list(tiles)}}}


# A configuration that contains an object of a class; classes without an entry are entities themselves.
CONTAINERS = {
    "ActuatorStateCfg": lambda own: own,
    "Aperture": lambda own: {"type": "camera", "aperture": own},
    "BpearlPattern": lambda own: {"type": "ray_caster", "pattern": {"bpearl": own}},
    "ComponentCfg": lambda own: {"type": "robot", "urdf": {"components": [own]}},
    "ConvexDecompositionCfg": lambda own: {"type": "rigid_object", "mesh_collision": {"pieces": own}},
    "CustomPattern": lambda own: {"type": "ray_caster", "pattern": {"custom": own}},
    "DcMotor": lambda own: {"type": "robot", "drive": {"actuators": {"a": {"dc_motor": own}}}},
    "DelayedPd": lambda own: {"type": "robot", "drive": {"actuators": {"a": {"delayed_pd": own}}}},
    "DepthNoise": lambda own: {"type": "camera", "imperfections": {"depth_noise": own}},
    "DriveCfg": lambda own: {"type": "robot", "drive": own},
    "EquidistantLens": lambda own: {"type": "camera", "lens": {"equidistant": own}},
    "EquisolidLens": lambda own: {"type": "camera", "lens": {"equisolid": own}},
    "Exposure": lambda own: {"type": "camera", "imperfections": {"exposure": own}},
    "Extrinsics": lambda own: {"type": "camera", "extrinsics": own},
    "FThetaLens": lambda own: {"type": "camera", "lens": {"f_theta": own}},
    "GridPattern": lambda own: {"type": "ray_caster", "pattern": {"grid": own}},
    "Holes": lambda own: {"type": "camera", "imperfections": {"holes": own}},
    "HullCfg": lambda own: {"type": "robot", "hull": own},
    "Imperfections": lambda own: {"type": "camera", "imperfections": own},
    "LidarPattern": lambda own: {"type": "ray_caster", "pattern": {"lidar": own}},
    "MjcfFile": lambda own: {"type": "robot", "mjcf": own},
    "NameCaseCfg": lambda own: {"type": "robot", "urdf": {"name_case": own}},
    "NoiseCfg": lambda own: {"type": "imu", "sampling": {"noise": {"lin_acc_b": own}}},
    "OpenCvFisheyeLens": lambda own: {"type": "camera", "lens": {"opencv_fisheye": own}},
    "OpenCvLens": lambda own: {"type": "camera", "lens": {"opencv": own}},
    "OrthographicLens": lambda own: {"type": "camera", "lens": {"orthographic": own}},
    "PinholePattern": lambda own: {"type": "ray_caster", "pattern": {"pinhole": own}},
    "PyramidStairsTerrain": lambda own: {"type": "terrain", "heights": {"pyramid_stairs": own}},
    "FlatTerrain": lambda own: {"type": "terrain", "heights": {"flat": own}},
    "PyramidSlopeTerrain": lambda own: {"type": "terrain", "heights": {"pyramid_slope": own}},
    "BoxesTerrain": lambda own: {"type": "terrain", "heights": {"boxes": own}},
    "SteppingStonesTerrain": lambda own: {"type": "terrain", "heights": {"stepping_stones": own}},
    "GapTerrain": lambda own: {"type": "terrain", "heights": {"gap": own}},
    "WavesTerrain": lambda own: {"type": "terrain", "heights": {"waves": own}},
    "DiscreteObstaclesTerrain": lambda own: {"type": "terrain", "heights": {"discrete_obstacles": own}},
    "RasterCfg": lambda own: {"type": "camera", "raster": own},
    "ReadNoise": lambda own: {"type": "camera", "imperfections": {"read_noise": own}},
    "RoughTerrain": lambda own: {"type": "terrain", "heights": {"rough": own}},
    "SamplingCfg": lambda own: {"type": "imu", "sampling": own},
    "ShotNoise": lambda own: {"type": "camera", "imperfections": {"shot_noise": own}},
    "Shutter": lambda own: {"type": "camera", "shutter": own},
    "SlopeTerrain": lambda own: {"type": "terrain", "heights": {"slope": own}},
    "StereographicLens": lambda own: {"type": "camera", "lens": {"stereographic": own}},
    "SurfaceCfg": lambda own: {"type": "rigid_object", "surface": own},
    "TargetFrameCfg": lambda own: {"type": "frame_transformer", "source": "a", "targets": [own]},
    "RoughTile": lambda own: grid({"tile": {"rough": own}}),
    "SlopeTile": lambda own: grid({"tile": {"slope_up": own}}),
    "StairsTile": lambda own: grid({"tile": {"stairs_down": own}}),
    "BoxesTile": lambda own: grid({"tile": {"boxes": own}}),
    "SteppingStonesTile": lambda own: grid({"tile": {"stepping_stones": own}}),
    "GapTile": lambda own: grid({"tile": {"gap": own}}),
    "WavesTile": lambda own: grid({"tile": {"waves": own}}),
    "ObstaclesTile": lambda own: grid({"tile": {"discrete_obstacles": own}}),
    "TileShare": lambda own: grid(own, {"tile": {"waves": {}}}),
    "UrdfCfg": lambda own: {"type": "robot", "urdf": own},
    "Vignetting": lambda own: {"type": "camera", "imperfections": {"vignetting": own}},
}
SIMULATION = {
    "SimulationManagerCfg": lambda own: own,
    "GroundCfg": lambda own: {"ground": own},
    "LightCfg": lambda own: {"lights": [own]},
    "Shard": lambda own: {"shard": own},
}
# Scenes, in place of the dict of from_scene.
SCENES = {
    "SceneCfg": lambda own: own,
    "ExclusionCfg": lambda own: {"exclude_collisions": [own]},
}
# Read by other functions than scene files.
ARGUMENTS = [
    "FoxgloveCfg", "IkCfg", "InspectCfg", "NullSpacePosture", "OrbitCamera", "Overlays", "OverviewCfg", "Randomization",
    "RecorderCfg", "ScreenshotCfg", "SegmentationCfg", "ServeCfg", "TaskCfg", "TerrainGrid", "WindowCfg",
]  # fmt: skip
ELSEWHERE = {*ARGUMENTS, "RandomizationTerm"}
REQUIRED = {
    "ComponentCfg": {"name": "a", "urdf": "a.urdf"},
    "DcMotor": {"saturation_effort": 1.0},
    "ExclusionCfg": {"pair": ["a", "b"]},
    "Aperture": {"focal_length": 0.05, "f_number": 2.0, "focus_distance": 1.0},
    "TargetFrameCfg": {"bodies": "a"},
    "TileShare": {"tile": {"flat": {}}},
    "FrameTransformerCfg": {"source": "a", "targets": []},
    "NullSpacePosture": {"rest": [0.0]},
    "RandomizationTerm": {"property": "mass", "pattern": ".*", "draw": {"scale": [1, 2]}},
}


def read(cls, own):
    """A configuration as Rust reads it, with all its fields."""
    if cls.__name__ in SIMULATION:
        return tomllib.loads(ks.to_toml({"simulation": SIMULATION[cls.__name__](own)}))
    if cls.__name__ in SCENES:
        return tomllib.loads(ks.to_toml(SCENES[cls.__name__](own)))
    contained = CONTAINERS.get(cls.__name__, lambda own: {"type": cls._type, **own})(own)
    if "type" not in contained:
        contained = {"type": cls._type, **contained}
    return tomllib.loads(ks.to_toml({"entities": {"x": contained}}))


def all_fields(obj):
    """All fields of a configuration, also those with their defaults, in the form of scene files."""
    if dataclasses.is_dataclass(obj):
        fields = {}
        for field in dataclasses.fields(obj):
            value = getattr(obj, field.name)
            if value is not None:
                fields[field.name] = all_fields(value)
        return fields
    if isinstance(obj, dict):
        return {key: all_fields(value) for key, value in obj.items()}
    if isinstance(obj, list | tuple):
        return [all_fields(value) for value in obj]
    return obj


@pytest.mark.parametrize("cls", [c for c in CLASSES if c.__name__ not in ELSEWHERE], ids=lambda c: c.__name__)
def test_defaults_are_those_of_rust(cls):
    required = REQUIRED.get(cls.__name__, {})
    default = cls(**required)
    given = all_fields(default)
    uid = given.pop("uid", None)
    if uid is not None:
        # Scene files name entities by their keys: the default is the name of an entity without one.
        assert _sim._default_uid(cls._type) == uid
    if cls.__name__ == "TerrainCfg":
        assert given["heights"] == [[0, 0], [0, 0]]
    found = read(cls, dict(required))
    assert read(cls, given) == found, cls.__name__
    # A field that is None here has no value in Rust, or the `false` that stands for None.
    own = [table for table in tables(found) if set(given) <= set(table)]
    for field in dataclasses.fields(cls):
        if getattr(default, field.name) is None:
            assert any(table.get(field.name, False) is False for table in own), field.name


@pytest.mark.parametrize("name", ARGUMENTS)
def test_defaults_of_arguments_are_those_of_rust(name):
    """Configurations of calls, which scene files do not have, and the terrain grid, whose heights are too many for a text.
    All fields of RandomizationTerm are required."""
    required = {"NullSpacePosture": {"rest": []}}.get(name, {})
    cls = getattr(ks, name)
    assert tomllib.loads(_sim._default_fields(name)) == all_fields(cls(**required))


def tables(value):
    """All dicts in a value."""
    if isinstance(value, dict):
        yield value
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from tables(item)


@pytest.mark.parametrize("cls", [c for c in ENTITIES if "uid" in c.__dataclass_fields__], ids=lambda c: c.__name__)
def test_entities_have_default_names(cls):
    """A control: every entity that is not a sensor has a name, and Rust gives the same."""
    names = {"robot", "articulation", "rigid_object", "rigid_object_group", "terrain", "mjcf", "weld"}
    assert cls._type in names and cls().uid == _sim._default_uid(cls._type)


# Structs of configurations without a class, and the reason.
WITHOUT_A_CLASS = {
    "EnvCfg": "its fields are those of TaskCfg",
    "ImageWindowCfg": "its fields are the arguments of ImageWindow",
    "JointPositionsCfg": "a term of tasks: a dict with its type",
    "TerrainLevelsCfg": "a term of tasks: a dict with its type",
    "TileCfg": "computed from the fields of TerrainGrid",
    "UniformVelocityCfg": "a term of tasks: a dict with its type",
}


def test_every_struct_has_a_class():
    """Structs in the sources of the crates that users see. A struct without a class fails until it gets one (types.rs), or a
    reason above."""
    structs = set()
    for crate in ("scene", "render", "robot", "sensors", "sim", "tasks", "viewer", "record"):
        for path in (PROJECT / crate / "src").rglob("*.rs"):
            structs |= set(re.findall(r"^pub struct (\w+Cfg)\b", path.read_text(), re.MULTILINE))
    classes = {cls.__name__ for cls in CLASSES}
    assert len(structs) > 40 and {"CameraCfg", "RecorderCfg"} <= structs & classes
    assert structs - classes == set(WITHOUT_A_CLASS)


def tables_of_schema(schema, path=()):
    """Names of the keys of each table in a JSON Schema, with the path of the table."""
    if isinstance(schema, dict):
        if isinstance(schema.get("properties"), dict):
            yield path, frozenset(schema["properties"])
        for key, inner in schema.items():
            yield from tables_of_schema(inner, (*path, key))
    elif isinstance(schema, list):
        for item in schema:
            yield from tables_of_schema(item, path)


def test_every_table_of_scene_files_has_a_class():
    """Each table of the JSON Schema has the fields of a class, the arguments of a constructor, or is a variant, whose only key
    is the name of a constructor."""
    schema = ks.json_schema()
    known = {frozenset(field.name for field in dataclasses.fields(cls)) for cls in CLASSES}
    # In scene files, the name of an entity is its key, and its type a field.
    known |= {fields - {"uid"} | {"type"} for fields in known} | {fields - {"uid"} for fields in known}
    constructors = {}
    for _, cls in inspect.getmembers(cfg, inspect.isclass):
        if not dataclasses.is_dataclass(cls):
            for name in vars(cls):
                if not name.startswith("_"):
                    constructors.setdefault(name, []).append(getattr(cls, name))
    for functions in constructors.values():
        known |= {frozenset(inspect.signature(function).parameters) for function in functions if callable(function)}
    # A pose, and a simulation with a preset.
    known |= {frozenset({"pos", "quat_wxyz", "rpy_deg"}), frozenset({"rpy_deg"})}
    known |= {fields | {"preset"} for fields in known if "physics_dt" in fields}
    found = [*tables_of_schema({"simulation": schema["properties"]["simulation"], **schema["definitions"]})]
    assert len(found) > 100
    # Names of lenses have aliases: those that Rust writes count. EmbodiChain's `rt` is one of a renderer.
    lenses = {key for path, keys in found if "lens" in path for key in keys if len(keys) == 1}
    written = {next(iter(read(ks.CameraCfg, {"lens": {name: {}}})["entities"]["x"]["lens"])) for name in lenses - {"max_angle"}}
    assert written == {name for name in vars(ks.Lens) if not name.startswith("_")} and len(lenses) > len(written)
    unknown = [
        (path, set(keys))
        for path, keys in found
        if keys not in known and not (len(keys) == 1 and keys <= {*constructors, *lenses, "rt"})
    ]
    assert not unknown, unknown


def test_every_class_is_tested():
    names = {cls.__name__ for cls in CLASSES}
    known = set(CONTAINERS) | set(SIMULATION) | set(SCENES) | ELSEWHERE | {cls.__name__ for cls in ENTITIES}
    assert names <= known, names - known
    assert {cls._type for cls in ENTITIES} == {
        "robot", "articulation", "rigid_object", "rigid_object_group", "terrain", "mjcf", "weld", "camera",
        "stereo_camera", "ray_caster", "ray_caster_camera", "contact_sensor", "imu", "frame_transformer", "joint_state",
        "actuator_state", "joint_wrench", "mujoco_sensor",
    }  # fmt: skip


@pytest.mark.parametrize("cls", [c for c in CLASSES if c.__name__ not in ELSEWHERE], ids=lambda c: c.__name__)
def test_unknown_fields_are_refused(cls):
    """A control: Rust sees the fields of every class."""
    own = dict(REQUIRED.get(cls.__name__, {})) | {"no_such_field": 1}
    with pytest.raises(ks.ConfigError, match="no_such_field"):
        read(cls, own)


def test_only_changed_fields_travel():
    text = ks.to_toml({"simulation": ks.SimulationManagerCfg(ground=None, num_envs=2)})
    simulation = tomllib.loads(text)["simulation"]
    assert simulation["ground"] is False and simulation["num_envs"] == 2
    legged = tomllib.loads(ks.to_toml({"simulation": ks.SimulationManagerCfg.legged()}))
    assert legged == tomllib.loads(ks.to_toml({"simulation": {"preset": "legged"}}))
    # A preset may be changed back to a default.
    assert tomllib.loads(ks.to_toml({"simulation": ks.SimulationManagerCfg.legged(impratio=1.0)}))["simulation"]["impratio"] == 1


def scene_of(make, pair):
    """A scene by its constructor, with collision exclusions in the form of ``pair``."""
    cube = ks.ObjectShape.box(size=[0.1, 0.1, 0.1])
    return make(
        simulation=ks.SimulationManagerCfg(num_envs=2, ground=None),
        entities={"a": ks.RigidObjectCfg(shape=cube), "b": {"type": "rigid_object", "shape": cube}, "imu": ks.ImuCfg(body="a")},
        exclude_collisions=[pair("a", "b")],
    )


def test_scenes_as_classes():
    """A SceneCfg has the keys of scene files, by their JSON Schema, and is the scene of the dict."""
    assert {field.name for field in dataclasses.fields(ks.SceneCfg)} == set(ks.json_schema()["properties"]) - {"$schema"}
    text = ks.to_toml(scene_of(dict, lambda *pair: pair))
    assert tomllib.loads(text)["exclude_collisions"] == [["a", "b"]] and tomllib.loads(text)["entities"]["a"]["type"] == "rigid_object"
    for pair in (lambda *pair: pair, lambda *pair: ks.ExclusionCfg(pair=pair), lambda *pair: {"pair": pair}):
        for make in (dict, ks.SceneCfg):
            scene = scene_of(make, pair)
            assert ks.to_toml(scene) == text
            sim = ks.SimulationManager.from_scene(scene)
            assert sim.keys() == ["a", "b", "imu"] and sim.num_envs == 2 and '<exclude body1="a' in sim.mjcf
    # A control: a scene without the exclusion differs.
    assert ks.to_toml(dataclasses.replace(scene, exclude_collisions=[])) != text and ks.SceneCfg() == ks.SceneCfg()
    assert ks.to_toml(ks.SceneCfg()) == ks.to_toml({})


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (lambda: ks.SceneCfg(simulation=ks.WeldCfg()), ("simulation", "WeldCfg", "SimulationManagerCfg")),
        (lambda: ks.SceneCfg(entities={"x": ks.RobotCfg(drive=ks.WeldCfg())}), ("drive", "WeldCfg", "DriveCfg")),
        (lambda: ks.SceneCfg(exclude_collisions=[ks.WeldCfg()]), ("exclude_collisions", "WeldCfg", "ExclusionCfg")),
        (lambda: ks.SceneCfg(exclude_collisions=[["a"]]), ("exclude_collisions[0]", "two names", '["a"]')),
        (lambda: {"exclude_collisions": [["a", "b"], ["a", 3]]}, ("exclude_collisions[1]", "two names", "3")),
        (lambda: {"exclude_collisions": "ab"}, ("exclude_collisions",)),
        (lambda: {"exclude_collisions": [{}]}, ("exclude_collisions[0]", "missing field `pair`")),
        (lambda: {"exclude_collisions": [["a", "b"], {"pair": ["a", "b"], "pears": 1}]}, ("[1]", "`pears`", "`pair`")),
        (lambda: ks.RobotCfg(), ("RobotCfg", "SceneCfg", "add_robot")),
        (lambda: {"simulation": None}, ("simulation", "None")),
        (lambda: 3, ("int",)),
    ],
)
def test_wrong_scenes(scene, words):
    for read_scene in (ks.to_toml, ks.SimulationManager.from_scene):
        with pytest.raises(ks.ConfigError) as error:
            read_scene(scene())
        assert all(word in str(error.value) for word in words), error.value


def test_none_is_never_a_silent_default():
    """A field that is present by default is removed by None, as a keyword argument, in a dict and in a class."""
    fields = set()
    for cls in CLASSES:
        for field in dataclasses.fields(cls):
            default = field.default if field.default_factory is dataclasses.MISSING else field.default_factory()
            if "| None" in str(field.type) and default is not None and default is not dataclasses.MISSING:
                fields.add(field.name)
    assert fields == set(_sim._NONE_IS_FALSE)
    for sim in (
        ks.SimulationManager(ground=None),
        ks.SimulationManager({"ground": None}),
        ks.SimulationManager(ks.SimulationManagerCfg(ground=None)),
    ):
        assert "ground" not in sim.mjcf
    assert "ground" in ks.SimulationManager().mjcf


VARIANTS = [
    (ks.Lens.pinhole, "camera", "lens"),
    (ks.Lens.opencv(ks.OpenCvLens(k1=-0.3)), "camera", "lens"),
    (ks.Lens.opencv_fisheye(ks.OpenCvFisheyeLens()), "camera", "lens"),
    (ks.Lens.equidistant(ks.EquidistantLens(max_angle=1.5)), "camera", "lens"),
    (ks.Lens.equisolid(ks.EquisolidLens()), "camera", "lens"),
    (ks.Lens.orthographic(ks.OrthographicLens()), "camera", "lens"),
    (ks.Lens.stereographic(ks.StereographicLens()), "camera", "lens"),
    (ks.Lens.ftheta(ks.FThetaLens()), "camera", "lens"),
    (ks.Lens.panorama, "camera", "lens"),
    (ks.CameraRenderer.raster, "camera", "renderer"),
    (ks.CameraRenderer.hybrid, "camera", "renderer"),
    (ks.CameraRenderer.fast_ray_traced, "camera", "renderer"),
    (ks.CameraRenderer.ray_traced(samples=16), "camera", "renderer"),
    (ks.ObjectShape.box(size=[1, 2, 3]), "rigid_object", "shape"),
    (ks.ObjectShape.sphere(radius=1.0), "rigid_object", "shape"),
    (ks.ObjectShape.cylinder(radius=1.0, length=2.0), "rigid_object", "shape"),
    (ks.ObjectShape.capsule(radius=1.0, length=2.0), "rigid_object", "shape"),
    (ks.ObjectShape.mesh(path="a.stl"), "rigid_object", "shape"),
    (ks.MeshCollision.pieces(ks.ConvexDecompositionCfg(max_pieces=3)), "rigid_object", "mesh_collision"),
    (ks.MeshCollision.triangles(thickness=0.1), "rigid_object", "mesh_collision"),
    (ks.Intrinsics.pixels(fx=1, fy=2, cx=3, cy=4), "camera", "intrinsics"),
    (ks.Intrinsics.aperture(focal_length=24.0, horizontal_aperture=21.0, vertical_aperture=None), "camera", "intrinsics"),
    (ks.HitTargets.named(["ground"]), "ray_caster", "targets"),
    (ks.HitTargets.static_only, "ray_caster", "targets"),
    (ks.RayPattern.grid(ks.GridPattern(resolution=0.5)), "ray_caster", "pattern"),
    (ks.RayPattern.lidar(ks.LidarPattern()), "ray_caster", "pattern"),
    (ks.RayPattern.bpearl(ks.BpearlPattern()), "ray_caster", "pattern"),
    (ks.RayPattern.pinhole(ks.PinholePattern()), "ray_caster", "pattern"),
]


@pytest.mark.parametrize(("value", "kind", "field"), VARIANTS, ids=lambda v: str(v)[:30])
def test_constructors_of_variants(value, kind, field):
    name = value if isinstance(value, str) else next(iter(value))
    found = tomllib.loads(ks.to_toml({"entities": {"x": {"type": kind, field: value}}}))["entities"]["x"][field]
    assert name == found or name in found


def test_numbers_of_variants():
    """Numbers that a constructor leaves out are those of Rust."""
    camera = ks.CameraCfg(
        renderer=ks.CameraRenderer.ray_traced(samples=16),
        lens=ks.Lens.equidistant(ks.EquidistantLens(max_angle=1.5)),
        imperfections=ks.Imperfections(shot_noise=ks.ShotNoise(electrons=900.0), holes=ks.Holes()),
    )
    drive = ks.DriveCfg(actuators={"J1": ks.ActuatorModel.ideal_pd(), "J2": ks.ActuatorModel.delayed_pd(ks.DelayedPd(delay=3))})
    scene = {"entities": {"c": camera, "r": ks.RobotCfg(drive=drive)}}
    found = tomllib.loads(ks.to_toml(scene))["entities"]
    plain = tomllib.loads(ks.to_toml({"entities": {"c": ks.CameraCfg(renderer="ray_traced")}}))["entities"]["c"]
    assert found["c"]["renderer"] == {"ray_traced": {**plain["renderer"]["ray_traced"], "samples": 16}}
    assert plain["renderer"]["ray_traced"]["samples"] != 16
    assert found["c"]["lens"] == {"equidistant": {"max_angle": 1.5}}
    assert found["c"]["imperfections"] == {"shot_noise": {"electrons": 900.0}, "holes": all_fields(ks.Holes())}
    assert found["r"]["drive"]["actuators"] == {"J1": {"ideal_pd": {}}, "J2": {"delayed_pd": {"delay": 3, "max_delay": 0}}}


def test_declared_names_are_complete():
    """Names of enumerations that macros declare are refused or accepted by Rust as the classes say."""
    for name in ("force", "acceleration", "none"):
        ks.to_toml({"entities": {"x": {"type": "robot", "drive": {"drive_type": name}}}})
    with pytest.raises(ks.ConfigError) as error:
        ks.to_toml({"entities": {"x": {"type": "robot", "drive": {"drive_type": "?"}}}})
    assert all(f"`{name}`" in str(error.value) for name in ("force", "acceleration", "none"))
    assert str(error.value).count("`") == 8
    with pytest.raises(ks.ConfigError) as error:
        ks.to_toml({"entities": {"x": {"type": "ray_caster", "pattern": "?"}}})
    patterns = [name for name in dir(ks.RayPattern) if not name.startswith("_")]
    assert all(f"`{name}`" in str(error.value) for name in patterns) and len(patterns) == 5
    with pytest.raises(ks.ConfigError) as error:
        ks.to_toml({"entities": {"x": {"type": "robot", "drive": {"actuators": {"a": {"?": {}}}}}}})
    models = [name for name in dir(ks.ActuatorModel) if not name.startswith("_")]
    assert all(f"`{name}`" in str(error.value) for name in models) and len(models) == 3


def test_values_of_other_types():
    cube = {"type": "rigid_object", "rgba": np.array([0.5, 0.5, 0.5, 1]), "mass": np.float32(2), "shape": {"box": {"size": (1, 1, 1)}}}
    found = tomllib.loads(ks.to_toml({"entities": {"x": cube}}))["entities"]["x"]
    assert found["mass"] == 2.0 and found["rgba"] == [0.5, 0.5, 0.5, 1.0]
    urdf = {"type": "robot", "urdf": Path("a") / "b.urdf", "drive": {"max_effort": float("inf")}}
    found = tomllib.loads(ks.to_toml({"entities": {"x": urdf}}))["entities"]["x"]
    assert found["drive"]["max_effort"] == float("inf")
    loop = {}
    loop["self"] = loop
    for wrong in ({"type": "imu", "body": object()}, {"type": "imu", 3: 1}, {"type": "imu", "body": [None]}, loop):
        with pytest.raises(ks.ConfigError):
            ks.to_toml({"entities": {"x": wrong}})


MODULES = sorted(Path(cfg.__file__).parent.glob("*.py"))


def test_classes_are_documented():
    classes = 0
    for path in MODULES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef):
                classes += 1
                assert ast.get_docstring(node), node.name
                for at, item in enumerate(node.body):
                    if isinstance(item, ast.AnnAssign) and not item.target.id.startswith("_"):
                        after = node.body[at + 1]
                        assert isinstance(after, ast.Expr), f"{node.name}.{item.target.id}"
    assert classes == len([value for value in vars(cfg).values() if inspect.isclass(value)])


# Notation and names of Rust.
RUST = re.compile(r"\]\(|\[`|(?<!``cv)::(?!``)|\.into\(\)|\bSome\b|\bVec<|``\w*Mut\b|\bf32\b|\bf64\b|\busize\b|: None``")


def test_documentation_has_the_words_of_python():
    for path in MODULES:
        text = path.read_text()
        lines = text.split("\n")
        assert len(lines) <= 800, path.name
        found = [line for line in lines if RUST.search(line)]
        assert not found, (path.name, found)
        # No line of a text is longer than those of programs.
        assert not [line for line in lines if len(line) > 120 and '"""' in line], path.name
    # A control: such notation is found.
    for wrong in ("``Extrinsics::convention``", "a [link](target)", "``100.0.into()``", "``RobotMut``", "less than ``f32``"):
        assert RUST.search(wrong), wrong
    assert not RUST.search("``cv::fisheye`` and ``package://`` and ``xmlns:``")
    # Names in code with a dot are attributes or fields.
    names = set(re.findall(r"``([A-Z]\w+)\.(\w+)``", "".join(path.read_text() for path in MODULES)))
    assert len(names) > 10
    for owner, name in names:
        cls = getattr(ks, owner)
        assert hasattr(cls, name) or name in getattr(cls, "__dataclass_fields__", {}), f"{owner}.{name}"


def test_terrain_grids_compute_their_tiles():
    """Against the heights that a simulation has, and closed forms: 3 x 2 tiles of 4 x 2 m in a border of 1 m."""
    tiles = [ks.TileShare(tile=ks.TerrainTile.stairs_up(ks.StairsTile(step_height=[0.1, 0.2]))), ks.TileShare(tile=ks.TerrainTile.flat())]
    own = ks.TerrainGrid(tile_size=[4, 2], rows=3, columns=2, platform=0.8, border=1, tiles=tiles, difficulty=[0.2, 0.8])
    with ks.SimulationManager(num_envs=1, threads=1, ground=None) as sim:
        terrain = sim.add_terrain(heights=ks.TerrainGenerator.grid(own))
        heights = terrain.heights
        at = np.array([[terrain.height_at(*own.tile_center(row, column)) for column in range(2)] for row in range(3)])
    assert own.heights().tobytes() == heights.tobytes()
    assert own.size() == (3 * 4 + 2, 2 * 2 + 2)
    np.testing.assert_allclose(np.array(own.size())[::-1], (np.array(heights.shape) - 1) * own.cell)
    assert [own.tile_center(row, column) for row, column in ((0, 0), (1, 1), (2, 0))] == [(-4, -1), (0, 1), (4, -1)]
    np.testing.assert_allclose([own.row_difficulty(row) for row in range(3)], [0.2, 0.5, 0.8])
    # The center of a platform is its highest point, (4 - 0.8) / 2 / 0.3 or (2 - 0.8) / 2 / 0.3 steps above the rim.
    platforms = own.platform_heights()
    assert platforms.shape == (3, 2) and (platforms[:, 1] == 0).all()
    np.testing.assert_allclose(platforms, at, atol=1e-6)
    np.testing.assert_allclose(platforms[:, 0] / platforms[0, 0], [1, 0.15 / 0.12, 0.18 / 0.12])
    for row in range(3):
        for column in range(2):
            x, y = own.tile_center(row, column)
            assert {own.tile_at(x + dx, y + dy) for dx in (-1.9, 1.9) for dy in (-0.9, 0.9)} == {(row, column)}
    assert own.tile_at(6.5, 0) is None and own.tile_at(0, -2.1) is None
    with pytest.raises(ks.ArgumentError, match="is not a point"):
        own.tile_at(float("nan"), 0)
    with pytest.raises(ks.ConfigError, match="terrain grid"):
        ks.TerrainGrid(tile_size=[4, 2], cell=0.3).heights()
    with pytest.raises(OverflowError):
        own.tile_center(-1, 0)


def test_origins_of_environments_without_a_simulation():
    """Seven environments: two columns in four rows along -x, with 3 m between neighbors."""
    own = ks.SimulationManagerCfg(num_envs=7, arena_space=3, threads=1)
    expected = [[4.5 - 3 * (k // 2), 3 * (k % 2) - 1.5, 0] for k in range(7)]
    np.testing.assert_array_equal(own.env_origins(), expected)
    with ks.SimulationManager(own) as sim:
        np.testing.assert_array_equal(sim.env_origins, expected)


def test_matrices_of_intrinsics():
    """Against the camera of a simulation, and closed forms."""
    sensor = ks.Intrinsics.aperture(focal_length=24.0, horizontal_aperture=20.0, vertical_aperture=7.5, horizontal_offset=-1.0, vertical_offset=0.5)
    forms = {
        "aperture": (sensor, [[768, 0, 288], [0, 1536, 272], [0, 0, 1]]),
        "pixels": (ks.Intrinsics.pixels(fx=500, fy=510, cx=300, cy=200), [[500, 0, 300], [0, 510, 200], [0, 0, 1]]),
        # A right angle: half the height is the focal length.
        "fovy": (ks.Intrinsics.fovy(radians=np.pi / 2), [[240, 0, 320], [0, 240, 240], [0, 0, 1]]),
    }
    with ks.SimulationManager(num_envs=1, threads=1) as sim:
        for name, (intrinsics, expected) in forms.items():
            matrix = ks.Intrinsics.matrix(intrinsics, 640, 480)
            np.testing.assert_allclose(matrix, expected, rtol=1e-14)
            camera = sim.add_sensor(name, ks.CameraCfg(intrinsics=intrinsics, width=640, height=480))
            np.testing.assert_array_equal(camera.intrinsic_matrices[0], matrix)
            (fx, _, cx), (_, fy, cy), _ = matrix
            assert ks.Intrinsics.from_matrix(matrix.tolist()) == {"pixels": {"fx": fx, "fy": fy, "cx": cx, "cy": cy}}
    for wrong, message in (
        ([[1, 0.1, 2], [0, 1, 2], [0, 0, 1]], "0.1"),
        ([[0, 0, 2], [0, 1, 2], [0, 0, 1]], "fx of the lens is 0; it must be positive and finite"),
        ([[1, 0, 2]], r"from_matrix, matrix: the shape is \[1, 3\]; expected \(3, 3\)"),
    ):
        with pytest.raises(ks.ArgumentError, match=message):
            ks.Intrinsics.from_matrix(wrong)
    with pytest.raises(ks.ArgumentError, match="vertical angle"):
        ks.Intrinsics.matrix(ks.Intrinsics.fovy(radians=4.0), 640, 480)
    with pytest.raises(ks.ConfigError, match="unknown variant `fov`"):
        ks.Intrinsics.matrix({"fov": {"radians": 1.0}}, 640, 480)
