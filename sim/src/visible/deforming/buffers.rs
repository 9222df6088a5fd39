//! Copies of the scene with the current shapes, whose memory is reused.

use super::{DeformingInstances, Scratch};
use kinetoscope_mujoco::Data;
use kinetoscope_scene::{EnvScene, RenderScene};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of copies that an environment keeps: those that cameras show, those on their way to a camera, and the
/// next one. Further copies are allocated each time.
const MAX_COPIES_PER_ENV: usize = 8;

/// Scene copies of all environments.
#[derive(Debug, Default)]
pub(in crate::visible) struct SceneBufferPool(Mutex<PoolState>);

#[derive(Debug, Default)]
struct PoolState {
    of_env: Vec<Vec<Buffer>>,
    scratch: Scratch,
}

/// Copy of a scene, with its original.
#[derive(Debug)]
struct Buffer {
    of: Arc<RenderScene>,
    copy: Arc<RenderScene>,
}

impl SceneBufferPool {
    /// Puts a copy of `scene` with the shapes of `data` into `out`, the scene of environment `env`.
    pub(in crate::visible) fn fill(
        &self,
        deforming: &DeformingInstances,
        env: usize,
        scene: &Arc<RenderScene>,
        data: &Data,
        out: &mut EnvScene,
    ) {
        // The previous copy is free again, unless a camera holds it.
        out.0 = None;
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let PoolState { of_env, scratch } = &mut *all;
        if of_env.len() <= env {
            of_env.resize_with(env + 1, Vec::new);
        }
        let buffers = &mut of_env[env];
        buffers.retain(|buffer| Arc::ptr_eq(&buffer.of, scene));
        for Buffer { copy, .. } in buffers.iter_mut() {
            if let Some(free) = Arc::get_mut(copy) {
                deforming.update_shapes(data, free, scratch);
                out.0 = Some(Arc::clone(copy));
                return;
            }
        }
        let mut copy = (**scene).clone();
        deforming.update_shapes(data, &mut copy, scratch);
        let copy = Arc::new(copy);
        if buffers.len() < MAX_COPIES_PER_ENV {
            buffers.push(Buffer { of: Arc::clone(scene), copy: Arc::clone(&copy) });
        }
        out.0 = Some(copy);
    }
}
