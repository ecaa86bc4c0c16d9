//! [`Body`]: a surface with its colours.

use crate::{
    paint::{Material, Spot},
    part::Part,
    shape::Shape,
    skeleton::Attach,
};
use glam::Vec3;

/// A surface with its colours.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub(crate) part: Part,
    pub(crate) shape: Shape,
    pub(crate) paint: fn(&Spot) -> Material,
    /// Splats per area relative to the other bodies of its group.
    pub(crate) density: f32,
    pub(crate) keep: fn(Vec3) -> bool,
    /// Attachment of all points, instead of that of [`crate::figure::attach`].
    pub(crate) carrier: Option<Attach>,
}

impl Body {
    pub(crate) fn new(part: Part, shape: Shape, paint: fn(&Spot) -> Material) -> Self {
        Self { part, shape, paint, density: 1.0, keep: |_| true, carrier: None }
    }

    pub(crate) fn denser(mut self, density: f32) -> Self {
        self.density = density;
        self
    }

    pub(crate) fn cut(mut self, keep: fn(Vec3) -> bool) -> Self {
        self.keep = keep;
        self
    }

    pub(crate) fn carried_by(mut self, carrier: Attach) -> Self {
        self.carrier = Some(carrier);
        self
    }
}
