//! The demo scene and its default edit.

use crate::{
    Edit, Graft, Paint, Region, SynthError, SynthScene,
    assemble::{Flaws, Group, assemble, split},
    dance::Dance,
    figure,
    math::{apportion, round_count},
    part::Part,
    skeleton::Skeleton,
    stage,
};
use std::ops::RangeInclusive;

/// Parameters of [`demo`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DemoParams {
    /// Exact number of Gaussians. Default 30 000, at least 1 000.
    pub num_splats: usize,
    /// Random seed. Default 0.
    pub seed: u64,
    /// Degree of the spherical harmonics, 0–3; highlights need 1. Default 1.
    pub sh_degree: usize,
    /// Smooth deviation of every trajectory from the truth, root mean square per axis, figure
    /// sizes. Default 0; 0.0005 is typical of a trained field.
    pub trajectory_noise: f32,
    /// Share of floaters, which move independently, 0–0.5. Default 0.
    pub floaters: f32,
    /// Noise of the frame-1 positions of moving splats, figure sizes;
    /// orientations and sizes are disturbed too. Default 0.
    pub jitter: f32,
}

impl DemoParams {
    /// Values that [`demo()`] accepts for `num_splats`.
    pub const NUM_SPLATS: RangeInclusive<usize> = 1_000..=100_000_000;
}

impl Default for DemoParams {
    fn default() -> Self {
        Self {
            num_splats: 30_000,
            seed: 0,
            sh_degree: 1,
            trajectory_noise: 0.0,
            floaters: 0.0,
            jitter: 0.0,
        }
    }
}

/// A dancer on a mosaic stage who waves with the right arm, sweeps the left one across the belly,
/// steps and sways. The clip loops.
///
/// # Errors
/// If a parameter is out of range.
pub fn demo(params: &DemoParams) -> Result<SynthScene, SynthError> {
    check(params)?;
    let num_floaters = round_count(params.num_splats as f32 * params.floaters);
    let shares = apportion(params.num_splats - num_floaters, &[0.57, 0.18, 0.20, 0.05]);
    let (figure_surface, figure_interior) = split(shares[0], 0.1);
    let group = |bodies, num_surface| Group { bodies, num_surface, num_interior: 0 };
    let groups = [
        Group {
            bodies: figure::bodies(),
            num_surface: figure_surface,
            num_interior: figure_interior,
        },
        group(stage::ground(), shares[1]),
        group(stage::props(), shares[2]),
        group(stage::backdrop(), shares[3]),
    ];
    let flaws = Flaws {
        trajectory_noise: params.trajectory_noise,
        jitter: params.jitter,
        num_floaters,
        outliers: 0.0,
    };
    let skeleton = Skeleton { dance: Dance::default() };
    Ok(assemble(skeleton, &groups, flaws, params.sh_degree, params.seed))
}

fn check(params: &DemoParams) -> Result<(), SynthError> {
    if !DemoParams::NUM_SPLATS.contains(&params.num_splats) {
        return Err(SynthError::param("num_splats", params.num_splats, "1000 to 100 million"));
    }
    if params.sh_degree > gs_core::sh::MAX_DEGREE {
        return Err(SynthError::param("sh_degree", params.sh_degree, "0 to 3"));
    }
    if !(0.0..=0.5).contains(&params.floaters) {
        return Err(SynthError::param("floaters", params.floaters, "0 to 0.5"));
    }
    if !(0.0..=0.1).contains(&params.trajectory_noise) {
        return Err(SynthError::param("trajectory_noise", params.trajectory_noise, "0 to 0.1"));
    }
    if !(0.0..=0.1).contains(&params.jitter) {
        return Err(SynthError::param("jitter", params.jitter, "0 to 0.1"));
    }
    Ok(())
}

/// The demo's edit: recoloured trousers, a jacket that inflates torso and
/// upper arms, a hat, one ball removed, rows shuffled.
pub fn demo_edits() -> Vec<Edit> {
    vec![
        Edit::Recolour {
            region: Region::parts(&[
                Part::Pelvis,
                Part::ThighL,
                Part::ThighR,
                Part::ShinL,
                Part::ShinR,
            ]),
            paint: Paint::Tint([0.62, 0.52, 0.34]),
        },
        Edit::Clothing {
            region: Region::parts(&[Part::Chest, Part::UpperArmL, Part::UpperArmR]),
            offset: [0.010, 0.016],
            copies: 1.5,
            jitter: 0.0015,
            paint: Some(Paint::Jacket),
        },
        Edit::Graft(Graft::Hat),
        Edit::Remove { region: Region::parts(&[Part::Ball]).within([0.80, 0.15, 0.50], 0.3) },
        Edit::Shuffle,
    ]
}
