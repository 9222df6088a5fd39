//! Models that differ from a compiled model in a few arrays and share all others with it.
//!
//! MuJoCo's model is one allocation. `mj_setConst`, which must follow a change of masses, writes to arrays that differ
//! between versions. Changes are therefore made to a full copy, in which MuJoCo may write to any array. The words in
//! which it then differs from the compiled model, byte by byte, become a [`ModelPatch`].

use super::error::EngineError;
use super::guard::guarded;
use super::model::{Compiled, Model, Storage, array_pointer, set_buffers};
use super::patch::{Field, Globals, ModelPatch, PatchLayout, PatchValues, PatchWords, fields_of, word};
use mujoco_sys as mj;
use mujoco_sys::fields::model as fields;
use mujoco_sys::fields::model::ModelArray;
use std::cell::OnceCell;
use std::ptr::NonNull;
use std::sync::Arc;

/// Prefixes of arrays of shapes, images and texts. They hold no editable property and may be large, so they are not
/// compared.
const UNCOMPARED_PREFIXES: [&str; 12] =
    ["mesh_", "skin_", "hfield_", "tex_", "mat_", "flex", "name", "text_", "numeric_", "tuple_", "key_", "oct_"];

/// An editor of model arrays, on a full copy of a compiled model.
///
/// Arrays on which MuJoCo's memory accesses depend cannot be written from outside:
///
/// ```
/// # use kinetoscope_mujoco::{self as mj, ModelEditor};
/// # let model = mj::compile("<mujoco/>", &[]).unwrap().into_model();
/// ModelEditor::new(&model).unwrap().body_mass_mut();
/// ```
/// ```compile_fail,E0624
/// # use kinetoscope_mujoco::{self as mj, ModelEditor};
/// # let model = mj::compile("<mujoco/>", &[]).unwrap().into_model();
/// ModelEditor::new(&model).unwrap().body_simple_mut();
/// ```
#[derive(Debug)]
pub struct ModelEditor {
    base: Model,
    copy: Storage,
    scratch: Scratch,
    /// Arrays that are compared.
    fields: OnceCell<Arc<[Field]>>,
    /// Places of the last patch.
    last: Option<Arc<PatchLayout>>,
    /// Places outside of which the copy equals the compiled model; `None` if it may differ everywhere.
    known: Option<Known>,
}

/// Places where the copy may differ from the compiled model.
#[derive(Debug)]
enum Known {
    Nowhere,
    /// Those of this patch.
    Patch(Arc<PatchLayout>),
}

/// The `mjData` that `mj_setConst` works in.
#[derive(Debug)]
struct Scratch(NonNull<mj::mjData>);

// SAFETY: an mjData is plain memory without thread affinity; `Scratch` is its only owner.
unsafe impl Send for Scratch {}

impl Drop for Scratch {
    fn drop(&mut self) {
        // SAFETY: made by mj_makeData, deleted once; deletion frees memory and cannot raise an engine error.
        unsafe { mj::mj_deleteData(self.0.as_ptr()) };
    }
}

macro_rules! edited_arrays {
    ($($visibility:vis $name:ident: $element:ty;)*) => {
        impl ModelEditor {
            $(
                #[doc = concat!("MuJoCo's array of the edited model, for writing: `", stringify!($name), "`.")]
                $visibility fn $name(&mut self) -> &mut [$element] {
                    self.known = None;
                    // SAFETY: the copy is alive, and `ModelEditor`, its only owner, is borrowed mutably.
                    unsafe { fields::$name(self.copy.0.as_ptr()) }
                }
            )*
        }
    };
}

edited_arrays! {
    pub body_mass_mut: f64;
    pub body_inertia_mut: f64;
    pub geom_friction_mut: f64;
    pub geom_rgba_mut: f32;
    pub body_pos_mut: f64;
    pub body_quat_mut: f64;
    pub dof_damping_mut: f64;
    pub dof_armature_mut: f64;
    pub dof_frictionloss_mut: f64;
    pub tendon_frictionloss_mut: f64;
    // The bounding radius must match the size, so both are written together.
    geom_size_mut: f64;
    geom_rbound_mut: f64;
    // MuJoCo takes shortcuts by these arrays, to rows that must then exist. They are only written consistently.
    body_ipos_mut: f64;
    body_sameframe_mut: u8;
    body_simple_mut: u8;
    geom_sameframe_mut: u8;
    site_sameframe_mut: u8;
    dof_simplenum_mut: i32;
}

impl ModelEditor {
    /// Creates an editor that starts with the arrays that the compiler made. Edits that `model` contains are not
    /// loaded; see [`load`](Self::load).
    ///
    /// # Errors
    /// MuJoCo cannot allocate a copy.
    pub fn new(model: &Model) -> Result<Self, EngineError> {
        let mut copy = Storage(copy_model(model.compiled())?);
        set_buffers(copy.header_mut(), model.small_buffers());
        // SAFETY: the copy is alive; an engine function (guarded).
        let data = guarded(|| unsafe { mj::mj_makeData(copy.0.as_ptr()) })?;
        let no_memory = || EngineError { message: "could not allocate data for a copy of the model".into() };
        let scratch = Scratch(NonNull::new(data).ok_or_else(no_memory)?);
        let (fields, known) = (OnceCell::new(), Some(Known::Nowhere));
        Ok(Self { base: model.clone(), copy, scratch, fields, last: None, known })
    }

    /// Replaces all edits by the arrays and the gravity of `model`.
    ///
    /// # Panics
    /// `model` comes from another compilation than the model of this editor.
    pub fn load(&mut self, model: &Model) {
        assert!(std::ptr::eq(model.compiled(), self.base.compiled()), "the model was compiled from another scene");
        match (self.known.take(), model.patch()) {
            (Some(Known::Nowhere), None) => {}
            (Some(Known::Patch(layout)), None) => {
                layout.for_each_place(|array, places| self.load_words(model, array, 8 * places.start..8 * places.end));
            }
            _ => {
                let fields = Arc::clone(self.fields());
                fields.iter().for_each(|field| self.load_words(model, &field.array, 0..field.array.bytes));
            }
        }
        Globals::of(model.header()).write(self.copy.header_mut());
        self.known = model.patch().is_none().then_some(Known::Nowhere);
    }

    /// Replaces a range of bytes of an array by that of `model`.
    fn load_words(&mut self, model: &Model, array: &ModelArray, range: std::ops::Range<usize>) {
        // SAFETY: a field of models of these sizes; nothing writes to a shared model.
        let from = unsafe { bytes(model.header(), array) };
        // SAFETY: the array of the copy has as many bytes, since both have the sizes of the compiled model; the copy is
        // alive, and `self` is borrowed mutably.
        let to =
            unsafe { std::slice::from_raw_parts_mut(array_pointer(self.copy.header(), array).cast_mut(), array.bytes) };
        // The last word may have fewer bytes.
        let range = range.start..range.end.min(array.bytes);
        if to[range.clone()] != from[range.clone()] {
            to[range.clone()].copy_from_slice(&from[range]);
        }
    }

    /// Moves the center of mass of a body to `com`, in the body's frame \[m\].
    ///
    /// Call [`set_constants`](Self::set_constants) afterwards. MuJoCo's shortcuts for coinciding frames end for this
    /// body.
    ///
    /// # Errors
    /// On 4.x: MuJoCo stores only a diagonal mass matrix for this body (`body_simple`), with no memory for other
    /// elements.
    ///
    /// # Panics
    /// There is no such body.
    pub fn set_center_of_mass(&mut self, body: usize, com: [f64; 3]) -> Result<(), DiagonalInertia> {
        let is_simple = self.body_simple_mut()[body] != 0;
        if is_simple && cfg!(mj4) {
            return Err(DiagonalInertia);
        }
        self.body_ipos_mut()[3 * body..3 * body + 3].copy_from_slice(&com);
        // On 4.x, mj_setConst computes this flag.
        self.body_sameframe_mut()[body] = 0;
        let base = self.base.clone();
        for geom in indices_of_body(base.geom_bodyid(), body) {
            clear_if_inertial(&mut self.geom_sameframe_mut()[geom]);
        }
        for site in indices_of_body(base.site_bodyid(), body) {
            clear_if_inertial(&mut self.site_sameframe_mut()[site]);
        }
        if is_simple {
            self.body_simple_mut()[body] = 0;
            let mut consecutive = 0;
            for dof in (0..base.nv()).rev() {
                let simple = self.body_simple_mut()[base.dof_bodyid()[dof] as usize] != 0;
                consecutive = if simple { consecutive + 1 } else { 0 };
                self.dof_simplenum_mut()[dof] = consecutive;
            }
        }
        Ok(())
    }

    /// Sets the size of a sphere, capsule, ellipsoid, cylinder or box geom \[m\], MuJoCo's three numbers.
    ///
    /// Other geoms stay unchanged, and so do mass and moments of inertia. Call [`set_constants`](Self::set_constants)
    /// afterwards; on 4.x it updates the bounding boxes of the body.
    ///
    /// The bounding radius, which 2.2.2 does not update, is the distance of the shape's farthest point from its center.
    ///
    /// # Panics
    /// There is no such geom.
    pub fn set_geom_size(&mut self, geom: usize, size: [f64; 3]) {
        let [x, y, z] = size;
        let radius = match self.base.geom_type()[geom] as u32 {
            mj::mjGEOM_SPHERE => x,
            mj::mjGEOM_CAPSULE => x + y,
            mj::mjGEOM_ELLIPSOID => x.max(y).max(z),
            mj::mjGEOM_CYLINDER => (x * x + y * y).sqrt(),
            mj::mjGEOM_BOX => (x * x + y * y + z * z).sqrt(),
            _ => return,
        };
        self.geom_size_mut()[3 * geom..3 * geom + 3].copy_from_slice(&size);
        self.geom_rbound_mut()[geom] = radius;
    }

    /// Sets gravity in world axes \[m/s²\]; [`set_constants`](Self::set_constants) is not needed.
    pub fn set_gravity(&mut self, gravity: [f64; 3]) {
        self.copy.header_mut().opt.gravity = gravity;
    }

    /// Updates everything that depends on masses, inertias, centers of mass, armatures, sizes and poses
    /// (`mj_setConst`).
    ///
    /// # Errors
    /// MuJoCo reported an error (`mju_error`).
    pub fn set_constants(&mut self) -> Result<(), EngineError> {
        self.known = None;
        let (m, d) = (self.copy.0.as_ptr(), self.scratch.0.as_ptr());
        // SAFETY: the copy and its data are alive, and `self` is borrowed mutably; an engine function (guarded).
        let done = guarded(|| unsafe { mj::mj_setConst(m, d) });
        if done.is_err() {
            // The reset clears the stack after the error. mj_setConst sets the positions that it needs itself.
            // SAFETY: as above.
            guarded(|| unsafe { mj::mj_resetData(m, d) })?;
        }
        done?;
        self.update_means();
        Ok(())
    }

    /// On 4.x, updates the mean inertia and the mean mass in `stat`, as 2.2.2 does itself in mj_setConst; 4.0 keeps
    /// those of its compiler. The solver scales by the mean inertia.
    fn update_means(&mut self) {
        if cfg!(mj4) {
            // SAFETY: the copy is alive, and only `&mut self` writes to it.
            let inertias = unsafe { fields::dof_M0(self.copy.0.as_ptr()) };
            let inertia = (!inertias.is_empty()).then(|| inertias.iter().sum::<f64>() / inertias.len() as f64);
            let masses = self.body_mass_mut();
            let bodies = masses.len().saturating_sub(1);
            let mass = (bodies > 0).then(|| masses[1..].iter().sum::<f64>() / bodies as f64);
            let stat = &mut self.copy.header_mut().stat;
            stat.meaninertia = inertia.unwrap_or(stat.meaninertia);
            stat.meanmass = mass.unwrap_or(stat.meanmass);
        }
    }

    /// Returns the edited model with the buffer sizes and, except for gravity, the options of `like`, which must come
    /// from the same compilation as this editor.
    ///
    /// # Panics
    /// `like` comes from another compilation.
    pub fn model(&self, like: &Model) -> Model {
        assert!(std::ptr::eq(like.compiled(), self.base.compiled()), "the model was compiled from another scene");
        match self.differences().into_patch(&self.base, Globals::of(self.copy.header())) {
            Some(patch) => like.clone().patched(&patch),
            None => like.without_patch(),
        }
    }

    /// Returns the differences of the edited model from the compiled one; `None` without any. Patches of similar edits
    /// share the list of places, so some words of a patch may be those of the compiled model.
    pub fn patch(&mut self) -> Option<Arc<ModelPatch>> {
        let globals = Globals::of(self.copy.header());
        let patch = match &self.last {
            None => self.differences().into_patch(&self.base, globals),
            Some(last) => self.patch_like(last, globals).or_else(|| {
                self.differences().into_patch_near(last, &self.base, globals, |array, at| {
                    // SAFETY: a field of models of these sizes; only `&mut self` writes to the copy.
                    word(unsafe { bytes(self.copy.header(), array) }, at)
                })
            }),
        };
        self.known = Some(match &patch {
            None => Known::Nowhere,
            Some(patch) => {
                self.last = Some(Arc::clone(patch.layout()));
                Known::Patch(Arc::clone(patch.layout()))
            }
        });
        patch
    }

    fn fields(&self) -> &Arc<[Field]> {
        let is_compared = |field: &Field| !UNCOMPARED_PREFIXES.iter().any(|of| field.array.name.starts_with(of));
        self.fields.get_or_init(|| fields_of(self.base.compiled()).into_iter().filter(is_compared).collect())
    }

    /// The patch with the places `layout`; `None` if the copy differs from the compiled model elsewhere, in no word of an
    /// array of `layout`, or in too few of the places.
    fn patch_like(&self, layout: &Arc<PatchLayout>, globals: Globals) -> Option<Arc<ModelPatch>> {
        let mut values = PatchValues::new(layout);
        for field in &**self.fields() {
            // SAFETY: a field of models of these sizes; only `&mut self` writes to the copy.
            let mine = unsafe { bytes(self.copy.header(), &field.array) };
            // SAFETY: as above; nothing writes to a compiled model.
            let compiled = unsafe { bytes(self.base.compiled(), &field.array) };
            values.push(field, mine, compiled)?;
        }
        values.into_patch(globals)
    }

    /// Collects the words in which the copy differs from the compiled model.
    fn differences(&self) -> PatchWords {
        let mut words = PatchWords::default();
        for field in &**self.fields() {
            // SAFETY: a field of models of these sizes; only `&mut self` writes to the copy.
            let mine = unsafe { bytes(self.copy.header(), &field.array) };
            // SAFETY: as above; nothing writes to a compiled model.
            let compiled = unsafe { bytes(self.base.compiled(), &field.array) };
            if mine == compiled {
                continue;
            }
            for at in 0..mine.len().div_ceil(8) {
                let value = word(mine, at);
                if value != word(compiled, at) {
                    words.push(*field, at as u32, &[value]);
                }
            }
        }
        words
    }

    /// Returns a whole copy of the edited model, which shares nothing, with small buffers.
    ///
    /// # Errors
    /// MuJoCo cannot allocate a copy.
    pub fn to_compiled(&self) -> Result<Compiled, EngineError> {
        let copy = copy_model(self.copy.header())?;
        // SAFETY: made by MuJoCo, without another owner.
        Ok(unsafe { Compiled::from_raw(copy) })
    }

    /// Dry friction of the degrees of freedom of the edited model, (nv,).
    pub fn dof_frictionloss(&self) -> &[f64] {
        // SAFETY: the copy is alive, and only `&mut self` writes to it.
        unsafe { fields::dof_frictionloss(self.copy.0.as_ptr()) }
    }
}

/// Error of [`ModelEditor::set_center_of_mass`] on 4.x: the center of mass of a body with a diagonal mass matrix cannot
/// be moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagonalInertia;

/// Copies a model that is one allocation.
fn copy_model(model: &mj::mjModel) -> Result<NonNull<mj::mjModel>, EngineError> {
    // SAFETY: the model is alive and one allocation, as mj_copyModel needs it; an engine function (guarded).
    let copy = guarded(|| unsafe { mj::mj_copyModel(std::ptr::null_mut(), model) })?;
    let no_memory = || EngineError { message: "could not allocate memory for a copy of the model".into() };
    NonNull::new(copy).ok_or_else(no_memory)
}

/// Clears a `sameframe` flag that refers to the inertia of the body: 2 for the inertia frame, 4 for its axes (4.x). A
/// flag of 1 refers to the body frame.
fn clear_if_inertial(sameframe: &mut u8) {
    if matches!(*sameframe, 2 | 4) {
        *sameframe = 0;
    }
}

/// Indices of the elements of a body; `bodies` has the body of each element.
fn indices_of_body(bodies: &[i32], body: usize) -> impl Iterator<Item = usize> + '_ {
    bodies.iter().enumerate().filter(move |(_, of)| **of as usize == body).map(|(index, _)| index)
}

/// Bytes of an array, which are plain numbers without padding.
///
/// # Safety
/// `field` is one of `fields::model::each` of a model of the same sizes, and not empty; nothing writes to the array
/// while the bytes are in use.
unsafe fn bytes<'m>(model: &'m mj::mjModel, field: &ModelArray) -> &'m [u8] {
    // SAFETY: the array has this size (contract), and lives as long as the model.
    unsafe { std::slice::from_raw_parts(array_pointer(model, field), field.bytes) }
}

/// Sets the pointer of an array in a model header.
pub(super) fn set_pointer(header: &mut mj::mjModel, field: &ModelArray, array: *const u8) {
    // SAFETY: the offset is that of a pointer inside of the struct.
    let pointer = unsafe { std::ptr::from_mut(header).byte_add(field.pointer_offset) };
    // SAFETY: a pointer stands there, and the struct is borrowed mutably.
    unsafe { pointer.cast::<*const u8>().write(array) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate as mj;
    use crate::Data;

    /// A chain with a tendon, a free body with its own center of mass, and a body with a diagonal inertia matrix.
    fn text(masses: [f64; 3], com: [f64; 3], moments: [f64; 3], armature: f64) -> String {
        let [upper, lower, free] = masses;
        let ([x, y, z], [a, b, c]) = (com, moments);
        format!(
            r#"<mujoco><worldbody><geom type="plane" size="5 5 1"/>
            <camera name="eye" mode="targetbody" target="lower" pos="0 -2 1"/>
            <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" damping="0.1" armature="0.01"/>
              <inertial pos="0.1 0 0" mass="{upper}" diaginertia="0.01 0.02 0.02"/>
              <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.03"/>
              <body name="lower" pos="0.2 0 0" euler="20 0 0"><joint name="elbow" axis="0 1 0" armature="{armature}"/>
                <inertial pos="{x} {y} {z}" euler="10 20 30" mass="{lower}" diaginertia="{a} {b} {c}"/>
                <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.03"/><geom type="box" size="0.02 0.03 0.04" pos="0.1 0 0.1"/>
                <site name="s" pos="0.1 0 0"/></body></body>
            <body name="free" pos="1 0 1"><freejoint/>
              <inertial pos="0.02 0.01 0" mass="{free}" diaginertia="0.1 0.1 0.1"/><geom type="box" size="0.1 0.1 0.1"/></body>
            <body name="ball" pos="2 0 1"><freejoint/><geom size="0.1"/></body>
            </worldbody>
            <tendon><fixed name="t" frictionloss="0.1"><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="-2"/></fixed></tendon>
            <actuator><motor name="m" joint="elbow" gear="3"/></actuator></mujoco>"#
        )
    }

    fn compile(text: &str) -> Model {
        mj::compile(text, &[]).expect("compiles").into_model()
    }

    fn base_text() -> String {
        text([1.0, 0.5, 2.0], [0.1, 0.0, 0.02], [0.01, 0.02, 0.025], 0.02)
    }

    fn base() -> Model {
        compile(&base_text())
    }

    /// Names of the arrays in which two models of the same sizes differ, and `stat` if their statistics differ. Arrays
    /// of f64 and statistics may differ by rounding; other arrays must be equal.
    fn differences(a: &Model, b: &Model) -> Vec<String> {
        let mut found = Vec::new();
        let mut compare = |field: ModelArray| {
            if field.bytes == 0 {
                return;
            }
            // SAFETY: the models are of the same sizes, and nothing writes to them.
            let left = unsafe { bytes(a.header(), &field) };
            // SAFETY: as above.
            let right = unsafe { bytes(b.header(), &field) };
            let numbers = |bytes: &[u8]| -> Vec<f64> {
                bytes.as_chunks::<8>().0.iter().map(|number| f64::from_ne_bytes(*number)).collect()
            };
            let equal = if matches!(field.element_type, "mjtNum" | "f64") {
                // Sums of some dozen products of numbers up to 100.
                numbers(left).iter().zip(numbers(right)).all(|(x, y)| (x - y).abs() <= 1e-12 * (1.0 + x.abs()))
            } else {
                left == right
            };
            if !equal {
                found.push(field.name.to_string());
            }
        };
        // SAFETY: the model is alive.
        unsafe { fields::each(a.raw(), &mut compare) };
        let stat = |m: &Model| (m.header().stat.meaninertia, m.header().stat.meanmass);
        let ((inertia, mass), (other_inertia, other_mass)) = (stat(a), stat(b));
        if (inertia - other_inertia).abs() > 1e-12 || (mass - other_mass).abs() > 1e-12 {
            found.push("stat".into());
        }
        found
    }

    #[test]
    fn masses() {
        let model = base();
        let (com, moments) = ([0.13, -0.02, 0.05], [0.03, 0.035, 0.04]);
        // The ball, for whose rows MuJoCo takes a shortcut: 2.5 kg, and 2/5 m r² about any axis.
        let heavy = r#"<freejoint/><geom size="0.1" mass="2.5"/>"#;
        let fresh = text([1.7, 0.9, 3.1], com, moments, 0.07).replace(r#"<freejoint/><geom size="0.1"/>"#, heavy);
        let fresh = compile(&fresh);
        assert!(differences(&model, &fresh).len() > 6, "{:?}", differences(&model, &fresh));
        let mut editor = ModelEditor::new(&model).expect("small");
        editor.body_mass_mut()[1..4].copy_from_slice(&[1.7, 0.9, 3.1]);
        editor.body_inertia_mut()[6..9].copy_from_slice(&moments);
        assert!(editor.body_simple_mut()[4] != 0 && editor.body_mass_mut()[4] != 2.5);
        editor.body_mass_mut()[4] = 2.5;
        editor.body_inertia_mut()[12..15].fill(0.01);
        editor.dof_armature_mut()[1] = 0.07;
        editor.set_center_of_mass(2, com).expect("not diagonal");
        // Control: without `set_constants`, the models differ.
        assert!(!differences(&editor.model(&model), &fresh).is_empty());
        editor.set_constants().expect("fits");
        let edited = editor.model(&model);
        // MuJoCo sorts principal axes. Moments are in order in both models, so the axes agree.
        assert_eq!(differences(&edited, &fresh), Vec::<String>::new());
        // `load` leaves no changes behind.
        editor.load(&model);
        assert_eq!(editor.model(&model).own_arrays().count(), 0);
        editor.set_constants().expect("fits");
        assert_eq!(
            editor.model(&model).own_arrays().count(),
            0,
            "recomputed constants of an unchanged model equal its own constants"
        );
        editor.load(&edited);
        assert_eq!(differences(&editor.model(&model), &edited), Vec::<String>::new());
    }

    /// One geom of each type that has a size, several of them in one body, around which 4.x keeps bounding boxes.
    fn shapes(sizes: [&str; 5], at: &str) -> Model {
        let [ball, capsule, ellipsoid, cylinder, cuboid] = sizes;
        compile(&format!(
            r#"<mujoco><worldbody>
            <body pos="0 0 1"><freejoint/><inertial pos="0.01 0 0.02" euler="10 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
              <geom size="{ball}"/><geom type="capsule" size="{capsule}" pos="1 0 0" euler="0 30 20"/>
              <geom type="ellipsoid" size="{ellipsoid}" pos="2 0 0"/><geom type="cylinder" size="{cylinder}" pos="3 0 0"/></body>
            <body pos="{at}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="box" size="{cuboid}"/></body>
            </worldbody></mujoco>"#
        ))
    }

    #[test]
    fn sizes_and_places() {
        let model = shapes(["0.1", "0.1 0.2", "0.1 0.2 0.3", "0.1 0.2", "0.1 0.2 0.3"], "0 5 0");
        let fresh = shapes(["0.11", "0.12 0.22", "0.13 0.35 0.32", "0.14 0.21", "0.2 0.1 0.35"], "0 4 1");
        assert!(!differences(&model, &fresh).is_empty());
        let mut editor = ModelEditor::new(&model).expect("small");
        let sizes = [[0.11, 0., 0.], [0.12, 0.22, 0.], [0.13, 0.35, 0.32], [0.14, 0.21, 0.], [0.2, 0.1, 0.35]];
        sizes.into_iter().enumerate().for_each(|(geom, size)| editor.set_geom_size(geom, size));
        editor.body_pos_mut()[6..9].copy_from_slice(&[0.0, 4.0, 1.0]);
        let unfinished = differences(&editor.model(&model), &fresh);
        assert_eq!(unfinished.is_empty(), !cfg!(mj4), "{unfinished:?}");
        editor.set_constants().expect("fits");
        assert_eq!(differences(&editor.model(&model), &fresh), Vec::<String>::new());
    }

    #[test]
    fn diagonal_inertia() {
        let model = base();
        let mut editor = ModelEditor::new(&model).expect("small");
        let with_com = |com: &str| {
            let inertial = format!(r#"<inertial pos="{com}" mass="4.1887902" diaginertia="0.0167 0.0167 0.0167"/>"#);
            let free = format!(r#"<freejoint/>{inertial}<geom size="0.1"/>"#);
            compile(&base_text().replace(r#"<freejoint/><geom size="0.1"/>"#, &free))
        };
        let (centered, shifted) = (with_com("0 0 0"), with_com("0.03 0 0.01"));
        if cfg!(mj4) {
            assert_eq!(editor.set_center_of_mass(4, [0.03, 0.0, 0.01]), Err(DiagonalInertia));
            #[cfg(mj4)]
            assert_ne!(centered.header().nC, shifted.header().nC, "the entry is not stored in the sparse matrix");
        } else {
            let mut editor = ModelEditor::new(&centered).expect("small");
            editor.set_center_of_mass(4, [0.03, 0.0, 0.01]).expect("room");
            editor.set_constants().expect("fits");
            assert_eq!(differences(&editor.model(&centered), &shifted), Vec::<String>::new());
        }
    }

    #[test]
    fn sharing() {
        let model = base();
        let mut editor = ModelEditor::new(&model).expect("small");
        editor.geom_friction_mut()[3] = 0.4;
        editor.set_gravity([0.0, 0.0, -1.6]);
        let edited = editor.model(&model);
        assert_eq!(edited.unshared_arrays(&model), ["geom_friction"]);
        assert_eq!(edited.own_arrays().collect::<Vec<_>>(), [("geom_friction", 8 * 3 * model.ngeom())]);
        assert_eq!((edited.gravity(), model.gravity()), ([0.0, 0.0, -1.6], [0.0, 0.0, -9.81]));
        assert_eq!((edited.geom_friction()[3], model.geom_friction()[3]), (0.4, 1.0));
        // With other buffer sizes, and after the editor and its first model are dropped.
        let buffers = mj::Buffers { contacts: 9, constraints: 70, arena_bytes: 1 << 20 };
        let larger = edited.with_buffers(buffers);
        assert!(larger.unshared_arrays(&edited).is_empty());
        let again = editor.model(&larger);
        assert!(again.is_compatible_with(&larger) && !again.is_compatible_with(&edited));
        drop((editor, model, edited));
        let mut data = Data::new(&larger).expect("small");
        (0..100).for_each(|_| data.step().expect("steps"));
        // Free fall: v = -g h k after k steps of semi-implicit Euler, for the ball.
        assert!((data.qvel()[10] - -1.6 * 0.002 * 100.0).abs() < 1e-12, "{:?}", data.qvel());
    }

    #[test]
    #[should_panic(expected = "another scene")]
    fn another_scene() {
        let _ = ModelEditor::new(&base()).expect("small").model(&base());
    }

    #[test]
    #[should_panic(expected = "other sizes")]
    fn other_sizes() {
        let model = base();
        let mut data = Data::new(&model).expect("small");
        data.set_model(model.with_buffers(mj::Buffers { contacts: 7, constraints: 7, arena_bytes: 1 << 20 }));
    }
}
