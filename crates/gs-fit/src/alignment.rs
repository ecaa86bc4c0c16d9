//! [`Alignment`]: gain, offset and displacement that register one picture to the current render.
//!
//! Pictures that were edited independently differ in brightness, position and shape. A fit to all
//! of them is blurred. Each picture is therefore registered to the current render at intervals, and
//! the fit continues with the registered pictures.

use glam::{DMat3, DVec3};
use gs_core::{Camera, nearest_rank};
use rayon::prelude::*;

/// Range of the search for a common displacement, pixels in each direction.
const SEARCH: i32 = 6;
/// Largest common displacement, pixels in each direction. Without a bound, the estimate of a plain
/// surface drifts: 20 pixels in a picture that was not displaced at all. With 4 or 16, pictures
/// displaced by σ 2 pixels give the same result.
const MOST_SHIFT: f32 = 8.0;
/// Passes of local registration per estimate.
const PASSES: usize = 2;
/// Ridge that pulls gain to 1 and offset to 0, added to the variance of a channel (values 0 to 1).
const RIDGE: f64 = 0.0005;
/// Ridge that pulls local displacements to 0, as a share of the mean squared image gradient.
const LOCAL_RIDGE: f32 = 0.1;
/// Factor of [`LOCAL_RIDGE`] for displacements of earlier estimates.
const PULL_BACK: f32 = 0.1;

/// `colour' = gain · picture(x + displacement(x)) + offset` per channel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Alignment {
    pub gain: [f32; 3],
    pub offset: [f32; 3],
    /// Common displacement of the whole picture, pixels.
    pub shift: [f32; 2],
    /// Additional local displacement, pixels, `[H,W]`; empty for zero.
    pub local: Vec<[f32; 2]>,
}

impl Default for Alignment {
    fn default() -> Self {
        Self { gain: [1.0; 3], offset: [0.0; 3], shift: [0.0; 2], local: Vec::new() }
    }
}

/// A picture of `[H,W,3]` and its size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Picture<'a> {
    pub width: usize,
    pub height: usize,
    pub rgb: &'a [f32],
}

impl Picture<'_> {
    /// Bilinear, clamped at the borders; `x`, `y` count pixels, centres at whole numbers.
    fn sample(&self, x: f32, y: f32) -> [f32; 3] {
        let (right, bottom) = ((self.width - 1) as f32, (self.height - 1) as f32);
        let (x, y) = (x.clamp(0.0, right), y.clamp(0.0, bottom));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(self.width - 1), (y0 + 1).min(self.height - 1));
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        std::array::from_fn(|c| {
            let at = |x: usize, y: usize| self.rgb[3 * (y * self.width + x) + c];
            let top = at(x0, y0) + fx * (at(x1, y0) - at(x0, y0));
            let low = at(x0, y1) + fx * (at(x1, y1) - at(x0, y1));
            top + fy * (low - top)
        })
    }
}

impl Alignment {
    /// The aligned picture where `mask` is set, `base` elsewhere, `[H,W,3]`.
    pub(crate) fn apply(&self, picture: Picture, mask: &[bool], base: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.extend_from_slice(base);
        let width = picture.width;
        let still = self.shift == [0.0; 2] && self.local.is_empty();
        out.par_chunks_mut(3 * width).enumerate().for_each(|(y, row)| {
            for x in 0..width {
                let p = y * width + x;
                if mask[p] {
                    let rgb = if still {
                        [0, 1, 2].map(|c| picture.rgb[3 * p + c])
                    } else {
                        self.displaced(picture, x, y)
                    };
                    for c in 0..3 {
                        row[3 * x + c] = (self.gain[c] * rgb[c] + self.offset[c]).clamp(0.0, 1.0);
                    }
                }
            }
        });
    }

    fn displaced(&self, picture: Picture, x: usize, y: usize) -> [f32; 3] {
        let [lx, ly] = self.local.get(y * picture.width + x).copied().unwrap_or([0.0; 2]);
        picture.sample(x as f32 + self.shift[0] + lx, y as f32 + self.shift[1] + ly)
    }

    /// Registers the picture to `render` (`[H,W,3]`) inside `mask`, starting from the current
    /// estimate. `radius` is half the width of the window in which local displacements are
    /// constant, pixels; `None` for a common displacement only.
    pub(crate) fn estimate(
        &mut self,
        picture: Picture,
        render: &[f32],
        mask: &[bool],
        radius: Option<usize>,
    ) {
        self.common_shift(picture, render, mask);
        if let Some(radius) = radius {
            for _ in 0..PASSES {
                self.refine_locally(picture, render, mask, radius);
            }
        }
        self.match_colors(picture, render, mask);
    }

    /// Least squares per channel, with a ridge towards the identity.
    fn match_colors(&mut self, picture: Picture, render: &[f32], mask: &[bool]) {
        let mut sums = [[0.0_f64; 5]; 3];
        for (p, _) in mask.iter().enumerate().filter(|(_, on)| **on) {
            let rgb = self.displaced(picture, p % picture.width, p / picture.width);
            for c in 0..3 {
                let (x, y) = (f64::from(rgb[c]), f64::from(render[3 * p + c]));
                for (sum, value) in sums[c].iter_mut().zip([1.0, x, y, x * x, x * y]) {
                    *sum += value;
                }
            }
        }
        for (c, [n, x, y, xx, xy]) in sums.into_iter().enumerate() {
            if n < 1.0 {
                continue;
            }
            let (mx, my) = (x / n, y / n);
            let (var, cov) = (xx / n - mx * mx, xy / n - mx * my);
            let gain = ((cov + RIDGE) / (var + RIDGE)).clamp(0.5, 2.0);
            #[expect(clippy::cast_possible_truncation, reason = "a gain")]
            {
                self.gain[c] = gain as f32;
                self.offset[c] = (my - gain * mx) as f32;
            }
        }
    }

    /// The whole-pixel change of the displacement with the smallest absolute difference, refined by a
    /// parabola per axis.
    fn common_shift(&mut self, picture: Picture, render: &[f32], mask: &[bool]) {
        let width = picture.width;
        let pixels: Vec<usize> = (0..mask.len()).filter(|&p| mask[p]).collect();
        let stride = (pixels.len() / 6000).max(1);
        let cost = |dx: f32, dy: f32| -> f32 {
            let moved = Self { shift: [self.shift[0] + dx, self.shift[1] + dy], ..self.shallow() };
            let mut sum = 0.0;
            for &p in pixels.iter().step_by(stride) {
                let [lx, ly] = self.local.get(p).copied().unwrap_or([0.0; 2]);
                let rgb = picture.sample(
                    (p % width) as f32 + moved.shift[0] + lx,
                    (p / width) as f32 + moved.shift[1] + ly,
                );
                for c in 0..3 {
                    let r = moved.gain[c] * rgb[c] + moved.offset[c] - render[3 * p + c];
                    sum += r.abs().min(0.25);
                }
            }
            sum
        };
        let costs: Vec<(f32, [i32; 2])> = (-SEARCH..=SEARCH)
            .flat_map(|dy| (-SEARCH..=SEARCH).map(move |dx| [dx, dy]))
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|[dx, dy]| (cost(dx as f32, dy as f32), [dx, dy]))
            .collect();
        let Some(&(best, [dx, dy])) = costs.iter().min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return;
        };
        let vertex = |before: f32, after: f32| {
            let bend = before - 2.0 * best + after;
            if bend > 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let (x, y) = (dx as f32, dy as f32);
        let sub = [
            vertex(cost(x - 1.0, y), cost(x + 1.0, y)),
            vertex(cost(x, y - 1.0), cost(x, y + 1.0)),
        ];
        let moved = [self.shift[0] + x + sub[0], self.shift[1] + y + sub[1]];
        self.shift = moved.map(|shift| shift.clamp(-MOST_SHIFT, MOST_SHIFT));
    }

    /// Without the local displacements.
    fn shallow(&self) -> Self {
        Self { local: Vec::new(), ..*self }
    }

    /// One pass of windowed least squares (Lucas–Kanade) on the remaining differences.
    fn refine_locally(&mut self, picture: Picture, render: &[f32], mask: &[bool], radius: usize) {
        let Picture { width, height, .. } = picture;
        let pixels = width * height;
        let mut aligned = Vec::new();
        self.apply(picture, mask, render, &mut aligned);
        // xx, xy, yy, x·r, y·r of the gradient and the difference
        let mut planes = vec![[0.0_f32; 5]; pixels];
        planes.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                let p = y * width + x;
                if !mask[p] || x == 0 || y == 0 || x + 1 == width || y + 1 == height {
                    continue;
                }
                for c in 0..3 {
                    let at = |q: usize| 0.5 * (aligned[3 * q + c] + render[3 * q + c]);
                    let gx = 0.5 * (at(p + 1) - at(p - 1));
                    let gy = 0.5 * (at(p + width) - at(p - width));
                    let r = (render[3 * p + c] - aligned[3 * p + c]).clamp(-0.15, 0.15);
                    for (sum, value) in
                        out.iter_mut().zip([gx * gx, gx * gy, gy * gy, gx * r, gy * r])
                    {
                        *sum += value;
                    }
                }
            }
        });
        let inside = mask.iter().filter(|on| **on).count().max(1) as f32;
        let mean = planes.iter().map(|p| p[0] + p[2]).sum::<f32>() / inside;
        let ridge = LOCAL_RIDGE * mean.max(1e-8);
        for _ in 0..2 {
            box_blur(&mut planes, width, radius);
        }
        if self.local.is_empty() {
            self.local = vec![[0.0; 2]; pixels];
        }
        for (local, [xx, xy, yy, xr, yr]) in self.local.iter_mut().zip(planes) {
            // The ridge also pulls the current estimate to zero.
            let (a, b, c) = (xx + ridge, xy, yy + ridge);
            let (u, v) = (xr - PULL_BACK * ridge * local[0], yr - PULL_BACK * ridge * local[1]);
            let det = a * c - b * b;
            if det > 0.0 {
                let step = [(c * u - b * v) / det, (a * v - b * u) / det];
                for k in 0..2 {
                    local[k] = (local[k] + step[k].clamp(-1.0, 1.0)).clamp(-8.0, 8.0);
                }
            }
        }
    }
}

/// Means over windows of `2·radius + 1` columns and rows, with zeros beyond the borders.
fn box_blur(planes: &mut [[f32; 5]], width: usize, radius: usize) {
    let height = planes.len() / width.max(1);
    let scale = 1.0 / (2 * radius + 1) as f32;
    let running =
        |len: usize, get: &dyn Fn(usize) -> [f32; 5], put: &mut dyn FnMut(usize, [f32; 5])| {
            let mut sum = [0.0_f32; 5];
            for k in 0..radius.min(len) {
                sum = add(sum, get(k), 1.0);
            }
            for k in 0..len {
                if k + radius < len {
                    sum = add(sum, get(k + radius), 1.0);
                }
                put(k, sum.map(|value| value * scale));
                if k >= radius {
                    sum = add(sum, get(k - radius), -1.0);
                }
            }
        };
    let source = planes.to_vec();
    planes.par_chunks_mut(width).zip(source.par_chunks(width)).for_each(|(out, row)| {
        running(width, &|k| row[k], &mut |k, value| out[k] = value);
    });
    let columns: Vec<Vec<[f32; 5]>> = (0..width)
        .into_par_iter()
        .map(|x| {
            let mut out = vec![[0.0; 5]; height];
            running(height, &|k| planes[k * width + x], &mut |k, value| out[k] = value);
            out
        })
        .collect();
    for (x, column) in columns.iter().enumerate() {
        for (y, value) in column.iter().enumerate() {
            planes[y * width + x] = *value;
        }
    }
}

fn add(mut a: [f32; 5], b: [f32; 5], factor: f32) -> [f32; 5] {
    for (a, b) in a.iter_mut().zip(b) {
        *a += factor * b;
    }
    a
}

/// Differences between the pictures that are removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Aligning {
    /// No differences: the pictures agree.
    Nothing,
    /// Colours, and one displacement per picture.
    Whole,
    /// Colours, and local displacements.
    Local,
}

/// Medians above which pictures disagree: displacement in pixels, and absolute logarithm of the
/// gain. Measured in the middle of a fit: 0.13 pixels and 0.02 for pictures that agree; 2.4 pixels
/// and 0.05 for gains of σ 0.15 and shifts of σ 2 pixels.
const DISAGREE: [f32; 2] = [0.4, 0.03];
/// Median over pictures of the root mean square local displacement, pixels, above which local
/// displacements are used. Measured: 0.4 without any, 0.9 for a warp of σ 2 pixels.
const DISAGREE_LOCALLY: f32 = 0.6;

/// Differences to remove, determined from the first estimates.
pub(crate) fn needed(alignments: &[Alignment]) -> Aligning {
    let median = |mut values: Vec<f32>| nearest_rank(&mut values, 0.5).unwrap_or(0.0);
    let local = |a: &Alignment| {
        let moved = a.local.iter().filter(|d| **d != [0.0; 2]);
        let (sum, count) =
            moved.fold((0.0, 0.0_f32), |(sum, n), d| (sum + d[0] * d[0] + d[1] * d[1], n + 1.0));
        (sum / count.max(1.0)).sqrt()
    };
    if median(alignments.iter().map(local).collect()) > DISAGREE_LOCALLY {
        return Aligning::Local;
    }
    let shifts = alignments.iter().map(|a| a.shift[0].hypot(a.shift[1])).collect();
    let gains = alignments.iter().flat_map(|a| a.gain.map(|gain| gain.ln().abs())).collect();
    if median(shifts) < DISAGREE[0] && median(gains) < DISAGREE[1] {
        Aligning::Nothing
    } else {
        Aligning::Whole
    }
}

/// Removes the component common to all alignments: the geometric mean of the gains, the mean
/// offset, and the displacements of a translation of the content by one vector. With a `reference`
/// view, its gain and offset are used instead of the means, and the translation is fitted mainly to
/// its displacement.
pub(crate) fn remove_common(
    alignments: &mut [Alignment],
    cameras: &[&Camera],
    centre: [f64; 3],
    reference: Option<usize>,
) {
    let n = alignments.len().max(1) as f32;
    for c in 0..3 {
        let (gain, offset) = match reference {
            Some(view) => (alignments[view].gain[c], alignments[view].offset[c]),
            None => (
                (alignments.iter().map(|a| a.gain[c].ln()).sum::<f32>() / n).exp(),
                alignments.iter().map(|a| a.offset[c]).sum::<f32>() / n,
            ),
        };
        for alignment in alignments.iter_mut() {
            alignment.gain[c] /= gain;
            alignment.offset[c] = if reference.is_some() {
                (alignment.offset[c] - offset) / gain
            } else {
                alignment.offset[c] - offset
            };
        }
    }
    // Normal equations of Σ |shift − J·T|².
    let (mut normal, mut moments) = (DMat3::ZERO, DVec3::ZERO);
    let rows: Vec<[DVec3; 2]> = cameras.iter().map(|camera| jacobian(camera, centre)).collect();
    for (view, (rows, alignment)) in rows.iter().zip(alignments.iter()).enumerate() {
        // The reference outweighs all others together.
        let weight = if reference == Some(view) { 100.0 * f64::from(n) } else { 1.0 };
        for k in 0..2 {
            let row = rows[k];
            normal += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
            moments += row * (weight * f64::from(alignment.shift[k]));
        }
    }
    // Directions that no picture constrains are not translated.
    let ridge = 1e-3 * (normal.x_axis.x + normal.y_axis.y + normal.z_axis.z);
    normal += DMat3::IDENTITY * ridge;
    if normal.determinant() <= 0.0 {
        return;
    }
    let translation = normal.inverse() * moments;
    for (rows, alignment) in rows.iter().zip(alignments) {
        for k in 0..2 {
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            {
                alignment.shift[k] -= rows[k].dot(translation) as f32;
            }
        }
    }
}

/// Derivative of the pixel position of a point with respect to the point; zero behind the camera.
fn jacobian(camera: &Camera, point: [f64; 3]) -> [DVec3; 2] {
    let [x, y, z] = camera.to_camera(point);
    if z <= camera.near {
        return [DVec3::ZERO; 2];
    }
    let k = &camera.intrinsics;
    let axis = |row: usize| DVec3::from_slice(&camera.viewmat[row][..3]);
    let (right, down, forward) = (axis(0), axis(1), axis(2));
    [(right / z - forward * (x / (z * z))) * k.fx, (down / z - forward * (y / (z * z))) * k.fy]
}
