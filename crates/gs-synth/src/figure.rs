//! The figure in its bind pose: bodies, colours, attachment of points. Height 1.8 world units.

use crate::{
    body::Body,
    math::smoothstep,
    paint::{HAIR, Material, Occluder, SKIN, Spot, blob, matt, rgb, ripple, shiny, stripes},
    part::{Bone, Part},
    shape::{Ring, Shape, ring},
    skeleton::Attach,
};
use glam::{Mat3, Vec3};

/// Half-trunk from crotch to neck, `(x, z)` centres and half-widths.
const TRUNK: [Ring; 14] = [
    ring(0.785, [0.0, 0.0], [0.012, 0.012]),
    ring(0.80, [0.0, 0.0], [0.07, 0.06]),
    ring(0.84, [0.0, -0.003], [0.135, 0.098]),
    ring(0.90, [0.0, -0.008], [0.166, 0.120]),
    ring(0.97, [0.0, -0.006], [0.160, 0.116]),
    ring(1.03, [0.0, 0.0], [0.145, 0.107]),
    ring(1.10, [0.0, 0.004], [0.141, 0.106]),
    ring(1.18, [0.0, 0.008], [0.150, 0.113]),
    ring(1.26, [0.0, 0.010], [0.166, 0.122]),
    ring(1.34, [0.0, 0.004], [0.184, 0.122]),
    ring(1.39, [0.0, -0.004], [0.184, 0.108]),
    ring(1.427, [0.0, -0.010], [0.150, 0.086]),
    ring(1.455, [0.0, -0.012], [0.088, 0.068]),
    ring(1.475, [0.0, -0.012], [0.05, 0.05]),
];
/// Rings of the trunk that belong to the pelvis; the chest begins with the last of them.
const PELVIS_RINGS: usize = 6;

const HEAD: [Ring; 10] = [
    ring(1.478, [0.0, 0.030], [0.0, 0.0]),
    ring(1.484, [0.0, 0.030], [0.042, 0.046]),
    ring(1.508, [0.0, 0.022], [0.076, 0.084]),
    ring(1.555, [0.0, 0.012], [0.106, 0.115]),
    ring(1.615, [0.0, 0.004], [0.120, 0.131]),
    ring(1.675, [0.0, 0.000], [0.118, 0.130]),
    ring(1.725, [0.0, 0.000], [0.100, 0.112]),
    ring(1.762, [0.0, 0.000], [0.066, 0.074]),
    ring(1.779, [0.0, 0.000], [0.030, 0.034]),
    ring(1.783, [0.0, 0.000], [0.0, 0.0]),
];

fn mirrored(rings: &[Ring], side: f32) -> Shape {
    let flipped: Vec<Ring> =
        rings.iter().map(|r| ring(r.y, [side * r.center[0], r.center[1]], r.radii)).collect();
    Shape::lathe(&flipped)
}

/// All bodies of the figure.
pub(crate) fn bodies() -> Vec<Body> {
    let mut bodies = vec![
        Body::new(Part::Pelvis, Shape::lathe(&TRUNK[..PELVIS_RINGS]), trousers),
        Body::new(Part::Chest, Shape::lathe(&TRUNK[PELVIS_RINGS - 1..]), shirt).denser(1.1),
        Body::new(
            Part::Head,
            Shape::lathe(&[
                ring(1.42, [0.0, -0.012], [0.056, 0.056]),
                ring(1.46, [0.0, -0.008], [0.051, 0.052]),
                ring(1.53, [0.0, 0.0], [0.050, 0.052]),
            ]),
            skin,
        ),
        Body::new(Part::Head, Shape::lathe(&HEAD), face).denser(4.5).cut(is_face),
        Body::new(Part::Head, Shape::lathe(&HEAD), skin).cut(|p| below_hair(p) && !is_face(p)),
        Body::new(
            Part::Head,
            Shape::lathe(&HEAD.map(|r| {
                let lift = 1.0 + 0.09 * smoothstep(1.45, 1.60, r.y);
                ring(
                    1.60 + (r.y - 1.60) * 1.07,
                    [0.0, r.center[1] - 0.006],
                    [r.radii[0] * lift, r.radii[1] * (lift + 0.01)],
                )
            })),
            hair,
        )
        .denser(1.8)
        .cut(above_hairline),
        Body::new(
            Part::Head,
            Shape::ellipsoid(Vec3::new(0.0, 1.592, 0.139), Vec3::new(0.017, 0.024, 0.019)),
            skin,
        )
        .denser(2.5),
    ];
    for side in [1.0, -1.0] {
        bodies.extend(limbs(side));
    }
    bodies
}

/// A lantern in the right hand.
pub(crate) fn lantern() -> Vec<Body> {
    let middle = Vec3::new(-0.24, 0.64, 0.05);
    let glass = Shape::ellipsoid(middle, Vec3::new(0.055, 0.075, 0.055));
    let grip = Shape::cuboid(
        middle + Vec3::new(0.03, 0.095, -0.03),
        Mat3::from_rotation_z(-0.3),
        Vec3::new(0.008, 0.04, 0.008),
    );
    let held = |shape| Body::new(Part::Held, shape, lamp).carried_by(Attach::rigid(Bone::ForearmR));
    std::iter::once(held(glass)).chain(grip.into_iter().map(held)).collect()
}

fn lamp(spot: &Spot) -> Material {
    let rib = stripes(spot.rest.y, 0.03, 0.3, 0.2);
    shiny(rgb(0.95, 0.78, 0.35) * (1.0 - 0.5 * rib), 0.12)
}

fn limbs(side: f32) -> Vec<Body> {
    let pick = |left: Part, right: Part| if side > 0.0 { left } else { right };
    let (upper, fore) =
        (pick(Part::UpperArmL, Part::UpperArmR), pick(Part::ForearmL, Part::ForearmR));
    let (thigh, shin) = (pick(Part::ThighL, Part::ThighR), pick(Part::ShinL, Part::ShinR));
    let foot = pick(Part::FootL, Part::FootR);
    let (arm, leg) = (0.2, 0.096);
    let z = -0.005;
    vec![
        Body::new(
            Part::Head,
            Shape::ellipsoid(
                Vec3::new(side * 0.119, 1.605, -0.008),
                Vec3::new(0.016, 0.034, 0.022),
            ),
            skin,
        )
        .denser(1.8),
        Body::new(
            upper,
            mirrored(
                &[
                    ring(1.418, [arm - 0.035, z], [0.0, 0.0]),
                    ring(1.415, [arm - 0.032, z], [0.024, 0.026]),
                    ring(1.400, [arm - 0.02, z], [0.044, 0.050]),
                    ring(1.360, [arm - 0.004, z], [0.055, 0.062]),
                    ring(1.31, [arm, z], [0.054, 0.061]),
                    ring(1.245, [arm, z], [0.053, 0.058]),
                    ring(1.232, [arm, z], [0.052, 0.057]),
                    ring(1.222, [arm, z], [0.043, 0.047]),
                    ring(1.17, [arm, z], [0.041, 0.044]),
                    ring(1.11, [arm, z], [0.038, 0.041]),
                ],
                side,
            ),
            sleeve,
        ),
        Body::new(
            fore,
            Shape::ellipsoid(Vec3::new(side * arm, 1.11, z), Vec3::splat(0.0385)),
            skin,
        ),
        Body::new(
            fore,
            mirrored(
                &[
                    ring(1.11, [arm, z], [0.038, 0.041]),
                    ring(1.06, [arm, z], [0.041, 0.043]),
                    ring(1.00, [arm, z], [0.038, 0.040]),
                    ring(0.93, [arm, z], [0.031, 0.034]),
                    ring(0.87, [arm, z], [0.026, 0.030]),
                    ring(0.845, [arm, z], [0.027, 0.036]),
                    ring(0.80, [arm, z], [0.027, 0.047]),
                    ring(0.75, [arm, z + 0.002], [0.024, 0.045]),
                    ring(0.71, [arm - 0.005, z + 0.004], [0.019, 0.036]),
                    ring(0.688, [arm - 0.008, z + 0.004], [0.010, 0.020]),
                    ring(0.682, [arm - 0.008, z + 0.004], [0.0, 0.0]),
                ],
                side,
            ),
            skin,
        )
        .denser(1.25),
        Body::new(
            fore,
            Shape::Ellipsoid {
                center: Vec3::new(side * (arm - 0.01), 0.795, 0.045),
                basis: Mat3::from_rotation_x(-0.5)
                    * Mat3::from_diagonal(Vec3::new(0.014, 0.036, 0.015)),
            },
            skin,
        )
        .denser(1.5),
        Body::new(
            thigh,
            mirrored(
                &[
                    ring(0.955, [leg - 0.02, -0.005], [0.0, 0.0]),
                    ring(0.95, [leg - 0.02, -0.005], [0.03, 0.04]),
                    ring(0.92, [leg - 0.012, -0.005], [0.064, 0.085]),
                    ring(0.87, [leg - 0.006, -0.004], [0.082, 0.103]),
                    ring(0.80, [leg, 0.0], [0.086, 0.102]),
                    ring(0.70, [leg, 0.002], [0.078, 0.090]),
                    ring(0.60, [leg, 0.002], [0.068, 0.077]),
                    ring(0.50, [leg, 0.0], [0.061, 0.067]),
                ],
                side,
            ),
            trousers,
        ),
        Body::new(
            shin,
            Shape::ellipsoid(Vec3::new(side * leg, 0.5, 0.0), Vec3::new(0.061, 0.061, 0.066)),
            trousers,
        ),
        Body::new(
            shin,
            mirrored(
                &[
                    ring(0.50, [leg, 0.0], [0.061, 0.067]),
                    ring(0.42, [leg, -0.008], [0.061, 0.068]),
                    ring(0.30, [leg, -0.010], [0.058, 0.064]),
                    ring(0.18, [leg, -0.010], [0.057, 0.061]),
                    ring(0.11, [leg, -0.010], [0.060, 0.064]),
                    ring(0.085, [leg, -0.008], [0.061, 0.066]),
                    ring(0.08, [leg, -0.008], [0.045, 0.05]),
                ],
                side,
            ),
            trousers,
        ),
        Body::new(foot, shoe(side * 0.1), leather).denser(1.4),
    ]
}

/// Heel to toe along z.
fn shoe(x: f32) -> Shape {
    // lathe axes (x, along, z) become world (x, z, −y): determinant +1
    let rings = [
        ring(-0.088, [0.0, -0.042], [0.0, 0.0]),
        ring(-0.084, [0.0, -0.042], [0.024, 0.026]),
        ring(-0.065, [0.0, -0.045], [0.043, 0.043]),
        ring(-0.02, [0.0, -0.054], [0.048, 0.053]),
        ring(0.03, [0.0, -0.050], [0.050, 0.049]),
        ring(0.09, [0.0, -0.040], [0.053, 0.039]),
        ring(0.14, [0.0, -0.034], [0.050, 0.033]),
        ring(0.172, [0.0, -0.031], [0.032, 0.024]),
        ring(0.180, [0.0, -0.030], [0.0, 0.0]),
    ];
    Shape::Lathe {
        rings: rings.to_vec(),
        basis: Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y),
        origin: Vec3::new(x, 0.0, 0.0),
    }
}

/// Attachment of a point of the figure.
pub(crate) fn attach(part: Part, rest: Vec3) -> Attach {
    let below = |y: f32, half: f32| smoothstep(-half, half, y - rest.y);
    match part {
        Part::Pelvis | Part::Chest => Attach::joint(Bone::Chest, smoothstep(0.98, 1.15, rest.y)),
        Part::Head => Attach::joint(Bone::Head, smoothstep(1.44, 1.51, rest.y)),
        Part::UpperArmL | Part::UpperArmR | Part::ForearmL | Part::ForearmR => {
            let left = matches!(part, Part::UpperArmL | Part::ForearmL);
            let (upper, fore) = if left {
                (Bone::UpperArmL, Bone::ForearmL)
            } else {
                (Bone::UpperArmR, Bone::ForearmR)
            };
            let bend = below(1.11, 0.065);
            if bend > 0.0 {
                Attach::joint(fore, bend)
            } else {
                Attach::joint(upper, below(1.385, 0.06))
            }
        }
        Part::ThighL | Part::ShinL => leg_attach([Bone::ThighL, Bone::ShinL], rest.y),
        Part::ThighR | Part::ShinR => leg_attach([Bone::ThighR, Bone::ShinR], rest.y),
        _ => Attach::rigid(part.bone()),
    }
}

fn leg_attach([thigh, shin]: [Bone; 2], y: f32) -> Attach {
    let bend = smoothstep(-0.055, 0.055, 0.5 - y);
    if bend > 0.0 {
        Attach::joint(shin, bend)
    } else {
        Attach::joint(thigh, smoothstep(-0.05, 0.09, 0.9 - y))
    }
}

/// Spheres that represent the figure when light is baked: part, bind centre, radius.
pub(crate) fn occluders() -> Vec<(Part, Occluder)> {
    let mut spheres: Vec<(Part, [f32; 3], f32)> = vec![
        (Part::Pelvis, [0.06, 0.90, 0.0], 0.105),
        (Part::Pelvis, [-0.06, 0.90, 0.0], 0.105),
        (Part::Chest, [0.0, 1.08, 0.0], 0.12),
        (Part::Chest, [0.06, 1.22, 0.0], 0.105),
        (Part::Chest, [-0.06, 1.22, 0.0], 0.105),
        (Part::Chest, [0.08, 1.35, 0.0], 0.095),
        (Part::Chest, [-0.08, 1.35, 0.0], 0.095),
        (Part::Head, [0.0, 1.57, 0.015], 0.105),
        (Part::Head, [0.0, 1.65, 0.0], 0.12),
    ];
    for side in [1.0_f32, -1.0] {
        let pick = |left: Part, right: Part| if side > 0.0 { left } else { right };
        let x = side * 0.2;
        for (y, radius) in [(1.36, 0.055), (1.27, 0.05), (1.18, 0.042)] {
            spheres.push((pick(Part::UpperArmL, Part::UpperArmR), [x, y, 0.0], radius));
        }
        for (y, radius) in
            [(1.09, 0.04), (1.01, 0.038), (0.93, 0.032), (0.86, 0.028), (0.77, 0.026)]
        {
            spheres.push((pick(Part::ForearmL, Part::ForearmR), [x, y, 0.0], radius));
        }
        let x = side * 0.096;
        for (y, radius) in [(0.8, 0.085), (0.69, 0.078), (0.58, 0.068)] {
            spheres.push((pick(Part::ThighL, Part::ThighR), [x, y, 0.0], radius));
        }
        for (y, radius) in [(0.47, 0.062), (0.37, 0.06), (0.27, 0.058), (0.17, 0.056)] {
            spheres.push((pick(Part::ShinL, Part::ShinR), [x, y, 0.0], radius));
        }
        for (z, radius) in [(-0.04, 0.045), (0.04, 0.045), (0.11, 0.036)] {
            spheres.push((pick(Part::FootL, Part::FootR), [side * 0.1, 0.045, z], radius));
        }
    }
    spheres
        .into_iter()
        .map(|(part, center, radius)| (part, Occluder { center: Vec3::from(center), radius }))
        .collect()
}

/// Height of the hairline at this depth and width; hair above, skin below.
fn hairline(p: Vec3) -> f32 {
    let fringe = 0.012 * (p.x * 55.0 + 0.8).sin();
    (1.565 + 1.02 * (p.z + 0.02)).clamp(1.50, 1.700 + fringe)
        - 0.15 * p.x.abs() * smoothstep(0.0, 0.1, p.z)
}

fn above_hairline(p: Vec3) -> bool {
    p.y > hairline(p)
}

fn is_face(p: Vec3) -> bool {
    below_hair(p) && p.z > 0.045
}

fn below_hair(p: Vec3) -> bool {
    p.y < hairline(p) + 0.035
}

fn skin(spot: &Spot) -> Material {
    let mottle = 0.015 * ripple(spot.rest, 9.0);
    let knuckles = if spot.rest.y < 0.74 { -0.03 } else { 0.0 };
    shiny(SKIN + rgb(mottle + knuckles, mottle + knuckles * 1.3, mottle + knuckles * 1.3), 0.045)
}

fn face(spot: &Spot) -> Material {
    let p = spot.rest;
    let mut c = SKIN;
    if p.z > 0.0 {
        let x = p.x.abs();
        let mix = |c: Vec3, to: Vec3, amount: f32| c + (to - c) * amount;
        c = mix(c, rgb(0.93, 0.52, 0.46), 0.5 * blob([x - 0.070, p.y - 1.570], [0.028, 0.019]));
        c = mix(c, rgb(0.98, 0.97, 0.95), blob([x - 0.045, p.y - 1.618], [0.026, 0.023]));
        c = mix(c, rgb(0.16, 0.30, 0.36), blob([x - 0.043, p.y - 1.617], [0.0155, 0.0185]));
        c = mix(c, rgb(0.04, 0.04, 0.06), blob([x - 0.043, p.y - 1.617], [0.0088, 0.0110]));
        let glint = blob([x - 0.047, p.y - 1.624], [0.0045, 0.0045]);
        c = mix(c, Vec3::ONE, glint);
        let brow = 1.660 - 9.0 * (x - 0.050).powi(2);
        c = mix(c, HAIR, blob([x - 0.047, p.y - brow], [0.026, 0.0065]));
        let smile = 1.530 + 12.0 * p.x * p.x;
        c = mix(c, rgb(0.72, 0.27, 0.27), blob([p.x, p.y - smile], [0.043, 0.0075]));
    }
    shiny(c, 0.04)
}

fn hair(spot: &Spot) -> Material {
    let p = spot.rest;
    let angle = p.x.atan2(p.z + 0.02);
    let strands = 0.5 + 0.5 * (angle * 21.0 + 2.0 * ripple(p, 4.0)).sin();
    shiny(HAIR * (0.8 + 0.45 * strands), 0.07)
}

/// Cream and teal, horizontal.
fn shirt(spot: &Spot) -> Material {
    let p = spot.rest;
    let band = stripes(p.y + 0.012, 0.066, 0.42, 0.16);
    let (cream, teal) = (rgb(0.96, 0.91, 0.80), rgb(0.13, 0.52, 0.55));
    let mut c = cream + (teal - cream) * band;
    let collar = smoothstep(1.444, 1.450, p.y);
    c += (teal * 0.9 - c) * collar;
    let pocket = p.z > 0.05 && (p.x - 0.075).abs() < 0.038 && (p.y - 1.285).abs() < 0.036;
    if pocket {
        c = rgb(0.93, 0.62, 0.25);
    }
    if p.y < 1.045 {
        return trousers(spot);
    }
    matt(c * (1.0 + 0.04 * ripple(p, 7.0)))
}

fn sleeve(spot: &Spot) -> Material {
    let p = spot.rest;
    if p.y < 1.228 {
        return skin(spot);
    }
    if p.y < 1.250 {
        return matt(rgb(0.13, 0.52, 0.55) * 0.95);
    }
    shirt(spot)
}

/// Indigo with seams, turn-ups and a belt.
fn trousers(spot: &Spot) -> Material {
    let p = spot.rest;
    if p.y > 0.995 {
        let buckle = p.x.abs() < 0.024 && p.z > 0.0;
        return if buckle {
            shiny(rgb(0.88, 0.74, 0.36), 0.12)
        } else {
            shiny(rgb(0.36, 0.20, 0.11), 0.06)
        };
    }
    let weave = 0.06 * ripple(p, 11.0) + 0.05 * (p.y * 210.0 + p.x * 130.0).sin();
    let worn =
        0.22 * blob([(p.x.abs() - 0.096), p.y - 0.72], [0.07, 0.16]) * smoothstep(0.0, 0.07, p.z);
    let mut c = rgb(0.17, 0.24, 0.43) * (1.0 + weave) + Vec3::splat(worn * 0.6);
    let sideways = spot.normal.x * p.x.signum();
    let seam = p.y < 0.93 && sideways > 0.965;
    if seam {
        c *= 0.72;
    }
    if p.y < 0.125 {
        c = rgb(0.44, 0.53, 0.70);
    }
    matt(c)
}

fn leather(spot: &Spot) -> Material {
    let p = spot.rest;
    if p.y < 0.022 {
        return matt(rgb(0.95, 0.93, 0.88));
    }
    if p.z > 0.118 {
        return shiny(rgb(0.95, 0.92, 0.86), 0.06);
    }
    let laces = p.y > 0.06 && p.z > 0.02 && p.x.abs() > 0.08 && p.x.abs() < 0.12;
    if laces && stripes(p.z, 0.024, 0.5, 0.1) > 0.5 {
        return matt(rgb(0.96, 0.94, 0.9));
    }
    shiny(rgb(0.82, 0.22, 0.18), 0.09)
}
