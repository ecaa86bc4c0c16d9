//! Builds a deformation network from named tensors.

use super::flags::Flags;
use super::network_shape::NetworkShape;
use crate::pth::{self, Tensor};
use gs_deform::{
    Component, EmptyVoxel, Head, Heads, HexPlane, HexPlaneNetwork, Linear, Mask, Plane,
};
use std::collections::BTreeMap;

const PREFIX: &str = "deformation_net.";

/// Tensors by name.
#[derive(Debug)]
pub(super) struct Tensors<'a> {
    by_name: BTreeMap<String, Tensor<'a>>,
}

impl<'a> Tensors<'a> {
    /// Strips the prefixes of wrapping modules from the names. The
    /// last of equal names is used, as in Python.
    pub(super) fn new(tensors: Vec<(String, Tensor<'a>)>) -> Self {
        let known = [format!("{PREFIX}grid.aabb")];
        let tensors = pth::siblings_of(tensors, &[&known[0]]);
        Self { by_name: tensors.into_iter().collect() }
    }

    fn get(&self, name: &str) -> Option<&Tensor<'a>> {
        self.by_name.get(&format!("{PREFIX}{name}"))
    }

    fn need(&self, name: &str) -> Result<&Tensor<'a>, String> {
        self.get(name).ok_or_else(|| format!("has no tensor `{PREFIX}{name}`"))
    }

    fn has(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    /// Number of consecutive names.
    fn count(&self, name: impl Fn(usize) -> String) -> usize {
        // At most the number of tensors.
        (0..self.by_name.len()).take_while(|&index| self.has(&name(index))).count()
    }

    /// Infers the shape of the network from the tensors.
    pub(super) fn shape(&self) -> Result<NetworkShape, String> {
        if !(self.has("grid.aabb") && self.has("grid.grids.0.0")) {
            let names: Vec<&str> = self.by_name.keys().map(String::as_str).take(4).collect();
            return Err(format!(
                "is not the deformation network of 4DGaussians: it has no `{PREFIX}grid.aabb` and `{PREFIX}grid.grids.0.0`, but {} tensors ({}{})",
                self.by_name.len(),
                names.join(", "),
                if self.by_name.len() > names.len() { ", …" } else { "" }
            ));
        }
        let &[1, channels, _, _] = self.need("grid.grids.0.0")?.shape() else {
            return Err(format!(
                "its plane grids.0.0 has shape {:?}, expected [1, C, R, R]",
                self.need("grid.grids.0.0")?.shape()
            ));
        };
        let levels = self.count(|l| format!("grid.grids.{l}.0"));
        let depth = self.count(|d| format!("feature_out.{}.weight", 2 * d));
        let first = self.need("feature_out.0.weight")?;
        let &[_, inputs] = first.shape() else {
            return Err(format!(
                "feature_out.0.weight has shape {:?}, expected two axes",
                first.shape()
            ));
        };
        let features = levels * channels;
        if inputs != features && inputs == 4 {
            return Err("was trained with no_grid, which the reference implementation cannot evaluate either".to_owned());
        }
        let last = self.need(&format!("feature_out.{}.weight", 2 * (depth - 1)))?;
        Ok(NetworkShape {
            width: last.shape().first().copied().unwrap_or(0),
            channels,
            levels,
            depth,
            // Any other width is rejected, with the tensor's name, when the network is built.
            encoded: inputs == 3 * features,
            has_sh_head: self.has("shs_deform.1.weight"),
            has_static_mlp: self.has("static_mlp.1.weight"),
            has_empty_voxel: self.has("empty_voxel.grid"),
        })
    }

    /// The network with the heads enabled by the flags.
    pub(super) fn network(
        &self,
        shape: &NetworkShape,
        flags: &Flags,
    ) -> Result<HexPlaneNetwork, String> {
        let mut heads = Heads::default();
        for component in Component::ALL {
            if !flags.deform[component as usize] {
                continue;
            }
            if component == Component::Sh && !shape.has_sh_head {
                return Err(
                    "has no SH head (revisions before November 2023 had none); leave no_dshs on"
                        .to_owned(),
                );
            }
            let head = Some(self.head(component.head_name())?);
            match component {
                Component::Means => heads.means = head,
                Component::LogScales => heads.log_scales = head,
                Component::Quats => heads.quats = head,
                Component::OpacityLogits => heads.opacity_logits = head,
                Component::Sh => heads.sh = head,
            }
        }
        let trunk = (0..shape.depth).map(|d| self.linear(&format!("feature_out.{}", 2 * d)));
        let mask = if shape.has_static_mlp {
            Mask::StaticMlp(self.head("static_mlp")?)
        } else if shape.has_empty_voxel {
            Mask::EmptyVoxel(self.voxel()?)
        } else {
            Mask::One
        };
        Ok(HexPlaneNetwork {
            planes: self.planes(shape)?,
            trunk: trunk.collect::<Result<_, _>>()?,
            heads,
            mask,
            grid_pe: flags.grid_pe,
            apply_rotation: flags.apply_rotation,
        })
    }

    fn planes(&self, shape: &NetworkShape) -> Result<HexPlane, String> {
        let aabb = self.need("grid.aabb")?;
        let corners = aabb.to_f32s();
        if aabb.shape() != [2, 3] {
            return Err(format!("grid.aabb has shape {:?}, expected [2, 3]", aabb.shape()));
        }
        let mut levels = Vec::new();
        for level in 0..shape.levels {
            let plane = |p: usize| self.plane(&format!("grid.grids.{level}.{p}"), shape.channels);
            levels.push([plane(0)?, plane(1)?, plane(2)?, plane(3)?, plane(4)?, plane(5)?]);
        }
        let corner = |row: usize| std::array::from_fn(|axis| corners[3 * row + axis]);
        Ok(HexPlane { aabb: [corner(0), corner(1)], channels: shape.channels, levels })
    }

    fn plane(&self, name: &str, expected: usize) -> Result<Plane, String> {
        let tensor = self.need(name)?;
        let &[1, channels, rows, columns] = tensor.shape() else {
            return Err(format!("{name} has shape {:?}, expected [1, C, R, R]", tensor.shape()));
        };
        if channels != expected {
            return Err(format!("{name} has {channels} channels, expected {expected}"));
        }
        Plane::from_channels_first(&tensor.to_f32s(), channels, rows, columns)
            .map_err(|error| format!("{name}: {error}"))
    }

    fn voxel(&self) -> Result<EmptyVoxel, String> {
        let grid = self.need("empty_voxel.grid")?;
        let resolution = match *grid.shape() {
            [1, 1, x, y, z] if x == y && y == z => x,
            _ => {
                return Err(format!(
                    "empty_voxel.grid has shape {:?}, expected [1, 1, R, R, R]",
                    grid.shape()
                ));
            }
        };
        let corner = |name: &str| match self.need(name)?.to_f32s()[..] {
            [x, y, z] => Ok([x, y, z]),
            ref other => Err(format!("{name} has {} values, expected 3", other.len())),
        };
        Ok(EmptyVoxel {
            grid: grid.to_f32s(),
            resolution,
            xyz_min: corner("empty_voxel.xyz_min")?,
            xyz_max: corner("empty_voxel.xyz_max")?,
        })
    }

    fn head(&self, name: &str) -> Result<Head, String> {
        Ok(Head {
            hidden: self.linear(&format!("{name}.1"))?,
            out: self.linear(&format!("{name}.3"))?,
        })
    }

    fn linear(&self, name: &str) -> Result<Linear, String> {
        let weight = self.need(&format!("{name}.weight"))?;
        let bias = self.need(&format!("{name}.bias"))?;
        match (weight.shape(), bias.shape()) {
            (&[outputs, inputs], &[biases]) if outputs == biases && inputs > 0 => {
                Ok(Linear { weight: weight.to_f32s(), bias: bias.to_f32s() })
            }
            _ => Err(format!(
                "{name} has weights {:?} and biases {:?}, expected [outputs, inputs] and [outputs]",
                weight.shape(),
                bias.shape()
            )),
        }
    }

    /// Whether the weights of layer 1 of a head are within the bounds of random initialisation,
    /// which suggests that it was not trained; only a hint, because weights that barely changed are
    /// also within them. `None` without such a head.
    pub(super) fn looks_untrained(&self, head: &str, width: usize) -> Option<bool> {
        let largest = |name: &str| {
            let values = self.get(name)?.to_f32s();
            Some(values.iter().fold(0.0_f64, |m, v| m.max(f64::from(v.abs()))))
        };
        let weight = largest(&format!("{head}.1.weight"))? / (6.0 / (2.0 * width as f64)).sqrt();
        let bias = largest(&format!("{head}.1.bias"))? * (width as f64).sqrt();
        // Allows for the rounding of single-precision bounds.
        Some(weight <= 1.0 + 1e-6 && bias <= 1.0 + 1e-6)
    }
}
