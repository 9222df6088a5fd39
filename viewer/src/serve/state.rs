//! JSON messages to the page: scene contents and state.

use crate::control::Speed;
use crate::stage::{JointName, Names, Overlays, Picked, Shown, Snapshot, describe, slider_range};
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
    ("masses", "centres of mass", |o| &mut o.masses),
    ("names", "names", |o| &mut o.names),
    ("trails", "trails", |o| &mut o.trails),
    ("sensors", "sensors", |o| &mut o.sensors),
];

/// Returns the scene contents: environments, robots with their joints, cameras, and overlays.
pub(super) fn contents(snapshot: &Snapshot, overlays: &Overlays) -> Value {
    let mut overlays = *overlays;
    let overlays: Vec<Value> = OVERLAYS
        .iter()
        .map(|(name, title, of)| json!({"name": name, "title": title, "on": *of(&mut overlays)}))
        .collect();
    // Limits come from the first environment, since a slider has a single range.
    let limits = snapshot.envs.first().map(|env| env.joints.as_slice()).unwrap_or_default();
    let joint = |index: usize, name: &JointName| {
        let [.., lower, upper] = limits.get(index).copied().unwrap_or([f64::NAN; 4]);
        json!({
            "name": parts(name).1,
            "unit": if name.slides { "m" } else { "rad" },
            "driven": name.driven,
            "lower": finite(lower),
            "upper": finite(upper),
            "slider": slider_range([lower, upper], name.slides),
        })
    };
    let robots: Vec<Value> = by_robot(&snapshot.names)
        .map(|(first, joints)| {
            let rows: Vec<Value> = joints.iter().enumerate().map(|(k, name)| joint(first + k, name)).collect();
            json!({"name": joints.first().map(|name| parts(name).0), "joints": rows})
        })
        .collect();
    json!({
        "environments": snapshot.envs.len(),
        "robots": robots,
        "cameras": snapshot.names.cameras,
        "overlays": overlays,
    })
}

/// Returns the state, with the joints of the shown environment, or of the first.
pub(super) fn state(snapshot: &Snapshot, shown: Shown, picked: Option<&Picked>, viewers: usize) -> Value {
    let (index, environment) = match shown {
        Shown::All => (0, None),
        Shown::One(env) => (env, Some(env)),
    };
    let env = snapshot.envs.get(index);
    let robots: Vec<Value> = by_robot(&snapshot.names)
        .map(|(first, joints)| {
            let range = first..first + joints.len();
            let rows = env.and_then(|env| env.joints.get(range.clone())).unwrap_or_default();
            let efforts = env.and_then(|env| env.efforts.get(range)).unwrap_or_default();
            let column = |k: usize| rows.iter().map(|row| finite(row[k])).collect::<Vec<_>>();
            let efforts: Vec<Value> = efforts.iter().map(|effort| finite(*effort)).collect();
            json!({"positions": column(0), "targets": column(1), "efforts": efforts})
        })
        .collect();
    let speed = match snapshot.run.speed {
        Speed::Free => Value::Null,
        Speed::Times(factor) => finite(factor),
    };
    let diverged = snapshot.envs.iter().enumerate().filter_map(|(k, env)| Some((k, env.look.diverged.as_ref()?)));
    json!({
        "time": env.map_or(0.0, |env| env.look.time),
        "steps": snapshot.run.steps,
        "paused": snapshot.run.paused,
        "speed": speed,
        "rate": snapshot.run.measured_speed.map_or(Value::Null, finite),
        "environment": environment,
        "viewers": viewers,
        "robots": robots,
        "diverged": diverged.map(|(k, why)| format!("environment {k}: {why}")).collect::<Vec<_>>(),
        "refused": snapshot.run.refused,
        "refusals": snapshot.run.refusals,
        "selected": picked.map(|picked| selected(picked, snapshot)),
        "recording": snapshot.run.recording.as_ref().map(|now| json!({"on": now.on, "text": now.text})),
        "timeline": snapshot.run.timeline.map(|line| json!({"now": line.now, "start": line.start, "end": line.end})),
    })
}

/// Returns the selection: pose and contact forces in the environment frame. Unknown values are null.
fn selected(picked: &Picked, snapshot: &Snapshot) -> Value {
    let pose = picked.pose(snapshot);
    let position = pose.map_or(picked.point, |pose| pose.translation.vector.into());
    let quaternion = pose.map(|pose| [pose.rotation.w, pose.rotation.i, pose.rotation.j, pose.rotation.k].map(finite));
    let (contacts, force) = picked.contact_force(snapshot).unzip();
    json!({
        "name": picked.name,
        "environment": picked.env,
        "mask_id": picked.mask_id,
        "position": position.map(finite),
        "quaternion": quaternion,
        "contacts": contacts,
        "force": force.map(|force| force.map(finite)),
        "says": describe(picked, snapshot),
    })
}

/// Finds a driven joint by the names of its robot and its own.
pub(super) fn find_joint<'a>(names: &'a Names, robot: &str, joint: &str) -> Result<&'a JointName, String> {
    let of_robot: Vec<&JointName> = names.joints.iter().filter(|name| parts(name).0 == robot).collect();
    if of_robot.is_empty() {
        let robots: Vec<&str> = by_robot(names).filter_map(|(_, joints)| Some(parts(joints.first()?).0)).collect();
        return Err(format!("there is no robot {robot:?} with joints; there are {robots:?}"));
    }
    let found = of_robot.iter().find(|name| parts(name).1 == joint).copied();
    let found = found.ok_or_else(|| {
        let joints: Vec<&str> = of_robot.iter().map(|name| parts(name).1).collect();
        format!("robot {robot:?} has no joint {joint:?}; it has {joints:?}")
    })?;
    if found.driven { Ok(found) } else { Err(format!("joint {joint:?} has no drive of its own")) }
}

/// Returns the joints of each robot, with the index of its first joint.
fn by_robot(names: &Names) -> impl Iterator<Item = (usize, &[JointName])> {
    let mut first = 0;
    names.joints.chunk_by(|a, b| a.robot == b.robot).map(move |joints| {
        let at = first;
        first += joints.len();
        (at, joints)
    })
}

/// Splits `uid/joint` into robot and joint.
fn parts(name: &JointName) -> (&str, &str) {
    name.name.split_once('/').unwrap_or(("", &name.name))
}

/// Returns a number, or null for a non-finite value, which JSON cannot represent.
fn finite(value: f64) -> Value {
    if value.is_finite() { json!(value) } else { Value::Null }
}
