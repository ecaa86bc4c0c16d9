//! [`Evidence`]: splats that frame 1 does not supervise, and the colour change of the surface
//! around them (ξ′ in addition to the paper's ξ).
//!
//! The paper's ξ (Eqs. 14–15) is zero where colours do not depend on the view. An editor that works
//! on pictures of frame 1 does not change splats that no picture shows. Motion may rotate them
//! towards the camera, with their old colour. ξ does not detect this. For such a splat
//!
//! ```text
//! ξ′ = 1 − exp(−(1 − ω) · a · ‖Δ̂ − Δ‖₁)
//! ```
//!
//! in the form of Eq. 15. ω is its supervision by frame 1: [`crate::first_frame_shares`], mapped
//! linearly from [`EvidenceParams::hidden`]–[`EvidenceParams::supervised`] to 0–1. `a` is the share
//! of the surrounding surface that the edit changed, Δ̂ the change of colour of that surface, and Δ
//! the change of the splat itself. The surface is a graph of neighbours that lie in each other's
//! tangent plane, move together, have similar normals and had similar colours before the edit. `a`
//! is the harmonic function on that graph with the supervised splats as boundary. Together with
//! view dependence, ξ̂ = 1 − (1 − ξ)(1 − ξ′).
//!
//! After an edit, a hidden splat has one of three kinds of colour: the old one, one that the edit
//! intended (a selection in 3D also changes hidden splats), or a meaningless one. Colours are
//! meaningless if the median of ‖Δ̂ − Δ‖₁ over changed hidden splats is more than twice that over
//! supervised splats. Such splats are also repaired if they have the geometry of a source splat.
//! Those on a surface that the edit did not change are restored to their old colour (`Δ̂ = 0`, and
//! `a` is the share of the surface that did not change). Where the edit intentionally changed more
//! than half of the hidden splats with `a > ½`, the others are correct, and ξ′ is 0.

mod before;
mod change;
mod edited_frame;
mod harmonic;
mod hidden;
mod hidden_color;
mod missing_change;
mod params;
mod source;
mod surface;

use crate::{CuarError, first_frame_visibility::survey};
pub use before::BeforeEdit;
pub use params::EvidenceParams;

use edited_frame::EditedFrame;
use gs_core::{Camera, DynamicScene, Rasterizer, Splats, sh, weighted_quantile};
use hidden::Hidden;
use hidden_color::HiddenColor;
use missing_change::{MissingChange, missing_changes};
use source::row_id;
use surface::{Nodes, SurfaceGraph};

/// Supervision and surrounding surface of each of the `M` edited splats; arrays are `[M]`, unless
/// noted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Evidence {
    /// ω, its supervision by frame 1, 0 to 1.
    pub supervision: Vec<f32>,
    /// `a`, the share of the surface around it that the edit changed, 0 to 1; for supervised
    /// splats, 1 if the edit changed them, else 0.
    pub agreement: Vec<f32>,
    /// The share of the surface around it that the edit deleted, 0 to 1.
    pub deleted: Vec<f32>,
    /// Whether the edit changed its colour.
    pub changed: Vec<bool>,
    /// ξ′, 0 to 1; 1 for remnants of deleted objects.
    pub xi: Vec<f32>,
    /// Rows with ξ′ > 0 that do not fade, ascending, each with its missing change of SH, Δ̂ − Δ,
    /// `[K,3]`.
    pub missing_changes: Vec<(u32, Vec<[f32; 3]>)>,
    /// Rows of remnants of deleted objects, ascending.
    pub remnants: Vec<u32>,
    /// Whether the edit itself changed hidden splats, so that the unchanged ones are correct.
    pub reaches_hidden: bool,
    /// Rows that frame 1 hides and that have a meaningless colour after the edit, ascending.
    pub meaningless: Vec<u32>,
    /// Number of hidden rows near a change whose correct colour is unknown.
    pub num_ambiguous: usize,
}

/// Key times at which motion is compared.
const KEY_TIMES: usize = 8;

impl Evidence {
    /// Evidence about the edit that changed `before` to `scene`. `cameras` show frame 1, at scene
    /// time `edit_time`.
    ///
    /// # Errors
    /// If a scene cannot be evaluated, array lengths are inconsistent, or the rasteriser fails.
    pub fn of<R: Rasterizer>(
        raster: &R,
        scene: &dyn DynamicScene,
        before: &BeforeEdit<'_>,
        edit_time: f32,
        cameras: &[Camera],
        params: &EvidenceParams,
    ) -> Result<Self, CuarError> {
        let first = scene.at(edit_time)?;
        let source = before.scene.at(edit_time)?;
        CuarError::check("before.source_rows", before.source_rows.len(), first.len())?;
        if before.source_rows.iter().flatten().any(|&id| id as usize >= source.len()) {
            return Err(CuarError::input(
                "`before.source_rows` refers to splats that do not exist",
            ));
        }
        let parents = source::parents(before, &first, &source);
        let old = source::colors(&parents, &first, &source);
        let gone = source::gone(before, &parents, &first, &source);
        let count = first.len();
        let mut evidence = Self {
            agreement: vec![0.0; count],
            deleted: vec![0.0; count],
            changed: vec![false; count],
            xi: vec![0.0; count],
            supervision: vec![1.0; count],
            ..Self::default()
        };
        let sizes = source::changes(&parents, &first, &old);
        if gone.is_empty() && !sizes.iter().any(|&size| size > params.min_change) {
            return Ok(evidence);
        }
        let place = |&id: &u32| {
            let id = id as usize;
            (source.means[id], 2.0 * source::size(&source, id))
        };
        let places: Vec<_> = gone.iter().map(place).collect();
        let (shares, buried) = survey(raster, &first, cameras, &places)?;
        let [hidden, supervised] = thresholds(&shares, &sizes, params);
        let ramp =
            |share: f32| ((share - hidden) / (supervised - hidden).max(1e-6)).clamp(0.0, 1.0);
        evidence.supervision = shares.into_iter().map(ramp).collect();
        let threshold = evidence.change_threshold(&sizes, params);
        evidence.changed = sizes.iter().map(|&size| size > threshold).collect();
        let num_buried = buried.into_iter().filter(|buried| *buried).count();
        let range = scene.time_range();
        let mut moments = Vec::new();
        for t in range.frames(KEY_TIMES).into_iter().filter(|t| *t != edit_time) {
            let (mut ours, mut theirs) = (Splats::default(), Splats::default());
            scene.geometry_into(t, &mut ours)?;
            before.scene.geometry_into(t, &mut theirs)?;
            ours.means.extend(gone.iter().map(|&id| theirs.means[id as usize]));
            moments.push(ours.means);
        }
        let nodes = Nodes::of(&first, &old, &parents, &source, &gone);
        let surface = SurfaceGraph::of(&nodes, &moments, params);
        let frame = EditedFrame {
            nodes: &nodes,
            surface: &surface,
            first: &first,
            old: &old,
            source_rows: before.source_rows,
        };
        let hidden = Hidden::of(&frame, &evidence.changed, &evidence.supervision, params);
        evidence.judge(&frame, &hidden, num_buried, params);
        Ok(evidence)
    }

    /// Change of base colour above which a splat counts as edited; larger than the noise of an edit
    /// that changed every visible splat a little.
    fn change_threshold(&self, sizes: &[f32], params: &EvidenceParams) -> f32 {
        let seen = sizes.iter().zip(&self.supervision).filter(|(_, known)| **known > 0.5);
        let mut seen: Vec<f32> = seen.map(|(size, _)| *size).collect();
        seen.sort_by(f32::total_cmp);
        let share = |of: usize| seen.get(seen.len() / of).copied().unwrap_or(0.0);
        // a tenth of half-normal noise is below an eighth of its deviation
        params.min_change.max((24.0 * share(10)).min(0.5 * share(2)))
    }

    /// Sets ξ′, the missing changes, and the remnants of deleted objects.
    fn judge(
        &mut self,
        frame: &EditedFrame<'_>,
        hidden: &Hidden,
        num_buried: usize,
        params: &EvidenceParams,
    ) {
        for (i, shares) in hidden.shares.iter().enumerate() {
            (self.agreement[i], self.deleted[i]) = shares.unwrap_or_default().into();
        }
        self.reaches_hidden = hidden.is_reached;
        self.num_ambiguous = hidden.num_ambiguous(params);
        self.meaningless = hidden.with_color(HiddenColor::Meaningless).map(row_id).collect();
        let is_remnant =
            |i: &usize| self.deleted[*i] > params.min_agreement && self.supervision[*i] <= 0.0;
        let remnants: Vec<u32> = hidden.open().filter(is_remnant).map(row_id).collect();
        // A deletion that also removed hidden splats was made in 3D and missed none. A deletion
        // made in pictures removes more splats than it misses.
        let num_gone = frame.nodes.len() - self.changed.len();
        if remnants.len() > num_buried && remnants.len() <= num_gone {
            self.remnants = remnants;
        }
        let (found, num_without) = missing_changes(frame, hidden, params);
        self.num_ambiguous += num_without;
        for MissingChange { row, share, change } in found {
            let size: f32 = change[0].iter().map(|x| (x * sh::C0).abs()).sum();
            self.xi[row] = 1.0 - (-(1.0 - self.supervision[row]) * share * size).exp();
            if self.remnants.binary_search(&row_id(row)).is_err() {
                self.missing_changes.push((row_id(row), change));
            }
        }
        self.remnants.iter().for_each(|row| self.xi[*row as usize] = 1.0);
    }
}

/// Shares between which supervision grows from 0 to 1: those of the parameters, or smaller ones
/// where splats overlap so much that typical shares are small. The smaller ones are a quarter and
/// three quarters of a typical share: that of changed splats or half that of all splats, whichever
/// is larger, because hidden splats may also have changed.
fn thresholds(shares: &[f32], sizes: &[f32], params: &EvidenceParams) -> [f32; 2] {
    let changed = shares.iter().zip(sizes).filter(|(_, size)| **size > params.min_change);
    let Some(changed) = typical(changed.map(|(share, _)| *share)) else {
        return [params.hidden, params.supervised];
    };
    let all = typical(shares.iter().copied()).unwrap_or(0.0);
    let typical = changed.max(0.5 * all);
    [params.hidden.min(0.25 * typical), params.supervised.min(0.75 * typical)]
}

/// Median of the positive shares, weighted by themselves.
fn typical(shares: impl Iterator<Item = f32>) -> Option<f32> {
    let positive = shares.filter(|share| *share > 0.0).map(|share| (share, share));
    weighted_quantile(positive.collect(), 0.5)
}
