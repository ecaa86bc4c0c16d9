//! [`Gamut`]: the range of the colours of a picture.

use gs_core::symmetric_eigen;

/// Box around colours, along their principal axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gamut {
    /// Unit vectors.
    axes: [[f32; 3]; 3],
    /// Smallest and largest coordinate along each axis.
    range: [[f32; 2]; 3],
}

impl Gamut {
    /// The gamut of `colors`; empty if there are none.
    pub(crate) fn of(colors: &[[f32; 3]]) -> Self {
        let count = colors.len().max(1) as f64;
        let mean =
            [0, 1, 2].map(|c| colors.iter().map(|rgb| f64::from(rgb[c])).sum::<f64>() / count);
        let mut covariance = [[0.0; 3]; 3];
        for rgb in colors {
            let offset = [0, 1, 2].map(|c| f64::from(rgb[c]) - mean[c]);
            for (row, a) in covariance.iter_mut().zip(offset) {
                for (entry, b) in row.iter_mut().zip(offset) {
                    *entry += a * b / count;
                }
            }
        }
        let (_, columns) = symmetric_eigen(covariance);
        #[expect(clippy::cast_possible_truncation, reason = "unit vectors")]
        let axes = [0, 1, 2].map(|k| [0, 1, 2].map(|c| columns[c][k] as f32));
        let range = axes.map(|axis| {
            colors
                .iter()
                .map(|rgb| dot(axis, *rgb))
                .fold([f32::INFINITY, f32::NEG_INFINITY], extended)
        });
        Self { axes, range }
    }

    /// `color` moved into the box extended to contain `start`.
    pub(crate) fn clamped(&self, color: [f32; 3], start: [f32; 3]) -> [f32; 3] {
        let mut inside = [0.0; 3];
        for (&axis, &range) in self.axes.iter().zip(&self.range) {
            let [low, high] = extended(range, dot(axis, start));
            let along = dot(axis, color).clamp(low, high);
            for (value, direction) in inside.iter_mut().zip(axis) {
                *value += along * direction;
            }
        }
        inside
    }
}

fn extended([low, high]: [f32; 2], value: f32) -> [f32; 2] {
    [low.min(value), high.max(value)]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_stay_on_the_line_of_greys() {
        let greys: Vec<[f32; 3]> = (2_u8..=8).map(|i| [f32::from(i) / 10.0; 3]).collect();
        let gamut = Gamut::of(&greys);
        let close = |a: [f32; 3], b: [f32; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-6);
        assert!(close(gamut.clamped([0.9, 0.3, 0.3], [0.5; 3]), [0.5; 3]), "red becomes grey");
        assert!(close(gamut.clamped([1.5; 3], [0.5; 3]), [0.8; 3]), "the brightest grey");
        let red = [0.9, 0.1, 0.1];
        assert!(close(gamut.clamped(red, red), red), "the start is always possible");
    }
}
