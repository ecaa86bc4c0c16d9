//! Colours of splats by a property: in renders, in pages and in `c4d view`.

mod confidence;
mod displacement;
mod image;
mod layer;
mod palette;
mod row_classes;

pub(crate) use confidence::confidence;
pub(crate) use displacement::displacement;
pub(crate) use image::overlay_image;
pub(crate) use layer::{Layer, LayerSource};
pub(crate) use row_classes::Class;
