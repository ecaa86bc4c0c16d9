//! Rows that are source splats, moved, rotated or scaled as a group.
//!
//! Rows are paired with source splats by properties that a similarity does not change: proportions,
//! opacity, base colour. Pairs of one group share one similarity. It is fitted to a few
//! neighbouring pairs, and kept if more pairs fit it as the group grows:
//!
//! 1. *Pairs*: for each open row, the source splats with the nearest signatures, within rounding.
//! 2. *Seeds*: rows in order of position. The rotations and scales of a pair define a candidate
//!    similarity. If neighbouring pairs do not agree with it, the candidate is fitted to the
//!    positions of the neighbours: some tools do not transform the splats' rotations or scales.
//! 3. *Growth*: pairs within four radii of the group that fit are added, and the similarity is
//!    fitted again.
//! 4. *Border*: a selection that was moved has a sharp border. A smooth warp is nearly a similarity
//!    in any small patch, but the residuals of pairs around the patch exceed the limit only
//!    slightly: a larger limit admits more pairs. Such a patch is not a group.
//! 5. *Rest*: open rows whose position, size and orientation fit the similarity also belong to the
//!    group, for any colours.

use super::row::Identity;
use super::signature::{By, candidates};
use super::stored;
use super::tolerance::match_by_tolerance;
use crate::row_index::index;
use crate::similarity::Similarity;
use anchors::KdTree;
use gs_core::{Precision, Splats, quat};
use rayon::prelude::*;

/// Minimum number of rows of a group: with coarse rounding, fewer rows fit a similarity by chance.
const MIN_GROUP: usize = 8;
/// Number of neighbouring rows considered around a seed.
const NEIGHBORS: usize = 24;
/// Minimum number of pairs, including the seed, that must agree on a similarity before it is tried.
const MIN_AGREEING: usize = 5;
/// Maximum number of groups. Each requires a pass over the open rows.
const MAX_GROUPS: usize = 64;
/// Maximum number of candidates that fail to grow before the search ends; real groups grow
/// immediately.
const MAX_FAILED: usize = 512;
/// Number of seeds tried in parallel.
const SEED_BLOCK: usize = 512;
/// Distance within which pairs may join a group, in radii of the group.
const REACH: f64 = 4.0;
/// Maximum rounds of growth; the reach grows fourfold with each.
const ROUNDS: usize = 24;
/// Residual limits: relative to coordinates (editors compute in single precision, text has seven
/// digits), and to the splat's middle standard deviation.
const ROUNDING: f64 = 4e-6;
const OF_DEVIATION: f64 = 2e-3;
/// Minimum extent of a group, in residual limits: any pairs fit within a smaller one.
const WIDTH: f64 = 12.0;
/// Residual, in limits, up to which pairs are added to a group at the end: the limits are those of
/// single splats, and the fit also has errors.
const EXPLAINED: f64 = 2.0;
/// Residual, in limits, below which a pair nearly fits. The residual of a smooth warp grows with
/// the square of the distance, so that at least as many pairs nearly fit as fit (on a limb; three
/// times as many on a surface). A moved selection has no such pairs, except at a joint with another
/// selection.
const NEAR_FIT: f64 = 4.0 * EXPLAINED;
/// Maximum number of pairs that nearly fit, as a share of those in the group.
const MAX_NEAR_FIT_SHARE: f64 = 0.5;
/// Pairs within this many residual limits of a patch of a smooth warp are not used as seeds: they
/// belong to the same warp.
const SAME_WARP: f64 = 32.0 * EXPLAINED;

/// Marks the open rows of `rows` that belong to a group, and returns the similarity of each group.
pub(super) fn find(
    source: &Splats,
    edited: &Splats,
    precision: Option<&Precision>,
    tolerance: f64,
    rows: &mut [Identity],
) -> Vec<Similarity> {
    let mut similarities = Vec::new();
    for by in [By::All, By::Proportions] {
        let open: Vec<usize> = (0..edited.len())
            .filter(|&row| rows[row] == Identity::Edited && edited.is_finite(row))
            .collect();
        // If files round, proportions alone do not distinguish splats.
        let vague = by == By::Proportions && precision.is_some();
        if open.len() < MIN_GROUP || source.len() < MIN_GROUP || vague {
            break;
        }
        let search = GroupSearch::of(source, edited, precision, tolerance, open, by);
        let mut found = search.groups();
        found.sort_by_key(|group| std::cmp::Reverse(group.pairs.len()));
        let first = similarities.len();
        for (number, group) in found.iter().enumerate() {
            for &(at, id) in &group.pairs {
                rows[search.open[at]] =
                    Identity::Moved { source: id, group: index(first + number) };
            }
        }
        for (number, group) in found.iter().enumerate() {
            search.add_rest(&group.similarity, index(first + number), rows);
        }
        similarities.extend(found.into_iter().map(|group| group.similarity));
    }
    similarities
}

struct FoundGroup {
    similarity: Similarity,
    /// Position in `open`, source id.
    pairs: Vec<(usize, u32)>,
}

struct GroupSearch<'a> {
    source: &'a Splats,
    edited: &'a Splats,
    precision: Option<&'a Precision>,
    tolerance: f64,
    /// Open rows in order of position.
    open: Vec<usize>,
    /// Centres of the open rows.
    places: Vec<[f64; 3]>,
    /// Residual limit of each open row, world units of the edit.
    limits: Vec<f64>,
    /// Source splats with the signature of each open row, nearest first.
    candidates: Vec<Vec<u32>>,
}

impl<'a> GroupSearch<'a> {
    fn of(
        source: &'a Splats,
        edited: &'a Splats,
        precision: Option<&'a Precision>,
        tolerance: f64,
        mut open: Vec<usize>,
        by: By,
    ) -> Self {
        let key = |row: usize| edited.means[row].map(f64::from);
        open.par_sort_unstable_by(|&a, &b| {
            let (x, y) = (key(a), key(b));
            x[0].total_cmp(&y[0])
                .then(x[1].total_cmp(&y[1]))
                .then(x[2].total_cmp(&y[2]))
                .then(a.cmp(&b))
        });
        let candidates = candidates(source, edited, precision, tolerance, &open, by);
        let limits = open.iter().map(|&row| residual_limit(edited, precision, tolerance, row));
        let limits = limits.collect();
        let places = open.iter().map(|&row| key(row)).collect();
        Self { source, edited, precision, tolerance, open, places, limits, candidates }
    }

    fn groups(&self) -> Vec<FoundGroup> {
        let paired: Vec<usize> =
            (0..self.open.len()).filter(|&at| !self.candidates[at].is_empty()).collect();
        let mut found: Vec<FoundGroup> = Vec::new();
        if paired.len() < MIN_GROUP {
            return found;
        }
        let points: Vec<[f64; 3]> = paired.iter().map(|&at| self.places[at]).collect();
        let tree = KdTree::<3>::new(&points);
        let mut taken = vec![false; self.open.len()];
        let mut smooth = vec![false; self.open.len()];
        let mut failed = 0;
        for block in paired.chunks(SEED_BLOCK) {
            let free: Vec<usize> =
                block.iter().copied().filter(|&at| !taken[at] && !smooth[at]).collect();
            let proposals: Vec<Vec<Similarity>> = free
                .par_iter()
                .with_min_len(16)
                .map_init(Vec::new, |near, &at| {
                    tree.nearest(&self.places[at], NEIGHBORS, near);
                    let around: Vec<usize> = near
                        .iter()
                        .map(|n| paired[n.id as usize])
                        .filter(|&at| !taken[at])
                        .collect();
                    self.propose(at, &around)
                })
                .collect();
            for (at, proposals) in free.into_iter().zip(proposals) {
                if taken[at] || smooth[at] || proposals.is_empty() {
                    continue;
                }
                let grown = proposals.iter().filter_map(|start| self.grow(at, start, &taken));
                // Ties go to the first: proper similarities are proposed before mirrored ones.
                let best = grown.reduce(|a, b| if b.pairs.len() > a.pairs.len() { b } else { a });
                let Some(group) = best.filter(|group| {
                    let ends = self.has_sharp_border(group, &taken);
                    if !ends {
                        let warped = self.explained(&group.similarity, SAME_WARP, &taken);
                        for &(at, _) in &warped {
                            smooth[at] = true;
                        }
                    }
                    ends
                }) else {
                    failed += 1;
                    if failed >= MAX_FAILED {
                        return found;
                    }
                    continue;
                };
                group.pairs.iter().for_each(|&(at, _)| taken[at] = true);
                found.push(group);
                if found.len() >= MAX_GROUPS {
                    return found;
                }
            }
        }
        found
    }

    /// Candidate similarities on which a few pairs around the seed agree.
    fn propose(&self, seed: usize, around: &[usize]) -> Vec<Similarity> {
        for &id in &self.candidates[seed] {
            let own = self.own_similarity(seed, id as usize);
            let slack = self.own_slack(seed);
            let agreeing: Vec<(usize, u32)> = around
                .iter()
                .filter_map(|&at| {
                    let aside = distance(self.places[at], self.places[seed]);
                    let limit = self.limits[at] + self.limits[seed] + slack * aside;
                    self.best_candidate(at, &own, limit).map(|id| (at, id))
                })
                .collect();
            if agreeing.len() >= MIN_AGREEING
                && let Some(fit) = self.fitted(&agreeing, false)
            {
                return vec![fit];
            }
        }
        self.propose_by_position(seed, around)
    }

    /// As `propose`, from positions only: for editors that mirror, or do not transform the splats'
    /// rotations or scales.
    fn propose_by_position(&self, seed: usize, around: &[usize]) -> Vec<Similarity> {
        let alike = self.equally_scaled(seed, around);
        let trimmed = |mirrored: bool| {
            let mut kept = alike.clone();
            while kept.len() >= MIN_AGREEING {
                let fit = Similarity::fit(&self.points(&kept), mirrored)?;
                let miss = |&(at, id): &(usize, u32)| self.residual(&fit, at, id) / self.limits[at];
                if kept.iter().all(|pair| miss(pair) <= 1.0) {
                    return self.fitted(&kept, mirrored);
                }
                let worst =
                    (0..kept.len()).max_by(|&a, &b| miss(&kept[a]).total_cmp(&miss(&kept[b])));
                kept.remove(worst?);
            }
            None
        };
        [false, true].into_iter().filter_map(trimmed).collect()
    }

    /// The seed, and the largest set of pairs around it whose distances from it changed by the same
    /// factor.
    fn equally_scaled(&self, seed: usize, around: &[usize]) -> Vec<(usize, u32)> {
        let first = self.candidates[seed][0];
        let from = |id: u32| self.source.means[id as usize].map(f64::from);
        let mut grown: Vec<(f64, f64, usize)> = around
            .iter()
            .filter_map(|&at| {
                let before = distance(from(self.candidates[at][0]), from(first));
                let after = distance(self.places[at], self.places[seed]);
                let limit = self.limits[at] + self.limits[seed];
                (before > 0.0 && after > 0.0).then(|| (after / before, limit / after, at))
            })
            .collect();
        grown.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let run = |start: usize| {
            let (factor, slack, _) = grown[start];
            let same =
                |other: &&(f64, f64, usize)| other.0 <= factor * (1.0 + 2.0 * (slack + other.1));
            grown[start..].iter().take_while(same).count()
        };
        let longest = (0..grown.len()).map(|start| (run(start), start));
        let Some((count, start)) = longest.max_by_key(|&(n, start)| (n, std::cmp::Reverse(start)))
        else {
            return Vec::new();
        };
        let alike = grown[start..start + count].iter().map(|&(_, _, at)| at);
        std::iter::once(seed).chain(alike).map(|at| (at, self.candidates[at][0])).collect()
    }

    /// Adds pairs as long as they fit the similarity.
    fn grow(&self, seed: usize, start: &Similarity, taken: &[bool]) -> Option<FoundGroup> {
        let mut similarity = *start;
        let (mut centre, mut radius) = (self.places[seed], 0.0);
        let mut pairs: Vec<(usize, u32)> = Vec::new();
        for round in 0..ROUNDS {
            // First the neighbours of the seed, then all pairs within reach of the group.
            let reach = if round == 0 { f64::INFINITY } else { REACH * radius };
            let explained: Vec<(usize, u32)> = (0..self.open.len())
                .into_par_iter()
                .with_min_len(1024)
                .filter(|&at| !taken[at] && !self.candidates[at].is_empty())
                .filter_map(|at| {
                    let aside = distance(self.places[at], centre);
                    if aside > reach {
                        return None;
                    }
                    // The error of a fit is the error of its points, relative to their extent.
                    let lever = if radius > 0.0 { aside / radius } else { 1.0 };
                    let limit =
                        self.limits[at] * (1.0 + lever / (pairs.len().max(4) as f64).sqrt());
                    self.best_candidate(at, &similarity, limit).map(|id| (at, id))
                })
                .collect();
            if explained.len() < MIN_AGREEING {
                return None;
            }
            let settled = explained == pairs;
            pairs = explained;
            if settled {
                break;
            }
            similarity = Similarity::fit(&self.points(&pairs), start.mirrored)?;
            (centre, radius) = self.spread(&pairs);
        }
        // Finally all pairs, at any distance from the group.
        let pairs = self.explained(&similarity, EXPLAINED, taken);
        let similarity = self.fitted(&pairs, start.mirrored)?;
        (pairs.len() >= MIN_GROUP).then_some(FoundGroup { similarity, pairs })
    }

    /// Free pairs that fit the similarity within `limits` residual limits.
    fn explained(&self, similarity: &Similarity, limits: f64, taken: &[bool]) -> Vec<(usize, u32)> {
        (0..self.open.len())
            .into_par_iter()
            .with_min_len(1024)
            .filter(|&at| !taken[at] && !self.candidates[at].is_empty())
            .filter_map(|at| {
                let limit = limits * self.limits[at];
                Some((at, self.best_candidate(at, similarity, limit)?))
            })
            .collect()
    }

    /// Whether few pairs nearly fit, as at the border of a moved selection: see [`NEAR_FIT`].
    fn has_sharp_border(&self, group: &FoundGroup, taken: &[bool]) -> bool {
        let nearly = self.explained(&group.similarity, NEAR_FIT, taken).len();
        nearly as f64 <= (1.0 + MAX_NEAR_FIT_SHARE) * group.pairs.len() as f64
    }

    /// Similarity fitted to pairs; `None` if they are too close to each other to determine it.
    fn fitted(&self, pairs: &[(usize, u32)], mirrored: bool) -> Option<Similarity> {
        let (_, radius) = self.spread(pairs);
        let limit = pairs.iter().map(|&(at, _)| self.limits[at]).fold(0.0, f64::max);
        if radius < WIDTH * limit {
            return None;
        }
        Similarity::fit(&self.points(pairs), mirrored)
    }

    fn points(&self, pairs: &[(usize, u32)]) -> Vec<([f64; 3], [f64; 3])> {
        let from = |id: u32| self.source.means[id as usize].map(f64::from);
        pairs.iter().map(|&(at, id)| (from(id), self.places[at])).collect()
    }

    /// Centre of the pairs in the edit, and root mean square distance from it.
    fn spread(&self, pairs: &[(usize, u32)]) -> ([f64; 3], f64) {
        let n = pairs.len().max(1) as f64;
        let mut centre = [0.0; 3];
        for &(at, _) in pairs {
            for (c, x) in centre.iter_mut().zip(self.places[at]) {
                *c += x / n;
            }
        }
        let squares: f64 =
            pairs.iter().map(|&(at, _)| distance(self.places[at], centre).powi(2)).sum();
        (centre, (squares / n).sqrt())
    }

    fn residual(&self, similarity: &Similarity, at: usize, id: u32) -> f64 {
        let moved = similarity.apply(self.source.means[id as usize].map(f64::from));
        distance(moved, self.places[at])
    }

    fn best_candidate(&self, at: usize, similarity: &Similarity, limit: f64) -> Option<u32> {
        let residuals =
            self.candidates[at].iter().map(|&id| (self.residual(similarity, at, id), id));
        let best = residuals.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        (best.0 <= limit).then_some(best.1)
    }

    /// The similarity given by the rotations and scales of one pair.
    fn own_similarity(&self, at: usize, id: usize) -> Similarity {
        let row = self.open[at];
        let of = |splats: &Splats, i: usize| quat::normalize(splats.quats[i].map(f64::from));
        let rotation = quat::mul(of(self.edited, row), quat::conjugate(of(self.source, id)));
        let grown = |k: usize| {
            f64::from(self.edited.log_scales[row][k]) - f64::from(self.source.log_scales[id][k])
        };
        let scale = ((grown(0) + grown(1) + grown(2)) / 3.0).exp();
        let found = Similarity { scale, rotation, mirrored: false, translation: [0.0; 3] };
        let rotated = found.apply_vector(self.source.means[id].map(f64::from));
        let translation = [0, 1, 2].map(|k| self.places[at][k] - rotated[k]);
        Similarity { translation, ..found }
    }

    /// Error of that similarity, per unit of distance.
    fn own_slack(&self, at: usize) -> f64 {
        let rounding = self.precision.map_or(0.0, |precision| {
            let row = precision.of(self.open[at]);
            let log_scale = row.log_scales.into_iter().fold(0.0_f32, f32::max);
            f64::from(row.rotation_rad + log_scale).min(0.2)
        });
        1e-4 + rounding
    }

    /// Adds the open rows that coincide with a source splat after the similarity is inverted.
    fn add_rest(&self, similarity: &Similarity, group: u32, rows: &mut [Identity]) {
        let still_open: Vec<usize> =
            self.open.iter().copied().filter(|&row| rows[row] == Identity::Edited).collect();
        if still_open.is_empty() {
            return;
        }
        let back = similarity.inverse();
        let undone = back.transform(&self.edited.select(&still_open));
        let mut found = vec![Identity::Edited; still_open.len()];
        if let Some(precision) = self.precision {
            let precision =
                back.transform_precision(&precision.select(&still_open), still_open.len());
            stored::matches(self.source, &undone, &precision, &mut found);
        } else {
            match_by_tolerance(self.source, &undone, 2.0 * self.tolerance, &mut found);
        }
        for (row, identity) in still_open.into_iter().zip(found) {
            if let Identity::Unchanged(source) | Identity::Recolored(source) = identity {
                rows[row] = Identity::Moved { source, group };
            }
        }
    }
}

/// Writes values of row `i` of `placed`, a source splat transformed by its group's similarity, to
/// `row` of `edited`: always the centre, which agrees by construction; shape and colours if the
/// edited values agree with them. Files round rotations by less than 2°, sizes by less than 4 %,
/// colours by up to two steps of 255.
pub(super) fn restore_row(placed: &Splats, i: usize, edited: &mut Splats, row: usize) {
    const MIN_COS_HALF_ANGLE: f32 = 0.999_85;
    const SIZE: f32 = 0.04;
    const OPACITY: f32 = 0.01;
    const COLOR: f32 = 0.03;
    edited.means[row] = placed.means[i];
    let same_rotation =
        quat::dot(placed.rotation(i), edited.rotation(row)).abs() >= MIN_COS_HALF_ANGLE;
    let (from, to) = (placed.log_scales[i], edited.log_scales[row]);
    if same_rotation && (0..3).all(|k| (from[k] - to[k]).abs() <= SIZE) {
        edited.quats[row] = placed.quats[i];
        edited.log_scales[row] = placed.log_scales[i];
    }
    let coeffs = edited.sh_coeffs();
    let (from, to) = (placed.sh_of(i)[0], edited.sh_of(row)[0]);
    let same_opacity = (placed.opacity(i) - edited.opacity(row)).abs() <= OPACITY;
    if same_opacity && (0..3).all(|c| (from[c] - to[c]).abs() <= COLOR) {
        edited.opacity_logits[row] = placed.opacity_logits[i];
        edited.sh[row * coeffs..][..coeffs].copy_from_slice(placed.sh_of(i));
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

fn residual_limit(
    edited: &Splats,
    precision: Option<&Precision>,
    tolerance: f64,
    row: usize,
) -> f64 {
    let largest = edited.means[row].iter().fold(0.0_f32, |m, c| m.max(c.abs()));
    let mut scale = edited.scale(row);
    scale.sort_by(f32::total_cmp);
    let stored = precision.map_or(0.0, |precision| {
        precision.of(row).means.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt()
    });
    let rounding = (ROUNDING * f64::from(largest)).max(OF_DEVIATION * f64::from(scale[1]));
    // Keeps the limit above 0 for exact values.
    (stored + tolerance * rounding).max(f64::MIN_POSITIVE)
}
