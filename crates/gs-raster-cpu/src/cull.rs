//! Exact culling: the pixel rows of a tile column that a splat can affect, inside its 3σ rectangle.

use crate::project::Projected;
use gs_core::Real;
use gs_core::image_formation::ALPHA_THRESHOLD;

/// The set of points where a splat's alpha is at least 1/255: `A x² + 2B x y +
/// C y² ≤ τ` about its centre, slightly enlarged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reach<F> {
    /// Half extents of the ellipse, pixels.
    pub extent: [F; 2],
    tau: F,
    /// Slope of the line of midpoints of vertical chords, `−B/C`.
    shear: F,
    /// x of the topmost point relative to the centre.
    x_top: F,
    inverse_c: F,
    inverse_a: F,
}

impl<F: Real> Reach<F> {
    /// `None` if alpha is below 1/255 everywhere.
    ///
    /// The margin exceeds the rounding error of the pixel stage, which grows with
    /// the condition number of the conic: culling must never remove a sample that
    /// would be drawn. A larger margin only costs time.
    #[inline(always)]
    pub(crate) fn new(p: &Projected<F>) -> Option<Self> {
        let tau = F::of(2.0) * (p.log_opacity - F::of(ALPHA_THRESHOLD).ln());
        let [a, b, c] = p.conic;
        let condition = a * p.spread[0];
        let margin = F::of(1e-3) + F::of(16.0) * F::epsilon() * condition;
        let tau = tau + margin * (F::one() + tau.abs());
        // Also false for NaN: a splat with NaN opacity draws nothing.
        let drawn = tau > F::zero();
        if !drawn {
            return None;
        }
        let extent = [(tau * p.spread[0]).sqrt(), (tau * p.spread[1]).sqrt()];
        Some(Self {
            extent,
            tau,
            shear: -b / c,
            x_top: -b * extent[1] / a,
            inverse_c: F::one() / c,
            inverse_a: F::one() / p.spread[0],
        })
    }

    /// Range of y about the centre where the ellipse meets the slab `left ≤ x ≤ right` about the
    /// centre; `None` if it does not.
    #[inline(always)]
    pub(crate) fn rows(&self, left: F, right: F) -> Option<(F, F)> {
        let [ex, ey] = self.extent;
        if left > ex || right < -ex {
            return None;
        }
        let (left, right) = (left.max(-ex), right.min(ex));
        let half_chord =
            |x: F| ((self.tau - x * x * self.inverse_a).max(F::zero()) * self.inverse_c).sqrt();
        let (mid_l, half_l) = (self.shear * left, half_chord(left));
        let (mid_r, half_r) = (self.shear * right, half_chord(right));
        let inside = |x: F| left <= x && x <= right;
        let top = if inside(self.x_top) { ey } else { (mid_l + half_l).max(mid_r + half_r) };
        let bottom = if inside(-self.x_top) { -ey } else { (mid_l - half_l).min(mid_r - half_r) };
        Some((bottom, top))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force over a fine grid: no point of the ellipse in the slab lies outside the rows, and
    /// the rows are tight.
    #[test]
    fn rows_enclose_the_ellipse_tightly() {
        for (a, b, c) in [(3.0_f64, 0.0, 3.0), (40.0, 18.0, 9.0), (5.0, -14.0, 60.0)] {
            let det = a * c - b * b;
            let p = Projected {
                conic: [c / det, -b / det, a / det],
                spread: [a, c],
                log_opacity: 0.8_f64.ln(),
                ..Projected::default()
            };
            let reach = Reach::new(&p).unwrap();
            let tau = reach.tau;
            for (left, right) in
                [(-30.0, 30.0), (-4.0, 1.0), (1.5, 3.0), (-9.0, -6.0), (11.0, 26.0)]
            {
                let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
                for i in 0..=600 {
                    let x: f64 = left + (right - left) * f64::from(i) / 600.0;
                    for j in -4000..=4000 {
                        let y = f64::from(j) / 100.0;
                        let q = p.conic[0] * x * x + 2.0 * p.conic[1] * x * y + p.conic[2] * y * y;
                        if q <= tau {
                            low = low.min(y);
                            high = high.max(y);
                        }
                    }
                }
                match reach.rows(left, right) {
                    None => assert!(low > high, "slab {left}..{right} was culled but is reached"),
                    Some((bottom, top)) if low <= high => {
                        assert!(bottom <= low + 1e-9 && top >= high - 1e-9, "slab {left}..{right}");
                        assert!(low - bottom < 0.3 && top - high < 0.3, "loose: {bottom} {low}");
                    }
                    Some((bottom, top)) => assert!(top - bottom < 2.0, "slab {left}..{right}"),
                }
            }
        }
    }

    #[test]
    fn faint_splats_are_culled() {
        let reaches = |log_opacity: f32| {
            let (conic, spread) = ([1.0, 0.0, 1.0], [1.0; 2]);
            Reach::new(&Projected { conic, spread, log_opacity, ..Projected::default() }).is_some()
        };
        assert!(!reaches(0.003_f32.ln()), "below 1/255");
        assert!(!reaches(0.0_f32.ln()), "transparent");
        assert!(!reaches(f32::NAN), "not a number");
        assert!(reaches(0.01_f32.ln()), "above 1/255");
    }
}
