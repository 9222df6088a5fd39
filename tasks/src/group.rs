//! Groups of observations.

use crate::context::TermContext;
use crate::episode_rng::EpisodeKey;
use crate::error::{EnvError, Result};
use crate::image::{ImageBatch, ImageSpace, ImageTerm};
use crate::observation::ObservationTerm;
use crate::space::Space;
use kinetoscope_scene::KeyedRng;
use ndarray::{Array2, ArrayView2};

/// Name of the group of observations that every task has: [`Step::observations`](crate::Step::observations).
pub const POLICY_GROUP: &str = "policy";

/// Terms of an observation group.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) name: String,
    pub(crate) terms: Vec<ObservationTerm>,
    pub(crate) images: Vec<ImageTerm>,
    /// Columns of the terms; filled when the task is built.
    pub(crate) space: Space,
}

impl Group {
    pub(crate) fn new(name: &str) -> Self {
        Self { name: name.into(), terms: Vec::new(), images: Vec::new(), space: Space::empty() }
    }

    /// Key of the noise of a term.
    pub(crate) fn noise_key(&self, term: &str) -> String {
        if self.name == POLICY_GROUP {
            format!("observation/{term}")
        } else {
            format!("observation/{}/{term}", self.name)
        }
    }
}

/// Latest observations of a group.
#[derive(Debug)]
pub(crate) struct GroupBuffers {
    /// Shape (N, columns).
    values: Array2<f64>,
    /// Observations at the end of the last step, before environments are reset; same shape.
    final_values: Array2<f64>,
    /// Noise generators by environment, then by term; `None` for a term without noise.
    noise: Vec<Vec<Option<KeyedRng>>>,
    images: Vec<ImageBatch>,
    /// Images at the end of the last step, before environments are reset; `None` if they are those of `images`.
    final_images: Option<Vec<ImageBatch>>,
}

impl GroupBuffers {
    pub(crate) fn new(group: &Group, num_envs: usize) -> Self {
        let values = Array2::zeros((num_envs, group.space.len()));
        let images = group.images.iter().map(|term| term.zeros(num_envs)).collect();
        Self { final_values: values.clone(), values, noise: vec![Vec::new(); num_envs], images, final_images: None }
    }

    pub(crate) fn values(&self) -> &Array2<f64> {
        &self.values
    }

    pub(crate) fn final_values(&self) -> &Array2<f64> {
        &self.final_values
    }

    /// Begins the noise of an episode in environment `env`.
    pub(crate) fn begin_noise(&mut self, group: &Group, env: usize, key: EpisodeKey) {
        let rng = |term: &ObservationTerm| term.has_noise().then(|| key.rng(&group.noise_key(&term.name)));
        self.noise[env] = group.terms.iter().map(rng).collect();
    }

    /// Observes the environments `envs`, which have an episode.
    pub(crate) fn observe(&mut self, group: &Group, now: &TermContext<'_>, envs: &[usize]) -> Result<()> {
        let mut first = 0;
        for (k, term) in group.terms.iter().enumerate() {
            let values = term.compute(now)?;
            for &env in envs {
                let mut rng = self.noise[env].get_mut(k).and_then(Option::as_mut);
                let (to, row) = (self.values.row_mut(env), values.row(env));
                for ((column, &value), to) in row.iter().enumerate().zip(to.into_iter().skip(first)) {
                    *to = term.process(value, rng.as_deref_mut());
                    if !to.is_finite() {
                        return Err(term.not_finite(env, column, *to));
                    }
                }
            }
            first += term.columns.len();
        }
        let images = group.images.iter().zip(&mut self.images);
        images.into_iter().try_for_each(|(term, into)| term.read(now, envs, into))
    }

    /// Keeps the present observations as those that the step led to. `begins` is true if some environments are observed
    /// again in this step.
    pub(crate) fn set_final(&mut self, begins: bool) {
        self.final_values.assign(&self.values);
        self.final_images = (begins && !self.images.is_empty()).then(|| self.images.clone());
    }
}

/// The latest observations of a group, after a reset or step.
#[derive(Clone, Copy, Debug)]
pub struct ObservationGroup<'e> {
    group: &'e Group,
    buffers: &'e GroupBuffers,
}

impl<'e> ObservationGroup<'e> {
    pub(crate) fn new(group: &'e Group, buffers: &'e GroupBuffers) -> Self {
        Self { group, buffers }
    }

    /// Name of the group.
    pub fn name(&self) -> &'e str {
        &self.group.name
    }

    /// Columns of the numbers, named `term/column`, with the bounds of the clip after scaling. Columns of a term without
    /// a clip are unbounded.
    pub fn space(&self) -> &'e Space {
        &self.group.space
    }

    /// Present observations, shape (N, columns of [`space`](Self::space)); zeros before the first reset. In an
    /// environment that began an episode in the last step, the first observation of that episode.
    pub fn observations(&self) -> ArrayView2<'e, f64> {
        self.buffers.values.view()
    }

    /// Observations at the end of the last step, before environments are reset; same shape. In an environment whose
    /// episode ended, its last observation; elsewhere, and after a reset, equal to
    /// [`observations`](Self::observations).
    pub fn final_observations(&self) -> ArrayView2<'e, f64> {
        self.buffers.final_values.view()
    }

    /// [`observations`](Self::observations) in single precision. Bounds of the space stay valid if they are rounded in
    /// the same way.
    ///
    /// # Errors
    /// A number is beyond the range of single precision; the error names its column.
    pub fn observations_f32(&self) -> Result<Array2<f32>> {
        self.to_f32(&self.buffers.values)
    }

    /// [`final_observations`](Self::final_observations) in single precision.
    ///
    /// # Errors
    /// A number is beyond the range of single precision; the error names its column.
    pub fn final_observations_f32(&self) -> Result<Array2<f32>> {
        self.to_f32(&self.buffers.final_values)
    }

    fn to_f32(self, values: &Array2<f64>) -> Result<Array2<f32>> {
        let narrow = values.mapv(|value| value as f32);
        match narrow.indexed_iter().find(|(_, value)| !value.is_finite()) {
            None => Ok(narrow),
            Some(((env, k), _)) => {
                let what = format!("the observation of the group {:?} in single precision", self.group.name);
                let column = self.group.space.names()[k].clone();
                Err(EnvError::NotFinite { what, env, column, value: values[(env, k)] })
            }
        }
    }

    /// Names and spaces of the images.
    pub fn image_spaces(&self) -> impl Iterator<Item = (&'e str, ImageSpace)> + use<'e> {
        self.group.images.iter().map(|term| (term.name.as_str(), term.space))
    }

    /// Present images of the term called `name`; zeros before the first reset.
    ///
    /// # Errors
    /// The group has no such images; the error lists the existing ones.
    pub fn image(&self, name: &str) -> Result<&'e ImageBatch> {
        Ok(&self.buffers.images[self.image_index(name)?])
    }

    /// Images of the term called `name` at the end of the last step, before environments are reset. In an environment
    /// whose episode ended, the last image of that episode; elsewhere, and after a reset, equal to
    /// [`image`](Self::image).
    ///
    /// # Errors
    /// The group has no such images; the error lists the existing ones.
    pub fn final_image(&self, name: &str) -> Result<&'e ImageBatch> {
        let index = self.image_index(name)?;
        Ok(&self.buffers.final_images.as_ref().unwrap_or(&self.buffers.images)[index])
    }

    fn image_index(&self, name: &str) -> Result<usize> {
        let names = || self.group.images.iter().map(|term| term.name.as_str());
        names().position(|of| of == name).ok_or_else(|| EnvError::unknown("image", name, names()))
    }
}
