//! Selections of Gaussian splats in a small language, and edits of the selected splats.
//!
//! [`Selector`] parses expressions such as `color #e33~.15 & !moving`, with the column in its
//! errors; [`Action`] parses changes; [`Editor`] applies both in order. Splats that are not
//! selected keep their bits and their order. Affine maps of colour ([`ColorMap`]) are exact on all
//! bands of the spherical harmonics, and rotations rotate these. Results are the same bits for any
//! number of threads. `docs/EDITING.md` has the language and the equations.
//!
//! ```
//! use gs_core::Splats;
//! use gs_edit::{Editor, Resources, Script};
//!
//! # fn edit(splats: Splats) -> Result<Splats, gs_edit::EditError> {
//! let script = Script::parse([("select", "sphere 0,1,0,.5 & opacity>.1"), ("hue", "120")])?;
//! let mut editor = Editor::new(splats)?;
//! for step in &script.steps {
//!     editor.apply(step, &Resources::default())?;
//! }
//! # Ok(editor.into_splats())
//! # }
//! ```
//!
//! Deliberately absent: files (callers load what [`Script::needs`] lists), motion (given as
//! [`Motion`]), rendering (styles need a [`StyleTransfer`]), fitting to pictures.

mod action;
mod color;
mod color_map;
mod editor;
mod error;
mod evaluate;
mod ids;
mod lexer;
mod lift;
mod parser;
mod reach;
mod resources;
mod script;
mod selector;
mod style;
mod summary;
mod transport;

pub use action::{ACTION_OPTIONS, Action, ActionOption, GraftPose, Pivot};
pub use color::base_color;
pub use color_map::ColorMap;
pub use editor::{Editor, MAX_OPACITY};
pub use error::{EditError, SyntaxError};
pub use evaluate::SelectorInput;
pub use ids::parse_ids;
pub use lift::lift_masks;
pub use resources::{Motion, ResourceNames, Resources};
pub use script::{Script, Step};
pub use selector::{Bounds, Selector, SplatProperty};
pub use style::StyleTransfer;
pub use summary::Summary;

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
