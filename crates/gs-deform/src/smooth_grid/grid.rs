//! [`SmoothGrid`]: features at lattice points of several resolutions, over some of the coordinates
//! x, y, z, t.

use crate::FieldError;

/// Factors of the spatial hash, one per axis of the grid.
const PRIMES: [u32; 4] = [1, 2_654_435_761, 805_459_861, 3_674_653_429];
/// Largest number of axes.
const MAX_AXES: usize = 4;
/// Largest accepted resolution.
const MAX_RESOLUTION: f32 = 1e9;

/// A grid as a checkpoint stores it; [`SmoothGrid::new`] verifies that the parts fit.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothGridParts {
    /// Coordinates of the axes, as indices into (x, y, z, t).
    pub axes: Vec<usize>,
    /// Factor from one level's resolution to the next, per axis.
    pub per_level_scale: Vec<f32>,
    /// Resolution of the coarsest level, per axis.
    pub base_resolution: Vec<f32>,
    /// First entry of each level, and the number of entries, `[L + 1]`.
    pub offsets: Vec<usize>,
    /// Entries, `[entries, C]` row-major.
    pub embeddings: Vec<f32>,
    /// `C`.
    pub channels: usize,
}

#[derive(Debug, Clone, PartialEq)]
struct Level {
    /// Lattice cells along each axis.
    scale: [f32; MAX_AXES],
    /// Factors of a corner's coordinates: strides, or primes where the level is hashed.
    factors: [u32; MAX_AXES],
    hashed: bool,
    start: usize,
    size: u32,
}

/// A verified grid.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothGrid {
    axes: Vec<usize>,
    levels: Vec<Level>,
    embeddings: Vec<f32>,
    channels: usize,
}

impl SmoothGrid {
    /// Verifies that all parts fit.
    ///
    /// # Errors
    /// Names the first part that does not fit; `name` is the grid's name.
    pub fn new(name: &str, parts: SmoothGridParts) -> Result<Self, FieldError> {
        let SmoothGridParts {
            axes,
            per_level_scale,
            base_resolution,
            offsets,
            embeddings,
            channels,
        } = parts;
        let shape = |part: &str, found: usize, expected: String| FieldError::Shape {
            tensor: format!("{name}.{part}"),
            found: vec![found],
            expected,
        };
        let dims = axes.len();
        if !(1..=MAX_AXES).contains(&dims) || axes.iter().any(|&axis| axis >= MAX_AXES) {
            return Err(shape("axes", dims, "1 to 4 of the coordinates x, y, z, t".to_owned()));
        }
        for (part, values) in
            [("per_level_scale", &per_level_scale), ("base_resolution", &base_resolution)]
        {
            if values.len() != dims {
                return Err(shape(part, values.len(), format!("[{dims}]")));
            }
        }
        let entries = embeddings.len().checked_div(channels).unwrap_or(0);
        let fits = offsets.len() >= 2
            && offsets[0] == 0
            && offsets.is_sorted_by(|a, b| a < b)
            && offsets.last() == Some(&entries)
            && entries * channels == embeddings.len();
        if !fits {
            let expected = format!("ascending from 0 to the {entries} rows of its embeddings");
            return Err(shape("offsets", offsets.len(), expected));
        }
        if !embeddings.iter().all(|value| value.is_finite()) {
            return Err(FieldError::NotFinite { tensor: format!("{name}.embeddings") });
        }
        let mut levels = Vec::with_capacity(offsets.len() - 1);
        for (index, bounds) in offsets.windows(2).enumerate() {
            let size = u32::try_from(bounds[1] - bounds[0]).map_err(|_too_large| {
                shape("embeddings", entries, "fewer than 2^32 rows a level".to_owned())
            })?;
            let level = level(index, &per_level_scale, &base_resolution, bounds[0], size);
            levels.push(level.ok_or_else(|| {
                FieldError::Unsupported(format!(
                    "{name}: the resolution of level {index} is out of range with base \
                    {base_resolution:?} and factors {per_level_scale:?}"
                ))
            })?);
        }
        Ok(Self { axes, levels, embeddings, channels })
    }

    /// `L·C`.
    pub fn num_features(&self) -> usize {
        self.levels.len() * self.channels
    }

    /// Features at a point (x, y, z, t) of the unit box, level by level; calls `put` with index and
    /// value. All are 0 if a coordinate of the grid lies outside 0 to 1.
    #[inline(always)]
    pub(super) fn encode(&self, point: [f32; 4], mut put: impl FnMut(usize, f32)) {
        let dims = self.axes.len();
        let inside = self.axes.iter().all(|&axis| (0.0..=1.0).contains(&point[axis]));
        for (index, level) in self.levels.iter().enumerate() {
            let first = index * self.channels;
            for channel in 0..self.channels {
                put(first + channel, 0.0);
            }
            if !inside {
                continue;
            }
            let (mut cells, mut weights) = ([0_u32; MAX_AXES], [0.0_f32; MAX_AXES]);
            for d in 0..dims {
                let position = point[self.axes[d]] * level.scale[d];
                let cell = position.floor();
                let fraction = position - cell;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "between 0 and the resolution"
                )]
                let cell = cell as u32;
                cells[d] = cell;
                weights[d] = fraction * fraction * (3.0 - 2.0 * fraction);
            }
            let mut sums = [0.0_f32; 8];
            let mut wide = Vec::new();
            let sums: &mut [f32] = if self.channels <= sums.len() {
                &mut sums[..self.channels]
            } else {
                wide.resize(self.channels, 0.0);
                &mut wide
            };
            for corner in 0..1_u32 << dims {
                let (mut weight, mut row) = (1.0_f32, 0_u32);
                for d in 0..dims {
                    let far = corner >> d & 1;
                    weight *= if far == 1 { weights[d] } else { 1.0 - weights[d] };
                    let term = (cells[d] + far).wrapping_mul(level.factors[d]);
                    row = if level.hashed { row ^ term } else { row.wrapping_add(term) };
                }
                let entry = level.start + (row % level.size) as usize;
                let values = &self.embeddings[entry * self.channels..][..self.channels];
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += weight * value;
                }
            }
            for (channel, sum) in sums.iter().enumerate() {
                put(first + channel, *sum);
            }
        }
    }
}

/// A level; `None` if its resolution is out of range. Computed in single precision, as in training,
/// because whether a level is hashed depends on the rounding.
fn level(index: usize, factor: &[f32], base: &[f32], start: usize, size: u32) -> Option<Level> {
    let (mut scale, mut factors) = ([0.0; MAX_AXES], [0; MAX_AXES]);
    let (mut points, mut hashed) = (1_u64, false);
    for d in 0..base.len() {
        let exponent = index as f32 * factor[d].log2();
        scale[d] = exponent.exp2() * base[d] - 1.0;
        if !(0.0..MAX_RESOLUTION).contains(&scale[d]) {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 1 and the largest resolution"
        )]
        let resolution = scale[d].ceil() as u32 + 1;
        #[expect(clippy::cast_possible_truncation, reason = "at most the size of the level")]
        let stride = points as u32;
        factors[d] = stride;
        points = points.saturating_mul(resolution.into());
        hashed |= points > u64::from(size);
        if hashed {
            points = 1;
        }
    }
    if hashed {
        factors = PRIMES;
    }
    Some(Level { scale, factors, hashed, start, size })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts() -> SmoothGridParts {
        SmoothGridParts {
            axes: vec![0, 2],
            per_level_scale: vec![2.0, 1.5],
            base_resolution: vec![3.0, 2.0],
            offsets: vec![0, 6, 14],
            embeddings: (0_u8..28).map(f32::from).collect(),
            channels: 2,
        }
    }

    fn features(grid: &SmoothGrid, point: [f32; 4]) -> Vec<f32> {
        let mut out = vec![f32::NAN; grid.num_features()];
        grid.encode(point, |k, value| out[k] = value);
        out
    }

    #[test]
    fn dense_levels_are_exact_at_lattice_points_and_smooth_between() {
        let grid = SmoothGrid::new("g", parts()).unwrap();
        assert!(
            !grid.levels[0].hashed && grid.levels[1].hashed,
            "6 points fit in 6 entries, 18 \
            do not fit in 8"
        );
        // Level 0 has 3 × 2 points: x = 1/2 and z = 1 is the point (1, 1), entry 4.
        let at = features(&grid, [0.5, 9.0, 1.0, 9.0]);
        assert_eq!(at[..2], [8.0, 9.0], "entry 4; y and t do not matter");
        let quarter = features(&grid, [0.125, 0.0, 0.0, 0.0])[0];
        let weight = 0.25_f32 * 0.25 * (3.0 - 0.5);
        assert!((quarter - 2.0 * weight).abs() < 1e-6, "{quarter}");
        let outside = features(&grid, [0.5, 0.0, 1.000_001, 0.0]);
        assert_eq!(outside, [0.0; 4], "outside, features are 0");
        assert_eq!(features(&grid, [f32::NAN, 0.0, 0.5, 0.0]), [0.0; 4], "and at NaN");
    }

    #[test]
    fn parts_that_do_not_fit_are_named() {
        let refused = |change: fn(&mut SmoothGridParts)| {
            let mut bad = parts();
            change(&mut bad);
            SmoothGrid::new("g", bad).unwrap_err().to_string()
        };
        assert!(refused(|p| p.axes = vec![0, 4]).contains("g.axes"), "axis");
        assert!(refused(|p| p.offsets[2] = 13).contains("g.offsets"), "rows");
        assert!(refused(|p| p.offsets[1] = 14).contains("g.offsets"), "an empty level");
        assert!(refused(|p| p.channels = 0).contains("g.offsets"), "no channels");
        assert!(refused(|p| p.embeddings[3] = f32::NAN).contains("g.embeddings"), "NaN");
        assert!(refused(|p| p.base_resolution[0] = 0.0).contains("resolution"), "no lattice");
        assert!(refused(|p| p.per_level_scale[1] = f32::NAN).contains("resolution"), "NaN");
        assert!(refused(|p| p.per_level_scale[1] = 1e30).contains("resolution"), "too fine");
        assert!(refused(|p| p.per_level_scale = vec![2.0]).contains("per_level_scale"), "axes");
    }
}
