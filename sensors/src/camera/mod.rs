//! Cameras: channels, frames and the rasterizer that fills them.

pub mod channel;
pub mod rasterizer;

#[cfg(test)]
mod tests;

pub use channel::{Channel, Channels, Frame, FrameMut};
pub use rasterizer::{RasterCfg, Rasterizer, Shot};
