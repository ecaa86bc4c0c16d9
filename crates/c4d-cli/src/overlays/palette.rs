//! Palettes of overlays.

use crate::report::ramp_color;

/// Colour of splats without a value.
pub(super) const NEUTRAL: [u8; 3] = [96, 96, 100];
/// Turn of the hue from one class to the next, degrees: the golden angle, so that any number of
/// classes is spread evenly.
const HUE_STEP: f32 = 137.508;
/// Hue of the first class, degrees.
const FIRST_HUE: f32 = 205.0;
/// Brightness of every other class, 0 to 1.
const BRIGHTNESS: [f32; 2] = [0.95, 0.7];
const SATURATION: f32 = 0.75;

/// Colour of class `number`, different from those of earlier classes.
pub(super) fn class_color(number: usize) -> [u8; 3] {
    let hue = (FIRST_HUE + HUE_STEP * number as f32).rem_euclid(360.0) / 60.0;
    let value = BRIGHTNESS[number % BRIGHTNESS.len()];
    [5.0, 3.0, 1.0].map(|offset: f32| {
        let k = (offset + hue) % 6.0;
        byte(value - value * SATURATION * k.min(4.0 - k).clamp(0.0, 1.0))
    })
}

/// `count` colours from the lowest to the highest value.
pub(super) fn scale_colors(count: usize) -> Vec<[u8; 3]> {
    let last = count.saturating_sub(1).max(1) as f32;
    (0..count).map(|i| ramp_color(i as f32 / last).map(byte)).collect()
}

/// Entry of a scale of `count` colours for a value from 0 to 1.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
pub(super) fn scale_entry(value: f32, count: u8) -> u8 {
    if value.is_finite() { (value.clamp(0.0, 1.0) * f32::from(count - 1)).round() as u8 } else { 0 }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
fn byte(value: f32) -> u8 {
    (255.0 * value.clamp(0.0, 1.0)).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_differ_and_scales_have_ends() {
        let colors: Vec<[u8; 3]> = (0..30).map(class_color).collect();
        for (i, a) in colors.iter().enumerate() {
            for b in &colors[..i] {
                let apart: i32 = (0..3).map(|k| (i32::from(a[k]) - i32::from(b[k])).abs()).sum();
                assert!(apart > 40, "{a:?} and {b:?}");
            }
        }
        let scale = scale_colors(255);
        assert!(scale[0].iter().all(|&v| v < 10) && scale[254][0] > 240, "dark to bright");
        assert_eq!([0.0, 0.5, 2.0, f32::NAN].map(|v| scale_entry(v, 255)), [0, 127, 254, 0]);
    }
}
