//! Samples points on bodies: numbers, positions and unlit colours.

use crate::{
    body::Body,
    figure,
    math::{apportion, normal3, uniform},
    paint::{Material, Spot},
    part::{Kind, Part},
    shape::{Sampler, Shape},
    skeleton::Attach,
};
use glam::Vec3;
use rand_pcg::Pcg64;

/// A sampled point that becomes a splat, in bind coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub(crate) part: Part,
    pub(crate) kind: Kind,
    pub(crate) attach: Attach,
    pub(crate) rest: Vec3,
    pub(crate) normal: Vec3,
    /// Mean distance between splats of this body, world units.
    pub(crate) spacing: f32,
    pub(crate) material: Material,
}

/// Surface points (exactly `num_surface`) and points inside (exactly `num_interior`), shared by
/// area and density.
pub(crate) fn scatter(
    bodies: &[Body],
    num_surface: usize,
    num_interior: usize,
    rng: &mut Pcg64,
) -> Vec<Point> {
    let samplers: Vec<Sampler> =
        bodies.iter().map(|body| Sampler::new(&body.shape, body.keep)).collect();
    let areas: Vec<f64> = samplers.iter().map(|s| f64::from(s.area())).collect();
    let wanted: Vec<f64> =
        areas.iter().zip(bodies).map(|(area, body)| area * f64::from(body.density)).collect();
    let hollow: Vec<f64> = wanted
        .iter()
        .zip(bodies)
        .map(|(&w, body)| if matches!(body.shape, Shape::Quad { .. }) { 0.0 } else { w })
        .collect();
    let surface = apportion(num_surface, &wanted);
    let interior = apportion(num_interior, &hollow);
    let mut points = Vec::with_capacity(num_surface + num_interior);
    for (i, body) in bodies.iter().enumerate() {
        let spacing = (samplers[i].area() / surface[i].max(1) as f32).sqrt();
        let trimmed = body.shape.inset(0.55 * spacing);
        let sampler = Sampler::new(&trimmed, body.keep);
        for (count, kind) in [(surface[i], Kind::Surface), (interior[i], Kind::Interior)] {
            for sample in sampler.draw(count, rng) {
                let material = (body.paint)(&Spot {
                    part: body.part,
                    rest: sample.point,
                    normal: sample.normal,
                    uv: sample.uv,
                });
                let rest = if kind == Kind::Interior {
                    // uniform in the cross-section's area, away from the skin
                    let depth = uniform(rng, 0.02, 0.5).sqrt();
                    sample.core + (sample.point - sample.core) * depth
                } else {
                    let jitter = normal3(rng) * (0.09 * spacing);
                    sample.point + jitter - sample.normal * jitter.dot(sample.normal)
                };
                points.push(Point {
                    part: body.part,
                    kind,
                    attach: body.carrier.unwrap_or_else(|| figure::attach(body.part, rest)),
                    rest,
                    normal: sample.normal,
                    spacing,
                    material,
                });
            }
        }
    }
    points
}

/// Area of the bodies, world units², each counted with its density.
pub(crate) fn weighted_area(bodies: &[Body]) -> f32 {
    bodies.iter().map(|body| Sampler::new(&body.shape, body.keep).area() * body.density).sum()
}
