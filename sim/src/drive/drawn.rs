//! Gains that override the nominal ones in one environment, randomized or set as environment properties. They are not
//! part of the state: a snapshot holds the values below the override, and an environment that restores a snapshot keeps
//! its own overrides.

use super::DriveType;
use super::gains::{Gains, Setting};
use super::table::DriveState;

/// Override of one gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawn {
    /// The gain in torque units, or the effort limit.
    value: f64,
    /// The overridden value: stiffness or damping in the unit of the drive type, or an effort limit.
    instead_of: f64,
}

/// Overrides of one drive, in the order of [`Kind::ALL`].
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

    /// User value of the gain: stiffness or damping in the unit of the drive type, or the effort limit.
    fn set_to(self, gains: &Gains, setting: &Setting) -> f64 {
        match self {
            Self::Stiffness => setting.stiffness,
            Self::Damping => setting.damping,
            Self::MaxEffort => gains.max_effort,
        }
    }

    /// Sets the gain in torque units and the matching user value in the unit of the drive type. A passive joint keeps
    /// its gains.
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

    /// Sets the user value, as a user does.
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
    /// Override of a gain. It exists even while a passive joint has no gains.
    fn drawn_gain(&self, drive: usize, kind: Kind) -> Option<Drawn> {
        self.drawn[drive][kind as usize]
    }

    /// Overrides the given gains (in torque units) and effort limit of a drive, even if a value equals the current or
    /// nominal one.
    pub(crate) fn draw_gains(&mut self, drive: usize, values: [Option<f64>; 3]) {
        for (kind, value) in Kind::ALL.into_iter().zip(values) {
            if let Some(value) = value {
                self.draw(drive, kind, value);
            }
        }
    }

    /// Resets gains and effort limit of a drive to those of the model, and removes the overrides.
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

    /// Restores the override of one gain, whatever the value below it, even if both are equal: the override then
    /// outlasts a change below it.
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

    /// Sets the stiffness of a drive, in the unit of its type, as a user does. Removes the override, even if both
    /// values are equal.
    pub(crate) fn set_stiffness(&mut self, drive: usize, value: f64) {
        self.set(drive, |setting| setting.stiffness = value);
        self.undraw(drive, Kind::Stiffness);
    }

    /// As [`set_stiffness`](Self::set_stiffness), for the damping.
    pub(crate) fn set_drive_damping(&mut self, drive: usize, value: f64) {
        self.set(drive, |setting| setting.damping = value);
        self.undraw(drive, Kind::Damping);
    }

    /// As [`set_stiffness`](Self::set_stiffness), for the effort limit.
    pub(crate) fn set_max_effort(&mut self, drive: usize, max_effort: f64) {
        self.set_limits(drive, |gains| Gains { max_effort, ..gains });
        self.undraw(drive, Kind::MaxEffort);
    }

    /// Changes the meaning of stiffness and damping of a drive. User values keep their numbers; overrides keep their
    /// value in torque units.
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

    /// Overridden gains (in torque units) and effort limit of a drive; `None` without override.
    pub(crate) fn drawn_values(&self, drive: usize) -> [Option<f64>; 3] {
        Kind::ALL.map(|kind| self.drawn_gain(drive, kind).map(|drawn| drawn.value))
    }

    /// Removes all overrides and restores the values below them.
    pub(crate) fn forget_drawn(&mut self) {
        for drive in 0..self.table().drives.len() {
            let (gains, setting) = self.without_drawn(drive);
            self.gains.put(drive, gains);
            self.settings.put(drive, setting);
            self.drawn.put(drive, DrawnGains::default());
        }
    }

    /// Gains and settings of a drive without its overrides.
    pub(super) fn without_drawn(&self, drive: usize) -> (Gains, Setting) {
        let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
        for kind in Kind::ALL {
            if let Some(drawn) = self.drawn_gain(drive, kind) {
                kind.set(drawn.instead_of, &mut gains, &mut setting);
            }
        }
        (gains, setting)
    }

    /// Sets the values below the overrides of a drive; the overrides stay in effect.
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
