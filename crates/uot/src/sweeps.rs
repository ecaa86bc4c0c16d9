//! The fixed-point iteration on the logarithms of the scalings, and its accelerations.

use crate::anderson::Anderson;
use crate::kernel::Kernel;
use crate::{Acceleration, SinkhornParams};

/// Number of plain sweeps before any acceleration: the first sweeps determine the overall level.
const WARM_UP: usize = 2;
/// Number of plain sweeps after an acceleration has stalled, to leave its cycle.
const RECOVERY: usize = 10;
/// Number of sweeps without a better residual after which the acceleration is changed.
const PATIENCE: usize = 30;
/// Smallest λ0 for which [`Acceleration::Auto`] begins with Anderson mixing on a structured cost,
/// whose range is 1.
const ANDERSON_LAMBDA: f64 = 0.05;
/// Maximum over-relaxation, for enforced marginals, which have no contraction bound.
const MAX_OMEGA: f64 = 1.95;

/// Logarithms of the marginals, and of `e^(−c/λ0)` for sides that may have no counterpart; in the
/// order of the kernel.
#[derive(Debug, Clone)]
pub(crate) struct Sides {
    pub(crate) log_a: Vec<f64>,
    pub(crate) log_b: Vec<f64>,
    pub(crate) unmatched_a: Option<Vec<f64>>,
    pub(crate) unmatched_b: Option<Vec<f64>>,
}

/// Scalings at the end, in the order of the kernel.
#[derive(Debug)]
pub(crate) struct Scalings {
    /// `ln ũ = f/λ0`, `ln ṽ = g/λ0` and `ln K(b ṽ)`, `ln Kᵀ(a ũ)` that belong to them.
    pub(crate) log_u: Vec<f64>,
    pub(crate) log_v: Vec<f64>,
    pub(crate) log_kv: Vec<f64>,
    pub(crate) log_ku: Vec<f64>,
    pub(crate) converged: bool,
    pub(crate) residuals: Vec<f64>,
    pub(crate) matvecs: usize,
}

/// The iteration: marginals, weights and scratch.
pub(crate) struct Sweeps<'k> {
    kernel: &'k mut dyn Kernel,
    sides: Sides,
    /// Whether the costs are explicit, in any unit.
    explicit: bool,
    params: SinkhornParams,
    phi_a: f64,
    phi_b: f64,
    log_u: Vec<f64>,
    log_v: Vec<f64>,
    log_kv: Vec<f64>,
    log_ku: Vec<f64>,
    row_scratch: Vec<f64>,
    col_scratch: Vec<f64>,
    matvecs: usize,
    residuals: Vec<f64>,
}

impl<'k> Sweeps<'k> {
    pub(crate) fn new(
        kernel: &'k mut dyn Kernel,
        sides: Sides,
        log_v: Vec<f64>,
        explicit: bool,
        params: SinkhornParams,
    ) -> Self {
        let (n, m) = (sides.log_a.len(), sides.log_b.len());
        Self {
            kernel,
            sides,
            explicit,
            params,
            phi_a: (1.0 + params.lambda_ent / params.lambda_a).recip(),
            phi_b: (1.0 + params.lambda_ent / params.lambda_b).recip(),
            log_u: vec![0.0; n],
            log_v,
            log_kv: vec![0.0; n],
            log_ku: vec![0.0; m],
            row_scratch: vec![0.0; n],
            col_scratch: vec![0.0; m],
            matvecs: 0,
            residuals: Vec::new(),
        }
    }

    /// Iterates to the tolerance or the limit of sweeps.
    pub(crate) fn run(mut self) -> Scalings {
        let mut converged = self.plain(WARM_UP);
        let mut anderson = match self.params.acceleration {
            Acceleration::Auto => self.explicit || self.params.lambda_ent >= ANDERSON_LAMBDA,
            Acceleration::Anderson => true,
            Acceleration::Plain | Acceleration::OverRelaxed => false,
        };
        // best over-relaxation for a sweep with real eigenvalues in [0, φ1φ2]
        let mut omega = (2.0 / (1.0 + (1.0 - self.phi_a * self.phi_b).sqrt())).min(MAX_OMEGA);
        while !converged && self.left() > 0 {
            converged = match self.params.acceleration {
                Acceleration::Plain => self.plain(self.left()),
                _ if anderson => self.anderson(),
                _ => self.over_relaxed(omega),
            };
            if !converged && self.params.acceleration != Acceleration::Plain {
                if anderson {
                    anderson = self.params.acceleration == Acceleration::Anderson;
                } else {
                    omega = 1.0 + 0.7 * (omega - 1.0);
                    anderson = self.explicit && self.params.acceleration == Acceleration::Auto;
                }
                converged = self.plain(RECOVERY);
            }
        }
        self.finish(converged)
    }

    fn left(&self) -> usize {
        self.params.max_sweeps - self.residuals.len()
    }

    fn record(&mut self, residual: f64) -> bool {
        self.residuals.push(residual);
        residual < self.params.tol
    }

    fn update_kv(&mut self) {
        for ((x, v), b) in self.col_scratch.iter_mut().zip(&self.log_v).zip(&self.sides.log_b) {
            *x = v + b;
        }
        self.kernel.rows(&self.col_scratch, &mut self.log_kv);
        self.matvecs += 1;
    }

    fn update_ku(&mut self) {
        for ((x, u), a) in self.row_scratch.iter_mut().zip(&self.log_u).zip(&self.sides.log_a) {
            *x = u + a;
        }
        self.kernel.cols(&self.row_scratch, &mut self.log_ku);
        self.matvecs += 1;
    }

    /// One half-sweep on each side with step ω; the largest change that a plain step would make.
    fn sweep(&mut self, omega: f64) -> f64 {
        self.update_kv();
        let unmatched = self.sides.unmatched_a.as_deref();
        let change_u = relax(&mut self.log_u, &self.log_kv, unmatched, self.phi_a, omega);
        self.update_ku();
        let unmatched = self.sides.unmatched_b.as_deref();
        let change_v = relax(&mut self.log_v, &self.log_ku, unmatched, self.phi_b, omega);
        change_u.max(change_v)
    }

    fn plain(&mut self, count: usize) -> bool {
        for _ in 0..count.min(self.left()) {
            let residual = self.sweep(1.0);
            if self.record(residual) {
                return true;
            }
        }
        false
    }

    fn over_relaxed(&mut self, omega: f64) -> bool {
        let mut watch = StallDetector::new();
        while self.left() > 0 {
            let residual = self.sweep(omega);
            if self.record(residual) {
                return true;
            }
            if watch.stalled(residual) {
                return false;
            }
        }
        false
    }

    fn anderson(&mut self) -> bool {
        let mut watch = StallDetector::new();
        let mut mixing = Anderson::new();
        let mut iterate = self.log_v.clone();
        while self.left() > 0 {
            self.log_v.copy_from_slice(&iterate);
            self.sweep(1.0);
            let shift = self.translation();
            self.log_v.iter_mut().for_each(|v| *v -= shift);
            let residual = largest_difference(&self.log_v, &iterate).max(shift.abs());
            if self.record(residual) {
                // the unshifted side is consistent with log_u
                self.log_v.iter_mut().for_each(|v| *v += shift);
                return true;
            }
            if watch.stalled(residual) {
                return false;
            }
            mixing.step(&mut iterate, &self.log_v, residual);
        }
        false
    }

    /// Constant by which `f/λ0` should grow and `g/λ0` shrink: the exact maximiser of the dual
    /// along that direction, `t/λ0 = λ1λ2/(λ0(λ1+λ2)) · ln(Σ a e^{−f/λ1} / Σ b e^{−g/λ2})`. 0 if
    /// the dual is constant along it (both marginals enforced) or changes differently (unmatched
    /// costs).
    fn translation(&self) -> f64 {
        let SinkhornParams { lambda_ent, lambda_a, lambda_b, .. } = self.params;
        let Sides { log_a, log_b, unmatched_a, unmatched_b } = &self.sides;
        let both_enforced = lambda_a.is_infinite() && lambda_b.is_infinite();
        if both_enforced || unmatched_a.is_some() || unmatched_b.is_some() {
            return 0.0;
        }
        let row = log_sum_exp(log_a, &self.log_u, -lambda_ent / lambda_a);
        let col = log_sum_exp(log_b, &self.log_v, -lambda_ent / lambda_b);
        (lambda_ent * (lambda_a.recip() + lambda_b.recip())).recip() * (row - col)
    }

    /// One more product, so that the row masses also belong to the returned scalings.
    fn finish(mut self, converged: bool) -> Scalings {
        self.update_kv();
        Scalings {
            log_u: self.log_u,
            log_v: self.log_v,
            log_kv: self.log_kv,
            log_ku: self.log_ku,
            converged,
            residuals: self.residuals,
            matvecs: self.matvecs,
        }
    }
}

/// `x ← x + ω(−φ·k − x)`; returns the largest `|−φ·k − x|`. NaN counts as infinite. A row or column
/// without possible mass gets 0.
fn relax(x: &mut [f64], log_k: &[f64], unmatched: Option<&[f64]>, phi: f64, omega: f64) -> f64 {
    let mut worst = 0.0_f64;
    for (i, (x, &k)) in x.iter_mut().zip(log_k).enumerate() {
        let k = unmatched.map_or(k, |unmatched| log_add(k, unmatched[i]));
        if k == f64::NEG_INFINITY {
            *x = 0.0;
            continue;
        }
        let change = -phi * k - *x;
        worst = if change.is_nan() { f64::INFINITY } else { worst.max(change.abs()) };
        *x += omega * change;
    }
    worst
}

/// `ln(e^x + e^y)`, y finite.
pub(crate) fn log_add(x: f64, y: f64) -> f64 {
    let (high, low) = if x > y { (x, y) } else { (y, x) };
    high + (low - high).exp().ln_1p()
}

fn largest_difference(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// `ln Σ e^{weight_i + factor·value_i}`.
fn log_sum_exp(weights: &[f64], values: &[f64], factor: f64) -> f64 {
    let exponent = |(w, v): (&f64, &f64)| w + factor * v;
    let top = weights.iter().zip(values).map(exponent).fold(f64::NEG_INFINITY, f64::max);
    top + weights.iter().zip(values).map(|pair| (exponent(pair) - top).exp()).sum::<f64>().ln()
}

/// Detects that the best residual has not improved for a while.
struct StallDetector {
    best: f64,
    since: usize,
}

impl StallDetector {
    fn new() -> Self {
        Self { best: f64::INFINITY, since: 0 }
    }

    fn stalled(&mut self, residual: f64) -> bool {
        self.since += 1;
        if residual < self.best {
            self.best = residual;
            self.since = 0;
        }
        self.since >= PATIENCE
    }
}
