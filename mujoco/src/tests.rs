//! Tests of model counts, ray hits and forces on bodies, against MuJoCo's own arrays and closed forms.

use super::{Buffers, Data, Model, compile};

const PI: f64 = std::f64::consts::PI;

fn model(text: &str) -> Model {
    compile(text, &[]).expect("compiles").into_model()
}

/// A model with several of each counted element.
fn counted() -> Model {
    // 2.2.2 declares skins among the assets.
    let section = if cfg!(mj4) { "deformable" } else { "asset" };
    model(
        &r#"<mujoco><asset><material name="red"/><material name="blue"/></asset><worldbody>
        <body name="arm"><joint name="a"/><joint name="b" axis="1 0 0"/><geom size="0.1" material="red"/><site name="s"/></body>
        <body name="sled" pos="2 0 0"><joint name="c" type="slide"/><geom size="0.1"/></body></worldbody>
        <SECTION><skin name="skin" vertex="0 0 0 1 0 0 0 1 0" face="0 1 2"><bone body="arm" bindpos="0 0 0"
          bindquat="1 0 0 0" vertid="0 1 2" vertweight="1 1 1"/></skin></SECTION>
        <equality><joint joint1="a" joint2="b"/></equality>
        <tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon>
        <actuator><motor joint="a"/><position joint="c"/><motor tendon="t"/></actuator>
        <sensor><jointpos joint="a"/><accelerometer site="s"/><framequat objtype="body" objname="sled"/></sensor>
        <keyframe><key name="k1" qpos="0.1 0 0"/><key name="k2" qpos="0.2 0 0"/><key name="k3"/></keyframe></mujoco>"#
            .replace("SECTION", section),
    )
}

#[test]
fn counts() {
    let model = counted();
    let counts = [model.nmat(), model.nkey(), model.nskin(), model.nsensor(), model.nsensordata(), model.nactuator()];
    assert_eq!(counts, [2, 3, 1, 3, 1 + 3 + 4, 3]);
    assert_eq!(model.nsensordata(), Data::new(&model).expect("small").sensordata().len());
    assert_eq!([0, 1, 2].map(|actuator| model.actuator_control(actuator)), [0, 1, 2]);
    assert_eq!(self::model("<mujoco/>").nmat(), 0);
}

#[test]
#[should_panic(expected = "3")]
fn control_of_no_actuator() {
    let _ = counted().actuator_control(3);
}

/// Rows: six for an equality, two for each of three degrees of freedom and for the tendon, four for each of 16
/// contacts.
#[test]
fn small_buffers() {
    let model = counted();
    let Buffers { contacts, constraints, arena_bytes } = model.small_buffers();
    assert_eq!((contacts, constraints), (16, 6 + 2 * 3 + 2 + 16 * 4));
    let small = model.with_buffers(model.small_buffers());
    assert_eq!(small.buffers().contacts, if cfg!(mj4) { model.buffers().contacts } else { 16 });
    assert_eq!(small.buffers().arena_bytes, if cfg!(mj4) { arena_bytes } else { 0 });
    let mut data = Data::new(&small).expect("small");
    data.forward().expect("fits");
    assert_eq!(data.ne(), 1, "the equality is active");
}

#[test]
fn multi_ray() {
    let model = model(
        r#"<mujoco><worldbody><geom type="plane" size="9 9 1"/><geom type="box" size="0.2 0.3 0.4" pos="1 0 0.5" euler="10 20 30"/>
        <body pos="-1 0.2 0.6"><freejoint/><geom type="capsule" size="0.2 0.3"/></body></worldbody></mujoco>"#,
    );
    let mut data = Data::new(&model).expect("small");
    data.forward().expect("fits");
    let origin = [0.1, -0.2, 0.7];
    let directions: Vec<[f64; 3]> = (0..60)
        .map(|k| {
            let (turn, tilt) = (f64::from(k) * PI / 15.0, f64::from(k % 7) * 0.25 - 1.2);
            [turn.cos() * tilt.cos(), turn.sin() * tilt.cos(), tilt.sin()]
        })
        .collect();
    let mut distances = vec![f64::NAN; directions.len()];
    let done = data.multi_ray(origin, &directions, 1, &mut distances);
    if cfg!(not(mj4)) {
        assert!(done.expect_err("mj_multiRay is missing before 4.x").to_string().contains("mj_multiRay"));
        return;
    }
    done.expect("mj_multiRay exists in 4.x");
    let mut hits = 0;
    for (direction, distance) in directions.iter().zip(distances) {
        let one = data.ray(origin, *direction, 1).expect("a ray");
        hits += usize::from(one.is_some());
        // Both functions use the same arithmetic on the same geoms.
        assert!((one.map_or(-1.0, |hit| hit.distance) - distance).abs() < 1e-12, "{direction:?}");
    }
    assert!((10..60).contains(&hits), "{hits}");
}

/// A mass m with moment I at radius r on a slide on a turntable, both without drives, turns with w and slides outward
/// with u.
///
/// m r² w + I w is conserved, so the turntable accelerates by a = -2 m r w u / (I + m r²). The free slide accelerates
/// by w² r. The world exerts mass times acceleration: m (r a + 2 w u) across the slide, the weight, and I a about the
/// axis. After an integration, the velocities from before it must be given.
#[test]
fn forces_before_integration() {
    let (mass, moment, radius, turning, sliding, g) = (2.0, 0.7, 0.5, 3.0, 0.4, 9.81);
    let model = model(&format!(
        r#"<mujoco><worldbody><body><joint axis="0 0 1"/><joint type="slide" axis="1 0 0"/>
        <inertial pos="{radius} 0 0" mass="{mass}" diaginertia="{moment} {moment} {moment}"/></body></worldbody></mujoco>"#
    ));
    let mut data = Data::new(&model).expect("small");
    let now = [turning, sliding];
    data.qvel_mut().copy_from_slice(&now);
    data.forward().expect("fits");
    let slowing = -2.0 * mass * radius * turning * sliding / (moment + mass * radius * radius);
    let qacc = [slowing, turning * turning * radius];
    assert!(data.qacc().iter().zip(qacc).all(|(found, qacc)| (found - qacc).abs() < 1e-12), "{:?}", data.qacc());
    let later = [7.0, -1.0];
    data.qvel_mut().copy_from_slice(&later);
    let across = mass * (radius * slowing + 2.0 * turning * sliding);
    let expected = [0.0, 0.0, moment * slowing, 0.0, across, mass * g];
    let far = |data: &Data| {
        let found = data.cfrc_int()[6..12].iter().zip(expected);
        found.fold(0.0_f64, |most, (found, expected)| most.max((found - expected).abs()))
    };
    let mut spare = Vec::new();
    data.rne_post_constraint(&now, &mut spare).expect("solves");
    assert!(far(&data) < 1e-12, "{:?} instead of {expected:?}", data.cfrc_int());
    assert_eq!(data.qvel(), later, "the given input must not change");
    // Control: velocities of another time give wrong forces.
    data.rne_post_constraint(&later, &mut spare).expect("solves");
    assert!(far(&data) > 1.0, "{:?}", data.cfrc_int());
}

/// Unwrapped functions read the model and write to the data, and an error of MuJoCo becomes a value.
#[test]
fn raw_calls() {
    let model = model(
        r#"<mujoco><worldbody><body pos="0 0 0.3"><freejoint/><geom size="0.1" mass="2"/></body></worldbody></mujoco>"#,
    );
    let mut data = Data::new(&model).expect("small");
    // SAFETY: a function that only reads the model.
    let total_mass = |model, _| unsafe { crate::sys::mj_getTotalmass(model) };
    // SAFETY: an engine function, which writes to the data.
    let place = |model, data| unsafe { crate::sys::mj_kinematics(model, data) };
    // SAFETY: the error handler ends the call, in which nothing has a destructor.
    let stop = |_, _| unsafe { crate::sys::mju_error(c"on purpose".as_ptr()) };
    // SAFETY: `total_mass` keeps no pointer.
    let mass = unsafe { data.with_raw(total_mass) };
    assert_eq!(mass.expect("reads"), 2.0);
    assert_eq!(data.xpos()[5], 0.0, "nothing is computed yet");
    // SAFETY: `place` calls an engine function with the pointers and keeps none.
    unsafe { data.with_raw(place) }.expect("computes");
    assert_eq!(data.xpos()[5], 0.3);
    // SAFETY: `stop` only raises an error.
    let stopped = unsafe { data.with_raw(stop) };
    assert!(stopped.expect_err("an error").to_string().contains("on purpose"));
}
