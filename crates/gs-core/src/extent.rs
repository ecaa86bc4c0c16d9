//! [`Extent`]: position and size of a scene, from which cameras and length scales are derived.

use crate::{Splats, weighted_quantile};

/// Share of the splats' weight that lies within [`Extent::radius`].
const RADIUS_SHARE: f64 = 0.9;
/// Share of the splats, by number, that lies within [`Extent::core`] of one of them.
const CORE_SHARE: f64 = 0.1;
/// Sample size for the distances of [`Extent::core`]. Doubling it changes
/// the result by at most 5 % on captured scenes.
const CORE_SAMPLE: usize = 1024;
/// Near plane in core radii. For captures of Neural 3D Video this gives 0.17 to 0.23 world units,
/// close to the reference's 0.2.
const NEAR_SHARE: f64 = 0.06;

/// Robust centre and size measures of the visible splats, world units. Floaters and haze have
/// little influence; NaN rows have none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Median of the centres per axis, each splat weighted by its opacity times its size.
    pub centre: [f64; 3],
    /// Distance from the centre within which 90 % of that weight lies; positive. Includes
    /// backdrops, because their splats are large.
    pub radius: f64,
    /// Radius of the smallest ball around a splat that contains a tenth of all splats, world
    /// units; positive. A backdrop with fewer than nine tenths of the splats does not affect it.
    pub core: f64,
    /// Median of the splats' sizes, world units: geometric mean of the two larger standard deviations.
    pub splat_size: f64,
}

impl Extent {
    /// Extent of the finite splats of one frame (stored parameters, world frame). If there are
    /// none, the unit ball around the origin.
    pub fn of(splats: &Splats) -> Self {
        let points = weighted_points(splats);
        let axis = |k: usize| points.iter().map(|p| (p.mean[k], p.weight)).collect();
        let quantile = |pairs, share| weighted_quantile(pairs, share).unwrap_or(0.0);
        let centre = [0, 1, 2].map(|k| quantile(axis(k), 0.5));
        let distances = points.iter().map(|p| (distance(p.mean, centre), p.weight)).collect();
        let positive = |length: f64, or: f64| if length > 0.0 { length } else { or };
        let sizes = points.iter().map(|p| (p.size, 1.0)).collect();
        let splat_size = positive(quantile(sizes, 0.5), 1.0);
        let radius = positive(quantile(distances, RADIUS_SHARE), splat_size);
        // Splats that all lie at one point have no spread; their own size is used instead.
        let core = positive(core_radius(&points), splat_size);
        Self { centre, radius, core, splat_size }
    }

    /// Near plane for cameras that were not used in training, world units: 6 % of [`Extent::core`].
    pub fn near_plane(&self) -> f64 {
        NEAR_SHARE * self.core
    }

    /// Spacing of single-precision coordinates at the centre, world units.
    pub fn position_step(&self) -> f64 {
        let farthest = self.centre.iter().fold(0.0_f64, |far, x| far.max(x.abs()));
        #[expect(clippy::cast_possible_truncation, reason = "the rounding is intended")]
        let farthest = farthest as f32;
        f64::from(farthest.next_up()) - f64::from(farthest)
    }
}

/// A visible splat, reduced to a weighted point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedPoint {
    /// Centre, world units.
    pub mean: [f64; 3],
    /// Geometric mean of the two larger standard deviations, world units.
    pub size: f64,
    /// Opacity times size.
    pub weight: f64,
}

/// The finite splats with positive weight.
pub fn weighted_points(splats: &Splats) -> Vec<WeightedPoint> {
    (0..splats.len())
        .filter(|&i| splats.is_finite(i))
        .map(|i| {
            let mut scale = splats.log_scales[i].map(|log| f64::from(log).exp());
            scale.sort_by(f64::total_cmp);
            let size = (scale[1] * scale[2]).sqrt();
            let weight = f64::from(splats.opacity(i)) * size;
            WeightedPoint { mean: splats.means[i].map(f64::from), size, weight }
        })
        .filter(|point| point.weight.is_finite() && point.weight > 0.0)
        .collect()
}

/// Radius of the smallest ball around a point of an evenly spaced sample that contains
/// [`CORE_SHARE`] of the sample.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a fraction of a count fits a count"
)]
fn core_radius(points: &[WeightedPoint]) -> f64 {
    let count = points.len().min(CORE_SAMPLE);
    let sample: Vec<[f64; 3]> = (0..count).map(|i| points[i * points.len() / count].mean).collect();
    let rank = (count as f64 * CORE_SHARE).ceil() as usize;
    let ball = |centre: &[f64; 3]| {
        let mut distances: Vec<f64> = sample.iter().map(|p| distance(*p, *centre)).collect();
        *distances.select_nth_unstable_by(rank.min(count - 1), f64::total_cmp).1
    };
    sample.iter().map(ball).min_by(f64::total_cmp).unwrap_or(0.0)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of 10×10×10 splats with side 2, scaled by `scale` and moved by `shift`, plus `dome`
    /// large splats about 5000 units away.
    fn scene(scale: f32, shift: f32, dome: usize) -> Splats {
        let mut splats = Splats::default();
        let mut push = |mean: [f32; 3], size: f32| {
            splats.means.push(mean.map(|x| x * scale + shift));
            splats.quats.push(crate::quat::IDENTITY);
            splats.log_scales.push([(size * scale).ln(); 3]);
            splats.opacity_logits.push(1.0);
            splats.sh.push([0.0; 3]);
        };
        for i in 0_u16..1000 {
            push([i % 10, i / 10 % 10, i / 100].map(|c| f32::from(c) / 4.5 - 1.0), 0.02);
        }
        for i in 0..dome {
            let (sin, cos) = (i as f32).sin_cos();
            push([5000.0 * sin, 2000.0, 5000.0 * cos], 300.0);
        }
        splats
    }

    #[test]
    fn extents_follow_scale_and_translation() {
        let plain = Extent::of(&scene(1.0, 0.0, 0));
        assert!((0.8..1.8).contains(&plain.radius), "{plain:?}");
        assert!((plain.splat_size - 0.02).abs() < 1e-6, "{plain:?}");
        for scale in [1e-3_f32, 1e-2, 1e2, 1e3] {
            let scaled = Extent::of(&scene(scale, 0.0, 0));
            let ratio = |a: f64, b: f64| (a / b / f64::from(scale) - 1.0).abs() < 1e-5;
            assert!(ratio(scaled.radius, plain.radius), "{scale}: {scaled:?}");
            assert!(ratio(scaled.near_plane(), plain.near_plane()), "{scale}: {scaled:?}");
            assert!(ratio(scaled.splat_size, plain.splat_size), "{scale}: {scaled:?}");
        }
        let shifted = Extent::of(&scene(1.0, 2000.0, 0));
        assert!((shifted.near_plane() / plain.near_plane() - 1.0).abs() < 1e-3, "{shifted:?}");
        assert!((shifted.centre[0] - 2000.0 - plain.centre[0]).abs() < 1e-3, "{shifted:?}");
    }

    #[test]
    fn a_backdrop_does_not_move_the_near_plane_into_the_scene() {
        for dome in [10, 1000, 8000] {
            let extent = Extent::of(&scene(1.0, 0.0, dome));
            assert!(extent.near_plane() < 0.1, "{dome} splats far away: {extent:?}");
        }
        let (half, far) = (Extent::of(&scene(1.0, 0.0, 1000)), Extent::of(&scene(1.0, 0.0, 0)));
        assert!(half.radius > 100.0 * far.radius, "the backdrop affects the radius: {half:?}");
    }

    #[test]
    fn empty_scenes_and_single_splats_have_an_extent() {
        let none = Extent::of(&Splats::default());
        assert!(none.radius == 1.0 && none.near_plane() > 0.0, "{none:?}");
        let one = Extent::of(&scene(1.0, 0.0, 0).select(&[0]));
        assert!((one.radius - 0.02).abs() < 1e-6 && one.core == one.radius, "{one:?}");
        let mut broken = scene(1.0, 0.0, 0);
        broken.means[0] = [f32::NAN; 3];
        broken.log_scales[1] = [f32::INFINITY; 3];
        assert!(Extent::of(&broken).near_plane() > 0.0, "NaN rows are ignored");
    }

    #[test]
    fn position_step_grows_with_the_distance_from_the_origin() {
        let step = |shift| Extent::of(&scene(1.0, shift, 0)).position_step();
        assert!(
            step(0.0) < 1e-6 && (0.05..0.1).contains(&step(1e6)),
            "{} {}",
            step(0.0),
            step(1e6)
        );
    }
}
