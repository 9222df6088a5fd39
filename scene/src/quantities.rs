//! The macro behind the list of quantities in [`state`](crate::state). It generates the fields of `SceneState`, the
//! flags of `StateFields`, and all code that handles each field.

use ndarray::{Array, Axis, RemoveAxis};

/// Values of a quantity in all environments.
pub(crate) trait PerEnvArray: Clone {
    /// Creates an array of default values, shape (num_envs, `shape`...). A quantity of variable length gets one empty
    /// list per environment.
    fn zeroed(num_envs: usize, shape: &[usize]) -> Self;

    /// True if `other` has the same sizes, in `num_envs` environments.
    fn same_shape(&self, other: &Self, num_envs: usize) -> bool;

    /// Copies the environments where `chosen` is true from values that [fit](Self::same_shape).
    fn copy_envs_from(&mut self, other: &Self, chosen: &[bool]);
}

impl<T: Clone + Default, D: RemoveAxis> PerEnvArray for Array<T, D> {
    fn zeroed(num_envs: usize, shape: &[usize]) -> Self {
        let mut lengths = D::zeros(1 + shape.len());
        lengths[0] = num_envs;
        shape.iter().enumerate().for_each(|(axis, length)| lengths[1 + axis] = *length);
        Self::default(lengths)
    }

    fn same_shape(&self, other: &Self, _num_envs: usize) -> bool {
        self.shape() == other.shape()
    }

    fn copy_envs_from(&mut self, other: &Self, chosen: &[bool]) {
        for (env, _) in (0..).zip(chosen).filter(|(_, chosen)| **chosen) {
            self.index_axis_mut(Axis(0), env).assign(&other.index_axis(Axis(0), env));
        }
    }
}

/// Lists of variable length, one for each environment.
impl<T: Clone> PerEnvArray for Vec<Vec<T>> {
    fn zeroed(num_envs: usize, _shape: &[usize]) -> Self {
        vec![Vec::new(); num_envs]
    }

    fn same_shape(&self, other: &Self, num_envs: usize) -> bool {
        [self.len(), other.len()] == [num_envs; 2]
    }

    fn copy_envs_from(&mut self, other: &Self, chosen: &[bool]) {
        for ((to, from), _) in self.iter_mut().zip(other).zip(chosen).filter(|(_, chosen)| **chosen) {
            to.clone_from(from);
        }
    }
}

/// Takes a list of flags of `StateFields`, each with its name in messages and its fields of `SceneState`.
///
/// A field has a type that implements [`PerEnvArray`], and its shape in an environment: an axis of `StateDims`, and the
/// width of a second axis.
macro_rules! quantities {
    ($(
        $(#[$about:meta])*
        $FLAG:ident = $name:literal {
            $($(#[$doc:meta])* $field:ident: $Type:ty $([$axis:ident $(, $width:literal)?])?,)+
        }
    )+) => {
        /// State of all environments after a physics step, a reset or a write to the state. Only requested quantities
        /// are present; the others are `None`.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct SceneState {
            /// Physics steps (of `physics_dt`) since the last reset of each environment, shape \[num_envs\].
            pub step: Vec<u64>,
            /// Time of positions and velocities \[s\] since the last reset, shape \[num_envs\].
            pub time: Vec<f64>,
            /// Time of efforts, accelerations and contacts \[s\] since the last reset, shape \[num_envs\].
            ///
            /// It is one MuJoCo step (`physics_dt / substeps`) earlier than [`time`](Self::time). Right after a reset
            /// or a write to the state, both are equal, because accelerations and contacts are then solved for the
            /// current state. Efforts of drives stay those of the last step, 0 after a reset.
            pub force_time: Vec<f64>,
            $($($(#[$doc])* pub $field: Option<$Type>,)+)+
            /// Render scenes of environments with their own sizes or colors, shape \[num_envs\]; empty if all
            /// environments share one scene, or if neither `visible` nor `instance_poses` is requested.
            pub own_scenes: Vec<EnvScene>,
        }

        /// Bit numbers of the flags.
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "named as the flags")]
        enum Bit {
            $($FLAG,)+
        }

        impl StateFields {
            $($(#[$about])* pub const $FLAG: Self = Self(1 << Bit::$FLAG as u32);)+

            /// All flags, with their names in messages.
            pub(crate) const NAMES: &'static [(Self, &'static str)] = &[$((Self::$FLAG, $name),)+];

            /// Flags whose fields are all present in `state`.
            pub fn present_in(state: &SceneState) -> Self {
                let mut present = Self::NONE;
                $(if [$(state.$field.is_some()),+].iter().all(|is| *is) {
                    present |= Self::$FLAG;
                })+
                present
            }

            /// Copies the fields of `state` that are in the set, with steps and times. The copy has the scenes of
            /// [`SceneState::own_scenes`] only with [`VISIBLE`](Self::VISIBLE) or [`INSTANCES`](Self::INSTANCES).
            pub fn part_of(self, state: &SceneState) -> SceneState {
                let sees = self.contains(Self::VISIBLE) || self.contains(Self::INSTANCES);
                SceneState {
                    step: state.step.clone(),
                    time: state.time.clone(),
                    force_time: state.force_time.clone(),
                    $($($field: state.$field.as_ref().filter(|_| self.contains(Self::$FLAG)).cloned(),)+)+
                    own_scenes: if sees { state.own_scenes.clone() } else { Vec::new() },
                }
            }
        }

        impl SceneState {
            /// Creates a state at step 0 with the fields of `requires`, filled with default values. The arrays of
            /// `visible` are empty.
            pub fn with_room(requires: StateFields, lengths: &StateDims) -> Self {
                let n = lengths.num_envs;
                let wants = |flag| requires.contains(flag);
                Self {
                    $($($field: wants(StateFields::$FLAG)
                        .then(|| <$Type as PerEnvArray>::zeroed(n, &[$(lengths.$axis $(, $width)?)?])),)+)+
                    ..Self::new(n)
                }
            }

            /// Returns the first axis of the arrays of `requires` that has another length than in `lengths`: its name,
            /// expected and found length; `None` if all fit. Absent arrays, contacts, markers and `visible` are not
            /// checked.
            pub fn misfit(&self, requires: StateFields, lengths: &StateDims) -> Option<(&'static str, usize, usize)> {
                $($($(if let Some([envs, count, ..]) = self.$field.as_ref().map(|array| array.shape())
                    && requires.contains(StateFields::$FLAG)
                {
                    let all = [
                        ("environments", lengths.num_envs, *envs),
                        (StateDims::label(stringify!($axis)), lengths.$axis, *count),
                    ];
                    if let Some(misfit) = all.into_iter().find(|(_, expected, found)| expected != found) {
                        return Some(misfit);
                    }
                })?)+)+
                None
            }

            /// True if `other` has every quantity of this state, in the same sizes.
            fn has_quantities_of(&self, other: &Self) -> bool {
                let n = self.num_envs();
                [$($(match (&self.$field, &other.$field) {
                    (None, _) => true,
                    (Some(_), None) => false,
                    (Some(mine), Some(others)) => mine.same_shape(others, n),
                },)+)+].iter().all(|fits| *fits)
            }

            /// Copies the quantities of this state from `other`, in the environments where `chosen` is true.
            fn take_over_quantities(&mut self, other: &Self, chosen: &[bool]) {
                $($(if let (Some(mine), Some(others)) = (&mut self.$field, &other.$field) {
                    mine.copy_envs_from(others, chosen);
                })+)+
            }
        }
    };
}
pub(crate) use quantities;
