//! New geometry that extends from the figure moves with the part to which it is attached.
//!
//! Wings that pass behind a swinging arm are as near to it as to the back to which they are
//! attached, but over a smaller area. Single splats do not distinguish the two, but the contact
//! areas of the whole piece do. Each connected piece of new splats that extends far from every
//! source therefore takes one motion, unless its contacts with two parts have similar areas. Pieces
//! close to the figure may be rigid (a stick) or bend (a sleeve): they take one motion only if it
//! accounts for nearly all of their contact area. A detached piece moves with the nearest part.

use super::edit::Edit;
use super::graph::Graph;
use super::numeric::TINY;
use super::region_motion::RegionMotion;
use super::source::Regions;
use anchors::{KdTree, NO_CELL};
use gs_core::Real;
use rayon::prelude::*;

/// Minimum number of splats of a piece; smaller ones are ignored.
const MIN_SPLATS: usize = 8;

/// Minimum share of a piece's splats beyond the full distance for which it is clearly not clothing.
/// Other new geometry may cover the figure, and must then bend with it.
const MIN_SHARE: f64 = 1.0 / 3.0;

/// Share of a piece's splats beyond [`CLEARANCE`] below which each splat keeps its own match.
const MIN_CLEAR_SHARE: f64 = 0.1;

/// Lengths in units of [`crate::MotionParams::new_geometry`]. Distance from every source that some
/// splats of a piece must have.
const CLEARANCE: f64 = 2.0 / 3.0;

/// Distance from the rest of the edit beyond which a piece is detached.
const DETACHED: f64 = 0.5;

/// Width of a contact: standard deviation of its weights over distance.
const CONTACT: f64 = 1.0 / 6.0;

/// Maximum difference at a contact between motions that count as one.
const SAME_MOTION: f64 = 1.0 / 3.0;

/// Maximum difference from the motion of the attachment at which a splat keeps its own match, so
/// that the seam between a piece and a soft body does not open.
const SEAM: f64 = 1.0 / 6.0;

/// Width of the contact of a detached piece, as a share of its distance.
const DETACHED_CONTACT: f64 = 0.5;

/// A splat is new if it is this many times farther from its nearest source than the edited splat
/// nearest to that source, its successor. Smaller values classify clones in inflated clothing as
/// new (measured: half of this value).
const SUCCESSOR_RATIO: f64 = 3.0;

/// Maximum length of a link inside a piece, in spacings.
const STEP: f64 = 2.5;

/// Maximum number of contacts that are tried as the attachment.
const MAX_TRIED: usize = 256;

/// Minimum ratio of the largest contact area to the second, for a piece of which [`MIN_SHARE`]
/// extends from the figure. Doubled if only [`MIN_CLEAR_SHARE`] does, and again if none does: the
/// piece is then more likely to be clothing.
const AREA_RATIO: f64 = 2.0;

/// Input of the search for new pieces.
pub(super) struct NewPieces<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) edit: &'a Edit,
    /// Region of each matched edited splat, `[E]`.
    pub(super) matched: &'a [Option<u32>],
    pub(super) graph: &'a Graph,
    /// Distance from every source beyond which a splat is new, world units.
    pub(super) new_geometry: f64,
    /// Distance from the rest of the edit beyond which a piece has no attachment, world units.
    pub(super) reach: f64,
}

/// A connected component of new splats.
struct Piece {
    splats: Vec<usize>,
    /// Minimum ratio of the largest contact area to the second.
    area_ratio: f64,
}

/// A splat of a piece and the matched splat outside all pieces that is nearest to it.
#[derive(Debug, Clone, Copy)]
struct NearestMatch {
    distance: f64,
    /// Region of the matched splat.
    region: u32,
    /// The splat of the piece.
    splat: usize,
}

/// Contact of a piece with a region.
#[derive(Debug, Clone, Copy)]
struct Contact {
    region: u32,
    /// Number of splats of the piece there, each weighted by nearness.
    area: f64,
    /// The nearest of these splats.
    splat: usize,
}

impl NewPieces<'_> {
    /// For every splat of a new piece, the region that the piece is attached to, `[E]`; `None` for
    /// all other splats and for those whose own match has nearly the same motion.
    pub(super) fn attachments(&self) -> Vec<Option<u32>> {
        let mut attachments = vec![None; self.edit.len()];
        if (0..self.edit.len()).filter(|&e| self.is_open(e)).count() < MIN_SPLATS {
            return attachments;
        }
        let pieces = self.pieces();
        let mut in_piece = vec![false; self.edit.len()];
        for &e in pieces.iter().flat_map(|piece| &piece.splats) {
            in_piece[e] = true;
        }
        let others: Vec<usize> =
            (0..self.edit.len()).filter(|&e| !in_piece[e] && self.matched[e].is_some()).collect();
        let points: Vec<[f64; 3]> = others.iter().map(|&e| self.edit.means[e]).collect();
        let tree = KdTree::<3>::new(&points);
        for piece in pieces {
            let nearest = self.nearest_matches(&piece.splats, &others, &tree);
            let Some(attachment) = self.attachment(&nearest, piece.area_ratio) else { continue };
            for e in piece.splats {
                let moves_with_it = self.matched[e].is_some_and(|region| {
                    self.difference(region, attachment, e) <= SEAM * self.new_geometry
                });
                attachments[e] = (!moves_with_it).then_some(attachment);
            }
        }
        attachments
    }

    /// Whether splat `e` is not a source splat and has no parent.
    fn is_open(&self, e: usize) -> bool {
        self.edit.exact[e].is_none() && self.edit.parent[e].is_none()
    }

    /// Maximum distance over time between splat `e` moved with region `a` and with region `b`,
    /// world units.
    fn difference(&self, a: u32, b: u32, e: usize) -> f64 {
        let at = self.edit.means[e].map(Real::as_f32);
        f64::from(self.motion.max_distance(a as usize, b as usize, at))
    }

    /// For each splat of `piece`, the nearest of the matched splats `others`, the points of `tree`.
    fn nearest_matches(
        &self,
        piece: &[usize],
        others: &[usize],
        tree: &KdTree<3>,
    ) -> Vec<NearestMatch> {
        let places: Vec<[f64; 3]> = piece.iter().map(|&splat| self.edit.means[splat]).collect();
        let found = tree.map(&places, 1, |i, near| {
            let nearest = near.first()?;
            let region = self.matched[others[nearest.id as usize]]?;
            let distance = nearest.distance_squared.sqrt();
            Some(NearestMatch { distance, region, splat: piece[i] })
        });
        found.into_iter().flatten().collect()
    }

    /// Distance of each new splat from the nearest source, world units, `[E]`; `None` for splats
    /// that are not new.
    fn gaps(&self) -> Vec<Option<f64>> {
        let usable = |&p: &usize| {
            let region = self.regions.cells.owners[p];
            region != NO_CELL && !self.motion.outlier[region as usize]
        };
        let kept = (0..self.regions.means.len()).filter(usable);
        let points: Vec<[f64; 3]> = kept.map(|p| self.regions.means[p]).collect();
        let sources = KdTree::<3>::new(&points);
        let edited = KdTree::<3>::new(&self.edit.means);
        let nearest = |tree: &KdTree<3>, places: &[[f64; 3]]| {
            tree.map(places, 1, |_, near| {
                near.first().map_or((0, f64::INFINITY), |n| (n.id, n.distance_squared.sqrt()))
            })
        };
        let open: Vec<usize> = (0..self.edit.len()).filter(|&e| self.is_open(e)).collect();
        let mut gaps = vec![None; self.edit.len()];
        if points.is_empty() {
            return gaps;
        }
        let places: Vec<[f64; 3]> = open.iter().map(|&e| self.edit.means[e]).collect();
        let gap = nearest(&sources, &places);
        let places: Vec<[f64; 3]> =
            gap.iter().map(|&(source, _)| points[source as usize]).collect();
        let successor = nearest(&edited, &places);
        for ((e, (_, gap)), (_, successor)) in open.into_iter().zip(gap).zip(successor) {
            gaps[e] = (gap > self.new_geometry || gap > SUCCESSOR_RATIO * successor).then_some(gap);
        }
        gaps
    }

    /// Connected components of the new splats that extend far enough from the figure.
    fn pieces(&self) -> Vec<Piece> {
        let gaps = self.gaps();
        let mut pieces = Vec::new();
        for splats in self.components(&gaps) {
            let extends = |distance: f64, share: f64| {
                let is_beyond = |&&e: &&usize| gaps[e].is_some_and(|gap| gap > distance);
                let count = splats.iter().filter(is_beyond).count();
                count >= MIN_SPLATS && count as f64 >= share * splats.len() as f64
            };
            if !extends(CLEARANCE * self.new_geometry, MIN_CLEAR_SHARE) {
                continue;
            }
            let area_ratio = if extends(self.new_geometry, MIN_SHARE) {
                AREA_RATIO
            } else if extends(self.new_geometry, MIN_CLEAR_SHARE) {
                2.0 * AREA_RATIO
            } else {
                4.0 * AREA_RATIO
            };
            pieces.push(Piece { splats, area_ratio });
        }
        pieces
    }

    /// Connected components of the splats with a gap, in ascending order of their first splats.
    fn components(&self, gaps: &[Option<f64>]) -> Vec<Vec<usize>> {
        let is_new = |e: usize| gaps[e].is_some();
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.edit.len()];
        for (a, b, length) in self.graph.links(&|i, j| is_new(i) && is_new(j)) {
            let (i, j) = (a as usize, b as usize);
            let step = STEP * self.graph.spacing[i].max(self.graph.spacing[j]);
            if length <= step {
                around[i].push(b);
                around[j].push(a);
            }
        }
        let mut seen = vec![false; self.edit.len()];
        let mut components = Vec::new();
        for first in 0..self.edit.len() {
            if seen[first] || !is_new(first) {
                continue;
            }
            seen[first] = true;
            let mut component = vec![first];
            let mut next = 0;
            while next < component.len() {
                for &j in &around[component[next]] {
                    if !seen[j as usize] {
                        seen[j as usize] = true;
                        component.push(j as usize);
                    }
                }
                next += 1;
            }
            components.push(component);
        }
        components
    }

    /// The region whose motion has the largest contact area; `None` if a different motion has a
    /// similar area, or if no match is within reach.
    fn attachment(&self, nearest: &[NearestMatch], area_ratio: f64) -> Option<u32> {
        let closest = nearest.iter().map(|n| n.distance).reduce(f64::min)?;
        if closest > self.reach {
            return None;
        }
        let detached = closest > DETACHED * self.new_geometry;
        let contact = CONTACT * self.new_geometry;
        let width = if detached { contact.max(DETACHED_CONTACT * closest) } else { contact };
        // A detached piece that extends far has no contact: it follows the nearest part.
        let area_ratio = if detached && area_ratio <= AREA_RATIO { 1.0 } else { area_ratio };
        let mut contacts: Vec<Contact> = nearest
            .iter()
            .map(|n| {
                let gap = (n.distance.powi(2) - closest.powi(2)) / width.powi(2);
                Contact { region: n.region, area: (-0.5 * gap).exp(), splat: n.splat }
            })
            .filter(|contact| contact.area > 1e-3)
            .collect();
        contacts.sort_by(|a, b| {
            a.region.cmp(&b.region).then(b.area.total_cmp(&a.area)).then(a.splat.cmp(&b.splat))
        });
        contacts.dedup_by(|next, first| {
            let same = next.region == first.region;
            first.area += if same { next.area } else { 0.0 };
            same
        });
        let (attachment, area) = self.largest_contact(&contacts)?;
        let limit = SAME_MOTION * self.new_geometry;
        contacts.retain(|c| self.difference(c.region, attachment, c.splat) > limit);
        let second = self.largest_contact(&contacts).map_or(0.0, |(_, area)| area);
        (area >= area_ratio * second).then_some(attachment)
    }

    /// The region whose motion has the largest contact area, and that area. Contacts are weighted
    /// by the agreement of their motions with it, so that a region in the middle of a part is
    /// preferred to one at a joint.
    fn largest_contact(&self, contacts: &[Contact]) -> Option<(u32, f64)> {
        let tolerance = (SAME_MOTION * self.new_geometry).max(TINY);
        contacts
            .par_iter()
            .step_by(contacts.len().div_ceil(MAX_TRIED).max(1))
            .map(|&Contact { region, .. }| {
                let agreeing = |c: &Contact| {
                    c.area * (1.0 - self.difference(c.region, region, c.splat) / tolerance).max(0.0)
                };
                (region, contacts.iter().map(agreeing).sum::<f64>())
            })
            .collect::<Vec<_>>()
            .into_iter()
            .reduce(|best, next| if next.1 > best.1 { next } else { best })
    }
}
