//! Entropic unbalanced optimal transport.
//!
//! # Objective
//!
//! For a cost `D` (`[n, m]`) and marginals `a` `[n]`, `b` `[m]` (uniform,
//! `1/n` and `1/m`, unless given), [`Sinkhorn`] minimises over `P ≥ 0`
//!
//! ```text
//! ⟨D, P⟩ + λ0 KL(P ‖ a bᵀ) + λ1 KL(P1 ‖ a) + λ2 KL(Pᵀ1 ‖ b),     KL(x ‖ y) = Σ x ln(x/y) − x + y
//! ```
//!
//! The entropy term is *added*, so the problem is strictly convex and has one solution. The
//! reference measure is `a bᵀ`; [`EntropyReference`] names two others. λ0, λ1, λ2 are
//! [`SinkhornParams::lambda_ent`], [`SinkhornParams::lambda_a`] and [`SinkhornParams::lambda_b`].
//!
//! # Three ways to state the cost
//!
//! * [`UotProblem::from_cost`]: any finite matrix. Uses the log domain if exponentials would
//!   underflow.
//! * [`UotProblem::from_csr`]: costs of candidate pairs; all other pairs are excluded. The result
//!   is read with [`UotOutput::col_posterior`].
//! * [`UotProblem::welsch`]: the bounded cost `1 − exp(−r²/(2β²))` of two point clouds in any
//!   dimension. All far pairs cost the same, so the kernel is a constant plus a sparse near field;
//!   no array of size `n·m` is built.
//!
//! ```
//! use uot::{Sinkhorn, SinkhornParams, UotProblem, WelschParams};
//!
//! let rows = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
//! let cols = [[1.9, 0.1], [0.1, 0.0]];
//! let problem = UotProblem::welsch(&rows, &cols, &WelschParams::default())?;
//! let out = Sinkhorn::new(SinkhornParams::default())?.solve(&problem)?;
//! assert!(out.converged);
//! assert_eq!(out.correspondence(&problem)?.rows, [2, 0]);
//! # Ok::<(), uot::UotError>(())
//! ```
//!
//! An infinite λ1 or λ2 enforces that marginal exactly (balanced, semi-relaxed). Rows and columns
//! may stay unmatched at a given cost ([`UotProblem::with_unmatched_cols`]).
//! [`Sinkhorn::solve_from`] starts from the potentials of a similar problem.
//!
//! # Guarantees
//!
//! * Results are bit-identical for any number of threads, and the structured solver's for any order
//!   of the points.
//! * Non-convergence is reported in the output ([`UotOutput::converged`], [`UotOutput::residuals`])
//!   and is not an error.
//! * Invalid input (empty, NaN, infinite, too large) gives a [`UotError`].
//!
//! Deliberately absent: images, file formats, types of linear-algebra crates.

mod anderson;
mod correspondence;
mod entropy_reference;
mod error;
mod kernel;
mod median;
mod near;
mod output;
mod params;
mod points;
mod posterior;
mod problem;
mod simd;
mod sinkhorn;
mod sparse;
mod sweeps;
mod tree;

pub use correspondence::{Correspondence, NO_ROW, TopRow};
pub use entropy_reference::EntropyReference;
pub use error::UotError;
pub use median::{MAX_EXACT_PAIRS, MedianDistance, median_distance};
pub use output::UotOutput;
pub use params::{
    Acceleration, Bandwidth, EpsilonScaling, MedianMode, SinkhornParams, Storage, WelschParams,
};
pub use posterior::Posterior;
pub use problem::{UotProblem, WelschScale};
pub use sinkhorn::{Sinkhorn, solve};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
