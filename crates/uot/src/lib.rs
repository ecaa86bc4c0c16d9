//! Entropic unbalanced optimal transport.
//!
//! # Objective
//!
//! For a cost `D` (`[n, m]`, rows = sources, columns = edited points) and marginals `a` `[n]`, `b` `[m]` (uniform,
//! `1/n` and `1/m`, unless given), [`Sinkhorn`] minimises over `P ≥ 0`
//!
//! ```text
//! ⟨D, P⟩ + λ0 KL(P ‖ a bᵀ) + λ1 KL(P1 ‖ a) + λ2 KL(Pᵀ1 ‖ b),     KL(x ‖ y) = Σ x ln(x/y) − x + y
//! ```
//!
//! The entropy term is *added*, so the problem is strictly convex and has one solution. (Eq. 22 of the Catalyst4D
//! paper prints it with a minus sign; that problem is not convex and no Sinkhorn iteration solves it.) The reference
//! measure is `a bᵀ`; [`EntropyReference`] names two others. λ0, λ1, λ2 are [`SinkhornParams::lambda_ent`],
//! [`SinkhornParams::lambda_a`] and [`SinkhornParams::lambda_b`].
//!
//! # Two ways to state the cost
//!
//! * [`UotProblem::from_cost`]: any finite matrix. Runs in the log domain where exponentials would underflow.
//! * [`UotProblem::welsch`]: the bounded cost `1 − exp(−r²/(2β²))` of two point clouds in any dimension (Eq. 21).
//!   All far pairs cost the same, so the kernel is a constant plus a sparse near field; nothing of size `n·m` is built.
//!
//! ```
//! use uot::{Sinkhorn, SinkhornParams, UotProblem, WelschParams};
//!
//! let src = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
//! let edit = [[1.9, 0.1], [0.1, 0.0]];
//! let problem = UotProblem::welsch(&src, &edit, &WelschParams::default())?;
//! let out = Sinkhorn::new(SinkhornParams::default())?.solve(&problem)?;
//! assert!(out.converged);
//! assert_eq!(out.correspondence(&problem)?.rows, [2, 0]);
//! # Ok::<(), uot::UotError>(())
//! ```
//!
//! # Promises
//!
//! * Results are bit-identical for any number of threads, and the structured solver's for any order of the points.
//! * Not converging is data ([`UotOutput::converged`], [`UotOutput::residuals`]), never an error.
//! * Hostile input (empty, NaN, infinite, absurd sizes) gives a [`UotError`].
//!
//! Deliberately absent: Gaussians, images, file formats, any vector-maths type.

mod anderson;
mod correspondence;
mod error;
mod kernel;
mod median;
mod near;
mod output;
mod params;
mod points;
mod problem;
mod simd;
mod sinkhorn;
mod sweeps;
mod tree;

pub use correspondence::{Correspondence, TopRow};
pub use error::UotError;
pub use median::{MAX_EXACT_PAIRS, MedianDistance, median_distance};
pub use output::UotOutput;
pub use params::{
    Acceleration, Bandwidth, EntropyReference, MedianMode, SinkhornParams, Storage, WelschParams,
};
pub use problem::{UotProblem, WelschScale};
pub use sinkhorn::{Sinkhorn, solve};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
