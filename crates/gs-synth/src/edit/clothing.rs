//! Clothing: moves the surface outwards along its normals and clones splats.

use super::{Draft, Region};
use crate::{
    math::{normal, normal3, smoothstep, uniform},
    paint::{rgb, ripple, stripes},
    part::{Kind, Part, Tag},
    scene::SplatTruth,
    skeleton::BoneMotions,
};
use glam::{Quat, Vec3};
use gs_core::quat;
use rand_pcg::Pcg64;

/// World units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wear {
    pub(super) offset: [f32; 2],
    pub(super) copies: f32,
    pub(super) jitter: f32,
}

/// Distance between quilting seams, world units.
const QUILT: f32 = 0.066;

/// 0 on a seam, 1 between seams.
fn puff(row: &SplatTruth) -> f32 {
    let phase = std::f32::consts::PI * (row.rest[1] + 0.02) / QUILT;
    phase.sin().abs().sqrt()
}

/// Inflates the region's surface; returns the rows of the clothing.
pub(super) fn dress(
    draft: &mut Draft,
    posing: &BoneMotions,
    region: &Region,
    wear: Wear,
    rng: &mut Pcg64,
) -> Vec<usize> {
    let originals: Vec<usize> =
        draft.rows_in(region).into_iter().filter(|&i| is_surface(&draft.rows[i])).collect();
    let mut worn = originals.clone();
    for i in originals {
        let whole = wear.copies.floor();
        let more = usize::from(uniform(rng, 0.0, 1.0) < wear.copies - whole);
        let clones = crate::math::floor_index(whole) - 1 + more;
        let ids: Vec<usize> = (0..clones).map(|_| draft.push_clone(i)).collect();
        worn.extend(&ids);
        offset(draft, posing, i, (wear, 0.0), rng);
        for id in ids {
            offset(draft, posing, id, (wear, 0.5), rng);
        }
    }
    worn
}

/// Rotation from frame 1 back to the bind pose, at a row.
fn unposed(posing: &BoneMotions, row: &SplatTruth) -> Quat {
    let posed = posing.splat(row.attach, row.rest, quat::IDENTITY, [0.0; 3]);
    quat::to_glam(posed.quat).conjugate()
}

/// Factor of the offset near the ends of the clothing at neck and
/// elbows, where it fits tightly for any thickness.
fn hem(row: &SplatTruth) -> f32 {
    let y = row.rest[1];
    match row.part {
        Part::Chest => 1.0 - 0.75 * smoothstep(1.43, 1.47, y),
        Part::UpperArmL | Part::UpperArmR => 0.35 + 0.65 * smoothstep(1.10, 1.17, y),
        _ => 1.0,
    }
}

/// Moves one row outwards; `spread` (in spacings) scatters
/// clones over the gaps between the originals.
fn offset(
    draft: &mut Draft,
    posing: &BoneMotions,
    i: usize,
    (wear, spread): (Wear, f32),
    rng: &mut Pcg64,
) {
    let row = draft.rows[i];
    let n = Vec3::from(row.normal);
    let [low, high] = wear.offset;
    let out = (low + (high - low) * puff(&row)) * hem(&row);
    let across = normal3(rng) * (wear.jitter + spread * row.spacing);
    // seams and cuffs are painted by bind position, so a clone has its own
    let sideways = across - n * across.dot(n);
    draft.rows[i].rest = (Vec3::from(row.rest) + unposed(posing, &row) * sideways).into();
    let step = n * (out + wear.jitter * normal(rng)) + sideways;
    let splats = &mut draft.splats;
    splats.means[i] = (Vec3::from(splats.means[i]) + step).into();
    // the surface grows with its distance from the limb's axis; clones fill the rest
    let grow = (1.0 + out / 0.2).min(1.5).ln();
    let thin = (0..3)
        .min_by(|&a, &b| splats.log_scales[i][a].total_cmp(&splats.log_scales[i][b]))
        .unwrap_or(0);
    for axis in (0..3).filter(|&axis| axis != thin) {
        splats.log_scales[i][axis] += grow + 0.05 * normal(rng);
    }
    draft.tags[i] = Tag::Clothing;
}

/// A quilted jacket: panels, seams, zip, collar, cuffs, a badge.
pub(super) fn jacket(row: &SplatTruth) -> Vec3 {
    let p = Vec3::from(row.rest);
    let panel = rgb(0.90, 0.36, 0.16);
    let trim = rgb(0.17, 0.16, 0.22);
    let seam = 1.0 - smoothstep(0.25, 0.6, puff(row));
    let mut c = panel * (1.0 + 0.05 * ripple(p, 5.0)) * (1.0 - 0.42 * seam);
    if row.part == Part::Chest {
        if p.y > 1.28 {
            c = rgb(0.98, 0.80, 0.42) * (1.0 - 0.35 * seam);
        }
        let zip = p.z > 0.0 && p.x.abs() < 0.013;
        if p.y > 1.44 || p.y < 1.062 || zip {
            c = trim;
        }
        if zip && stripes(p.y, 0.03, 0.4, 0.1) > 0.5 {
            c = rgb(0.82, 0.82, 0.84);
        }
    } else if p.y < 1.145 {
        c = trim;
    } else if p.y > 1.33 {
        c = rgb(0.98, 0.80, 0.42) * (1.0 - 0.35 * seam);
    }
    c
}

fn is_surface(row: &SplatTruth) -> bool {
    matches!(row.kind, Kind::Surface | Kind::Outlier)
}
