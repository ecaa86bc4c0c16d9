//! [`DeformMlp`]: layers and heads of the network.

use super::encoding;
use crate::FieldError;
use crate::linear::{Linear, Packed};

/// Frequencies of the position encoding, the same in every published model.
const POSITION_FREQUENCIES: usize = 10;
/// Largest accepted number of time frequencies; published models have 6 or 10. Above 24,
/// neighbouring frames alias in single precision.
const MAX_TIME_FREQUENCIES: usize = 24;
/// Length of the position encoding.
pub(super) const POSITION: usize = encoding::len(3, POSITION_FREQUENCIES);

/// Head that moves positions.
#[derive(Debug, Clone, PartialEq)]
pub enum Warp {
    /// A translation, 3 outputs.
    Translation(Linear),
    /// Rotational and translational part of a screw motion, 3 outputs each.
    Screw {
        /// `branch_w`.
        rotation: Linear,
        /// `branch_v`.
        translation: Linear,
    },
}

/// The parts of a network as a checkpoint stores them; [`DeformMlp::new`] verifies that they fit.
#[derive(Debug, Clone, PartialEq)]
pub struct DeformMlpParts {
    /// `timenet`: two layers with a ReLU between them, applied to the encoded time.
    pub timenet: Option<[Linear; 2]>,
    /// Hidden layers, a ReLU after each. A layer with more inputs than the previous layer has
    /// outputs takes the encoded position and time as its first inputs (skip connection).
    pub layers: Vec<Linear>,
    /// Head that moves positions.
    pub warp: Warp,
    /// Change of the quaternion, 4 outputs.
    pub rotation: Linear,
    /// Change of the scales, 3 outputs.
    pub scaling: Linear,
    /// Change of the opacity, 1 output, `gaussian_opacity`.
    pub opacity: Option<Linear>,
    /// `gaussian_color`: change of the DC coefficient, 3 outputs, after
    /// hidden layers of its own with a ReLU each.
    pub color: Option<Vec<Linear>>,
    /// Rotation about a control node, 4 outputs, `local_rotation`.
    pub local_rotation: Option<Linear>,
}

/// A verified network.
#[derive(Debug, Clone)]
pub struct DeformMlp {
    pub(super) timenet: Option<[Linear; 2]>,
    pub(super) time_frequencies: usize,
    /// Length of encoded position and time together.
    pub(super) inputs: usize,
    /// Each layer, and whether it has the skip connection.
    pub(super) layers: Vec<(Packed, bool)>,
    pub(super) warp: Vec<Packed>,
    pub(super) rotation: Packed,
    pub(super) scaling: Packed,
    pub(super) opacity: Option<Packed>,
    pub(super) color: Vec<Packed>,
    pub(super) local_rotation: Option<Packed>,
    width: usize,
}

impl DeformMlp {
    /// Verifies that all shapes fit and all values are finite.
    ///
    /// # Errors
    /// Names the first tensor that does not fit.
    pub fn new(parts: DeformMlpParts) -> Result<Self, FieldError> {
        let DeformMlpParts {
            timenet,
            layers,
            warp,
            rotation,
            scaling,
            opacity,
            color,
            local_rotation,
        } = parts;
        let Some(first) = layers.first() else {
            return Err(FieldError::Shape {
                tensor: "linear".to_owned(),
                found: vec![0],
                expected: "at least one layer".to_owned(),
            });
        };
        let inputs = first.num_inputs();
        let time = inputs.checked_sub(POSITION).filter(|&time| time > 0).ok_or_else(|| {
            FieldError::Shape {
                tensor: "linear.0".to_owned(),
                found: vec![first.num_outputs(), inputs],
                expected: format!("more than {POSITION} inputs: encoded position, then time"),
            }
        })?;
        let encoded = match &timenet {
            None => time,
            Some([hidden, out]) => {
                let encoded = hidden.num_inputs();
                hidden.check("timenet.0", encoded, None)?;
                out.check("timenet.2", hidden.num_outputs(), Some(time))?;
                encoded
            }
        };
        let frequencies = (0..=MAX_TIME_FREQUENCIES).find(|&l| encoding::len(1, l) == encoded);
        let time_frequencies = frequencies.ok_or_else(|| {
            FieldError::Unsupported(format!(
                "time is encoded to {encoded} numbers, expected an odd number up to {}; the \
                network comes from a modified version of Deformable-3D-Gaussians",
                encoding::len(1, MAX_TIME_FREQUENCIES)
            ))
        })?;
        let mut packed = Vec::with_capacity(layers.len());
        let mut width = 0;
        for (index, layer) in layers.iter().enumerate() {
            let joined = index > 0 && layer.num_inputs() != width;
            let expected = if joined || index == 0 { inputs + width } else { width };
            layer.check(&format!("linear.{index}"), expected, None)?;
            packed.push((Packed::new(layer), joined));
            width = layer.num_outputs();
        }
        let head = |name: &str, layer: &Linear, outputs: usize| -> Result<Packed, FieldError> {
            layer.check(name, width, Some(outputs))?;
            Ok(Packed::new(layer))
        };
        let warp = match &warp {
            Warp::Translation(layer) => vec![head("gaussian_warp", layer, 3)?],
            Warp::Screw { rotation, translation } => {
                vec![head("branch_w", rotation, 3)?, head("branch_v", translation, 3)?]
            }
        };
        let optional = |name: &str, layer: &Option<Linear>, outputs: usize| {
            layer.as_ref().map(|layer| head(name, layer, outputs)).transpose()
        };
        let mut hidden = width;
        let color = color.unwrap_or_default();
        let last = color.len().saturating_sub(1);
        let mut packed_color = Vec::with_capacity(color.len());
        for (index, layer) in color.iter().enumerate() {
            let outputs = (index == last).then_some(3);
            layer.check(&format!("gaussian_color.{index}"), hidden, outputs)?;
            hidden = layer.num_outputs();
            packed_color.push(Packed::new(layer));
        }
        Ok(Self {
            time_frequencies,
            inputs,
            layers: packed,
            rotation: head("gaussian_rotation", &rotation, 4)?,
            scaling: head("gaussian_scaling", &scaling, 3)?,
            opacity: optional("gaussian_opacity", &opacity, 1)?,
            local_rotation: optional("local_rotation", &local_rotation, 4)?,
            warp,
            color: packed_color,
            timenet,
            width,
        })
    }

    /// Width of the last hidden layer.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of hidden layers.
    pub fn depth(&self) -> usize {
        self.layers.len()
    }

    /// Whether positions move by screw motions instead of translations.
    pub fn is_screw(&self) -> bool {
        self.warp.len() == 2
    }

    /// Whether opacities change with time.
    pub fn changes_opacity(&self) -> bool {
        self.opacity.is_some()
    }

    /// Encoded time, through `timenet` if there is one.
    pub(super) fn time(&self, t: f32) -> Vec<f32> {
        let mut encoded = vec![0.0; encoding::len(1, self.time_frequencies)];
        encoding::encode([t], self.time_frequencies, |k, value| encoded[k] = value);
        match &self.timenet {
            None => encoded,
            Some([hidden, out]) => {
                let relu = product(hidden, &encoded).into_iter().map(|value| value.max(0.0));
                product(out, &relu.collect::<Vec<f32>>())
            }
        }
    }
}

/// `W·x + b` for one input, summed in double precision.
fn product(layer: &Linear, x: &[f32]) -> Vec<f32> {
    let rows = layer.weight.chunks_exact(layer.num_inputs());
    let sum = |(row, bias): (&[f32], &f32)| {
        let terms = row.iter().zip(x).map(|(w, x)| f64::from(*w) * f64::from(*x));
        #[expect(clippy::cast_possible_truncation, reason = "activations are single precision")]
        let sum = (f64::from(*bias) + terms.sum::<f64>()) as f32;
        sum
    };
    rows.zip(&layer.bias).map(sum).collect()
}
