//! [`Dance`]: joint angles over time.

use crate::{part::Bone, pose::Pose};
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// Motion of the figure (or of the two bodies).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dance {
    /// The left arm's movement.
    pub(crate) arm: Arm,
    /// Rotation of the whole figure about the vertical over the clip, radians. Not periodic.
    pub(crate) spin_rad: f64,
    /// Angle of the left arm away from the body at frame 1, radians.
    pub(crate) abduct_rad: f64,
}

/// Movement of the left arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arm {
    /// The forearm sweeps across the belly and back.
    Across,
    /// The straight arm swings to and fro along the side of the body.
    Along,
}

impl Default for Dance {
    fn default() -> Self {
        Self { arm: Arm::Across, spin_rad: 0.0, abduct_rad: 6.0_f64.to_radians() }
    }
}

/// Bind-pose joint centres, world units.
pub(crate) fn pivot(bone: Bone) -> DVec3 {
    let v = DVec3::new;
    match bone {
        Bone::World | Bone::Cloth => DVec3::ZERO,
        Bone::Pelvis => v(0.0, 0.93, 0.0),
        Bone::Chest => v(0.0, 1.06, -0.01),
        Bone::Head => v(0.0, 1.47, -0.01),
        Bone::UpperArmL => v(0.2, 1.375, -0.005),
        Bone::ForearmL => v(0.2, 1.11, -0.005),
        Bone::UpperArmR => v(-0.2, 1.375, -0.005),
        Bone::ForearmR => v(-0.2, 1.11, -0.005),
        Bone::ThighL => v(0.094, 0.9, 0.0),
        Bone::ShinL => v(0.098, 0.5, 0.0),
        Bone::FootL => v(0.1, 0.09, -0.01),
        Bone::ThighR => v(-0.094, 0.9, 0.0),
        Bone::ShinR => v(-0.098, 0.5, 0.0),
        Bone::FootR => v(-0.1, 0.09, -0.01),
        Bone::ObjectA => v(-0.3, 0.3, 0.0),
        Bone::ObjectB => v(0.3, 0.3, 0.0),
    }
}

fn rotation_x(degrees: f64) -> DQuat {
    DQuat::from_rotation_x(degrees.to_radians())
}

fn rotation_y(degrees: f64) -> DQuat {
    DQuat::from_rotation_y(degrees.to_radians())
}

fn rotation_z(degrees: f64) -> DQuat {
    DQuat::from_rotation_z(degrees.to_radians())
}

/// 0 at whole `x`, 1 at half, smooth, period 1.
fn wave(x: f64) -> f64 {
    (1.0 - (TAU * x).cos()) / 2.0
}

impl Dance {
    /// Pose of a bone relative to its parent, in the coordinates of the bind pose.
    pub(crate) fn local(&self, bone: Bone, t: f64) -> Pose {
        let phase = TAU * t;
        let sway = phase.sin();
        let (sway_m, tilt) = (-0.04 * sway, 2.5 * sway);
        // keeps the soles fixed while the hips move sideways
        let roll = -(sway_m / 0.82).asin().to_degrees() - tilt;
        let mut scale = 1.0;
        let mut shift = DVec3::ZERO;
        let rotation = match bone {
            Bone::World | Bone::Cloth => DQuat::IDENTITY,
            Bone::Pelvis => {
                let swing = (PI * t / 2.0).sin().powi(2);
                shift = DVec3::new(sway_m, -0.008 * sway * sway, 0.0);
                DQuat::from_rotation_y(self.spin_rad * swing) * rotation_z(tilt)
            }
            Bone::Chest => {
                scale = 1.0 + 0.018 * wave(2.0 * t);
                rotation_y(13.0 * (phase + 0.4).sin())
                    * rotation_z(-4.0 * sway)
                    * rotation_x(4.0 * wave(t))
            }
            Bone::Head => {
                scale = 1.0 / (1.0 + 0.018 * wave(2.0 * t));
                rotation_y(-12.0 * (phase + 0.7).sin())
                    * rotation_x(4.0 * (2.0 * phase).sin())
                    * rotation_z(5.0 * phase.cos() - 3.0)
            }
            Bone::UpperArmL => {
                scale = 1.0 / (1.0 + 0.018 * wave(2.0 * t));
                match self.arm {
                    Arm::Across => {
                        let e = wave(t);
                        rotation_z(self.abduct_rad.to_degrees() * (1.0 - e) + 7.0 * e)
                            * rotation_x(-4.0 - 31.0 * e)
                            * rotation_y(-72.0 * e)
                    }
                    Arm::Along => {
                        DQuat::from_rotation_z(self.abduct_rad)
                            * rotation_x(28.0 * phase.cos() - 12.0)
                    }
                }
            }
            Bone::ForearmL => match self.arm {
                Arm::Across => rotation_x(-12.0 - 84.0 * wave(t)),
                Arm::Along => rotation_x(-7.0),
            },
            Bone::UpperArmR => {
                scale = 1.0 / (1.0 + 0.018 * wave(2.0 * t));
                let e = wave(t - 0.06);
                rotation_z(-11.0 - 104.0 * e) * rotation_x(-6.0) * rotation_y(-88.0 * e)
            }
            Bone::ForearmR => {
                let e = wave(t - 0.06);
                rotation_x(-15.0 - 45.0 * e - 20.0 * e * (3.0 * phase).sin())
            }
            Bone::ThighL => rotation_z(roll) * rotation_x(-36.0 * lift(sway)),
            Bone::ThighR => rotation_z(roll) * rotation_x(-36.0 * lift(-sway)),
            Bone::ShinL => rotation_x(58.0 * lift(sway)),
            Bone::ShinR => rotation_x(58.0 * lift(-sway)),
            Bone::FootL => rotation_x(-10.0 * lift(sway)) * rotation_z(-roll - tilt),
            Bone::FootR => rotation_x(-10.0 * lift(-sway)) * rotation_z(-roll - tilt),
            Bone::ObjectA => {
                let e = (PI * t / 2.0).sin().powi(2);
                shift = DVec3::new(-0.55 * e, 0.12 * wave(t), 0.15 * e);
                rotation_z(95.0 * e) * rotation_y(30.0 * e)
            }
            Bone::ObjectB => {
                let e = (PI * t / 2.0).sin().powi(2);
                shift = DVec3::new(0.25 * e, 0.0, -0.2 * e);
                rotation_y(-50.0 * e) * rotation_z(-12.0 * e)
            }
        };
        Pose::about(pivot(bone), scale, rotation, shift)
    }
}

/// Height of a foot, given the sway away from it.
fn lift(sway: f64) -> f64 {
    let up = sway.max(0.0);
    up * up
}
