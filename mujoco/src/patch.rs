//! Differences between a model and the compiled model: what an environment keeps instead of a model of its own.
//!
//! A [`ModelPatch`] has the words (8 bytes) in which arrays differ, and a list of their places, which patches with
//! differences in the same places share. [`Model::patched`] writes them to a model's own arrays. If nothing else uses
//! that model, its arrays are reused: then only these words are written. Places of the patch before get the compiled
//! values first, unless the new patch has the same list.

use super::editor::set_pointer;
use super::model::{Model, OwnArray, ShallowModel, Storage, array_pointer};
use super::weld::Weld;
use mujoco_sys as mj;
use mujoco_sys::fields::model as fields;
use mujoco_sys::fields::model::{ModelArray, each};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Array of a model, with its index in MuJoCo's list of arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) index: u32,
    pub(super) array: ModelArray,
}

/// Consecutive words of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    /// [`Field::index`] of the array.
    field: u32,
    /// Index of the first word.
    at: u32,
    words: u32,
}

/// Places of the words of a patch.
#[derive(Debug)]
pub(super) struct PatchLayout {
    /// Model that the places belong to.
    storage: Arc<Storage>,
    /// Arrays with a difference, in MuJoCo's order.
    fields: Box<[Field]>,
    /// Spans in ascending order.
    spans: Box<[Span]>,
}

/// Values outside of arrays that an environment can have for itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Globals {
    gravity: [f64; 3],
    mean_inertia: f64,
    mean_mass: f64,
}

impl Globals {
    pub(super) fn of(header: &mj::mjModel) -> Self {
        let (mean_inertia, mean_mass) = (header.stat.meaninertia, header.stat.meanmass);
        Self { gravity: header.opt.gravity, mean_inertia, mean_mass }
    }

    pub(super) fn write(self, header: &mut mj::mjModel) {
        // mj_setConst overwrites the rest of `stat`, too, including values that the file sets.
        header.opt.gravity = self.gravity;
        (header.stat.meaninertia, header.stat.meanmass) = (self.mean_inertia, self.mean_mass);
    }

    fn bits(self) -> [u64; 5] {
        let [x, y, z] = self.gravity;
        [x, y, z, self.mean_inertia, self.mean_mass].map(f64::to_bits)
    }
}

/// Differences between a model and the compiled model that it comes from: some words of arrays, gravity, and the mean
/// mass and inertia.
#[derive(Debug)]
pub struct ModelPatch {
    layout: Arc<PatchLayout>,
    /// Words, span by span.
    values: Box<[u64]>,
    globals: Globals,
    welded: Option<Welded>,
}

/// Origin of a patch with active welds: the differences without these welds, or `None` without differences. They come
/// back when the welds end, with their own list of places.
#[derive(Debug)]
struct Welded(Option<Arc<ModelPatch>>);

/// Array of numbers (`f64`) of a model, to be read for a patch without a model that has it.
#[derive(Clone, Copy, Debug)]
pub struct NumberArray {
    name: &'static str,
    /// The array in the compiled model.
    compiled: fn(&Model) -> &[f64],
}

macro_rules! number_arrays {
    ($($constant:ident = $name:ident;)*) => {
        impl NumberArray {
            $(
                #[doc = concat!("MuJoCo's `", stringify!($name), "`.")]
                pub const $constant: Self = Self {
                    name: stringify!($name),
                    // SAFETY: the compiled model lives as long as `model`, and nothing writes to it.
                    compiled: |model| unsafe { fields::$name(model.compiled()) },
                };
            )*
        }
    };
}

number_arrays! {
    BODY_MASS = body_mass;
    BODY_INERTIA = body_inertia;
    BODY_IPOS = body_ipos;
    BODY_POS = body_pos;
    BODY_IQUAT = body_iquat;
    BODY_QUAT = body_quat;
    BODY_SUBTREEMASS = body_subtreemass;
    BODY_INVWEIGHT0 = body_invweight0;
    DOF_ARMATURE = dof_armature;
    DOF_DAMPING = dof_damping;
    DOF_FRICTIONLOSS = dof_frictionloss;
    DOF_INVWEIGHT0 = dof_invweight0;
    TENDON_FRICTIONLOSS = tendon_frictionloss;
    TENDON_INVWEIGHT0 = tendon_invweight0;
    GEOM_FRICTION = geom_friction;
    GEOM_SIZE = geom_size;
}

impl NumberArray {
    /// MuJoCo's name of the array.
    pub fn name(self) -> &'static str {
        self.name
    }

    /// Numbers of the array in the compiled model of `model` with the differences `patch`.
    pub fn all(self, model: &Model, patch: Option<&ModelPatch>) -> Vec<f64> {
        let mut numbers = (self.compiled)(model).to_vec();
        if let Some(patch) = patch {
            patch.overlay(self, 0, &mut numbers);
        }
        numbers
    }

    /// `K` numbers as in [`all`](Self::all), from index `first` on.
    ///
    /// # Panics
    /// The array has fewer than `first + K` numbers.
    pub fn some<const K: usize>(self, model: &Model, patch: Option<&ModelPatch>, first: usize) -> [f64; K] {
        let mut numbers = [0.0; K];
        numbers.copy_from_slice(&(self.compiled)(model)[first..first + K]);
        if let Some(patch) = patch {
            patch.overlay(self, first, &mut numbers);
        }
        numbers
    }
}

impl ModelPatch {
    /// Gravity in world axes \[m/s²\].
    pub fn gravity(&self) -> [f64; 3] {
        self.globals.gravity
    }

    /// Memory \[bytes\]. The list of places counts in equal parts for all patches that share it.
    pub fn bytes(&self) -> usize {
        let layout = size_of::<PatchLayout>() + size_of_val(&*self.layout.fields) + size_of_val(&*self.layout.spans);
        let owners = Arc::strong_count(&self.layout);
        // Two counters before the content of each `Arc`.
        let unwelded = self.welded.as_ref().and_then(|origin| origin.0.as_ref()).map_or(0, |patch| patch.bytes());
        2 * size_of::<usize>() + size_of::<Self>() + size_of_val(&*self.values) + layout.div_ceil(owners) + unwelded
    }

    /// Replaces the numbers that the patch has of an array in `numbers`, a part of the array from index `first` on.
    fn overlay(&self, array: NumberArray, first: usize, numbers: &mut [f64]) {
        let Some(field) = self.layout.fields.iter().find(|field| field.array.name == array.name) else { return };
        let mut values = &self.values[..];
        for span in &self.layout.spans {
            let (mine, rest) = values.split_at(span.words as usize);
            values = rest;
            if span.field != field.index {
                continue;
            }
            for (at, value) in (span.at as usize..).zip(mine) {
                if let Some(number) = at.checked_sub(first).and_then(|k| numbers.get_mut(k)) {
                    *number = f64::from_bits(*value);
                }
            }
        }
    }

    /// Names and sizes \[bytes\] of the arrays with differences.
    pub fn arrays(&self) -> impl Iterator<Item = (&'static str, usize)> {
        self.layout.fields.iter().map(|field| (field.array.name, field.array.bytes))
    }

    /// Prefetches the values, without waiting for them.
    pub fn prefetch(&self) {
        super::prefetch(&self.values);
    }

    /// The differences `patch` of `model` and these active welds, besides those that are active from the start. Welds
    /// that an earlier call added to `patch` end. If a weld is listed twice, the last pose counts. `None` if there is no
    /// difference.
    ///
    /// On 4.x, the active flags are in the data: call [`Data::set_equality_active`](crate::Data::set_equality_active)
    /// too.
    ///
    /// # Panics
    /// One of the equalities is not a weld of this model, or `patch` comes from another compilation.
    pub fn with_welds(patch: Option<&Arc<Self>>, model: &Model, welds: &[Weld]) -> Option<Arc<Self>> {
        for weld in welds {
            assert!(model.is_weld(weld.equality), "equality {} is not a weld", weld.equality);
        }
        if let Some(patch) = patch {
            patch.expect_storage(model);
        }
        let unwelded = match patch.map(|patch| &patch.welded) {
            Some(Some(origin)) => origin.0.as_ref(),
            _ => patch,
        };
        if welds.is_empty() {
            return unwelded.cloned();
        }
        let compiled = model.compiled();
        // Words of each array by index: those of the differences, which include constants of equalities that follow from
        // other properties, then those of the welds.
        let mut words: BTreeMap<u32, BTreeMap<u32, u64>> = BTreeMap::new();
        if let Some(patch) = unwelded {
            patch.for_each(|field, span, values| {
                words.entry(field.index).or_default().extend((span.at..).zip(values.iter().copied()));
            });
        }
        let fields = fields_of(compiled);
        for field in fields.iter().filter(|field| matches!(field.array.name, "eq_data" | "eq_active")) {
            // SAFETY: the array has this size and lives as long as the compiled model, to which nothing writes.
            let bytes = unsafe { std::slice::from_raw_parts(array_pointer(compiled, &field.array), field.array.bytes) };
            let changed = words.entry(field.index).or_default();
            welds.iter().for_each(|weld| weld.write(field.array.name, bytes, changed));
        }
        let mut all = PatchWords::default();
        for field in &fields {
            for (at, word) in words.remove(&field.index).into_iter().flatten() {
                all.push(*field, at, &[word]);
            }
        }
        let globals = unwelded.map_or_else(|| Globals::of(compiled), |patch| patch.globals);
        all.into_patch_of(model, globals, Some(Welded(unwelded.cloned())))
    }

    fn expect_storage(&self, model: &Model) {
        assert!(Arc::ptr_eq(&self.layout.storage, model.storage()), "the model was compiled from another scene");
    }

    /// Calls `visit` for each span with its array and its values.
    fn for_each(&self, mut visit: impl FnMut(&Field, &Span, &[u64])) {
        self.layout.for_each(&self.values, |k, span, values| visit(&self.layout.fields[k], span, values));
    }
}

impl PatchLayout {
    /// Calls `visit` for each span with the index of its array among `fields`, and with its part of `values`.
    fn for_each(&self, mut values: &[u64], mut visit: impl FnMut(usize, &Span, &[u64])) {
        let mut k = 0;
        for span in &self.spans {
            while self.fields[k].index != span.field {
                k += 1;
            }
            let (mine, rest) = values.split_at(span.words as usize);
            visit(k, span, mine);
            values = rest;
        }
    }

    /// Calls `visit` for each span with its array.
    pub(super) fn for_each_place(&self, mut visit: impl FnMut(&ModelArray, std::ops::Range<usize>)) {
        let mut k = 0;
        for span in &self.spans {
            while self.fields[k].index != span.field {
                k += 1;
            }
            visit(&self.fields[k].array, span.at as usize..(span.at + span.words) as usize);
        }
    }

    /// Spans that contain those of `self` and `others`.
    fn merged_spans(&self, others: &[Span]) -> Vec<Span> {
        let mut all: Vec<Span> = self.spans.iter().chain(others).copied().collect();
        all.sort_by_key(|span| (span.field, span.at));
        let mut merged: Vec<Span> = Vec::with_capacity(all.len());
        for span in all {
            match merged.last_mut() {
                Some(last) if last.field == span.field && last.at + last.words >= span.at => {
                    last.words = last.words.max(span.at + span.words - last.at);
                }
                _ => merged.push(span),
            }
        }
        merged
    }
}

/// Number of words of spans.
fn word_count(spans: &[Span]) -> usize {
    spans.iter().map(|span| span.words as usize).sum()
}

/// Places and values that become a patch, in ascending order.
#[derive(Debug, Default)]
pub(super) struct PatchWords {
    fields: Vec<Field>,
    spans: Vec<Span>,
    values: Vec<u64>,
}

impl PatchWords {
    /// Adds words that start at index `at` of an array, after all words so far.
    pub(super) fn push(&mut self, field: Field, at: u32, values: &[u64]) {
        if self.fields.last().is_none_or(|last| last.index != field.index) {
            self.fields.push(field);
        }
        match self.spans.last_mut() {
            Some(last) if last.field == field.index && last.at + last.words == at => last.words += values.len() as u32,
            _ => self.spans.push(Span { field: field.index, at, words: values.len() as u32 }),
        }
        self.values.extend_from_slice(values);
    }

    /// Creates the patch of `model` with these words; `None` if there is no difference.
    pub(super) fn into_patch(self, model: &Model, globals: Globals) -> Option<Arc<ModelPatch>> {
        self.into_patch_of(model, globals, None)
    }

    fn into_patch_of(self, model: &Model, globals: Globals, welded: Option<Welded>) -> Option<Arc<ModelPatch>> {
        if self.is_nominal(model, globals) {
            return None;
        }
        let storage = Arc::clone(model.storage());
        let layout = Arc::new(PatchLayout { storage, fields: self.fields.into(), spans: self.spans.into() });
        Some(Arc::new(ModelPatch { layout, values: self.values.into(), globals, welded }))
    }

    /// Creates the patch as [`into_patch`](Self::into_patch) does, with the places of `last`, too, if they are few. Then
    /// it has words that do not differ, which `read` returns.
    ///
    /// Numbers that differ by rounding alone, such as the constants of MuJoCo, are equal in some environments by
    /// chance. The places of a draw therefore soon have all that ever differ, and environments share their list:
    /// [`PatchValues`].
    pub(super) fn into_patch_near(
        self,
        last: &PatchLayout,
        model: &Model,
        globals: Globals,
        read: impl Fn(&ModelArray, usize) -> u64,
    ) -> Option<Arc<ModelPatch>> {
        let is_similar = self.fields[..] == last.fields[..] && Arc::ptr_eq(&last.storage, model.storage());
        if !is_similar || self.is_nominal(model, globals) {
            return self.into_patch(model, globals);
        }
        let spans = last.merged_spans(&self.spans);
        if !are_most(self.values.len(), word_count(&spans)) {
            return self.into_patch(model, globals);
        }
        let storage = Arc::clone(model.storage());
        let layout = PatchLayout { storage, fields: self.fields.into(), spans: spans.into() };
        let mut values = Vec::with_capacity(word_count(&layout.spans));
        layout.for_each_place(|array, places| values.extend(places.map(|at| read(array, at))));
        Some(Arc::new(ModelPatch { layout: Arc::new(layout), values: values.into(), globals, welded: None }))
    }

    fn is_nominal(&self, model: &Model, globals: Globals) -> bool {
        self.spans.is_empty() && globals.bits() == Globals::of(model.compiled()).bits()
    }
}

/// True if `differing` words are so many of `all` words of a list of places that a patch may have the list.
fn are_most(differing: usize, all: usize) -> bool {
    8 * all <= 9 * differing
}

/// Values of a patch with a given list of places, collected array by array.
#[derive(Debug)]
pub(super) struct PatchValues<'l> {
    layout: &'l Arc<PatchLayout>,
    /// Spans of arrays that are not collected yet.
    spans: &'l [Span],
    values: Vec<u64>,
    /// Number of values that differ from those of the compiled model.
    differing: usize,
}

impl<'l> PatchValues<'l> {
    pub(super) fn new(layout: &'l Arc<PatchLayout>) -> Self {
        let values = Vec::with_capacity(word_count(&layout.spans));
        Self { layout, spans: &layout.spans, values, differing: 0 }
    }

    /// Adds the next array: its content, and that of the compiled model. `None` if they differ in a word outside of the
    /// places, or in no word although the array has places.
    pub(super) fn push(&mut self, field: &Field, mine: &[u8], compiled: &[u8]) -> Option<()> {
        let (differing, mut end) = (self.differing, 0);
        while let Some((span, rest)) = self.spans.split_first().filter(|(span, _)| span.field == field.index) {
            let places = span.at as usize..(span.at + span.words) as usize;
            if mine[end..8 * places.start] != compiled[end..8 * places.start] {
                return None;
            }
            // The last word may have fewer bytes.
            end = mine.len().min(8 * places.end);
            for at in places {
                let value = word(mine, at);
                self.differing += usize::from(value != word(compiled, at));
                self.values.push(value);
            }
            self.spans = rest;
        }
        let is_used = end == 0 || self.differing > differing;
        (is_used && mine[end..] == compiled[end..]).then_some(())
    }

    /// The patch, after all arrays; `None` if too few of its values differ.
    pub(super) fn into_patch(self, globals: Globals) -> Option<Arc<ModelPatch>> {
        let Self { layout, values, differing, .. } = self;
        let is_similar = differing > 0 && are_most(differing, values.len());
        is_similar
            .then(|| Arc::new(ModelPatch { layout: Arc::clone(layout), values: values.into(), globals, welded: None }))
    }
}

impl ModelPatch {
    pub(super) fn layout(&self) -> &Arc<PatchLayout> {
        &self.layout
    }
}

/// Arrays of a model that are not empty, in MuJoCo's order.
pub(super) fn fields_of(model: &mj::mjModel) -> Vec<Field> {
    let mut fields = Vec::new();
    let mut index = 0;
    let keep = |array: ModelArray| {
        if array.bytes > 0 {
            fields.push(Field { index, array });
        }
        index += 1;
    };
    // SAFETY: the model is alive.
    unsafe { each(model, keep) };
    fields
}

/// Word `at` of an array; its bytes after the end of the array are 0.
pub(super) fn word(bytes: &[u8], at: usize) -> u64 {
    let rest = &bytes[8 * at..];
    rest.first_chunk::<8>().map_or_else(
        || {
            let mut last = [0; 8];
            last[..rest.len()].copy_from_slice(rest);
            u64::from_ne_bytes(last)
        },
        |whole| u64::from_ne_bytes(*whole),
    )
}

/// Own arrays of a model. Arrays and words that its patch does not have are those of the compiled model.
#[derive(Clone, Debug, Default)]
pub(super) struct OwnArrays {
    arrays: Vec<OwnArray>,
    /// Index in `arrays` of each array of the patch.
    used: Vec<usize>,
}

impl OwnArrays {
    /// Memory of all arrays \[bytes\].
    pub(super) fn bytes(&self) -> usize {
        self.arrays.iter().map(|array| size_of::<OwnArray>() + size_of_val(&*array.memory)).sum()
    }
}

impl ShallowModel {
    /// A copy without a patch and without own arrays.
    pub(super) fn unpatched(&self) -> Self {
        let compiled = self.storage.header();
        let mut header = self.copy_header();
        for field in self.patch.iter().flat_map(|patch| &patch.layout.fields) {
            set_pointer(&mut header, &field.array, array_pointer(compiled, &field.array));
        }
        Globals::of(compiled).write(&mut header);
        // Sizes are those of `self`; all pointers lead to the storage.
        Self { header, storage: Arc::clone(&self.storage), own: Arc::default(), patch: None }
    }

    /// Exchanges the differences for those of `patch`, in the own arrays `own` of this model.
    fn apply(&mut self, patch: &Arc<ModelPatch>) {
        let compiled = self.storage.header();
        let own = Arc::get_mut(&mut self.own).expect("own arrays of a model that nothing else uses");
        let layout = &*patch.layout;
        if self.patch.as_ref().is_none_or(|before| !Arc::ptr_eq(&before.layout, &patch.layout)) {
            if let Some(before) = &self.patch {
                before.layout.for_each(&before.values, |k, span, _| {
                    let array = &mut own.arrays[own.used[k]];
                    // SAFETY: the array has this size and lives as long as the compiled model, to which nothing writes.
                    let nominal =
                        unsafe { std::slice::from_raw_parts(array_pointer(compiled, &array.field), array.field.bytes) };
                    let places = span.at as usize..(span.at + span.words) as usize;
                    places.for_each(|at| array.memory[at] = word(nominal, at));
                });
                for field in &before.layout.fields {
                    set_pointer(&mut self.header, &field.array, array_pointer(compiled, &field.array));
                }
            }
            own.used.clear();
            for field in &layout.fields {
                let known = own.arrays.iter().position(|array| array.field == field.array);
                own.used.push(known.unwrap_or_else(|| {
                    // SAFETY: as above.
                    let nominal =
                        unsafe { std::slice::from_raw_parts(array_pointer(compiled, &field.array), field.array.bytes) };
                    own.arrays.push(OwnArray::from_bytes(field.array, nominal));
                    own.arrays.len() - 1
                }));
            }
        }
        layout.for_each(&patch.values, |k, span, values| {
            let places = span.at as usize..(span.at + span.words) as usize;
            own.arrays[own.used[k]].memory[places].copy_from_slice(values);
        });
        for (field, &k) in layout.fields.iter().zip(&own.used) {
            // After the last write to the array.
            set_pointer(&mut self.header, &field.array, own.arrays[k].memory.as_ptr().cast());
        }
        patch.globals.write(&mut self.header);
        self.patch = Some(Arc::clone(patch));
    }
}

impl Model {
    /// Returns the model with the differences `patch` from the compiled model, instead of those that it has. If `self`
    /// is the only owner of a model with own arrays, its memory is reused.
    ///
    /// # Panics
    /// `patch` comes from another compilation.
    #[must_use]
    pub fn patched(mut self, patch: &Arc<ModelPatch>) -> Self {
        patch.expect_storage(&self);
        if self.0.patch.as_ref().is_some_and(|own| Arc::ptr_eq(own, patch)) {
            return self;
        }
        let is_sole_owner = Arc::get_mut(&mut self.0).is_some_and(|model| Arc::get_mut(&mut model.own).is_some());
        if !is_sole_owner {
            self = Self(Arc::new(self.0.unpatched()));
        }
        Arc::get_mut(&mut self.0).expect("a model with one owner").apply(patch);
        self
    }

    /// Returns the model without differences from the compiled model, except for its buffer sizes.
    #[must_use]
    pub fn without_patch(&self) -> Self {
        if self.0.patch.is_none() { self.clone() } else { Self(Arc::new(self.0.unpatched())) }
    }

    /// Differences from the compiled model, besides buffer sizes; `None` for a model without any.
    pub fn patch(&self) -> Option<&Arc<ModelPatch>> {
        self.0.patch.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Buffers, ModelEditor, compile};

    const SCENE: &str = r#"<mujoco><worldbody><geom type="plane" size="5 5 1"/>
        <body pos="0 0 1"><joint axis="0 1 0" damping="0.1" armature="0.01"/><geom type="capsule" size="0.03 0.1"/>
          <body pos="0.2 0 0"><joint axis="0 1 0"/><geom type="box" size="0.02 0.03 0.04"/></body></body>
        <body name="a" pos="1 0 1"><freejoint/><geom size="0.1"/></body>
        <body name="b" pos="2 0 1"><freejoint/><geom size="0.1"/></body></worldbody>
        <equality><weld name="w" body1="a" body2="b" active="false"/></equality></mujoco>"#;

    fn base() -> Model {
        compile(SCENE, &[]).expect("compiles").into_model()
    }

    /// Edits of different arrays, f32 and bytes among them; kind 0 has none.
    fn edit(editor: &mut ModelEditor, kind: usize, factor: f64) {
        match kind {
            1 => editor.body_mass_mut()[1..].iter_mut().for_each(|mass| *mass *= factor),
            2 => editor.geom_friction_mut()[3] = factor,
            3 => editor.geom_rgba_mut()[5] = factor as f32,
            4 => editor.set_gravity([0.0, factor, -1.0]),
            5 => {
                editor.body_mass_mut()[2] = factor;
                editor.geom_friction_mut()[6] = 0.3;
                editor.set_geom_size(3, [0.2, 0.0, 0.0]);
            }
            _ => return,
        }
        editor.set_constants().expect("fits");
    }

    /// Bytes of all arrays, and the globals.
    fn content(model: &Model) -> (Vec<(&'static str, Vec<u8>)>, [u64; 5]) {
        // SAFETY: the model is alive, and nothing writes to it meanwhile.
        let bytes = |field: &Field| unsafe {
            std::slice::from_raw_parts(array_pointer(model.header(), &field.array), field.array.bytes).to_vec()
        };
        let arrays = fields_of(model.header()).iter().map(|field| (field.array.name, bytes(field))).collect();
        (arrays, Globals::of(model.header()).bits())
    }

    /// The model of a patch has the content of a whole copy, whatever patches its memory had before.
    #[test]
    fn whole_copies() {
        let base = base();
        let (mut editor, mut other) =
            (ModelEditor::new(&base).expect("small"), ModelEditor::new(&base).expect("small"));
        let mut model = base.clone();
        let mut differed = 0;
        for turn in 0..60_usize {
            let (kind, factor) = (turn * turn % 7 % 6, 1.0 + 0.01 * turn as f64);
            editor.load(&base);
            edit(&mut editor, kind, factor);
            // An editor without a history.
            other.load(&base);
            other.body_mass_mut();
            edit(&mut other, kind, factor);
            let whole = content(&other.to_compiled().expect("small").into_model());
            let patch = editor.patch();
            model =
                patch.as_ref().map_or(base.clone(), |patch| std::mem::replace(&mut model, base.clone()).patched(patch));
            assert!(content(&model) == whole, "turn {turn}, kind {kind}");
            assert!(content(&editor.model(&base)) == whole, "turn {turn}, kind {kind}");
            assert_eq!(patch.is_none(), kind == 0, "kind {kind}");
            // Without a model that has the patch.
            assert_eq!(NumberArray::BODY_MASS.all(&base, patch.as_deref()), model.body_mass());
            assert_eq!(NumberArray::GEOM_FRICTION.some::<5>(&base, patch.as_deref(), 2), model.geom_friction()[2..7]);
            differed += usize::from(whole != content(&base));
            // With a weld, and without it again.
            let weld = Weld { equality: 0, pose: [0.1, 0.2, 0.3, 0.8, 0.0, 0.6, 0.0] };
            let welded = ModelPatch::with_welds(patch.as_ref(), &base, &[weld]).expect("differs");
            let with_weld = base.clone().patched(&welded);
            assert_eq!(with_weld.eq_data()[3..10], weld.pose);
            assert_eq!((with_weld.body_mass(), with_weld.gravity()), (model.body_mass(), model.gravity()));
            let released = ModelPatch::with_welds(Some(&welded), &base, &[]);
            assert!(content(&released.map_or(base.clone(), |patch| base.clone().patched(&patch))) == whole);
        }
        assert!(differed > 40);
    }

    /// A model that something else uses stays as it is; other models give their memory to the next patch.
    #[test]
    fn owners() {
        let base = base();
        let mut editor = ModelEditor::new(&base).expect("small");
        let mut patch = |factor: f64| {
            editor.load(&base);
            edit(&mut editor, 1, factor);
            editor.patch().expect("differs")
        };
        let (first, second) = (patch(1.5), patch(2.5));
        let model = base.clone().patched(&first);
        let memory = model.body_mass().as_ptr();
        let before = content(&model);
        let kept = model.clone();
        let model = model.patched(&second);
        assert_ne!(model.body_mass().as_ptr(), memory);
        assert!(content(&kept) == before && content(&model) != before);
        // With other buffer sizes, the arrays are shared.
        let larger = kept.with_buffers(Buffers { contacts: 9, constraints: 70, arena_bytes: 1 << 20 });
        let kept = kept.patched(&second);
        assert!(content(&larger) == before && content(&kept) == content(&model));
        let memory = model.body_mass().as_ptr();
        let model = model.patched(&first);
        assert_eq!(model.body_mass().as_ptr(), memory, "the only owner's memory is reused");
        assert!(content(&model) == before);
        assert!(content(&model.without_patch()) == content(&base));
        assert!(first.bytes() < 1000 && first.bytes() > 8 * 4, "{}", first.bytes());
    }

    #[test]
    #[should_panic(expected = "another scene")]
    fn another_scene() {
        let mut editor = ModelEditor::new(&base()).expect("small");
        edit(&mut editor, 2, 0.5);
        let _ = base().patched(&editor.patch().expect("differs"));
    }
}
