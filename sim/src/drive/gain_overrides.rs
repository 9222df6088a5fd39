//! Overrides of drive gains in one environment, by randomization or environment properties. Overrides are not part of
//! the state: a snapshot holds the values below the override, and an environment that restores a snapshot keeps its own
//! overrides.

use super::DriveType;
use super::gains::{DriveSetting, Gains};
use super::table::DriveState;

/// Override of one gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GainOverride {
    /// The gain in torque units, or the effort limit.
    value: f64,
    /// The overridden value: stiffness or damping in the unit of the drive type, or an effort limit.
    overridden: f64,
}

/// Overrides of one drive, in the order of [`GainKind::ALL`].
pub(super) type GainOverrides = [Option<GainOverride>; 3];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GainKind {
    Stiffness,
    Damping,
    MaxEffort,
}

impl GainKind {
    const ALL: [Self; 3] = [Self::Stiffness, Self::Damping, Self::MaxEffort];

    fn gain(self, gains: &Gains) -> f64 {
        match self {
            Self::Stiffness => gains.kp,
            Self::Damping => gains.kd,
            Self::MaxEffort => gains.max_effort,
        }
    }

    /// User value of the gain: stiffness or damping in the unit of the drive type, or the effort limit.
    fn user_value(self, gains: &Gains, setting: &DriveSetting) -> f64 {
        match self {
            Self::Stiffness => setting.stiffness,
            Self::Damping => setting.damping,
            Self::MaxEffort => gains.max_effort,
        }
    }

    /// Sets the gain in torque units and the matching user value in the unit of the drive type. A passive joint keeps
    /// its gains.
    fn write_torque_value(self, value: f64, gains: &mut Gains, setting: &mut DriveSetting) {
        let unit = setting.gain_scale();
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
    fn write_user_value(self, value: f64, gains: &mut Gains, setting: &mut DriveSetting) {
        match self {
            Self::Stiffness => setting.stiffness = value,
            Self::Damping => setting.damping = value,
            Self::MaxEffort => gains.max_effort = value,
        }
        let (kp, kd) = setting.torque_gains().map_or((0.0, 0.0), |spec| (spec.kp, spec.kd));
        match self {
            Self::Stiffness => gains.kp = kp,
            Self::Damping => gains.kd = kd,
            Self::MaxEffort => {}
        }
    }
}

impl DriveState {
    /// Override of a gain; `None` without one. It exists even while a passive joint has no gains.
    fn gain_override(&self, drive: usize, kind: GainKind) -> Option<GainOverride> {
        self.overrides[drive][kind as usize]
    }

    /// Overrides stiffness, damping (in torque units) and effort limit of a drive, even if a value equals the current
    /// or nominal one. `None` leaves a value unchanged.
    pub(crate) fn override_gains(&mut self, drive: usize, values: [Option<f64>; 3]) {
        for (kind, value) in GainKind::ALL.into_iter().zip(values) {
            if let Some(value) = value {
                self.set_override(drive, kind, value);
            }
        }
    }

    /// Resets gains and effort limit of a drive to those of the model, and removes the overrides.
    pub(crate) fn reset_to_nominal(&mut self, drive: usize) {
        let initial = self.table().drives[drive].initial;
        for kind in GainKind::ALL {
            let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
            let nominal = kind.gain(&initial);
            if nominal.to_bits() != kind.gain(&gains).to_bits() {
                kind.write_torque_value(nominal, &mut gains, &mut setting);
                self.gains.set_if_changed(drive, gains);
                self.settings.set_if_changed(drive, setting);
            }
            self.clear_override(drive, kind);
        }
    }

    /// Restores the override of one gain, whatever the value below it, even if both are equal: the override then
    /// outlasts a change below it. `kind` is an index of [`GainKind::ALL`].
    pub(crate) fn restore_override(&mut self, drive: usize, kind: usize, value: f64) {
        self.set_override(drive, GainKind::ALL[kind], value);
    }

    fn set_override(&mut self, drive: usize, kind: GainKind, value: f64) {
        let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
        let before = self.gain_override(drive, kind);
        let overridden = before.map_or(kind.user_value(&gains, &setting), |drawn| drawn.overridden);
        kind.write_torque_value(value, &mut gains, &mut setting);
        self.gains.set_if_changed(drive, gains);
        self.settings.set_if_changed(drive, setting);
        let mut drawn = self.overrides[drive];
        drawn[kind as usize] = Some(GainOverride { value, overridden });
        self.overrides.set_if_changed(drive, drawn);
    }

    /// Sets the stiffness of a drive in this environment, in the unit of the drive type, and removes its override, even
    /// if both values are equal.
    pub(crate) fn set_stiffness(&mut self, drive: usize, value: f64) {
        self.update_setting(drive, |setting| setting.stiffness = value);
        self.clear_override(drive, GainKind::Stiffness);
    }

    /// Sets the damping of a drive as [`set_stiffness`](Self::set_stiffness) sets the stiffness.
    pub(crate) fn set_drive_damping(&mut self, drive: usize, value: f64) {
        self.update_setting(drive, |setting| setting.damping = value);
        self.clear_override(drive, GainKind::Damping);
    }

    /// Sets the effort limit of a drive as [`set_stiffness`](Self::set_stiffness) sets the stiffness.
    pub(crate) fn set_max_effort(&mut self, drive: usize, max_effort: f64) {
        self.set_limits(drive, |gains| Gains { max_effort, ..gains });
        self.clear_override(drive, GainKind::MaxEffort);
    }

    /// Changes the meaning of stiffness and damping of a drive. User values keep their numbers; overrides keep their
    /// value in torque units. `None` for `inertia` keeps the earlier inertia.
    pub(crate) fn set_drive_type(&mut self, drive: usize, drive_type: DriveType, inertia: Option<f64>) {
        let (gains, setting) = self.base_gains(drive);
        self.gains.set_if_changed(drive, gains);
        self.settings.set_if_changed(drive, setting);
        self.update_setting(drive, |old| *old = DriveSetting { drive_type, inertia: inertia.or(old.inertia), ..*old });
        self.set_base_gains(drive, self.gains[drive], self.settings[drive]);
    }

    fn clear_override(&mut self, drive: usize, kind: GainKind) {
        let mut drawn = self.overrides[drive];
        drawn[kind as usize] = None;
        self.overrides.set_if_changed(drive, drawn);
    }

    /// Overrides of stiffness, damping and effort limit of a drive; `None` without an override. Stiffness and damping
    /// are in torque units, not in the unit of the drive type.
    pub(crate) fn override_values(&self, drive: usize) -> [Option<f64>; 3] {
        GainKind::ALL.map(|kind| self.gain_override(drive, kind).map(|drawn| drawn.value))
    }

    /// Removes all overrides and restores the values below them.
    pub(crate) fn clear_overrides(&mut self) {
        for drive in 0..self.table().drives.len() {
            let (gains, setting) = self.base_gains(drive);
            self.gains.set_if_changed(drive, gains);
            self.settings.set_if_changed(drive, setting);
            self.overrides.set_if_changed(drive, GainOverrides::default());
        }
    }

    /// Gains and settings of a drive without its overrides.
    pub(super) fn base_gains(&self, drive: usize) -> (Gains, DriveSetting) {
        let (mut gains, mut setting) = (self.gains[drive], self.settings[drive]);
        for kind in GainKind::ALL {
            if let Some(drawn) = self.gain_override(drive, kind) {
                kind.write_user_value(drawn.overridden, &mut gains, &mut setting);
            }
        }
        (gains, setting)
    }

    /// Sets the values below the overrides of a drive; the overrides stay in effect.
    pub(super) fn set_base_gains(&mut self, drive: usize, mut gains: Gains, mut setting: DriveSetting) {
        let drawn = GainKind::ALL.map(|kind| {
            let GainOverride { value, .. } = self.gain_override(drive, kind)?;
            let overridden = kind.user_value(&gains, &setting);
            kind.write_torque_value(value, &mut gains, &mut setting);
            Some(GainOverride { value, overridden })
        });
        self.gains.set_if_changed(drive, gains);
        self.settings.set_if_changed(drive, setting);
        self.overrides.set_if_changed(drive, drawn);
    }
}
