//! Colours: the unlit appearance of a body, and the baked light.

use crate::{math::smoothstep, part::Part};
use glam::Vec3;

/// A point on a body's surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    pub(crate) part: Part,
    /// Bind coordinates.
    pub(crate) rest: Vec3,
    /// Bind coordinates, unit.
    pub(crate) normal: Vec3,
    /// Surface parameters.
    pub(crate) uv: [f32; 2],
}

/// Colour before shading (sRGB values, 0–1) and gloss of the surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Material {
    pub(crate) rgb: Vec3,
    pub(crate) gloss: f32,
}

pub(crate) const fn rgb(r: f32, g: f32, b: f32) -> Vec3 {
    Vec3::new(r, g, b)
}

pub(crate) const fn matt(rgb: Vec3) -> Material {
    Material { rgb, gloss: 0.02 }
}

pub(crate) const fn shiny(rgb: Vec3, gloss: f32) -> Material {
    Material { rgb, gloss }
}

pub(crate) const SKIN: Vec3 = rgb(0.93, 0.71, 0.57);
pub(crate) const HAIR: Vec3 = rgb(0.33, 0.19, 0.13);

/// Smooth pseudo-random pattern in about [−1,1], wavelength about `1/frequency`.
pub(crate) fn ripple(p: Vec3, frequency: f32) -> f32 {
    let q = p * (std::f32::consts::TAU * frequency);
    let a = (q.x + 1.7 * (0.6 * q.y).sin() + 0.9 * q.z).sin();
    let b = (q.y * 1.13 - 1.3 * (0.7 * q.z).cos() + 0.4 * q.x).sin();
    let c = (q.z * 0.91 + 1.1 * (0.8 * q.x).sin() - 0.5 * q.y).sin();
    (a + b + c) / 3.0
}

/// 1 inside stripes of a periodic pattern, 0 between, edges `soft` wide (fraction of the period).
pub(crate) fn stripes(x: f32, period: f32, share: f32, soft: f32) -> f32 {
    let f = (x / period).rem_euclid(1.0);
    smoothstep(0.0, soft, f) * (1.0 - smoothstep(share, share + soft, f))
}

/// 1 within `radius` of the ellipse centre, soft edge.
pub(crate) fn blob(offset: [f32; 2], radii: [f32; 2]) -> f32 {
    let d = (offset[0] / radii[0]).hypot(offset[1] / radii[1]);
    1.0 - smoothstep(0.8, 1.15, d)
}

/// A sphere that casts soft shadows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Occluder {
    pub(crate) center: Vec3,
    pub(crate) radius: f32,
}

/// Unit, towards the key light.
pub(crate) fn key_light() -> Vec3 {
    Vec3::new(0.48, 0.74, 0.47)
}

/// Colour multiplier of the baked light at a point of the frame-1 world.
pub(crate) fn shade(point: Vec3, normal: Vec3, occluders: &[Occluder], casts: bool) -> Vec3 {
    let mut ambient = 1.0;
    let mut key = 1.0;
    let light = key_light();
    for occluder in occluders {
        let to = occluder.center - point;
        let distance2 = to.length_squared().max(1e-6);
        let facing = (normal.dot(to) / distance2.sqrt()).max(0.0);
        ambient *= 1.0 - 0.8 * facing * (occluder.radius.powi(2) / distance2).min(1.0);
        if casts {
            let along = to.dot(light);
            if along > occluder.radius {
                let miss = (distance2 - along * along).max(0.0).sqrt();
                // the penumbra widens with the distance from the occluder
                let soft = 0.25 * occluder.radius + 0.06 * along;
                let cover = 1.0 - smoothstep(occluder.radius - soft, occluder.radius + soft, miss);
                key *= 1.0 - 0.75 * cover;
            }
        }
    }
    let wrapped = ((normal.dot(light) + 0.35) / 1.35).max(0.0);
    let sky = 0.5 + 0.5 * normal.y;
    let sun = rgb(1.0, 0.94, 0.84) * (0.70 * wrapped * key);
    let fill = (rgb(0.42, 0.47, 0.58) * sky + rgb(0.33, 0.26, 0.24) * (1.0 - sky)) * 1.12;
    sun + fill * ambient
}

/// Degree-1 coefficients of a highlight: brighter by up to `gloss` where the view direction equals
/// the mirrored light direction.
pub(crate) fn highlight(normal: Vec3, gloss: f32) -> [[f32; 3]; 3] {
    let mirrored = 2.0 * normal.dot(key_light()) * normal - key_light();
    // the view direction points from the camera to the splat; it is
    // −mirrored where the highlight is visible
    let a = -mirrored * (gloss / gs_core::sh::C1);
    [[-a.y; 3], [a.z; 3], [-a.x; 3]]
}

/// Perceived brightness of an sRGB triple.
pub(crate) fn luma(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.299, 0.587, 0.114))
}

/// Rotates the hue by `angle_rad` about the grey axis; grey is unchanged.
pub(crate) fn rotate_hue(rgb: Vec3, angle_rad: f32) -> Vec3 {
    let grey = Vec3::splat(1.0 / 3.0_f32.sqrt());
    (glam::Quat::from_axis_angle(grey, angle_rad) * rgb).clamp(Vec3::ZERO, Vec3::ONE)
}
