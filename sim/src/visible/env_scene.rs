//! Render scenes of environments with sizes or colors of their own.

use super::{Anchor, VisualScene};
use kinetoscope_look::shape_from_size;
use kinetoscope_mujoco::{Data, Model};
use kinetoscope_scene::{EnvScene, Material, RenderSceneError};
use std::collections::BTreeMap;
use std::sync::Arc;

impl VisualScene {
    /// Creates the scene with other sizes \[m\] and colors, by geom of `model`. Meshes and textures are shared.
    ///
    /// # Errors
    /// A size or a color is invalid for rendering. Those of [`Properties`](crate::Properties) are valid.
    pub(crate) fn env_scene(
        &self,
        model: &Model,
        sizes: &BTreeMap<usize, &[f64]>,
        colors: &BTreeMap<usize, &[f64]>,
    ) -> Result<EnvScene, RenderSceneError> {
        let mut instances = self.scene.instances().to_vec();
        for (instance, anchor) in instances.iter_mut().zip(&self.anchors) {
            let Anchor::Geom(geom) = anchor else { continue };
            let size = sizes.get(geom).and_then(|size| shape_from_size(model.geom_type()[*geom], size));
            if let Some(shape) = size {
                instance.shape = shape;
            }
            if let Some(color) = colors.get(geom) {
                let rgba = [0, 1, 2, 3].map(|k| color[k] as f32);
                instance.visible = rgba[3] > 0.0;
                instance.material = Material { rgba, ..instance.material.clone() };
            }
        }
        Ok(EnvScene(Some(Arc::new(self.scene.with_instances(instances)?))))
    }

    /// Returns this scene with the shapes of `data`, in memory that is not shared; the same scene if no shape deforms.
    pub(super) fn with_shapes_of(self: &Arc<Self>, data: &Data) -> Arc<Self> {
        if !self.deforms() {
            return Arc::clone(self);
        }
        let buffers = Arc::default();
        let scene = Self { buffers, ..(**self).clone() }.scene_at(data);
        Arc::new(Self { scene, buffers: Arc::default(), ..(**self).clone() })
    }

    /// Returns this scene as in an environment whose own scene is `own`.
    pub(super) fn with_env_scene(self: &Arc<Self>, own: &EnvScene) -> Arc<Self> {
        match &own.0 {
            None => Arc::clone(self),
            Some(scene) => Arc::new(Self { scene: Arc::clone(scene), ..(**self).clone() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_mujoco as mj;

    /// Sizes and colors that cannot be rendered are an error; the scene does not fall back to the nominal ones.
    #[test]
    fn invalid_appearance() {
        let text = r#"<mujoco><worldbody><geom type="box" size="0.1 0.2 0.3"/></worldbody></mujoco>"#;
        let model = mj::compile(text, &[]).expect("compiles").into_model();
        let visible = VisualScene::of_model(&model);
        let look = |size: [f64; 3], red: f64| {
            let (size, color) = ([(0, &size[..])].into(), [red, 0.0, 0.0, 1.0]);
            visible.env_scene(&model, &size, &[(0, &color[..])].into())
        };
        let error = look([0.1, 0.0, 0.3], 0.5).expect_err("a box has three nonzero sizes");
        assert!(matches!(error, RenderSceneError::Size { shape: "box", .. }), "{error}");
        let error = look([0.1, 0.2, 0.3], f64::NAN).expect_err("not a color");
        assert!(matches!(error, RenderSceneError::Material { .. }), "{error}");
        // Control.
        assert!(look([0.4, 0.2, 0.3], 0.5).is_ok_and(|own| own.0.is_some()));
    }
}
