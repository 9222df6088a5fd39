//! State and working memory of one environment (`mjData`).

use super::error::EngineError;
use super::guard::guarded;
use super::model::Model;
use mujoco_sys as mj;
use std::ptr::NonNull;

/// One `mjData` with its model, which it keeps alive.
#[derive(Debug)]
pub struct Data {
    raw: NonNull<mj::mjData>,
    model: Model,
}

// SAFETY: an mjData is plain memory without thread affinity; `Data` is its only owner. It is not `Sync`: engine
// functions take it as const but write to its stack.
unsafe impl Send for Data {}

impl Drop for Data {
    fn drop(&mut self) {
        // SAFETY: made by mj_makeData, deleted once; deletion frees memory and cannot raise an engine error.
        unsafe { mj::mj_deleteData(self.raw.as_ptr()) };
    }
}

/// Kinds of MuJoCo warnings, the same on all versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Warning {
    /// The inertia matrix is close to singular.
    Inertia,
    /// The contact buffer (4.x: the arena) is full: contacts were dropped.
    ContactFull,
    /// The constraint buffer (4.x: the arena) is full: constraints were dropped.
    ConstraintFull,
    /// A position is not finite or too large.
    BadPosition,
    /// A velocity is not finite or too large.
    BadVelocity,
    /// An acceleration is not finite or too large.
    BadAcceleration,
    /// A control is not finite or too large; MuJoCo then uses zero for all controls.
    BadControl,
}

impl Warning {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Inertia,
        Self::ContactFull,
        Self::ConstraintFull,
        Self::BadPosition,
        Self::BadVelocity,
        Self::BadAcceleration,
        Self::BadControl,
    ];

    /// Stable kebab-case name, as counted in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inertia => "mujoco-bad-inertia",
            Self::ContactFull => "mujoco-contact-buffer-full",
            Self::ConstraintFull => "mujoco-constraint-buffer-full",
            Self::BadPosition => "mujoco-bad-position",
            Self::BadVelocity => "mujoco-bad-velocity",
            Self::BadAcceleration => "mujoco-bad-acceleration",
            Self::BadControl => "mujoco-bad-control",
        }
    }

    fn code(self) -> usize {
        (match self {
            Self::Inertia => mj::mjWARN_INERTIA,
            Self::ContactFull => mj::mjWARN_CONTACTFULL,
            Self::ConstraintFull => mj::mjWARN_CNSTRFULL,
            Self::BadPosition => mj::mjWARN_BADQPOS,
            Self::BadVelocity => mj::mjWARN_BADQVEL,
            Self::BadAcceleration => mj::mjWARN_BADQACC,
            Self::BadControl => mj::mjWARN_BADCTRL,
        }) as usize
    }
}

/// Number of times each [`Warning`] was raised, in the order of [`Warning::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WarningCounts(pub [u64; Warning::ALL.len()]);

impl WarningCounts {
    /// Count of one kind.
    pub fn get(&self, warning: Warning) -> u64 {
        Warning::ALL.iter().position(|&w| w == warning).map_or(0, |i| self.0[i])
    }

    /// Adds the counts of `other`.
    pub fn add(&mut self, other: &Self) {
        for (total, n) in self.0.iter_mut().zip(other.0) {
            *total += n;
        }
    }

    /// Returns a warning that indicates divergence: a bad acceleration, position or velocity, the first one in this
    /// order; `None` without any of them.
    ///
    /// [`step2`](Data::step2) and then [`step1`](Data::step1) check them in this order, so the first one is the cause.
    pub fn diverged(&self) -> Option<Warning> {
        [Warning::BadAcceleration, Warning::BadPosition, Warning::BadVelocity].into_iter().find(|&w| self.get(w) > 0)
    }

    /// Returns the buffer that overflowed, contacts before constraints; `None` without an overflow. An overflow of the
    /// stack is an [`EngineError`] instead.
    pub fn overflow(&self) -> Option<Overflow> {
        if self.get(Warning::ContactFull) > 0 {
            Some(Overflow::Contacts)
        } else if self.get(Warning::ConstraintFull) > 0 {
            Some(Overflow::Constraints)
        } else {
            None
        }
    }
}

/// Buffer that was too small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overflow {
    /// The contact buffer.
    Contacts,
    /// The buffer of constraint rows.
    Constraints,
    /// The solver's stack.
    Stack,
}

impl Data {
    /// Creates data in the model's initial state, with the model's buffer sizes. Poses and other derived quantities are
    /// not computed yet.
    ///
    /// # Errors
    /// MuJoCo cannot allocate the data.
    pub fn new(model: &Model) -> Result<Self, EngineError> {
        // SAFETY: the model is alive; mj_makeData is an engine function (guarded).
        let raw = guarded(|| unsafe { mj::mj_makeData(model.raw()) })?;
        let raw = NonNull::new(raw).ok_or_else(|| EngineError { message: "could not create mjData".into() })?;
        Ok(Self { raw, model: model.clone() })
    }

    /// Model of this data: the one that it was created for, or the last one of [`set_model`](Self::set_model).
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Replaces the model by another one of the same sizes: one [edited](super::ModelEditor) from the same compiled
    /// model. The state stays unchanged.
    ///
    /// The next forward pass updates everything that depends on the model.
    ///
    /// # Panics
    /// The model was compiled separately, or its buffers have other sizes.
    pub fn set_model(&mut self, model: Model) {
        self.replace_model(model);
    }

    /// Replaces the model as [`set_model`](Self::set_model) does, and returns the one before.
    ///
    /// # Panics
    /// The model was compiled separately, or its buffers have other sizes.
    pub fn replace_model(&mut self, model: Model) -> Model {
        assert!(
            model.is_compatible_with(&self.model),
            "the model was compiled separately, or its buffers have other sizes"
        );
        std::mem::replace(&mut self.model, model)
    }

    pub(super) fn raw(&self) -> *const mj::mjData {
        self.raw.as_ptr()
    }

    pub(super) fn raw_mut(&mut self) -> *mut mj::mjData {
        self.raw.as_ptr()
    }

    fn header(&self) -> &mj::mjData {
        // SAFETY: the data is alive and only `&mut self` writes to it.
        unsafe { self.raw.as_ref() }
    }

    fn header_mut(&mut self) -> &mut mj::mjData {
        // SAFETY: the data is alive and borrowed mutably.
        unsafe { self.raw.as_mut() }
    }

    /// Resets to the model's initial state (`mj_resetData`), with zero inputs and warning counters. Also clears the
    /// effects of an engine error. Derived quantities are not computed.
    pub fn reset(&mut self) {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together.
        let result = guarded(|| unsafe { mj::mj_resetData(m, d) });
        // mj_resetData raises no engine error on a data of matching sizes, which is this type's invariant.
        debug_assert!(result.is_ok(), "{result:?}");
    }

    /// Computes everything that depends on positions and velocities (`mj_step1`): kinematics, contacts, constraints,
    /// bias forces.
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    #[inline]
    pub fn step1(&mut self) -> Result<(), EngineError> {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_step1(m, d) })
    }

    /// Computes the part of [`step1`](Self::step1) that poses and velocities of bodies need: kinematics, centers of mass
    /// and velocities (`cvel`). All other quantities stay.
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    pub fn body_motion(&mut self) -> Result<(), EngineError> {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_kinematics(m, d) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_comPos(m, d) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_comVel(m, d) })
    }

    /// Computes the part of [`step1`](Self::step1) that poses and velocities need: kinematics, centers of mass, cameras,
    /// lights, tendons and, on 4.x, flexes, then the velocities of bodies (`cvel`). All other quantities stay.
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    pub fn poses_and_velocities(&mut self) -> Result<(), EngineError> {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_kinematics(m, d) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_comPos(m, d) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_camlight(m, d) })?;
        #[cfg(mj4)]
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_flex(m, d) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_tendon(m, d) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_comVel(m, d) })
    }

    /// Normalizes the quaternions of free and ball joints in `qpos`, as the forward pass of 2.2.2 does. Has no effect
    /// on 4.x, where positions stay as they are.
    #[inline]
    pub fn normalize_quaternions(&mut self) {
        #[cfg(not(mj4))]
        {
            let (m, qpos) = (self.model.raw(), self.qpos_mut().as_mut_ptr());
            // SAFETY: `qpos` has the length of the model's positions; the function cannot raise an engine error.
            unsafe { mj::mj_normalizeQuat(m, qpos) };
        }
    }

    /// True if `qpos` or `qvel` contains a number that MuJoCo's step rejects: not finite, or above 1e10 in magnitude.
    #[inline]
    pub fn has_bad_state(&self) -> bool {
        // The comparison is false for NaN. Without an early exit, the loop is vectorized.
        let good = |values: &[f64]| values.iter().fold(true, |good, x| good & (x.abs() <= mj::mjMAXVAL));
        !(good(self.qpos()) & good(self.qvel()))
    }

    /// Computes actuation, accelerations and constraint forces, and integrates one time step (`mj_step2`). Call
    /// [`step1`](Self::step1) first. A model with the integrator RK4 is integrated with Euler's method here.
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    #[inline]
    pub fn step2(&mut self) -> Result<(), EngineError> {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_step2(m, d) })
    }

    /// Runs one whole step (`mj_step`).
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    pub fn step(&mut self) -> Result<(), EngineError> {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_step(m, d) })
    }

    /// Computes all quantities at the current state, without integration (`mj_forward`).
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    pub fn forward(&mut self) -> Result<(), EngineError> {
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_forward(m, d) })
    }

    /// Computes body accelerations and the forces between bodies (`cacc`, `cfrc_int`) with `mj_rnePostConstraint`.
    ///
    /// Accelerations and constraint forces are those of the last solve. `qvel` are the velocities of that solve: those
    /// before the integration, if the step is complete. Nothing that affects later steps changes. `scratch` is scratch
    /// memory for `nv` numbers.
    ///
    /// # Errors
    /// MuJoCo reported an error (out of memory): reset or drop this data.
    ///
    /// # Panics
    /// `qvel` does not have `nv` numbers.
    pub fn rne_post_constraint(&mut self, qvel: &[f64], scratch: &mut Vec<f64>) -> Result<(), EngineError> {
        scratch.clear();
        scratch.extend_from_slice(self.qvel());
        self.qvel_mut().copy_from_slice(qvel);
        let (m, d) = (self.model.raw(), self.raw.as_ptr());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        let done = guarded(|| unsafe { mj::mj_rnePostConstraint(m, d) });
        self.qvel_mut().copy_from_slice(scratch);
        #[cfg(mj4)]
        {
            // Otherwise MuJoCo's own sensors would reuse these values in the next step.
            self.header_mut().flg_rnepost = false;
        }
        done
    }

    /// Returns the dense joint-space inertia matrix of the last forward pass, armature included, in row-major order
    /// with the shape (nv, nv).
    ///
    /// # Errors
    /// MuJoCo reported an error (`mju_error`).
    pub fn mass_matrix(&self) -> Result<Vec<f64>, EngineError> {
        let nv = self.model.nv();
        let mut dense = vec![0.0; nv * nv];
        let (m, d, out) = (self.model.raw(), self.raw.as_ptr(), dense.as_mut_ptr());
        #[cfg(mj4)]
        // SAFETY: `out` has nv * nv elements; model and data belong together.
        guarded(|| unsafe { mj::mj_fullM(m, d, out) })?;
        #[cfg(not(mj4))]
        {
            // SAFETY: the data is alive; qM has the length that mj_fullM reads.
            let packed = unsafe { (*d).qM };
            // SAFETY: `out` has nv * nv elements; model and data belong together.
            guarded(|| unsafe { mj::mj_fullM(m, out, packed) })?;
        }
        Ok(dense)
    }

    /// Force \[N\] and torque \[N m\] of contact `index` on its second geom (`geom2`), from the last solve, in the
    /// contact frame: along the normal (from `geom1` to `geom2`) and two tangents, then about these three axes at the
    /// contact point. A positive normal force pushes the geoms apart. A contact without constraint rows has no force.
    ///
    /// # Panics
    /// `index` is not smaller than the number of contacts.
    #[track_caller]
    pub fn contact_force(&self, index: usize) -> [f64; 6] {
        assert!(index < self.contact().len(), "contact {index} of {}", self.contact().len());
        let mut force = [0.0; 6];
        // SAFETY: the index is in range; the result has six elements; the function only reads.
        unsafe { mj::mj_contactForce(self.model.raw(), self.raw(), index as i32, force.as_mut_ptr()) };
        force
    }

    /// Simulation time \[s\].
    pub fn time(&self) -> f64 {
        self.header().time
    }

    /// Sets the simulation time \[s\].
    pub fn set_time(&mut self, time: f64) {
        self.header_mut().time = time;
    }

    /// Number of equality rows of the last forward pass. They come first among the constraint rows.
    pub fn ne(&self) -> usize {
        self.header().ne.max(0) as usize
    }

    /// Number of dry-friction rows of the last forward pass (contacts excluded). They follow the equality rows: degrees
    /// of freedom in order, then tendons.
    pub fn nf(&self) -> usize {
        self.header().nf.max(0) as usize
    }

    /// Memory of the data \[bytes\]: its struct, its buffer, and its arena (4.x) or stack (2.2.2).
    pub fn bytes(&self) -> usize {
        let d = self.header();
        #[cfg(mj4)]
        let extra = d.narena as usize;
        #[cfg(not(mj4))]
        let extra = d.nstack as usize * size_of::<f64>();
        size_of::<mj::mjData>() + d.nbuffer as usize + extra
    }

    /// True if MuJoCo gave a warning since the last [`take_warnings`](Self::take_warnings) or reset.
    #[inline]
    pub fn has_warnings(&self) -> bool {
        let warnings = &self.header().warning;
        Warning::ALL.iter().any(|kind| warnings[kind.code()].number > 0)
    }

    /// Returns the number of warnings of each type since the last call or reset, and sets MuJoCo's counters to zero.
    pub fn take_warnings(&mut self) -> WarningCounts {
        let mut counts = WarningCounts::default();
        let warnings = &mut self.header_mut().warning;
        for (count, kind) in counts.0.iter_mut().zip(Warning::ALL) {
            let stat = &mut warnings[kind.code()];
            *count = stat.number.max(0) as u64;
            stat.number = 0;
        }
        counts
    }
}
