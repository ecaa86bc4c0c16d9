//! [`PersistentSplats`]: splats of the edit frame, extended over the whole clip. Outside their own
//! lifetimes they follow the splats that represent the same surface.
//!
//! A splat `a` of the edit frame has a few carriers `s`, each with a rest position `p_s`, its
//! position at the edit time. At time `t`, `a` moves by the rigid motion that best maps the rest
//! positions to the positions of the carriers,
//!
//! ```text
//! M_a(t) = argmin Σ_s w_as v_s(t)² |M p_s − x_s(t)|²,    x_a(t) = M_a(t) x_a
//! ```
//!
//! where the presence `v_s(t)` of a carrier is continuous, 0 to 1, so that the motion is continuous
//! between generations. `M_a` is relative to its value at the edit time, so that `a` has exactly
//! its own position in the edit frame.

use crate::AmgError;
use crate::generations::{FACING, FOLLOW_PRESENCE, Generations, NEIGHBORS, OpacityRange};
use crate::rigid::{RigidFit, dot, norm};
use crate::row_index::index;
use crate::similarity::Similarity;
use anchors::KdTree;
use gs_core::{DynamicScene, Real, SceneError, Splats, TimeRange, quat};
use rayon::prelude::*;
use std::sync::Arc;

/// Maximum number of times at which carriers are selected; the intervals are shorter than a
/// lifetime.
const CHOICES: usize = 33;
/// Minimum presence of a carrier, so that the motion is defined when none of them is visible.
const MIN_PRESENCE: f64 = 1e-3;

/// A source splat whose motion persistent splats follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Carrier {
    /// Id of the source splat.
    pub source: u32,
    /// Position at the edit time, world frame and units; estimated if it is invisible then.
    pub rest: [f32; 3],
    /// Opacity, 0 to 1, at and below which its presence is 0.
    pub floor: f32,
    /// Opacity, 0 to 1, at which its presence is 1; above `floor`.
    pub peak: f32,
}

/// Neighbours of a splat in rest positions, over all times at which carriers are selected.
#[derive(Debug, Clone, Default)]
struct Near {
    /// Median squared distance, averaged over those times.
    width: f64,
    /// Source ids, squared distances, misalignments.
    found: Vec<(u32, f64, f64)>,
}

impl Carrier {
    fn opacity_range(&self) -> OpacityRange {
        OpacityRange { floor: self.floor, peak: self.peak }
    }

    pub(crate) fn fault(&self, num_sources: usize) -> bool {
        let finite = self.rest.iter().chain([&self.floor, &self.peak]).all(|v| v.is_finite());
        !finite || self.peak <= self.floor || self.source as usize >= num_sources
    }
}

/// Source splats of the edit frame that edited splats follow over the whole clip, and their
/// carriers: a sparse matrix of weights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PersistentSplats {
    /// Source ids, ascending, `[A]`.
    pub ids: Vec<u32>,
    /// Start of each splat's carriers in `carrier_indices`, and the end of the last, `[A+1]`.
    pub offsets: Vec<u32>,
    /// Indices into `carriers`, `[nnz]`.
    pub carrier_indices: Vec<u32>,
    /// Weights above 0, `[nnz]`.
    pub weights: Vec<f32>,
    /// All carriers, in ascending order of source id.
    pub carriers: Vec<Carrier>,
}

impl PersistentSplats {
    /// The carriers of the splats `ids` (ascending).
    pub(crate) fn of(generations: &Generations, at_edit: &Splats, ids: &[u32]) -> Self {
        let lifetimes = &generations.lifetimes;
        let step = lifetimes.times.len().div_ceil(CHOICES).max(1);
        let mut chosen_at: Vec<usize> = (0..lifetimes.times.len()).step_by(step).collect();
        chosen_at.push(lifetimes.edit);
        chosen_at.push(lifetimes.times.len() - 1);
        chosen_at.sort_unstable();
        chosen_at.dedup();
        let positions: Vec<[f64; 3]> =
            ids.iter().map(|&id| at_edit.means[id as usize].map(f64::from)).collect();
        let mut near_of: Vec<Near> = vec![Near::default(); ids.len()];
        for &k in &chosen_at {
            let there: Vec<usize> = (0..lifetimes.len())
                .filter(|&i| {
                    generations.rest[i].is_some() && lifetimes.presence(k, i) > FOLLOW_PRESENCE
                })
                .collect();
            if there.is_empty() {
                continue;
            }
            let rest = |&i: &usize| generations.rest[i].map_or([0.0; 3], |rest| rest.position);
            let tree = KdTree::<3>::new(&there.iter().map(rest).collect::<Vec<_>>());
            let found = tree.map(&positions, NEIGHBORS, |at, near| {
                let own = generations.axis(ids[at] as usize);
                let width = near[near.len() / 2].distance_squared;
                let entry = |n: &anchors::Neighbor| {
                    let i = there[n.id as usize];
                    let axis = generations.axis(i);
                    let facing = norm(own) * norm(axis) - dot(own, axis).abs();
                    (index(i), n.distance_squared, facing.max(0.0))
                };
                (width, near.iter().map(entry).collect::<Vec<(u32, f64, f64)>>())
            });
            for (all, (width, found)) in near_of.iter_mut().zip(found) {
                all.width += width / chosen_at.len() as f64;
                all.found.extend(found);
            }
        }
        let rows: Vec<Vec<(u32, f32)>> = near_of
            .into_par_iter()
            .map(|Near { width, found: mut near }| {
                near.sort_unstable_by_key(|entry| entry.0);
                near.dedup_by_key(|entry| entry.0);
                let width = width.max(f64::MIN_POSITIVE);
                let weigh = |&(id, squared, facing): &(u32, f64, f64)| {
                    let confidence =
                        generations.rest[id as usize].map_or(0.0, |rest| rest.confidence);
                    let weight = confidence * (-0.5 * squared / width - FACING * facing).exp();
                    (id, weight.as_f32())
                };
                near.iter().map(weigh).filter(|entry| entry.1 > 1e-4).collect()
            })
            .collect();
        Self::from_rows(generations, ids, &rows)
    }

    fn from_rows(generations: &Generations, ids: &[u32], rows: &[Vec<(u32, f32)>]) -> Self {
        let mut used: Vec<u32> = rows.iter().flatten().map(|entry| entry.0).collect();
        used.sort_unstable();
        used.dedup();
        let carrier = |&source: &u32| {
            let i = source as usize;
            let OpacityRange { floor, peak } = generations.lifetimes.opacity_ranges[i];
            let rest = generations.rest[i].map_or([0.0; 3], |rest| rest.position.map(Real::as_f32));
            Carrier { source, rest, floor, peak }
        };
        let mut persistent = Self {
            ids: ids.to_vec(),
            offsets: vec![0],
            carriers: used.iter().map(carrier).collect(),
            ..Self::default()
        };
        for row in rows {
            for (id, weight) in row {
                persistent.carrier_indices.push(used.binary_search(id).map_or(0, index));
                persistent.weights.push(*weight);
            }
            persistent.offsets.push(index(persistent.carrier_indices.len()));
        }
        persistent
    }

    /// The subset of the `wanted` splats, without unused carriers.
    pub(crate) fn only(&self, wanted: impl Fn(u32) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.ids.len()).filter(|&a| wanted(self.ids[a])).collect();
        let mut used = vec![false; self.carriers.len()];
        for &a in &kept {
            self.row(a).0.iter().for_each(|&c| used[c as usize] = true);
        }
        let mut place = vec![0; self.carriers.len()];
        let mut carriers = Vec::new();
        for (c, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            place[c] = index(carriers.len());
            carriers.push(self.carriers[c]);
        }
        let mut persistent = Self { offsets: vec![0], carriers, ..Self::default() };
        for a in kept {
            let (ids, weights) = self.row(a);
            persistent.ids.push(self.ids[a]);
            persistent.carrier_indices.extend(ids.iter().map(|&c| place[c as usize]));
            persistent.weights.extend(weights);
            persistent.offsets.push(index(persistent.carrier_indices.len()));
        }
        persistent
    }

    /// Whether there are no such splats.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    fn row(&self, a: usize) -> (&[u32], &[f32]) {
        let range = self.offsets[a] as usize..self.offsets[a + 1] as usize;
        (&self.carrier_indices[range.clone()], &self.weights[range])
    }

    /// A description of the first invalid value, if there is one.
    pub(crate) fn fault(&self, num_sources: usize) -> Option<String> {
        let entries = self.carrier_indices.len();
        let ascending = |ids: &[u32]| ids.windows(2).all(|pair| pair[0] < pair[1]);
        let rising = self.offsets.windows(2).all(|pair| pair[0] <= pair[1]);
        if self.ids.is_empty() && self.offsets.len() <= 1 && entries == 0 {
            return None;
        }
        if self.offsets.len() != self.ids.len() + 1
            || self.offsets[0] != 0
            || !rising
            || self.offsets[self.ids.len()] as usize != entries
            || self.weights.len() != entries
            || !ascending(&self.ids)
        {
            return Some("the arrays of persistent splats are inconsistent".to_owned());
        }
        if let Some(id) = self.ids.iter().find(|&&id| id as usize >= num_sources) {
            return Some(format!(
                "persistent splat {id} is out of range: the source has {num_sources} splats"
            ));
        }
        if let Some(at) = self.carriers.iter().position(|c| c.fault(num_sources)) {
            return Some(format!("carrier {at} is invalid: {:?}", self.carriers[at]));
        }
        if let Some(at) =
            self.carrier_indices.iter().position(|&c| c as usize >= self.carriers.len())
        {
            return Some(format!("carrier index {at} of persistent splats is out of range"));
        }
        let positive = |w: &f32| *w > 0.0 && w.is_finite();
        let at = self.weights.iter().position(|w| !positive(w))?;
        Some(format!("weight {at} of persistent splats is {}, expected above 0", self.weights[at]))
    }

    /// Writes positions and rotations of the persistent splats for the source state `source_t` to
    /// `out`, which contains the source at the edit time. `from`: motions at the edit time, `[A]`.
    pub(crate) fn move_into(&self, from: &[PersistentMotion], source_t: &Splats, out: &mut Splats) {
        let motions = self.motions(source_t);
        for ((&id, from), to) in self.ids.iter().zip(from).zip(&motions) {
            let id = id as usize;
            let Some((from, to)) = from.0.as_ref().zip(to.0.as_ref()) else { continue };
            let position = to.apply(from.inverse().apply(out.means[id].map(f64::from)));
            let rotation = quat::mul(to.rotation, quat::conjugate(from.rotation));
            out.means[id] = position.map(Real::as_f32);
            out.quats[id] = quat::mul(rotation.map(Real::as_f32), out.quats[id]);
        }
    }

    /// Motions of the persistent splats from rest to the source state `source_t`.
    pub(crate) fn motions(&self, source_t: &Splats) -> Vec<PersistentMotion> {
        let present: Vec<f64> = self
            .carriers
            .iter()
            .map(|carrier| {
                carrier.opacity_range().presence(source_t.opacity(carrier.source as usize))
            })
            .collect();
        (0..self.ids.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|a| {
                let (carrier_indices, weights) = self.row(a);
                if carrier_indices.is_empty() {
                    return PersistentMotion(None);
                }
                let pairs = carrier_indices.iter().zip(weights).map(|(&c, &weight)| {
                    let carrier = &self.carriers[c as usize];
                    let there = present[c as usize].powi(2) + MIN_PRESENCE * MIN_PRESENCE;
                    let to = source_t.means[carrier.source as usize].map(f64::from);
                    (f64::from(weight) * there, carrier.rest.map(f64::from), to)
                });
                let fit = RigidFit::of(pairs);
                let rotation = fit.rotation(0.0);
                let motion = Similarity {
                    scale: 1.0,
                    rotation,
                    mirrored: false,
                    translation: fit.apply(rotation, [0.0; 3]),
                };
                PersistentMotion(motion.is_valid().then_some(motion))
            })
            .collect()
    }
}

/// PersistentMotion of a persistent splat from rest; `None` if it has no carriers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PersistentMotion(Option<Similarity>);

/// The source with the splats of the edit frame extended over the whole clip, as input to the
/// motion guides. Splats that are invisible in the edit frame do not move.
#[derive(Debug)]
pub(crate) struct PersistentScene {
    pub(crate) source: Arc<dyn DynamicScene>,
    pub(crate) at_edit: Splats,
    pub(crate) edit_time: f32,
    pub(crate) persistent: PersistentSplats,
    from: Vec<PersistentMotion>,
}

impl PersistentScene {
    pub(crate) fn new(
        source: Arc<dyn DynamicScene>,
        generations: &Generations,
        edit_time: f32,
    ) -> Result<Self, AmgError> {
        let at_edit = source.at(edit_time)?;
        let ids: Vec<u32> =
            (0..at_edit.len()).filter(|&i| generations.is_shown(i)).map(index).collect();
        let persistent = PersistentSplats::of(generations, &at_edit, &ids);
        let from = persistent.motions(&at_edit);
        Ok(Self { source, at_edit, edit_time, persistent, from })
    }
}

impl DynamicScene for PersistentScene {
    fn num_splats(&self) -> usize {
        self.source.num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.source.sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        self.source.time_range()
    }

    fn num_frames(&self) -> Option<usize> {
        self.source.num_frames()
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        out.clone_from(&self.at_edit);
        if t != self.edit_time {
            let source_t = self.source.at(t)?;
            self.persistent.move_into(&self.from, &source_t, out);
        }
        Ok(())
    }

    fn fades(&self) -> bool {
        false
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.source.dynamic_mask()
    }
}
