//! Mistakes in the equations of motion, drives and contacts, which the laws of physics have to notice.

use super::Mutation;

const fn physics(
    name: &'static str,
    file: &'static str,
    [search, replacement]: [&'static str; 2],
    laws: &'static [&'static str],
) -> Mutation {
    Mutation { name, file, search, replacement, tests: ("physics", laws) }
}

pub(super) const PHYSICS: &[Mutation] = &[
    physics(
        "inertia turned the wrong way",
        "sim/src/inertia.rs",
        [
            "inertia: rotation.matrix() * self.inertia * rotation.matrix().transpose(),",
            "inertia: rotation.matrix().transpose() * self.inertia * rotation.matrix(),",
        ],
        &["tilted_inertia", "parallel_axis", "mass_matrix"],
    ),
    physics(
        "parallel-axis term dropped",
        "sim/src/inertia.rs",
        ["let reduced_mass = self.mass * other.mass / mass;", "let reduced_mass = 0.0 * other.mass / mass;"],
        &["parallel_axis", "mass_matrix"],
    ),
    physics(
        "centre of mass of fused links not moved",
        "sim/src/inertia.rs",
        ["com: self.com + d * (other.mass / mass),", "com: self.com + d * (0.5 * other.mass / mass),"],
        &["parallel_axis", "gravity_torques"],
    ),
    physics(
        "turn of the inertial frame ignored",
        "sim/src/inertia.rs",
        [
            "in_com_axes.transformed(&inertial.link_from_com)",
            "in_com_axes.transformed(&Pose::from_parts(inertial.link_from_com.translation, UnitQuaternion::identity()))",
        ],
        &["tilted_inertia", "equations_of_motion"],
    ),
    physics(
        "quaternion order swapped in the MJCF",
        "sim/src/mjcf/write.rs",
        ["out.numbers(\"quat\", &[q.w, q.i, q.j, q.k])", "out.numbers(\"quat\", &[q.i, q.j, q.k, q.w])"],
        &["mass_matrix", "gravity_torques", "rolling_cylinder"],
    ),
    physics(
        "quaternion order swapped in poses that are read",
        "scene/src/pose.rs",
        [
            "UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))",
            "UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]))",
        ],
        &["tilted_inertia", "asymmetric_top", "internal_momentum"],
    ),
    physics(
        "roll and yaw exchanged",
        "scene/src/pose.rs",
        [
            "UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2])",
            "UnitQuaternion::from_euler_angles(rpy[2], rpy[1], rpy[0])",
        ],
        &["mass_matrix", "rolling_cylinder"],
    ),
    physics(
        "frame of a link behind a fixed joint not moved",
        "sim/src/mjcf/robot.rs",
        [
            "self.place(joint.child, parent_body, body_from_joint);",
            "self.place(joint.child, parent_body, body_from_parent);",
        ],
        &["centre_of_percussion", "falling_rod"],
    ),
    physics(
        "joint frame in the wrong order",
        "sim/src/mjcf/robot.rs",
        [
            "let body_from_joint = body_from_parent * joint.parent_from_joint;",
            "let body_from_joint = joint.parent_from_joint * body_from_parent;",
        ],
        &["mass_matrix", "gravity_torques"],
    ),
    physics(
        "Jacobian with the arm of the wrong sign",
        "sim/src/kinematics/jacobian.rs",
        ["&pose.translation.vector.cross(&axis)", "&axis.cross(&pose.translation.vector)"],
        &["jacobian", "virtual_work"],
    ),
    physics(
        "Jacobian of a joint that moved already",
        "sim/src/kinematics/jacobian.rs",
        ["pose *= joint.before;", "pose *= joint.before * joint.moved(positions);"],
        &["jacobian", "virtual_work"],
    ),
    physics(
        "velocity at a point with the arm of the wrong sign",
        "sim/src/capture/motion.rs",
        [
            "vector(data.cvel(), 6 * body + 3) + angular.cross(&(point - reference(data, body)))",
            "vector(data.cvel(), 6 * body + 3) - angular.cross(&(point - reference(data, body)))",
        ],
        &["centre_of_percussion", "falling_rod"],
    ),
    Mutation {
        name: "no centripetal acceleration",
        file: "sim/src/capture/motion.rs",
        search: "let acceleration = spatial + turning.cross(&velocity) + gravity;",
        replacement: "let acceleration = spatial + gravity;",
        tests: ("api", &["sensors::imu"]),
    },
    Mutation {
        name: "wrench of a joint about another point",
        file: "sim/src/capture/motion.rs",
        search: "let torque = vector(data.cfrc_int(), 6 * body) + arm.cross(&force);",
        replacement: "let torque = vector(data.cfrc_int(), 6 * body) - arm.cross(&force);",
        tests: ("api", &["sensors::wrench"]),
    },
    Mutation {
        name: "contact force on the other body",
        file: "sim/src/capture/contacts.rs",
        search: "force: force.into(),",
        replacement: "force: (-force).into(),",
        tests: ("api", &["sensors::contact"]),
    },
    Mutation {
        name: "contact time one step behind",
        file: "sensors/src/contact_sensor/air_time.rs",
        search: "(self.contact, self.air) = (self.contact + steps, 0);",
        replacement: "(self.contact, self.air) = (self.contact + steps - 1, 0);",
        tests: ("api", &["sensors::contact"]),
    },
    Mutation {
        name: "implicit drive without its stiffness",
        file: "sim/src/drive/implicit.rs",
        search: "let stiffness = h * (gains.kd + h * gains.kp);",
        replacement: "let stiffness = h * gains.kd;",
        tests: ("api", &["drives::law"]),
    },
    physics(
        "drive pushes the wrong way",
        "sim/src/drive/implicit.rs",
        ["gains.kp * (target.position - q)", "gains.kp * (q - target.position)"],
        &["gyroscope"],
    ),
    Mutation {
        name: "effort limit forgotten",
        file: "sim/src/drive/implicit.rs",
        search: "gains.max_effort.min(UNLIMITED)",
        replacement: "UNLIMITED",
        tests: ("api", &["drives::law"]),
    },
    Mutation {
        name: "drive law from the velocity of the step before",
        file: "sim/src/drive/implicit.rs",
        search: "effort / stiffness - v / h",
        replacement: "effort / stiffness",
        tests: ("api", &["drives::law"]),
    },
    physics(
        "damping of joints that drives",
        "sim/src/drive/implicit.rs",
        ["data.qfrc_applied_mut()[dof] -= damping * v;", "data.qfrc_applied_mut()[dof] += damping * v;"],
        &["viscous_joint"],
    ),
    physics(
        "mimic ratio and offset exchanged",
        "sim/src/mjcf/write.rs",
        ["&[e.offset, e.multiplier, 0.0, 0.0, 0.0]", "&[e.multiplier, e.offset, 0.0, 0.0, 0.0]"],
        &["atwood_machine", "geared_inertia"],
    ),
    physics(
        "friction cone always a pyramid",
        "sim/src/mjcf/write.rs",
        ["if o.cone == Cone::Elliptic { \"elliptic\" }", "if o.cone == Cone::Elliptic { \"pyramidal\" }"],
        &["rest_depth", "stick_creep"],
    ),
    physics(
        "impratio forgotten",
        "sim/src/simulation_cfg.rs",
        ["impratio: self.impratio,", "impratio: 1.0,"],
        &["stick_creep"],
    ),
    physics(
        "substeps as long as updates",
        "sim/src/simulation_cfg.rs",
        ["timestep: self.physics_dt / f64::from(self.substeps),", "timestep: self.physics_dt,"],
        &["substeps"],
    ),
    physics(
        "Runge-Kutta stepped as Euler",
        "sim/src/env.rs",
        ["if self.data.model().integrator() == mj::mjINT_RK4 {", "if self.data.model().integrator() == u32::MAX {"],
        &["order_of_runge_kutta", "free_fall", "asymmetric_top"],
    ),
    physics(
        "an update is a step too short",
        "sim/src/manager.rs",
        [
            "fn advance(&mut self, steps: u32) {\n        let mut left = steps;",
            "fn advance(&mut self, steps: u32) {\n        let mut left = steps.saturating_sub(u32::from(steps > 1));",
        ],
        &["free_fall", "parts_of_an_update"],
    ),
    physics(
        "restitution with half of its damping",
        "sim/src/objects/restitution.rs",
        ["(2.0 * ratio * frequency).max(1e-9)", "(ratio * frequency).max(1e-9)"],
        &["elastic_bounce"],
    ),
    physics(
        "friction of an object forgotten",
        "sim/src/mjcf/scene.rs",
        ["        role,\n        friction: cfg.friction,\n", "        role,\n        friction: None,\n"],
        &["conveyor"],
    ),
    physics(
        "mass of an object from its density only",
        "sim/src/objects/mass_properties.rs",
        ["let mass = cfg.mass.unwrap_or(cfg.density * volume);", "let mass = cfg.density * volume;"],
        &["drag", "conveyor"],
    ),
    physics(
        "weld anchored at the inverse pose",
        "sim/src/objects/weld.rs",
        ["to_row(&(first.inverse() * second))", "to_row(&(second.inverse() * first))"],
        // Not the slider and crank: at its weld both bodies are turned alike, and where they are the same the inverse is too.
        &["four_bar"],
    ),
    physics(
        "velocity of the centre of mass with the arm of the wrong sign",
        "sim/src/objects/robot_state.rs",
        ["body_pose(data, body).translation.vector - com", "com - body_pose(data, body).translation.vector"],
        &["tumbling_projectile"],
    ),
    physics(
        "angular velocity written in the axes of the world",
        "sim/src/objects/free_body.rs",
        ["let angular = rotation.inverse() * turning;", "let angular = turning;"],
        &["tumbling_projectile"],
    ),
    physics(
        "force and torque exchanged",
        "sim/src/wrenches.rs",
        ["force.iter().chain(torque)", "torque.iter().chain(force)"],
        &["tilted_inertia", "centre_of_percussion", "parallel_axis"],
    ),
    physics(
        "limits of joints twice as wide",
        "sim/src/mjcf/write.rs",
        [".numbers(\"range\", &range)", ".numbers(\"range\", &range.map(|x| 2.0 * x))"],
        &["joint_limit"],
    ),
    physics(
        "limits of motors twice as large",
        "sim/src/mjcf/write.rs",
        ["\"forcerange\", &[-limit, limit]", "\"forcerange\", &[-2.0 * limit, 2.0 * limit]"],
        &["force_limit"],
    ),
    physics(
        "armature forgotten",
        "sim/src/mjcf/robot.rs",
        ["armature: plan.armature,", "armature: 0.0 * plan.armature,"],
        &["armature"],
    ),
    physics(
        "dry friction forgotten",
        "sim/src/mjcf/robot.rs",
        [
            "frictionloss: if tendon { 0.0 } else { plan.friction },",
            "frictionloss: if tendon { 0.0 } else { 0.0 * plan.friction },",
        ],
        &["dry_friction"],
    ),
    physics(
        "IMU at rest feels nothing",
        "sensors/src/imu.rs",
        ["acceleration + self.gravity_bias, spin_up", "acceleration, spin_up"],
        &["imu_turntable", "imu_pendulum"],
    ),
    physics(
        "pixels half a percent too wide",
        "sensors/src/visibility/projection.rs",
        ["inverse_f: [1.0 / self.fx, 1.0 / self.fy],", "inverse_f: [1.005 / self.fx, 1.0 / self.fy],"],
        &["sphere_depth"],
    ),
];
