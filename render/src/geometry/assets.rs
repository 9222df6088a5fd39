//! What is built once for an asset: trees over meshes, pyramids over height fields.

use super::shape::height_field::Field;
use super::shape::mesh::{MeshBuilder, MeshTree};
use kinetoscope_scene::shape::HeightField;
use kinetoscope_scene::shape::RenderMesh;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// What ray casters have built, shared by all of a simulation: a second one over the same terrain builds nothing. What
/// nobody uses any more is given back.
#[derive(Clone, Debug, Default)]
pub struct RayAssets(Arc<Mutex<Assets>>);

impl RayAssets {
    /// Does something with the assets; one after the other.
    pub(crate) fn with<R>(&self, f: impl FnOnce(&mut Assets) -> R) -> R {
        let mut assets = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let result = f(&mut assets);
        assets.builder = MeshBuilder::default();
        result
    }
}

/// Something built, and the mesh that it was built from.
type Entry<T> = (Weak<RenderMesh>, Weak<T>);

/// What was built, found by the identity of the mesh.
#[derive(Debug, Default)]
pub struct Assets {
    meshes: Vec<Entry<MeshTree>>,
    fields: Vec<Entry<Field>>,
    /// For the meshes of one call.
    builder: MeshBuilder,
}

impl Assets {
    pub(crate) fn mesh(&mut self, mesh: &Arc<RenderMesh>) -> Arc<MeshTree> {
        find(&mut self.meshes, mesh, || self.builder.build(mesh))
    }

    pub(super) fn height_field(&mut self, shape: &HeightField) -> Arc<Field> {
        find(&mut self.fields, shape.mesh(), || Field::new(shape))
    }
}

/// What was built from a mesh; built now where nobody has it.
fn find<T>(entries: &mut Vec<Entry<T>>, mesh: &Arc<RenderMesh>, build: impl FnOnce() -> T) -> Arc<T> {
    // While an entry is there, no other mesh can be where its own was.
    entries.retain(|(_, built)| built.strong_count() > 0);
    let known =
        entries.iter().find(|(from, _)| from.as_ptr() == Arc::as_ptr(mesh)).and_then(|(_, built)| built.upgrade());
    known.unwrap_or_else(|| {
        let built = Arc::new(build());
        entries.push((Arc::downgrade(mesh), Arc::downgrade(&built)));
        built
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::shape::Sphere;

    #[test]
    fn shared_assets() {
        let ball = kinetoscope_scene::shape::Shape::from(Sphere { radius: 1.0 }).tessellate(8);
        let [a, b] = [0, 1].map(|_| Arc::new(RenderMesh::new(&ball, RenderMesh::CREASE)));
        let assets = RayAssets::default();
        let tree = |mesh| assets.clone().with(|assets| assets.mesh(mesh));
        let first = tree(&a);
        assert!(Arc::ptr_eq(&first, &tree(&a)) && !Arc::ptr_eq(&first, &tree(&b)));
        let gone = Arc::downgrade(&first);
        drop(first);
        assert!(gone.upgrade().is_none(), "not in use");
        assert_eq!(Arc::strong_count(&tree(&a)), 1);
    }
}
