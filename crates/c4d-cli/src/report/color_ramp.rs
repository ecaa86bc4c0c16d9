//! Colour ramp for values.

use gs_core::Image;

/// Dark to bright, evenly spaced from 0 to 1 (samples of matplotlib's magma).
const RAMP: [[f32; 3]; 5] = [
    [0.001, 0.000, 0.014],
    [0.317, 0.072, 0.485],
    [0.716, 0.215, 0.475],
    [0.987, 0.536, 0.382],
    [0.987, 0.991, 0.750],
];

/// One channel, 0 to 1, as colours.
pub(crate) fn heat(map: &Image) -> Image {
    let mut out = Image::zeros(map.width, map.height, 3);
    for (pixel, &value) in out.data.chunks_exact_mut(3).zip(&map.data) {
        pixel.copy_from_slice(&ramp_color(value));
    }
    out
}

/// The colour of a value, 0 to 1.
pub(crate) fn ramp_color(value: f32) -> [f32; 3] {
    let last = RAMP.len() - 1;
    let at = value.clamp(0.0, 1.0) * last as f32;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4")]
    let low = (at.floor() as usize).min(last - 1);
    let share = at - low as f32;
    [0, 1, 2].map(|c| RAMP[low][c] + share * (RAMP[low + 1][c] - RAMP[low][c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle() {
        let map = Image::from_data(3, 1, 1, vec![0.0, 0.5, 2.0]).unwrap();
        let colors = heat(&map);
        assert_eq!(colors.pixel(0, 0), RAMP[0], "lowest");
        assert_eq!(colors.pixel(1, 0), RAMP[2], "half");
        assert_eq!(colors.pixel(2, 0), RAMP[4], "highest, and beyond");
    }
}
