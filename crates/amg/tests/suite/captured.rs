//! Effects of scenes trained on captured footage that synthetic scenes lack: independently sliding
//! splats on textureless surfaces, and splats that are replaced by others.
use crate::common::Table;
use amg::{DynamicParams, MotionOptions, propagate};
use gs_core::{DynamicScene, Splats};
use std::sync::Arc;

/// A pseudo-random number in [−1, 1].
fn scatter(i: usize, stream: u32) -> f32 {
    let x = (i as f32 * 12.989_8 + stream as f32 * 78.233).sin() * 43_758.547;
    2.0 * (x - x.floor()) - 1.0
}

fn push(splats: &mut Splats, mean: [f32; 3], logit: f32) {
    splats.means.push(mean);
    splats.quats.push([1.0, 0.0, 0.0, 0.0]);
    splats.log_scales.push([-3.0, -3.0, -5.0]);
    splats.opacity_logits.push(logit);
    splats.sh.push([0.0; 3]);
}

/// A wall of `n × n` splats, spacing 0.1, whose centres are displaced from the grid by `off`.
fn wall(n: usize, off: impl Fn(usize) -> [f32; 2]) -> Splats {
    let mut splats = Splats::default();
    for i in 0..n * n {
        let [dx, dy] = off(i);
        push(&mut splats, [0.1 * (i % n) as f32 + dx, 0.1 * (i / n) as f32 + dy, 0.0], 2.0);
    }
    splats
}

/// A block of 6³ splats, spacing 0.1, from `corner`, opacities by row.
fn block(splats: &mut Splats, corner: [f32; 3], logit: impl Fn(usize) -> f32) {
    for i in 0..216 {
        let cell = [i % 6, i / 6 % 6, i / 36];
        let mean = [0, 1, 2].map(|a| corner[a] + 0.1 * cell[a] as f32);
        push(splats, mean, logit(i));
    }
}

fn farthest(before: &[[f32; 3]], after: &[[f32; 3]], by: [f32; 3]) -> f32 {
    let miss = |(x, y): (&[f32; 3], &[f32; 3])| {
        (0..3).map(|a| (y[a] - x[a] - by[a]).powi(2)).sum::<f32>().sqrt()
    };
    before.iter().zip(after).map(miss).fold(0.0, f32::max)
}

#[test]
fn incoherent_motion_of_a_wall_is_ignored() {
    const SIDE: usize = 30;
    let slide = |i: usize, t: f32| [0, 1].map(|a| t * 0.05 * scatter(i, a));
    let frames: Vec<Splats> = [0.0_f32, 0.5, 1.0]
        .map(|t| {
            let mut frame = wall(SIDE, |i| slide(i, t));
            block(&mut frame, [1.0 + t, 1.0, 1.0], |_| 2.0);
            frame
        })
        .to_vec();
    let source = Arc::new(Table::new(frames));
    // As after a new reconstruction: no splat is at the position of an old one.
    let mut edited = wall(SIDE, |_| [0.033, 0.041]);
    let walls = edited.len();
    block(&mut edited, [1.02, 1.03, 1.01], |_| 2.0);
    let edited = Arc::new(edited);
    let moved = |coherent: bool| {
        let dynamics = DynamicParams { coherent, ..DynamicParams::default() };
        let mut options = MotionOptions::default();
        options.dynamics = dynamics;
        let found = propagate(source.clone(), edited.clone(), &options, &|_, _| {}).unwrap();
        let at = found.scene.at(1.0).unwrap().means;
        let wall = farthest(&edited.means[..walls], &at[..walls], [0.0; 3]);
        (wall, farthest(&edited.means[walls..], &at[walls..], [1.0, 0.0, 0.0]))
    };
    let (wall, block) = moved(true);
    assert!(wall < 0.004, "the wall's splats slide by up to 0.07, the edit's by {wall}");
    assert!(block < 0.004, "the block follows with an error of {block}");
    let (wall, _) = moved(false);
    assert!(wall > 0.01, "control: otherwise the wall drifts by {wall}");
}

#[test]
fn faded_splats_do_not_determine_motion() {
    // Every other splat fades and then moves away while invisible; at half time it is still with
    // the others.
    let at = |t: f32| {
        let mut frame = Splats::default();
        block(&mut frame, [t, 0.0, 0.0], |i| if i % 2 == 0 { 2.0 - 20.0 * t } else { 2.0 });
        let gone = if t > 0.5 { 3.0 } else { 0.0 };
        for (i, mean) in frame.means.iter_mut().enumerate() {
            mean[1] += if i % 2 == 0 { gone } else { 0.0 };
        }
        frame
    };
    let source = Arc::new(Table::new(vec![at(0.0), at(0.5), at(1.0)]));
    let mut edited = Splats::default();
    block(&mut edited, [0.02, 0.03, 0.01], |_| 2.0);
    let edited = Arc::new(edited);
    let missed = |fading: bool| {
        let mut options = MotionOptions::default();
        options.aggregation.fading = fading;
        let found = propagate(source.clone(), edited.clone(), &options, &|_, _| {}).unwrap();
        let at = found.scene.at(1.0).unwrap();
        let faintest = at.opacity_logits.iter().copied().fold(f32::INFINITY, f32::min);
        (farthest(&edited.means, &at.means, [1.0, 0.0, 0.0]), faintest)
    };
    let (miss, faintest) = missed(true);
    assert!(miss < 0.05, "the edit follows the remaining splats with an error of {miss}");
    assert!(faintest > 1.0, "and has the same visibility, {faintest}");
    let (miss, _) = missed(false);
    assert!(miss > 0.5, "control: with equal weights, they tear it apart, {miss}");
}

#[test]
fn objects_that_fade_as_a_whole_are_followed() {
    let at = |t: f32| {
        let mut frame = Splats::default();
        block(&mut frame, [t, 0.0, 0.0], |_| 2.0 - 8.0 * t);
        frame
    };
    let source = Arc::new(Table::new(vec![at(0.0), at(0.5), at(1.0)]));
    let mut edited = Splats::default();
    block(&mut edited, [0.02, 0.03, 0.01], |_| 1.0);
    let edited = Arc::new(edited);
    let found = propagate(source, edited.clone(), &MotionOptions::default(), &|_, _| {}).unwrap();
    let at = found.scene.at(1.0).unwrap();
    let miss = farthest(&edited.means, &at.means, [1.0, 0.0, 0.0]);
    assert!(miss < 1e-3, "missing by {miss}");
    for logit in at.opacity_logits {
        assert!((logit + 7.0).abs() < 1e-3, "1 less 8, found {logit}");
    }
}
