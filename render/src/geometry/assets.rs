//! Acceleration structures shared between ray casters: BVHs over meshes, height pyramids over height fields.

use super::shape::height_field::Field;
use super::shape::mesh::{MeshBuilder, MeshTree};
use kinetoscope_scene::shape::HeightField;
use kinetoscope_scene::shape::RenderMesh;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Cache of acceleration structures, shared by the ray casters of a simulation. A second ray caster over the same
/// terrain builds nothing. Entries without users are dropped.
#[derive(Clone, Debug, Default)]
pub struct RayAssets(Arc<Mutex<Assets>>);

impl RayAssets {
    /// Calls `f` with the cache, under its lock.
    pub(crate) fn with<R>(&self, f: impl FnOnce(&mut Assets) -> R) -> R {
        let mut assets = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let result = f(&mut assets);
        assets.builder = MeshBuilder::default();
        result
    }
}

/// The mesh that a structure was built from, and the structure.
type Entry<T> = (Weak<RenderMesh>, Weak<T>);

/// Acceleration structures, found by the identity of their mesh.
#[derive(Debug, Default)]
pub struct Assets {
    meshes: Vec<Entry<MeshTree>>,
    fields: Vec<Entry<Field>>,
    /// Scratch memory for the meshes of one call.
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

/// Returns the structure built from a mesh, and builds it if it is missing.
fn find<T>(entries: &mut Vec<Entry<T>>, mesh: &Arc<RenderMesh>, build: impl FnOnce() -> T) -> Arc<T> {
    // While an entry exists, no other mesh can be at the address of its mesh.
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
