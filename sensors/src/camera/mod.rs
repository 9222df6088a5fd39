//! Cameras: channels, frames and the rasterizer that fills them.

pub mod channel;
pub mod parallel;
pub mod rasterizer;

#[cfg(test)]
mod tests;

pub use channel::{Channel, Channels, Frame, FrameMut};
pub use parallel::ParallelRasterizer;
pub use rasterizer::{RasterCfg, Rasterizer, Shot};
