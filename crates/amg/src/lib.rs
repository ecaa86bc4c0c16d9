//! Anchor-based motion guidance: propagates an edited frame of a dynamic Gaussian scene along the
//! motion of the scene.
//!
//! [`propagate()`] takes a source [`gs_core::DynamicScene`] and the edited splats of one of its
//! frames and returns an [`EditedScene`], itself a `DynamicScene`, defined at every time of the
//! source. Its result is a [`Binding`]: a few source splats and weights for each edited splat,
//! independent of time. Edited splats that *are* source splats ([`IdentityMap`]) keep their motion
//! bit for bit. Results do not depend on the order of rows or the number of threads.
//!
//! Deliberately absent: images, files, GPU, anything learned.
//!
//! # Glossary
//!
//! | word | meaning |
//! |---|---|
//! | region | source splats of a cube that move together and have similar normals: an anchor |
//! | outlier | a source splat, or region, that moves with none of its neighbours ("floater") |
//! | offset | signed distance of an edited splat from a region along its outward normal |
//! | flatness | 1 − s₁/s₂ of the two smallest scales: 0 for a ball, nearly 1 for a disc |
//! | hypothesis | one motion that an edited splat may have; several regions share it |
//! | posterior | probability of an edited splat's regions, and of none, given all others |
//! | marginal penalty | cost of a region that has more edited splats than its share, or fewer |
//! | parent | the source splat from which an edited splat was made, identified by equal bits |
//! | new piece | connected edited splats that do not coincide with source splats ("graft") |
//! | support | the source splats whose motion an edited splat follows |
//! | moved group | source splats that the edit moved, rotated or scaled together |
//! | generation | source splats that represent a surface at a time when others have faded |
//! | rest position | the position that a splat would have at the edit time |
//! | descendant | a splat that is invisible in the edit frame, on a surface that is visible in it |
//! | binding | per edited splat, the source splats it follows and their weights |

mod aggregate;
mod binding;
mod bit_map;
mod carriers;
mod coherence;
mod color_change;
mod dynamics;
mod eigenvector;
mod error;
mod field;
mod generations;
mod guide_input;
mod identity;
mod inheritance;
mod keyframes;
mod knn;
mod motion_params;
mod moved_group;
mod near_copies;
mod options;
mod paper;
mod persistent;
mod persistent_copies;
mod pose;
mod propagate;
mod regions;
mod report;
mod rigid;
mod rigid_parts;
mod row_index;
mod row_kind;
mod scene;
mod simd;
mod similarity;
mod similarity_messages;

pub use anchors::{AnchorParams, Grouping, Radius};
pub use binding::{Binding, SurfaceBinding};
pub use color_change::ColorChange;
pub use dynamics::DynamicSplit;
pub use error::AmgError;
pub use field::FieldAt;
pub use guide_input::ProgressFn;
pub use identity::{Identity, IdentityMap};
pub use inheritance::{InheritanceReport, Inherited};
pub use motion_params::MotionParams;
pub use moved_group::MovedGroup;
pub use options::{
    Aggregation, AnchorSampling, DynamicParams, Follow, IdentityParams, KnnParams, MotionGuide,
    MotionOptions, MotionPreset, PaperParams, PositionRule, RotationRule, ScaleRule,
};
pub use persistent::{Carrier, PersistentSplats};
pub use propagate::{Propagation, propagate};
pub use report::{MotionReport, TransportReport};
pub use rigid_parts::RigidParts;
pub use row_kind::RowKind;
pub use scene::EditedScene;
pub use similarity::Similarity;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
