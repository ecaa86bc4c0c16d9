//! [`Evidence`]: splats that frame 1 does not supervise, and the colour change of the surface
//! around them (ξ′ in addition to the paper's ξ).
//!
//! The paper's ξ (Eqs. 14–15) is zero where colours do not depend on the view. An editor that works
//! on pictures of frame 1 does not change splats that no picture shows; motion may turn them to the
//! camera, in their old colour. ξ does not detect this. For such a splat
//!
//! ```text
//! ξ′ = 1 − exp(−(1 − ω) · a · ‖Δ̂ − Δ‖₁)
//! ```
//!
//! in the form of Eq. 15, where ω is its supervision by frame 1 ([`crate::first_frame_shares`],
//! ramped from [`EvidenceParams::hidden`] to [`EvidenceParams::supervised`]), `a` the share of the
//! surface around it that the edit changed, Δ its own change of colour by the edit, and Δ̂ that of
//! the surface around it. Surface: neighbours in its tangent plane that move with it, have similar
//! normals and had similar colours before the edit. The share `a` is the harmonic function on
//! that graph with the supervised splats as boundary. Together with view dependence, ξ̂ = 1 − (1 −
//! ξ)(1 − ξ′).
//!
//! After an edit, a hidden splat has one of three kinds of colour: the old one, one that the edit
//! intended (a selection in 3D also changes hidden splats), or a meaningless one. Colours are
//! meaningless if ‖Δ̂ − Δ‖₁ of changed hidden splats is, in the median, more than twice that of
//! supervised splats. Such splats are also repaired if they have the geometry of a source splat;
//! those on a surface that the edit did not change get their old colour back (`Δ̂ = 0`, and `a` is
//! the share of the surface that did not change). Where the edit intentionally changed more than
//! half of the hidden splats with `a > ½`, the others are correct, and ξ′ is 0.

mod before;
mod change;
mod edited_frame;
mod hidden;
mod hidden_color;
mod lacking;
mod params;
mod source;
mod surface;
mod vote;

use crate::{CuarError, first_frame_visibility::survey};
pub use before::BeforeEdit;
pub use params::EvidenceParams;

use edited_frame::EditedFrame;
use gs_core::{Camera, DynamicScene, Rasterizer, Splats, sh, weighted_quantile};
use hidden::Hidden;
use hidden_color::HiddenColor;
use lacking::{Lacking, lacking_changes};
use source::row_id;
use surface::{Nodes, Surface};

/// Supervision and surrounding surface of each edited splat; arrays are `[M]`.
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
    /// ξ′, 0 to 1; 1 for remains of deleted objects.
    pub xi: Vec<f32>,
    /// Rows with ξ′ > 0 that do not fade, ascending, with their missing change of SH, Δ̂ − Δ,
    /// `[K,3]`.
    pub lacking: Vec<(u32, Vec<[f32; 3]>)>,
    /// Remains of deleted objects.
    pub ghosts: Vec<u32>,
    /// Whether the edit itself changed hidden splats, so that the unchanged ones are correct.
    pub reaches_hidden: bool,
    /// Rows that frame 1 hides and that have a meaningless colour after the edit, ascending.
    pub meaningless: Vec<u32>,
    /// Number of hidden rows near a change whose correct colour is unknown.
    pub num_undecided: usize,
}

/// Key times at which motion is compared.
const KEY_TIMES: usize = 8;

impl Evidence {
    /// Evidence about the edit that turned `before` into `scene`. `cameras` view frame 1, at
    /// `edit_time`.
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
        let least = evidence.least_change(&sizes, params);
        evidence.changed = sizes.iter().map(|&size| size > least).collect();
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
        let surface = Surface::of(&nodes, &moments, params);
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
    fn least_change(&self, sizes: &[f32], params: &EvidenceParams) -> f32 {
        let seen = sizes.iter().zip(&self.supervision).filter(|(_, known)| **known > 0.5);
        let mut seen: Vec<f32> = seen.map(|(size, _)| *size).collect();
        seen.sort_by(f32::total_cmp);
        let share = |of: usize| seen.get(seen.len() / of).copied().unwrap_or(0.0);
        // a tenth of half-normal noise lies below an eighth of its deviation
        params.min_change.max((24.0 * share(10)).min(0.5 * share(2)))
    }

    /// Sets ξ′, the missing changes, and the remains of deleted objects.
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
        self.num_undecided = hidden.num_undecided(params);
        self.meaningless = hidden.with_color(HiddenColor::Meaningless).map(row_id).collect();
        let is_ghost =
            |i: &usize| self.deleted[*i] > params.min_agreement && self.supervision[*i] <= 0.0;
        let ghosts: Vec<u32> = hidden.open().filter(is_ghost).map(row_id).collect();
        // A deletion that also removed hidden splats was made in 3D, and missed none. A deletion
        // from pictures removes more than it misses.
        let num_gone = frame.nodes.len() - self.changed.len();
        if ghosts.len() > num_buried && ghosts.len() <= num_gone {
            self.ghosts = ghosts;
        }
        let (found, num_without) = lacking_changes(frame, hidden, params);
        self.num_undecided += num_without;
        for Lacking { row, share, change } in found {
            let size: f32 = change[0].iter().map(|x| (x * sh::C0).abs()).sum();
            self.xi[row] = 1.0 - (-(1.0 - self.supervision[row]) * share * size).exp();
            if self.ghosts.binary_search(&row_id(row)).is_err() {
                self.lacking.push((row_id(row), change));
            }
        }
        self.ghosts.iter().for_each(|row| self.xi[*row as usize] = 1.0);
    }
}

/// Shares between which supervision grows from 0 to 1: those of the parameters, or less where
/// splats overlap so much that typical shares are small (a quarter and three quarters of the
/// typical share of changed splats, or of half that of all splats, if larger: hidden splats may
/// also have changed).
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
