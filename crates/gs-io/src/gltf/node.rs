//! Nodes: placement of meshes in the scene.

use super::GltfError;
use super::document::{Document, Node};
use glam::{DMat3, DMat4, DQuat, DVec3};

/// Tolerance for the column products and the determinant of a
/// rotation; hand-written matrices have few decimal places.
const SLACK: f64 = 1e-3;

/// A mesh and its placement in the scene: scaled by `scale` along the mesh's
/// axes, then rotated by `rotation`, then translated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    pub(super) mesh: usize,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
    pub(super) translation: DVec3,
}

/// Every mesh with at least one primitive for which `wanted` is true, once per node of the default
/// scene that uses it, depth first. In a file without nodes, meshes are used untransformed.
pub(super) fn placements(
    document: &Document,
    wanted: &dyn Fn(usize) -> bool,
) -> Result<Vec<Placement>, GltfError> {
    let nodes = &document.nodes;
    let mut found = Vec::new();
    let mut open: Vec<(usize, DMat4)> =
        roots(document)?.into_iter().rev().map(|node| (node, DMat4::IDENTITY)).collect();
    let mut seen = vec![false; nodes.len()];
    while let Some((index, parent)) = open.pop() {
        let node = nodes.get(index).ok_or_else(|| damaged(format!("node {index} is missing")))?;
        // The specification requires a tree; this also ends cycles.
        if std::mem::replace(&mut seen[index], true) {
            return Err(damaged(format!("node {index} has two parents or is below itself")));
        }
        let global = parent * local(node);
        if let Some(mesh) = node.mesh.filter(|&mesh| wanted(mesh)) {
            found.push(Placement::of(mesh, &global, node, index)?);
        }
        open.extend(node.children.iter().rev().map(|&child| (child, global)));
    }
    if nodes.is_empty() {
        let still = |mesh| Placement {
            mesh,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
            translation: DVec3::ZERO,
        };
        found.extend((0..document.meshes.len()).filter(|&mesh| wanted(mesh)).map(still));
    }
    Ok(found)
}

/// Roots of the default scene; without scenes, the nodes that are not children.
fn roots(document: &Document) -> Result<Vec<usize>, GltfError> {
    if document.scenes.is_empty() {
        let mut child = vec![false; document.nodes.len()];
        for &index in document.nodes.iter().flat_map(|node| &node.children) {
            if let Some(slot) = child.get_mut(index) {
                *slot = true;
            }
        }
        return Ok((0..child.len()).filter(|&index| !child[index]).collect());
    }
    let index = document.scene.unwrap_or_default();
    let scene = document.scenes.get(index);
    Ok(scene.ok_or_else(|| damaged(format!("scene {index} is missing")))?.nodes.clone())
}

fn damaged(what: String) -> GltfError {
    GltfError::damaged(what)
}

fn local(node: &Node) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return DMat4::from_cols_array(matrix);
    }
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |[x, y, z, w]| {
        let q = DQuat::from_xyzw(x, y, z, w);
        if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
    });
    let scale = node.scale.map_or(DVec3::ONE, DVec3::from_array);
    DMat4::from_scale_rotation_translation(scale, rotation, node.translation.into())
}

impl Placement {
    /// Decomposes a matrix into a rotation, a positive scale along each axis, and a translation.
    /// Other matrices cannot be applied to splats.
    fn of(mesh: usize, global: &DMat4, node: &Node, index: usize) -> Result<Self, GltfError> {
        let refused = |why: &str| {
            damaged(format!(
                "node {index} `{}` {why}, which cannot be applied to Gaussians; apply its \
                transformation in the program that made it",
                node.name
            ))
        };
        if !global.is_finite() {
            return Err(refused("has a matrix that is not finite"));
        }
        let linear = DMat3::from_mat4(*global);
        let columns = [linear.x_axis, linear.y_axis, linear.z_axis];
        let scale = DVec3::from_array(columns.map(DVec3::length));
        if scale.min_element() <= 0.0 || !scale.is_finite() {
            return Err(refused("is scaled to zero"));
        }
        let [x, y, z] = [columns[0] / scale.x, columns[1] / scale.y, columns[2] / scale.z];
        if [x.dot(y), y.dot(z), z.dot(x)].iter().any(|product| product.abs() > SLACK) {
            return Err(refused("is sheared"));
        }
        if (x.cross(y).dot(z) - 1.0).abs() > SLACK {
            return Err(refused("is mirrored"));
        }
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize();
        Ok(Self { mesh, rotation, scale, translation: global.w_axis.truncate() })
    }

    /// Whether this is the identity.
    pub(super) fn is_still(&self) -> bool {
        self.rotation.w.abs() >= 1.0 && self.scale == DVec3::ONE && self.translation == DVec3::ZERO
    }

    /// The factor, if it is the same along all axes.
    pub(super) fn uniform_scale(&self) -> Option<f64> {
        let factor = self.scale.x;
        let same = (self.scale - factor).abs().max_element() <= 1e-6 * factor;
        same.then_some(factor)
    }

    /// A point of the mesh in the scene.
    pub(super) fn point(&self, local: DVec3) -> DVec3 {
        self.rotation * (self.scale * local) + self.translation
    }
}
