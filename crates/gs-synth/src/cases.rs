//! [`TruthCase`]: test scenes with known motion.

mod graze;

use crate::{
    Edit, EditedFrame, Graft, Paint, Region, SynthError, SynthScene, apply_edits,
    assemble::{Flaws, Group, assemble},
    body::Body,
    dance::{Arm, Dance},
    figure,
    math::round_count,
    part::Part,
    skeleton::Skeleton,
    stage,
};
use gs_core::Camera;
use std::{f64::consts::PI, fmt, ops::RangeInclusive, str::FromStr};

/// A test scene with known motion, named after the tested property.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TruthCase {
    /// Only colours change.
    Recolour,
    /// Every splat of the figure jittered by 0.2 % of the figure size, 6° and 5 % of its scale.
    Drift,
    /// Torso, upper arms and thighs offset by 2–5 %, with 50 % more splats.
    Clothing,
    /// 30 % of the splats removed, half of the others split.
    PruneSplit,
    /// A hat.
    GraftHat,
    /// Horns.
    GraftHorns,
    /// Wings.
    GraftWings,
    /// A block on the chest that touches an arm.
    GraftBlock,
    /// A thin stick in a hand.
    GraftStick,
    /// A ring that hovers above the head.
    GraftHalo,
    /// Head and limbs become boxes.
    Blocky,
    /// An arm swings along the body within two splat spacings; everything jittered.
    GrazingLimb,
    /// Two bodies that touch at frame 1 move apart; jittered and split.
    TouchAndPart,
    /// The figure rotates by 180° over the clip; a jacket and a hat.
    FastRotation,
    /// A sheet stretches by a third and billows; a layer laid over it.
    StretchingCloth,
    /// 5 % floaters, 5 % of the surface splats with wrong motion; clothing of 1–2.5 %.
    FloatersOutliers,
    /// Source positions off by 0.3 % and four times the usual trajectory noise; clothing of 1–2.5
    /// %.
    NoisyReconstruction,
    /// Recoloured, rows shuffled.
    ShuffledRows,
    /// Clothing of 1–3 %, boxes, a hat, pruning, splitting, jitter, shuffled rows.
    Everything,
    /// The lantern in a hand enlarged by half, with all its splats scaled exactly.
    ScaleObject,
    /// The head rotated rigidly by 40° and tilted slightly.
    TurnHead,
    /// The lantern moved by 5 % of the figure size, rotated and shrunk, then jittered as in
    /// [`Self::Drift`], so that no splat is an exact copy.
    MoveObject,
}

/// A source, an edit of its first frame, and the true motion of the edit.
#[derive(Debug, Clone)]
pub struct TruthScene {
    /// The dynamic source.
    pub source: SynthScene,
    /// The edit and its true motion.
    pub edited: EditedFrame,
    /// Length unit of the metric, world units.
    pub figure_size: f32,
    /// Views of the scene, 400 × 400 pixels.
    pub cameras: Vec<Camera>,
}

impl TruthCase {
    /// All cases.
    pub const ALL: [Self; 22] = [
        Self::Recolour,
        Self::Drift,
        Self::Clothing,
        Self::PruneSplit,
        Self::GraftHat,
        Self::GraftHorns,
        Self::GraftWings,
        Self::GraftBlock,
        Self::GraftStick,
        Self::GraftHalo,
        Self::Blocky,
        Self::GrazingLimb,
        Self::TouchAndPart,
        Self::FastRotation,
        Self::StretchingCloth,
        Self::FloatersOutliers,
        Self::NoisyReconstruction,
        Self::ShuffledRows,
        Self::Everything,
        Self::ScaleObject,
        Self::TurnHead,
        Self::MoveObject,
    ];

    /// Name in reports and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Recolour => "recolour",
            Self::Drift => "drift",
            Self::Clothing => "clothing",
            Self::PruneSplit => "prune-split",
            Self::GraftHat => "graft-hat",
            Self::GraftHorns => "graft-horns",
            Self::GraftWings => "graft-wings",
            Self::GraftBlock => "graft-block",
            Self::GraftStick => "graft-stick",
            Self::GraftHalo => "graft-halo",
            Self::Blocky => "blocky",
            Self::GrazingLimb => "grazing-limb",
            Self::TouchAndPart => "touch-and-part",
            Self::FastRotation => "fast-rotation",
            Self::StretchingCloth => "stretching-cloth",
            Self::FloatersOutliers => "floaters-outliers",
            Self::NoisyReconstruction => "noisy-reconstruction",
            Self::ShuffledRows => "shuffled-rows",
            Self::Everything => "everything",
            Self::ScaleObject => "scale-object",
            Self::TurnHead => "turn-head",
            Self::MoveObject => "move-object",
        }
    }
}

impl fmt::Display for TruthCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for TruthCase {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        let found = Self::ALL.into_iter().find(|case| case.name() == name);
        found.ok_or_else(|| SynthError::UnknownCase(name.to_owned()))
    }
}

/// Sizes that [`build`] accepts, splats.
pub const CASE_SIZES: RangeInclusive<usize> = 500..=10_000_000;

/// Builds the case with a source of exactly `size` splats, one of [`CASE_SIZES`].
///
/// All sources have 18 % interior splats, 2 % floaters and trajectory noise of 0.05 % of the figure
/// size per axis, unless the case says otherwise.
///
/// # Errors
/// If `size` is out of range.
pub fn build(case: TruthCase, seed: u64, size: usize) -> Result<TruthScene, SynthError> {
    if !CASE_SIZES.contains(&size) {
        return Err(SynthError::param("size", size, "500 to 10 million"));
    }
    let source = source(case, seed, size);
    let edited = apply_edits(&source, &edits(case), seed)?;
    let figure_size = source.figure_size();
    let cameras = source.suggested_cameras(400, 400);
    Ok(TruthScene { source, edited, figure_size, cameras })
}

/// Abduction of the left arm that leaves a gap of half a
/// percent of the figure size to hip and thigh.
const ABDUCT_RAD: f64 = 0.026;

fn source(case: TruthCase, seed: u64, size: usize) -> SynthScene {
    let floaters = if case == TruthCase::FloatersOutliers { 0.05 } else { 0.02 };
    let is_noisy = case == TruthCase::NoisyReconstruction;
    let flaws = Flaws {
        trajectory_noise: if is_noisy { 0.002 } else { 0.0005 },
        jitter: if is_noisy { 0.003 } else { 0.0 },
        num_floaters: round_count(size as f32 * floaters),
        outliers: if case == TruthCase::FloatersOutliers { 0.05 } else { 0.0 },
    };
    let (bodies, interior) = bodies(case);
    let num_interior = round_count(size as f32 * interior);
    let num_surface = size - flaws.num_floaters - num_interior;
    let calm = Dance { abduct_rad: ABDUCT_RAD, ..Dance::default() };
    let dance = match case {
        TruthCase::GrazingLimb => {
            graze::dance(&bodies, num_surface, Dance { arm: Arm::Along, ..calm })
        }
        TruthCase::FastRotation => Dance { spin_rad: PI, ..calm },
        _ => calm,
    };
    let groups = [Group { bodies, num_surface, num_interior }];
    assemble(Skeleton { dance }, &groups, flaws, 1, seed)
}

/// Bodies and their share of interior splats.
fn bodies(case: TruthCase) -> (Vec<Body>, f32) {
    match case {
        TruthCase::TouchAndPart => (stage::two_objects(), 0.18),
        TruthCase::StretchingCloth => (stage::sheet(), 0.0),
        TruthCase::ScaleObject | TruthCase::MoveObject => {
            (figure::bodies().into_iter().chain(figure::lantern()).collect(), 0.18)
        }
        _ => (figure::bodies(), 0.18),
    }
}

fn edits(case: TruthCase) -> Vec<Edit> {
    let figure = || Region::parts(&Part::FIGURE);
    let jitter = |region| Edit::Drift { region, position: 0.002, angle_rad: 0.1, log_scale: 0.05 };
    let split = |region| Edit::PruneSplit { region, prune: 0.3, split: 0.5 };
    let dress = |offset| Edit::Clothing {
        region: Region::parts(&[
            Part::Chest,
            Part::UpperArmL,
            Part::UpperArmR,
            Part::ThighL,
            Part::ThighR,
        ]),
        offset,
        copies: 1.5,
        jitter: 0.002,
        paint: Some(Paint::Tint([0.75, 0.3, 0.25])),
    };
    let recolour = || Edit::Recolour { region: Region::moving(), paint: Paint::Hue(2.1) };
    match case {
        TruthCase::Recolour => vec![recolour()],
        TruthCase::Drift | TruthCase::GrazingLimb => vec![jitter(figure())],
        TruthCase::Clothing => vec![dress([0.02, 0.05])],
        TruthCase::PruneSplit => vec![split(figure())],
        TruthCase::GraftHat => vec![Edit::Graft(Graft::Hat)],
        TruthCase::GraftHorns => vec![Edit::Graft(Graft::Horns)],
        TruthCase::GraftWings => vec![Edit::Graft(Graft::Wings)],
        TruthCase::GraftBlock => vec![Edit::Graft(Graft::Block)],
        TruthCase::GraftStick => vec![Edit::Graft(Graft::Stick)],
        TruthCase::GraftHalo => vec![Edit::Graft(Graft::Halo)],
        TruthCase::Blocky => vec![Edit::Blocky { parts: blocky_parts() }],
        TruthCase::TouchAndPart => vec![split(Region::moving()), jitter(Region::moving())],
        TruthCase::FastRotation => vec![dress([0.01, 0.025]), Edit::Graft(Graft::Hat)],
        TruthCase::StretchingCloth => vec![Edit::Clothing {
            region: Region::parts(&[Part::Cloth]).within([0.1, 0.9, 0.0], 0.35),
            offset: [0.01, 0.02],
            copies: 1.5,
            jitter: 0.002,
            paint: Some(Paint::Tint([0.2, 0.4, 0.6])),
        }],
        TruthCase::FloatersOutliers | TruthCase::NoisyReconstruction => {
            vec![dress([0.01, 0.025])]
        }
        TruthCase::ShuffledRows => vec![recolour(), Edit::Shuffle],
        TruthCase::ScaleObject => vec![Edit::Transform {
            region: Region::parts(&[Part::Held]),
            scale: 1.5,
            rotation_rad: [0.0; 3],
            shift: [0.0; 3],
        }],
        TruthCase::TurnHead => vec![Edit::Transform {
            region: Region::parts(&[Part::Head]),
            scale: 1.0,
            rotation_rad: [0.1, 0.7, 0.0],
            shift: [0.0; 3],
        }],
        TruthCase::MoveObject => {
            let held = || Region::parts(&[Part::Held]);
            let transform = Edit::Transform {
                region: held(),
                scale: 0.8,
                rotation_rad: [0.0, 0.5, 0.3],
                shift: [-0.03, -0.04, 0.0],
            };
            vec![transform, jitter(held())]
        }
        TruthCase::Everything => vec![
            Edit::Blocky { parts: vec![Part::Head, Part::ForearmL, Part::ShinR] },
            dress([0.01, 0.03]),
            split(figure()),
            Edit::Graft(Graft::Hat),
            jitter(figure()),
            Edit::Shuffle,
        ],
    }
}

fn blocky_parts() -> Vec<Part> {
    let trunk = [Part::Pelvis, Part::Chest];
    Part::FIGURE.into_iter().filter(|part| !trunk.contains(part)).collect()
}
