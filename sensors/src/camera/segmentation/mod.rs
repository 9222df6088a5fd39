//! Segmentation: conversion of the mask channel to instances, links and semantic classes.

mod image;
mod labels;
mod palette;

pub use labels::{Segment, SegmentLevel, Segmentation, SegmentationCfg, SegmentedEntity};
pub use palette::segment_color;
