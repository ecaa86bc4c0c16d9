//! [`Pose`]: a similarity transform.

use glam::{DQuat, DVec3};

/// A similarity transform `x ↦ s·R·x + p`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    pub(crate) scale: f64,
    pub(crate) rotation: DQuat,
    pub(crate) translation: DVec3,
}

impl Pose {
    pub(crate) const IDENTITY: Self =
        Self { scale: 1.0, rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Scales and rotates about `pivot`, then translates by `shift`.
    pub(crate) fn about(pivot: DVec3, scale: f64, rotation: DQuat, shift: DVec3) -> Self {
        Self { scale, rotation, translation: pivot + shift - scale * (rotation * pivot) }
    }

    pub(crate) fn apply(&self, x: DVec3) -> DVec3 {
        self.scale * (self.rotation * x) + self.translation
    }

    /// Composition: first `inner`, then `self`.
    pub(crate) fn after(&self, inner: &Self) -> Self {
        Self {
            scale: self.scale * inner.scale,
            rotation: self.rotation * inner.rotation,
            translation: self.apply(inner.translation),
        }
    }

    pub(crate) fn inverse(&self) -> Self {
        let (scale, rotation) = (1.0 / self.scale, self.rotation.conjugate());
        Self { scale, rotation, translation: -scale * (rotation * self.translation) }
    }
}

/// A splat after a motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moved {
    pub(crate) mean: [f32; 3],
    pub(crate) quat: [f32; 4],
    pub(crate) log_scales: [f32; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_round_trips() {
        let pose = Pose::about(
            DVec3::new(1.0, 2.0, 3.0),
            1.3,
            DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(-1.2),
            DVec3::new(0.1, 0.0, -2.0),
        );
        let x = DVec3::new(0.3, -0.4, 5.0);
        assert!((pose.inverse().apply(pose.apply(x)) - x).length() < 1e-12, "round trip");
    }
}
