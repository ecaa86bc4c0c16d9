//! Smoothness of motion.

use crate::MotionTrack;

impl MotionTrack {
    /// Mean over splats and times of `‖x_{t+1} − 2x_t + x_{t−1}‖ / size`. Lower is smoother.
    /// Accelerated motion also has jitter, so compare with that of the truth or the source. 0 for
    /// fewer than three times.
    pub fn jitter(&self, size: f64) -> f64 {
        let mut total = 0.0;
        let mut count = 0_usize;
        for window in self.frames().windows(3) {
            for ((a, b), c) in window[0].iter().zip(&window[1]).zip(&window[2]) {
                let second: f64 =
                    (0..3).map(|k| f64::from(a[k] - 2.0 * b[k] + c[k]).powi(2)).sum::<f64>();
                total += second.sqrt();
                count += 1;
            }
        }
        total / count.max(1) as f64 / size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jitter_is_zero_for_uniform_motion_and_positive_for_shaking() {
        let along = |x: fn(usize) -> f32| {
            MotionTrack::from_frames((0..4).map(|t| vec![[x(t), 0.0, 0.0]; 5]).collect())
        };
        assert!(along(|t| t as f32).jitter(1.0) < 1e-6, "constant velocity");
        let shaking = along(|t| if t % 2 == 0 { 0.1 } else { -0.1 }).jitter(1.0);
        assert!((shaking - 0.4).abs() < 1e-5, "±0.1 each frame: {shaking}");
    }
}
