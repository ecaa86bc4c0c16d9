//! [`SurfaceGraph`]: graph of the neighbours on one surface.

use super::{params::EvidenceParams, source::thin_axis};
use anchors::{RigidNeighbors, Trajectories};
use gs_core::{Splats, sh};
use rayon::prelude::*;

/// Edited splats, followed by deleted source splats.
pub(super) struct Nodes {
    /// Centres at frame 1, world units.
    pub means: Vec<[f64; 3]>,
    /// Thin axis, unit, of either sign.
    pub normals: Vec<[f32; 3]>,
    /// 1 − s₁/s₂ of the two smallest scales: 0 for a ball, nearly 1 for a disc.
    pub flatness: Vec<f32>,
    /// Base colour before the edit: logarithm of brightness, and shares of red and green.
    pub colors: Vec<[f32; 3]>,
    /// Whether there is a colour before the edit.
    pub has_source: Vec<bool>,
}

impl Nodes {
    pub(super) fn of(
        first: &Splats,
        old: &[[f32; 3]],
        parents: &[Option<u32>],
        source: &Splats,
        gone: &[u32],
    ) -> Self {
        let mut nodes = Self {
            means: Vec::new(),
            normals: Vec::new(),
            flatness: Vec::new(),
            colors: Vec::new(),
            has_source: Vec::new(),
        };
        let coeffs = first.sh_coeffs();
        for i in 0..first.len() {
            nodes.push(first, i, old[i * coeffs], parents[i].is_some());
        }
        for id in gone.iter().map(|&id| id as usize) {
            nodes.push(source, id, source.sh_of(id)[0], true);
        }
        nodes
    }

    fn push(&mut self, splats: &Splats, i: usize, base: [f32; 3], has_source: bool) {
        let mut scale = splats.scale(i);
        scale.sort_by(f32::total_cmp);
        let normal = thin_axis(splats, i);
        let flatness = 1.0 - scale[0] / scale[1];
        let sound = splats.is_finite(i) && normal.iter().all(|x| x.is_finite());
        self.means.push(if sound { splats.means[i].map(f64::from) } else { [0.0; 3] });
        self.normals.push(if sound { normal } else { [0.0; 3] });
        self.flatness.push(if flatness.is_finite() { flatness } else { 0.0 });
        self.colors.push(tone(base));
        self.has_source.push(has_source && sound);
    }

    pub(super) fn len(&self) -> usize {
        self.means.len()
    }

    /// Similarity of the normals of two splats, 0 to 1.
    pub(super) fn facing(&self, a: usize, b: usize) -> f32 {
        let cosine: f32 = (0..3).map(|k| self.normals[a][k] * self.normals[b][k]).sum();
        let flat = self.flatness[a].min(self.flatness[b]);
        1.0 - flat * (1.0 - cosine.powi(2).min(1.0))
    }

    /// Similarity of their colours before the edit, 0 to 1.
    pub(super) fn likeness(&self, a: usize, b: usize, params: &EvidenceParams) -> f32 {
        let [a, b] = [a, b].map(|i| scaled_tone(self.colors[i], params));
        let square: f32 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
        (-0.5 * square).exp()
    }
}

/// Added to every channel, so that the tone of black is defined and that of dark colours is not
/// dominated by noise.
const DARK: f32 = 0.03;

/// Logarithm of brightness, and shares of red and green, of a base colour as SH. Light and shadow
/// change only the first.
pub(super) fn tone(base: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = base.map(|x| {
        let value = 0.5 + sh::C0 * x;
        if value.is_finite() { value.clamp(0.0, 10.0) + DARK } else { DARK }
    });
    let sum = r + g + b;
    [sum.ln(), r / sum, g / sum]
}

/// A tone in units of its spread.
pub(super) fn scaled_tone([light, red, green]: [f32; 3], params: &EvidenceParams) -> [f32; 3] {
    [light / params.light_spread, red / params.hue_spread, green / params.hue_spread]
}

/// Neighbours on one surface, each list `per_node` long.
pub(super) struct SurfaceGraph {
    pub rigid: RigidNeighbors,
    pub points: Trajectories,
    ids: Vec<u32>,
    weights: Vec<f32>,
    per_node: usize,
}

impl SurfaceGraph {
    /// The graph of `nodes`, with their positions `moments` at other times, `[T][nodes]`.
    pub(super) fn of(nodes: &Nodes, moments: &[Vec<[f32; 3]>], params: &EvidenceParams) -> Self {
        let place = |i: usize, means: &[[f32; 3]]| {
            let mean = means[i].map(f64::from);
            if mean.iter().all(|x| x.is_finite()) { mean } else { nodes.means[i] }
        };
        let moved: Vec<[f64; 3]> = (0..nodes.len())
            .flat_map(|i| moments.iter().map(move |means| place(i, means)))
            .collect();
        let still = |i: usize| {
            moved[i * moments.len()..(i + 1) * moments.len()].iter().all(|x| *x == nodes.means[i])
        };
        let moving = (0..nodes.len()).map(|i| !still(i)).collect();
        let points = Trajectories {
            rest: nodes.means.clone(),
            moved,
            presence: Vec::new(),
            weights: vec![1.0; nodes.len()],
            moving,
        };
        let rigid = RigidNeighbors::of(&points, params.strain);
        let per_node = if nodes.len() > 0 { rigid.get(0).len() } else { 0 };
        let lists: Vec<(u32, f32)> = (0..nodes.len())
            .into_par_iter()
            .with_min_len(256)
            .flat_map_iter(|i| {
                let rigid = &rigid;
                rigid.get(i).map(move |(neighbor, together)| {
                    let j = neighbor.id as usize;
                    let spacing = rigid.spacing[i].max(1e-12);
                    let near = (-0.5 * neighbor.distance_squared / (2.0 * spacing).powi(2)).exp();
                    let plane = in_plane(nodes, i, j, spacing);
                    let alike = nodes.facing(i, j) * nodes.likeness(i, j, params);
                    (neighbor.id, narrow(near * together * plane) * alike)
                })
            })
            .collect();
        let (ids, weights) = lists.into_iter().unzip();
        Self { rigid, points, ids, weights, per_node }
    }

    /// Neighbours of node `i` with weights.
    pub(super) fn of_node(&self, i: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let range = i * self.per_node..(i + 1) * self.per_node;
        let ids = self.ids[range.clone()].iter().map(|&id| id as usize);
        ids.zip(self.weights[range].iter().copied())
    }

    pub(super) fn len(&self) -> usize {
        self.points.len()
    }
}

/// Whether two splats lie in each other's tangent plane, 0 to 1; no effect for balls.
fn in_plane(nodes: &Nodes, a: usize, b: usize, spacing: f64) -> f64 {
    let step = [0, 1, 2].map(|k| nodes.means[b][k] - nodes.means[a][k]);
    let off = |i: usize| {
        let along: f64 = (0..3).map(|k| step[k] * f64::from(nodes.normals[i][k])).sum();
        f64::from(nodes.flatness[i]) * (along / spacing).powi(2)
    };
    (-0.5 * (off(a) + off(b))).exp()
}

#[expect(clippy::cast_possible_truncation, reason = "weights are single precision")]
fn narrow(x: f64) -> f32 {
    x as f32
}
