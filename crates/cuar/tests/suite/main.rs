//! Tests of the appearance stage: gradients, solvers, known truth, and edits as editors deliver them.

mod common;
mod fuzzy;
mod gradient;
mod hidden;
mod losses;
mod monocular;
mod placement;
mod solvers;
mod truth;
mod whole_stage;
