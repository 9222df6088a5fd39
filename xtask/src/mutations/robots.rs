//! Mutations of robot files and robots: objects, randomization, snapshots, kinematics, tasks.

use super::Mutation;

pub(super) const ROBOTS: &[Mutation] = &[
    Mutation::of(
        "input",
        "prefixes of left and right exchanged",
        "robot/src/urdf/merge.rs",
        [
            "None if component.name.starts_with(\"left_\") => \"left_\",",
            "None if component.name.starts_with(\"left_\") => \"right_\",",
        ],
        &["urdf::assembly::two_arms_and_hands"],
    ),
    Mutation::of(
        "input",
        "the one on the chassis hangs from its tip",
        "robot/src/urdf/merge.rs",
        ["if parent_cfg.name == \"chassis\" {", "if component.name == \"chassis\" {"],
        &["urdf::assembly::usual_parents"],
    ),
    Mutation::of(
        "input",
        "links of the files before forgotten where a link is named",
        "robot/src/urdf/merge.rs",
        ["Some(link) => Ok(Some(first + link)),", "Some(link) => Ok(Some(link)),"],
        &["urdf::assembly::links_by_name"],
    ),
    Mutation::of(
        "input",
        "joints of the files before forgotten by a mimic",
        "robot/src/urdf/merge.rs",
        ["joint: JointId(first_joint + followed),", "joint: JointId(followed),"],
        &["urdf::assembly::hand_on_arm"],
    ),
    Mutation::of(
        "input",
        "connector of two components the wrong way round",
        "robot/src/urdf/merge.rs",
        ["parent_from_joint: component.transform,", "parent_from_joint: component.transform.inverse(),"],
        &["urdf::assembly::one_component", "urdf::assembly::hand_on_arm"],
    ),
    Mutation::of(
        "input",
        "case of a name with its component forgotten",
        "robot/src/urdf/names.rs",
        ["unique = self.case.apply(&format!(\"{component}_{name}\"));", "unique = format!(\"{component}_{name}\");"],
        &["urdf::assembly::one_component"],
    ),
    Mutation::of(
        "input",
        "speed limit of a joint read from its effort limit",
        "robot/src/urdf/merge.rs",
        ["given.velocity.then_some(model.limit.velocity)", "given.velocity.then_some(model.limit.effort)"],
        &["inspect_robot::joints"],
    ),
];
