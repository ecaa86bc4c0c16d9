//! Reports: one HTML file that opens offline.
//!
//! Pictures are embedded as JPEG and plots as SVG. The page's content security policy forbids all
//! other resources.

mod color_ramp;
mod page;
mod picture;
mod plot;
mod run_report;

pub(crate) use color_ramp::ramp_color;
pub(crate) use page::{MAX_BYTES, Page, escape};
pub(crate) use picture::{Triple, wipe};
pub(crate) use plot::{Curve, Plot};
pub(crate) use run_report::{RunReport, run_report};
