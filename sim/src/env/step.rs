//! Steps and forward passes of an environment, and the recovery from those that fail.

use super::{Divergence, EnvStatus, SimEnv, Stage};
use crate::capture::{CaptureRequest, CapturedStep};
use crate::row::{ColdState, EnvRow};
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{
    Data, EngineError, IntegrationState, ObjectKind, Overflow, SolvedState, UserInputs, Warning, WarningCounts,
};
use kinetoscope_scene::Contact;
use std::cmp::Reverse;
use std::sync::atomic::Ordering;

/// Memory of one environment above which its buffers no longer grow \[bytes\].
pub(super) const MAX_ENV_BYTES: usize = 2 << 30;

/// Largest number of bodies in an error.
const MAX_NAMED_BODIES: usize = 10;

impl SimEnv {
    /// Does `count` MuJoCo steps. A diverged environment does not step.
    pub fn step(&mut self, count: u32) {
        self.advance(count, None);
        self.reach(Stage::Forward);
    }

    /// Does `count` MuJoCo steps, without a forward pass after the last one, and captures the quantities of `capture`
    /// in the last step.
    pub(crate) fn advance(&mut self, count: u32, capture: Option<&CaptureRequest>) {
        for left in (0..count).rev() {
            if self.row.diverged.is_some() {
                return;
            }
            self.step_once(capture.filter(|_| left == 0));
        }
    }

    fn step_once(&mut self, mut capture: Option<&CaptureRequest>) {
        if let Some(wanted) = capture.take_if(|_| self.data.model().integrator() == mj::mjINT_RK4) {
            // RK4 ends with the solution of an intermediate state, so the state before the step is captured.
            self.capture_current(wanted);
        }
        self.reach(Stage::Forward);
        if self.row.diverged.is_some() {
            return;
        }
        let mut efforts = std::mem::take(&mut self.efforts);
        self.step_from_forward(&mut efforts, capture);
        self.efforts = efforts;
    }

    fn step_from_forward(&mut self, efforts: &mut Vec<f64>, capture: Option<&CaptureRequest>) {
        // The row still has a state that it was restored from.
        if self.held == 0 {
            self.save_motion();
        }
        self.held = 0;
        loop {
            let mut done = self.try_step(efforts, capture);
            if done.is_ok() && !self.data.has_warnings() && !self.data.has_bad_state() {
                return self.finish_step(efforts);
            }
            let mut raised = self.data.take_warnings();
            if done.is_ok() && self.data.has_bad_state() {
                // MuJoCo itself names the fault.
                done = self.data.step1();
                raised.add(&self.data.take_warnings());
            }
            match classify_step(done, &raised) {
                StepOutcome::Succeeded => {
                    if raised != WarningCounts::default() {
                        self.report_warnings(&raised);
                        self.row.cold.warnings.add(&raised);
                    }
                    return self.finish_step(efforts);
                }
                StepOutcome::Overflowed(what) => {
                    if let Err(reason) = self.grow_and_restore(what) {
                        return self.undo_step(reason);
                    }
                }
                StepOutcome::Diverged(reason) => {
                    self.count_warnings(&raised);
                    return self.undo_step(reason);
                }
            }
        }
    }

    /// Keeps the results of a successful step.
    fn finish_step(&mut self, efforts: &[f64]) {
        self.row.drives.finish_step(efforts);
        self.row.steps = self.row.steps.saturating_add(1);
        self.row.solved_current = false;
        self.row.is_forward_counted = false;
        self.stage = Stage::Raw;
    }

    /// Does one step after a forward pass, and reads the efforts that the drives applied.
    fn try_step(&mut self, efforts: &mut Vec<f64>, capture: Option<&CaptureRequest>) -> Result<(), EngineError> {
        self.apply_inputs();
        if self.data.model().integrator() == mj::mjINT_RK4 {
            // mj_step2 integrates with Euler even if the model says RK4.
            self.data.step()?;
        } else {
            self.data.step2()?;
        }
        // Must precede mj_step1, which lays out the constraints of the new state: 4.x moves them within its arena.
        self.row.drives.read_efforts(&self.data, efforts);
        if let Some(capture) = capture {
            let Self { data, row, .. } = self;
            let EnvRow { motion, cold, .. } = &mut **row;
            let qvel = motion.qvel(data.model());
            capture.capture(data, qvel, &mut cold.captured)?;
        }
        Ok(())
    }

    /// Captures the solution of the current state with the current drives; the state stays the same, bit for bit. The
    /// capture is empty for a diverged environment and for one whose next step will fail.
    pub(crate) fn capture_current(&mut self, capture: &CaptureRequest) {
        self.row.cold.captured.clear();
        self.row.solved_current = true;
        if !self.with_solved_state(|data, qvel, cold| capture.capture(data, qvel, &mut cold.captured)) {
            self.row.cold.captured.clear();
        }
    }

    /// Writes the contacts of the current state with their solved forces to `contacts`; empty if the solve fails.
    /// Earlier captures and later steps are not affected.
    pub(crate) fn current_contacts(&mut self, capture: &CaptureRequest, contacts: &mut Vec<Contact>) {
        let mut solved = CapturedStep::default();
        let done = self.with_solved_state(|data, qvel, _| capture.capture(data, qvel, &mut solved));
        contacts.clear();
        contacts.extend(solved.contacts.iter().filter(|_| done));
    }

    /// Solves the current state, passes the solution and the velocities to `take`, and restores the state. Returns true
    /// if the solve succeeded.
    fn with_solved_state(
        &mut self,
        mut take: impl FnMut(&mut Data, &[f64], &mut ColdState) -> Result<(), EngineError>,
    ) -> bool {
        if self.row.diverged.is_none() {
            self.reach(Stage::Forward);
        }
        if self.row.diverged.is_some() {
            return false;
        }
        self.save_motion();
        let good = loop {
            self.apply_inputs();
            let Self { data, row, .. } = self;
            let EnvRow { motion, cold, .. } = &mut **row;
            let qvel = motion.qvel(data.model());
            let done = data.step2().and_then(|()| take(data, qvel, cold));
            match classify_step(done, &self.data.take_warnings()) {
                StepOutcome::Succeeded => break true,
                StepOutcome::Overflowed(what) if self.grow_and_restore(what).is_ok() => {}
                StepOutcome::Overflowed(_) | StepOutcome::Diverged(_) => {
                    self.data.reset();
                    break false;
                }
            }
        };
        self.restore_saved();
        good
    }

    /// Checks a state and inputs that were just written to `data`, without a forward pass. Restores `good` and marks the
    /// environment as diverged if a number is not finite or too large.
    pub(super) fn accept(&mut self, good: &IntegrationState) {
        // Warnings belong to this environment: the next one that uses the data must not see them.
        let raised = self.data.take_warnings();
        self.accept_after(good, raised);
    }

    /// Checks a state as [`accept`](Self::accept) does, written by code in which MuJoCo gave the warnings `raised`. A
    /// warning of divergence rejects the state: MuJoCo may have replaced it by the initial state.
    pub(super) fn accept_after(&mut self, good: &IntegrationState, mut raised: WarningCounts) {
        self.disown();
        self.stage = Stage::Raw;
        self.row.is_forward_counted = false;
        self.row.is_pass_impossible = false;
        let mut done = Ok(());
        let mut bad = raised.diverged().is_some();
        if !bad {
            self.row.save_written(&self.data);
            bad = self.data.has_bad_state();
            if bad {
                // MuJoCo itself names the fault.
                done = self.data.step1();
                raised.add(&self.data.take_warnings());
            }
        }
        self.count_warnings(&raised);
        if bad {
            let reason = match (done, raised.diverged()) {
                (_, Some(warning)) => Divergence::Warning(warning),
                (Err(error), None) => Divergence::Engine(error),
                (Ok(()), None) => Divergence::Warning(Warning::BadPosition),
            };
            self.mark_diverged(reason, good);
        }
    }

    /// Computes what `stage` contains for the current state, unless it is there already.
    pub(crate) fn reach(&mut self, stage: Stage) {
        if self.stage >= stage {
            return;
        }
        if stage == Stage::Forward {
            if self.row.is_pass_impossible {
                return self.replace_pass();
            }
            return self.forward_or_freeze(None);
        }
        self.prepare_pass();
        match stage {
            Stage::Raw | Stage::Forward => {}
            Stage::State => self.data.normalize_quaternions(),
            Stage::Bodies | Stage::Kinematics => {
                let all = stage == Stage::Kinematics;
                let done = if all { self.data.poses_and_velocities() } else { self.data.body_motion() };
                if done.is_err() {
                    // The stack is too small. A whole forward pass grows it.
                    return self.forward_or_freeze(None);
                }
            }
        }
        self.stage = stage;
    }

    /// Runs one forward pass (`mj_step1`), growing the buffers as needed. On failure, restores `good` and marks the
    /// environment as diverged.
    pub(super) fn forward(&mut self, good: &IntegrationState) {
        if self.stage < Stage::Forward {
            self.forward_or_freeze(Some(good));
        }
    }

    /// Makes quaternions raw and keeps them, before a pass that may normalize them.
    fn prepare_pass(&mut self) {
        if self.raw_quats.is_empty() {
            return;
        }
        if self.stage == Stage::Raw {
            self.raw_quats.save(&self.data);
        } else {
            self.raw_quats.restore(&mut self.data);
        }
    }

    /// Runs one forward pass as [`forward`](Self::forward) does. Without `good`, a failed environment keeps its state.
    fn forward_or_freeze(&mut self, good: Option<&IntegrationState>) {
        self.prepare_pass();
        loop {
            let done = self.data.step1();
            self.stage = Stage::Forward;
            if done.is_ok() && !self.data.has_warnings() {
                self.row.is_forward_counted = true;
                return;
            }
            let raised = self.data.take_warnings();
            let reason = match classify_step(done, &raised) {
                StepOutcome::Succeeded => {
                    if !self.row.is_forward_counted {
                        self.count_warnings(&raised);
                        self.row.is_forward_counted = true;
                    }
                    return;
                }
                StepOutcome::Overflowed(what) => {
                    self.save_motion();
                    match self.grow_buffers(what, Inputs::OfData) {
                        Ok(()) => {
                            self.raw_quats.save(&self.data);
                            continue;
                        }
                        Err(reason) => reason,
                    }
                }
                StepOutcome::Diverged(reason) => {
                    self.count_warnings(&raised);
                    reason
                }
            };
            let (current, before) = (self.current_motion(), self.row.diverged.clone());
            self.mark_diverged(reason, good.unwrap_or(&current));
            if good.is_none() && before.is_some() {
                self.row.diverged = before;
            }
            // Cannot fail for `good`: it had a forward pass before, with these or smaller buffers.
            self.prepare_pass();
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            self.stage = Stage::Forward;
            if !matches!(classify_step(done, &raised), StepOutcome::Succeeded) {
                self.row.is_pass_impossible = true;
                self.replace_pass();
            }
            return;
        }
    }

    /// Gives the data what it can have of a forward pass that fails: poses and velocities, without contacts and
    /// constraints. The failed pass is not repeated, because it would grow the buffers of this thread up to their
    /// limit, and MuJoCo requires a reset of the data after it.
    fn replace_pass(&mut self) {
        let state = self.current_motion();
        let (mut inputs, mut solved) = (UserInputs::default(), SolvedState::default());
        inputs.save(&self.data);
        solved.save(&self.data);
        self.data.reset();
        inputs.restore(&mut self.data);
        state.restore(&mut self.data);
        solved.restore(&mut self.data);
        self.stage = Stage::Raw;
        self.prepare_pass();
        // Needs no buffer that can overflow: the stack has room for a smaller pass than that of the initial state.
        let _ = self.data.poses_and_velocities();
        self.data.take_warnings();
        self.stage = Stage::Forward;
    }

    /// Restores the state before the step, which is stored in the row, with larger buffers and a forward pass done.
    fn grow_and_restore(&mut self, mut what: Overflow) -> Result<(), Divergence> {
        loop {
            self.grow_buffers(what, Inputs::Written)?;
            self.prepare_pass();
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match classify_step(done, &raised) {
                StepOutcome::Succeeded => {
                    self.stage = Stage::Forward;
                    return Ok(());
                }
                StepOutcome::Overflowed(next) => what = next,
                StepOutcome::Diverged(reason) => return Err(reason),
            }
        }
    }

    /// Names of the bodies with the most contacts, at most ten, without the world.
    fn crowded_bodies(&self) -> Vec<String> {
        let model = self.data.model();
        let mut contacts = vec![0_usize; model.nbody()];
        for contact in self.data.contact() {
            for geom in [contact.geom1, contact.geom2] {
                // Contacts of flexes have no geom.
                let body = usize::try_from(geom).ok().and_then(|geom| model.geom_bodyid().get(geom));
                if let Some(count) = body.and_then(|body| contacts.get_mut(*body as usize)) {
                    *count += 1;
                }
            }
        }
        let mut bodies: Vec<usize> = (1..contacts.len()).filter(|body| contacts[*body] > 0).collect();
        bodies.sort_by_key(|body| (Reverse(contacts[*body]), *body));
        bodies.iter().take(MAX_NAMED_BODIES).filter_map(|body| model.name(ObjectKind::Body, *body)).collect()
    }

    /// Replaces the data by data with twice the buffer size of `what`, in the state that is stored in the row, and with
    /// the same results. Data that is already larger than the limit is an error.
    fn grow_buffers(&mut self, what: Overflow, kept: Inputs) -> Result<(), Divergence> {
        let buffers = self.data.model().buffers().enlarged(what);
        if self.data.bytes() > self.max_bytes {
            return Err(Divergence::BuffersExhausted { buffers, bodies: self.crowded_bodies() });
        }
        let base = self.base.with_buffers(buffers);
        let model = self.row.patch.as_ref().map_or_else(|| base.clone(), |patch| base.clone().patched(patch));
        let mut data = Data::new(&model).map_err(Divergence::Engine)?;
        let mut solved = SolvedState::default();
        solved.save(&self.data);
        solved.restore(&mut data);
        match kept {
            Inputs::Written => self.row.written.restore(&mut data),
            Inputs::OfData => {
                let mut inputs = UserInputs::default();
                inputs.save(&self.data);
                inputs.restore(&mut data);
            }
        }
        self.row.motion.restore(&mut data);
        (self.data, self.base, self.patched) = (data, base, None);
        self.stage = Stage::Raw;
        self.disown();
        self.buffer_growths.fetch_add(1, Ordering::Relaxed);
        let bytes = self.data.bytes();
        tracing::info!(target: "kinetoscope_sim", env = self.row.cold.env, ?what, bytes, "a buffer of MuJoCo was doubled");
        Ok(())
    }

    /// Adds warnings to those of the environment. Without any, the cold part of the row stays out of the cache.
    fn count_warnings(&mut self, raised: &WarningCounts) {
        if *raised != WarningCounts::default() {
            self.row.cold.warnings.add(raised);
        }
    }

    /// Emits an event for each of MuJoCo's warnings in `raised` that the environment has for the first time.
    fn report_warnings(&self, raised: &WarningCounts) {
        let (env, counts) = (self.row.cold.env, &self.row.cold.warnings);
        for warning in Warning::ALL.into_iter().filter(|&kind| raised.get(kind) > 0 && counts.get(kind) == 0) {
            tracing::warn!(target: "kinetoscope_sim", env, warning = warning.name(), "MuJoCo warned in an environment");
        }
    }

    /// Restores the state that is stored in the row.
    fn restore_saved(&mut self) {
        let motion = std::mem::take(&mut self.row.motion);
        self.restore_motion(&motion);
        self.row.motion = motion;
    }

    /// Restores the state before the step, which is stored in the row, and marks the environment as diverged.
    fn undo_step(&mut self, reason: Divergence) {
        let motion = std::mem::take(&mut self.row.motion);
        self.mark_diverged(reason, &motion);
        self.row.motion = motion;
    }

    /// Marks the environment as diverged and restores `good`, the last valid state, without a forward pass.
    fn mark_diverged(&mut self, reason: Divergence, good: &IntegrationState) {
        if self.row.diverged.is_none() {
            let (env, step) = (self.row.cold.env, self.row.steps);
            tracing::warn!(target: "kinetoscope_sim", env, step, %reason, "an environment diverged");
        }
        self.row.diverged = Some(Box::new(EnvStatus::Diverged { step: self.row.steps, reason }));
        self.row.cold.captured.clear();
        self.data.reset();
        self.data.take_warnings();
        self.restore_motion(good);
        self.row.is_forward_counted = true;
    }
}

/// Inputs with which an environment continues in larger buffers.
enum Inputs {
    /// Inputs as of the last write: a failed step may have cleared those of the data.
    Written,
    /// Inputs of the data.
    OfData,
}

enum StepOutcome {
    Succeeded,
    Overflowed(Overflow),
    Diverged(Divergence),
}

fn classify_step(done: Result<(), EngineError>, raised: &WarningCounts) -> StepOutcome {
    match done {
        Err(error) if error.is_out_of_memory() => StepOutcome::Overflowed(raised.overflow().unwrap_or(Overflow::Stack)),
        Err(error) => StepOutcome::Diverged(Divergence::Engine(error)),
        Ok(()) => match (raised.overflow(), raised.diverged()) {
            (Some(what), _) => StepOutcome::Overflowed(what),
            (None, Some(warning)) => StepOutcome::Diverged(Divergence::Warning(warning)),
            (None, None) => StepOutcome::Succeeded,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Batch;
    use mj::Buffers;
    use std::sync::Arc;

    /// Spheres of 0.1 m radius in a row on the ground. Moved onto each other, they have more contacts than the buffers hold.
    #[test]
    fn exhausted_buffers() {
        let sphere = |k: usize| format!("<body name='s{k}' pos='{k} 0 0.1'><freejoint/><geom size='0.1'/></body>");
        let spheres: String = (0..12).map(sphere).collect();
        let text = format!("<mujoco><worldbody><geom type='plane' size='20 1 1'/>{spheres}</worldbody></mujoco>");
        let model = mj::compile(&text, &[]).expect("compiles").into_model();
        let few = Buffers { contacts: 12, constraints: 48, arena_bytes: 1 << 17 };
        let mut env = SimEnv::new(&model.with_buffers(few), &Arc::default()).expect("small");
        env.max_bytes = 0;
        env.step(1);
        assert_eq!(env.row.diverged.as_deref(), None, "contacts with the ground fit");
        // The first ten are at one place; the last two stay alone.
        env.write(|data| (0..10).for_each(|k| data.qpos_mut()[7 * k] = 1e-3 * k as f64));
        env.step(1);
        let Some(EnvStatus::Diverged { reason, .. }) = env.row.diverged.as_deref() else { panic!("it runs") };
        let Divergence::BuffersExhausted { bodies, .. } = reason else { panic!("{reason}") };
        assert!(bodies.len() <= 10 && bodies.iter().all(|name| name.starts_with('s')), "{bodies:?}");
        assert!(["s0", "s1", "s2"].contains(&&*bodies[0]), "{bodies:?}");
        let text = reason.to_string();
        assert!(text.contains("do not fit into 2 GiB; expected fewer bodies that overlap; most contacts: s"), "{text}");
    }

    /// The same in one of 64 environments: it is stopped at its last state, and the others have the bits of a batch
    /// without such an environment.
    #[test]
    fn exhausted_buffers_of_one_of_64() {
        let sphere = |k: usize| format!("<body name='s{k}' pos='{k} 0 0.1'><freejoint/><geom size='0.1'/></body>");
        let spheres: String = (0..12).map(sphere).collect();
        let text = format!("<mujoco><worldbody><geom type='plane' size='20 1 1'/>{spheres}</worldbody></mujoco>");
        let model = mj::compile(&text, &[]).expect("compiles").into_model();
        let few = model.with_buffers(Buffers { contacts: 12, constraints: 48, arena_bytes: 1 << 17 });
        let batch = || {
            let mut batch =
                Batch::new(&few, &Arc::default(), 64, 1, kinetoscope_exec::ThreadPool::new()).expect("small");
            batch.run(|i, env| {
                env.max_bytes = 0;
                env.write(|data| data.qvel_mut()[0] = 0.01 * i as f64);
            });
            batch.step(2);
            batch
        };
        let bits = |batch: &Batch, i: usize| {
            batch.read(i, |env| {
                let data = env.data();
                let all = [data.qpos(), data.qvel(), data.qacc_warmstart()];
                all.into_iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>()
            })
        };
        let (mut crowded, mut calm) = (batch(), batch());
        crowded.run(|i, env| {
            if i == 17 {
                env.write(|data| (0..10).for_each(|k| data.qpos_mut()[7 * k] = 1e-3 * k as f64));
            }
        });
        crowded.step(30);
        calm.step(30);
        let status = crowded.read(17, |env| env.status().clone());
        let EnvStatus::Diverged { reason: Divergence::BuffersExhausted { .. }, .. } = status else {
            panic!("{status:?}")
        };
        let different: Vec<usize> = (0..64).filter(|&i| bits(&crowded, i) != bits(&calm, i)).collect();
        assert_eq!(different, [17]);
        // It is revived by a reset.
        crowded.run(|i, env| {
            if i == 17 {
                env.reset(|_, _| ());
            }
        });
        crowded.step(1);
        assert_eq!(crowded.read(17, |env| env.status().clone()), EnvStatus::Running);
    }
}
