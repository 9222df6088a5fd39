//! Settings of `<option>` of a model, and their comparison for two models.

use super::model::Model;
use mujoco_sys as mj;

/// A global setting that differs between two models.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionDifference {
    /// MJCF name of the setting: an attribute of `<option>`, or `flag NAME` for an attribute of its `<flag>`.
    pub name: &'static str,
    /// Value in the first model.
    pub first: String,
    /// Value in the second model.
    pub second: String,
}

/// Keyword of an `<option>` code.
fn keyword(words: &[(u32, &str)], code: i32) -> String {
    words.iter().find(|(known, _)| *known as i32 == code).map_or_else(|| code.to_string(), |(_, word)| (*word).into())
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// Flags that are on unless disabled. `autoreset` and `island` of 4.x are excluded, because robot drives determine them
/// ([`Compiled::prepare_for_stepping`](super::Compiled::prepare_for_stepping)).
const DISABLED: &[(u32, &str)] = &[
    (mj::mjDSBL_CONSTRAINT, "flag constraint"),
    (mj::mjDSBL_EQUALITY, "flag equality"),
    (mj::mjDSBL_FRICTIONLOSS, "flag frictionloss"),
    (mj::mjDSBL_LIMIT, "flag limit"),
    (mj::mjDSBL_CONTACT, "flag contact"),
    #[cfg(not(mj4))]
    (mj::mjDSBL_PASSIVE, "flag passive"),
    #[cfg(mj4)]
    (mj::mjDSBL_SPRING, "flag spring"),
    #[cfg(mj4)]
    (mj::mjDSBL_DAMPER, "flag damper"),
    (mj::mjDSBL_GRAVITY, "flag gravity"),
    (mj::mjDSBL_CLAMPCTRL, "flag clampctrl"),
    (mj::mjDSBL_WARMSTART, "flag warmstart"),
    (mj::mjDSBL_FILTERPARENT, "flag filterparent"),
    (mj::mjDSBL_ACTUATION, "flag actuation"),
    (mj::mjDSBL_REFSAFE, "flag refsafe"),
    (mj::mjDSBL_SENSOR, "flag sensor"),
    #[cfg(mj4)]
    (mj::mjDSBL_MIDPHASE, "flag midphase"),
    #[cfg(mj4)]
    (mj::mjDSBL_EULERDAMP, "flag eulerdamp"),
    #[cfg(mj4)]
    (mj::mjDSBL_NATIVECCD, "flag nativeccd"),
    #[cfg(mj4)]
    (mj::mjDSBL_MULTICCD, "flag multiccd"),
];

/// Flags that are off unless enabled. Flags that only compute energies or statistics are excluded: they affect no step.
const ENABLED: &[(u32, &str)] = &[
    (mj::mjENBL_OVERRIDE, "flag override"),
    #[cfg(not(mj4))]
    (mj::mjENBL_SENSORNOISE, "flag sensornoise"),
    #[cfg(not(mj4))]
    (mj::mjENBL_MULTICCD, "flag multiccd"),
    #[cfg(mj4)]
    (mj::mjENBL_SLEEP, "flag sleep"),
    #[cfg(mj4)]
    (mj::mjENBL_DIAGEXACT, "flag diagexact"),
    #[cfg(mj4)]
    (mj::mjENBL_IPC, "flag ipc"),
    #[cfg(mj4)]
    (mj::mjENBL_SPECULATIVE, "flag speculative"),
];

impl Model {
    /// Names and values (as text) of the `<option>` settings that affect a step; names of flags begin with `flag `. On
    /// 4.x, the flags `autoreset` and `island` are not included.
    pub fn options(&self) -> Vec<(&'static str, String)> {
        let opt = &self.header().opt;
        let integrators = [
            (mj::mjINT_EULER, "Euler"),
            (mj::mjINT_RK4, "RK4"),
            (mj::mjINT_IMPLICIT, "implicit"),
            #[cfg(mj4)]
            (mj::mjINT_IMPLICITFAST, "implicitfast"),
        ];
        let cones = [(mj::mjCONE_PYRAMIDAL, "pyramidal"), (mj::mjCONE_ELLIPTIC, "elliptic")];
        let solvers = [(mj::mjSOL_PGS, "PGS"), (mj::mjSOL_CG, "CG"), (mj::mjSOL_NEWTON, "Newton")];
        let jacobians = [(mj::mjJAC_DENSE, "dense"), (mj::mjJAC_SPARSE, "sparse"), (mj::mjJAC_AUTO, "auto")];
        let mut options = vec![
            ("timestep", opt.timestep.to_string()),
            ("gravity", numbers(&opt.gravity)),
            ("wind", numbers(&opt.wind)),
            ("magnetic", numbers(&opt.magnetic)),
            ("density", opt.density.to_string()),
            ("viscosity", opt.viscosity.to_string()),
            ("integrator", keyword(&integrators, opt.integrator)),
            ("cone", keyword(&cones, opt.cone)),
            ("impratio", opt.impratio.to_string()),
            ("solver", keyword(&solvers, opt.solver)),
            ("jacobian", keyword(&jacobians, opt.jacobian)),
            ("iterations", opt.iterations.to_string()),
            ("tolerance", opt.tolerance.to_string()),
            ("noslip_iterations", opt.noslip_iterations.to_string()),
            ("noslip_tolerance", opt.noslip_tolerance.to_string()),
            ("o_margin", opt.o_margin.to_string()),
            ("o_solref", numbers(&opt.o_solref)),
            ("o_solimp", numbers(&opt.o_solimp)),
        ];
        #[cfg(not(mj4))]
        options.extend([
            ("collision", opt.collision.to_string()),
            ("mpr_iterations", opt.mpr_iterations.to_string()),
            ("mpr_tolerance", opt.mpr_tolerance.to_string()),
        ]);
        #[cfg(mj4)]
        options.extend([
            ("ccd_iterations", opt.ccd_iterations.to_string()),
            ("ccd_tolerance", opt.ccd_tolerance.to_string()),
            ("ls_iterations", opt.ls_iterations.to_string()),
            ("ls_tolerance", opt.ls_tolerance.to_string()),
            ("o_friction", numbers(&opt.o_friction)),
            ("actuatorgroupdisable", opt.disableactuator.to_string()),
            ("sdf_iterations", opt.sdf_iterations.to_string()),
            ("sdf_initpoints", opt.sdf_initpoints.to_string()),
            ("sleep_tolerance", opt.sleep_tolerance.to_string()),
        ]);
        let on = |on: bool| String::from(if on { "enable" } else { "disable" });
        options.extend(DISABLED.iter().map(|(bit, name)| (*name, on(opt.disableflags as u32 & bit == 0))));
        options.extend(ENABLED.iter().map(|(bit, name)| (*name, on(opt.enableflags as u32 & bit != 0))));
        options
    }

    /// Settings of [`options`](Self::options) that differ from those of `other`; `first` is the value in this model.
    pub fn option_differences(&self, other: &Self) -> Vec<OptionDifference> {
        let pairs = self.options().into_iter().zip(other.options());
        pairs
            .filter(|((_, here), (_, there))| here != there)
            .map(|((name, first), (_, second))| OptionDifference { name, first, second })
            .collect()
    }
}
