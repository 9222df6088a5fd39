//! What an environment looks like whose sizes or colours are its own.

use super::{Visible, geom};
use crate::mj::Model;
use scene::{Material, OwnScene};
use std::collections::BTreeMap;
use std::sync::Arc;

impl Visible {
    /// The scene with other sizes \[m\] and colours, by geom of `model`. Meshes and textures are shared.
    pub(crate) fn own_scene(
        &self,
        model: &Model,
        sizes: &BTreeMap<usize, &[f64]>,
        colors: &BTreeMap<usize, &[f64]>,
    ) -> OwnScene {
        let mut instances = self.scene.instances().to_vec();
        for (instance, geom) in instances.iter_mut().zip(&self.geoms) {
            let size = sizes.get(geom).and_then(|size| geom::sized(model.geom_type()[*geom] as u32, size));
            if let Some(shape) = size {
                instance.shape = shape;
            }
            if let Some(color) = colors.get(geom) {
                let rgba = [0, 1, 2, 3].map(|k| color[k] as f32);
                instance.visible = rgba[3] > 0.0;
                instance.material = Material { rgba, ..instance.material.clone() };
            }
        }
        // Sizes and colours were checked when they were set, and there are as many triangles as before.
        OwnScene(self.scene.with_instances(instances).ok().map(Arc::new))
    }

    /// This as it is in an environment whose scene is `own`.
    pub(super) fn seen_as(self: &Arc<Self>, own: &OwnScene) -> Arc<Self> {
        match &own.0 {
            None => Arc::clone(self),
            Some(scene) => Arc::new(Self { scene: Arc::clone(scene), ..(**self).clone() }),
        }
    }
}
