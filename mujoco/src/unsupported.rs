//! Features of MuJoCo 4.x models that cannot be written back as MJCF.

use super::model::Model;

/// A feature of a model element that cannot be written back as MJCF.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnsupportedFeature {
    /// Kind of the element: `joint`, `geom`, `pair`, `tendon`, `actuator`, `flex` or `plugin`.
    pub element: &'static str,
    /// Index of the element among those of its kind; 0 for `flex` and `plugin`.
    pub index: usize,
    /// Name or description of the feature, for error messages.
    pub feature: &'static str,
}

impl Model {
    /// Returns the first feature that 2.2.2 lacks and that cannot be written back as MJCF, if any; `None` on 2.2.2.
    #[cfg(not(mj4))]
    pub fn unsupported_feature(&self) -> Option<UnsupportedFeature> {
        None
    }

    /// Returns the first feature that 2.2.2 lacks and that cannot be written back as MJCF, if any; `None` on 2.2.2.
    #[cfg(mj4)]
    pub fn unsupported_feature(&self) -> Option<UnsupportedFeature> {
        use super::arrays::is_set;
        use mujoco_sys::fields::model as fields;
        /// An array of this model.
        macro_rules! array {
            ($name:ident) => {{
                // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
                unsafe { fields::$name(self.raw()) }
            }};
        }
        let header = self.header();
        let whole = [("flex", header.nflex, "a deformable (flex) body"), ("plugin", header.nplugin, "a plugin")];
        if let Some((element, _, what)) = whole.into_iter().find(|(_, count, _)| *count > 0) {
            return Some(UnsupportedFeature { element, index: 0, feature: what });
        }
        let numbers = [
            ("joint", array!(jnt_stiffnesspoly), self.njnt(), "nonlinear (polynomial) stiffness"),
            ("joint", array!(dof_dampingpoly), self.nv(), "nonlinear (polynomial) damping"),
            ("joint", array!(jnt_springyield), self.njnt(), "springyield"),
            ("geom", array!(geom_surfacevel), self.ngeom(), "surfacevel"),
            ("geom", array!(geom_adhesion), self.ngeom(), "adhesion"),
            ("pair", array!(pair_adhesion), self.npair(), "adhesion"),
            ("pair", array!(pair_solreffriction), self.npair(), "solreffriction"),
            ("tendon", array!(tendon_stiffnesspoly), self.ntendon(), "nonlinear (polynomial) stiffness"),
            ("tendon", array!(tendon_dampingpoly), self.ntendon(), "nonlinear (polynomial) damping"),
            ("tendon", array!(tendon_springyield), self.ntendon(), "springyield"),
            ("actuator", array!(actuator_delay), self.nactuator(), "delay"),
            ("actuator", array!(actuator_damping), self.nactuator(), "damping"),
            ("actuator", array!(actuator_dampingpoly), self.nactuator(), "nonlinear (polynomial) damping"),
            ("actuator", array!(actuator_armature), self.nactuator(), "armature"),
        ];
        for (element, values, count, what) in numbers {
            // An infinite `springyield` has no effect.
            if let Some(at) = values.iter().position(|x| *x != 0.0 && x.is_finite()) {
                let row = at / (values.len() / count.max(1)).max(1);
                let of_dofs = std::ptr::eq(values, array!(dof_dampingpoly));
                let index = if of_dofs { self.dof_jntid()[row] as usize } else { row };
                return Some(UnsupportedFeature { element, index, feature: what });
            }
        }
        let counts = [
            ("actuator", array!(actuator_ctrlnum), 1, "a number of controls other than 1"),
            ("actuator", array!(actuator_outnum), 1, "a number of outputs other than 1"),
        ];
        for (element, values, one, what) in counts {
            if let Some(index) = values.iter().position(|n| *n != one) {
                return Some(UnsupportedFeature { element, index, feature: what });
            }
        }
        // `actdim` is not written back, so an actuator may have one activation at most.
        if let Some(index) = array!(actuator_actnum).iter().position(|n| *n > 1) {
            return Some(UnsupportedFeature { element: "actuator", index, feature: "several activations" });
        }
        if let Some(index) = array!(actuator_history).iter().step_by(2).position(|n| *n > 0) {
            return Some(UnsupportedFeature { element: "actuator", index, feature: "nsample" });
        }
        let flags = [
            ("joint", array!(jnt_actgravcomp), "actuatorgravcomp"),
            ("actuator", array!(actuator_actearly), "actearly"),
        ];
        for (element, values, what) in flags {
            if let Some(index) = values.iter().position(|flag| is_set(*flag)) {
                return Some(UnsupportedFeature { element, index, feature: what });
            }
        }
        None
    }

    /// Returns the name of a feature of a sensor that 2.2.2 lacks and that cannot be written back as MJCF, if any;
    /// `None` on 2.2.2.
    ///
    /// # Panics
    /// There is no such sensor.
    pub fn unsupported_sensor_feature(&self, sensor: usize) -> Option<&'static str> {
        #[cfg(mj4)]
        {
            use mujoco_sys::fields::model as fields;
            /// Values of this sensor in an array of the model.
            macro_rules! numbers {
                ($name:ident) => {{
                    // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
                    let values = unsafe { fields::$name(self.raw()) };
                    let width = values.len() / self.nsensor();
                    &values[width * sensor..width * (sensor + 1)]
                }};
            }
            if numbers!(sensor_delay).iter().any(|x| *x != 0.0) {
                return Some("delay");
            }
            if numbers!(sensor_interval).iter().any(|x| *x != 0.0) {
                return Some("interval");
            }
            if numbers!(sensor_history)[0] > 0 {
                return Some("nsample");
            }
            // A rangefinder of 4.x may output more than a distance.
            let word = super::mjcf_keywords::sensor(self.sensor_type()[sensor]);
            let several = word.is_some_and(|word| word.keyword == "rangefinder") && self.sensor_dim()[sensor] != 1;
            several.then_some("rangefinder output other than the distance")
        }
        #[cfg(not(mj4))]
        {
            assert!(sensor < self.nsensor(), "sensor {sensor} of {}", self.nsensor());
            None
        }
    }

    /// Gravity compensation of a body (4.x), as a fraction of its weight: 1 cancels gravity; 0 on 2.2.2.
    ///
    /// # Panics
    /// There is no such body.
    pub fn body_gravity_compensation(&self, body: usize) -> f64 {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let values = unsafe { mujoco_sys::fields::model::body_gravcomp(self.raw()) };
            values[body]
        }
        #[cfg(not(mj4))]
        {
            assert!(body < self.nbody(), "body {body} of {}", self.nbody());
            0.0
        }
    }

    /// Range of the total actuator force on a joint \[N m or N\]; `None` without a limit and on 2.2.2.
    ///
    /// # Panics
    /// There is no such joint.
    pub fn joint_actuator_force(&self, joint: usize) -> Option<[f64; 2]> {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let limited = unsafe { mujoco_sys::fields::model::jnt_actfrclimited(self.raw()) };
            // SAFETY: as above.
            let range = unsafe { mujoco_sys::fields::model::jnt_actfrcrange(self.raw()) };
            super::arrays::is_set(limited[joint]).then(|| [range[2 * joint], range[2 * joint + 1]])
        }
        #[cfg(not(mj4))]
        {
            assert!(joint < self.njnt(), "joint {joint} of {}", self.njnt());
            None
        }
    }

    /// Range of the total actuator force on a tendon \[N\]; `None` without a limit and on 2.2.2.
    ///
    /// # Panics
    /// There is no such tendon.
    pub fn tendon_actuator_force(&self, tendon: usize) -> Option<[f64; 2]> {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let limited = unsafe { mujoco_sys::fields::model::tendon_actfrclimited(self.raw()) };
            // SAFETY: as above.
            let range = unsafe { mujoco_sys::fields::model::tendon_actfrcrange(self.raw()) };
            super::arrays::is_set(limited[tendon]).then(|| [range[2 * tendon], range[2 * tendon + 1]])
        }
        #[cfg(not(mj4))]
        {
            assert!(tendon < self.ntendon(), "tendon {tendon} of {}", self.ntendon());
            None
        }
    }

    /// Armature of a tendon \[kg\], the inertia of its length changes (4.x); 0 on 2.2.2.
    ///
    /// # Panics
    /// There is no such tendon.
    pub fn tendon_armature(&self, tendon: usize) -> f64 {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let values = unsafe { mujoco_sys::fields::model::tendon_armature(self.raw()) };
            values[tendon]
        }
        #[cfg(not(mj4))]
        {
            assert!(tendon < self.ntendon(), "tendon {tendon} of {}", self.ntendon());
            0.0
        }
    }
}
