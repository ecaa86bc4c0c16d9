//! Share of a scene's splats that are visible at one time, and for how long.

use crate::failure::{Failure, Outcome};
use gs_core::{DynamicScene, Splats};

/// Larger scenes are skipped: sampling them would take longer than the command itself.
const MAX_SPLATS: usize = 500_000;
/// Times at which opacities are sampled.
const SAMPLES: usize = 33;
/// Opacity in 255ths above which a splat is visible, 0.02.
const VISIBLE: u8 = 5;
/// Share of its own largest opacity above which a splat is visible.
const SHARE_OF_PEAK: f32 = 0.05;
/// Share of visible splats below which an edit applies only to a part of the scene.
const MOST: f64 = 0.95;

/// Share of the clip that counts as the whole clip: one sample less.
const WHOLE: f64 = 0.96;

/// Visible splats of a scene whose opacities change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lifetimes {
    /// Splats visible at the given time, as a share of those visible at any time.
    pub(crate) share: f64,
    /// Median of the uninterrupted time around the given time for which these are visible, as a
    /// share of the clip.
    pub(crate) median: f64,
    time: f32,
}

impl Lifetimes {
    /// Samples a scene; `None` if no splat fades or is visible, or the scene is very large.
    pub(crate) fn of(scene: &dyn DynamicScene, time: f32) -> Outcome<Option<Self>> {
        if !scene.fades() || scene.num_splats() > MAX_SPLATS {
            return Ok(None);
        }
        let (n, times) = (scene.num_splats(), scene.time_range().frames(SAMPLES));
        let mut levels = Vec::with_capacity(SAMPLES);
        let mut splats = Splats::default();
        for &t in &times {
            scene.at_into(t, &mut splats).map_err(Failure::bad_input)?;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "opacities lie between 0 and 1; NaN becomes 0"
            )]
            let opacity = |row: usize| (255.0 * splats.opacity(row)) as u8;
            levels.push((0..n).map(opacity).collect::<Vec<u8>>());
        }
        let requested = times.iter().position(|&t| t >= time).unwrap_or(SAMPLES - 1);
        let (mut ever, mut lifetimes) = (0_usize, Vec::new());
        for row in 0..n {
            let peak = levels.iter().map(|levels| levels[row]).max().unwrap_or(0);
            if peak <= VISIBLE {
                continue;
            }
            ever += 1;
            let threshold = f32::from(VISIBLE).max(SHARE_OF_PEAK * f32::from(peak));
            let is_visible = |levels: &&Vec<u8>| f32::from(levels[row]) > threshold;
            if !is_visible(&&levels[requested]) {
                continue;
            }
            let after = levels[requested..].iter().take_while(is_visible).count();
            let before = levels[..requested].iter().rev().take_while(is_visible).count();
            lifetimes.push(after + before - 1);
        }
        if lifetimes.is_empty() {
            return Ok((ever > 0).then_some(Self { share: 0.0, median: 0.0, time }));
        }
        lifetimes.sort_unstable();
        let median = lifetimes[lifetimes.len() / 2] as f64 / (SAMPLES - 1) as f64;
        Ok(Some(Self { share: lifetimes.len() as f64 / ever as f64, median, time }))
    }

    /// Whether an edit at that time applies only to a part of the scene.
    pub(crate) fn is_partial(&self) -> bool {
        self.share < MOST
    }

    /// Text for a report.
    pub(crate) fn describe(&self) -> String {
        let lifetimes = if self.median < WHOLE {
            format!("half of these for at most {:.0} % of the clip", 100.0 * self.median)
        } else {
            "most of these during the whole clip".to_owned()
        };
        format!(
            "{:.0} % of the splats that are ever visible are visible at time {}, {lifetimes}",
            100.0 * self.share,
            self.time
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_deform::{Polynomial, PolynomialScene, StaticScene};

    fn rest(n: usize) -> Splats {
        Splats {
            means: vec![[0.0; 3]; n],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; n],
            log_scales: vec![[-1.0; 3]; n],
            opacity_logits: vec![2.0; n],
            sh: vec![[0.0; 3]; n],
            sh_degree: 0,
        }
    }

    #[test]
    fn short_lived_and_permanent_splats_are_distinguished() {
        let still = Polynomial {
            velocity: [[0.0; 3]; 3],
            omega: [0.0; 4],
            centre: 0.5,
            width: f32::INFINITY,
        };
        let brief = |centre: f32| Polynomial { centre, width: 0.05, ..still };
        let motions = vec![still, brief(0.0), brief(0.5), brief(1.0)];
        let scene = PolynomialScene::new(rest(4), motions).unwrap();
        let found = Lifetimes::of(&scene, 0.0).unwrap().unwrap();
        assert_eq!(found.share, 0.5, "the permanent one and the first short-lived one");
        assert!(found.is_partial() && found.median == 1.0, "{found:?}");
        let found = Lifetimes::of(&scene, 0.25).unwrap().unwrap();
        assert_eq!(found.share, 0.25, "only the permanent one");
        let message = found.describe();
        assert!(message.starts_with("25 % of the splats"), "{message}");
        let static_scene = StaticScene::new(rest(2)).unwrap();
        assert_eq!(Lifetimes::of(&static_scene, 0.0).unwrap(), None, "nothing fades");
    }
}
