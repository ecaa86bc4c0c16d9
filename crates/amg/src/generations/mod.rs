//! Short-lived splats: which splats of the edit frame each later or earlier splat descends from.
//!
//! Methods such as Spacetime Gaussians represent a surface by successive generations of splats.
//! Splats are matched between neighbouring key times by transport ([`matching`]), from the edit
//! time in both directions. This gives each splat a rest position, its position at the edit time
//! ([`rest`]). A last transport between rest positions gives each splat's ancestors in the edit
//! frame.

mod lifetimes;
mod matching;
mod refine_rest;
mod rest;

pub(crate) use lifetimes::{FOLLOW_PRESENCE, Lifetimes, OpacityRange};
pub(crate) use matching::{FACING, NEIGHBORS};
pub(crate) use rest::Rest;

use crate::AmgError;
use gs_core::{DynamicScene, Splats};
use matching::{MatchFeatures, matches};
use rayon::prelude::*;
use rest::{at_rest, point_of};

/// The ancestors of a splat among the splats visible in the edit frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Ancestry {
    /// Source ids with shares that sum to 1; empty if the splat has no visible ancestor.
    pub(crate) of: Vec<(u32, f32)>,
    /// Confidence of the match, 0 to 1.
    pub(crate) confidence: f32,
}

/// Lifetimes of the source's splats, and their relation to the splats of the edit frame.
#[derive(Debug)]
pub(crate) struct Generations {
    pub(crate) lifetimes: Lifetimes,
    /// Rest positions, `[N]`; `None` for splats that no chain of matches reaches.
    pub(crate) rest: Vec<Option<Rest>>,
    /// Thin axis of each splat at its rest position, `[N]`; its length is the flatness.
    axes: Vec<[f64; 3]>,
    /// Ancestors, `[N]`; empty for splats that are visible in the edit frame.
    pub(crate) ancestries: Vec<Ancestry>,
}

impl Generations {
    pub(crate) fn of(
        source: &dyn DynamicScene,
        edit_time: f32,
        progress: &dyn Fn(f32),
    ) -> Result<Self, AmgError> {
        let lifetimes = Lifetimes::of(source, edit_time, &|done| progress(0.3 * done))?;
        let mut rest =
            rest::rest_positions(source, &lifetimes, &|done| progress(0.3 + 0.4 * done))?;
        refine_rest::refine_rest(&lifetimes, &mut rest);
        let points = points_at_rest(source, &lifetimes, &rest)?;
        progress(0.9);
        let ancestries = ancestries(&lifetimes, &rest, &points)?;
        let axes = points.iter().map(|point| point.map_or([0.0; 3], |point| point.axis)).collect();
        progress(1.0);
        Ok(Self { lifetimes, rest, axes, ancestries })
    }

    /// Whether splat `i` is visible in the edit frame.
    pub(crate) fn is_shown(&self, i: usize) -> bool {
        self.lifetimes.is_visible(self.lifetimes.edit, i)
    }

    /// Thin axis of splat `i` at rest; its length is the flatness.
    pub(crate) fn axis(&self, i: usize) -> [f64; 3] {
        self.axes[i]
    }
}

/// Splats at their rest positions, with their size and colour at the time when they were matched.
fn points_at_rest(
    source: &dyn DynamicScene,
    lifetimes: &Lifetimes,
    rest: &[Option<Rest>],
) -> Result<Vec<Option<MatchFeatures>>, AmgError> {
    let mut points = vec![None; rest.len()];
    let mut splats = Splats::default();
    for (k, &t) in lifetimes.times.iter().enumerate() {
        let joined: Vec<(usize, Rest)> = rest
            .iter()
            .enumerate()
            .filter_map(|(i, rest)| Some((i, rest.filter(|rest| rest.joined == k)?)))
            .collect();
        if joined.is_empty() {
            continue;
        }
        source.at_into(t, &mut splats)?;
        for (i, rest) in joined {
            let mass =
                f64::from(lifetimes.opacity_ranges[i].peak) * lifetimes.presence(k, i).max(1e-3);
            points[i] = Some(MatchFeatures { mass, ..at_rest(point_of(&splats, i), &rest) });
        }
    }
    Ok(points)
}

/// Transport between rest positions: from the splats visible in the edit frame to all others.
fn ancestries(
    lifetimes: &Lifetimes,
    rest: &[Option<Rest>],
    points: &[Option<MatchFeatures>],
) -> Result<Vec<Ancestry>, AmgError> {
    let select =
        |ids: &[usize]| -> Vec<MatchFeatures> { ids.iter().filter_map(|&i| points[i]).collect() };
    let (shown, others): (Vec<usize>, Vec<usize>) = (0..rest.len())
        .filter(|&i| points[i].is_some())
        .partition(|&i| lifetimes.is_visible(lifetimes.edit, i));
    let found = matches(&select(&shown), &select(&others))?;
    let mut ancestries = vec![Ancestry::default(); rest.len()];
    let found: Vec<Ancestry> = others
        .par_iter()
        .zip(&found)
        .map(|(&i, found)| {
            let matched = 1.0 - found.unmatched;
            let Some(rest) = rest[i].filter(|_| matched > 0.5) else { return Ancestry::default() };
            let total: f64 = found.of.iter().map(|entry| entry.1).sum();
            let kept = found.of.iter().filter(|entry| entry.1 > 1e-3 * total);
            let of = kept.map(|&(at, share)| {
                (crate::row_index::index(shown[at as usize]), gs_core::Real::as_f32(share / total))
            });
            let confidence = gs_core::Real::as_f32(matched * rest.confidence);
            Ancestry { of: of.collect(), confidence }
        })
        .collect();
    for (&i, ancestry) in others.iter().zip(found) {
        ancestries[i] = ancestry;
    }
    Ok(ancestries)
}
