//! Rows, states and properties of environments that do not fit are refused, and nothing changes.

use super::worlds::{ALL, Ids, all_bits, all_properties, all_values, arm, cfg, world};
use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::{Result, Snapshot};
use kinetoscope_testkit::error_tables::assert_errors_unchanged;

/// Snapshots that do not fit into the world of the tests, which has three environments.
struct Others {
    scene: Snapshot,
    two_states: Snapshot,
    four_states: Snapshot,
}

impl Others {
    fn new() -> Self {
        let mut scene = SimulationManager::new(cfg(3, 1)).unwrap();
        scene.add_robot(arm()).unwrap();
        let [two, four] = [2, 4].map(|envs| world(cfg(envs, 1)).0);
        let [scene, two_states, four_states] = [scene, two, four].map(|sim| sim.snapshot(ALL).unwrap());
        Self { scene, two_states, four_states }
    }
}

type Call = fn(&mut SimulationManager, Ids, &Others) -> Result<()>;

/// A call, the variant of its error, and parts of the message.
type Row = (&'static str, Call, &'static str, &'static [&'static str]);

fn draw(sim: &mut SimulationManager, property: Property, pattern: &str, draw: RandomizationOp) -> Result<()> {
    sim.properties_mut().randomize(&Randomization::new().with(property, pattern, draw), ALL)
}

fn set(sim: &mut SimulationManager, property: Property, name: &str, value: &[f64]) -> Result<()> {
    sim.properties_mut().randomize_with(ALL, |_, _, properties| properties.set(property, name, value))
}

fn rollout_from(sim: &mut SimulationManager, snapshot: &Snapshot) -> Result<()> {
    sim.rollout(&Array3::zeros((3, 2, 7)), Some(snapshot), ALL).map(drop)
}

const STATES: &[Row] = &[
    ("another scene", |sim, _, o| sim.restore(&o.scene, ALL), "Snapshot(OtherScene", &["another scene", "positions"]),
    (
        "another scene, with properties",
        |sim, _, o| sim.properties_mut().restore(&o.scene, ALL),
        "Snapshot(OtherScene",
        &["positions"],
    ),
    ("rollout of another scene", |sim, _, o| rollout_from(sim, &o.scene), "Snapshot(OtherScene", &["positions"]),
    ("rollout of two states", |sim, _, o| rollout_from(sim, &o.two_states), "Snapshot(EnvCount", &["2", "3"]),
    ("more states than environments", |sim, _, o| sim.restore(&o.four_states, ALL), "UnknownIndex", &["3"]),
    (
        "two states for three environments",
        |sim, _, o| sim.restore(&o.two_states, Some(&[0, 1, 2].map(EnvId))),
        "Snapshot(EnvCount { saved: 2, requested: 3",
        &["a single one for all"],
    ),
    (
        "states of an environment that does not exist",
        |sim, _, o| sim.restore(&o.two_states, Some(&[0, 3].map(EnvId))),
        "UnknownIndex { what: \"environment\", index: 3",
        &[],
    ),
    (
        "properties of an environment that does not exist",
        |sim, _, o| sim.properties_mut().restore(&o.two_states, Some(&[0, 3].map(EnvId))),
        "UnknownIndex",
        &["3"],
    ),
];

const ROWS: &[Row] = &[
    (
        "two rows for three environments",
        |sim, ids, _| sim.robot_mut(ids.arm).write_qpos(&Array2::zeros((2, 6)), None, None),
        "Shape",
        &["[2, 6]", "[3, 6]"],
    ),
    (
        "five numbers for six joints",
        |sim, ids, _| sim.robot_mut(ids.arm).write_qpos(&Array2::zeros((3, 5)), None, None),
        "Shape",
        &["[3, 5]", "[3, 6]"],
    ),
    (
        "NaN in the last row",
        |sim, ids, _| {
            let mut rows = Array2::zeros((3, 6));
            rows[(2, 4)] = f64::NAN;
            sim.robot_mut(ids.arm).write_qpos(&rows, None, None)
        },
        "NotFinite",
        &["[2, 4]", "JOINT5", "NaN"],
    ),
    (
        "infinite velocity",
        |sim, ids, _| sim.rigid_object_mut(ids.cube).write_velocity(&array![[f64::INFINITY, 0., 0., 0., 0., 0.]], None),
        "NotFinite",
        &["cube", "inf"],
    ),
    (
        "NaN in a control",
        |sim, ids, _| sim.mjcf_part_mut(ids.machine).set_ctrl(&array![[f64::NAN]], None, None),
        "NotFinite",
        &["motor", "NaN"],
    ),
];

const DRAWS: &[Row] = &[
    (
        "mass below 0",
        |sim, _, _| draw(sim, Property::Mass, "cube", RandomizationOp::Add([-2.0, -1.0])),
        "Randomization(Value { env: 0, property: \"mass\", name: \"cube\"",
        &["kg"],
    ),
    (
        "mass too small",
        |sim, _, _| draw(sim, Property::Mass, "cube", RandomizationOp::Set([5e-16, 5e-16])),
        "Randomization(Value",
        &["at least 1e-15 kg"],
    ),
    // Such a mass is allowed, but not the moments that scale with it here.
    (
        "moments too small",
        |sim, _, _| draw(sim, Property::Mass, "cube", RandomizationOp::Set([2e-15, 2e-15])),
        "Randomization(Value { env: 0, property: \"inertia\", name: \"cube\"",
        &["moments of inertia must be positive"],
    ),
    (
        "moments below 0",
        |sim, _, _| draw(sim, Property::Inertia, "cube", RandomizationOp::Add([-1.0, -1.0])),
        "Randomization(Value",
        &["positive"],
    ),
    (
        "moments of no body",
        |sim, _, _| set(sim, Property::Inertia, "cube", &[1.0, 1.0, 2.1]),
        "Randomization(Value",
        &["sum of the others"],
    ),
    (
        "friction below 0",
        |sim, _, _| draw(sim, Property::Friction, "ground", RandomizationOp::Set([-0.1, -0.1])),
        "Randomization(Value { env: 0, property: \"friction\", name: \"ground\"",
        &[">= 0"],
    ),
    (
        "damping below 0",
        |sim, _, _| draw(sim, Property::JointDamping, "machine/hinge", RandomizationOp::Set([-1.0, -1.0])),
        "Randomization(Value { env: 0, property: \"joint_damping\", name: \"machine/hinge\"",
        &[">= 0"],
    ),
    (
        "armature below 0",
        |sim, _, _| draw(sim, Property::Armature, "arm/JOINT1", RandomizationOp::Set([-1.0, -1.0])),
        "Randomization(Value { env: 0, property: \"armature\", name: \"arm/JOINT1\"",
        &[">= 0"],
    ),
    (
        "effort limit below 0",
        |sim, _, _| draw(sim, Property::MaxEffort, "arm/JOINT1", RandomizationOp::Set([-1.0, -1.0])),
        "Randomization(Value { env: 0, property: \"max_effort\", name: \"arm/JOINT1\"",
        &[">= 0"],
    ),
    // The first environments are valid.
    (
        "mass of the last environment",
        |sim, _, _| {
            let mass = |env: EnvId| [1.0 - 0.5 * env.0 as f64];
            sim.properties_mut().randomize_with(ALL, |_, env, p| p.set(Property::Mass, "cube", &mass(env)))
        },
        "Randomization(Value { env: 2, property: \"mass\", name: \"cube\", value: [0.0]",
        &["environment 2"],
    ),
    (
        "color above 1",
        |sim, _, _| set(sim, Property::Color, "cube", &[1.5, 0.0, 0.0, 1.0]),
        "Randomization(Value",
        &["0 to 1"],
    ),
    (
        "gravity NaN",
        |sim, _, _| set(sim, Property::Gravity, "gravity", &[0.0, f64::NAN, 0.0]),
        "Randomization(Value",
        &["finite"],
    ),
    (
        "a misspelt name",
        |sim, _, _| draw(sim, Property::Mass, "cub", RandomizationOp::Scale([1.0, 1.0])),
        "Randomization(Pattern",
        &["mass", "\"cub\"", "\"cube\""],
    ),
    (
        "two terms for a name",
        |sim, _, _| {
            let op = RandomizationOp::Scale([1.0, 1.0]);
            let terms = Randomization::new().with(Property::Mass, "cube", op).with(Property::Mass, "c.*", op);
            sim.properties_mut().randomize(&terms, ALL)
        },
        "Randomization(Pattern",
        &["\"cube\"", "both"],
    ),
    // Joints whose implicit drive uses the friction row, and the free joint of an object, do not have this property.
    (
        "dry friction of driven joints",
        |sim, _, _| draw(sim, Property::DryFriction, "arm/JOINT1|cube/free", RandomizationOp::Set([1.0, 1.0])),
        "Randomization(Pattern { property: \"dry_friction\"",
        &["matches no"],
    ),
    (
        "range in the wrong order",
        |sim, _, _| draw(sim, Property::Mass, "cube", RandomizationOp::Set([1.0, 0.5])),
        "Randomization(Range",
        &["1..0.5"],
    ),
    (
        "range from NaN",
        |sim, _, _| draw(sim, Property::Mass, "cube", RandomizationOp::Set([f64::NAN, 1.0])),
        "Randomization(Range",
        &["finite ends"],
    ),
    (
        "range without end",
        |sim, _, _| draw(sim, Property::Mass, "cube", RandomizationOp::Set([0.0, f64::INFINITY])),
        "Randomization(Range",
        &["inf"],
    ),
    (
        "one number for gravity",
        |sim, _, _| set(sim, Property::Gravity, "gravity", &[0.0]),
        "Randomization(Width { property: \"gravity\", name: \"gravity\", found: 1, expected: 3",
        &[],
    ),
    ("a misspelt body", |sim, _, _| set(sim, Property::Mass, "kube", &[0.5]), "UnknownName", &["\"kube\"", "cube"]),
    (
        "draw in an environment that does not exist",
        |sim, _, _| sim.properties_mut().randomize(&Randomization::new(), Some(&[EnvId(7)])),
        "UnknownIndex",
        &["7"],
    ),
    (
        "properties of an environment that does not exist",
        |sim, _, _| sim.properties().of(EnvId(3)).map(drop),
        "UnknownIndex",
        &["3"],
    ),
    (
        "two rows of values for three environments",
        |sim, _, _| sim.properties_mut().set(Property::Mass, "cube", &array![[0.4], [0.6]], ALL),
        "Shape",
        &["[2, 1]", "[3, 1]"],
    ),
    (
        "mass of the last row",
        |sim, ids, _| sim.rigid_object_mut(ids.cube).set_mass(&array![0.4, 0.6, f64::NAN], ALL),
        "NotFinite",
        &["set_mass", "NaN"],
    ),
];

/// Every mistake, in environments that have own properties, and in others.
#[test]
fn mistakes() {
    let others = Others::new();
    let (sim, ids) = world(cfg(3, 2));
    let mut state = (sim, ids);
    state.0.properties_mut().randomize(&all_properties(), Some(&[EnvId(1)])).unwrap();
    state.0.update(20);
    let fingerprint = |(sim, _): &(SimulationManager, Ids)| (all_bits(sim), all_values(sim));
    let rows = STATES.iter().chain(ROWS).chain(DRAWS);
    assert_errors_unchanged(
        &mut state,
        fingerprint,
        rows.map(|(what, call, variant, parts)| (what, call, variant, parts)),
        |(sim, ids), call| call(sim, *ids, &others),
    );
    // Mistakes do not advance the random streams either.
    let (mut other, _) = world(cfg(3, 2));
    for sim in [&mut state.0, &mut other] {
        sim.properties_mut().randomize(&all_properties(), Some(&[EnvId(0)])).unwrap();
    }
    assert_eq!(all_values(&state.0)[0], all_values(&other)[0]);
}
