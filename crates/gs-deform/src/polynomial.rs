//! [`PolynomialScene`]: splats whose centres are cubics of time, as Spacetime Gaussians and `.splatv` files have them.

use gs_core::{DynamicScene, SceneError, Splats, SplatsError, TimeRange, activation, quat};
use rayon::prelude::*;
use thiserror::Error;

/// Motion of one splat. With `dt = t − centre`:
/// centre of the splat `mean + v₁·dt + v₂·dt² + v₃·dt³`, rotation `normalise(quat + ω·dt)`, opacity `α·exp(−(dt/width)²)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Polynomial {
    /// `v₁, v₂, v₃`, world units per unit of time to the first, second and third power.
    pub velocity: [[f32; 3]; 3],
    /// `ω`, change of the quaternion (wxyz, added before it is normalised) per unit of time.
    pub omega: [f32; 4],
    /// Time at which the splat is as stored.
    pub centre: f32,
    /// Time from the centre after which opacity has fallen to 1/e; infinite for splats that are always there.
    pub width: f32,
}

/// Parts that do not make a scene.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PolynomialError {
    /// The arrays of the splats disagree.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// Not one motion per splat.
    #[error("polynomials: {found} motions for {expected} splats")]
    Rows {
        /// Motions.
        found: usize,
        /// Splats.
        expected: usize,
    },
}

/// Opacities stay inside (0,1) by this much, so that their logits are finite. Far below the 1/255 under which renderers skip.
const OPACITY_MARGIN: f32 = 1e-6;

/// Splats at times 0 to 1, each moving along its own polynomial and fading in and out around its own time.
#[derive(Debug, Clone, PartialEq)]
pub struct PolynomialScene {
    rest: Splats,
    motions: Vec<Polynomial>,
}

impl PolynomialScene {
    /// A scene from the splats as they are at their centres of time, and their motions, `[N]`.
    ///
    /// # Errors
    /// If the arrays disagree.
    pub fn new(rest: Splats, motions: Vec<Polynomial>) -> Result<Self, PolynomialError> {
        rest.check_shapes()?;
        if motions.len() != rest.len() {
            return Err(PolynomialError::Rows { found: motions.len(), expected: rest.len() });
        }
        Ok(Self { rest, motions })
    }

    /// The splats at their centres of time.
    pub fn rest(&self) -> &Splats {
        &self.rest
    }

    /// Their motions.
    pub fn motions(&self) -> &[Polynomial] {
        &self.motions
    }

    fn check(&self, t: f32) -> Result<(), SceneError> {
        let range = self.time_range();
        if range.contains(t) { Ok(()) } else { Err(SceneError::Time { t, range }) }
    }
}

impl Polynomial {
    fn mean(&self, rest: [f32; 3], t: f32) -> [f32; 3] {
        let dt = f64::from(t) - f64::from(self.centre);
        [0, 1, 2].map(|k| {
            let [v1, v2, v3] = [0, 1, 2].map(|power| f64::from(self.velocity[power][k]));
            #[expect(clippy::cast_possible_truncation, reason = "positions are single precision")]
            let value = (f64::from(rest[k]) + dt * (v1 + dt * (v2 + dt * v3))) as f32;
            value
        })
    }

    fn quat(&self, rest: [f32; 4], t: f32) -> [f32; 4] {
        let dt = t - self.centre;
        quat::normalize([0, 1, 2, 3].map(|k| rest[k] + self.omega[k] * dt))
    }

    fn logit(&self, rest: f32, t: f32) -> f32 {
        let fade = (-((t - self.centre) / self.width).powi(2)).exp();
        let opacity = activation::sigmoid(rest) * fade;
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

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.geometry_into(t, out)?;
        let logits = self.motions.par_iter().zip(&self.rest.opacity_logits);
        logits
            .map(|(motion, &rest)| motion.logit(rest, t))
            .collect_into_vec(&mut out.opacity_logits);
        out.sh.clone_from(&self.rest.sh);
        out.sh_degree = self.rest.sh_degree;
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.check(t)?;
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
    fn infinite_width_never_fades_and_opacity_stays_finite() {
        for t in [0.0, 0.5, 1.0] {
            let splats = one(f32::INFINITY).at(t).unwrap();
            assert!((splats.opacity(0) - 0.5).abs() < 1e-6, "always there");
        }
        let gone = one(1e-3).at(0.0).unwrap();
        assert!(gone.is_finite(0) && gone.opacity(0) < 1e-5, "gone, but finite");
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
