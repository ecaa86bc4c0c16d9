//! Parameters of the solver and of the Welsch cost.

use crate::UotError;
use crate::entropy_reference::EntropyReference;

/// Acceleration of the fixed-point sweeps. All converge to the same plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Acceleration {
    /// Anderson mixing; over-relaxation for structured costs with `lambda_ent < 0.05`. Switches to
    /// the other if one stalls.
    #[default]
    Auto,
    /// Alternating sweeps without acceleration. Slowest; the objective decreases monotonically.
    Plain,
    /// Over-relaxation with the optimal factor for the contraction bound.
    OverRelaxed,
    /// Anderson mixing of up to 12 differences, and the optimal translation in closed form.
    Anderson,
}

/// ε-scaling: a sequence of decreasing entropy weights before the requested one, each started from
/// the potentials of the previous one.
///
/// Without it, a small λ0 needs of the order of (largest cost)/λ0 sweeps; with it, a few per
/// halving of the weight. Applies to explicit and sparse costs; the structured Welsch cost is
/// bounded and does not need it. If both marginals are enforced and costs are a thousand λ0 or
/// more, the problem is nearly a linear programme, and convergence to a small tolerance is slow.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum EpsilonScaling {
    /// From a tenth of the range of the costs, by factors of four, where that range exceeds 50 λ0.
    #[default]
    Auto,
    /// No scaling: the requested weight from the start.
    Off,
    /// A sequence given by the caller.
    From {
        /// First weight, cost units. Without effect unless it is above λ0.
        init: f64,
        /// Factor from one weight to the next, above 0 and below 1.
        decay: f64,
    },
}

/// Parameters of [`crate::Sinkhorn`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinkhornParams {
    /// λ0, weight of the entropy term, in cost units. Default 0.1.
    pub lambda_ent: f64,
    /// λ1, weight of the row marginal, in cost units; `f64::INFINITY` enforces it exactly. Default
    /// 1.
    pub lambda_a: f64,
    /// λ2, weight of the column marginal, in cost units; `f64::INFINITY` enforces it exactly.
    /// Default 1.
    pub lambda_b: f64,
    /// Reference measure of the entropy term. Default [`EntropyReference::Kl`].
    pub reference: EntropyReference,
    /// Sweeps stop once no potential moves by `tol · lambda_ent` or more. Default 1e-9; 1e-5 is
    /// sufficient for correspondences.
    pub tol: f64,
    /// Sweeps after which the solver stops and reports `converged = false`. Default 20 000.
    pub max_sweeps: usize,
    /// Acceleration of the sweeps. Default [`Acceleration::Auto`].
    pub acceleration: Acceleration,
    /// Sequence of larger entropy weights at the start. Default [`EpsilonScaling::Auto`].
    pub epsilon_scaling: EpsilonScaling,
}

impl Default for SinkhornParams {
    fn default() -> Self {
        Self {
            lambda_ent: 0.1,
            lambda_a: 1.0,
            lambda_b: 1.0,
            reference: EntropyReference::Kl,
            tol: 1e-9,
            max_sweeps: 20_000,
            acceleration: Acceleration::Auto,
            epsilon_scaling: EpsilonScaling::Auto,
        }
    }
}

impl SinkhornParams {
    /// Shares of the row side, λ1/(λ0+λ1+λ2), and of the column side in the common level of the
    /// potentials. A side with an infinite weight has share 1; two such sides have ½ each.
    pub(crate) fn level_shares(&self) -> (f64, f64) {
        match (self.lambda_a.is_infinite(), self.lambda_b.is_infinite()) {
            (true, true) => (0.5, 0.5),
            (true, false) => (1.0, 0.0),
            (false, true) => (0.0, 1.0),
            (false, false) => {
                let all = self.lambda_ent + self.lambda_a + self.lambda_b;
                (self.lambda_a / all, self.lambda_b / all)
            }
        }
    }

    pub(crate) fn validate(&self) -> Result<(), UotError> {
        positive("lambda_ent", self.lambda_ent)?;
        for (name, value) in [("lambda_a", self.lambda_a), ("lambda_b", self.lambda_b)] {
            if value.is_nan() || value <= 0.0 {
                let expected = "a number above zero (infinity enforces the marginal)";
                return Err(UotError::BadParam { name, value, expected });
            }
        }
        if let EpsilonScaling::From { init, decay } = self.epsilon_scaling {
            positive("epsilon_scaling.init", init)?;
            // the number of weights stays below a few thousand
            if !(decay > 0.0 && decay <= 0.99) {
                let (name, expected) = ("epsilon_scaling.decay", "above 0, at most 0.99");
                return Err(UotError::BadParam { name, value: decay, expected });
            }
        }
        if !(self.tol >= 0.0 && self.tol.is_finite()) {
            let expected = "a finite number, zero or above";
            return Err(UotError::BadParam { name: "tol", value: self.tol, expected });
        }
        if self.max_sweeps == 0 {
            let expected = "at least one sweep";
            return Err(UotError::BadParam { name: "max_sweeps", value: 0.0, expected });
        }
        Ok(())
    }
}

/// Width β of the Welsch cost.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Bandwidth {
    /// `β = γ · d_med`, with this γ and the median `d_med` of all pair distances.
    MedianTimes(f64),
    /// This β, unit of the points.
    Fixed(f64),
}

/// Method for the median pair distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum MedianMode {
    /// Exact up to [`crate::MAX_EXACT_PAIRS`] pairs, sampled above (4 million pairs, seed 0).
    #[default]
    Auto,
    /// Exact for any size; O(n+m) memory.
    Exact,
    /// Median of `pairs` pairs drawn with replacement.
    Sampled {
        /// Number of pairs to draw, at least 1.
        pairs: usize,
        /// Random seed.
        seed: u64,
    },
}

/// Number format of the stored near field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Storage {
    /// 8 bytes per entry.
    #[default]
    F64,
    /// 4 bytes per entry; potentials are accurate to 2e-5. Sums are in `f64`.
    F32,
}

/// Parameters of the structured Welsch problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WelschParams {
    /// Width of the cost. Default `MedianTimes(0.05)`.
    pub bandwidth: Bandwidth,
    /// Distance, in units of β, beyond which the cost of a pair may be rounded to 1 (its weight w
    /// is below `exp(−cutoff²/2)`). Default 6: potentials are accurate to 2e-9. 4 is sufficient for
    /// correspondences; 8 equals the dense problem.
    pub cutoff: f64,
    /// Method for the median. Default [`MedianMode::Auto`].
    pub median: MedianMode,
    /// Number format of the near field. Default [`Storage::F64`].
    pub storage: Storage,
}

impl Default for WelschParams {
    fn default() -> Self {
        Self {
            bandwidth: Bandwidth::MedianTimes(0.05),
            cutoff: 6.0,
            median: MedianMode::Auto,
            storage: Storage::F64,
        }
    }
}

impl WelschParams {
    pub(crate) fn validate(&self) -> Result<(), UotError> {
        match self.bandwidth {
            Bandwidth::MedianTimes(gamma) => positive("gamma", gamma)?,
            Bandwidth::Fixed(beta) => positive("beta", beta)?,
        }
        positive("cutoff", self.cutoff)
    }
}

fn positive(name: &'static str, value: f64) -> Result<(), UotError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(UotError::BadParam { name, value, expected: "a finite number above zero" })
    }
}
