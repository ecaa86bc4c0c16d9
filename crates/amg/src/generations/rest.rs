//! Rest positions: the position that each splat would have at the edit time, found step by step
//! from the splats that it matches.

use super::lifetimes::{FOLLOW_PRESENCE, Lifetimes};
use super::matching::{MatchFeatures, SplatMatch, matches};
use crate::AmgError;
use crate::rigid::{RigidFit, sub};
use gs_core::{DynamicScene, Splats, quat, sh};

/// Minimum presence at which a splat is matched with earlier ones. It is matched once, near the
/// middle of its lifetime: if the surface moves along a curve, the straight path of a long-lived
/// splat is close to the surface only there.
const MATCH_PRESENCE: f64 = 0.8;
/// Half of a typical lifetime, as a share of the clip.
const HALF_LIFETIME: f64 = 0.06;

/// The position and rotation that a splat would have at the edit time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rest {
    /// World frame and units.
    pub(crate) position: [f64; 3],
    /// Rotation from the key time at which it was matched to the edit time, `wxyz`.
    pub(crate) rotation: [f64; 4],
    /// Index of that key time.
    pub(crate) joined: usize,
    /// Product of the matched shares along the chain, 0 to 1.
    pub(crate) confidence: f64,
}

/// Rest positions of all splats, `[N]`; `None` where no chain of matches leads to the edit time.
pub(super) fn rest_positions(
    source: &dyn DynamicScene,
    lifetimes: &Lifetimes,
    progress: &dyn Fn(f32),
) -> Result<Vec<Option<Rest>>, AmgError> {
    let mut rest: Vec<Option<Rest>> = (0..lifetimes.len())
        .map(|i| {
            lifetimes.is_visible(lifetimes.edit, i).then(|| Rest {
                position: lifetimes.position(lifetimes.edit, i),
                rotation: quat::IDENTITY.map(f64::from),
                joined: lifetimes.edit,
                confidence: 1.0,
            })
        })
        .collect();
    let steps = lifetimes.times.len() - 1;
    let mut done = 0;
    let forwards: Vec<usize> = (lifetimes.edit + 1..lifetimes.times.len()).collect();
    let backwards: Vec<usize> = (0..lifetimes.edit).rev().collect();
    let mut splats = Splats::default();
    for k in forwards.into_iter().chain(backwards) {
        source.at_into(lifetimes.times[k], &mut splats).map_err(AmgError::from)?;
        step(lifetimes, k, &splats, &mut rest)?;
        done += 1;
        progress(done as f32 / steps as f32);
    }
    Ok(rest)
}

/// Matches the splats that are visible at key time `k` and have no rest position yet.
fn step(
    lifetimes: &Lifetimes,
    k: usize,
    splats: &Splats,
    rest: &mut [Option<Rest>],
) -> Result<(), AmgError> {
    let there = |i: &usize| {
        lifetimes.presence(k, *i)
            > if rest[*i].is_some() { FOLLOW_PRESENCE } else { MATCH_PRESENCE }
    };
    let (old, new): (Vec<usize>, Vec<usize>) =
        (0..lifetimes.len()).filter(there).partition(|&i| rest[i].is_some());
    if new.is_empty() || old.is_empty() {
        return Ok(());
    }
    let point = |&i: &usize| MatchFeatures { drift: drift(lifetimes, k, i), ..point_of(splats, i) };
    let olds: Vec<MatchFeatures> = old.iter().map(point).collect();
    let news: Vec<MatchFeatures> = new.iter().map(point).collect();
    let found = matches(&olds, &news)?;
    for (&i, found) in new.iter().zip(&found) {
        // If unmatched, it is tried again at the next key time.
        if found.unmatched < 0.5 {
            rest[i] = rest_of(&old, &olds, found, k, lifetimes.position(k, i), rest);
        }
    }
    Ok(())
}

/// The rest position under the rigid motion of its matches from key time `k` to the edit time.
fn rest_of(
    old: &[usize],
    points: &[MatchFeatures],
    found: &SplatMatch,
    k: usize,
    position: [f64; 3],
    rest: &[Option<Rest>],
) -> Option<Rest> {
    let mut pairs = Vec::with_capacity(found.of.len());
    let (mut confidence, mut total) = (0.0, 0.0);
    for &(at, share) in &found.of {
        let known = rest[old[at as usize]]?;
        pairs.push((share, points[at as usize].position, known.position));
        confidence += share * known.confidence;
        total += share;
    }
    let fit = RigidFit::of(pairs.into_iter().filter(|pair| pair.0 > 1e-6));
    let rotation = fit.rotation(0.0);
    let position = fit.apply(rotation, position);
    let usable = total > 0.0 && position.iter().chain(&rotation).all(|value| value.is_finite());
    usable.then_some(Rest { position, rotation, joined: k, confidence })
}

/// Displacement of a splat over half a typical lifetime, at its velocity at key time `k`, world
/// units.
fn drift(lifetimes: &Lifetimes, k: usize, i: usize) -> [f64; 3] {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(lifetimes.times.len() - 1));
    let step = f64::from(lifetimes.times[b] - lifetimes.times[a]);
    if step <= 0.0 {
        return [0.0; 3];
    }
    sub(lifetimes.position(b, i), lifetimes.position(a, i)).map(|v| v / step * HALF_LIFETIME)
}

/// The properties of splat `i`, without velocity.
pub(super) fn point_of(splats: &Splats, i: usize) -> MatchFeatures {
    let scale = splats.scale(i).map(f64::from);
    let thin = (0..3).fold(0, |best, axis| if scale[axis] < scale[best] { axis } else { best });
    let mut axis = [0.0; 3];
    let others: Vec<f64> = (0..3).filter(|&a| a != thin).map(|a| scale[a]).collect();
    let middle = others[0].min(others[1]);
    axis[thin] = if middle > 0.0 { 1.0 - scale[thin] / middle } else { 0.0 };
    let rotation = quat::normalize(splats.quats[i].map(f64::from));
    let dc = splats.sh_of(i)[0];
    let ln_size = (others[0] * others[1]).max(f64::MIN_POSITIVE).ln() / 2.0;
    MatchFeatures {
        position: splats.means[i].map(f64::from),
        drift: [0.0; 3],
        axis: quat::rotate(rotation, axis),
        ln_size,
        color: dc.map(|c| (0.5 + f64::from(sh::C0) * f64::from(c)).clamp(0.0, 1.0)),
        mass: f64::from(splats.opacity(i)).max(1e-3),
    }
}

/// The same properties at the rest position.
pub(super) fn at_rest(point: MatchFeatures, rest: &Rest) -> MatchFeatures {
    MatchFeatures {
        position: rest.position,
        axis: quat::rotate(rest.rotation, point.axis),
        ..point
    }
}
