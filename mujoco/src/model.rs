//! Compiled models: mutable until shared, then immutable.

use super::data::Overflow;
use super::patch::{ModelPatch, OwnArrays};
use mujoco_sys as mj;
use mujoco_sys::fields::model::{ModelArray, each};
use std::ptr::NonNull;
use std::sync::Arc;

/// Owner of a model that MuJoCo allocated (`mj_loadXML`, `mj_copyModel`). The model is freed with its last owner: a
/// [`Model`] or an editor.
#[derive(Debug)]
pub(super) struct Storage(pub(super) NonNull<mj::mjModel>);

// SAFETY: the model is plain memory without thread affinity; it is written only through `Compiled` or `ModelEditor`,
// which is its only owner then.
unsafe impl Send for Storage {}
// SAFETY: once shared in a `Model`, nothing writes to it.
unsafe impl Sync for Storage {}

impl Storage {
    pub(super) fn header(&self) -> &mj::mjModel {
        // SAFETY: the model is alive as long as `self`; every writer borrows its owner mutably.
        unsafe { self.0.as_ref() }
    }

    pub(super) fn header_mut(&mut self) -> &mut mj::mjModel {
        // SAFETY: the model is alive, and `self`, its owner, is borrowed mutably.
        unsafe { self.0.as_mut() }
    }
}

impl Drop for Storage {
    fn drop(&mut self) {
        // SAFETY: made by MuJoCo, deleted once.
        unsafe { mj::mj_deleteModel(self.0.as_ptr()) };
    }
}

/// A freshly compiled model that may still be edited.
#[derive(Debug)]
pub struct Compiled(Storage);

impl Compiled {
    /// # Safety
    /// `raw` is a model made by MuJoCo, without another owner.
    pub(super) unsafe fn from_raw(raw: NonNull<mj::mjModel>) -> Self {
        Self(Storage(raw))
    }

    pub(super) fn raw(&self) -> *const mj::mjModel {
        self.0.0.as_ptr()
    }

    pub(super) fn raw_mut(&mut self) -> *mut mj::mjModel {
        self.0.0.as_ptr()
    }

    /// Ends editing and returns the immutable model.
    pub fn into_model(self) -> Model {
        // SAFETY: a bitwise copy of the struct: its pointers lead into `storage`, which outlives it, and the copy is
        // never freed as a model (mjModel has no destructor of its own).
        let header = unsafe { std::ptr::read(self.0.0.as_ptr()) };
        Model(Arc::new(ShallowModel { header, storage: Arc::new(self.0), own: Arc::default(), patch: None }))
    }
}

/// A shallow `mjModel`: it has its own sizes and options, and shares its arrays with the storage except for those of its
/// patch.
///
/// It is not one allocation. Functions that need one (`mj_copyModel`, `mj_saveModel`, `mj_deleteModel`) must not
/// receive it. Functions that step or read follow its pointers and may.
pub(super) struct ShallowModel {
    /// Its pointers lead into `storage`, those of the arrays of `patch` into `own`.
    pub(super) header: mj::mjModel,
    pub(super) storage: Arc<Storage>,
    pub(super) own: Arc<OwnArrays>,
    pub(super) patch: Option<Arc<ModelPatch>>,
}

/// An array that a model does not share with its compiled model. Only the sole owner of a model writes to it
/// ([`Model::patched`]).
#[derive(Clone, Debug)]
pub(super) struct OwnArray {
    pub(super) field: ModelArray,
    /// Content, in units that are aligned for every element type.
    pub(super) memory: Box<[u64]>,
}

impl OwnArray {
    /// Copies the `field.bytes` bytes of `values` into an aligned array.
    pub(super) fn from_bytes(field: ModelArray, values: &[u8]) -> Self {
        let mut memory = vec![0_u64; field.bytes.div_ceil(8)];
        for (word, chunk) in memory.iter_mut().zip(values.chunks(8)) {
            let mut whole = [0; 8];
            whole[..chunk.len()].copy_from_slice(chunk);
            *word = u64::from_ne_bytes(whole);
        }
        Self { field, memory: memory.into() }
    }
}

impl std::fmt::Debug for ShallowModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("mjModel").field("nq", &self.header.nq).field("nv", &self.header.nv).finish_non_exhaustive()
    }
}

impl ShallowModel {
    /// Copies the struct alone. Its pointers lead into memory that `self` keeps alive.
    pub(super) fn copy_header(&self) -> mj::mjModel {
        // SAFETY: bitwise copy of a plain C struct that is never freed as a model.
        unsafe { std::ptr::read(&self.header) }
    }

    /// The same model with a changed struct: only its buffer sizes may differ.
    fn with_header(&self, header: mj::mjModel) -> Self {
        Self { header, storage: Arc::clone(&self.storage), own: Arc::clone(&self.own), patch: self.patch.clone() }
    }
}

// SAFETY: the pointers in `header` lead into `storage` and `own`, which are Send + Sync; nothing writes through them.
unsafe impl Send for ShallowModel {}
// SAFETY: as above.
unsafe impl Sync for ShallowModel {}

/// Pointer to an array of a model; null for an empty array. `field` is one of `fields::model::each`.
pub(super) fn array_pointer(model: &mj::mjModel, field: &ModelArray) -> *const u8 {
    // SAFETY: the offset is that of a pointer inside of the struct.
    let pointer = unsafe { std::ptr::from_ref(model).byte_add(field.pointer_offset) };
    // SAFETY: the struct has a pointer at this offset; the pointer is read and not followed.
    unsafe { pointer.cast::<*const u8>().read() }
}

/// An immutable model, cheap to clone and to share between environments and threads.
#[derive(Clone, Debug)]
pub struct Model(pub(super) Arc<ShallowModel>);

/// Buffer sizes of a [`Data`](super::Data) for contacts and constraints.
///
/// On 2.2.2, memory grows with the square of `constraints`, so both sizes start small and grow on demand. On 4.x,
/// contacts and constraints share one arena.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Buffers {
    /// Largest number of contacts (2.2.2; unused on 4.x).
    pub contacts: usize,
    /// Largest number of constraint rows, which also determines the stack size (2.2.2; unused on 4.x).
    pub constraints: usize,
    /// Size of the arena, stack included \[bytes\] (4.x; unused on 2.2.2).
    pub arena_bytes: usize,
}

impl Buffers {
    /// Returns sizes with twice the capacity of the buffer that overflowed. On 2.2.2, the stack grows with
    /// `constraints`, and the other buffer keeps its size, because unused rows are expensive. On 4.x, the arena
    /// doubles.
    #[must_use]
    pub fn enlarged(self, what: Overflow) -> Self {
        let twice = |n: usize| n.max(1).saturating_mul(2);
        // On 4.x, all of them share the arena. On 2.2.2, the stack is sized for the rows.
        let larger = Self { arena_bytes: twice(self.arena_bytes), ..self };
        match what {
            Overflow::Contacts => Self { contacts: twice(self.contacts), ..larger },
            Overflow::Constraints | Overflow::Stack => Self { constraints: twice(self.constraints), ..larger },
        }
    }
}

impl Model {
    pub(super) fn raw(&self) -> *const mj::mjModel {
        &self.0.header
    }

    pub(super) fn header(&self) -> &mj::mjModel {
        &self.0.header
    }

    /// True if one is a clone of the other. Results of [`with_buffers`](Self::with_buffers) are different models, even
    /// with equal content.
    pub fn ptr_eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Returns the same model with other buffer sizes; a size of 0 becomes 1. Only the struct is copied; the arrays are
    /// shared.
    #[must_use]
    pub fn with_buffers(&self, buffers: Buffers) -> Self {
        let mut header = self.0.copy_header();
        set_buffers(&mut header, buffers);
        Self(Arc::new(self.0.with_header(header)))
    }

    pub(super) fn storage(&self) -> &Arc<Storage> {
        &self.0.storage
    }

    /// The compiled model, which is one allocation.
    pub(super) fn compiled(&self) -> &mj::mjModel {
        self.0.storage.header()
    }

    /// Returns the same model with the buffer sizes of `like`, which must come from the same compilation. A model that
    /// has these sizes already is only cloned.
    ///
    /// # Panics
    /// `like` comes from another compilation.
    #[must_use]
    pub fn with_buffers_of(&self, like: &Self) -> Self {
        if self.is_compatible_with(like) {
            return self.clone();
        }
        assert!(Arc::ptr_eq(&self.0.storage, &like.0.storage), "the model was compiled from another scene");
        let mut header = self.0.copy_header();
        let sizes = like.header();
        (header.nconmax, header.njmax) = (sizes.nconmax, sizes.njmax);
        #[cfg(mj4)]
        {
            header.narena = sizes.narena;
        }
        #[cfg(not(mj4))]
        {
            header.nstack = sizes.nstack;
        }
        Self(Arc::new(self.0.with_header(header)))
    }

    /// True if data of one model can be used with the other: both come from one compiled model, with equal buffer
    /// sizes.
    pub fn is_compatible_with(&self, other: &Self) -> bool {
        let sizes = |m: &mj::mjModel| {
            #[cfg(mj4)]
            let stack = m.narena;
            #[cfg(not(mj4))]
            let stack = m.nstack;
            (m.nconmax, m.njmax, stack)
        };
        Arc::ptr_eq(&self.0.storage, &other.0.storage) && sizes(self.header()) == sizes(other.header())
    }

    /// Names and sizes \[bytes\] of the arrays that this model does not share with the compiled model.
    pub fn own_arrays(&self) -> impl Iterator<Item = (&'static str, usize)> {
        self.0.patch.iter().flat_map(|patch| patch.arrays())
    }

    /// Memory of the struct and of this model's own arrays \[bytes\].
    ///
    /// Models that differ only in buffer sizes share these arrays.
    pub fn own_bytes(&self) -> usize {
        size_of::<ShallowModel>() + self.0.own.bytes()
    }

    /// Memory of all arrays of the compiled model \[bytes\]. All models made from it share these arrays. Arrays that
    /// this model replaced by its own copies are included.
    pub fn shared_bytes(&self) -> usize {
        self.header().nbuffer as usize
    }

    /// Names of the arrays that are stored in different memory in the two models, which come from one compiled model.
    pub fn unshared_arrays(&self, other: &Self) -> Vec<&'static str> {
        let (mine, theirs) = (self.array_pointers(), other.array_pointers());
        mine.iter().zip(&theirs).filter(|(mine, theirs)| mine.1 != theirs.1).map(|(mine, _)| mine.0).collect()
    }

    fn array_pointers(&self) -> Vec<(&'static str, *const u8)> {
        let mut pointers = Vec::new();
        // SAFETY: the model is alive.
        unsafe { each(self.raw(), |field| pointers.push((field.name, array_pointer(self.header(), &field)))) };
        pointers
    }

    /// Buffer sizes of a new [`Data`](super::Data) of this model. `arena_bytes` is 0 on 2.2.2.
    pub fn buffers(&self) -> Buffers {
        let m = self.header();
        #[cfg(mj4)]
        let arena_bytes = m.narena as usize;
        #[cfg(not(mj4))]
        let arena_bytes = 0;
        Buffers { contacts: m.nconmax.max(0) as usize, constraints: m.njmax.max(0) as usize, arena_bytes }
    }

    /// Small initial buffer sizes: room for the permanent constraints (at most six rows per equality; drives, friction,
    /// limits) and for 16 contacts of four rows (pyramidal cones, `condim` 3). A model that needs more overflows
    /// ([`WarningCounts::overflow`](crate::WarningCounts::overflow)): see [`Buffers::enlarged`].
    pub fn small_buffers(&self) -> Buffers {
        const CONTACTS: usize = 16;
        /// Rows of a contact with a pyramidal cone of dimension 3.
        const ROWS_PER_CONTACT: usize = 4;
        let m = self.header();
        let always = 6 * m.neq as usize + 2 * m.nv as usize + 2 * m.ntendon as usize;
        // The arena holds Jacobians, the solver's Hessian and its stack. This size fits the bundled robots without
        // growing. A scene that needs more grows at its first step.
        let rows = always + CONTACTS * ROWS_PER_CONTACT;
        let nv = m.nv as usize;
        Buffers {
            contacts: CONTACTS,
            constraints: rows,
            arena_bytes: (1 << 18) + 8 * (4 * rows * nv + 8 * nv * nv + 64 * rows) + 4096 * CONTACTS,
        }
    }

    /// Number of generalized positions, the length of `qpos`: 7 for a free joint, 4 for a ball joint, 1 for a hinge or
    /// slide.
    pub fn nq(&self) -> usize {
        self.header().nq as usize
    }

    /// Number of degrees of freedom, the length of `qvel`: 6 for a free joint, 3 for a ball joint, 1 for a hinge or
    /// slide.
    pub fn nv(&self) -> usize {
        self.header().nv as usize
    }

    /// Number of control inputs, the length of `ctrl`.
    pub fn nu(&self) -> usize {
        self.header().nu as usize
    }

    /// Number of bodies, the world included.
    pub fn nbody(&self) -> usize {
        self.header().nbody as usize
    }

    /// Number of joints, free and ball joints included.
    pub fn njnt(&self) -> usize {
        self.header().njnt as usize
    }

    /// Number of geoms.
    pub fn ngeom(&self) -> usize {
        self.header().ngeom as usize
    }

    /// Number of meshes.
    pub fn nmesh(&self) -> usize {
        self.header().nmesh as usize
    }

    /// Number of textures.
    pub fn ntex(&self) -> usize {
        self.header().ntex as usize
    }

    /// Number of tendons.
    pub fn ntendon(&self) -> usize {
        self.header().ntendon as usize
    }

    /// Number of activations, the length of `act`.
    pub fn na(&self) -> usize {
        self.header().na as usize
    }

    /// Number of flexes; 0 on 2.2.2.
    pub fn nflex(&self) -> usize {
        #[cfg(mj4)]
        return self.header().nflex as usize;
        #[cfg(not(mj4))]
        0
    }

    /// Number of sites.
    pub fn nsite(&self) -> usize {
        self.header().nsite as usize
    }

    /// Number of equality constraints, active or not.
    pub fn neq(&self) -> usize {
        self.header().neq as usize
    }

    /// Number of geom pairs with their own contact parameters.
    pub fn npair(&self) -> usize {
        self.header().npair as usize
    }

    /// Number of MuJoCo's own sensors.
    pub fn nsensor(&self) -> usize {
        self.header().nsensor as usize
    }

    /// Number of values of MuJoCo's own sensors, the length of `sensordata`.
    pub fn nsensordata(&self) -> usize {
        self.header().nsensordata as usize
    }

    /// Number of keyframes.
    pub fn nkey(&self) -> usize {
        self.header().nkey as usize
    }

    /// Number of skins.
    pub fn nskin(&self) -> usize {
        self.header().nskin as usize
    }

    /// MuJoCo's time step \[s\] (`opt.timestep`).
    pub fn timestep(&self) -> f64 {
        self.header().opt.timestep
    }

    /// Gravity in world axes \[m/s²\] (`opt.gravity`), even if a flag disables gravity.
    pub fn gravity(&self) -> [f64; 3] {
        self.header().opt.gravity
    }

    /// Feature of the model with which a step depends on more than the state, so that every environment needs a
    /// [`Data`](super::Data) of its own: sleeping bodies, plugins, or flexes (4.x); `None` for all other models.
    pub fn persistent_feature(&self) -> Option<&'static str> {
        #[cfg(mj4)]
        {
            let m = self.header();
            if m.opt.enableflags & mj::mjENBL_SLEEP as i32 != 0 {
                return Some("the option flag sleep");
            }
            if m.nplugin > 0 {
                return Some("a plugin");
            }
            if m.nflex > 0 {
                return Some("a flex");
            }
        }
        None
    }

    /// True if actuators or sensors keep a history of values (`nsample`, for delays and intervals; 4.x).
    pub fn has_history(&self) -> bool {
        #[cfg(mj4)]
        return self.header().nhistory > 0;
        #[cfg(not(mj4))]
        false
    }

    /// Number of mocap bodies.
    pub fn nmocap(&self) -> usize {
        self.header().nmocap as usize
    }

    /// Code of the integrator (`mjINT_EULER`, ...).
    pub fn integrator(&self) -> u32 {
        self.header().opt.integrator as u32
    }
}

#[cfg(mj4)]
pub(super) fn set_buffers(header: &mut mj::mjModel, buffers: Buffers) {
    // MuJoCo cannot allocate an arena of size 0.
    header.narena = buffers.arena_bytes.max(1) as i64;
}

#[cfg(not(mj4))]
pub(super) fn set_buffers(header: &mut mj::mjModel, buffers: Buffers) {
    // With size 0, MuJoCo omits contacts or constraints, drives among them, without a warning.
    let as_int = |n: usize| i32::try_from(n.max(1)).unwrap_or(i32::MAX);
    header.nconmax = as_int(buffers.contacts);
    header.njmax = as_int(buffers.constraints);
    // MuJoCo's rule for nstack (user_model.cc, 2.2.2), in units of 8 bytes: 5 times the square of all rows and degrees
    // of freedom, plus a linear part.
    let square = buffers.constraints.saturating_add(header.neq as usize + header.nv as usize);
    let linear = [
        header.nq,
        header.nv,
        header.nu,
        header.na,
        header.nbody,
        header.njnt,
        header.ngeom,
        header.nsite,
        header.neq,
        header.ntendon,
        header.nwrap,
    ]
    .iter()
    .map(|&n| n as usize)
    .sum::<usize>();
    let numbers = square.saturating_mul(square).saturating_mul(5).saturating_add(20 * linear);
    header.nstack = as_int(numbers.max(1000));
}

impl Compiled {
    /// On 4.x, disables MuJoCo's automatic reset of diverged environments and, if `has_drive_rows`, its constraint
    /// islands. Has no effect on 2.2.2.
    ///
    /// Drive rows are rewritten in the one system of all constraints. With islands, 4.x would solve a copy made before
    /// that.
    pub fn prepare_for_stepping(&mut self, has_drive_rows: bool) {
        #[cfg(mj4)]
        {
            // SAFETY: `Compiled` is the only owner of the model.
            let model = unsafe { self.0.0.as_mut() };
            model.opt.disableflags |= mj::mjDSBL_AUTORESET as i32;
            if has_drive_rows {
                model.opt.disableflags |= mj::mjDSBL_ISLAND as i32;
            }
        }
        #[cfg(not(mj4))]
        let _ = has_drive_rows;
    }

    /// MuJoCo's time step \[s\] (`opt.timestep`).
    pub fn timestep(&self) -> f64 {
        // SAFETY: the model is alive and `Compiled` its only owner.
        unsafe { self.0.0.as_ref() }.opt.timestep
    }

    /// Sets gain and bias parameters of `actuators` to zero and removes their control limits. They then exert no force,
    /// and their controls only store targets.
    pub fn clear_actuator_gains(&mut self, actuators: &[usize]) {
        let gains = mj::mjNGAIN as usize;
        let biases = mj::mjNBIAS as usize;
        for &i in actuators {
            self.actuator_gainprm_mut()[i * gains..(i + 1) * gains].fill(0.0);
            self.actuator_biasprm_mut()[i * biases..(i + 1) * biases].fill(0.0);
        }
        self.unlimit_controls(actuators);
    }

    /// Turns `actuators` into plain effort sources: the control is the actuator force, without limits of control and
    /// force. Gears stay.
    pub fn make_effort_sources(&mut self, actuators: &[usize]) {
        self.clear_actuator_gains(actuators);
        for &i in actuators {
            self.actuator_gainprm_mut()[i * mj::mjNGAIN as usize] = 1.0;
            self.actuator_forcelimited_mut()[i] = Default::default();
        }
    }

    /// Removes the control limits of `actuators`, given as indices. The drive limits its targets itself, and a control
    /// may also carry a feedforward effort.
    pub fn unlimit_controls(&mut self, actuators: &[usize]) {
        for &i in actuators {
            self.actuator_ctrllimited_mut()[i] = Default::default();
        }
    }
}
