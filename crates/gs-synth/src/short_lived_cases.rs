//! [`ShortLivedCase`]: edits of the splats visible in frame 1, and the correct result at every time.

use crate::short_lived::{ShortLivedParams, ShortLivedScene, bone_motion};
use crate::{
    Edit, EditedFrame, Graft, Paint, Region, SynthError, SynthScene, apply_edits,
    math::{narrow, wide, wxyz},
    part::{Part, Tag},
    pose::Pose,
};
use glam::{DQuat, DVec3};
use gs_core::{Camera, DynamicScene, SceneError, Splats, TimeRange, quat};
use std::{fmt, str::FromStr};

/// Opacity above which an editor shows a splat, so that an edit reaches it.
const VISIBLE: f32 = 0.02;

/// An edit of a scene with short-lived splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ShortLivedCase {
    /// Chest and upper arms get a jacket of a different colour.
    Recolour,
    /// A forearm is deleted.
    Delete,
    /// A hat of new splats is added.
    Hat,
    /// The lantern in a hand is enlarged by half.
    Scale,
}

impl ShortLivedCase {
    /// All cases.
    pub const ALL: [Self; 4] = [Self::Recolour, Self::Delete, Self::Hat, Self::Scale];

    /// Name in reports and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Recolour => "brief-recolour",
            Self::Delete => "brief-delete",
            Self::Hat => "brief-hat",
            Self::Scale => "brief-scale",
        }
    }

    fn edit(self) -> Edit {
        let jacket = [Part::Chest, Part::UpperArmL, Part::UpperArmR];
        match self {
            Self::Recolour => Edit::Recolour {
                region: Region::parts(&jacket),
                paint: Paint::Tint([0.95, 0.75, 0.15]),
            },
            Self::Delete => Edit::Remove { region: Region::parts(&[Part::ForearmR]) },
            Self::Hat => Edit::Graft(Graft::Hat),
            Self::Scale => Edit::Transform {
                region: Region::parts(&[Part::Held]),
                scale: 1.5,
                rotation_rad: [0.0; 3],
                shift: [0.0; 3],
            },
        }
    }
}

impl fmt::Display for ShortLivedCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ShortLivedCase {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        let found = Self::ALL.into_iter().find(|case| case.name() == name);
        found.ok_or_else(|| SynthError::UnknownCase(name.to_owned()))
    }
}

/// A source, an edit of its first frame, and the correct result at every time.
#[derive(Debug, Clone)]
pub struct ShortLivedTruthScene {
    /// The dynamic source.
    pub source: ShortLivedScene,
    /// Output of the editor. Splats that are invisible in frame 1 are unchanged.
    pub edited: Splats,
    /// The edit of the whole surface.
    pub truth: ShortLivedTruth,
    /// Flags of the source splats on the edited surface, `[N]`.
    pub touched: Vec<bool>,
    /// SH of all source splats with the new colours of the case, for controls that are given them;
    /// unchanged if the case has none. `[N,K,3]`.
    pub painted: Vec<[f32; 3]>,
    /// Views of the scene, 400 × 400 pixels.
    pub cameras: Vec<Camera>,
}

/// Origin of a splat of the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    /// A source splat, possibly with other colours.
    Source(usize),
    /// A source splat, transformed with its part.
    Transformed(usize),
    /// New geometry.
    New,
}

/// An edit of the whole surface: every source splat is edited as if it were visible in frame 1.
/// Rows are those of the edited frame without those that the edit should have removed.
#[derive(Debug, Clone)]
pub struct ShortLivedTruth {
    source: ShortLivedScene,
    /// The same edit of the lasting splats.
    lasting: SynthScene,
    rows: Vec<Origin>,
    /// Similarity of the transformed splats at frame 1.
    transform: Option<Pose>,
}

impl ShortLivedTruth {
    /// Which rows are new geometry, `[M]`.
    pub fn new_rows(&self) -> Vec<bool> {
        self.rows.iter().map(|row| *row == Origin::New).collect()
    }

    /// Writes centre, rotation and scales of row `i` at `t`, if it is transformed.
    fn write_transformed(&self, i: usize, source: usize, t: f32, now: &Splats, out: &mut Splats) {
        let Some(transform) = self.transform else { return };
        let attach = self.source.lasting.rows[source].attach;
        let motion = bone_motion(&self.source.lasting.skeleton.motion(f64::from(t)), attach);
        let by = motion.after(&transform).after(&motion.inverse());
        out.means[i] = by.apply(wide(now.means[source])).as_vec3().into();
        out.quats[i] = quat::mul(wxyz(by.rotation), now.quats[source]);
        out.log_scales[i] = now.log_scales[source].map(|value| value + narrow(by.scale.ln()));
    }
}

impl DynamicScene for ShortLivedTruth {
    fn num_splats(&self) -> usize {
        self.rows.len()
    }

    fn sh_degree(&self) -> usize {
        self.source.sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        // New geometry, and all colours.
        self.lasting.at_into(t, out)?;
        let now = self.source.at(t)?;
        for (i, row) in self.rows.iter().enumerate() {
            let (Origin::Source(source) | Origin::Transformed(source)) = *row else { continue };
            out.means[i] = now.means[source];
            out.quats[i] = now.quats[source];
            out.log_scales[i] = now.log_scales[source];
            out.opacity_logits[i] = now.opacity_logits[source];
            if matches!(row, Origin::Transformed(_)) {
                self.write_transformed(i, source, t, &now, out);
            }
        }
        Ok(())
    }
}

/// Builds the case.
///
/// # Errors
/// If a parameter is out of range.
pub fn build_short_lived(
    case: ShortLivedCase,
    params: &ShortLivedParams,
) -> Result<ShortLivedTruthScene, SynthError> {
    let mut bodies = crate::figure::bodies();
    if case == ShortLivedCase::Scale {
        bodies.extend(crate::figure::lantern());
    }
    let source = ShortLivedScene::of_bodies(bodies, params)?;
    let edit = case.edit();
    let EditedFrame { splats: all, truth } =
        apply_edits(&source.lasting, std::slice::from_ref(&edit), params.seed)?;
    let at_edit = source.at(0.0)?;
    let mut touched = vec![true; at_edit.len()];
    let rows: Vec<Origin> = truth
        .source_rows
        .iter()
        .zip(&truth.tags)
        .map(|(parent, tag)| match *parent {
            Some(id) => {
                touched[id as usize] = *tag != Tag::Unchanged;
                if *tag == Tag::Transformed {
                    Origin::Transformed(id as usize)
                } else {
                    Origin::Source(id as usize)
                }
            }
            None => Origin::New,
        })
        .collect();
    let transform = transform_of(&edit, &rows, &source.lasting.frame1, &all);
    let truth =
        ShortLivedTruth { lasting: truth.scene().clone(), rows, transform, source: source.clone() };
    // The edited frame: visible splats are edited, all others are unchanged.
    let visible = |row: usize| at_edit.opacity(row) > VISIBLE;
    let whole = truth.at(0.0)?;
    let mut row_of_source = vec![None; at_edit.len()];
    for (i, row) in truth.rows.iter().enumerate() {
        if let Origin::Source(id) | Origin::Transformed(id) = *row {
            row_of_source[id] = Some(i);
        }
    }
    let mut edited = Splats::with_capacity(whole.len(), whole.sh_degree);
    for (row, edited_row) in row_of_source.iter().enumerate() {
        match edited_row {
            Some(i) if visible(row) => edited.push_from(&whole, *i),
            None if visible(row) => {}
            _ => edited.push_from(&at_edit, row),
        }
    }
    for i in (0..truth.rows.len()).filter(|&i| truth.rows[i] == Origin::New) {
        edited.push_from(&whole, i);
    }
    let mut painted = match edit {
        Edit::Recolour { paint, .. } => {
            let all = Edit::Recolour { region: Region::moving(), paint };
            apply_edits(&source.lasting, &[all], params.seed)?.splats.sh
        }
        _ => source.lasting.frame1.sh.clone(),
    };
    let coeffs = whole.sh_coeffs();
    for (i, row) in truth.rows.iter().enumerate() {
        if let Origin::Source(id) = *row
            && touched[id]
        {
            painted[id * coeffs..(id + 1) * coeffs].copy_from_slice(whole.sh_of(i));
        }
    }
    let cameras = source.lasting.suggested_cameras(400, 400);
    Ok(ShortLivedTruthScene { source, edited, truth, touched, painted, cameras })
}

/// The similarity of an [`Edit::Transform`]: its centre follows from any transformed splat.
fn transform_of(edit: &Edit, rows: &[Origin], before: &Splats, after: &Splats) -> Option<Pose> {
    let Edit::Transform { scale, rotation_rad, .. } = edit else { return None };
    let (i, source) = rows.iter().enumerate().find_map(|(i, row)| match row {
        Origin::Transformed(source) => Some((i, *source)),
        _ => None,
    })?;
    let rotation = DQuat::from_scaled_axis(wide(*rotation_rad));
    let about = Pose::about(DVec3::ZERO, f64::from(*scale), rotation, DVec3::ZERO);
    let shift = wide(after.means[i]) - about.apply(wide(before.means[source]));
    Some(Pose { translation: shift, ..about })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(case: ShortLivedCase) -> ShortLivedTruthScene {
        build_short_lived(
            case,
            &ShortLivedParams { num_splats: 2_000, ..ShortLivedParams::default() },
        )
        .unwrap()
    }

    #[test]
    fn edits_change_visible_splats_and_the_truth_changes_all() {
        let scene = small(ShortLivedCase::Recolour);
        let before = scene.source.at(0.0).unwrap();
        let changed = |row: usize| scene.edited.sh_of(row) != before.sh_of(row);
        for row in 0..before.len() {
            let visible = before.opacity(row) > VISIBLE;
            assert_eq!(changed(row), visible && scene.touched[row], "row {row}");
        }
        let (late, truth) = (scene.source.at(0.7).unwrap(), scene.truth.at(0.7).unwrap());
        let reached = (0..late.len()).filter(|&row| truth.sh_of(row) != late.sh_of(row)).count();
        assert_eq!(reached, scene.touched.iter().filter(|t| **t).count(), "the whole surface");
    }

    #[test]
    fn deletion_hat_and_scaling_have_the_expected_rows() {
        let delete = small(ShortLivedCase::Delete);
        let gone = delete.touched.iter().filter(|t| **t).count();
        assert_eq!(delete.truth.num_splats() + gone, delete.source.num_splats(), "removed");
        assert!(delete.edited.len() > delete.truth.num_splats(), "invisible splats remain");
        let hat = small(ShortLivedCase::Hat);
        let new = hat.truth.new_rows().iter().filter(|new| **new).count();
        assert!(new > 30 && !hat.touched.contains(&true), "{new}");
        assert_eq!(hat.edited, hat.truth.at(0.0).unwrap(), "a graft is entirely visible");
        let scale = small(ShortLivedCase::Scale);
        let (before, truth) = (scale.source.at(0.5).unwrap(), scale.truth.at(0.5).unwrap());
        let moved = (0..before.len()).filter(|&row| before.means[row] != truth.means[row]).count();
        assert_eq!(moved, scale.touched.iter().filter(|t| **t).count(), "the lantern");
    }
}
