//! Grafts: hat, horns, wings, block, stick, halo.

use super::Draft;
use crate::{
    SynthError, SynthScene,
    assemble::SplatBuilder,
    body::Body,
    math::round_count,
    paint::{Material, Spot, matt, rgb, ripple, shiny, stripes},
    part::{Bone, Part, Tag},
    sampler::{scatter, weighted_area},
    shape::{Ring, Shape, ring},
    skeleton::Attach,
};
use glam::{Mat3, Vec3};
use rand_pcg::Pcg64;

/// Geometry to add.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Graft {
    /// Brimmed hat on the head.
    Hat,
    /// Two horns on the head.
    Horns,
    /// Two wings on the back, attached to the chest.
    Wings,
    /// A block that touches the left arm, attached to the chest.
    Block,
    /// A thin stick in the right hand, next to the thigh.
    Stick,
    /// A ring that hovers above the head and moves with it.
    Halo,
}

/// Adds the graft with the chest's density of splats.
pub(super) fn attach(
    draft: &mut Draft,
    scene: &SynthScene,
    graft: Graft,
    rng: &mut Pcg64,
) -> Result<(), SynthError> {
    let Some(model) = scene.rows.iter().find(|row| row.part == Part::Chest) else {
        return Err(SynthError::NoFigure { edit: "a graft" });
    };
    let (bodies, tag) = match graft {
        Graft::Hat => (hat(), Tag::Hat),
        Graft::Horns => (vec![horn(1.0), horn(-1.0)], Tag::Horns),
        Graft::Wings => (vec![wing(1.0), wing(-1.0)], Tag::Wings),
        Graft::Block => (block(), Tag::Block),
        Graft::Stick => (stick(), Tag::Stick),
        Graft::Halo => (vec![halo()], Tag::Halo),
    };
    let spacing = 0.8 * model.spacing;
    let count = round_count(weighted_area(&bodies) / (spacing * spacing)).max(8);
    add(draft, scene, &bodies, count, tag, rng);
    Ok(())
}

/// Appends `count` surface splats of `bodies`, new to the scene.
pub(super) fn add(
    draft: &mut Draft,
    scene: &SynthScene,
    bodies: &[Body],
    count: usize,
    tag: Tag,
    rng: &mut Pcg64,
) {
    let posing = scene.skeleton.posing();
    let dresser = SplatBuilder::with_parts(&posing, true, false, scene.frame1.sh_degree);
    for point in scatter(bodies, count, 0, rng) {
        let row = dresser.push(&point, &mut draft.splats, rng);
        draft.rows.push(row);
        draft.tags.push(tag);
        draft.source_rows.push(None);
        draft.removed.push(false);
    }
}

fn hat() -> Vec<Body> {
    let tilt = Mat3::from_rotation_x(-0.10) * Mat3::from_rotation_z(-0.05);
    let at = |rings: &[Ring]| Shape::Lathe {
        rings: rings.to_vec(),
        basis: tilt,
        origin: Vec3::new(0.0, 1.705, -0.005),
    };
    let round = |y: f32, radius: f32| ring(y, [0.0, 0.0], [radius * 0.95, radius * 1.05]);
    let head = Attach::rigid(Bone::Head);
    vec![
        Body::new(
            Part::Head,
            at(&[
                round(-0.002, 0.12),
                round(-0.008, 0.19),
                round(0.002, 0.236),
                round(0.015, 0.250),
                round(0.028, 0.238),
                round(0.018, 0.19),
                round(0.020, 0.13),
            ]),
            felt,
        )
        .denser(1.3)
        .carried_by(head),
        Body::new(
            Part::Head,
            at(&[
                round(0.008, 0.143),
                round(0.05, 0.141),
                round(0.10, 0.136),
                round(0.145, 0.124),
                round(0.163, 0.100),
                round(0.158, 0.05),
                round(0.150, 0.0),
            ]),
            felt,
        )
        .carried_by(head),
    ]
}

fn felt(spot: &Spot) -> Material {
    let band = spot.rest.y > 1.738 && spot.rest.y < 1.775;
    let on_crown = spot.rest.x.hypot(spot.rest.z) < 0.16;
    if band && on_crown && spot.normal.y < 0.6 {
        return shiny(rgb(0.93, 0.72, 0.27), 0.05);
    }
    matt(rgb(0.30, 0.21, 0.40) * (1.0 + 0.07 * ripple(spot.rest, 8.0)))
}

fn horn(side: f32) -> Body {
    let at = |x: f32, y: f32, z: f32| Vec3::new(side * x, y, z);
    Body::new(
        Part::Head,
        Shape::Horn {
            curve: [at(0.072, 1.715, 0.02), at(0.24, 1.77, 0.01), at(0.175, 1.97, 0.07)],
            radii: [0.038, 0.006],
        },
        |spot| {
            let ridge = stripes(spot.uv[0], 0.09, 0.45, 0.15);
            shiny(rgb(0.91, 0.86, 0.74) * (1.0 - 0.35 * spot.uv[0] - 0.15 * ridge), 0.08)
        },
    )
    .denser(1.6)
    .carried_by(Attach::rigid(Bone::Head))
}

fn wing(side: f32) -> Body {
    Body::new(
        Part::Chest,
        Shape::Wing { root: Vec3::new(side * 0.045, 1.30, -0.13), side },
        |spot| {
            let [u, v] = spot.uv;
            let quill = stripes(u * (1.0 + 0.4 * v), 0.085, 0.72, 0.18);
            let tip = rgb(0.44, 0.56, 0.80);
            let down = rgb(0.97, 0.96, 0.94);
            shiny((down + (tip - down) * v) * (0.80 + 0.2 * quill), 0.04)
        },
    )
    .carried_by(Attach::rigid(Bone::Chest))
}

fn wood(spot: &Spot) -> Material {
    matt(rgb(0.55, 0.38, 0.22) * (1.0 + 0.1 * ripple(spot.rest, 6.0)))
}

/// A block on the chest's left front; its lower face touches the upper arm.
fn block() -> Vec<Body> {
    Shape::cuboid(Vec3::new(0.09, 1.20, 0.14), Mat3::IDENTITY, Vec3::new(0.14, 0.10, 0.08))
        .into_iter()
        .map(|face| Body::new(Part::Chest, face, wood).carried_by(Attach::rigid(Bone::Chest)))
        .collect()
}

/// A stick through the right hand, along the thigh.
fn stick() -> Vec<Body> {
    Shape::cuboid(Vec3::new(-0.2, 0.76, 0.1), Mat3::IDENTITY, Vec3::new(0.012, 0.012, 0.32))
        .into_iter()
        .map(|face| Body::new(Part::ForearmR, face, wood).carried_by(Attach::rigid(Bone::ForearmR)))
        .collect()
}

/// A ring above the head, without contact.
fn halo() -> Body {
    let round = |y: f32, radius: f32| ring(y, [0.0, 0.0], [radius, radius]);
    let rings = [
        round(0.0, 0.165),
        round(0.018, 0.183),
        round(0.0, 0.201),
        round(-0.018, 0.183),
        round(0.0, 0.165),
    ];
    let shape = Shape::Lathe {
        rings: rings.to_vec(),
        basis: Mat3::IDENTITY,
        origin: Vec3::new(0.0, 1.95, 0.0),
    };
    Body::new(Part::Head, shape, |_| shiny(rgb(0.98, 0.86, 0.42), 0.15))
        .carried_by(Attach::rigid(Bone::Head))
}
