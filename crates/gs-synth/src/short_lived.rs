//! [`ShortLivedScene`]: a figure whose splats are visible only for a part of the clip, as in
//! Spacetime Gaussians and native 4D Gaussians.
//!
//! Every splat has its own position on the true surface. A short-lived splat is there at its centre
//! time `c`, moves in a straight line with the surface's velocity at `c`, and its opacity is
//! multiplied by `exp(−½((t − c)/σ)²)`. Where one generation has faded, others represent the same
//! surface.

use crate::{
    SynthError, SynthScene,
    assemble::{Flaws, Group, assemble},
    body::Body,
    dance::Dance,
    math::{normal3, rng, uniform, wide},
    skeleton::{Attach, BoneMotions, Skeleton},
};
use glam::{Quat, Vec3};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, activation, quat};
use gs_deform::{Polynomial, PolynomialScene};
use std::ops::RangeInclusive;

/// Standard deviations in a visible lifetime, during which opacity is above a twentieth of its
/// peak.
const SIGMAS_PER_LIFE: f32 = 4.896;
/// Half the time over which velocities are taken, shares of the clip.
const VELOCITY_STEP: f64 = 1e-3;
/// Centre times lie this far beyond both ends of the clip, so that both ends are covered, too.
const BEYOND: f32 = 0.1;
/// Logit of a completely faded splat: an opacity of 1e-6.
const FADED_LOGIT: f32 = -13.8;

/// Parameters of a [`ShortLivedScene`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortLivedParams {
    /// Number of splats, at least 1 000.
    pub num_splats: usize,
    /// Random seed.
    pub seed: u64,
    /// Share of short-lived splats, 0–1.
    pub share: f32,
    /// Shortest and longest visible lifetime, shares of the clip.
    pub lifetimes: [f32; 2],
    /// Distance of the generations from the true surface, root mean square per axis, figure sizes.
    pub jitter: f32,
}

impl Default for ShortLivedParams {
    fn default() -> Self {
        Self { num_splats: 6_000, seed: 0, share: 0.8, lifetimes: [0.05, 0.3], jitter: 0.001 }
    }
}

impl ShortLivedParams {
    /// Values that are accepted for `num_splats`.
    pub const NUM_SPLATS: RangeInclusive<usize> = 1_000..=10_000_000;

    fn check(&self) -> Result<(), SynthError> {
        if !Self::NUM_SPLATS.contains(&self.num_splats) {
            return Err(SynthError::param("num_splats", self.num_splats, "1000 to 10 million"));
        }
        if !(0.0..=1.0).contains(&self.share) {
            return Err(SynthError::param("share", self.share, "0 to 1"));
        }
        let [low, high] = self.lifetimes;
        if !(low > 0.0 && low <= high && high <= 10.0) {
            return Err(SynthError::param("lifetimes", low, "above 0, ascending, at most 10"));
        }
        if !(0.0..=0.1).contains(&self.jitter) {
            return Err(SynthError::param("jitter", self.jitter, "0 to 0.1"));
        }
        Ok(())
    }
}

/// Lifetime and motion of a short-lived splat.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Life {
    centre: f32,
    sigma: f32,
    /// Centre at the centre time.
    mean: Vec3,
    velocity: Vec3,
    quat: [f32; 4],
    log_scales: [f32; 3],
}

/// A figure with mostly short-lived splats.
#[derive(Debug, Clone, PartialEq)]
pub struct ShortLivedScene {
    /// The same splats, lasting for the whole clip.
    pub(crate) lasting: SynthScene,
    lifetimes: Vec<Option<Life>>,
}

impl ShortLivedScene {
    /// The figure of the demo, with surface splats only, as short-lived splats.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn figure(params: &ShortLivedParams) -> Result<Self, SynthError> {
        Self::of_bodies(crate::figure::bodies(), params)
    }

    pub(crate) fn of_bodies(
        bodies: Vec<Body>,
        params: &ShortLivedParams,
    ) -> Result<Self, SynthError> {
        params.check()?;
        let groups = [Group { bodies, num_surface: params.num_splats, num_interior: 0 }];
        let skeleton = Skeleton { dance: Dance::default() };
        let mut lasting = assemble(skeleton, &groups, Flaws::default(), 1, params.seed);
        let mut draw = rng(params.seed, 20);
        let times: Vec<Option<(f32, f32)>> = (0..params.num_splats)
            .map(|_| {
                let is_brief = uniform(&mut draw, 0.0, 1.0) < params.share;
                let centre = uniform(&mut draw, -BEYOND, 1.0 + BEYOND);
                let life = uniform(&mut draw, params.lifetimes[0], params.lifetimes[1]);
                is_brief.then_some((centre, life / SIGMAS_PER_LIFE))
            })
            .collect();
        // The splats visible at a time cover the surface: fewer splats are larger.
        let presence = |life: &Option<(f32, f32)>| {
            life.map_or(1.0, |(_, sigma)| sigma * 2.507 / (1.0 + 2.0 * BEYOND))
        };
        let seen = times.iter().map(presence).sum::<f32>() / times.len() as f32;
        let grow = -0.5 * seen.max(1e-3).ln();
        for log_scale in &mut lasting.frame1.log_scales {
            // Discs grow in their plane.
            let thin = (0..3).min_by(|&a, &b| log_scale[a].total_cmp(&log_scale[b])).unwrap_or(0);
            for axis in (0..3).filter(|&axis| axis != thin) {
                log_scale[axis] += grow;
            }
        }
        let jitter = params.jitter * lasting.figure_size;
        let lifetimes = times
            .into_iter()
            .enumerate()
            .map(|(row, life)| {
                let (offset, turn) = (normal3(&mut draw) * jitter, normal3(&mut draw) * 0.05);
                let (centre, sigma) = life?;
                Some(life_of(&lasting, row, (centre, sigma), offset, turn))
            })
            .collect();
        Ok(Self { lasting, lifetimes })
    }

    /// The same splats, lasting for the whole clip, exactly on the surface.
    pub fn lasting(&self) -> &SynthScene {
        &self.lasting
    }

    /// The same scene as splats that move along lines and fade, as trainers store it; `None` if some
    /// splats last for the whole clip, because those do not move along lines.
    pub fn lines(&self) -> Option<PolynomialScene> {
        let lifetimes = self.lifetimes.iter().copied().collect::<Option<Vec<Life>>>()?;
        let rest = Splats {
            means: lifetimes.iter().map(|life| life.mean.into()).collect(),
            quats: lifetimes.iter().map(|life| life.quat).collect(),
            log_scales: lifetimes.iter().map(|life| life.log_scales).collect(),
            ..self.lasting.frame1.clone()
        };
        let motions = lifetimes.iter().map(|life| Polynomial {
            velocity: [life.velocity.into(), [0.0; 3], [0.0; 3]],
            omega: [0.0; 4],
            centre: life.centre,
            width: std::f32::consts::SQRT_2 * life.sigma,
        });
        PolynomialScene::new(rest, motions.collect()).ok()
    }

    /// Largest extent of the figure at frame 1, world units.
    pub fn figure_size(&self) -> f32 {
        self.lasting.figure_size()
    }

    /// Opacity at `t` divided by its peak.
    fn presence(&self, row: usize, t: f32) -> f32 {
        self.lifetimes[row]
            .map_or(1.0, |life| (-0.5 * ((t - life.centre) / life.sigma).powi(2)).exp())
    }
}

fn life_of(
    lasting: &SynthScene,
    row: usize,
    (centre, sigma): (f32, f32),
    offset: Vec3,
    turn: Vec3,
) -> Life {
    let attach = lasting.rows[row].attach;
    let frame1 = &lasting.frame1;
    let c = f64::from(centre);
    let at = |t: f64| lasting.skeleton.motion(t).point(attach, wide(frame1.means[row]));
    let velocity = (at(c + VELOCITY_STEP) - at(c - VELOCITY_STEP)) / (2.0 * VELOCITY_STEP);
    let moved = lasting.skeleton.motion(c).splat(
        attach,
        frame1.means[row],
        frame1.quats[row],
        frame1.log_scales[row],
    );
    Life {
        centre,
        sigma,
        mean: Vec3::from(moved.mean) + offset,
        velocity: velocity.as_vec3(),
        quat: quat::mul(quat::from_glam(Quat::from_scaled_axis(turn)), moved.quat),
        log_scales: moved.log_scales,
    }
}

/// Motion of a bone since frame 1.
pub(crate) fn bone_motion(frame: &BoneMotions, attach: Attach) -> crate::pose::Pose {
    frame.pose(attach)
}

impl DynamicScene for ShortLivedScene {
    fn num_splats(&self) -> usize {
        self.lasting.num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.lasting.sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.lasting.at_into(t, out)?;
        for (row, life) in self.lifetimes.iter().enumerate() {
            let Some(life) = life else { continue };
            out.means[row] = (life.mean + life.velocity * (t - life.centre)).into();
            out.quats[row] = life.quat;
            out.log_scales[row] = life.log_scales;
            let opacity = activation::sigmoid(out.opacity_logits[row]) * self.presence(row, t);
            out.opacity_logits[row] =
                if opacity > 1e-6 { activation::logit(opacity) } else { FADED_LOGIT };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generations_lie_on_the_same_surface() {
        let params =
            ShortLivedParams { num_splats: 2_000, jitter: 0.0, ..ShortLivedParams::default() };
        let scene = ShortLivedScene::figure(&params).unwrap();
        let size = scene.figure_size();
        for t in [0.0, 0.4, 1.0] {
            let (now, truth) = (scene.at(t).unwrap(), scene.lasting().at(t).unwrap());
            let mut visible = 0;
            for row in 0..now.len() {
                if now.opacity(row) < 0.5 {
                    continue;
                }
                visible += 1;
                let miss = Vec3::from(now.means[row]).distance(Vec3::from(truth.means[row]));
                // A splat moves in a straight line, the surface does not: up to 3 % difference.
                assert!(miss < 0.04 * size, "row {row} at {t}: {miss}");
            }
            assert!(visible > 400 && visible < 1_400, "{visible} of 2000 at {t}");
        }
        // Negative control: faded splats are elsewhere.
        let (first, last) = (scene.at(0.0).unwrap(), scene.lasting().at(0.0).unwrap());
        let astray = (0..first.len())
            .filter(|&row| {
                Vec3::from(first.means[row]).distance(Vec3::from(last.means[row])) > 0.05 * size
            })
            .count();
        assert!(astray > 200, "{astray}");
    }

    #[test]
    fn short_lived_splats_move_along_lines() {
        let params =
            ShortLivedParams { num_splats: 1_000, share: 1.0, ..ShortLivedParams::default() };
        let scene = ShortLivedScene::figure(&params).unwrap();
        let lines = scene.lines().unwrap();
        for t in [0.0, 0.6, 1.0] {
            let (expected, found) = (scene.at(t).unwrap(), lines.at(t).unwrap());
            for row in 0..found.len() {
                let off = Vec3::from(found.means[row]).distance(Vec3::from(expected.means[row]));
                assert!(off < 1e-5, "row {row} at {t}: {off}");
                let off = (found.opacity(row) - expected.opacity(row)).abs();
                assert!(off < 1e-5, "opacity of row {row} at {t}: {off}");
            }
            assert_eq!(found.sh, expected.sh, "colours at {t}");
        }
        let some_last =
            ShortLivedScene::figure(&ShortLivedParams { share: 0.9, ..params }).unwrap();
        assert!(some_last.lines().is_none(), "splats that last are not on lines");
    }

    #[test]
    fn parameters_are_checked() {
        let wrong = |params: ShortLivedParams| ShortLivedScene::figure(&params).is_err();
        let usual = ShortLivedParams::default();
        assert!(wrong(ShortLivedParams { share: 1.5, ..usual }), "share");
        assert!(wrong(ShortLivedParams { lifetimes: [0.3, 0.1], ..usual }), "lifetimes");
        assert!(wrong(ShortLivedParams { num_splats: 10, ..usual }), "size");
    }
}
