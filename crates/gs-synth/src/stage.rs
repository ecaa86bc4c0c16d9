//! Surroundings of the figure: ground disc, columns, crates, balls,
//! backdrop; and the bodies of the small scenes.

use crate::{
    body::Body,
    cloth,
    math::smoothstep,
    paint::{Material, Occluder, Spot, matt, rgb, ripple, shiny, stripes},
    part::Part,
    shape::{Ring, Shape, ring},
};
use glam::{Mat3, Vec3};

/// Radius of the ground disc, world units.
const DISC: f32 = 1.5;
/// Distance of the backdrop's wall, world units.
const WALL: f32 = 6.5;

/// A column: base, fluted shaft, capital.
fn column(x: f32, z: f32, height: f32) -> Body {
    let rings: Vec<Ring> = [
        (0.0, 0.145),
        (0.02, 0.148),
        (0.045, 0.142),
        (0.06, 0.120),
        (0.10, 0.112),
        (0.35, 0.108),
        (0.65, 0.102),
        (0.90, 0.097),
        (0.925, 0.115),
        (0.95, 0.134),
        (0.975, 0.138),
        (0.99, 0.130),
        (0.997, 0.09),
        (1.0, 0.0),
    ]
    .iter()
    .map(|&(share, radius)| ring(share * height, [0.0, 0.0], [radius, radius]))
    .collect();
    Body::new(
        Part::Column,
        Shape::Lathe { rings, basis: Mat3::IDENTITY, origin: Vec3::new(x, 0.0, z) },
        stone,
    )
}

fn crate_box(center: [f32; 3], half: f32, rotation_rad: f32) -> Vec<Body> {
    Shape::cuboid(Vec3::from(center), Mat3::from_rotation_y(rotation_rad), Vec3::splat(half))
        .into_iter()
        .map(|face| Body::new(Part::Crate, face, planks))
        .collect()
}

fn ball(center: [f32; 3], radius: f32, paint: fn(&Spot) -> Material) -> Body {
    Body::new(Part::Ball, Shape::ellipsoid(Vec3::from(center), Vec3::splat(radius)), paint)
        .denser(1.5)
}

/// Columns, crates, balls.
pub(crate) fn props() -> Vec<Body> {
    let mut bodies = vec![
        column(-0.98, -0.85, 1.65),
        column(-1.22, -0.12, 0.85),
        ball([0.80, 0.15, 0.50], 0.15, beach),
        ball([-0.80, 0.11, 0.62], 0.11, |_| shiny(rgb(0.16, 0.58, 0.60), 0.16)),
        ball([-1.22, 0.99, -0.12], 0.14, |_| shiny(rgb(0.93, 0.71, 0.24), 0.16)),
    ];
    bodies.extend(crate_box([0.94, 0.21, -0.62], 0.21, 0.35));
    bodies.extend(crate_box([0.91, 0.56, -0.64], 0.14, -0.2));
    bodies
}

/// Shadows of the props.
pub(crate) fn occluders() -> Vec<Occluder> {
    let at = |center: [f32; 3], radius| Occluder { center: Vec3::from(center), radius };
    let mut spheres = vec![
        at([0.80, 0.15, 0.50], 0.15),
        at([-0.80, 0.11, 0.62], 0.11),
        at([-1.22, 0.99, -0.12], 0.14),
        at([0.94, 0.21, -0.62], 0.24),
        at([0.91, 0.56, -0.64], 0.16),
    ];
    for k in 0_u8..9 {
        spheres.push(at([-0.98, 0.1 + 0.18 * f32::from(k), -0.85], 0.11));
    }
    for k in 0_u8..5 {
        spheres.push(at([-1.22, 0.1 + 0.17 * f32::from(k), -0.12], 0.11));
    }
    spheres
}

/// The patterned disc and its rim.
pub(crate) fn ground() -> Vec<Body> {
    let rim = [ring(-0.10, [0.0; 2], [DISC - 0.01; 2]), ring(-0.03, [0.0; 2], [DISC - 0.01; 2])];
    vec![
        Body::new(
            Part::Ground,
            Shape::Annulus {
                center: Vec3::ZERO,
                axes: [Vec3::Z * DISC, Vec3::X * DISC],
                inner: 0.0,
            },
            mosaic,
        ),
        Body::new(Part::Ground, Shape::lathe(&rim), |_| matt(rgb(0.60, 0.55, 0.52))),
    ]
}

/// Floor and wall around the disc, closed overhead.
pub(crate) fn backdrop() -> Vec<Body> {
    vec![
        Body::new(
            Part::Backdrop,
            Shape::Annulus {
                center: Vec3::new(0.0, -0.10, 0.0),
                axes: [Vec3::Z * WALL, Vec3::X * WALL],
                inner: 0.24,
            },
            haze,
        )
        .denser(2.0),
        Body::new(
            Part::Backdrop,
            Shape::Ellipsoid {
                center: Vec3::new(0.0, -0.3, 0.0),
                basis: Mat3::from_diagonal(Vec3::new(WALL, 5.0, WALL)),
            },
            haze,
        )
        .cut(|p| p.y > -0.35),
    ]
}

/// Two bodies that touch at frame 1: a ball and a rounded block.
pub(crate) fn two_objects() -> Vec<Body> {
    vec![
        Body::new(
            Part::ObjectA,
            Shape::ellipsoid(Vec3::new(-0.3, 0.3, 0.0), Vec3::splat(0.298)),
            beach_a,
        ),
        Body::new(
            Part::ObjectB,
            Shape::Ellipsoid {
                center: Vec3::new(0.3, 0.3, 0.0),
                basis: Mat3::from_diagonal(Vec3::new(0.298, 0.42, 0.26)),
            },
            checker,
        ),
    ]
}

/// The sheet of [`crate::cloth`], front and back.
pub(crate) fn sheet() -> Vec<Body> {
    let [half, top, bottom] =
        [cloth::HALF_WIDTH, cloth::TOP, cloth::BOTTOM].map(crate::math::narrow);
    let (across, up) = (Vec3::X * (2.0 * half), Vec3::Y * (top - bottom));
    let thick = 0.004;
    vec![
        Body::new(
            Part::Cloth,
            Shape::Quad { corner: Vec3::new(-half, bottom, thick), across, up },
            tartan,
        ),
        Body::new(
            Part::Cloth,
            Shape::Quad { corner: Vec3::new(half, bottom, -thick), across: -across, up },
            tartan,
        ),
    ]
}

fn stone(spot: &Spot) -> Material {
    let p = spot.rest;
    let flutes = 0.5 + 0.5 * (std::f32::consts::TAU * 9.0 * spot.uv[1]).sin();
    let shaft = if spot.normal.y.abs() < 0.3 { flutes } else { 0.8 };
    let veins = 0.05 * ripple(p, 2.5);
    matt(rgb(0.90, 0.86, 0.80) * (0.80 + 0.2 * shaft + veins))
}

fn planks(spot: &Spot) -> Material {
    let [u, v] = spot.uv;
    let border = u.min(1.0 - u).min(v.min(1.0 - v)) < 0.13;
    let diagonal = (u - v).abs() < 0.11;
    let grain = 0.07 * (v * 60.0 + 3.0 * ripple(spot.rest, 3.0)).sin();
    let tone = if border || diagonal { 1.0 } else { 0.74 };
    let gap = if border || diagonal { 0.0 } else { stripes(v, 0.148, 0.14, 0.05) };
    matt(rgb(0.78, 0.56, 0.34) * (tone * (1.0 + grain)) * (1.0 - 0.45 * gap))
}

fn beach_ball(p: Vec3) -> Material {
    let sector = (p.x.atan2(p.z) / std::f32::consts::TAU * 6.0 + 0.3).rem_euclid(6.0);
    let colors = [
        rgb(0.89, 0.27, 0.22),
        rgb(0.97, 0.94, 0.88),
        rgb(0.97, 0.74, 0.22),
        rgb(0.97, 0.94, 0.88),
        rgb(0.20, 0.50, 0.72),
        rgb(0.97, 0.94, 0.88),
    ];
    let cap = p.y.abs() > 0.96;
    shiny(if cap { colors[0] } else { colors[crate::math::floor_index(sector).min(5)] }, 0.15)
}

fn beach(spot: &Spot) -> Material {
    // tilted, so that the seams are visible
    beach_ball(Mat3::from_rotation_x(0.6) * Mat3::from_rotation_z(0.35) * spot.normal)
}

fn beach_a(spot: &Spot) -> Material {
    beach_ball(Mat3::from_rotation_z(1.2) * spot.normal)
}

fn checker(spot: &Spot) -> Material {
    let p = spot.rest / 0.09;
    let odd = (p.x.floor() + p.y.floor() + p.z.floor()).rem_euclid(2.0) > 0.5;
    shiny(if odd { rgb(0.30, 0.34, 0.62) } else { rgb(0.93, 0.90, 0.83) }, 0.06)
}

fn tartan(spot: &Spot) -> Material {
    let p = spot.rest;
    let across = stripes(p.x, 0.2, 0.35, 0.04);
    let down = stripes(p.y, 0.2, 0.35, 0.04);
    let thin = stripes(p.x + 0.13, 0.2, 0.05, 0.03).max(stripes(p.y + 0.13, 0.2, 0.05, 0.03));
    let base = rgb(0.70, 0.17, 0.18) * (1.0 - 0.38 * (across + down));
    matt(base + (rgb(0.95, 0.80, 0.35) - base) * (0.8 * thin))
}

/// Rings of tiles around a star.
fn mosaic(spot: &Spot) -> Material {
    let p = spot.rest;
    let radius = p.x.hypot(p.z);
    let angle = p.x.atan2(p.z);
    let (light, dark) = (rgb(0.87, 0.82, 0.73), rgb(0.46, 0.52, 0.55));
    let warm = rgb(0.80, 0.47, 0.33);
    let turn = angle / std::f32::consts::TAU + 1.0;
    let edge = |at: f32| smoothstep(at - 0.012, at + 0.012, radius);
    let star = 0.50 + 0.17 * (std::f32::consts::TAU * turn * 8.0).cos();
    let inside = 1.0 - smoothstep(star - 0.02, star + 0.02, radius);
    let mut c = light + (warm * 1.06 - light) * inside;
    let heart = 1.0 - edge(0.27);
    c += (rgb(0.96, 0.76, 0.44) - c) * heart;
    let row = if radius < 1.05 { 0.0 } else { 0.5 };
    let tile = stripes(turn + row / 14.0, 1.0 / 14.0, 0.5, 0.09);
    let band = edge(0.78) * (1.0 - edge(1.32));
    c += (light + (dark - light) * tile - c) * band;
    let line = edge(1.34) * (1.0 - edge(1.42));
    c += (warm - c) * line;
    c *= 1.0 + 0.035 * ripple(p, 3.0);
    shiny(c, 0.03)
}

/// Warm horizon under a cool sky, soft clouds.
fn haze(spot: &Spot) -> Material {
    let p = spot.rest;
    let height = smoothstep(-0.2, 4.2, p.y);
    let horizon = 1.0 - smoothstep(0.0, 1.1, (p.y + 0.1).abs());
    let low = rgb(0.74, 0.76, 0.80);
    let high = rgb(0.36, 0.48, 0.66);
    let clouds = 0.05 * ripple(p, 0.22) * (1.0 - height);
    let mut c = low + (high - low) * height + Vec3::splat(clouds);
    c += (rgb(0.95, 0.83, 0.72) - c) * (0.6 * horizon);
    if p.y < -0.05 {
        let far = smoothstep(1.6, WALL, p.x.hypot(p.z));
        c = rgb(0.56, 0.55, 0.56) + (c - rgb(0.56, 0.55, 0.56)) * far;
    }
    Material { rgb: c, gloss: 0.0 }
}
