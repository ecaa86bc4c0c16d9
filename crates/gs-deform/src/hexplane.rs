//! The six feature planes over (x, y, z, t), at several resolutions.

use crate::FieldError;

/// Coordinates (first, second) of plane `p`: 0 (x,y), 1 (x,z), 2 (x,t), 3 (y,z), 4 (y,t), 5 (z,t).
pub const PLANE_AXES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// One feature plane. The first coordinate of its pair runs along `columns`.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Resolution along the first coordinate.
    pub columns: usize,
    /// Resolution along the second coordinate.
    pub rows: usize,
    /// Features, channels last: `[rows, columns, C]`.
    pub texels: Vec<f32>,
}

impl Plane {
    /// From a tensor `[C, rows, columns]`, as checkpoints store it.
    ///
    /// # Errors
    /// If there are not `C · rows · columns` values, or one of these factors is 0.
    pub fn from_channels_first(
        values: &[f32],
        channels: usize,
        rows: usize,
        columns: usize,
    ) -> Result<Self, FieldError> {
        let texels = rows.saturating_mul(columns);
        if texels == 0 || channels == 0 || texels.checked_mul(channels) != Some(values.len()) {
            return Err(FieldError::Shape {
                tensor: "plane".to_owned(),
                found: vec![values.len()],
                expected: format!("[{channels}, {rows}, {columns}], all at least 1"),
            });
        }
        let mut out = vec![0.0; values.len()];
        for (channel, source) in values.chunks_exact(texels).enumerate() {
            for (texel, &value) in source.iter().enumerate() {
                out[texel * channels + channel] = value;
            }
        }
        Ok(Self { columns, rows, texels: out })
    }
}

/// Feature planes and the box that maps the world onto them.
#[derive(Debug, Clone, PartialEq)]
pub struct HexPlane {
    /// Row 0 the **maximum** corner, row 1 the minimum: the axes are mirrored. World units.
    pub aabb: [[f32; 3]; 2],
    /// `C`, features per plane.
    pub channels: usize,
    /// `L` levels of six planes, in the order of [`PLANE_AXES`].
    pub levels: Vec<[Plane; 6]>,
}

impl HexPlane {
    /// `L·C`, features per Gaussian: products over the planes, levels concatenated.
    pub fn num_features(&self) -> usize {
        self.levels.len() * self.channels
    }

    /// Box coordinates of a world point: maximum corner ↦ −1, minimum corner ↦ +1. Uses the
    /// reference's order of operations, factor first.
    pub fn normalize(&self, mean: [f32; 3]) -> [f32; 3] {
        let [maximum, minimum] = self.aabb;
        std::array::from_fn(|axis| {
            let factor = 2.0 / (minimum[axis] - maximum[axis]);
            (mean[axis] - maximum[axis]) * factor - 1.0
        })
    }

    /// Value of plane `p` of `level` at box coordinates and time `coords` = (x, y, z, t): bilinear,
    /// corner-aligned, clamped at the border. `[C]`.
    ///
    /// # Panics
    /// If there is no such level or plane.
    pub fn sample(&self, level: usize, p: usize, coords: [f32; 4]) -> Vec<f32> {
        let plane = &self.levels[level][p];
        let (first, second) = PLANE_AXES[p];
        let i = Tap::new(coords[first], plane.columns);
        let j = Tap::new(coords[second], plane.rows);
        let texel = |row: usize, column: usize, c: usize| {
            plane.texels[(row * plane.columns + column) * self.channels + c]
        };
        (0..self.channels)
            .map(|c| {
                texel(j.low, i.low, c) * (i.w_low * j.w_low)
                    + texel(j.low, i.high, c) * (i.w_high * j.w_low)
                    + texel(j.high, i.low, c) * (i.w_low * j.w_high)
                    + texel(j.high, i.high, c) * (i.w_high * j.w_high)
            })
            .collect()
    }

    pub(crate) fn check(&self) -> Result<(), FieldError> {
        let [maximum, minimum] = self.aabb;
        let proper = (0..3).all(|axis| {
            let factor = 2.0 / (minimum[axis] - maximum[axis]);
            maximum[axis].is_finite() && minimum[axis].is_finite() && factor.is_finite()
        });
        if !proper {
            return Err(FieldError::Box { maximum, minimum });
        }
        if self.levels.is_empty() || self.channels == 0 {
            return Err(FieldError::Shape {
                tensor: "planes".to_owned(),
                found: vec![self.levels.len(), self.channels],
                expected: "at least one level and one channel".to_owned(),
            });
        }
        for (level, planes) in self.levels.iter().enumerate() {
            for (p, plane) in planes.iter().enumerate() {
                let name = || format!("grids.{level}.{p}");
                let expected = plane.rows * plane.columns * self.channels;
                if expected == 0 || plane.texels.len() != expected {
                    return Err(FieldError::Shape {
                        tensor: name(),
                        found: vec![plane.texels.len()],
                        expected: format!(
                            "[{}, {}, {}], all at least 1",
                            plane.rows, plane.columns, self.channels
                        ),
                    });
                }
                if !plane.texels.iter().all(|value| value.is_finite()) {
                    return Err(FieldError::NotFinite { tensor: name() });
                }
            }
        }
        Ok(())
    }
}

/// Two neighbours along an axis and their weights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tap {
    pub(crate) low: usize,
    pub(crate) high: usize,
    pub(crate) w_low: f32,
    pub(crate) w_high: f32,
}

impl Tap {
    /// Corner-aligned position of `u` ∈ [−1,1] on an axis of `resolution` samples, clamped. NaN
    /// gives NaN weights.
    #[inline(always)]
    pub(crate) fn new(u: f32, resolution: usize) -> Self {
        let last = resolution - 1;
        let position = ((u + 1.0) * 0.5 * last as f32).clamp(0.0, last as f32);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the axis; NaN becomes 0, a valid index"
        )]
        let low = position as usize;
        let w_high = position - low as f32;
        // The neighbour beyond the last sample has weight 0; the last sample is read instead, to
        // stay in bounds.
        Self { low, high: (low + 1).min(last), w_low: 1.0 - w_high, w_high }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_axes_are_mirrored() {
        let plane = Plane::from_channels_first(&[0.0], 1, 1, 1).unwrap();
        let field = HexPlane {
            aabb: [[3.0, 2.0, 1.0], [-1.0, -2.0, -3.0]],
            channels: 1,
            levels: vec![std::array::from_fn(|_| plane.clone())],
        };
        assert_eq!(field.normalize([3.0, 2.0, 1.0]), [-1.0; 3], "maximum corner");
        assert_eq!(field.normalize([-1.0, -2.0, -3.0]), [1.0; 3], "minimum corner");
        assert!(field.check().is_ok(), "valid");
        let flat = HexPlane { aabb: [[1.0; 3], [1.0, 0.0, 0.0]], ..field };
        assert!(matches!(flat.check(), Err(FieldError::Box { .. })), "flat box");
    }

    #[test]
    fn taps_are_clamped_to_the_axis() {
        for u in [-9.0, -1.0, -0.99, 0.0, 0.5, 1.0, 9.0, f32::NAN, f32::INFINITY] {
            for resolution in [1, 2, 5] {
                let tap = Tap::new(u, resolution);
                assert!(tap.low < resolution && tap.high < resolution, "{u} on {resolution}");
            }
        }
        let end = Tap::new(1.0, 5);
        assert_eq!((end.low, end.w_low, end.w_high), (4, 1.0, 0.0), "last sample exactly");
        let middle = Tap::new(0.0, 4);
        assert_eq!((middle.low, middle.high, middle.w_high), (1, 2, 0.5), "between");
    }

    #[test]
    fn channels_first_tensors_become_channels_last() {
        let plane = Plane::from_channels_first(&[1.0, 2.0, 3.0, 4.0], 2, 1, 2).unwrap();
        assert_eq!(plane.texels, [1.0, 3.0, 2.0, 4.0], "interleaved");
        assert!(Plane::from_channels_first(&[1.0], 2, 1, 2).is_err(), "too few values");
        assert!(Plane::from_channels_first(&[], 1, 0, 2).is_err(), "no rows");
        assert!(Plane::from_channels_first(&[], 2, usize::MAX, 2).is_err(), "overflow");
    }
}
