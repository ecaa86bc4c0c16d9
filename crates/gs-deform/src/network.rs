//! [`HexPlaneField`]: feature planes, trunk and heads of a 4DGaussians deformation network.

use crate::linear::{Linear, Packed};
use crate::{FieldError, Head, HexPlane, Mask};

/// Outputs of the SH head: 16 coefficients of three channels, for any degree in use.
const SH_OUTPUTS: usize = 48;

/// Parameter that a head changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// Centres, 3 outputs.
    Means,
    /// Log-scales, 3 outputs.
    LogScales,
    /// Raw quaternions, 4 outputs.
    Quats,
    /// Opacity logits, 1 output.
    OpacityLogits,
    /// SH coefficients, 48 outputs, coefficient-major.
    Sh,
}

impl Component {
    /// All components, in the order of checkpoints.
    pub const ALL: [Self; 5] =
        [Self::Means, Self::LogScales, Self::Quats, Self::OpacityLogits, Self::Sh];

    /// Number of outputs of the component's head.
    pub const fn num_outputs(self) -> usize {
        match self {
            Self::Means | Self::LogScales => 3,
            Self::Quats => 4,
            Self::OpacityLogits => 1,
            Self::Sh => SH_OUTPUTS,
        }
    }

    /// Name of the component's head in checkpoints.
    pub const fn head_name(self) -> &'static str {
        match self {
            Self::Means => "pos_deform",
            Self::LogScales => "scales_deform",
            Self::Quats => "rotations_deform",
            Self::OpacityLogits => "opacity_deform",
            Self::Sh => "shs_deform",
        }
    }
}

/// Heads in use; a component without a head passes through unchanged and unmasked.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Heads {
    /// Centres.
    pub means: Option<Head>,
    /// Log-scales.
    pub log_scales: Option<Head>,
    /// Quaternions.
    pub quats: Option<Head>,
    /// Opacity logits.
    pub opacity_logits: Option<Head>,
    /// SH coefficients.
    pub sh: Option<Head>,
}

impl Heads {
    /// The head of one component.
    pub fn get(&self, component: Component) -> Option<&Head> {
        match component {
            Component::Means => self.means.as_ref(),
            Component::LogScales => self.log_scales.as_ref(),
            Component::Quats => self.quats.as_ref(),
            Component::OpacityLogits => self.opacity_logits.as_ref(),
            Component::Sh => self.sh.as_ref(),
        }
    }
}

/// The parts of a deformation network as a checkpoint stores them; [`HexPlaneField::new`] verifies
/// that they fit.
#[derive(Debug, Clone, PartialEq)]
pub struct HexPlaneNetwork {
    /// Feature planes.
    pub planes: HexPlane,
    /// Trunk layers: ReLU between them, none after the last. At least one.
    pub trunk: Vec<Linear>,
    /// Heads in use.
    pub heads: Heads,
    /// Factor of the stored parameters.
    pub mask: Mask,
    /// Frequency of the feature encoding `[g, sin(k·g), cos(k·g)]`; 0 means none. 1 cannot be
    /// evaluated.
    pub grid_pe: u32,
    /// Whether quaternions are composed `normalise(q ⊗ dq)` instead of added `q + dq`.
    pub apply_rotation: bool,
}

/// A verified deformation network, ready to evaluate at any time.
#[derive(Debug, Clone)]
pub struct HexPlaneField {
    pub(crate) planes: HexPlane,
    pub(crate) trunk: Vec<Packed>,
    pub(crate) heads: [Option<PackedHead>; 5],
    pub(crate) mask: PackedMask,
    pub(crate) grid_pe: f32,
    pub(crate) apply_rotation: bool,
    pub(crate) width: usize,
}

#[derive(Debug, Clone)]
pub(crate) struct PackedHead {
    pub(crate) hidden: Packed,
    pub(crate) out: Packed,
}

#[derive(Debug, Clone)]
pub(crate) enum PackedMask {
    One,
    StaticMlp(PackedHead),
    EmptyVoxel(crate::EmptyVoxel),
}

impl HexPlaneField {
    /// Verifies that all shapes fit and all values in use are finite.
    ///
    /// # Errors
    /// Names the first tensor that does not fit.
    pub fn new(network: HexPlaneNetwork) -> Result<Self, FieldError> {
        let HexPlaneNetwork { planes, trunk, heads, mask, grid_pe, apply_rotation } = network;
        planes.check()?;
        if grid_pe == 1 {
            return Err(FieldError::Unsupported(
                "grid_pe = 1 builds a layer for encoded features but never encodes them; the reference cannot evaluate it, expected 0 or at least 2"
                    .to_owned(),
            ));
        }
        let mut inputs = planes.num_features() * if grid_pe == 0 { 1 } else { 3 };
        if trunk.is_empty() {
            return Err(FieldError::Shape {
                tensor: "feature_out".to_owned(),
                found: vec![0],
                expected: "at least one layer".to_owned(),
            });
        }
        for (index, layer) in trunk.iter().enumerate() {
            layer.check(&format!("feature_out.{}", 2 * index), inputs, None)?;
            inputs = layer.num_outputs();
        }
        let width = inputs;
        let pack = |name: &str, head: &Head, outputs: usize| -> Result<PackedHead, FieldError> {
            head.hidden.check(&format!("{name}.1"), width, None)?;
            head.out.check(&format!("{name}.3"), head.hidden.num_outputs(), Some(outputs))?;
            Ok(PackedHead { hidden: Packed::new(&head.hidden), out: Packed::new(&head.out) })
        };
        let mut packed = [const { None }; 5];
        for (slot, component) in packed.iter_mut().zip(Component::ALL) {
            if let Some(head) = heads.get(component) {
                *slot = Some(pack(component.head_name(), head, component.num_outputs())?);
            }
        }
        let mask = match mask {
            Mask::One => PackedMask::One,
            Mask::StaticMlp(head) => PackedMask::StaticMlp(pack("static_mlp", &head, 1)?),
            Mask::EmptyVoxel(voxel) => {
                voxel.check()?;
                PackedMask::EmptyVoxel(voxel)
            }
        };
        let trunk = trunk.iter().map(Packed::new).collect();
        #[expect(clippy::cast_precision_loss, reason = "a small frequency")]
        let grid_pe = grid_pe as f32;
        Ok(Self { planes, trunk, heads: packed, mask, grid_pe, apply_rotation, width })
    }

    /// Whether the field deforms `component`.
    pub fn deforms(&self, component: Component) -> bool {
        self.heads[component as usize].is_some()
    }

    /// The feature planes.
    pub fn planes(&self) -> &HexPlane {
        &self.planes
    }

    /// `W`, width of the trunk's output.
    pub fn width(&self) -> usize {
        self.width
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    fn linear(inputs: usize, outputs: usize) -> Linear {
        Linear { weight: vec![0.1; inputs * outputs], bias: vec![0.0; outputs] }
    }

    fn network() -> HexPlaneNetwork {
        let plane = Plane { columns: 2, rows: 2, texels: vec![1.0; 8] };
        HexPlaneNetwork {
            planes: HexPlane {
                aabb: [[1.0; 3], [-1.0; 3]],
                channels: 2,
                levels: vec![std::array::from_fn(|_| plane.clone())],
            },
            trunk: vec![linear(2, 4)],
            heads: Heads {
                means: Some(Head { hidden: linear(4, 4), out: linear(4, 3) }),
                ..Heads::default()
            },
            mask: Mask::One,
            grid_pe: 0,
            apply_rotation: false,
        }
    }

    #[test]
    fn tensors_of_wrong_shape_are_named() {
        assert!(HexPlaneField::new(network()).is_ok(), "fits");
        let mut bad = network();
        bad.trunk[0] = linear(3, 4);
        let error = HexPlaneField::new(bad).unwrap_err().to_string();
        assert!(error.contains("`feature_out.0` has shape [4, 3], expected [4, 2]"), "{error}");
        let mut bad = network();
        bad.heads.means = Some(Head { hidden: linear(4, 4), out: linear(4, 4) });
        let error = HexPlaneField::new(bad).unwrap_err().to_string();
        assert!(error.contains("pos_deform.3"), "{error}");
        let mut bad = network();
        bad.trunk.clear();
        assert!(HexPlaneField::new(bad).is_err(), "no trunk");
        let mut bad = network();
        bad.planes.levels[0][3].texels[1] = f32::INFINITY;
        let error = HexPlaneField::new(bad).unwrap_err().to_string();
        assert!(error.contains("grids.0.3"), "{error}");
    }

    #[test]
    fn grid_pe_of_one_is_refused() {
        let error = HexPlaneField::new(HexPlaneNetwork { grid_pe: 1, ..network() }).unwrap_err();
        assert!(matches!(error, FieldError::Unsupported(_)), "{error}");
        let wide = HexPlaneNetwork { grid_pe: 2, trunk: vec![linear(6, 4)], ..network() };
        assert!(HexPlaneField::new(wide).is_ok(), "three blocks");
    }
}
