//! Splats that live briefly: which of those that the edit frame shows each splat descends from.
//!
//! Scenes of Spacetime Gaussians and their kind show a surface through generations of splats. A
//! chain of small transports ([`matching`]), from the edit time in both directions, gives each
//! splat the place that it would have at the edit time ([`rest`]); one more transport there says
//! from which splats of the edit frame it descends.

mod lives;
mod matching;
mod polish;
mod rest;

pub(crate) use lives::{Lives, Visibility};
pub(crate) use rest::Rest;

use crate::AmgError;
use gs_core::{DynamicScene, Splats};
use matching::{Point, matches};
use rayon::prelude::*;
use rest::{at_rest, point_of};

/// Splats that the edit frame shows from which one descends, and how sure that is.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Descent {
    /// Source ids and shares that sum to 1; empty if it descends from nothing that was shown.
    pub(crate) of: Vec<(u32, f32)>,
    /// 0 to 1.
    pub(crate) confidence: f32,
}

/// The source's splats as generations of the surface that the edit frame shows.
#[derive(Debug)]
pub(crate) struct Generations {
    pub(crate) lives: Lives,
    /// Rest places, `[N]`; none for what descends from nothing.
    pub(crate) rest: Vec<Option<Rest>>,
    /// At rest, `[N]`: facing of the splats that have a rest place.
    axes: Vec<[f64; 3]>,
    /// `[N]`; empty for those that the edit frame shows.
    pub(crate) descent: Vec<Descent>,
}

impl Generations {
    pub(crate) fn of(
        source: &dyn DynamicScene,
        edit_time: f32,
        progress: &dyn Fn(f32),
    ) -> Result<Self, AmgError> {
        let lives = Lives::of(source, edit_time, &|done| progress(0.3 * done))?;
        let mut rest = rest::rest_places(source, &lives, &|done| progress(0.3 + 0.4 * done))?;
        polish::polish(&lives, &mut rest);
        let points = points_at_rest(source, &lives, &rest)?;
        progress(0.9);
        let descent = descent(&lives, &rest, &points)?;
        let axes = points.iter().map(|point| point.map_or([0.0; 3], |point| point.axis)).collect();
        progress(1.0);
        Ok(Self { lives, rest, axes, descent })
    }

    /// Whether the edit frame shows splat `i`.
    pub(crate) fn is_shown(&self, i: usize) -> bool {
        self.lives.is_there(self.lives.edit, i)
    }

    /// Thin axis of splat `i` at rest; its length is the flatness.
    pub(crate) fn axis(&self, i: usize) -> [f64; 3] {
        self.axes[i]
    }
}

/// Splats as they would be at the edit time, each as it is when it is matched.
fn points_at_rest(
    source: &dyn DynamicScene,
    lives: &Lives,
    rest: &[Option<Rest>],
) -> Result<Vec<Option<Point>>, AmgError> {
    let mut points = vec![None; rest.len()];
    let mut splats = Splats::default();
    for (k, &t) in lives.times.iter().enumerate() {
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
            let mass = f64::from(lives.visibility[i].peak) * lives.presence(k, i).max(1e-3);
            points[i] = Some(Point { mass, ..at_rest(point_of(&splats, i), &rest) });
        }
    }
    Ok(points)
}

/// Transport, at rest, from what the edit frame shows to all others.
fn descent(
    lives: &Lives,
    rest: &[Option<Rest>],
    points: &[Option<Point>],
) -> Result<Vec<Descent>, AmgError> {
    let pick = |ids: &[usize]| -> Vec<Point> { ids.iter().filter_map(|&i| points[i]).collect() };
    let (shown, others): (Vec<usize>, Vec<usize>) = (0..rest.len())
        .filter(|&i| points[i].is_some())
        .partition(|&i| lives.is_there(lives.edit, i));
    let found = matches(&pick(&shown), &pick(&others))?;
    let mut descent = vec![Descent::default(); rest.len()];
    let lines: Vec<Descent> = others
        .par_iter()
        .zip(&found)
        .map(|(&i, found)| {
            let matched = 1.0 - found.unmatched;
            let Some(rest) = rest[i].filter(|_| matched > 0.5) else { return Descent::default() };
            let total: f64 = found.of.iter().map(|entry| entry.1).sum();
            let kept = found.of.iter().filter(|entry| entry.1 > 1e-3 * total);
            let of = kept.map(|&(at, share)| {
                (crate::row_index::index(shown[at as usize]), gs_core::Real::as_f32(share / total))
            });
            let confidence = gs_core::Real::as_f32(matched * rest.confidence);
            Descent { of: of.collect(), confidence }
        })
        .collect();
    for (&i, line) in others.iter().zip(lines) {
        descent[i] = line;
    }
    Ok(descent)
}
