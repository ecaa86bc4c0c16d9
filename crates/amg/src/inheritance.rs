//! The effect of an edit on splats that represent the edited surface at other times: see
//! [`Inherited`].

use crate::color_change::{ColorChange, ColorPairs};
use crate::generations::{Ancestry, Generations};
use crate::identity::{Identity, IdentityMap};
use crate::row_index::index;
use crate::row_kind::RowKind;
use crate::work::Row;
use anchors::KdTree;
use gs_core::{Real, Splats, activation, sh};

/// Number of nearest splats, including the splat itself, from which a change is estimated: the
/// change of colour from the recoloured ones, a deletion of the surface from all. The surface
/// counts as deleted if a third of them are deleted. If an editor deletes a tenth of all splats at
/// random, this is wrong for 0.6 in 1000 of the deleted ones.
const NEIGHBORS: usize = 32;
/// Between these shares of recoloured ancestors, a descendant gets a part of the change, because it
/// covers both sides of the border of the edit.
const SOFT: [f32; 2] = [0.3, 0.7];
/// Changes of opacity below this are rounding of the editor.
const SAME_OPACITY: f32 = 2e-3;

/// Opacities outside this range lose precision as logits.
const MOST_OPACITY: f32 = 0.9999;
const LEAST_OPACITY: f32 = 1e-8;
/// Logit of an invisible splat: an opacity of 2e-9.
const FADED_LOGIT: f32 = -20.0;

/// The part of the edit that a source splat inherits from its ancestors in the edit frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inherited {
    /// Edited row, of kind [`RowKind::Descendant`].
    pub row: u32,
    /// Confidence of the ancestry, 0 to 1.
    pub confidence: f32,
    /// Factor on the opacity; 0 where the surface was deleted.
    pub opacity: f32,
    /// Change of colour.
    pub color: ColorChange,
    /// Moved group to which the surface belongs.
    pub group: Option<u32>,
}

impl Inherited {
    /// The logit of the source's opacity times the factor; unchanged if the factor is 1.
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
        !(numbers && self.opacity >= 0.0 && self.color.is_finite() && in_range)
    }
}

/// The effect of the edit on a splat that is visible in the edit frame.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fate {
    Gone,
    Kept,
    Recoloured(usize),
    Moved(u32),
}

/// Finds the edit that each row inherits, and marks the rows that inherit one as
/// [`RowKind::Descendant`].
pub(crate) fn inherit(
    generations: &Generations,
    (at_edit, edited): (&Splats, &Splats),
    identity: &IdentityMap,
    group_of: &[u32],
    rows: &mut [Row],
) -> Vec<Inherited> {
    let mut fates = fates(identity, edited, group_of, at_edit.len());
    keep_pruned(&mut fates, generations, at_edit);
    let stacks = stacks(identity, edited, at_edit.len());
    let palette = Palette::of(generations, at_edit, edited, &fates, &stacks);
    let mut inherited = Vec::new();
    for (row, kind) in identity.rows.iter().enumerate() {
        let Identity::Unchanged(id) = *kind else { continue };
        let ancestry = &generations.ancestries[id as usize];
        if ancestry.of.is_empty() {
            continue;
        }
        let color = dc_color(at_edit, id as usize);
        if let Some(found) = palette.inherited(row, ancestry, color, &fates) {
            rows[row].0 = RowKind::Descendant;
            inherited.push(found);
        }
    }
    inherited
}

/// The fate of each source splat; undefined for splats that are invisible in the edit frame. If
/// several rows are at the place of a splat, the most opaque recoloured one counts.
fn fates(
    identity: &IdentityMap,
    edited: &Splats,
    group_of: &[u32],
    num_sources: usize,
) -> Vec<Fate> {
    let mut fates = vec![Fate::Gone; num_sources];
    for (row, kind) in identity.rows.iter().enumerate() {
        match *kind {
            Identity::Unchanged(id) => {
                if !matches!(fates[id as usize], Fate::Recoloured(_)) {
                    fates[id as usize] = Fate::Kept;
                }
            }
            Identity::Recoloured(id) => match fates[id as usize] {
                Fate::Recoloured(other) if edited.opacity(other) >= edited.opacity(row) => {}
                _ => fates[id as usize] = Fate::Recoloured(row),
            },
            // A splat that is also at its original place was copied.
            Identity::Moved { source, .. } if fates[source as usize] == Fate::Gone => {
                fates[source as usize] = Fate::Moved(group_of.get(row).copied().unwrap_or(0));
            }
            Identity::Moved { .. } | Identity::Edited => {}
        }
    }
    fates
}

/// The rows at the place of a source splat.
#[derive(Debug, Clone, Copy, Default)]
struct Stack {
    /// Combined opacity of all rows.
    together: f32,
    /// Opacity of the most opaque row.
    most: f32,
}

impl Stack {
    /// The opacity of the surface. Clones do not make it more opaque than the splat was, or than
    /// the most opaque clone; densification places them exactly on their originals.
    fn of_surface(self, before: f32) -> f32 {
        self.together.min(before.max(self.most))
    }
}

fn stacks(identity: &IdentityMap, edited: &Splats, num_sources: usize) -> Vec<Stack> {
    let mut stacks = vec![Stack::default(); num_sources];
    for (row, kind) in identity.rows.iter().enumerate() {
        if let Some(id) = kind.in_place() {
            let (stack, opacity) = (&mut stacks[id as usize], edited.opacity(row));
            stack.together += (1.0 - stack.together) * opacity;
            stack.most = stack.most.max(opacity);
        }
    }
    stacks
}

/// A surface is deleted where many of the splats around a deleted one are deleted, too. Elsewhere
/// the editor only thinned the splats out, and descendants of the deleted ones stay.
fn keep_pruned(fates: &mut [Fate], generations: &Generations, at_edit: &Splats) {
    let shown: Vec<usize> = (0..fates.len()).filter(|&id| generations.is_shown(id)).collect();
    let is_gone: Vec<bool> = shown.iter().map(|&id| fates[id] == Fate::Gone).collect();
    let places: Vec<[f64; 3]> = shown.iter().map(|&id| at_edit.means[id].map(f64::from)).collect();
    let gone: Vec<usize> = (0..shown.len()).filter(|&at| is_gone[at]).collect();
    let around: Vec<[f64; 3]> = gone.iter().map(|&at| places[at]).collect();
    let is_hole = KdTree::<3>::new(&places).map(&around, NEIGHBORS, |_, near| {
        let gone = near.iter().filter(|n| is_gone[n.id as usize]).count();
        3 * gone >= near.len()
    });
    for (at, is_hole) in gone.into_iter().zip(is_hole) {
        if !is_hole {
            fates[shown[at]] = Fate::Kept;
        }
    }
}

fn dc_color(splats: &Splats, i: usize) -> [f32; 3] {
    splats.sh_of(i)[0].map(|c| 0.5 + sh::C0 * c)
}

/// The edit's local changes of colour.
struct Palette {
    /// Source ids of the recoloured splats that are visible in the edit frame.
    ids: Vec<usize>,
    /// Change of colour around each.
    changes: Vec<ColorChange>,
    /// Factor on the opacity of each.
    opacities: Vec<f32>,
}

impl Palette {
    fn of(
        generations: &Generations,
        at_edit: &Splats,
        edited: &Splats,
        fates: &[Fate],
        stacks: &[Stack],
    ) -> Self {
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
        let pair = |pairs: &mut ColorPairs, weight: f64, at: usize| {
            let (id, row) = recoloured[at];
            let weight = weight * f64::from(at_edit.opacity(id));
            let wide = |color: [f32; 3]| color.map(f64::from);
            let (from, to) = (dc_color(at_edit, id), dc_color(edited, row));
            pairs.add(weight, wide(from), wide(to));
            let (from, to) = (&at_edit.sh_of(id)[1..], &edited.sh_of(row)[1..]);
            pairs.add_harmonics(weight, from, to);
        };
        let mut all = ColorPairs::default();
        (0..recoloured.len()).for_each(|at| pair(&mut all, 1.0, at));
        let whole = all.change(&ColorChange::NONE);
        let tree = KdTree::<3>::new(&places);
        let changes = tree.map(&places, NEIGHBORS, |_, near| {
            let width = near[near.len() / 3].distance_squared.max(f64::MIN_POSITIVE);
            let mut pairs = ColorPairs::default();
            for n in near {
                let weight = (-0.5 * n.distance_squared / width).exp();
                pair(&mut pairs, weight, n.id as usize);
            }
            pairs.change(&whole)
        });
        let opacities = recoloured
            .iter()
            .map(|&(id, _)| {
                let before = at_edit.opacity(id);
                let after = stacks[id].of_surface(before);
                if (before - after).abs() < SAME_OPACITY { 1.0 } else { after / before }
            })
            .collect();
        Self { ids: recoloured.into_iter().map(|(id, _)| id).collect(), changes, opacities }
    }

    /// The edit that a row inherits; `None` if its ancestors are unchanged.
    fn inherited(
        &self,
        row: usize,
        ancestry: &Ancestry,
        color: [f32; 3],
        fates: &[Fate],
    ) -> Option<Inherited> {
        // Shares are cut off where they are small, so they sum to a little less than 1.
        let (mut gone, mut left, mut recoloured, mut factor) = (0.0, 0.0, 0.0, 0.0);
        let mut moved: Vec<(u32, f32)> = Vec::new();
        let mut sum = ColorSum::default();
        for &(id, share) in &ancestry.of {
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
            if softened > 0.0 { sum.mean(color).share(softened) } else { ColorChange::NONE };
        let group = moved
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            .filter(|entry| entry.1 > 0.5)
            .map(|entry| entry.0);
        let nothing = opacity == 1.0 && change == ColorChange::NONE && group.is_none();
        (!nothing).then_some(Inherited {
            row: index(row),
            confidence: ancestry.confidence,
            opacity,
            color: change,
            group,
        })
    }
}

/// A weighted mean of changes.
#[derive(Default)]
struct ColorSum {
    weight: f32,
    matrix: [[f32; 3]; 3],
    offset: [f32; 3],
    harmonics: f32,
}

impl ColorSum {
    fn add(&mut self, weight: f32, change: &ColorChange) {
        self.weight += weight;
        for i in 0..3 {
            self.offset[i] += weight * change.offset[i];
            for j in 0..3 {
                self.matrix[i][j] += weight * change.matrix[i][j];
            }
        }
        self.harmonics += weight * change.harmonics;
    }

    /// The mean, with the offset limited so that displayable colours stay displayable.
    fn mean(&self, color: [f32; 3]) -> ColorChange {
        let over = 1.0 / self.weight;
        let mut mean = ColorChange {
            matrix: self.matrix.map(|row| row.map(|v| v * over)),
            offset: self.offset.map(|v| v * over),
            harmonics: self.harmonics * over,
        };
        let shown = mean.apply(color);
        for i in 0..3 {
            if color[i] >= 0.0 && color[i] <= 1.0 {
                mean.offset[i] += shown[i].clamp(0.0, 1.0) - shown[i];
            }
        }
        mean
    }
}

/// Counts of splats that inherit an edit from their ancestors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct InheritanceReport {
    /// Source splats that are visible at some time.
    pub visible: usize,
    /// Of these, visible in the edit frame.
    pub shown: usize,
    /// Of the others, with ancestors in the edit frame.
    pub with_ancestors: usize,
    /// Rows that inherit a change of colour or opacity.
    pub recoloured: usize,
    /// Rows that inherit a deletion.
    pub removed: usize,
    /// Rows that inherit a translation, rotation or scaling.
    pub moved: usize,
    /// Copies that last, unlike their originals.
    pub copied: usize,
    /// Mean confidence of rows that inherit anything, 0 to 1.
    pub confidence: f64,
    /// Rows that inherit with a confidence below one half.
    pub unsure: usize,
    /// Splats of the edit frame that edited ones follow over the whole clip.
    pub lasting: usize,
}

impl InheritanceReport {
    pub(crate) fn of(
        generations: &Generations,
        inherited: &[Inherited],
        copied: usize,
        lasting: usize,
    ) -> Self {
        let lives = &generations.lives;
        let visible = (0..lives.len()).filter(|&i| lives.is_visible(lives.prime[i], i)).count();
        let shown = (0..lives.len()).filter(|&i| generations.is_shown(i)).count();
        let count = |of: &dyn Fn(&Inherited) -> bool| inherited.iter().filter(|i| of(i)).count();
        let total: f64 = inherited.iter().map(|i| f64::from(i.confidence)).sum();
        let removed = |i: &Inherited| i.opacity <= 0.0;
        Self {
            visible,
            shown,
            with_ancestors: generations.ancestries.iter().filter(|d| !d.of.is_empty()).count(),
            recoloured: count(&|i| !removed(i) && i.group.is_none()),
            removed: count(&removed),
            moved: count(&|i| !removed(i) && i.group.is_some()),
            copied,
            confidence: if inherited.is_empty() { 0.0 } else { total / inherited.len() as f64 },
            unsure: count(&|i| i.confidence < 0.5),
            lasting,
        }
    }
}

/// The DC coefficients after the change.
pub(crate) fn changed_dc(change: &ColorChange, dc: [f32; 3]) -> [f32; 3] {
    change.apply(dc.map(|c| 0.5 + sh::C0 * c)).map(|c| ((c - 0.5) / sh::C0).as_f32())
}
