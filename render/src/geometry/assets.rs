//! Acceleration structures shared between ray casters: BVHs over meshes, height pyramids over height fields.

use super::shape::height_field::HeightGrid;
use super::shape::mesh::{MeshBuilder, MeshBvh};
use kinetoscope_scene::shape::HeightField;
use kinetoscope_scene::shape::RenderMesh;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Cache of acceleration structures, shared by the ray casters of a simulation. A second ray caster over the same
/// terrain builds nothing. Entries without users are dropped.
#[derive(Clone, Debug, Default)]
pub struct RayAssetCache(Arc<Mutex<AssetCache>>);

impl RayAssetCache {
    /// Calls `f` with the cache, under its lock.
    pub(crate) fn with<R>(&self, f: impl FnOnce(&mut AssetCache) -> R) -> R {
        let mut assets = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let result = f(&mut assets);
        assets.builder = MeshBuilder::default();
        result
    }
}

/// The mesh that a structure was built from, and the structure.
type CacheEntry<T> = (Weak<RenderMesh>, Weak<T>);

/// Cache of acceleration structures, keyed by the address of their mesh.
#[derive(Debug, Default)]
pub struct AssetCache {
    meshes: Vec<CacheEntry<MeshBvh>>,
    height_fields: Vec<CacheEntry<HeightGrid>>,
    /// Scratch memory for the meshes of one call.
    builder: MeshBuilder,
}

impl AssetCache {
    pub(crate) fn mesh(&mut self, mesh: &Arc<RenderMesh>) -> Arc<MeshBvh> {
        get_or_build(&mut self.meshes, mesh, || self.builder.build(mesh))
    }

    pub(super) fn height_field(&mut self, shape: &HeightField) -> Arc<HeightGrid> {
        get_or_build(&mut self.height_fields, shape.mesh(), || HeightGrid::new(shape))
    }
}

/// Returns the structure built from a mesh, and builds it if it is missing.
fn get_or_build<T>(entries: &mut Vec<CacheEntry<T>>, mesh: &Arc<RenderMesh>, build: impl FnOnce() -> T) -> Arc<T> {
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
        let [a, b] = [0, 1].map(|_| Arc::new(RenderMesh::new(&ball, RenderMesh::DEFAULT_CREASE_ANGLE)));
        let assets = RayAssetCache::default();
        let tree = |mesh| assets.clone().with(|assets| assets.mesh(mesh));
        let first = tree(&a);
        assert!(Arc::ptr_eq(&first, &tree(&a)) && !Arc::ptr_eq(&first, &tree(&b)));
        let gone = Arc::downgrade(&first);
        drop(first);
        assert!(gone.upgrade().is_none(), "not in use");
        assert_eq!(Arc::strong_count(&tree(&a)), 1);
    }
}
