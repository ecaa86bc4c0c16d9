//! Colour-uncertainty-guided appearance refinement (CUAR) of dynamic Gaussian splats (Eqs. 11–20).
//!
//! Colours that are visible in the edited first frame are correct. At other times, some splats show
//! colours that were never supervised: interiors that motion reveals, and view-dependent colours
//! from new directions. [`refine()`] finds such pixels by the change of colour over time
//! (uncertainty), looks up the colour of the same surface in the first frame (flow, warp, occlusion
//! test), and fits the SH of the edited splats to it, with one offset for all times.
//!
//! Promises: unedited splats and all geometry are unchanged, bit for bit. The same inputs and seed
//! give the same bits on a deterministic rasteriser, for any number of threads and interruptions
//! and any memory budget in which the images fit. Every loss and gradient is checked against finite
//! differences. The passes ([`render_flow`], [`render_uncertainty`], [`artifact_mask`]), the losses
//! ([`loss`]) and [`Adam`] can be used alone. Works with any [`gs_core::Rasterizer`]; the steps of
//! Adam can run on a device ([`DescentEngine`]).
//!
//! Conventions: pixels as in [`gs_core::Camera::project`]; images row-major, channels innermost;
//! losses are means over the whole image.
//!
//! Deliberately absent: files (`.flo` bytes and colour-wheel pictures are encoded here, but not
//! stored), GPU code, anchors and motion.
//!
//! ```
//! use cuar::{NoRefineObserver, RefineOptions, Views, refine};
//! use gs_core::{DynamicScene, TimeRange};
//! use gs_raster_cpu::CpuRasterizer;
//! use gs_synth::{DemoParams, demo};
//!
//! let scene = demo(&DemoParams { num_splats: 1_000, ..DemoParams::default() })?;
//! let edited = scene.moving_mask();
//! let cameras = scene.orbit_cameras(4, 64, 48);
//! let times = TimeRange::UNIT.frames(5);
//! let views = Views { cameras: &cameras, times: &times, held_out: &[3] };
//! let options = RefineOptions { samples: 8, ..RefineOptions::default() };
//! let raster = CpuRasterizer::default();
//! let refined = refine(&raster, &scene, &edited, &views, &options, None, &mut NoRefineObserver)?;
//! let better = refined.scene(&scene); // a DynamicScene
//! assert_eq!(better.num_splats(), scene.num_splats());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod descent;
mod descent_image;
mod engine;
mod error;
mod evaluator;
pub mod evidence;
mod fingerprint;
mod first_frame_visibility;
mod flow;
mod flow_files;

pub mod loss;
mod normal_equations;
mod observer;
mod options;
mod problem;
mod push_forward;
mod refine;
mod refine_edit;
mod refine_report;
mod regression;
mod repair;
mod sample;
mod sample_source;
mod scene;
mod solve;
mod splat_visibility;
mod state;
mod stored_image;
mod supervision;
mod supervision_stats;
mod uncertainty;
mod view_sampler;
mod warp;

pub use descent_image::{Crop, DescentImage, Entry};
pub use engine::{Backend, DescentEngine, DescentTask};
pub use error::CuarError;
pub use evidence::{BeforeEdit, Evidence, EvidenceParams};
pub use first_frame_visibility::first_frame_shares;
pub use flow::{Flow, displacements, render_flow};
pub use flow_files::{encode_flo, flow_wheel};
pub use gs_fit::Adam;
pub use observer::{NoRefineObserver, Preview, RefineObserver, RefineProgress};
pub use options::{AdamParams, RefineOptions, RefinePreset, RegressionParams, Solver};
pub use problem::TracePoint;
pub use refine::{Refined, refine, refine_with};
pub use refine_edit::{any_uncertain, make_images, refine_edit};
pub use refine_report::RefineReport;
pub use repair::{Repair, RepairCounts};
pub use scene::{FADED_LOGIT, OffsetScene};
pub use state::State;
pub use supervision_stats::{Rejection, SupervisionStats};
pub use uncertainty::{
    artifact_mask, color_uncertainty, render_evidence, render_total_uncertainty, render_uncertainty,
};
pub use view_sampler::{ViewTime, Views};
pub use warp::{WarpForm, WarpParams};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
