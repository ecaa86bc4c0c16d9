//! What an edit of a surface does to splats that stand for it at other times: see [`Inherited`].

use crate::colour_change::{ColourChange, ColourPairs};
use crate::generations::{Descent, Generations};
use crate::identity::{Identity, IdentityMap};
use crate::row_index::index;
use crate::row_kind::RowKind;
use crate::work::Row;
use anchors::KdTree;
use gs_core::{Real, Splats, activation, sh};

/// Recoloured splats around an ancestor from which a change of colour is learnt.
const NEIGHBORS: usize = 24;
/// Shares of ancestors that were recoloured between which a descendant takes a share of the change:
/// what stands for both sides of a border is drawn on both.
const SOFT: [f32; 2] = [0.3, 0.7];
/// Splats around a deleted one, itself included, of which half are deleted with its surface: a
/// tenth deleted at random leaves one surface in a few thousand mistaken.
const AROUND: usize = 16;
/// Opacities of ancestors that differ by less were not edited.
const SAME_OPACITY: f32 = 2e-3;

/// Opacities that logits hold with some precision left.
const MOST_OPACITY: f32 = 0.9999;
const LEAST_OPACITY: f32 = 1e-8;
/// Logit of what is not there: an opacity of 2e-9.
const FADED_LOGIT: f32 = -20.0;

/// What a source splat inherits of the edit from the splats of the edit frame that it descends
/// from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inherited {
    /// Edited row, of kind [`RowKind::Descendant`].
    pub row: u32,
    /// How sure the descent is, 0 to 1.
    pub confidence: f32,
    /// Factor on the opacity; 0 where the surface was deleted.
    pub opacity: f32,
    /// Change of colour.
    pub colour: ColourChange,
    /// Group with which the surface was moved.
    pub group: Option<u32>,
}

impl Inherited {
    /// The logit of a source's opacity times the factor; the same bits if that is 1.
    pub(crate) fn logit(&self, logit: f32) -> f32 {
        if self.opacity == 1.0 {
            return logit;
        }
        let opacity = (activation::sigmoid(logit) * self.opacity).min(MOST_OPACITY);
        if opacity > LEAST_OPACITY { activation::logit(opacity) } else { FADED_LOGIT }
    }

    pub(crate) fn fault(&self, rows: usize, groups: usize) -> bool {
        let numbers = self.opacity.is_finite() && self.confidence.is_finite();
        let in_range =
            (self.row as usize) < rows && self.group.is_none_or(|group| (group as usize) < groups);
        !(numbers && self.opacity >= 0.0 && self.colour.is_finite() && in_range)
    }
}

/// What the edit did to a splat that its frame shows.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fate {
    Gone,
    Kept,
    Recoloured(usize),
    Moved(u32),
}

/// Marks rows that inherit something as [`RowKind::Descendant`]s and says what.
pub(crate) fn inherit(
    generations: &Generations,
    (at_edit, edited): (&Splats, &Splats),
    identity: &IdentityMap,
    group_of: &[u32],
    rows: &mut [Row],
) -> Vec<Inherited> {
    let mut fates = fates(identity, group_of, at_edit.len());
    keep_pruned(&mut fates, generations, at_edit);
    let palette = Palette::of(generations, at_edit, edited, &fates);
    let mut inherited = Vec::new();
    for (row, kind) in identity.rows.iter().enumerate() {
        let Identity::Unchanged(id) = *kind else { continue };
        let descent = &generations.descent[id as usize];
        if descent.of.is_empty() {
            continue;
        }
        let colour = at_rest_colour(at_edit, id as usize);
        if let Some(found) = palette.inherited(row, descent, colour, &fates) {
            rows[row].0 = RowKind::Descendant;
            inherited.push(found);
        }
    }
    inherited
}

/// What became of each source splat; those that the frame does not show are not asked.
fn fates(identity: &IdentityMap, group_of: &[u32], num_sources: usize) -> Vec<Fate> {
    let mut fates = vec![Fate::Gone; num_sources];
    for (row, kind) in identity.rows.iter().enumerate() {
        match *kind {
            Identity::Unchanged(id) => fates[id as usize] = Fate::Kept,
            Identity::Recoloured(id) => fates[id as usize] = Fate::Recoloured(row),
            // What is also still in its place was copied.
            Identity::Moved { source, .. } if fates[source as usize] == Fate::Gone => {
                fates[source as usize] = Fate::Moved(group_of.get(row).copied().unwrap_or(0));
            }
            Identity::Moved { .. } | Identity::Edited => {}
        }
    }
    fates
}

/// A surface is deleted where most of the splats around a deleted one are. Where they are still
/// there, an editor has thinned them out, and what descends from the missing ones stays.
fn keep_pruned(fates: &mut [Fate], generations: &Generations, at_edit: &Splats) {
    let shown: Vec<usize> = (0..fates.len()).filter(|&id| generations.is_shown(id)).collect();
    let is_gone: Vec<bool> = shown.iter().map(|&id| fates[id] == Fate::Gone).collect();
    let places: Vec<[f64; 3]> = shown.iter().map(|&id| at_edit.means[id].map(f64::from)).collect();
    let tree = KdTree::<3>::new(&places);
    let is_hole = tree.map(&places, AROUND, |_, near| {
        let gone = near.iter().filter(|n| is_gone[n.id as usize]).count();
        2 * gone >= near.len()
    });
    for ((&id, gone), hole) in shown.iter().zip(is_gone).zip(is_hole) {
        if gone && !hole {
            fates[id] = Fate::Kept;
        }
    }
}

fn at_rest_colour(splats: &Splats, i: usize) -> [f32; 3] {
    splats.sh_of(i)[0].map(|c| 0.5 + sh::C0 * c)
}

/// The changes of colour of an edit, by place.
struct Palette {
    /// Source ids of recoloured splats that the frame shows.
    ids: Vec<usize>,
    /// What was done around each.
    changes: Vec<ColourChange>,
    /// Factor on the opacity of each.
    opacities: Vec<f32>,
}

impl Palette {
    fn of(generations: &Generations, at_edit: &Splats, edited: &Splats, fates: &[Fate]) -> Self {
        let recoloured: Vec<(usize, usize)> = fates
            .iter()
            .enumerate()
            .filter(|(id, _)| generations.is_shown(*id))
            .filter_map(|(id, fate)| match *fate {
                Fate::Recoloured(row) => Some((id, row)),
                _ => None,
            })
            .collect();
        let places: Vec<[f64; 3]> =
            recoloured.iter().map(|&(id, _)| at_edit.means[id].map(f64::from)).collect();
        let pair = |pairs: &mut ColourPairs, weight: f64, at: usize| {
            let (id, row) = recoloured[at];
            let weight = weight * f64::from(at_edit.opacity(id));
            let wide = |colour: [f32; 3]| colour.map(f64::from);
            let (from, to) = (at_rest_colour(at_edit, id), at_rest_colour(edited, row));
            pairs.add(weight, wide(from), wide(to));
            let (from, to) = (&at_edit.sh_of(id)[1..], &edited.sh_of(row)[1..]);
            pairs.add_harmonics(weight, from, to);
        };
        let mut all = ColourPairs::default();
        (0..recoloured.len()).for_each(|at| pair(&mut all, 1.0, at));
        let whole = all.change(&ColourChange::NONE);
        let tree = KdTree::<3>::new(&places);
        let changes = tree.map(&places, NEIGHBORS, |_, near| {
            let width = near[near.len() / 3].distance_squared.max(f64::MIN_POSITIVE);
            let mut pairs = ColourPairs::default();
            for n in near {
                let weight = (-0.5 * n.distance_squared / width).exp();
                pair(&mut pairs, weight, n.id as usize);
            }
            pairs.change(&whole)
        });
        let opacities = recoloured
            .iter()
            .map(|&(id, row)| {
                let (before, after) = (at_edit.opacity(id), edited.opacity(row));
                if (before - after).abs() < SAME_OPACITY { 1.0 } else { after / before }
            })
            .collect();
        Self { ids: recoloured.into_iter().map(|(id, _)| id).collect(), changes, opacities }
    }

    /// What a row inherits; nothing if its ancestors are as they were.
    fn inherited(
        &self,
        row: usize,
        descent: &Descent,
        colour: [f32; 3],
        fates: &[Fate],
    ) -> Option<Inherited> {
        // Shares are cut off where they are small, so they sum to a little less than 1.
        let (mut gone, mut left, mut recoloured, mut factor) = (0.0, 0.0, 0.0, 0.0);
        let mut moved: Vec<(u32, f32)> = Vec::new();
        let mut sum = ColourSum::default();
        for &(id, share) in &descent.of {
            if fates[id as usize] != Fate::Gone {
                left += share;
            }
            match fates[id as usize] {
                Fate::Gone => gone += share,
                Fate::Kept => factor += share,
                Fate::Recoloured(_) => {
                    let Ok(at) = self.ids.binary_search(&(id as usize)) else { continue };
                    recoloured += share;
                    factor += share * self.opacities[at];
                    sum.add(share, &self.changes[at]);
                }
                Fate::Moved(group) => {
                    factor += share;
                    match moved.iter_mut().find(|(of, _)| *of == group) {
                        Some(entry) => entry.1 += share,
                        None => moved.push((group, share)),
                    }
                }
            }
        }
        let opacity = if gone > left {
            0.0
        } else {
            let kept = factor / left;
            if (kept - 1.0).abs() < SAME_OPACITY { 1.0 } else { kept }
        };
        let softened = {
            let x = ((recoloured - SOFT[0]) / (SOFT[1] - SOFT[0])).clamp(0.0, 1.0);
            x * x * (3.0 - 2.0 * x)
        };
        let change =
            if softened > 0.0 { sum.mean(colour).share(softened) } else { ColourChange::NONE };
        let group = moved
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            .filter(|entry| entry.1 > 0.5)
            .map(|entry| entry.0);
        let nothing = opacity == 1.0 && change == ColourChange::NONE && group.is_none();
        (!nothing).then_some(Inherited {
            row: index(row),
            confidence: descent.confidence,
            opacity,
            colour: change,
            group,
        })
    }
}

/// A weighted mean of changes.
#[derive(Default)]
struct ColourSum {
    weight: f32,
    matrix: [[f32; 3]; 3],
    offset: [f32; 3],
    harmonics: f32,
}

impl ColourSum {
    fn add(&mut self, weight: f32, change: &ColourChange) {
        self.weight += weight;
        for i in 0..3 {
            self.offset[i] += weight * change.offset[i];
            for j in 0..3 {
                self.matrix[i][j] += weight * change.matrix[i][j];
            }
        }
        self.harmonics += weight * change.harmonics;
    }

    /// The mean; colours that it would take out of what can be shown go to its bounds.
    fn mean(&self, colour: [f32; 3]) -> ColourChange {
        let over = 1.0 / self.weight;
        let mut mean = ColourChange {
            matrix: self.matrix.map(|row| row.map(|v| v * over)),
            offset: self.offset.map(|v| v * over),
            harmonics: self.harmonics * over,
        };
        let shown = mean.apply(colour);
        for i in 0..3 {
            if colour[i] >= 0.0 && colour[i] <= 1.0 {
                mean.offset[i] += shown[i].clamp(0.0, 1.0) - shown[i];
            }
        }
        mean
    }
}

/// What was reached by descent, in numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DescentReport {
    /// Source splats that are visible at some time.
    pub visible: usize,
    /// Of these, shown by the edit frame.
    pub shown: usize,
    /// Of the others, descended from something that it shows.
    pub descended: usize,
    /// Rows that inherit another colour or opacity.
    pub recoloured: usize,
    /// Rows that inherit a deletion.
    pub removed: usize,
    /// Rows that inherit a move, turn or scaling.
    pub moved: usize,
    /// Mean confidence of rows that inherit anything, 0 to 1.
    pub confidence: f64,
    /// Of these, rows whose confidence is below a half.
    pub unsure: usize,
    /// Splats of the edit frame that edited ones follow as if they lasted.
    pub lasting: usize,
}

impl DescentReport {
    pub(crate) fn of(generations: &Generations, inherited: &[Inherited], lasting: usize) -> Self {
        let lives = &generations.lives;
        let visible = (0..lives.len()).filter(|&i| lives.is_there(lives.prime[i], i)).count();
        let shown = (0..lives.len()).filter(|&i| generations.is_shown(i)).count();
        let count = |of: &dyn Fn(&Inherited) -> bool| inherited.iter().filter(|i| of(i)).count();
        let total: f64 = inherited.iter().map(|i| f64::from(i.confidence)).sum();
        let removed = |i: &Inherited| i.opacity <= 0.0;
        Self {
            visible,
            shown,
            descended: generations.descent.iter().filter(|d| !d.of.is_empty()).count(),
            recoloured: count(&|i| !removed(i) && i.group.is_none()),
            removed: count(&removed),
            moved: count(&|i| !removed(i) && i.group.is_some()),
            confidence: if inherited.is_empty() { 0.0 } else { total / inherited.len() as f64 },
            unsure: count(&|i| i.confidence < 0.5),
            lasting,
        }
    }
}

/// A colour as harmonics hold it.
pub(crate) fn changed_dc(change: &ColourChange, dc: [f32; 3]) -> [f32; 3] {
    change.apply(dc.map(|c| 0.5 + sh::C0 * c)).map(|c| ((c - 0.5) / sh::C0).as_f32())
}
