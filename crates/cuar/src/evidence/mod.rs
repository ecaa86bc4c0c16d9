//! [`Evidence`]: which splats frame 1 does not supervise, and what the surface around them became
//! (ξ′ beside the paper's ξ).
//!
//! The paper's ξ (Eqs. 14–15) is zero where colours do not depend on the view. What an editor that
//! works on pictures of frame 1 leaves undone then stays unnoticed: a splat that no picture showed
//! keeps its old colour, and motion turns it to the camera. For such a splat
//!
//! ```text
//! ξ′ = 1 − exp(−(1 − ω) · a · ‖Δ̂ − Δ‖₁)
//! ```
//!
//! in the form of Eq. 15, where ω is how far frame 1 supervises it ([`crate::first_frame_shares`],
//! ramped from [`EvidenceParams::hidden`] to [`EvidenceParams::supervised`]), `a` the share of the
//! surface around it that the edit changed, Δ its own change of colour since before the edit, and
//! Δ̂ the change that the surface around it has. Surface: neighbours in its tangent plane that move
//! with it, face alike and had similar colours before. The share `a` is the harmonic function on
//! that graph with the supervised splats as boundary. Together with view dependence, ξ̂ = 1 − (1 −
//! ξ)(1 − ξ′).
//!
//! An edit that reaches hidden splats (a selection in 3D, not pictures) has changed those that it
//! was to change: where more than half of the hidden splats with `a > ½` differ from the source, ξ′
//! is 0.

mod before;
mod change;
mod params;
mod source;
mod surface;
mod vote;

use crate::{CuarError, first_frame_visibility::survey};
pub use before::BeforeEdit;
pub use params::EvidenceParams;

use change::expected_changes;
use gs_core::{Camera, DynamicScene, Rasterizer, Splats, sh};
use source::row_id;
use surface::{Nodes, Surface};

/// What frame 1 and the surface around tell of each edited splat; arrays are `[M]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Evidence {
    /// ω, how far frame 1 supervises it, 0 to 1.
    pub supervision: Vec<f32>,
    /// `a`, the share of the surface around it that the edit changed, 0 to 1; of the supervised
    /// ones, whether it changed them.
    pub agreement: Vec<f32>,
    /// The share of the surface around it that the edit deleted, 0 to 1.
    pub deleted: Vec<f32>,
    /// Whether the edit changed its colour.
    pub changed: Vec<bool>,
    /// ξ′, 0 to 1 ; 1 for what only exists because a deletion missed it.
    pub xi: Vec<f32>,
    /// Δ̂ of the rows with ξ′ > 0 that the edit would have changed: row, and change of SH `[K,3]`.
    pub expected: Vec<(u32, Vec<[f32; 3]>)>,
    /// Rows that only exist because a deletion missed them.
    pub ghosts: Vec<u32>,
    /// Whether the edit changed hidden splats by itself, so that those it left are meant to be as
    /// they are.
    pub reaches_hidden: bool,
    /// Hidden rows near a change, of which nothing tells what they should be.
    pub num_undecided: usize,
}

/// Key times at which motion is compared.
const KEY_TIMES: usize = 8;

impl Evidence {
    /// Evidence of the edit of `before` that `scene` carries, from `cameras` that look at frame 1
    /// at `edit_time`.
    ///
    /// # Errors
    /// If a scene cannot be evaluated, arrays disagree, or the rasteriser fails.
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
        evidence.vote(&nodes, &surface, params);
        evidence.judge(&nodes, &surface, (&first, &old), num_buried, params);
        Ok(evidence)
    }

    /// Change of base colour from which a splat counts as edited: above the noise of an edit that
    /// moved every splat it saw a little.
    fn least_change(&self, sizes: &[f32], params: &EvidenceParams) -> f32 {
        let seen = sizes.iter().zip(&self.supervision).filter(|(_, known)| **known > 0.5);
        let mut seen: Vec<f32> = seen.map(|(size, _)| *size).collect();
        seen.sort_by(f32::total_cmp);
        let share = |of: usize| seen.get(seen.len() / of).copied().unwrap_or(0.0);
        // a tenth of half-normal noise lies below an eighth of its deviation
        params.min_change.max((24.0 * share(10)).min(0.5 * share(2)))
    }

    /// Shares of the surface around each hidden splat, and whether the edit reaches hidden splats.
    fn vote(&mut self, nodes: &Nodes, surface: &Surface, params: &EvidenceParams) {
        let count = self.changed.len();
        let label = |i: usize| match self.changed.get(i) {
            Some(&changed) => [f32::from(u8::from(changed)), 0.0],
            None => [0.0, 1.0],
        };
        // what is gone was taken by the edit, seen or not; what has no source tells nothing of a
        // change
        let seen = |i: usize| match self.supervision.get(i) {
            Some(&supervision) if nodes.has_source[i] => supervision,
            Some(_) => 0.0,
            None => 1.0,
        };
        let first = vote::harmonic(surface, &label, &seen);
        let (mut reached, mut hidden) = (0.0_f64, 0.0_f64);
        for i in (0..count).filter(|&i| nodes.has_source[i] && first[i][0] > 0.5) {
            let weight = f64::from(1.0 - self.supervision[i]);
            hidden += weight;
            reached += if self.changed[i] { weight } else { 0.0 };
        }
        self.reaches_hidden = hidden > 0.0 && reached > 0.5 * hidden;
        // a hidden splat that changed is no accident
        let known = |i: usize| match self.changed.get(i) {
            Some(true) if nodes.has_source[i] => 1.0,
            _ => seen(i),
        };
        let shares = vote::harmonic(surface, &label, &known);
        for (i, share) in shares[..count].iter().enumerate() {
            (self.agreement[i], self.deleted[i]) = (share[0], share[1]);
            let near = share[0] + share[1];
            let decided = share[0].max(share[1]) > params.min_agreement;
            if self.supervision[i] < 1.0 && !self.changed[i] && near > 0.2 && !decided {
                self.num_undecided += 1;
            }
        }
    }

    /// ξ′, what is to be changed, and what is to fade.
    fn judge(
        &mut self,
        nodes: &Nodes,
        surface: &Surface,
        (first, old): (&Splats, &[[f32; 3]]),
        num_buried: usize,
        params: &EvidenceParams,
    ) {
        let open =
            |i: &usize| nodes.has_source[*i] && !self.changed[*i] && self.supervision[*i] < 1.0;
        let rows: Vec<usize> = (0..first.len()).filter(open).collect();
        let missed: Vec<usize> = rows
            .iter()
            .copied()
            .filter(|&i| !self.reaches_hidden && self.agreement[i] > params.min_agreement)
            .collect();
        let teachers: Vec<usize> = (0..first.len())
            .filter(|&i| nodes.has_source[i] && self.changed[i] && self.supervision[i] > 0.5)
            .collect();
        let changes = expected_changes(nodes, surface, first, old, &missed, &teachers, params);
        for (i, change) in missed.into_iter().zip(changes) {
            let Some(change) = change else {
                self.num_undecided += 1;
                continue;
            };
            let size: f32 = change[0].iter().map(|x| (x * sh::C0).abs()).sum();
            self.xi[i] = 1.0 - (-(1.0 - self.supervision[i]) * self.agreement[i] * size).exp();
            self.expected.push((row_id(i), change));
        }
        let is_ghost =
            |i: &usize| self.deleted[*i] > params.min_agreement && self.supervision[*i] <= 0.0;
        let ghosts: Vec<usize> = rows.into_iter().filter(is_ghost).collect();
        // A deletion that took splats from under what remains knew of them; and it took most of
        // what it meant to.
        let num_gone = nodes.len() - self.changed.len();
        if ghosts.len() > num_buried && ghosts.len() <= num_gone {
            for i in ghosts {
                self.xi[i] = 1.0;
                self.ghosts.push(row_id(i));
            }
        }
    }
}

/// Shares between which supervision grows from 0 to 1: those of the parameters, or less where
/// splats overlap so much that those which the edit changed show less of themselves (a quarter, and
/// three quarters, of their median share).
fn thresholds(shares: &[f32], sizes: &[f32], params: &EvidenceParams) -> [f32; 2] {
    let changed = shares.iter().zip(sizes).filter(|(_, size)| **size > params.min_change);
    let mut changed: Vec<f32> =
        changed.map(|(share, _)| *share).filter(|share| *share > 0.0).collect();
    if changed.is_empty() {
        return [params.hidden, params.supervised];
    }
    let middle = changed.len() / 2;
    let typical = *changed.select_nth_unstable_by(middle, f32::total_cmp).1;
    [params.hidden.min(0.25 * typical), params.supervised.min(0.75 * typical)]
}
