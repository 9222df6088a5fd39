//! Gains that an environment has as properties of its own, drawn or set. They are not of its state: a snapshot holds what
//! they stand in for, and an environment that goes on from a snapshot keeps its own.

use super::DriveType;
use super::gains::{Gains, Setting};
use super::table::DriveState;

/// A gain that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawn {
    /// The gain, in torque units.
    value: f64,
    /// What it stands in for: stiffness or damping in the unit of the drive type, or an effort limit.
    instead_of: f64,
}

/// What is drawn of each drive, in the order of [`Kind::ALL`].
pub(super) type DrawnGains = [Option<Drawn>; 3];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Stiffness,
    Damping,
    MaxEffort,
}

impl Kind {
    const ALL: [Self; 3] = [Self::Stiffness, Self::Damping, Self::MaxEffort];

    fn gain(self, gains: &Gains) -> f64 {
        match self {
            Self::Stiffness => gains.kp,
            Self::Damping => gains.kd,
            Self::MaxEffort => gains.max_effort,
        }
    }

    /// What a user sets of it.
    fn set_to(self, gains: &Gains, setting: &Setting) -> f64 {
        match self {
            Self::Stiffness => setting.stiffness,
            Self::Damping => setting.damping,
            Self::MaxEffort => gains.max_effort,
        }
    }

    /// Sets the gain; the drive type stays, and gives it back in its unit. A passive joint has no gains.
    fn put(self, value: f64, gains: &mut Gains, setting: &mut Setting) {
        let unit = setting.unit();
        let in_unit = value / unit.unwrap_or(1.0);
        match self {
            Self::Stiffness => {
                setting.stiffness = in_unit;
                gains.kp = if unit.is_some() { value } else { gains.kp };
            }
            Self::Damping => {
                setting.damping = in_unit;
                gains.kd = if unit.is_some() { value } else { gains.kd };
            }
            Self::MaxEffort => gains.max_effort = value,
        }
    }

    /// Sets it as a user would.
    fn set(self, value: f64, gains: &mut Gains, setting: &mut Setting) {
        match self {
            Self::Stiffness => setting.stiffness = value,
            Self::Damping => setting.damping = value,
            Self::MaxEffort => gains.max_effort = value,
        }
        let (kp, kd) = setting.actuator().map_or((0.0, 0.0), |spec| (spec.kp, spec.kd));
        match self {
            Self::Stiffness => gains.kp = kp,
            Self::Damping => gains.kd = kd,
            Self::MaxEffort => {}
        }
    }
}

impl DriveState {
    /// What is drawn of a gain. The record says so, whatever the gain is now: a passive joint has none.
    fn drawn_gain(&self, drive: usize, kind: Kind) -> Option<Drawn> {
        self.drawn[drive][kind as usize]
    }

    /// Draws gains (in torque units) and the effort limit of a drive, those that are given: also to what they are, or to the
    /// nominal value.
    pub(crate) fn draw_gains(&mut self, drive: usize, values: [Option<f64>; 3]) {
        for (kind, value) in Kind::ALL.into_iter().zip(values) {
            if let Some(value) = value {
                self.draw(drive, kind, value);
            }
        }
    }

    /// Gains and the effort limit of a drive become those that the model starts with, and are drawn no longer.
    pub(crate) fn become_nominal(&mut self, drive: usize) {
        let initial = self.table().drives[drive].initial;
        for kind in Kind::ALL {
            let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
            let nominal = kind.gain(&initial);
            if nominal.to_bits() != kind.gain(&gains).to_bits() {
                kind.put(nominal, &mut gains, &mut setting);
                self.gains.put(drive, gains);
                self.settings.put(drive, setting);
            }
            self.undraw(drive, kind);
        }
    }

    /// One of them is drawn as it was, whatever is below it: also its very value, which stays then when that changes.
    pub(crate) fn redraw_gain(&mut self, drive: usize, kind: usize, value: f64) {
        self.draw(drive, Kind::ALL[kind], value);
    }

    fn draw(&mut self, drive: usize, kind: Kind, value: f64) {
        let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
        let before = self.drawn_gain(drive, kind);
        let instead_of = before.map_or(kind.set_to(&gains, &setting), |drawn| drawn.instead_of);
        kind.put(value, &mut gains, &mut setting);
        self.gains.put(drive, gains);
        self.settings.put(drive, setting);
        let mut drawn = self.drawn[drive];
        drawn[kind as usize] = Some(Drawn { value, instead_of });
        self.drawn.put(drive, drawn);
    }

    /// Sets the stiffness of a drive, in the unit of its type, as a user does: it is drawn no longer, also where it was set
    /// to the very value that was drawn.
    pub(crate) fn set_stiffness(&mut self, drive: usize, value: f64) {
        self.set(drive, |setting| setting.stiffness = value);
        self.undraw(drive, Kind::Stiffness);
    }

    /// As [`set_stiffness`](Self::set_stiffness), of the damping.
    pub(crate) fn set_drive_damping(&mut self, drive: usize, value: f64) {
        self.set(drive, |setting| setting.damping = value);
        self.undraw(drive, Kind::Damping);
    }

    /// As [`set_stiffness`](Self::set_stiffness), of the effort limit.
    pub(crate) fn set_max_effort(&mut self, drive: usize, max_effort: f64) {
        self.set_limits(drive, |gains| Gains { max_effort, ..gains });
        self.undraw(drive, Kind::MaxEffort);
    }

    /// Changes what stiffness and damping of a drive mean: those that were set keep their numbers, those that are drawn what
    /// they are in torque units.
    pub(crate) fn set_drive_type(&mut self, drive: usize, drive_type: DriveType, inertia: Option<f64>) {
        let (gains, setting) = self.without_drawn(drive);
        self.gains.put(drive, gains);
        self.settings.put(drive, setting);
        self.set(drive, |old| *old = Setting { drive_type, inertia: inertia.or(old.inertia), ..*old });
        self.set_below_drawn(drive, self.gains[drive], self.settings[drive]);
    }

    fn undraw(&mut self, drive: usize, kind: Kind) {
        let mut drawn = self.drawn[drive];
        drawn[kind as usize] = None;
        self.drawn.put(drive, drawn);
    }

    /// The gains and the effort limit of a drive that are drawn.
    pub(crate) fn drawn_values(&self, drive: usize) -> [Option<f64>; 3] {
        Kind::ALL.map(|kind| self.drawn_gain(drive, kind).map(|drawn| drawn.value))
    }

    /// Gains and settings become what they would be if nothing had been drawn.
    pub(crate) fn forget_drawn(&mut self) {
        for drive in 0..self.table().drives.len() {
            let (gains, setting) = self.without_drawn(drive);
            self.gains.put(drive, gains);
            self.settings.put(drive, setting);
            self.drawn.put(drive, DrawnGains::default());
        }
    }

    /// Gains and setting of a drive as they would be if nothing had been drawn.
    pub(super) fn without_drawn(&self, drive: usize) -> (Gains, Setting) {
        let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
        for kind in Kind::ALL {
            if let Some(drawn) = self.drawn_gain(drive, kind) {
                kind.set(drawn.instead_of, &mut gains, &mut setting);
            }
        }
        (gains, setting)
    }

    /// Sets gains and setting of a drive; those that are drawn stay, and stand in for these.
    pub(super) fn set_below_drawn(&mut self, drive: usize, mut gains: Gains, mut setting: Setting) {
        let drawn = Kind::ALL.map(|kind| {
            let Drawn { value, .. } = self.drawn_gain(drive, kind)?;
            let instead_of = kind.set_to(&gains, &setting);
            kind.put(value, &mut gains, &mut setting);
            Some(Drawn { value, instead_of })
        });
        self.gains.put(drive, gains);
        self.settings.put(drive, setting);
        self.drawn.put(drive, drawn);
    }
}
