//! Copies of the scene with the current shapes, whose memory is reused.

use super::{Deforming, Scratch};
use kinetoscope_mujoco::Data;
use kinetoscope_scene::{OwnScene, RenderScene};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of copies that an environment keeps: those that cameras show, those on their way to a camera, and the
/// next one. Further copies are allocated each time.
const KEPT: usize = 8;

/// Scene copies of all environments.
#[derive(Debug, Default)]
pub(in crate::visible) struct Buffers(Mutex<All>);

#[derive(Debug, Default)]
struct All {
    of_env: Vec<Vec<Buffer>>,
    scratch: Scratch,
}

/// Copy of a scene, with its original.
#[derive(Debug)]
struct Buffer {
    of: Arc<RenderScene>,
    copy: Arc<RenderScene>,
}

impl Buffers {
    /// Puts a copy of `scene` with the shapes of `data` into `out`, the scene of environment `env`.
    pub(in crate::visible) fn fill(
        &self,
        deforming: &Deforming,
        env: usize,
        scene: &Arc<RenderScene>,
        data: &Data,
        out: &mut OwnScene,
    ) {
        // The previous copy is free again, unless a camera holds it.
        out.0 = None;
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let All { of_env, scratch } = &mut *all;
        if of_env.len() <= env {
            of_env.resize_with(env + 1, Vec::new);
        }
        let buffers = &mut of_env[env];
        buffers.retain(|buffer| Arc::ptr_eq(&buffer.of, scene));
        for Buffer { copy, .. } in buffers.iter_mut() {
            if let Some(free) = Arc::get_mut(copy) {
                deforming.shape(data, free, scratch);
                out.0 = Some(Arc::clone(copy));
                return;
            }
        }
        let mut copy = (**scene).clone();
        deforming.shape(data, &mut copy, scratch);
        let copy = Arc::new(copy);
        if buffers.len() < KEPT {
            buffers.push(Buffer { of: Arc::clone(scene), copy: Arc::clone(&copy) });
        }
        out.0 = Some(copy);
    }
}
