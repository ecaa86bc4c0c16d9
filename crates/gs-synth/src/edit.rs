//! [`Edit`]: an operation of a static editor on the frame-1 splats, which
//! keeps track of the true motion of each result.

mod blocky;
mod clothing;
mod draft;
mod graft;
mod region;
mod transform;

use crate::{
    EditedFrame, SynthError, SynthScene,
    math::{normal, normal3, rng, uniform},
    paint::{luma, rotate_hue},
    part::{Part, Tag},
    truth,
};
pub(crate) use draft::Draft;
use glam::{Quat, Vec3};
pub use graft::Graft;
use gs_core::{activation, quat, sh};
use rand_pcg::Pcg64;
pub use region::Region;

/// New colours. The baked light is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Paint {
    /// One colour (sRGB, 0–1), without texture.
    Solid([f32; 3]),
    /// One colour (sRGB, 0–1) times the texture's brightness.
    Tint([f32; 3]),
    /// All hues rotated by this angle, radians.
    Hue(f32),
    /// A quilted jacket with zip, collar and cuffs.
    Jacket,
}

/// One step of an editing session. Lengths are relative to the figure size.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Edit {
    /// New colours, same geometry.
    Recolour {
        /// Affected region.
        region: Region,
        /// The new colours.
        paint: Paint,
    },
    /// Surface splats are moved outwards along their normals and cloned.
    Clothing {
        /// Affected region.
        region: Region,
        /// Smallest and largest offset, figure sizes; folds vary between the
        /// two. Collar and cuffs of a figure lie closer.
        offset: [f32; 2],
        /// Number of splats after the edit per splat before, at least 1;
        /// the additional ones are jittered clones.
        copies: f32,
        /// Position noise, figure sizes.
        jitter: f32,
        /// New colours, if any.
        paint: Option<Paint>,
    },
    /// A share of the splats is removed, a share of the others is split into two smaller ones.
    PruneSplit {
        /// Affected region.
        region: Region,
        /// Share removed, 0–1.
        prune: f32,
        /// Share of the remaining that is split, 0–1.
        split: f32,
    },
    /// New geometry is added.
    Graft(Graft),
    /// Body parts are replaced by boxes of their size; the neck is unchanged. Only existing parts
    /// of the figure are re-modelled.
    Blocky {
        /// Parts of the figure to re-model.
        parts: Vec<Part>,
    },
    /// Every splat of the region is disturbed slightly, as by a few optimiser steps.
    Drift {
        /// Affected region.
        region: Region,
        /// Position noise, root mean square per axis, figure sizes.
        position: f32,
        /// Rotation noise, radians per axis.
        angle_rad: f32,
        /// Noise of the logarithms of the scales.
        log_scale: f32,
    },
    /// The region is scaled and rotated about its centre, then translated, as a whole. Its
    /// attachment to bones does not change.
    Transform {
        /// Affected region.
        region: Region,
        /// Scale factor.
        scale: f32,
        /// Rotation vector, radians.
        rotation_rad: [f32; 3],
        /// Displacement, figure sizes.
        shift: [f32; 3],
    },
    /// The splats of the region are removed.
    Remove {
        /// Affected region.
        region: Region,
    },
    /// Rows are permuted.
    Shuffle,
}

/// Applies `edits` in order to the frame-1 splats of `scene`.
///
/// Splats that no edit affects are bit-identical. The truth uses the source's skeleton without noise.
///
/// # Errors
/// If a parameter is out of range or an edit needs a figure the scene does not have.
pub fn apply_edits(
    scene: &SynthScene,
    edits: &[Edit],
    seed: u64,
) -> Result<EditedFrame, SynthError> {
    Ok(truth::finish(scene, drafted(scene, edits, seed, Removal::Whole)?))
}

/// Treatment of splats removed by [`Edit::Remove`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Removal {
    /// They are removed.
    Whole,
    /// They remain, marked in [`Draft::removed`].
    Marked,
}

/// The splats after `edits`, with their descriptions.
pub(crate) fn drafted(
    scene: &SynthScene,
    edits: &[Edit],
    seed: u64,
    removal: Removal,
) -> Result<Draft, SynthError> {
    let mut draft = Draft::of(scene);
    for (step, edit) in edits.iter().enumerate() {
        edit.check()?;
        let mut rng = rng(seed, 100 + step as u64);
        match edit {
            Edit::Recolour { region, paint } => {
                let rows = draft.rows_in(region);
                recolour(&mut draft, &rows, *paint);
            }
            Edit::Clothing { region, offset, copies, jitter, paint } => {
                let size = scene.figure_size();
                let wear = clothing::Wear {
                    offset: offset.map(|share| share * size),
                    copies: *copies,
                    jitter: jitter * size,
                };
                let worn =
                    clothing::dress(&mut draft, &scene.skeleton.posing(), region, wear, &mut rng);
                if let Some(paint) = paint {
                    recolour(&mut draft, &worn, *paint);
                }
            }
            Edit::PruneSplit { region, prune, split } => {
                prune_split(&mut draft, region, *prune, *split, &mut rng);
            }
            Edit::Graft(graft) => graft::attach(&mut draft, scene, *graft, &mut rng)?,
            Edit::Blocky { parts } => blocky::remodel(&mut draft, scene, parts, &mut rng)?,
            Edit::Drift { region, position, angle_rad, log_scale } => {
                let noise = [position * scene.figure_size(), *angle_rad, *log_scale];
                drift(&mut draft, region, noise, &mut rng);
            }
            Edit::Transform { region, scale, rotation_rad, shift } => {
                let shift = shift.map(|share| share * scene.figure_size());
                let by = (*scale, *rotation_rad, shift);
                transform::transform(&mut draft, &scene.skeleton.posing(), region, by);
            }
            Edit::Remove { region } => {
                let gone = draft.mask_of(region);
                match removal {
                    Removal::Whole => draft.retain(|i| !gone[i]),
                    Removal::Marked => {
                        draft
                            .removed
                            .iter_mut()
                            .zip(gone)
                            .for_each(|(removed, gone)| *removed |= gone);
                    }
                }
            }
            Edit::Shuffle => draft.shuffle(&mut rng),
        }
    }
    Ok(draft)
}

impl Edit {
    fn check(&self) -> Result<(), SynthError> {
        let share = |name, value: f32, max: f32, expected| {
            if (0.0..=max).contains(&value) {
                Ok(())
            } else {
                Err(SynthError::param(name, value, expected))
            }
        };
        match self {
            Self::Clothing { offset, copies, jitter, .. } => {
                share("offset[0]", offset[0], 0.5, "0 to 0.5")?;
                share("offset[1]", offset[1], 0.5, "0 to 0.5")?;
                share("jitter", *jitter, 0.1, "0 to 0.1")?;
                share("copies", copies - 1.0, 15.0, "1 to 16 copies")
            }
            Self::PruneSplit { prune, split, .. } => {
                share("prune", *prune, 1.0, "0 to 1")?;
                share("split", *split, 1.0, "0 to 1")
            }
            Self::Drift { position, angle_rad, log_scale, .. } => {
                share("position", *position, 0.1, "0 to 0.1")?;
                share("angle_rad", *angle_rad, 4.0, "0 to 4")?;
                share("log_scale", *log_scale, 4.0, "0 to 4")
            }
            Self::Transform { scale, rotation_rad, shift, .. } => {
                if !(0.01..=100.0).contains(scale) {
                    return Err(SynthError::param("scale", scale, "0.01 to 100"));
                }
                let largest = |v: &[f32; 3]| v.iter().fold(0.0, |m: f32, c| m.max(c.abs()));
                let finite = rotation_rad.iter().chain(shift).all(|c| c.is_finite());
                share(
                    "rotation_rad",
                    if finite { largest(rotation_rad) } else { f32::NAN },
                    7.0,
                    "-7 to 7",
                )?;
                share("shift", largest(shift), 10.0, "-10 to 10")
            }
            Self::Recolour { .. }
            | Self::Graft(_)
            | Self::Blocky { .. }
            | Self::Remove { .. }
            | Self::Shuffle => Ok(()),
        }
    }
}

/// Repaints the rows; their other SH coefficients are unchanged.
fn recolour(draft: &mut Draft, rows: &[usize], paint: Paint) {
    let coeffs = draft.splats.sh_coeffs();
    let albedo = |draft: &Draft, i: usize| {
        let dc = Vec3::from(draft.splats.sh[i * coeffs]);
        (dc * sh::C0 + 0.5) / draft.rows[i].shade.max(Vec3::splat(1e-3))
    };
    let brightness: f32 = rows.iter().map(|&i| luma(albedo(draft, i))).sum();
    let mean = (brightness / rows.len().max(1) as f32).max(1e-3);
    for &i in rows {
        let old = albedo(draft, i);
        let new = match paint {
            Paint::Solid(rgb) => Vec3::from(rgb),
            Paint::Tint(rgb) => Vec3::from(rgb) * (0.35 + 0.65 * luma(old) / mean),
            Paint::Hue(angle_rad) => rotate_hue(old, angle_rad),
            Paint::Jacket => clothing::jacket(&draft.rows[i]),
        };
        let lit = (new * draft.rows[i].shade).clamp(Vec3::ZERO, Vec3::ONE);
        draft.splats.sh[i * coeffs] = sh::dc_from_rgb(lit.into());
        if draft.tags[i] == Tag::Unchanged {
            draft.tags[i] = Tag::Recoloured;
        }
    }
}

fn drift(draft: &mut Draft, region: &Region, noise: [f32; 3], rng: &mut Pcg64) {
    let [position, angle_rad, log_scale] = noise;
    for i in draft.rows_in(region) {
        let splats = &mut draft.splats;
        splats.means[i] = (Vec3::from(splats.means[i]) + normal3(rng) * position).into();
        let turn = Quat::from_scaled_axis(normal3(rng) * angle_rad);
        splats.quats[i] = quat::mul(quat::from_glam(turn), splats.quats[i]);
        for value in &mut splats.log_scales[i] {
            *value += log_scale * normal(rng);
        }
        if matches!(draft.tags[i], Tag::Unchanged | Tag::Recoloured) {
            draft.tags[i] = Tag::Drifted;
        }
    }
}

/// A split replaces a splat by two of 0.65 times its size, displaced along its longest axis.
fn prune_split(draft: &mut Draft, region: &Region, prune: f32, split: f32, rng: &mut Pcg64) {
    let inside = draft.mask_of(region);
    let gone: Vec<bool> =
        inside.iter().map(|&is_inside| is_inside && uniform(rng, 0.0, 1.0) < prune).collect();
    let parents: Vec<bool> = inside
        .iter()
        .zip(&gone)
        .map(|(&is_inside, &is_gone)| uniform(rng, 0.0, 1.0) < split && is_inside && !is_gone)
        .collect();
    for i in (0..inside.len()).filter(|&i| parents[i]) {
        let scale = draft.splats.scale(i);
        let longest = (0..3).max_by(|&a, &b| scale[a].total_cmp(&scale[b])).unwrap_or(0);
        let axis = quat::to_glam(draft.splats.rotation(i)) * Vec3::AXES[longest];
        let step = axis * (scale[longest] * uniform(rng, 0.5, 0.8));
        let child = draft.push_clone(i);
        for (row, sign) in [(i, 1.0), (child, -1.0)] {
            let splats = &mut draft.splats;
            splats.means[row] = (Vec3::from(splats.means[row]) + sign * step).into();
            for value in &mut splats.log_scales[row] {
                *value += 0.65_f32.ln();
            }
            let opacity = (splats.opacity(row) * uniform(rng, 0.95, 1.0)).clamp(0.01, 0.99);
            splats.opacity_logits[row] = activation::logit(opacity);
            draft.tags[row] = Tag::SplitChild;
        }
    }
    draft.retain(|i| i >= gone.len() || !gone[i]);
}
