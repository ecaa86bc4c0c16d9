//! Seeded dynamic scenes, edits of their first frame, and the true motion of both.
//!
//! Contents: [`demo()`], a dancer on a stage; [`apply_edits`], edits of its first frame, and
//! [`apply_visible_edits()`], the same edits made by an editor that works on images; [`Truth`], the
//! true motion of every edited splat; [`build`], hard cases; [`build_short_lived`], cases with
//! short-lived splats; [`motion_error`], the score. Every result is a function of its seed; at `t = 0` scenes and truths return their frame-1 splats bit for bit.
//!
//! Conventions: world units are approximately metres, y is up, a figure stands on y = 0 at the
//! origin and faces +z (its left is +x); times run over `[0,1]` and frame 1 is `t = 0`; quaternions
//! are `wxyz`; colours are sRGB values without conversion.
//!
//! Deliberately absent: files, and the methods under test. Included are three controls
//! ([`rigid_neighbors`] uses only the source's motion, [`part_neighbors`] the true parts, and
//! [`label_transport()`] votes of neighbours) and the training of the deformation network for
//! comparison ([`fit_hexplane`]).
//!
//! ```
//! use gs_synth::{DemoParams, apply_edits, demo, demo_edits, motion_error};
//!
//! let scene = demo(&DemoParams { num_splats: 2_000, ..DemoParams::default() })?;
//! let edited = apply_edits(&scene, &demo_edits(), 0)?;
//! let perfect = motion_error(&edited.truth, &edited.truth, &[0.25, 0.5])?;
//! assert_eq!(perfect.epe, 0.0);
//! # Ok::<(), gs_synth::SynthError>(())
//! ```

mod assemble;
mod body;
mod cameras;
mod cases;
mod cloth;
mod contact;
mod control;
mod dance;
mod demo;
mod edit;
mod error;
mod figure;
mod fit;
mod label_transport;
mod math;
mod metric;
mod oracle;
mod paint;
mod part;
mod pose;
mod sampler;
mod scene;
mod shape;
mod short_lived;
mod short_lived_cases;
mod skeleton;
mod stage;
mod truth;
mod visible_edits;

pub use cases::{CASE_SIZES, TruthCase, TruthScene, build};
pub use control::rigid_neighbors;
pub use demo::{DemoParams, demo, demo_edits};
pub use edit::{Edit, Graft, Paint, Region, apply_edits};
pub use error::SynthError;
pub use fit::{FitParams, FitResidual, FittedField, fit_hexplane};
pub use label_transport::label_transport;
pub use metric::{MotionError, motion_error, motion_error_of};
pub use oracle::{PartBy, part_neighbors};
pub use part::{Bone, Kind, Part, Tag};
pub use scene::{SplatTruth, SynthScene};
pub use short_lived::{ShortLivedParams, ShortLivedScene};
pub use short_lived_cases::{
    ShortLivedCase, ShortLivedTruth, ShortLivedTruthScene, build_short_lived,
};
pub use truth::{EditedFrame, Truth};
pub use visible_edits::{PICTURE_WEIGHT, UnseenColor, apply_visible_edits};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
