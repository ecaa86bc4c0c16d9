//! Agreement between neighbours of the edit: min-sum belief propagation over (motion, facing) labels.
//!
//! Neighbours on one sheet face the same way (up to the turn of the surface) and move the same way. Sheets of two body parts
//! that interleave at a contact are told apart by facing: neighbours that face opposite ways owe each other no motion, and those
//! that share a motion must face alike.

use super::cloud::TINY;
use super::edit::Edit;
use super::graph::Link;
use super::modes::{Choice, MODES};
use super::motion::CellMotion;
use super::surface::mirror_coupling;
use gs_core::Real;
use rayon::prelude::*;

const LABELS: usize = 2 * MODES;

/// Ten settle every scene measured.
const ROUNDS: usize = 12;

/// Strength with which neighbours on one sheet want one motion, and that with which neighbours want one facing.
const SHEET: f64 = 0.8;
const FACING: f64 = 0.4;

/// Neighbours are on one sheet if neither is farther than about this from the other's plane, in spacings, and their normals differ
/// by no more than about this, `1 − |cos|`. Where two sheets cross, many neighbours are nearly on one.
const THICKNESS: f64 = 0.2;
const MISALIGNED: f64 = 0.05;

/// Share of the figure by which two motions must differ to count as entirely different.
const APART: f64 = 0.1;

/// Costs beyond this are not evidence any more, only distance.
const EVIDENCE: f32 = 8.0;

/// Share of the old message kept: damping, without which loops may oscillate.
const DAMPING: f32 = 0.5;

struct Edge {
    ends: [u32; 2],
    /// Facing: sign and strength.
    mirror: f32,
    /// Strength with which the ends want one motion.
    sheet: f32,
    /// Disagreement of every pair of motions, saturated at 1.
    apart: [f32; MODES * MODES],
}

impl Edge {
    fn cost(&self, a: usize, b: usize) -> f32 {
        let apart = self.apart[(a / 2) * MODES + b / 2];
        let alike = (a % 2 == b % 2) == (self.mirror >= 0.0);
        if alike { self.sheet * apart } else { self.mirror.abs() * (1.0 - apart) }
    }
}

/// Index of the motion each edited splat takes.
pub(super) fn choose(
    motion: &CellMotion,
    choices: &[Choice],
    edit: &Edit,
    links: &[Link],
    spacing: &[f64],
    figure_size: f64,
) -> Vec<usize> {
    // Splats with one motion and a plain facing decide nothing among themselves, and those without any decide nothing at all.
    let settled: Vec<bool> = choices
        .iter()
        .map(|c| c.len() <= 1 && c.first().is_none_or(|m| (m.cost[0] - m.cost[1]).abs() > 6.0))
        .collect();
    let edges: Vec<Edge> = links
        .par_iter()
        .with_min_len(256)
        .filter(|link| !(settled[link.0 as usize] && settled[link.1 as usize]))
        .filter(|link| [link.0, link.1].iter().all(|&end| !choices[end as usize].is_empty()))
        .map(|&link| edge(motion, choices, edit, link, spacing, APART * figure_size))
        .collect();
    let mut incident: Vec<Vec<(u32, u8)>> = vec![Vec::new(); choices.len()];
    for (number, edge) in (0_u32..).zip(&edges) {
        for end in [0_u8, 1] {
            incident[edge.ends[usize::from(end)] as usize].push((number, end));
        }
    }
    let unary: Vec<[f32; LABELS]> = choices.iter().map(evidence).collect();
    // messages[edge][end]: what the edge tells that end.
    let mut messages = vec![[[0.0_f32; LABELS]; 2]; edges.len()];
    let belief = |messages: &[[[f32; LABELS]; 2]], i: usize| {
        let mut sum = unary[i];
        for &(edge, end) in &incident[i] {
            let message = &messages[edge as usize][usize::from(end)];
            for (sum, m) in sum.iter_mut().zip(message) {
                *sum += m;
            }
        }
        sum
    };
    for _ in 0..ROUNDS {
        let beliefs: Vec<[f32; LABELS]> = (0..choices.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| belief(&messages, i))
            .collect();
        messages
            .par_iter_mut()
            .zip(&edges)
            .with_min_len(256)
            .for_each(|(message, edge)| pass(message, edge, &beliefs, choices));
    }
    (0..choices.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let sum = belief(&messages, i);
            (0..2 * choices[i].len()).fold(0, |best, l| if sum[l] < sum[best] { l } else { best })
                / 2
        })
        .collect()
}

fn evidence(choice: &Choice) -> [f32; LABELS] {
    let mut costs = [f32::INFINITY; LABELS];
    for (m, mode) in choice.iter().enumerate() {
        for facing in 0..2 {
            costs[2 * m + facing] = mode.cost[facing].min(EVIDENCE);
        }
    }
    costs
}

fn edge(
    motion: &CellMotion,
    choices: &[Choice],
    edit: &Edit,
    link: Link,
    spacing: &[f64],
    tau: f64,
) -> Edge {
    let (a, b) = (link.0 as usize, link.1 as usize);
    let inner = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (x, y) = (edit.means[a], edit.means[b]);
    let d = [0, 1, 2].map(|i| y[i] - x[i]);
    let between = [0, 1, 2].map(|i| (0.5 * (x[i] + y[i])).as_f32());
    let (na, nb) = (edit.axes[a], edit.axes[b]);
    // Distance to the 6th neighbour.
    let h = spacing[a].min(spacing[b]) * std::f64::consts::SQRT_2;
    let squared = inner(d, d);
    let reach = (2.0 * h).max(TINY);
    let nearness = (-0.5 * squared / (reach * reach)).exp();
    let flat = (inner(na, na) * inner(nb, nb)).sqrt();
    let sheet = if flat > 1e-6 {
        let plane = |n: [f64; 3]| inner(n, d).powi(2) / inner(n, n);
        let thickness = (THICKNESS * h).max(TINY).powi(2);
        let misaligned = 1.0 - inner(na, nb).abs() / flat;
        flat * (-0.5 * plane(na).max(plane(nb)) / thickness - misaligned / MISALIGNED).exp()
    } else {
        0.0
    };
    let mut apart = [0.0; MODES * MODES];
    for (i, p) in choices[a].iter().enumerate() {
        for (j, q) in choices[b].iter().enumerate() {
            let distance =
                f64::from(motion.disagreement(p.cell as usize, q.cell as usize, between));
            apart[i * MODES + j] = if tau > 0.0 { (distance / tau).min(1.0).as_f32() } else { 0.0 };
        }
    }
    Edge {
        ends: [link.0, link.1],
        mirror: (FACING * mirror_coupling(na, nb, d, h)).as_f32(),
        sheet: (SHEET * nearness * sheet).as_f32(),
        apart,
    }
}

fn pass(
    message: &mut [[f32; LABELS]; 2],
    edge: &Edge,
    beliefs: &[[f32; LABELS]],
    choices: &[Choice],
) {
    let old = *message;
    for to in 0..2 {
        let from = 1 - to;
        let (sender, receiver) = (edge.ends[from] as usize, edge.ends[to] as usize);
        let (ns, nr) = (2 * choices[sender].len(), 2 * choices[receiver].len());
        let mut lowest = f32::INFINITY;
        let mut new = [0.0_f32; LABELS];
        for (r, slot) in new[..nr].iter_mut().enumerate() {
            *slot = (0..ns).fold(f32::INFINITY, |best, s| {
                let joint = if to == 1 { edge.cost(s, r) } else { edge.cost(r, s) };
                best.min(beliefs[sender][s] - old[from][s] + joint)
            });
            lowest = lowest.min(*slot);
        }
        for r in 0..nr {
            message[to][r] = DAMPING * old[to][r] + (1.0 - DAMPING) * (new[r] - lowest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::best::cloud::{Cloud, Companions};
    use crate::best::modes::Mode;

    /// Two patches of cells, of which the second moves away.
    fn two_parts() -> CellMotion {
        let patch = |x: f64| (0..16).map(move |i| [x + f64::from(i % 4), f64::from(i / 4), 0.0]);
        let means: Vec<[f64; 3]> = patch(0.0).chain(patch(100.0)).collect();
        let away = |mean: &[f64; 3]| [mean[0], mean[1], if mean[0] < 50.0 { 0.0 } else { 10.0 }];
        let cloud = Cloud {
            means_t: vec![means.iter().map(away).collect()],
            turns_t: vec![vec![[1.0, 0.0, 0.0, 0.0]; 32]],
            opacity: vec![1.0; 32],
            moving: vec![true; 32],
            seen_t: Vec::new(),
            means,
        };
        CellMotion::of(&cloud, &Companions::of(&cloud))
    }

    /// A sheet of splats, the motions each could have, and who is beside whom: everyone.
    fn chosen(choices: &[Choice]) -> Vec<usize> {
        let count = choices.len();
        let edit = Edit {
            means: (0..count).map(|i| [0.1 * (i % 3) as f64, 0.1 * (i / 3) as f64, 0.0]).collect(),
            axes: vec![[0.0, 0.0, 1.0]; count],
            lineage: vec![None; count],
            exact: vec![None; count],
            kept: Vec::new(),
        };
        let ends = (0_u32..).take(count);
        let links: Vec<Link> = ends
            .clone()
            .flat_map(|a| ends.clone().filter(move |&b| a < b).map(move |b| (a, b)))
            .collect();
        choose(&two_parts(), choices, &edit, &links, &vec![0.1; count], 10.0)
    }

    /// The second part first, at `cost` more than the other.
    fn choice(cost: f32) -> Choice {
        let mode = |cell: u32, cost: f32| Mode {
            witnesses: Vec::new(),
            cell,
            cost: [cost, cost + 5.0],
            descent: 0.0,
        };
        vec![mode(20, cost), mode(4, 0.0)]
    }

    #[test]
    fn neighbours_agree_beside_one_that_has_no_motion_to_offer() {
        // The one in doubt leans the other way; alone, it goes there.
        let sheet: Vec<Choice> = (0..8).map(|i| choice(if i == 4 { -0.3 } else { 3.0 })).collect();
        assert_eq!(chosen(&[choice(-0.3)]), [0], "alone");
        assert_eq!(chosen(&sheet), [1; 8], "on a sheet");
        let with_floater: Vec<Choice> = sheet.into_iter().chain([Vec::new()]).collect();
        assert_eq!(chosen(&with_floater)[..8], [1; 8], "beside a floater");
    }
}
