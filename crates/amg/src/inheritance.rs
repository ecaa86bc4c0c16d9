//! [`Inherited`]: effect of an edit on splats that represent the edited surface at other times.

use crate::color_change::{ColorChange, ColorPairs};
use crate::generations::{Ancestry, Generations};
use crate::guide_input::Row;
use crate::identity::{Identity, IdentityMap};
use crate::row_index::index;
use crate::row_kind::RowKind;
use anchors::KdTree;
use gs_core::{Real, Splats, activation, sh};

/// Number of nearest splats, including the splat itself, from which a change is estimated: changes
/// of colour from the recoloured ones, deletion of the surface from all. The surface counts as
/// deleted if at least a third of them are deleted. If an editor deletes a tenth of all splats at
/// random, 0.6 in 1000 of the deleted ones are misclassified.
const NEIGHBORS: usize = 32;
/// Between these shares of recoloured ancestors, a descendant inherits a part of the change,
/// because it covers both sides of the border of the edit.
const SOFT: [f32; 2] = [0.3, 0.7];
/// Smaller changes of opacity are rounding of the editor.
const SAME_OPACITY: f32 = 2e-3;

/// Opacities outside this range lose precision as logits.
const MAX_OPACITY: f32 = 0.9999;
const MIN_OPACITY: f32 = 1e-8;
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
    /// Change of colour of the surface.
    pub color: ColorChange,
    /// Index of the moved group to which the surface belongs.
    pub group: Option<u32>,
}

impl Inherited {
    /// The logit of the source's opacity times the factor; unchanged if the factor is 1.
    pub(crate) fn logit(&self, logit: f32) -> f32 {
        if self.opacity == 1.0 {
            return logit;
        }
        let opacity = (activation::sigmoid(logit) * self.opacity).min(MAX_OPACITY);
        if opacity > MIN_OPACITY { activation::logit(opacity) } else { FADED_LOGIT }
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
enum EditEffect {
    Deleted,
    Kept,
    Recolored(usize),
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
    let mut effects = effects(identity, edited, group_of, at_edit.len());
    keep_pruned(&mut effects, generations, at_edit);
    let coincident = coincident(identity, edited, at_edit.len());
    let palette = Palette::of(generations, at_edit, edited, &effects, &coincident);
    let mut inherited = Vec::new();
    for (row, kind) in identity.rows.iter().enumerate() {
        let Identity::Unchanged(id) = *kind else { continue };
        let ancestry = &generations.ancestries[id as usize];
        if ancestry.of.is_empty() {
            continue;
        }
        let color = dc_color(at_edit, id as usize);
        if let Some(found) = palette.inherited(row, ancestry, color, &effects) {
            rows[row].0 = RowKind::Descendant;
            inherited.push(found);
        }
    }
    inherited
}

/// Effect of the edit on each source splat; undefined for splats that are invisible in the edit
/// frame. If several rows are at the position of a splat, the most opaque recoloured one counts.
fn effects(
    identity: &IdentityMap,
    edited: &Splats,
    group_of: &[u32],
    num_sources: usize,
) -> Vec<EditEffect> {
    let mut effects = vec![EditEffect::Deleted; num_sources];
    for (row, kind) in identity.rows.iter().enumerate() {
        match *kind {
            Identity::Unchanged(id) => {
                if !matches!(effects[id as usize], EditEffect::Recolored(_)) {
                    effects[id as usize] = EditEffect::Kept;
                }
            }
            Identity::Recolored(id) => match effects[id as usize] {
                EditEffect::Recolored(other) if edited.opacity(other) >= edited.opacity(row) => {}
                _ => effects[id as usize] = EditEffect::Recolored(row),
            },
            // A splat that is also at its original position was copied.
            Identity::Moved { source, .. } if effects[source as usize] == EditEffect::Deleted => {
                effects[source as usize] =
                    EditEffect::Moved(group_of.get(row).copied().unwrap_or(0));
            }
            Identity::Moved { .. } | Identity::Edited => {}
        }
    }
    effects
}

/// Opacities of the edited rows at the position of a source splat.
#[derive(Debug, Clone, Copy, Default)]
struct CoincidentRows {
    /// Combined opacity of all rows.
    together: f32,
    /// Opacity of the most opaque row.
    most: f32,
}

impl CoincidentRows {
    /// The opacity of the surface. Clones do not make it more opaque than the splat was, or than
    /// the most opaque clone; densification places them exactly on their originals.
    fn of_surface(self, before: f32) -> f32 {
        self.together.min(before.max(self.most))
    }
}

fn coincident(identity: &IdentityMap, edited: &Splats, num_sources: usize) -> Vec<CoincidentRows> {
    let mut coincident = vec![CoincidentRows::default(); num_sources];
    for (row, kind) in identity.rows.iter().enumerate() {
        if let Some(id) = kind.in_place() {
            let (rows_here, opacity) = (&mut coincident[id as usize], edited.opacity(row));
            rows_here.together += (1.0 - rows_here.together) * opacity;
            rows_here.most = rows_here.most.max(opacity);
        }
    }
    coincident
}

/// A surface is deleted where many of the neighbours of a deleted splat are deleted. Elsewhere the
/// editor only thinned the splats out, and descendants of the deleted ones are kept.
fn keep_pruned(effects: &mut [EditEffect], generations: &Generations, at_edit: &Splats) {
    let shown: Vec<usize> = (0..effects.len()).filter(|&id| generations.is_shown(id)).collect();
    let is_deleted: Vec<bool> =
        shown.iter().map(|&id| effects[id] == EditEffect::Deleted).collect();
    let places: Vec<[f64; 3]> = shown.iter().map(|&id| at_edit.means[id].map(f64::from)).collect();
    let deleted: Vec<usize> = (0..shown.len()).filter(|&at| is_deleted[at]).collect();
    let around: Vec<[f64; 3]> = deleted.iter().map(|&at| places[at]).collect();
    let is_hole = KdTree::<3>::new(&places).map(&around, NEIGHBORS, |_, near| {
        let count = near.iter().filter(|n| is_deleted[n.id as usize]).count();
        3 * count >= near.len()
    });
    for (at, is_hole) in deleted.into_iter().zip(is_hole) {
        if !is_hole {
            effects[shown[at]] = EditEffect::Kept;
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
        effects: &[EditEffect],
        coincident: &[CoincidentRows],
    ) -> Self {
        let recolored: Vec<(usize, usize)> = effects
            .iter()
            .enumerate()
            .filter(|(id, _)| generations.is_shown(*id))
            .filter_map(|(id, effect)| match *effect {
                EditEffect::Recolored(row) => Some((id, row)),
                _ => None,
            })
            .collect();
        let places: Vec<[f64; 3]> =
            recolored.iter().map(|&(id, _)| at_edit.means[id].map(f64::from)).collect();
        let pair = |pairs: &mut ColorPairs, weight: f64, at: usize| {
            let (id, row) = recolored[at];
            let weight = weight * f64::from(at_edit.opacity(id));
            let wide = |color: [f32; 3]| color.map(f64::from);
            let (from, to) = (dc_color(at_edit, id), dc_color(edited, row));
            pairs.add(weight, wide(from), wide(to));
            let (from, to) = (&at_edit.sh_of(id)[1..], &edited.sh_of(row)[1..]);
            pairs.add_harmonics(weight, from, to);
        };
        let mut all = ColorPairs::default();
        (0..recolored.len()).for_each(|at| pair(&mut all, 1.0, at));
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
        let opacities = recolored
            .iter()
            .map(|&(id, _)| {
                let before = at_edit.opacity(id);
                let after = coincident[id].of_surface(before);
                if (before - after).abs() < SAME_OPACITY { 1.0 } else { after / before }
            })
            .collect();
        Self { ids: recolored.into_iter().map(|(id, _)| id).collect(), changes, opacities }
    }

    /// The edit that a row inherits; `None` if its ancestors are unchanged.
    fn inherited(
        &self,
        row: usize,
        ancestry: &Ancestry,
        color: [f32; 3],
        effects: &[EditEffect],
    ) -> Option<Inherited> {
        // Shares are cut off where they are small, so they sum to a little less than 1.
        let (mut deleted, mut left, mut recolored, mut factor) = (0.0, 0.0, 0.0, 0.0);
        let mut moved: Vec<(u32, f32)> = Vec::new();
        let mut sum = ColorSum::default();
        for &(id, share) in &ancestry.of {
            if effects[id as usize] != EditEffect::Deleted {
                left += share;
            }
            match effects[id as usize] {
                EditEffect::Deleted => deleted += share,
                EditEffect::Kept => factor += share,
                EditEffect::Recolored(_) => {
                    let Ok(at) = self.ids.binary_search(&(id as usize)) else { continue };
                    recolored += share;
                    factor += share * self.opacities[at];
                    sum.add(share, &self.changes[at]);
                }
                EditEffect::Moved(group) => {
                    factor += share;
                    match moved.iter_mut().find(|(of, _)| *of == group) {
                        Some(entry) => entry.1 += share,
                        None => moved.push((group, share)),
                    }
                }
            }
        }
        let opacity = if deleted > left {
            0.0
        } else {
            let kept = factor / left;
            if (kept - 1.0).abs() < SAME_OPACITY { 1.0 } else { kept }
        };
        let softened = {
            let x = ((recolored - SOFT[0]) / (SOFT[1] - SOFT[0])).clamp(0.0, 1.0);
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

    /// The mean, with the offset limited so that colours in the displayable range stay in it.
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
    pub recolored: usize,
    /// Rows that inherit a deletion.
    pub removed: usize,
    /// Rows that inherit a translation, rotation or scaling.
    pub moved: usize,
    /// Copies that are extended over the whole clip, unlike their originals.
    pub copied: usize,
    /// Mean confidence of rows that inherit an edit, 0 to 1.
    pub confidence: f64,
    /// Rows that inherit with a confidence below 0.5.
    pub unsure: usize,
    /// Splats of the edit frame that edited splats follow over the whole clip,
    /// [`crate::PersistentSplats`].
    pub persistent: usize,
}

impl InheritanceReport {
    pub(crate) fn of(
        generations: &Generations,
        inherited: &[Inherited],
        copied: usize,
        persistent: usize,
    ) -> Self {
        let lifetimes = &generations.lifetimes;
        let visible = (0..lifetimes.len())
            .filter(|&i| lifetimes.is_visible(lifetimes.peak_time[i], i))
            .count();
        let shown = (0..lifetimes.len()).filter(|&i| generations.is_shown(i)).count();
        let count = |of: &dyn Fn(&Inherited) -> bool| inherited.iter().filter(|i| of(i)).count();
        let total: f64 = inherited.iter().map(|i| f64::from(i.confidence)).sum();
        let removed = |i: &Inherited| i.opacity <= 0.0;
        Self {
            visible,
            shown,
            with_ancestors: generations.ancestries.iter().filter(|d| !d.of.is_empty()).count(),
            recolored: count(&|i| !removed(i) && i.group.is_none()),
            removed: count(&removed),
            moved: count(&|i| !removed(i) && i.group.is_some()),
            copied,
            confidence: if inherited.is_empty() { 0.0 } else { total / inherited.len() as f64 },
            unsure: count(&|i| i.confidence < 0.5),
            persistent,
        }
    }
}

/// DC coefficients (SH degree 0) after the change.
pub(crate) fn changed_dc(change: &ColorChange, dc: [f32; 3]) -> [f32; 3] {
    change.apply(dc.map(|c| 0.5 + sh::C0 * c)).map(|c| ((c - 0.5) / sh::C0).as_f32())
}
