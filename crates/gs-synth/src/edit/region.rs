//! [`Region`]: the splats that an edit affects.

use crate::part::Part;
use glam::Vec3;

/// The splats that an edit affects: those of some parts, inside an optional ball.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Body parts.
    pub parts: Vec<Part>,
    /// Centre and radius of a ball at frame 1, world units; `None` for everywhere.
    pub ball: Option<([f32; 3], f32)>,
}

impl Region {
    /// All splats of these parts.
    pub fn parts(parts: &[Part]) -> Self {
        Self { parts: parts.to_vec(), ball: None }
    }

    /// All moving parts except floaters: the figure and the object
    /// it holds, both bodies and the sheet.
    pub fn moving() -> Self {
        let mut parts = Part::FIGURE.to_vec();
        parts.extend([Part::ObjectA, Part::ObjectB, Part::Cloth, Part::Held]);
        Self { parts, ball: None }
    }

    /// Restricts the region to a ball around `center` (frame-1 world units).
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
