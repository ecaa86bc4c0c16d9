//! [`HashGridField`]: grid, trunk and heads of a Swift4D deformation network.

use super::grid::HashGrid;
use crate::FieldError;
use crate::linear::{Activation, Linear, Packed};
use crate::network::Component;

/// The box in which a field is defined, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldBox {
    /// Corner with the smallest coordinates.
    pub min: [f32; 3],
    /// Corner with the largest coordinates.
    pub max: [f32; 3],
}

impl FieldBox {
    /// Verifies that no edge is empty or infinite.
    ///
    /// # Errors
    /// The message contains both corners.
    pub fn check(&self) -> Result<(), FieldError> {
        let proper = (0..3).all(|axis| {
            let edge = self.max[axis] - self.min[axis];
            edge.is_finite() && edge > 0.0
        });
        let (maximum, minimum) = (self.max, self.min);
        if proper { Ok(()) } else { Err(FieldError::Box { maximum, minimum }) }
    }

    /// Position in the box, 0 to 1 on each axis, of a world point; `None` outside, where nothing
    /// moves. The faces belong to the box. Uses the reference's order of operations, so that points
    /// within an ulp of a face are classified the same.
    pub fn normalize(&self, mean: [f32; 3]) -> Option<[f32; 3]> {
        let coords: [f32; 3] = std::array::from_fn(|axis| {
            let (min, max) = (self.min[axis], self.max[axis]);
            (mean[axis] - min) / (max - min)
        });
        coords.iter().all(|c| (0.0..=1.0).contains(c)).then_some(coords)
    }
}

/// The parts of a network as a checkpoint stores them; [`HashGridField::new`] verifies that they
/// fit. Checkpoints have no biases: pass zeros.
#[derive(Debug, Clone, PartialEq)]
pub struct HashGridNetwork {
    /// Box in which the field is defined.
    pub bounds: FieldBox,
    /// Features.
    pub grid: HashGrid,
    /// `[N, L·F]` with a ReLU after it, then `[N, N]`.
    pub trunk: [Linear; 2],
    /// Whether a ReLU also follows the trunk.
    pub trunk_relu: bool,
    /// In the order of [`Component::ALL`]: `[N, N]`, ReLU, `[N, N]`, ReLU, `[outputs, N]`.
    pub heads: [[Linear; 3]; 5],
}

/// A verified deformation network, ready to evaluate at any time.
#[derive(Debug, Clone)]
pub struct HashGridField {
    bounds: FieldBox,
    pub(super) grid: HashGrid,
    pub(super) trunk: [Packed; 2],
    pub(super) trunk_end: Activation,
    pub(super) heads: [[Packed; 3]; 5],
    width: usize,
}

impl HashGridField {
    /// Verifies that all shapes fit and all values are finite.
    ///
    /// # Errors
    /// Names the first tensor that does not fit.
    pub fn new(network: HashGridNetwork) -> Result<Self, FieldError> {
        let HashGridNetwork { bounds, grid, trunk, trunk_relu, heads } = network;
        bounds.check()?;
        let width = trunk[0].num_outputs();
        trunk[0].check("trunk.0", grid.shape().num_features(), None)?;
        trunk[1].check("trunk.1", width, Some(width))?;
        for (component, layers) in Component::ALL.into_iter().zip(&heads) {
            let outputs = [width, width, component.num_outputs()];
            for (index, (layer, outputs)) in layers.iter().zip(outputs).enumerate() {
                layer.check(&format!("{component:?} head.{index}"), width, Some(outputs))?;
            }
        }
        let pack = |layer: &Linear| Packed::new(layer);
        Ok(Self {
            bounds,
            grid,
            trunk: trunk.each_ref().map(pack),
            trunk_end: if trunk_relu { Activation::Relu } else { Activation::None },
            heads: heads.each_ref().map(|head| head.each_ref().map(pack)),
            width,
        })
    }

    /// The features.
    pub fn grid(&self) -> &HashGrid {
        &self.grid
    }

    /// `N`, width of all layers.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Box in which the field is defined.
    pub fn bounds(&self) -> &FieldBox {
        &self.bounds
    }
}
