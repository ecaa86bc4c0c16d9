//! Measures a scene: the core metrics of `c4d eval`, which need no weights, and neural metrics.

mod cameras;
mod cost;
mod definitions;
mod item;
mod json;
mod matches;
mod method_table;
mod motion;
mod networks;
mod neural;
mod photos;
mod pictures;
mod ranking;
mod series;
mod subject;
mod table;
#[cfg(test)]
mod tests;
mod truth;

pub(crate) use cameras::{ViewFlags, Viewpoints, viewpoints};
pub(crate) use cost::cost;
pub(crate) use definitions::{DEFINITIONS, Definition, Group, chosen};
pub(crate) use item::Item;
pub(crate) use json::{Header, document};
pub(crate) use matches::matches;
pub(crate) use method_table::{SHOWN, method_table};
pub(crate) use motion::motion;
pub(crate) use networks::Networks;
pub(crate) use neural::{Prompts, neural, sampled_frames};
pub(crate) use photos::{Photos, holds_images, is_video};
pub(crate) use pictures::{Sight, pictures};
pub(crate) use ranking::best;
pub(crate) use subject::Subject;
pub(crate) use table::{number, table};
pub(crate) use truth::Truth;
