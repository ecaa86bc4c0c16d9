//! New geometry that stands out from the figure moves with what it is attached to.
//!
//! Wings that pass behind a swinging arm lie as near to it as to the back they grow from, over
//! fewer splats. Splat by splat nothing tells the two apart; the whole piece does: it touches its
//! carrier over the widest area. So each connected piece of new splats that reaches far from every
//! source takes one motion, unless two parts hold it about equally well. Pieces that stay near the
//! figure may be sticks, which are stiff, or sleeves, which bend: they take one motion only if all
//! that they touch has it. What hovers touches nothing, and moves as one with what is nearest.

use super::edit::Edit;
use super::graph::Link;
use super::numeric::TINY;
use super::region_motion::RegionMotion;
use super::source::Regions;
use anchors::{KdTree, NO_CELL};
use gs_core::Real;
use rayon::prelude::*;

/// Fewer splats are strays.
const MIN_SPLATS: usize = 8;

/// Share of a piece's splats that stand out by the full length. Other new geometry may line the
/// figure, and must then bend with it.
const MIN_SHARE: f64 = 1.0 / 3.0;

/// Pieces of which this share stands out by [`FREE`] are looked at at all.
const MIN_FREE: f64 = 0.1;

/// Lengths in units of that by which geometry stands out, see
/// [`crate::MotionParams::new_geometry`]: how far some splats of a piece must be from every source;
/// how far what hovers stays from the rest of the edit; the width of a contact; by how much motions
/// that carry a piece together may differ where it touches them; and by how much those of its own
/// surroundings may differ from the carrier's and still keep its seam closed on a soft body.
const FREE: f64 = 2.0 / 3.0;
const HOVERS: f64 = 0.5;
const CONTACT: f64 = 1.0 / 6.0;
const TOGETHER: f64 = 1.0 / 3.0;
const SEAM: f64 = 1.0 / 6.0;

/// Width of the contact of what hovers, as a share of its distance.
const HOVERING_CONTACT: f64 = 0.5;

/// A splat of a piece is this many times farther from its nearest source than another splat of the
/// edit is: that one is the source's successor. At half of this, clones in swollen clothes pass for
/// new.
const SURPLUS: f64 = 3.0;

/// Longest step inside a piece, in spacings.
const STEP: f64 = 2.5;

/// Regions asked whether they are the carrier.
const CANDIDATES: usize = 256;

/// How many times better than any other the carrier must hold a piece that touches the figure:
/// twice as well for each step by which it is less plain that the piece is no clothing. It stands
/// out; a tenth of it does; it stays near.
const DOMINANT: f64 = 2.0;
const CLEAR: f64 = 2.0 * DOMINANT;
const UNANIMOUS: f64 = 2.0 * CLEAR;

/// What is known when new pieces are looked for.
pub(super) struct NewPieces<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) edit: &'a Edit,
    /// The region of each edited splat that some region explains.
    pub(super) matched: &'a [Option<u32>],
    pub(super) links: &'a [Link],
    pub(super) spacing: &'a [f64],
    /// Distance from every source at which new geometry stands out, world units.
    pub(super) stands_out: f64,
    /// Pieces farther than this from everything stay where they are, world units.
    pub(super) reach: f64,
}

/// Connected new splats.
struct Piece {
    splats: Vec<usize>,
    /// How many times better than any other its carrier must hold it.
    needed: f64,
}

/// A splat of a piece and what it is nearest to.
#[derive(Debug, Clone, Copy)]
struct Touch {
    distance: f64,
    /// The region that splat belongs to.
    region: u32,
    splat: usize,
}

/// A region that a piece touches.
#[derive(Debug, Clone, Copy)]
struct Contact {
    region: u32,
    /// Splats of the piece there, each weighted by nearness.
    area: f64,
    /// The nearest of them.
    splat: usize,
}

impl NewPieces<'_> {
    /// For every splat of a new piece, the region that carries it; `None` for all others and for
    /// those that the motion they have already makes part of the carrier.
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
                let part_of_it = self.matched[e].is_some_and(|region| {
                    self.differ(region, carrier, e) <= SEAM * self.stands_out
                });
                carriers[e] = (!part_of_it).then_some(carrier);
            }
        }
        carriers
    }

    /// How far the motions of two regions differ at splat `e`.
    fn differ(&self, a: u32, b: u32, e: usize) -> f64 {
        let at = self.edit.means[e].map(Real::as_f32);
        f64::from(self.motion.disagreement(a as usize, b as usize, at))
    }

    /// What each splat of the piece is nearest to in the rest of the edit.
    fn touches(&self, piece: &[usize], holders: &[usize], tree: &KdTree<3>) -> Vec<Touch> {
        let places: Vec<[f64; 3]> = piece.iter().map(|&splat| self.edit.means[splat]).collect();
        let touches = tree.map(&places, 1, |i, near| {
            let found = near.first()?;
            let region = self.matched[holders[found.id as usize]]?;
            Some(Touch { distance: found.distance_squared.sqrt(), region, splat: piece[i] })
        });
        touches.into_iter().flatten().collect()
    }

    /// Per splat, its distance from the sources if it is new, and not in place of a source.
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
            let d = crate::rigid::sub(self.edit.means[i], self.edit.means[j]);
            let step = STEP * self.spacing[i].max(self.spacing[j]);
            if is_new(i) && is_new(j) && crate::rigid::norm(d) <= step {
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
                let needed = if beyond(far, MIN_SHARE) {
                    DOMINANT
                } else if beyond(far, MIN_FREE) {
                    CLEAR
                } else {
                    UNANIMOUS
                };
                pieces.push(Piece { splats: piece, needed });
            }
        }
        pieces
    }

    /// The region whose motion holds the piece over the widest contact; none if another motion
    /// holds it nearly as well, or if nothing is in touch.
    fn carrier(&self, touches: &[Touch], needed: f64) -> Option<u32> {
        let closest = touches.iter().map(|t| t.distance).reduce(f64::min)?;
        if closest > self.reach {
            return None;
        }
        let hovers = closest > HOVERS * self.stands_out;
        let touch = CONTACT * self.stands_out;
        let width = if hovers { touch.max(HOVERING_CONTACT * closest) } else { touch };
        // What hovers and stands out is held by nothing: the nearest will do.
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
        contacts.retain(|c| self.differ(c.region, carrier, c.splat) > TOGETHER * self.stands_out);
        let rival = self.strongest(&contacts).map_or(0.0, |(_, held)| held);
        (held >= needed * rival).then_some(carrier)
    }

    /// The region with whose motion the widest contacts agree, and how wide they are; the better
    /// they agree, the more they count, so that it is a region amidst a part, not at a joint.
    fn strongest(&self, contacts: &[Contact]) -> Option<(u32, f64)> {
        let tolerance = (TOGETHER * self.stands_out).max(TINY);
        contacts
            .par_iter()
            .step_by(contacts.len().div_ceil(CANDIDATES).max(1))
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
