//! Rest places: the position that each splat would have at the edit time, found step by step from
//! the splats that it is matched with.

use super::lives::{Lives, PRESENT};
use super::matching::{Match, Point, matches};
use crate::AmgError;
use crate::rigid::{RigidFit, sub};
use gs_core::{DynamicScene, Splats, quat, sh};

/// Presence from which a splat is matched with earlier ones. It is matched once, near the middle of
/// its life: if the surface moves along a curve, the straight path of a long-lived splat is close
/// to the surface only there.
const RIPE: f64 = 0.8;
/// Half of a typical life, share of the clip.
const HALF_LIFE: f64 = 0.06;

/// The position and rotation that a splat would have at the edit time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rest {
    /// World units.
    pub(crate) place: [f64; 3],
    /// Rotation from the key time at which it was matched to the edit time.
    pub(crate) turn: [f64; 4],
    /// Index of that key time.
    pub(crate) joined: usize,
    /// Product of the matched shares along the chain, 0 to 1.
    pub(crate) confidence: f64,
}

/// Rest places of all splats, `[N]`; `None` where no chain of matches arrives.
pub(super) fn rest_places(
    source: &dyn DynamicScene,
    lives: &Lives,
    progress: &dyn Fn(f32),
) -> Result<Vec<Option<Rest>>, AmgError> {
    let mut rest: Vec<Option<Rest>> = (0..lives.len())
        .map(|i| {
            lives.is_visible(lives.edit, i).then(|| Rest {
                place: lives.place(lives.edit, i),
                turn: quat::IDENTITY.map(f64::from),
                joined: lives.edit,
                confidence: 1.0,
            })
        })
        .collect();
    let steps = lives.times.len() - 1;
    let mut done = 0;
    let forwards: Vec<usize> = (lives.edit + 1..lives.times.len()).collect();
    let backwards: Vec<usize> = (0..lives.edit).rev().collect();
    let mut splats = Splats::default();
    for k in forwards.into_iter().chain(backwards) {
        source.at_into(lives.times[k], &mut splats).map_err(AmgError::from)?;
        step(lives, k, &splats, &mut rest)?;
        done += 1;
        progress(done as f32 / steps as f32);
    }
    Ok(rest)
}

/// Matches the splats that are visible at key time `k` and have no rest place yet.
fn step(
    lives: &Lives,
    k: usize,
    splats: &Splats,
    rest: &mut [Option<Rest>],
) -> Result<(), AmgError> {
    let there = |i: &usize| lives.presence(k, *i) > if rest[*i].is_some() { PRESENT } else { RIPE };
    let (old, new): (Vec<usize>, Vec<usize>) =
        (0..lives.len()).filter(there).partition(|&i| rest[i].is_some());
    if new.is_empty() || old.is_empty() {
        return Ok(());
    }
    let point = |&i: &usize| Point { drift: drift(lives, k, i), ..point_of(splats, i) };
    let olds: Vec<Point> = old.iter().map(point).collect();
    let news: Vec<Point> = new.iter().map(point).collect();
    let found = matches(&olds, &news)?;
    for (&i, found) in new.iter().zip(&found) {
        // Otherwise the next key time is tried.
        if found.unmatched < 0.5 {
            rest[i] = rest_of(&old, &olds, found, k, lives.place(k, i), rest);
        }
    }
    Ok(())
}

/// The rest place under the rigid motion of its matches from key time `k` to the edit time.
fn rest_of(
    old: &[usize],
    points: &[Point],
    found: &Match,
    k: usize,
    place: [f64; 3],
    rest: &[Option<Rest>],
) -> Option<Rest> {
    let mut pairs = Vec::with_capacity(found.of.len());
    let (mut confidence, mut total) = (0.0, 0.0);
    for &(at, share) in &found.of {
        let known = rest[old[at as usize]]?;
        pairs.push((share, points[at as usize].place, known.place));
        confidence += share * known.confidence;
        total += share;
    }
    let fit = RigidFit::of(pairs.into_iter().filter(|pair| pair.0 > 1e-6));
    let turn = fit.rotation(0.0);
    let place = fit.apply(turn, place);
    let usable = total > 0.0 && place.iter().chain(&turn).all(|value| value.is_finite());
    usable.then_some(Rest { place, turn, joined: k, confidence })
}

/// Displacement of a splat over half a life, at its velocity at key time `k`, world units.
fn drift(lives: &Lives, k: usize, i: usize) -> [f64; 3] {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(lives.times.len() - 1));
    let step = f64::from(lives.times[b] - lives.times[a]);
    if step <= 0.0 {
        return [0.0; 3];
    }
    sub(lives.place(b, i), lives.place(a, i)).map(|v| v / step * HALF_LIFE)
}

/// The properties of splat `i` in its present state.
pub(super) fn point_of(splats: &Splats, i: usize) -> Point {
    let scale = splats.scale(i).map(f64::from);
    let thin = (0..3).fold(0, |best, axis| if scale[axis] < scale[best] { axis } else { best });
    let mut axis = [0.0; 3];
    let others: Vec<f64> = (0..3).filter(|&a| a != thin).map(|a| scale[a]).collect();
    let middle = others[0].min(others[1]);
    axis[thin] = if middle > 0.0 { 1.0 - scale[thin] / middle } else { 0.0 };
    let rotation = quat::normalize(splats.quats[i].map(f64::from));
    let dc = splats.sh_of(i)[0];
    let ln_size = (others[0] * others[1]).max(f64::MIN_POSITIVE).ln() / 2.0;
    Point {
        place: splats.means[i].map(f64::from),
        drift: [0.0; 3],
        axis: quat::rotate(rotation, axis),
        ln_size,
        color: dc.map(|c| (0.5 + f64::from(sh::C0) * f64::from(c)).clamp(0.0, 1.0)),
        mass: f64::from(splats.opacity(i)).max(1e-3),
    }
}

/// The same properties at the rest place.
pub(super) fn at_rest(point: Point, rest: &Rest) -> Point {
    Point { place: rest.place, axis: quat::rotate(rest.turn, point.axis), ..point }
}
