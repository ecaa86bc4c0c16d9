//! Colour-uncertainty-guided appearance refinement (CUAR) of dynamic Gaussian splats (Eqs. 11–20).
//!
//! An edited first frame is right where it is seen. Carried through time, some of its splats show colours that nothing ever supervised:
//! interiors that motion reveals, view-dependent colour at angles no first-frame view had. [`refine()`] finds such places by how much colour
//! changes over time (uncertainty), fetches what the first frame shows of the same surface (flow, warp, occlusion test), and fits the SH of the
//! edited splats to it, one offset shared by all times.
//!
//! Promises: unedited splats and all geometry are untouched, bit for bit; the same inputs and seed give the same bits on a deterministic
//! rasteriser whatever the number of threads or interruptions, and whatever the memory budget as long as it holds the images; every loss and
//! gradient is checked against finite differences. The passes ([`render_flow`], [`render_uncertainty`], [`artifact_mask`]), the losses
//! ([`loss`]) and [`Adam`] are usable alone. Works over any [`gs_core::Rasterizer`]; who has the images on a device can do Adam's steps there
//! ([`DescentEngine`]).
//!
//! Conventions: pixels as in [`gs_core::Camera::project`]; images row-major, channels innermost; losses are means over the whole image.
//!
//! Deliberately absent: files (bytes of `.flo` and a colour-wheel picture are made here, stored elsewhere), GPU code, anchors and motion.
//!
//! ```
//! use cuar::{NoObserver, RefineOptions, Views, refine};
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
//! let refined = refine(&raster, &scene, &edited, &views, &options, None, &mut NoObserver)?;
//! let better = refined.scene(&scene); // a DynamicScene
//! assert_eq!(better.num_splats(), scene.num_splats());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod adam;
mod carried;
mod descent;
mod descent_image;
mod engine;
mod error;
mod flow;
mod flow_files;
pub mod loss;
mod options;
mod plan;
mod problem;
mod refine;
mod regression;
mod report;
mod sample;
mod scene;
mod splat_visibility;
mod state;
mod supervision;
mod trust;
mod uncertainty;
mod visit;
mod warp;

pub use adam::Adam;
pub use descent_image::{Crop, DescentImage, Entry};
pub use engine::{Backend, DescentEngine, DescentTask};
pub use error::CuarError;
pub use flow::{Flow, displacements, render_flow};
pub use flow_files::{decode_flo, encode_flo, flow_wheel};
pub use options::{AdamParams, Preset, RefineOptions, RegressionParams, Solver};
pub use plan::{ViewTime, Views};
pub use problem::TracePoint;
pub use refine::{Refined, refine, refine_with};
pub use report::Report;
pub use scene::OffsetScene;
pub use state::{NoObserver, Observer, Preview, Progress, State};
pub use trust::{Doubt, Trust};
pub use uncertainty::{artifact_mask, color_uncertainty, render_uncertainty};
pub use warp::{WarpForm, WarpParams};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
