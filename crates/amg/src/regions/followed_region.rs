//! The region that each edited splat follows: its own match, or that of a different splat.

use super::attachment::NewPieces;
use super::candidates::Candidates;
use super::edit::Edit;
use super::graph::{self, Graph};
use super::posterior::RegionPosterior;
use super::region_motion::RegionMotion;
use super::source::Regions;

/// The region that an edited splat follows.
#[derive(Debug, Clone, Copy)]
pub(super) enum Followed {
    /// Its own match.
    Own(u32),
    /// The attachment of its piece, the match of the splat to which it is connected, or its most
    /// probable region although "unmatched" is more probable.
    Other(u32),
    /// No region is within reach.
    Nothing,
}

/// Input of [`FollowInputs::followed`].
pub(super) struct FollowInputs<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) edit: &'a Edit,
    pub(super) candidates: &'a Candidates,
    /// RegionPosterior of each edited splat, `[E]`.
    pub(super) posteriors: &'a [RegionPosterior],
    /// See [`NewPieces::new_geometry`], world units.
    pub(super) new_geometry: f64,
    /// Maximum distance from a splat to its nearest candidate, world units.
    pub(super) reach: f64,
}

impl FollowInputs<'_> {
    /// The region that each edited splat follows, `[E]`.
    pub(super) fn followed(&self) -> Vec<Followed> {
        let Self { regions, motion, edit, .. } = *self;
        let matched: Vec<Option<u32>> = (0..edit.len()).map(|e| self.matched(e)).collect();
        let graph = Graph::of(&edit.means);
        let seeds = graph::nearest_seed(&graph, |e| matched[e].is_some());
        let pieces = NewPieces {
            regions,
            motion,
            edit,
            matched: &matched,
            graph: &graph,
            new_geometry: self.new_geometry,
            reach: self.reach,
        };
        let attachments = pieces.attachments();
        let followed = |e: usize| {
            let of_seed = seeds[e].and_then(|seed| matched[seed as usize]);
            let likeliest = self.posteriors[e].region.filter(|_| self.within_reach(e));
            match (attachments[e], matched[e], of_seed.or(likeliest)) {
                (None, Some(region), _) => Followed::Own(region),
                (Some(region), ..) | (None, None, Some(region)) => Followed::Other(region),
                (None, None, None) => Followed::Nothing,
            }
        };
        (0..edit.len()).map(followed).collect()
    }

    /// The most probable region of splat `e`, if "unmatched" is less probable than all regions
    /// together and a region is within reach.
    fn matched(&self, e: usize) -> Option<u32> {
        let RegionPosterior { region, unmatched } = self.posteriors[e];
        let is_matched = unmatched < 0.5 && (self.within_reach(e) || self.edit.exact[e].is_some());
        region.filter(|_| is_matched)
    }

    fn within_reach(&self, e: usize) -> bool {
        self.candidates.distance[e] <= self.reach
    }
}
