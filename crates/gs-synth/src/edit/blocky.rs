//! Blocky re-modelling: body parts become boxes.

use super::{Draft, graft};
use crate::{
    SynthError, SynthScene,
    body::Body,
    math::round_count,
    paint::{HAIR, Material, SKIN, Spot, matt, rgb},
    part::{Part, Tag},
    shape::Shape,
    skeleton::Attach,
};
use glam::{Mat3, Vec3};
use rand_pcg::Pcg64;

/// Splats of a box, as a share of those of the part it replaces.
const BOX_SHARE: f32 = 0.9;

pub(super) fn remodel(
    draft: &mut Draft,
    scene: &SynthScene,
    parts: &[Part],
    rng: &mut Pcg64,
) -> Result<(), SynthError> {
    if !scene.rows.iter().any(|row| row.part == Part::Chest) {
        return Err(SynthError::NoFigure { edit: "blocky re-modelling" });
    }
    for &part in parts.iter().filter(|part| Part::FIGURE.contains(part)) {
        let old: Vec<Vec3> = draft
            .rows
            .iter()
            .filter(|row| row.part == part)
            .map(|row| Vec3::from(row.rest))
            .collect();
        if old.is_empty() {
            continue;
        }
        let mut low = old.iter().copied().reduce(Vec3::min).unwrap_or_default();
        let high = old.iter().copied().reduce(Vec3::max).unwrap_or_default();
        if part == Part::Head {
            // the box replaces the head without the neck
            low.y = low.y.max(1.475);
        }
        let half = (high - low) * Vec3::new(0.46, 0.5, 0.46);
        let bodies: Vec<Body> = Shape::cuboid((low + high) / 2.0, Mat3::IDENTITY, half)
            .into_iter()
            .map(|face| Body::new(part, face, blocky_paint).carried_by(Attach::rigid(part.bone())))
            .collect();
        let is_neck: Vec<bool> =
            draft.rows.iter().map(|row| part == Part::Head && row.rest[1] < 1.475).collect();
        let gone: Vec<bool> =
            draft.rows.iter().zip(&is_neck).map(|(row, &neck)| row.part == part && !neck).collect();
        let count = round_count(BOX_SHARE * old.len() as f32).max(12);
        draft.retain(|i| !gone[i]);
        graft::add(draft, scene, &bodies, count, Tag::Box, rng);
    }
    Ok(())
}

/// Large pixels.
fn blocky_paint(spot: &Spot) -> Material {
    let p = spot.rest;
    let cell = (p / 0.035).floor();
    let noise = ((cell.x * 12.99 + cell.y * 78.23 + cell.z * 37.72).sin() * 4375.5).fract().abs();
    let tone = 0.93 + 0.12 * noise;
    let rgb = match spot.part {
        Part::Head => head(p),
        Part::UpperArmL | Part::UpperArmR if p.y > 1.235 => rgb(0.13, 0.52, 0.55),
        Part::UpperArmL | Part::UpperArmR | Part::ForearmL | Part::ForearmR => SKIN,
        Part::FootL | Part::FootR => rgb(0.82, 0.22, 0.18),
        Part::Chest => rgb(0.96, 0.91, 0.80),
        _ => rgb(0.17, 0.24, 0.43),
    };
    matt(rgb * tone)
}

fn head(p: Vec3) -> Vec3 {
    let front = p.z > 0.08;
    let x = p.x.abs();
    if p.y > 1.70 || (p.z < -0.04 && p.y > 1.54) {
        HAIR
    } else if front && (1.60..1.64).contains(&p.y) && (0.03..0.07).contains(&x) {
        rgb(0.12, 0.20, 0.26)
    } else if front && (1.53..1.55).contains(&p.y) && x < 0.05 {
        rgb(0.72, 0.27, 0.27)
    } else {
        SKIN
    }
}
