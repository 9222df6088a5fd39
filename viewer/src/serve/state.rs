//! JSON messages to the page: scene contents and state.

use crate::control::Speed;
use crate::scene_view::{EnvSelection, JointEntry, Names, Overlays, Selection, Snapshot, selection_text, slider_range};
use serde_json::{Value, json};

/// Name, label, and accessor of an overlay.
type Overlay = (&'static str, &'static str, fn(&mut Overlays) -> &mut bool);

/// All overlays.
pub(super) const OVERLAYS: [Overlay; 9] = [
    ("visuals", "visuals", |o| &mut o.visuals),
    ("collisions", "collision shapes", |o| &mut o.collisions),
    ("contacts", "contact forces", |o| &mut o.contacts),
    ("frames", "frames", |o| &mut o.frames),
    ("joints", "joint axes", |o| &mut o.joints),
    ("masses", "centers of mass", |o| &mut o.centers_of_mass),
    ("names", "names", |o| &mut o.names),
    ("trails", "trails", |o| &mut o.trails),
    ("sensors", "sensors", |o| &mut o.sensors),
];

/// Returns the scene contents: environments, robots with their joints, cameras, and overlays.
pub(super) fn scene_contents(snapshot: &Snapshot, overlays: &Overlays) -> Value {
    let mut overlays = *overlays;
    let overlays: Vec<Value> = OVERLAYS
        .iter()
        .map(|(name, title, of)| json!({"name": name, "title": title, "on": *of(&mut overlays)}))
        .collect();
    // Limits come from the first environment, since a slider has a single range.
    let limits = snapshot.envs.first().map(|env| env.joints.as_slice()).unwrap_or_default();
    let joint = |index: usize, name: &JointEntry| {
        let [.., lower, upper] = limits.get(index).copied().unwrap_or([f64::NAN; 4]);
        json!({
            "name": split_name(name).1,
            "unit": if name.is_prismatic { "m" } else { "rad" },
            "driven": name.accepts_target,
            "lower": json_number(lower),
            "upper": json_number(upper),
            "slider": slider_range([lower, upper], name.is_prismatic),
        })
    };
    let robots: Vec<Value> = joints_by_robot(&snapshot.names)
        .map(|(first, joints)| {
            let rows: Vec<Value> = joints.iter().enumerate().map(|(k, name)| joint(first + k, name)).collect();
            json!({"name": joints.first().map(|name| split_name(name).0), "joints": rows})
        })
        .collect();
    json!({
        "environments": snapshot.envs.len(),
        "robots": robots,
        "cameras": snapshot.names.cameras,
        "overlays": overlays,
    })
}

/// Returns the state, with time and joints of the shown environment, or of the first environment if all are shown.
pub(super) fn state(snapshot: &Snapshot, shown: EnvSelection, picked: Option<&Selection>, viewers: usize) -> Value {
    let (index, environment) = match shown {
        EnvSelection::All => (0, None),
        EnvSelection::One(env) => (env, Some(env)),
    };
    let env = snapshot.envs.get(index);
    let robots: Vec<Value> = joints_by_robot(&snapshot.names)
        .map(|(first, joints)| {
            let range = first..first + joints.len();
            let rows = env.and_then(|env| env.joints.get(range.clone())).unwrap_or_default();
            let efforts = env.and_then(|env| env.efforts.get(range)).unwrap_or_default();
            let column = |k: usize| rows.iter().map(|row| json_number(row[k])).collect::<Vec<_>>();
            let efforts: Vec<Value> = efforts.iter().map(|effort| json_number(*effort)).collect();
            json!({"positions": column(0), "targets": column(1), "efforts": efforts})
        })
        .collect();
    let speed = match snapshot.run.speed {
        Speed::Unlimited => Value::Null,
        Speed::Factor(factor) => json_number(factor),
    };
    let diverged = snapshot.envs.iter().enumerate().filter_map(|(k, env)| Some((k, env.snapshot.diverged.as_ref()?)));
    json!({
        "time": env.map_or(0.0, |env| env.snapshot.time),
        "steps": snapshot.run.steps,
        "paused": snapshot.run.paused,
        "speed": speed,
        "rate": snapshot.run.measured_speed.map_or(Value::Null, json_number),
        "environment": environment,
        "viewers": viewers,
        "robots": robots,
        "diverged": diverged.map(|(k, why)| format!("environment {k}: {why}")).collect::<Vec<_>>(),
        "refused": snapshot.run.last_refusal,
        "refusals": snapshot.run.refusal_count,
        "selected": picked.map(|picked| selection_json(picked, snapshot)),
        "recording": snapshot.run.recording.as_ref().map(|now| json!({"on": now.on, "text": now.text})),
        "timeline": snapshot.run.timeline.map(|line| json!({"now": line.time, "start": line.start, "end": line.end})),
    })
}

/// Returns the selection: pose and contact forces in the environment frame. Unknown values are null.
fn selection_json(picked: &Selection, snapshot: &Snapshot) -> Value {
    let pose = picked.pose(snapshot);
    let position = pose.map_or(picked.point, |pose| pose.translation.vector.into());
    let quaternion =
        pose.map(|pose| [pose.rotation.w, pose.rotation.i, pose.rotation.j, pose.rotation.k].map(json_number));
    let (contacts, force) = picked.contact_force(snapshot).unzip();
    json!({
        "name": picked.name,
        "environment": picked.env,
        "mask_id": picked.mask_id,
        "position": position.map(json_number),
        "quaternion": quaternion,
        "contacts": contacts,
        "force": force.map(|force| force.map(json_number)),
        "says": selection_text(picked, snapshot),
    })
}

/// Finds a joint with a target by the name of its robot and the name of the joint. The error is a text for an unknown
/// robot or joint, with the known names, or for a joint that accepts no target.
pub(super) fn find_joint<'a>(names: &'a Names, robot: &str, joint: &str) -> Result<&'a JointEntry, String> {
    let of_robot: Vec<&JointEntry> = names.joints.iter().filter(|name| split_name(name).0 == robot).collect();
    if of_robot.is_empty() {
        let robots: Vec<&str> =
            joints_by_robot(names).filter_map(|(_, joints)| Some(split_name(joints.first()?).0)).collect();
        return Err(format!("unknown robot {robot:?}; robots with joints: {robots:?}"));
    }
    let found = of_robot.iter().find(|name| split_name(name).1 == joint).copied();
    let found = found.ok_or_else(|| {
        let joints: Vec<&str> = of_robot.iter().map(|name| split_name(name).1).collect();
        format!("robot {robot:?} has no joint {joint:?}; it has {joints:?}")
    })?;
    if found.accepts_target { Ok(found) } else { Err(format!("joint {joint:?} has no drive or mimics another joint")) }
}

/// Returns the joints of each robot, with the index of its first joint.
fn joints_by_robot(names: &Names) -> impl Iterator<Item = (usize, &[JointEntry])> {
    let mut first = 0;
    names.joints.chunk_by(|a, b| a.robot == b.robot).map(move |joints| {
        let at = first;
        first += joints.len();
        (at, joints)
    })
}

/// Splits `uid/joint` into robot and joint.
fn split_name(name: &JointEntry) -> (&str, &str) {
    name.name.split_once('/').unwrap_or(("", &name.name))
}

/// Returns a number, or null for a non-finite value, which JSON cannot represent.
fn json_number(value: f64) -> Value {
    if value.is_finite() { json!(value) } else { Value::Null }
}
