//! [`PolynomialScene`]: splats whose centres are cubic polynomials of time, as in Spacetime
//! Gaussians and `.splatv` files.

use gs_core::{DynamicScene, SceneError, Splats, SplatsError, TimeRange, activation, quat};
use rayon::prelude::*;
use thiserror::Error;

/// Motion of one splat. With `dt = t − centre`: centre of the splat
/// `mean + v₁·dt + v₂·dt² + v₃·dt³`, rotation `normalise(quat + ω·dt)`, opacity
/// `α·exp(−(dt/width)²)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Polynomial {
    /// `v₁, v₂, v₃`, world units per unit of time to the first, second and third power.
    pub velocity: [[f32; 3]; 3],
    /// `ω`, change of the quaternion (wxyz, added before it is normalised) per unit of time.
    pub omega: [f32; 4],
    /// Time at which the splat has its stored parameters.
    pub centre: f32,
    /// Time from the centre at which opacity has fallen to 1/e of its
    /// peak; infinite for splats that do not fade.
    pub width: f32,
}

/// Error of building a [`PolynomialScene`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PolynomialError {
    /// The arrays of the splats have inconsistent lengths.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// The number of motions or windows differs from the number of splats.
    #[error("polynomials: {found} motions or windows for {expected} splats")]
    Rows {
        /// Number of motions or windows.
        found: usize,
        /// Number of splats.
        expected: usize,
    },
}

/// Opacities are clamped to this distance from 0 and 1, so that their logits are finite. Far below
/// 1/255, the smallest alpha that is drawn.
const OPACITY_MARGIN: f32 = 1e-6;

/// Limits of fading, the same for all splats of a scene.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FadeLimits {
    /// Lower bound of the opacity; 0 for none.
    pub floor: f32,
    /// A splat is not drawn where its fading factor
    /// `exp(−(dt/width)²)` is at most this; 0 for no cutoff.
    pub cutoff: f32,
}

/// Splats at times 0 to 1, each moving along its own polynomial and fading in and out around its
/// own time.
#[derive(Debug, Clone, PartialEq)]
pub struct PolynomialScene {
    rest: Splats,
    motions: Vec<Polynomial>,
    limits: FadeLimits,
    /// Start and end time of each splat, the end excluded; empty if all exist at all times.
    windows: Vec<[f32; 2]>,
    clock: [f64; 2],
    num_frames: Option<usize>,
}

impl PolynomialScene {
    /// A scene from the splats at their own centre times, and their motions, `[N]`.
    ///
    /// # Errors
    /// If the arrays have inconsistent lengths.
    pub fn new(rest: Splats, motions: Vec<Polynomial>) -> Result<Self, PolynomialError> {
        rest.check_shapes()?;
        if motions.len() != rest.len() {
            return Err(PolynomialError::Rows { found: motions.len(), expected: rest.len() });
        }
        Ok(Self {
            rest,
            motions,
            limits: FadeLimits::default(),
            windows: Vec::new(),
            clock: [0.0, 1.0],
            num_frames: None,
        })
    }

    /// The scene with these limits of fading.
    #[must_use]
    pub fn with_fade_limits(self, limits: FadeLimits) -> Self {
        Self { limits, ..self }
    }

    /// The scene whose splats exist in half-open time windows `[start, end)`,
    /// `[N, 2]`, in the time unit of the motions.
    ///
    /// # Errors
    /// If the number of windows differs from the number of splats.
    pub fn with_windows(self, windows: Vec<[f32; 2]>) -> Result<Self, PolynomialError> {
        if windows.len() != self.rest.len() {
            return Err(PolynomialError::Rows { found: windows.len(), expected: self.rest.len() });
        }
        Ok(Self { windows, ..self })
    }

    /// Whether a splat exists at time `t` of the motions' clock.
    fn exists(&self, row: usize, t: f64) -> bool {
        let within = |[first, last]: &[f32; 2]| f64::from(*first) <= t && t < f64::from(*last);
        self.windows.get(row).is_none_or(within)
    }

    /// The scene with motions in a different clock, where the scene's times 0 to 1 are `start` to
    /// `end`. Stored times are used unconverted, which avoids a second rounding.
    #[must_use]
    pub fn with_clock(self, start: f64, end: f64) -> Self {
        Self { clock: [start, end], ..self }
    }

    /// The scene with the number of frames of its source.
    #[must_use]
    pub fn with_frames(self, num_frames: usize) -> Self {
        Self { num_frames: Some(num_frames), ..self }
    }

    /// Time of the motions' clock at scene time `t`.
    pub(crate) fn clock_time(&self, t: f32) -> f64 {
        let [start, end] = self.clock;
        start + f64::from(t) * (end - start)
    }

    /// The splats at their own centre times.
    pub fn rest(&self) -> &Splats {
        &self.rest
    }

    /// The motions of the splats.
    pub fn motions(&self) -> &[Polynomial] {
        &self.motions
    }

    fn check(&self, t: f32) -> Result<(), SceneError> {
        let range = self.time_range();
        if range.contains(t) { Ok(()) } else { Err(SceneError::Time { t, range }) }
    }
}

impl Polynomial {
    fn mean(&self, rest: [f32; 3], t: f64) -> [f32; 3] {
        let dt = t - f64::from(self.centre);
        [0, 1, 2].map(|k| {
            let [v1, v2, v3] = [0, 1, 2].map(|power| f64::from(self.velocity[power][k]));
            #[expect(clippy::cast_possible_truncation, reason = "positions are single precision")]
            let value = (f64::from(rest[k]) + dt * (v1 + dt * (v2 + dt * v3))) as f32;
            value
        })
    }

    /// Time since the centre, single precision.
    fn since(&self, t: f64) -> f32 {
        #[expect(clippy::cast_possible_truncation, reason = "rotations and opacities are single")]
        let dt = (t - f64::from(self.centre)) as f32;
        dt
    }

    fn quat(&self, rest: [f32; 4], t: f64) -> [f32; 4] {
        let dt = self.since(t);
        quat::normalize([0, 1, 2, 3].map(|k| rest[k] + self.omega[k] * dt))
    }

    fn logit(&self, rest: f32, t: f64, limits: FadeLimits) -> f32 {
        let fade = (-(self.since(t) / self.width).powi(2)).exp();
        let drawn = limits.cutoff == 0.0 || fade > limits.cutoff;
        let opacity = if drawn { activation::sigmoid(rest) * fade } else { 0.0 };
        let opacity = opacity.max(limits.floor);
        activation::logit(opacity.clamp(OPACITY_MARGIN, 1.0 - OPACITY_MARGIN))
    }
}

impl DynamicScene for PolynomialScene {
    fn num_splats(&self) -> usize {
        self.rest.len()
    }

    fn sh_degree(&self) -> usize {
        self.rest.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn num_frames(&self) -> Option<usize> {
        self.num_frames
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.geometry_into(t, out)?;
        let (t, limits) = (self.clock_time(t), self.limits);
        let logits = self.motions.par_iter().zip(&self.rest.opacity_logits).enumerate();
        logits
            .map(|(row, (motion, &rest))| {
                let rest = if self.exists(row, t) { rest } else { f32::NEG_INFINITY };
                motion.logit(rest, t, limits)
            })
            .collect_into_vec(&mut out.opacity_logits);
        out.sh.clone_from(&self.rest.sh);
        out.sh_degree = self.rest.sh_degree;
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.check(t)?;
        let t = self.clock_time(t);
        let means = self.motions.par_iter().zip(&self.rest.means);
        means.map(|(motion, &rest)| motion.mean(rest, t)).collect_into_vec(&mut out.means);
        let quats = self.motions.par_iter().zip(&self.rest.quats);
        quats.map(|(motion, &rest)| motion.quat(rest, t)).collect_into_vec(&mut out.quats);
        out.log_scales.clone_from(&self.rest.log_scales);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(width: f32) -> PolynomialScene {
        let rest = Splats {
            means: vec![[1.0, 2.0, 3.0]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[-1.0; 3]],
            opacity_logits: vec![0.0],
            sh: vec![[0.5; 3]],
            sh_degree: 0,
        };
        let motion = Polynomial {
            velocity: [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]],
            omega: [0.0, 2.0, 0.0, 0.0],
            centre: 0.5,
            width,
        };
        PolynomialScene::new(rest, vec![motion]).unwrap()
    }

    #[test]
    fn follows_the_formulas() {
        let splats = one(0.5).at(1.0).unwrap();
        assert_eq!(splats.means[0], [1.5, 2.5, 3.5], "1 + 1/2, 2 + 2/4, 3 + 4/8");
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert!((splats.quats[0][0] - half).abs() < 1e-6, "normalise(1, 1, 0, 0)");
        assert!((splats.opacity(0) - 0.5 * (-1.0_f32).exp()).abs() < 1e-6, "faded to 1/e");
        assert_eq!(one(0.5).at(0.5).unwrap().means[0], [1.0, 2.0, 3.0], "at its centre");
    }

    #[test]
    fn splats_of_infinite_width_do_not_fade_and_opacity_is_finite() {
        for t in [0.0, 0.5, 1.0] {
            let splats = one(f32::INFINITY).at(t).unwrap();
            assert!((splats.opacity(0) - 0.5).abs() < 1e-6, "always there");
        }
        let gone = one(1e-3).at(0.0).unwrap();
        assert!(gone.is_finite(0) && gone.opacity(0) < 1e-5, "faded, but finite");
    }

    #[test]
    fn floor_cutoff_and_clock_are_applied() {
        let faded = |limits| one(0.25).with_fade_limits(limits).at(1.0).unwrap().opacity(0);
        let exact = 0.5 * (-4.0_f32).exp();
        assert!((faded(FadeLimits::default()) - exact).abs() < 1e-6, "neither");
        assert!((faded(FadeLimits { floor: 0.1, cutoff: 0.0 }) - 0.1).abs() < 1e-6, "floor");
        assert!(faded(FadeLimits { floor: 0.0, cutoff: 0.05 }) < 1e-5, "cut off");
        assert!((faded(FadeLimits { floor: 0.0, cutoff: 0.01 }) - exact).abs() < 1e-6, "above");
        let clock = one(0.5).with_clock(-0.5, 1.5).with_frames(7);
        assert_eq!(clock.at(0.5).unwrap(), one(0.5).at(0.5).unwrap(), "the middle");
        assert_eq!(clock.at(0.75).unwrap(), one(0.5).at(1.0).unwrap(), "its window ends earlier");
        assert_eq!(clock.num_frames(), Some(7), "frames");
        let windowed = one(f32::INFINITY).with_windows(vec![[0.25, 0.75]]).unwrap();
        let opacity = |t: f32| windowed.at(t).unwrap().opacity(0);
        assert!((opacity(0.25) - 0.5).abs() < 1e-6, "from its start time");
        assert!(opacity(0.2) < 1e-5 && opacity(0.75) < 1e-5, "until before its end time");
        assert!(one(1.0).with_windows(Vec::new()).is_err(), "a window each");
    }

    #[test]
    fn bad_parts_and_times_are_refused() {
        let scene = one(1.0);
        assert!(PolynomialScene::new(scene.rest.clone(), Vec::new()).is_err(), "a motion each");
        assert!(scene.at(1.5).is_err() && scene.at(f32::NAN).is_err(), "outside");
        let mut out = Splats::default();
        scene.geometry_into(0.3, &mut out).unwrap();
        assert_eq!(out.means, scene.at(0.3).unwrap().means, "geometry alone agrees");
    }
}
