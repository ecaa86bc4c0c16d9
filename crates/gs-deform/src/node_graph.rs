//! [`NodeGraphScene`]: splats driven by control nodes, as in SC-GS.

use crate::deform_mlp::{DeformMlp, MlpOutputs};
use crate::{FieldError, shape};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, activation, quat};
use rayon::prelude::*;

/// Opacities are clamped to this distance from 0 and 1, so that their logits are finite.
const OPACITY_MARGIN: f32 = 1e-6;
/// Added to each weight before normalisation.
const WEIGHT_FLOOR: f32 = 1e-7;

/// Control nodes, and the binding of splats to them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodeGraph {
    /// Coordinates of the nodes: position, then hyper coordinates, `[M, D]` row-major.
    pub nodes: Vec<f32>,
    /// `D ≥ 3`.
    pub dims: usize,
    /// Logarithms of the nodes' radii, `[M]`.
    pub log_radii: Vec<f32>,
    /// Logits of the nodes' weights, `[M]`.
    pub weight_logits: Vec<f32>,
    /// Hyper coordinates of the splats, `[N, D − 3]` row-major.
    pub hyper: Vec<f32>,
    /// Share of the motion applied to each splat, 0 to 1, `[N]`; empty if 1 for all.
    pub masks: Vec<f32>,
    /// Number of nearest nodes that drive a splat.
    pub neighbors: usize,
    /// Bound of the scale change as a factor, if the network was trained with
    /// one: the change is then `tanh(d)·ln(bound)`.
    pub max_scale: Option<f32>,
}

/// Splats driven by their nearest nodes: a model of SC-GS, at times 0 to 1.
///
/// The network is evaluated at the nodes; each splat takes a weighted mean of the outputs at its
/// nearest nodes. Rotations are normalised after the change is added to the stored quaternion;
/// scale changes are added to activated scales.
#[derive(Debug)]
pub struct NodeGraphScene {
    canonical: Splats,
    graph: NodeGraph,
    mlp: DeformMlp,
    positions: Vec<[f32; 3]>,
    /// `[N, K]`.
    indices: Vec<u32>,
    weights: Vec<f32>,
}

impl NodeGraphScene {
    /// A scene from its parts; finds the nodes that drive each splat.
    ///
    /// # Errors
    /// Names the first array that does not fit or is not finite.
    pub fn new(canonical: Splats, graph: NodeGraph, mlp: DeformMlp) -> Result<Self, FieldError> {
        canonical.check_shapes()?;
        let (n, dims) = (canonical.len(), graph.dims);
        let wrong = |tensor: &str, found: Vec<usize>, expected: String| {
            Err(FieldError::Shape { tensor: tensor.to_owned(), found, expected })
        };
        let count = graph.log_radii.len();
        if dims < 3 || graph.nodes.len() != count * dims || count < graph.neighbors.max(1) {
            let found = vec![graph.nodes.len().checked_div(dims).unwrap_or(0), dims];
            let minimum = graph.neighbors.max(1);
            return wrong(
                "nodes",
                found,
                format!("[{count}, 3 or more], at least {minimum} nodes"),
            );
        }
        if graph.weight_logits.len() != count {
            return wrong("_node_weight", vec![graph.weight_logits.len()], format!("[{count}]"));
        }
        if graph.hyper.len() != n * (dims - 3) {
            return wrong("fea", vec![graph.hyper.len()], format!("[{n}, {}]", dims - 3));
        }
        if !graph.masks.is_empty() && graph.masks.len() != n {
            return wrong("motion mask", vec![graph.masks.len()], format!("[{n}]"));
        }
        let arrays: [(&str, &[f32]); 5] = [
            ("nodes", &graph.nodes),
            ("_node_radius", &graph.log_radii),
            ("_node_weight", &graph.weight_logits),
            ("fea", &graph.hyper),
            ("motion mask", &graph.masks),
        ];
        for (name, values) in arrays {
            if !values.iter().all(|value| value.is_finite()) {
                return Err(FieldError::NotFinite { tensor: name.to_owned() });
            }
        }
        let positions =
            graph.nodes.chunks_exact(dims).map(|node| [node[0], node[1], node[2]]).collect();
        let (indices, weights) = bind(&canonical, &graph);
        Ok(Self { canonical, graph, mlp, positions, indices, weights })
    }

    /// The stored splats, before any deformation.
    pub fn canonical(&self) -> &Splats {
        &self.canonical
    }

    /// The nodes.
    pub fn graph(&self) -> &NodeGraph {
        &self.graph
    }

    /// The network.
    pub fn mlp(&self) -> &DeformMlp {
        &self.mlp
    }

    /// Nodes that drive splat `row`, nearest first, and their weights, which sum to 1.
    pub fn bonds(&self, row: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let bonds = row * self.graph.neighbors..(row + 1) * self.graph.neighbors;
        self.indices[bonds.clone()]
            .iter()
            .map(|&node| node as usize)
            .zip(self.weights[bonds].iter().copied())
    }

    fn mask(&self, row: usize) -> f32 {
        self.graph.masks.get(row).copied().unwrap_or(1.0)
    }

    fn mean(&self, row: usize, outputs: &MlpOutputs, frames: &[[f32; 4]]) -> [f32; 3] {
        let x = self.canonical.means[row];
        let mut change = [0.0; 3];
        for (node, weight) in self.bonds(row) {
            let warp = outputs.warp[node];
            let by = match frames.get(node) {
                None => [warp[0], warp[1], warp[2]],
                Some(&frame) => {
                    // The splat rotates about the node and translates with it.
                    let centre = self.positions[node];
                    let arm = [0, 1, 2].map(|k| x[k] - centre[k]);
                    let rotated = quat::rotate(frame, arm);
                    [0, 1, 2].map(|k| rotated[k] - arm[k] + warp[k])
                }
            };
            for k in 0..3 {
                change[k] += weight * by[k];
            }
        }
        let mask = self.mask(row);
        [0, 1, 2].map(|k| x[k] + mask * change[k])
    }

    fn blend<const D: usize>(&self, row: usize, values: &[[f32; D]]) -> [f32; D] {
        let mut sum = [0.0; D];
        for (node, weight) in self.bonds(row) {
            for (sum, value) in sum.iter_mut().zip(values[node]) {
                *sum += weight * value;
            }
        }
        let mask = self.mask(row);
        sum.map(|value| mask * value)
    }

    fn outputs(&self, t: f32) -> Result<MlpOutputs, SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        let mut outputs = self.mlp.outputs(&self.positions, t);
        if let Some(bound) = self.graph.max_scale {
            let limit = bound.ln();
            for change in outputs.scaling.as_flattened_mut() {
                *change = change.tanh() * limit;
            }
        }
        Ok(outputs)
    }

    fn geometry(&self, outputs: &MlpOutputs, out: &mut Splats) {
        let frames: Vec<[f32; 4]> = outputs
            .local_rotation
            .iter()
            .map(|&[w, x, y, z]| quat::normalize([w + 1.0, x, y, z]))
            .collect();
        let rows = || (0..self.canonical.len()).into_par_iter();
        rows().map(|row| self.mean(row, outputs, &frames)).collect_into_vec(&mut out.means);
        rows()
            .map(|row| {
                let change = self.blend(row, &outputs.rotation);
                let stored = self.canonical.quats[row];
                quat::normalize(std::array::from_fn(|k| stored[k] + change[k]))
            })
            .collect_into_vec(&mut out.quats);
        rows()
            .map(|row| {
                let change = self.blend(row, &outputs.scaling);
                let stored = self.canonical.log_scales[row];
                std::array::from_fn(|k| shape::log_scale(stored[k].exp() + change[k]))
            })
            .collect_into_vec(&mut out.log_scales);
    }
}

/// The nearest nodes of each splat, nearest first, and their weights.
fn bind(canonical: &Splats, graph: &NodeGraph) -> (Vec<u32>, Vec<f32>) {
    let (dims, neighbors) = (graph.dims, graph.neighbors);
    let hyper = dims - 3;
    let rows: Vec<Vec<(u32, f32)>> = (0..canonical.len())
        .into_par_iter()
        .map(|row| {
            let own = &graph.hyper[row * hyper..(row + 1) * hyper];
            let point = || canonical.means[row].iter().chain(own);
            let mut nearest: Vec<(f32, u32)> = Vec::with_capacity(neighbors + 1);
            for (index, node) in (0_u32..).zip(graph.nodes.chunks_exact(dims)) {
                let squares = point().zip(node).map(|(a, b)| (a - b) * (a - b));
                let distance: f32 = squares.sum();
                let at = nearest.partition_point(|(other, _)| *other <= distance);
                if at < neighbors {
                    nearest.insert(at, (distance, index));
                    nearest.truncate(neighbors);
                }
            }
            let raw: Vec<f32> = nearest
                .iter()
                .map(|&(squared, node)| {
                    let radius = graph.log_radii[node as usize].exp();
                    let near = (-squared / (2.0 * radius * radius)).exp();
                    let weight = activation::sigmoid(graph.weight_logits[node as usize]);
                    near * weight + WEIGHT_FLOOR
                })
                .collect();
            let total: f32 = raw.iter().sum();
            nearest.iter().zip(raw).map(|(&(_, node), weight)| (node, weight / total)).collect()
        })
        .collect();
    rows.into_iter().flatten().unzip()
}

impl DynamicScene for NodeGraphScene {
    fn num_splats(&self) -> usize {
        self.canonical.len()
    }

    fn sh_degree(&self) -> usize {
        self.canonical.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let outputs = self.outputs(t)?;
        self.geometry(&outputs, out);
        out.opacity_logits.clone_from(&self.canonical.opacity_logits);
        out.sh.clone_from(&self.canonical.sh);
        out.sh_degree = self.canonical.sh_degree;
        if !outputs.opacity.is_empty() {
            let changes: Vec<[f32; 1]> = outputs.opacity.iter().map(|&change| [change]).collect();
            out.opacity_logits.par_iter_mut().enumerate().for_each(|(row, logit)| {
                let [change] = self.blend(row, &changes);
                let opacity = activation::sigmoid(*logit) + change;
                *logit = activation::logit(opacity.clamp(OPACITY_MARGIN, 1.0 - OPACITY_MARGIN));
            });
        }
        if !outputs.color.is_empty() {
            let coeffs = self.canonical.sh_coeffs();
            out.sh.par_chunks_mut(coeffs).enumerate().for_each(|(row, sh)| {
                let change = self.blend(row, &outputs.color);
                for (channel, change) in sh[0].iter_mut().zip(change) {
                    *channel += change;
                }
            });
        }
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let outputs = self.outputs(t)?;
        self.geometry(&outputs, out);
        Ok(())
    }

    fn fades(&self) -> bool {
        self.mlp.changes_opacity()
    }
}
