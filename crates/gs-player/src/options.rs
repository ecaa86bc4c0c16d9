//! [`EncodeOptions`]: precision of the stored scene.

use crate::PlayerError;

/// Precision of the stored scene. A *step* is the distance of two neighbouring
/// stored values. The error of a value is at most half a step for static
/// splats, and at most `tolerance` steps for moving ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncodeOptions {
    /// Stored SH degree, 0 to 3; a scene of lower degree keeps its own. Default
    /// 1: diffuse colour and first-order view dependence. Each further degree
    /// takes about as many bytes as all other static data.
    pub sh_degree: usize,
    /// Steps across the middle 90 % of the scene's longest side. Default 16 384: a 16th of a pixel
    /// when that side fills 1000 pixels.
    pub position_steps: f64,
    /// Step of the components of unit quaternions. Default 1/1024: about a 10th of a degree.
    pub rotation_step: f64,
    /// Step of the natural logarithms of the standard deviations. Default 1/64: ±0.8 % of the size.
    pub scale_step: f64,
    /// Step of the opacity, 0 to 1. Default 1/255.
    pub opacity_step: f64,
    /// Step of the diffuse colour, 0 to 1. Default 1/255.
    pub color_step: f64,
    /// Step of the SH coefficients above degree 0. Default 1/64.
    pub shading_step: f64,
    /// Largest error of a moving value, steps; at least 1. Default 1.5.
    pub tolerance: f64,
}

impl Default for EncodeOptions {
    fn default() -> Self {
        Self {
            sh_degree: 1,
            position_steps: 16_384.0,
            rotation_step: 1.0 / 1024.0,
            scale_step: 1.0 / 64.0,
            opacity_step: 1.0 / 255.0,
            color_step: 1.0 / 255.0,
            shading_step: 1.0 / 64.0,
            tolerance: 1.5,
        }
    }
}

impl EncodeOptions {
    /// Verifies the ranges of all options.
    pub(crate) fn check(&self) -> Result<(), PlayerError> {
        let refuse =
            |name, found: String, expected| Err(PlayerError::Option { name, found, expected });
        if self.sh_degree > gs_core::sh::MAX_DEGREE {
            return refuse("sh_degree", self.sh_degree.to_string(), "0 to 3");
        }
        if !(16.0..=1e8).contains(&self.position_steps) {
            return refuse("position_steps", self.position_steps.to_string(), "16 to 1e8");
        }
        let steps = [
            ("rotation_step", self.rotation_step),
            ("scale_step", self.scale_step),
            ("opacity_step", self.opacity_step),
            ("color_step", self.color_step),
            ("shading_step", self.shading_step),
        ];
        for (name, step) in steps {
            if !(1e-6..=0.25).contains(&step) {
                return refuse(name, step.to_string(), "1e-6 to 0.25");
            }
        }
        if !(1.0..=1e3).contains(&self.tolerance) {
            return refuse("tolerance", self.tolerance.to_string(), "1 to 1000 steps");
        }
        Ok(())
    }
}
