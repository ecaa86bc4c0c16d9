//! New geometry that stands out from the figure moves with the part it is attached to, its carrier.
//!
//! Wings that pass behind a swinging arm lie as near to it as to the back they grow from. A single
//! splat cannot be assigned to one of the two, but the whole piece can: its contact with the carrier
//! is the widest. So a connected piece of new splats that extends far from every source gets one
//! motion, unless two parts have contacts of similar area. Pieces that stay near the figure may be
//! rigid (sticks) or bend (sleeves): they get one motion only if all their contacts share it. A piece
//! that hovers has no contact and moves with the nearest part.

use super::cubes::NEARBY;
use super::edit::Edit;
use super::graph::Link;
use super::numeric::TINY;
use super::region_motion::RegionMotion;
use super::source::Regions;
use anchors::{KdTree, NO_CELL};
use gs_core::Real;
use rayon::prelude::*;

/// Fewest splats of a piece; smaller ones are strays.
const MIN_SPLATS: usize = 8;

/// Least share of a piece's splats beyond [`FREE`], and beyond the full length if the piece is
/// unlikely to be clothing.
const MIN_FREE: f64 = 0.1;
const MIN_SHARE: f64 = 1.0 / 6.0;

/// Lengths in units of [`crate::MotionParams::new_geometry`]: distance from every source that some
/// splats of any piece exceed; and the width of a contact, which is also the distance from which a
/// piece hovers and the largest difference of motions that carry a piece together.
const FREE: f64 = 2.0 / 3.0;
const CONTACT: f64 = 1.0 / 3.0;

/// A splat is new if its distance from the nearest source is this many times that of the source's
/// nearest edited splat, its successor. Smaller values classify clones in inflated clothing as new
/// (measured: two thirds of this value).
const SURPLUS: f64 = 3.0;

/// Least ratio of the contact areas of the carrier and of any other part, for a piece that touches
/// the figure and stands out; and for one that may be clothing, which has to be attached to a single
/// part.
const DOMINANT: f64 = 2.0;
const UNANIMOUS: f64 = 4.0 * DOMINANT;

/// Input of the search for new pieces.
pub(super) struct NewPieces<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) edit: &'a Edit,
    /// The region of each matched splat.
    pub(super) matched: &'a [Option<u32>],
    pub(super) links: &'a [Link],
    /// Distance from every source at which new geometry stands out, world units.
    pub(super) stands_out: f64,
    /// Largest difference of motions that count as one, world units.
    pub(super) same_motion: f64,
    /// Pieces farther than this from all matched splats stay where they are, world units.
    pub(super) reach: f64,
}

/// Connected new splats.
struct Piece {
    splats: Vec<usize>,
    /// Least ratio of the contact areas of its carrier and of the next part.
    needed: f64,
}

/// A splat of a piece and its nearest matched splat outside of it.
#[derive(Debug, Clone, Copy)]
struct Touch {
    distance: f64,
    /// The region of that splat.
    region: u32,
    splat: usize,
}

/// Contact of a piece with a region.
#[derive(Debug, Clone, Copy)]
struct Contact {
    region: u32,
    /// Splats of the piece in contact, weighted by nearness.
    area: f64,
    /// The nearest of them.
    splat: usize,
}

impl NewPieces<'_> {
    /// For every splat of a new piece, its carrier; `None` for all others, and for splats whose own
    /// motion is that of the carrier.
    pub(super) fn carriers(&self) -> Vec<Option<u32>> {
        let mut carriers = vec![None; self.edit.len()];
        let unknown = |e: &usize| self.edit.exact[*e].is_none() && self.edit.parent[*e].is_none();
        if (0..self.edit.len()).filter(unknown).count() < MIN_SPLATS {
            return carriers;
        }
        let pieces = self.pieces();
        let mut inside = vec![false; self.edit.len()];
        for &e in pieces.iter().flat_map(|piece| &piece.splats) {
            inside[e] = true;
        }
        let holders: Vec<usize> =
            (0..self.edit.len()).filter(|&e| !inside[e] && self.matched[e].is_some()).collect();
        let points: Vec<[f64; 3]> = holders.iter().map(|&e| self.edit.means[e]).collect();
        let tree = KdTree::<3>::new(&points);
        for piece in pieces {
            let touches = self.touches(&piece.splats, &holders, &tree);
            let Some(carrier) = self.carrier(&touches, piece.needed) else { continue };
            for e in piece.splats {
                let is_alike = self.matched[e]
                    .is_some_and(|region| self.differ(region, carrier, e) <= self.same_motion);
                carriers[e] = (!is_alike).then_some(carrier);
            }
        }
        carriers
    }

    /// Largest distance between the paths of splat `e` with two regions, world units.
    fn differ(&self, a: u32, b: u32, e: usize) -> f64 {
        let at = self.edit.means[e].map(Real::as_f32);
        f64::from(self.motion.disagreement(a as usize, b as usize, at))
    }

    /// The nearest matched splat outside of the piece for each splat of it.
    fn touches(&self, piece: &[usize], holders: &[usize], tree: &KdTree<3>) -> Vec<Touch> {
        let places: Vec<[f64; 3]> = piece.iter().map(|&splat| self.edit.means[splat]).collect();
        let touches = tree.map(&places, 1, |i, near| {
            let found = near.first()?;
            let region = self.matched[holders[found.id as usize]]?;
            Some(Touch { distance: found.distance_squared.sqrt(), region, splat: piece[i] })
        });
        touches.into_iter().flatten().collect()
    }

    /// Distance of each new splat from the nearest source; `None` for splats that replace a source
    /// splat.
    fn gaps(&self) -> Vec<Option<f64>> {
        let far = self.stands_out;
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
        let is_open = |&e: &usize| self.edit.exact[e].is_none() && self.edit.parent[e].is_none();
        let open: Vec<usize> = (0..self.edit.len()).filter(is_open).collect();
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
            gaps[e] = (gap > far || gap > SURPLUS * successor).then_some(gap);
        }
        gaps
    }

    fn pieces(&self) -> Vec<Piece> {
        let gaps = self.gaps();
        let far = self.stands_out;
        let is_new = |e: usize| gaps[e].is_some();
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.edit.len()];
        for &(a, b) in self.links {
            let (i, j) = (a as usize, b as usize);
            if is_new(i) && is_new(j) {
                around[i].push(b);
                around[j].push(a);
            }
        }
        let mut seen = vec![false; self.edit.len()];
        let mut pieces = Vec::new();
        for first in 0..self.edit.len() {
            if seen[first] || !is_new(first) {
                continue;
            }
            seen[first] = true;
            let mut piece = vec![first];
            let mut next = 0;
            while next < piece.len() {
                for &j in &around[piece[next]] {
                    if !seen[j as usize] {
                        seen[j as usize] = true;
                        piece.push(j as usize);
                    }
                }
                next += 1;
            }
            let beyond = |distance: f64, share: f64| {
                let is_beyond = |&&e: &&usize| gaps[e].is_some_and(|gap| gap > distance);
                let count = piece.iter().filter(is_beyond).count();
                count >= MIN_SPLATS && count as f64 >= share * piece.len() as f64
            };
            if beyond(FREE * self.stands_out, MIN_FREE) {
                let needed = if beyond(far, MIN_SHARE) { DOMINANT } else { UNANIMOUS };
                pieces.push(Piece { splats: piece, needed });
            }
        }
        pieces
    }

    /// The region whose motion has the widest contact with the piece; `None` if another motion has
    /// nearly as much, or if there is no contact.
    fn carrier(&self, touches: &[Touch], needed: f64) -> Option<u32> {
        let closest = touches.iter().map(|t| t.distance).reduce(f64::min)?;
        if closest > self.reach {
            return None;
        }
        let width = (CONTACT * self.stands_out).max(TINY);
        let hovers = closest > width;
        // Pieces that hover and stand out have no contact; the nearest part is enough.
        let needed = if hovers && needed <= DOMINANT { 1.0 } else { needed };
        let mut contacts: Vec<Contact> = touches
            .iter()
            .map(|t| {
                let gap = (t.distance.powi(2) - closest.powi(2)) / width.powi(2);
                Contact { region: t.region, area: (-0.5 * gap).exp(), splat: t.splat }
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
        let (carrier, held) = self.strongest(&contacts)?;
        contacts.retain(|c| self.differ(c.region, carrier, c.splat) > width);
        let rival = self.strongest(&contacts).map_or(0.0, |(_, held)| held);
        (held >= needed * rival).then_some(carrier)
    }

    /// The region whose motion agrees with the largest area of contact, and that area. Contacts are
    /// weighted by agreement, so that the region lies amidst a part, not at a joint.
    fn strongest(&self, contacts: &[Contact]) -> Option<(u32, f64)> {
        let tolerance = (CONTACT * self.stands_out).max(TINY);
        contacts
            .par_iter()
            .step_by(contacts.len().div_ceil(NEARBY).max(1))
            .map(|&Contact { region, .. }| {
                let agreement = |c: &Contact| {
                    c.area * (1.0 - self.differ(c.region, region, c.splat) / tolerance).max(0.0)
                };
                (region, contacts.iter().map(agreement).sum::<f64>())
            })
            .collect::<Vec<_>>()
            .into_iter()
            .reduce(|best, next| if next.1 > best.1 { next } else { best })
    }
}
