"""The Python package has the methods of the Rust types that programs get, and the free functions: a Rust method or function
without a name in Python fails here until it gets one, or a reason."""

from functools import cache, reduce

from rust_api import rust_api
from test_sim_sensors import scene  # noqa: F401, the fixture

import kinetoscope as ks

# Rust types that programs get from a simulation, with the Python classes that have their methods.
VIEWS = {
    "Camera": [ks.Sensor],
    "CameraPlacement": [ks.Sensor],
    "ContactSensor": [ks.Sensor],
    "ActuatorState": [ks.Sensor],
    "Chain": [ks.KinematicChain],
    "Dynamics": [ks.Robot],
    "Entities": [ks.SimulationManager, ks.Sensor],
    "Env": [ks.Task],
    "EnvProperties": [ks.SimulationManager],
    "EnvPropertiesMut": [ks.SimulationManager],
    "FileRecording": [ks.FileRecording],
    "FoxgloveServer": [ks.FoxgloveServer],
    "FrameTransformer": [ks.Sensor],
    "IkSolver": [ks.KinematicChain],
    "ImageWindow": [ks.ImageWindow],
    "Imu": [ks.Sensor],
    "InteractiveScene": [ks.SimulationManager, ks.Sensor],
    "JointState": [ks.Sensor],
    "JointWrench": [ks.Sensor],
    "MjcfPart": [ks.MjcfPart],
    "MjcfPartMut": [ks.MjcfPart],
    "MujocoSensor": [ks.Sensor],
    "ObservationGroup": [ks.Task],
    "OpenWindow": [ks.SimulationManager],
    "Play": [ks.Playback],
    "Playback": [ks.Playback],
    "Properties": [ks.SimulationManager],
    "RayCaster": [ks.Sensor],
    "RayCasterCamera": [ks.Sensor],
    "Record": [ks.SimulationManager, ks.Recorder],
    "Recorder": [ks.Recorder, ks.RecordingSummary],
    "Recording": [ks],
    "RigidObject": [ks.RigidObject],
    "RigidObjectGroup": [ks.RigidObjectGroup],
    "RigidObjectGroupMut": [ks.RigidObjectGroup],
    "RigidObjectMut": [ks.RigidObject],
    "Robot": [ks.Robot],
    "RobotMut": [ks.Robot],
    "RobotPartMut": [ks.Robot],
    "Sampled": [ks.Sensor],
    "SceneView": [ks.SimulationManager, ks.Sensor],
    "SceneViewMut": [ks.SimulationManager, ks.Sensor],
    "Screenshot": [ks.SimulationManager],
    "Segmentation": [ks.Segmentation],
    "Serve": [ks.SimulationManager],
    "ServerHandle": [ks.Server],
    "SimulationManager": [ks.SimulationManager],
    "Snapshot": [ks.Snapshot],
    "StereoCamera": [ks.Sensor],
    "StreamToFoxglove": [ks.SimulationManager],
    "Terrain": [ks.Terrain],
    "TerrainGrid": [ks.TerrainGrid],
    "Viewer": [ks.Viewer],
    "ViewerExt": [ks.SimulationManager],
    "Warnings": [ks.SimulationManager],
    "Weld": [ks.Weld],
    "WeldMut": [ks.Weld],
    "Window": [ks.Window],
}

# Exported types with methods that are not in Python as classes, by reason.
NOT_VIEWS = {
    "configurations and parts of them, which are dataclasses, dicts or texts in Python": """
        Boxes CameraConvention CameraInfo ComponentCfg ContactSensorCfg DelayedPd DiscreteObstacles EnvSelection Extrinsics Flat FoxgloveCfg
        FrameTransformerCfg Gap IkCfg ImuCfg Integrator LightCfg MjcfFile MjcfPartCfg NameCase NoiseCfg NullSpacePosture ObjectShape OrbitCamera
        Overlays Property PyramidSlope PyramidStairs Randomization RayAlignment RayPattern RecorderCfg RoughTerrain SamplingCfg SceneCfg
        SegmentationCfg Shard SimulationManagerCfg Slope SteppingStones StereoCameraCfg SurfaceCfg TargetFrameCfg TaskCfg TerrainCfg TerrainTile
        TipFrame UrdfCfg Waves AutoresetMode""",
    "results that are dicts, tuples or texts in Python": """
        Box3d Closed Diagnostic DiagnosticKind DistortionModel EndedEpisode FieldSelector Format ImageBatch MaskId Occlusion Rectification
        ReplayResult RobotReport SegmentedEntity SourceLocation Space StreamField StreamSchema Topic EventKind""",
    "parts of the description of a robot: Robot.description and inspect have their values": """
        Configuration CouplingPolynomial HullSet JointKind Link MeshKey RigidInertia RobotDescription Tree""",
    "pixels and arrays, which are NumPy arrays in Python": "Canvas History RayImages RobotState",
    "poses and files of arrays, which are NumPy arrays in Python, too": "ElementType NpyElement PoseF32 PoseF64",
    "random numbers, which numpy.random has in Python": "AreaSampling KeyedRng OrthonormalBasis Philox",
    "meshes, which the packages trimesh and scipy have in Python; simulations read the files": "HullCache RenderMesh TextureSource TriMesh",
    "traits and types with which Rust programs add sensors, tasks, entities or viewers of their own": """
        ActionTerm AnySensorCfg AnySensorId CommandTerm Contacts CurriculumTerm DevicePhysics EntityTypes EnvBuilder EpisodeRng EventContext
        EventTerm ImageTerm ObservationTerm Observer Observers ObserversMut Phases PlaybackSource Poses RecordButton RecordControl
        RewardTerm SampleChannel Sampler SceneState Schedule Sensor SensorCfg SensorContext SensorSlot SensorTypeVisitor StateFields
        StateRequirements StepResult TermArgs TermContext TermRegistry TerminationTerm VectorEnv""",
    "scenes for renderers, which kinetoscope-render has": """
        CameraFit ClosedForm ClosedFormVisitor Headlight Instance Marker Material MipLevel OffscreenScene PlaneLines Ray RenderScene Sky Texture
        Triangulated TriangleSampling VisualScene""",
    "modules that other crates of the project use": "App AtomicFile LineStarts Pattern Value",
    "a flag of Rust programs; SimulationManager.stream_to_foxglove has the server": "FoxgloveStream",
}

# Rust methods with another name in Python, or a name of which they are a part.
RENAMED = {
    "ActuatorState.actuator_names": "columns",
    "ActuatorState.control_history": "history",
    "ActuatorState.force_history": "history",
    "Camera.channel": "__getitem__",
    "Camera.frame_counts": "sample_counts",
    "Chain.between": "__new__",
    "Chain.is_moved_by": "joint_names",
    "Chain.new": "__new__",
    "Chain.pose": "compute_fk",
    "Chain.variables": "dof",
    "ContactSensor.body_names": "columns",
    "Dynamics.dof_count": "dof",
    "Entities.articulated_id": "__getitem__",
    "Entities.articulated_uids": "keys",
    "Entities.articulation_id": "__getitem__",
    "Entities.mjcf_id": "__getitem__",
    "Entities.mjcf_uids": "keys",
    "Entities.rigid_object_id": "__getitem__",
    "Entities.rigid_object_uids": "keys",
    "Entities.robot_id": "__getitem__",
    "Entities.robot_ids": "keys",
    "Entities.sensor_by_uid": "__getitem__",
    "Entities.sensor_due_in": "due_in",
    "Entities.sensor_ids": "keys",
    "Entities.sensor_uids": "keys",
    "Entities.terrain": "__getitem__",
    "Env.group": "group_space",
    "Env.groups": "group_names",
    "EnvPropertiesMut.set": "set_property",
    "FoxgloveServer.address": "url",
    "FrameTransformer.target_frame_names": "columns",
    "IkSolver.new": "compute_ik",
    "IkSolver.solve": "compute_ik",
    "ImageWindow.open": "__new__",
    "ImageWindow.window": "is_open",
    "InteractiveScene.new": "from_scene",
    "InteractiveScene.reset_to_default": "reset",
    "JointState.effort_history": "history",
    "JointState.effort_stamps": "force_stamps",
    "JointState.joint_names": "columns",
    "JointState.velocity_history": "history",
    "JointWrench.link_names": "columns",
    "MujocoSensor.names": "columns",
    "ObservationGroup.final_image": "images",
    "ObservationGroup.final_observations": "observations",
    "ObservationGroup.final_observations_f32": "observations",
    "ObservationGroup.image": "images",
    "ObservationGroup.name": "group_names",
    "ObservationGroup.observations_f32": "observations",
    "ObservationGroup.space": "group_space",
    "OpenWindow.open_window_with": "open_window",
    "Playback.open": "__new__",
    "Properties.get": "property",
    "Properties.names": "property_names",
    "Properties.nominal": "nominal_property",
    "RayCasterCamera.frame_counts": "sample_counts",
    "RayCaster.hit_ids": "__getitem__",
    "Record.finish_recording": "finish",
    "Recorder.has_failed": "failure",
    "Recorder.streams": "left_out",
    "Recorder.summary": "packets",
    "Recording.time_series": "read_series",
    "Recording.topic": "read_series",
    "Recording.topics": "recording_topics",
    "RigidObjectGroup.is_empty": "__len__",
    "RigidObjectGroup.len": "__len__",
    "Robot.is_driven": "driven_joint_ids",
    "Robot.is_link_fixed": "fixed_link_ids",
    "Robot.is_mimic": "mimic_joint_ids",
    "Robot.joint_id": "find_joints",
    "Robot.link_id": "find_links",
    "RobotMut.into_part": "set_qpos_target",
    "Sampled.sampler": "channels",
    "Sampled.schedule": "update_period",
    "Screenshot.render_image": "screenshot",
    "Screenshot.screenshot_with": "screenshot",
    "Segmentation.segment_of": "segments",
    "Serve.serve_with": "serve",
    "ServerHandle.address": "url",
    "SimulationManager.articulation": "__getitem__",
    "SimulationManager.new": "__new__",
    "SimulationManager.robot": "__getitem__",
    "Env.step_until": "step",
    "Snapshot.is_empty": "__len__",
    "Snapshot.len": "__len__",
    "StereoCamera.has_disparity": "channels",
    "StereoCamera.left": "__getitem__",
    "StereoCamera.right": "__getitem__",
    "Terrain.cfg": "heights",
    "Viewer.newest": "state",
    "Viewer.send": "pause",
    "ViewerExt.update_without_waiting": "update",
    "Warnings.counts": "warnings",
    "Warnings.env_counts": "env_warnings",
    "Weld.cfg": "uid",
    "Window.closed": "failure",
    "Camera.schedule": "update_period",
    "StereoCamera.latest_delivered_disparity": "latest_delivered",
}

READS = "sensors and views of a simulation are subscripts and attributes of Python objects, not borrows"
GIVEN = "the program gave it"
EXTENSION = "for observers and viewers written in Rust"
MUJOCO = "MuJoCo's own data, which the package mujoco has in Python"
LIST = "a list of Python is read by its index"
# Rust methods that Python leaves out, with the reason.
LEFT_OUT = {
    "Camera.history_filled": "with sample_counts and the length of history",
    "Camera.history_length": GIVEN,
    "Camera.images": "all channels at once are a loop over the names",
    "Camera.lens": GIVEN,
    "Camera.lens_bytes": "a measure for tests of memory",
    "Camera.optics": "camera_info has the calibration; OpenCV computes with it",
    "Camera.path": "the uid and the parent that the program gave",
    "Camera.render_count": "a measure for tests of laziness",
    "Camera.renders_markers": GIVEN,
    "Camera.view": "pose_w and intrinsic_matrices",
    "Chain.reduce_into": "joints that do not move the tip have no column",
    "Chain.reduced": "joints that do not move the tip have no column",
    "ContactSensor.find_bodies": LIST,
    "ContactSensor.force_threshold": GIVEN,
    "Dynamics.dof_range": "the columns are those of mass_matrix",
    "Dynamics.new": "a robot of a simulation has the methods, and inspect the values without one",
    "Env.cfg": GIVEN,
    "Env.context": "for terms written in Rust",
    "Env.into_sim": "the simulation of a task is usable after close",
    "EnvProperties.bytes": "a measure for tests of memory",
    "EnvProperties.of": "property has the values of all environments",
    "EnvPropertiesMut.randomize_with": "a function of Rust per environment; set_property takes NumPy arrays",
    "FileRecording.new": "made by SimulationManager.file_recording",
    "IkSolver.chain": "the chain has the solver",
    "InteractiveScene.into_sim": "a SimulationManager is a scene, too",
    "JointState.joints": LIST,
    "MjcfPart.cfg": GIVEN,
    "MjcfPart.model": MUJOCO,
    "MujocoSensor.columns_of": LIST,
    "MujocoSensor.dims": LIST,
    "MujocoSensor.sensors": MUJOCO,
    "MujocoSensor.value": LIST,
    "MujocoSensor.value_history": LIST,
    "Properties.set": "for functions of randomize_with",
    "RayCaster.latest_delivered_hits": "numeric sensors: history has the delivered values",
    "RayCaster.num_rays": "the second length of its arrays",
    "RayCaster.target_instances": "the targets that the program gave",
    "RayCasterCamera.images": "all channels at once are a loop over the names",
    "RayCasterCamera.points": "point_map and point_cloud",
    "Recorder.wait_until_written": "for tests; finish waits",
    "Recording.env_ids": "the names of topics have the environments",
    "Recording.open": "functions of Python open the file themselves",
    "Recording.path": GIVEN,
    "Recording.warnings": "messages of other programs that cannot be read",
    "RigidObject.cfg": GIVEN,
    "Robot.gather_state": "properties return new arrays",
    "Sampled.force_stamp_history": "stamp_history has the times of the rows",
    "Sampled.history_filled": "with sample_counts and the length of history",
    "Sampled.latest_delivered_force_stamps": "numeric sensors: history has the delivered values",
    "SceneView.device_failure": "update raises it",
    "SceneView.with_device": "device_array has the arrays",
    "SceneView.body_motion": "velocities are properties of robots and objects",
    "SceneView.markers": EXTENSION,
    "SceneView.markers_except": EXTENSION,
    "SceneView.viewpoint": EXTENSION,
    "SceneViewMut.env_scene": "scenes for renderers, which kinetoscope-render has",
    "SceneViewMut.read_visual_state": EXTENSION,
    "SceneViewMut.set_point_forces": "forces of the mouse in viewers; set_external_wrench acts on links and objects",
    "SceneViewMut.visual_scene": "scenes for renderers, which kinetoscope-render has",
    "SceneViewMut.with_mujoco": MUJOCO,
    "Screenshot.overview_camera": "screenshot uses it by default",
    "Segmentation.colorize_into": "NumPy arrays are new; colors are copied once",
    "Segmentation.colorize_segments": "colorize takes the mask",
    "Segmentation.new": "made by SimulationManager.segmentation",
    "Segmentation.segment_into": "NumPy arrays are new; ids are copied once",
    "SimulationManager.entities": READS,
    "SimulationManager.observers": EXTENSION,
    "SimulationManager.properties": READS,
    "SimulationManager.scene": READS,
    "SimulationManager.sensor": READS,
    "SimulationManager.weld": READS,
    "SimulationManager.rigid_object": READS,
    "SimulationManager.rigid_object_group": READS,
    "SimulationManager.mjcf_part": READS,
    "SimulationManager.with_mujoco": MUJOCO,
    "StereoCamera.left_from_right": GIVEN,
    "TerrainGrid.check": "the other methods check the grid",
    "TerrainGrid.tile": "the shares of the tiles, which the program gave",
    "TerrainGrid.tile_seed": "for heights, which compute it",
    "Viewer.add_viewer": "SimulationManager.viewer",
    "Viewer.has_ended": "a call of an ended simulation raises",
    "Viewer.set_request": "snapshots of viewers are not in Python",
    "Viewer.wait": "snapshots of viewers are not in Python",
    "Warnings.buffer_growths": "a measure for tests of memory",
    "Window.id": "for tests that capture windows",
}


# Exported functions of Rust, by crate, with their names in Python.
FUNCTIONS = {
    "record": {
        "frame_at": "Playback.frame_at",
        "recover": "recover",
        "recover_to": "recover",
        "verify": "SimulationManager.verify_recording",
        "verify_until": "SimulationManager.verify_recording",
    },
    "robot": {
        "assemble": "assemble_urdf",
        "link_poses": "KinematicChain.compute_link_fk",
        "own_limit": "KinematicChain.qpos_limits",
        "parse_file": "inspect",
        "parse_file_with": "inspect",
        "position_ranges": "KinematicChain.qpos_limits",
        "write_urdf": "assemble_urdf",
    },
    "sensors": {"look_at_pose": "Placement.look_at"},
    "sim": {
        "describe": "KinematicChain.__new__",
        "inspect": "inspect",
        "rollout_until": "SimulationManager.rollout",
        "update_until": "SimulationManager.update",
    },
    ".": {
        "path": "asset",
        "quadruped": "bundled_robot",
        "revo1_left": "bundled_robot",
        "sr5": "bundled_robot",
        "sr5_with_hand": "bundled_robot",
    },
}
# Exported functions that are not in Python, by crate and reason.
FUNCTIONS_LEFT_OUT = {
    ("record", "the program that built the recorded simulation gave the number"): "num_envs",
    ("robot", "steps of add_robot and inspect"): "complete count_by_name fuse planar_axes rigid_bodies solid_ball_inertial",
    ("robot", "functions of Python read files, which may be temporary"): "parse_str parse_str_with",
    ("robot", "the text is easy to change: str.replace, or xml.etree"): "write_urdf_with",
    ("scene", "vectors, poses and quaternions, which NumPy and scipy.spatial.transform compute"): """
        add add_scaled cos_sin_turns cross dot from_row from_wxyz from_xyz_rpy from_xyzw norm normalize scale sub to_f64 to_row to_wxyz
        try_normalize""",
    ("scene", "meshes, which the packages trimesh, scipy and coacd have; configurations of objects name files, hulls and pieces"): """
        convex_decomposition convex_hull load load_bytes load_with prisms smooth_normals write_binary_stl write_obj""",
    ("scene", "files of arrays, which NumPy reads and writes"): "header write",
    ("scene", "names, patterns and files, which the classes check themselves"): """
        assign closest_names format_candidates parse read_named read_named_text read_referenced read_referenced_text select similar_name
        strip_env_prefix""",
    ("scene", "for renderers"): "decode_srgb sample_cosine_hemisphere sample_disk",
    ("sensors", "colors of viewers and videos; Segmentation.colorize, and color maps of matplotlib"): """
        depth_color mask_color normal_color segment_color""",
    ("sim", "for packages with the physics of a device; this one has its own"): "set_device_opener",
    ("tasks", "terms are dicts with their names"): """
        action_rate generated_commands is_alive joint_efforts joint_pos_rel joint_vel last_action relative_joint_positions""",
    ("tasks", "for terms written in Rust"): "env_ids",
    ("tasks", "for environments written in Rust; gymnasium.utils.env_checker checks those of Python"): "check",
    ("viewer", "plots, which matplotlib draws; read_series has the numbers"): "canvas write",
    (".", "the environment variable KINETOSCOPE_ASSETS names the folder"): "set_folder",
}


@cache
def api():
    return rust_api()


def rust_methods():
    """Public methods of the exported types and traits, by type: a set of names each."""
    return api()[0]


def test_every_type_is_known():
    """A new exported type with methods gets a class of Python, or a place in the table of reasons."""
    methods = rust_methods()
    others = {name for names in NOT_VIEWS.values() for name in names.split()}
    assert not others & set(VIEWS)
    known = others | set(VIEWS)
    assert len(methods) > 100 and set(methods) - known == set(), "types without a class or a reason"
    assert known - set(methods) == set(), "types of the tables that do not exist"


def test_every_method_has_a_name_in_python(scene):  # noqa: F811
    """Also a channel of a sensor is a name: ``sensor["hits"]`` is ``RayCaster::hits``."""
    channels = {channel for name in scene for channel in (scene[name].channels if isinstance(scene[name], ks.Sensor) else ())}
    missing, stale = [], {*RENAMED, *LEFT_OUT}
    for rust, names in rust_methods().items():
        # The methods of a scene to find entities by name are subscripts.
        stems = {name.removesuffix("_id") for name in names if name.endswith("_id")} | {"mjcf_part"}
        found = {name for name in names if rust == "InteractiveScene" and name.removesuffix("_mut").removesuffix("_id") in stems}
        for name in sorted(names - found if rust in VIEWS else ()):
            owners, full = VIEWS[rust], f"{rust}.{name}"
            if any(hasattr(owner, name) for owner in owners):
                continue
            if name.endswith("_mut") or name in ("read", "sim"):
                # Views that write, and the same view for reading.
                continue
            is_sensor = owners == [ks.Sensor]
            if is_sensor and (name in channels or name.removesuffix("_history") in channels):
                continue
            stale.discard(full)
            renamed = RENAMED.get(full)
            if renamed is not None:
                assert any(hasattr(owner, renamed) for owner in owners), (full, renamed)
            elif full not in LEFT_OUT:
                missing.append(full)
    assert not missing, f"without a name in Python or a reason: {missing}"
    assert not stale, f"reasons that are not needed any more: {sorted(stale)}"
    assert not set(RENAMED) & set(LEFT_OUT)


def test_every_function_has_a_name_in_python():
    """A new exported function gets a name in Python, or a place in the table of reasons."""
    functions = api()[1]
    assert sum(map(len, functions.values())) > 90
    left_out = [(crate, name) for (crate, _), names in FUNCTIONS_LEFT_OUT.items() for name in names.split()]
    named = [(crate, name) for crate, names in FUNCTIONS.items() for name in names]
    known = [*left_out, *named]
    assert len(known) == len(set(known))
    found = {(crate, name) for crate, names in functions.items() for name in names}
    assert found - set(known) == set(), "functions without a name in Python or a reason"
    assert set(known) - found == set(), "functions of the tables that do not exist"
    for names in FUNCTIONS.values():
        for path in names.values():
            assert callable(reduce(getattr, path.split("."), ks)) or path == "KinematicChain.qpos_limits", path


def test_exported_items_are_found():
    """Controls of the search in the sources: items of public modules, names of nested lists, and nothing of private modules."""
    methods, functions = api()
    assert {"RobotDescription", "Chain", "TriMesh", "FileRecording", "SimulationManager"} <= set(methods)
    assert {"between", "pose"} <= methods["Chain"] and "build" not in methods["Chain"]
    assert "link_poses" in functions["robot"] and "mimic_relations" not in functions["robot"] and "describe" in functions["sim"]
    assert "JointPlan" not in methods and "write_urdf" in functions["robot"]
