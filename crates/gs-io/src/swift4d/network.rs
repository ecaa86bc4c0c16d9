//! Builds a hash-grid network from the flat tensors of `FDHash.pth`.

use super::Swift4dError;
use super::settings::Settings;
use crate::pth::{self, Tensor};
use gs_deform::{Component, FieldBox, GridShape, HashGrid, HashGridNetwork, IndexRule, Linear};
use half::slice::HalfFloatSliceExt;
use std::collections::BTreeMap;

/// Heads in the order of `Component::ALL`.
pub(super) const HEADS: [&str; 5] =
    ["xyz_deform", "scales_deform", "rotations_deform", "opacity_deform", "shs_deform"];
const ENCODER: &str = "enc_model";
/// Supported widths of fused layers.
const WIDTHS: [usize; 4] = [16, 32, 64, 128];
/// Inputs and outputs of fused layers are padded to multiples of this.
const PADDING: usize = 16;

/// The tensors of the file.
#[derive(Debug)]
pub(super) struct Params<'a> {
    by_name: BTreeMap<String, Tensor<'a>>,
    width: usize,
}

/// Number of parameters of a head: two square layers and the output layer.
fn head_len(width: usize, component: Component) -> usize {
    2 * width * width + component.num_outputs().next_multiple_of(PADDING) * width
}

impl<'a> Params<'a> {
    /// Infers the width from the heads, which must all agree.
    pub(super) fn new(tensors: Vec<(String, Tensor<'a>)>) -> Result<Self, Swift4dError> {
        let tensors = pth::siblings_of(tensors, &["enc_model.params"]);
        let mut params = Self { by_name: tensors.into_iter().collect(), width: 0 };
        if !HEADS.iter().chain([&ENCODER]).any(|name| params.get(name).is_some()) {
            let names: Vec<&str> = params.by_name.keys().map(String::as_str).take(4).collect();
            return Err(Swift4dError::Network(format!(
                "is not the field of a Swift4D model: it has no `{ENCODER}.params`, but {} tensors ({})",
                params.by_name.len(),
                names.join(", ")
            )));
        }
        let first = params.need(HEADS[0])?.len();
        let fits = |width: &usize| head_len(*width, Component::Means) == first;
        params.width = WIDTHS.into_iter().find(fits).ok_or_else(|| {
            Swift4dError::Network(format!(
                "`{}.params` has {first} values, which matches no width of fused layers (16, 32, \
                64 or 128)",
                HEADS[0]
            ))
        })?;
        for (name, component) in HEADS.into_iter().zip(Component::ALL) {
            let (found, expected) = (params.need(name)?.len(), head_len(params.width, component));
            if found != expected {
                return Err(Swift4dError::Network(format!(
                    "`{name}.params` has {found} values, expected {expected} for width {}",
                    params.width
                )));
            }
        }
        params.need(ENCODER)?;
        Ok(params)
    }

    /// `N`.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Length of `enc_model.params`: trunk, then table.
    pub(super) fn encoder_len(&self) -> usize {
        self.get(ENCODER).map_or(0, Tensor::len)
    }

    /// Expected length for a grid with a valid shape.
    pub(super) fn expected_len(&self, shape: &GridShape) -> usize {
        self.trunk_len(shape) + shape.num_entries() * shape.features
    }

    fn trunk_len(&self, shape: &GridShape) -> usize {
        self.width * (shape.num_features().next_multiple_of(PADDING) + self.width)
    }

    fn get(&self, name: &str) -> Option<&Tensor<'a>> {
        self.by_name.get(&format!("{name}.params"))
    }

    fn need(&self, name: &str) -> Result<&Tensor<'a>, Swift4dError> {
        self.get(name)
            .ok_or_else(|| Swift4dError::Network(format!("has no tensor `{name}.params`")))
    }

    /// Parameters as evaluated by the reference: rounded to half precision, keeping subnormals.
    fn halves(&self, name: &str) -> Result<Vec<f32>, Swift4dError> {
        let mut values = self.need(name)?.to_f32s();
        let mut halves = [half::f16::ZERO; 1024];
        for chunk in values.chunks_mut(halves.len()) {
            let halves = &mut halves[..chunk.len()];
            halves.convert_from_f32_slice(chunk);
            halves.convert_to_f32_slice(chunk);
        }
        Ok(values)
    }

    /// The stored box; Gaussians of the PLY may be outside.
    pub(super) fn bounds(&self) -> Result<FieldBox, Swift4dError> {
        let corner = |name: &str| {
            let wrong = Swift4dError::Network;
            let tensor =
                self.by_name.get(name).ok_or_else(|| wrong(format!("has no tensor `{name}`")))?;
            match tensor.to_f32s()[..] {
                [x, y, z] => Ok([x, y, z]),
                ref other => Err(wrong(format!("`{name}` has {} values, expected 3", other.len()))),
            }
        };
        Ok(FieldBox { min: corner("xyz_bound_min")?, max: corner("xyz_bound_max")? })
    }

    /// The network, under the current index rule.
    pub(super) fn network(
        &self,
        bounds: FieldBox,
        settings: &Settings,
    ) -> Result<HashGridNetwork, Swift4dError> {
        let shape = settings.shape;
        let mut encoder = self.halves(ENCODER)?;
        if encoder.len() != self.expected_len(&shape) {
            return Err(Swift4dError::Network(format!(
                "`{ENCODER}.params` has {} values, expected {}",
                encoder.len(),
                self.expected_len(&shape)
            )));
        }
        let table = encoder.split_off(self.trunk_len(&shape));
        let (inputs, width) = (shape.num_features(), self.width);
        let padded = inputs.next_multiple_of(PADDING);
        let (first, second) = encoder.split_at(width * padded);
        let heads = HEADS.into_iter().zip(Component::ALL).map(|(name, component)| {
            let values = self.halves(name)?;
            let (hidden, out) = values.split_at(2 * width * width);
            let (first, second) = hidden.split_at(width * width);
            Ok([
                layer(first, width, width, width),
                layer(second, width, width, width),
                layer(out, width, width, component.num_outputs()),
            ])
        });
        let heads: Vec<[Linear; 3]> = heads.collect::<Result<_, Swift4dError>>()?;
        let [means, log_scales, quats, opacity, sh] = &heads[..] else {
            return Err(Swift4dError::Network(format!("has {} heads, expected 5", heads.len())));
        };
        Ok(HashGridNetwork {
            bounds,
            grid: HashGrid::new(shape, IndexRule::Current, table)?,
            trunk: [layer(first, padded, inputs, width), layer(second, width, width, width)],
            trunk_relu: settings.trunk_relu,
            heads: [means, log_scales, quats, opacity, sh].map(Clone::clone),
        })
    }
}

/// The first `outputs` rows and `inputs` columns of a matrix with
/// rows of `padded` values. There are no biases.
fn layer(values: &[f32], padded: usize, inputs: usize, outputs: usize) -> Linear {
    let rows = values.chunks_exact(padded).take(outputs);
    let weight = rows.flat_map(|row| &row[..inputs]).copied().collect();
    Linear { weight, bias: vec![0.0; outputs] }
}
