//! Arm angle at which the swinging forearm grazes the body.

use crate::{
    body::Body,
    dance::Dance,
    math::rng,
    part::Part,
    sampler::{Point, scatter, weighted_area},
    skeleton::Skeleton,
};

/// Target for the smallest distance between forearm and body, splat spacings.
const GAP: f64 = 1.5;

/// The dance with the arm's angle such that the forearm passes the body at [`GAP`] spacings of a
/// source of `num_surface` splats.
pub(super) fn dance(bodies: &[Body], num_surface: usize, dance: Dance) -> Dance {
    let spacing = f64::from((weighted_area(bodies) / num_surface as f32).sqrt());
    let points = scatter(bodies, 4000, 0, &mut rng(0, 50));
    let of = |parts: &[Part]| -> Vec<Point> {
        points.iter().filter(|point| parts.contains(&point.part)).copied().collect()
    };
    let arm = of(&[Part::ForearmL]);
    let body = of(&[Part::Chest, Part::Pelvis, Part::ThighL]);
    let (mut close, mut far) = (0.0_f64, 0.6_f64);
    for _ in 0..12 {
        let middle = f64::midpoint(close, far);
        let skeleton = Skeleton { dance: Dance { abduct_rad: middle, ..dance } };
        if clearance(&skeleton, &arm, &body) < GAP * spacing {
            close = middle;
        } else {
            far = middle;
        }
    }
    Dance { abduct_rad: far, ..dance }
}

/// Smallest distance between the two sets of points over the clip, world units.
fn clearance(skeleton: &Skeleton, arm: &[Point], body: &[Point]) -> f64 {
    let mut smallest = f64::INFINITY;
    for step in 0..8 {
        let pose = skeleton.pose_at(f64::from(step) / 8.0);
        let place = |point: &Point| pose.point(point.attach, point.rest.as_dvec3());
        let body: Vec<_> = body.iter().map(place).collect();
        for point in arm {
            let x = place(point);
            for y in &body {
                smallest = smallest.min(x.distance_squared(*y));
            }
        }
    }
    smallest.sqrt()
}
