//! Rounds rows to the grids of a `.4dgs` file.
//!
//! The encoder rounds each value independently, and rejects a file if single precision increases
//! the error. Here the time of a row is rounded first and its position is moved along its motion
//! accordingly, so that fast rows of short clips keep their positions. All values are then on the grids of
//! the encoder.

use fourdgs::GaussianSet;
use fourdgs::quantization::{
    Bounds, Profile, Steps, life_class, motion_step, mu_step, rint, support_k,
};

/// Error bounds of the file, as stated in the writer's losses.
pub(super) const PROFILE: Profile = Profile::Fine;

/// Rounds all values but rotations to the grids that the encoder derives from the rows.
#[expect(clippy::cast_possible_truncation, reason = "rows are single precision")]
pub(super) fn snap(set: &mut GaussianSet, cutoff: f64) {
    // Steps of sizes do not depend on the sizes; the other steps depend on the rounded sizes.
    let steps_of =
        |set: &GaussianSet| Steps::of(&Bounds::for_profile(PROFILE, median(&set.scales)));
    let scale_step = steps_of(set).scale_log;
    for scale in &mut set.scales {
        let bin = rint(f64::from(*scale).max(1e-30).ln() / scale_step) as f64;
        *scale = (bin * scale_step).exp() as f32;
    }
    let steps = steps_of(set);
    let reach = support_k(cutoff);
    for row in 0..set.count() {
        let sigma = f64::from(set.sigma_t[row]);
        let lasts = !sigma.is_finite();
        let sigma_bin = if lasts { 0 } else { rint(sigma.max(1e-30).ln() / steps.sigma_log) };
        let window = f64::from(set.win_hi[row]) - f64::from(set.win_lo[row]);
        let class = life_class(sigma_bin, steps.sigma_log, lasts, window, reach);
        let speed = motion_step(class, steps.motion);
        let time = mu_step(sigma_bin, steps.sigma_log, lasts, steps.time);
        let before = f64::from(set.mu_t[row]);
        let after = rint(before / time) as f64 * time;
        set.mu_t[row] = after as f32;
        for k in 3 * row..3 * row + 3 {
            let velocity = f64::from(set.motions[k]);
            set.positions[k] = (f64::from(set.positions[k]) + velocity * (after - before)) as f32;
            set.motions[k] = (rint(velocity / speed) as f64 * speed) as f32;
        }
    }
    let round = |value: &mut f32, step: f64| {
        *value = (rint(f64::from(*value) / step) as f64 * step) as f32;
    };
    for color in set.colors.chunks_exact_mut(4) {
        color[..3].iter_mut().for_each(|value| round(value, steps.rgb));
        round(&mut color[3], steps.alpha);
    }
    for axis in 0..3 {
        let values = || set.positions.iter().skip(axis).step_by(3);
        let origin = f64::from(values().copied().fold(f32::INFINITY, f32::min));
        for value in set.positions.iter_mut().skip(axis).step_by(3) {
            let bin = rint((f64::from(*value) - origin) / steps.pos) as f64;
            *value = (bin * steps.pos + origin) as f32;
        }
    }
}

/// The median as computed by the encoder, which has a default for no values.
fn median(values: &[f32]) -> f64 {
    let mut values: Vec<f64> = values.iter().copied().map(f64::from).collect();
    gs_core::median(&mut values).unwrap_or(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_and_fast_rows_are_written_within_their_bounds() {
        let n = 400_usize;
        let value = |i: usize| ((i * 7919) % 1000) as f32 * 0.013;
        let mut set = GaussianSet {
            // Single precision is coarse here: the bound of positions is 2e-5.
            positions: (0..3 * n).map(|i| 900.0 + value(i)).collect(),
            scales: (0..3 * n).map(|i| 0.001 + 1e-5 * value(i)).collect(),
            rotations: [0.0, 0.0, 0.0, 1.0].repeat(n),
            // A colour halfway between two steps.
            colors: vec![0.5; 4 * n],
            motions: (0..3 * n).map(|i| 50.0 * (value(i) - 6.0)).collect(),
            mu_t: (0..n).map(|i| 0.1 * value(i)).collect(),
            sigma_t: (0..n).map(|i| if i % 3 == 0 { f32::INFINITY } else { 0.3 }).collect(),
            win_lo: vec![0.0; n],
            win_hi: vec![2.0; n],
            ..GaussianSet::default()
        };
        let options = fourdgs::WriteOptions { profile: PROFILE, ..Default::default() };
        let write = |set: &GaussianSet| {
            fourdgs::write_to_vec(set, 2.0, &options, &fourdgs::SceneExtras::default())
        };
        assert!(write(&set).is_err(), "the encoder refuses what it rounds itself");
        let before = set.clone();
        snap(&mut set, options.cutoff);
        write(&set).unwrap();
        for row in 0..n {
            // Halfway through the clip, where the row was before.
            for k in 3 * row..3 * row + 3 {
                let at = |set: &GaussianSet| {
                    f64::from(set.positions[k])
                        + f64::from(set.motions[k]) * (1.0 - f64::from(set.mu_t[row]))
                };
                let off = (at(&set) - at(&before)).abs();
                assert!(off < 3e-4, "row {row}: {off}");
            }
        }
    }
}
