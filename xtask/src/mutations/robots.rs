//! Mistakes in what is made of files of robots, and in what is done with robots: objects, randomization, snapshots, kinematics, tasks.

use super::Mutation;

const fn input(
    name: &'static str,
    file: &'static str,
    [search, replacement]: [&'static str; 2],
    tests: &'static [&'static str],
) -> Mutation {
    Mutation { name, file, search, replacement, tests: ("input", tests) }
}

const fn api(
    name: &'static str,
    file: &'static str,
    [search, replacement]: [&'static str; 2],
    tests: &'static [&'static str],
) -> Mutation {
    Mutation { name, file, search, replacement, tests: ("api", tests) }
}

pub(super) const ROBOTS: &[Mutation] = &[
    input(
        "prefixes of left and right exchanged",
        "sim/src/urdf/merge.rs",
        [
            "None if component.name.starts_with(\"left_\") => \"left_\",",
            "None if component.name.starts_with(\"left_\") => \"right_\",",
        ],
        &["urdf::assembly::two_arms_and_hands"],
    ),
    input(
        "the one on the chassis hangs from its tip",
        "sim/src/urdf/merge.rs",
        ["if parent_cfg.name == \"chassis\" {", "if component.name == \"chassis\" {"],
        &["urdf::assembly::usual_parents"],
    ),
    input(
        "links of the files before forgotten where a link is named",
        "sim/src/urdf/merge.rs",
        ["Some(link) => Ok(Some(first + link)),", "Some(link) => Ok(Some(link)),"],
        &["urdf::assembly::links_by_name"],
    ),
    input(
        "joints of the files before forgotten by a mimic",
        "sim/src/urdf/merge.rs",
        ["joint: JointId(first_joint + followed),", "joint: JointId(followed),"],
        &["urdf::assembly::hand_on_arm"],
    ),
    input(
        "connector of two components the wrong way round",
        "sim/src/urdf/merge.rs",
        ["parent_from_joint: component.transform,", "parent_from_joint: component.transform.inverse(),"],
        &["urdf::assembly::one_component", "urdf::assembly::hand_on_arm"],
    ),
    input(
        "case of a name with its component forgotten",
        "sim/src/urdf/names.rs",
        ["unique = self.case.apply(&format!(\"{component}_{name}\"));", "unique = format!(\"{component}_{name}\");"],
        &["urdf::assembly::one_component"],
    ),
    input(
        "speed limit of a joint read from its effort limit",
        "sim/src/urdf/merge.rs",
        ["given.velocity.then_some(model.limit.velocity)", "given.velocity.then_some(model.limit.effort)"],
        &["inspect_robot::joints"],
    ),
    api(
        "start of the joint that is followed forgotten",
        "sim/src/mjcf/robot_file/couplings.rs",
        ["start(follower) + data[0] - data[1] * start(driver)", "start(follower) + data[0]"],
        &["mjcf_robot::couplings::lines"],
    ),
    api(
        "force limit of a motor from the nearer end of its range",
        "sim/src/mjcf/robot_file/actuator.rs",
        ["let end = low.abs().max(high.abs());", "let end = low.abs().min(high.abs());"],
        &["mjcf_robot::drives::gains_and_limits"],
    ),
    api(
        "bias of an actuator in a part read from its gain",
        "sim/src/mjcf/part/actuators.rs",
        ["row_of(m.actuator_biasprm(), count, a)", "row_of(m.actuator_gainprm(), count, a)"],
        &["mjcf::motion"],
    ),
    api(
        "torsional friction drawn into the rolling friction",
        "sim/src/randomization/apply.rs",
        [
            "Property::TorsionalFriction => editor.geom_friction_mut()[3 * place + 1] = value[0],",
            "Property::TorsionalFriction => editor.geom_friction_mut()[3 * place + 2] = value[0],",
        ],
        &["objects::masses::friction"],
    ),
    api(
        "number of draws not in a snapshot",
        "sim/src/snapshot/own.rs",
        ["self.draws[env] = entries[source].own.draws;", "self.draws[env] = 0;"],
        &["environments::snapshot::with_properties"],
    ),
    api(
        "objects of a group written in the opposite order",
        "sim/src/objects/object_group.rs",
        ["let object = self.data.objects.start + k;", "let object = self.data.objects.end - 1 - k;"],
        &["objects::groups::poses", "objects::groups::velocities"],
    ),
    api(
        "turns of inverse kinematics rounded down",
        "sim/src/kinematics/inverse.rs",
        [
            "let turns = ((reference[i] - *position) / TAU).round();",
            "let turns = ((reference[i] - *position) / TAU).floor();",
        ],
        &["kinematics::inverse::no_unneeded_turns"],
    ),
    api(
        "offset of a follower with the wrong sign in a chain",
        "sim/src/kinematics/chain.rs",
        ["self.ratio * positions[self.variable] + self.offset", "self.ratio * positions[self.variable] - self.offset"],
        &["kinematics::judges::slides_and_followers", "kinematics::inverse::followers"],
    ),
    api(
        "time limit of an episode one step too late",
        "env/src/environment.rs",
        ["is_some_and(|limit| *steps >= limit)", "is_some_and(|limit| *steps > limit)"],
        &["env::episodes::time_limit"],
    ),
    api(
        "observations scaled before they are clipped",
        "env/src/observation.rs",
        [
            "self.scale * noisy.clamp(self.clip[0], self.clip[1])",
            "(self.scale * noisy).clamp(self.clip[0], self.clip[1])",
        ],
        &["env::observations::noise_clip_scale"],
    ),
    api(
        "drawn turn of a root about the axes of the environment",
        "env/src/terms/reset_root_uniform.rs",
        [
            "let mut pose = from_row(&start) * from_xyz_rpy([0.0; 3], rpy);",
            "let mut pose = from_row(&start);\n            pose.rotation = from_xyz_rpy([0.0; 3], rpy).rotation * pose.rotation;",
        ],
        &["env::terms::root_ranges"],
    ),
];
