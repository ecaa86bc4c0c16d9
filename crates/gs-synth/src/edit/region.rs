//! [`Region`]: which splats an edit touches.

use crate::part::Part;
use glam::Vec3;

/// Which splats an edit touches: those of some parts, inside an optional ball.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Body parts.
    pub parts: Vec<Part>,
    /// Centre and radius of a ball at frame 1, world units; `None` for everywhere.
    pub ball: Option<([f32; 3], f32)>,
}

impl Region {
    /// Everything of these parts.
    pub fn parts(parts: &[Part]) -> Self {
        Self { parts: parts.to_vec(), ball: None }
    }

    /// The whole figure and what it holds, both objects and the sheet: whatever moves, floaters
    /// excepted.
    pub fn moving() -> Self {
        let mut parts = Part::FIGURE.to_vec();
        parts.extend([Part::ObjectA, Part::ObjectB, Part::Cloth, Part::Held]);
        Self { parts, ball: None }
    }

    /// Only within `radius` of `center` (frame-1 world).
    #[must_use]
    pub fn within(mut self, center: [f32; 3], radius: f32) -> Self {
        self.ball = Some((center, radius));
        self
    }

    pub(super) fn contains(&self, part: Part, mean: [f32; 3]) -> bool {
        let inside = self.ball.is_none_or(|(center, radius)| {
            Vec3::from(center).distance_squared(Vec3::from(mean)) <= radius * radius
        });
        inside && self.parts.contains(&part)
    }
}
