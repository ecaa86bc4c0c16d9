//! Propagates a small edit along a scene that rotates by 90°:
//! `cargo run --release -p amg --example propagate_an_edit`.

use amg::{MotionOptions, propagate};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, quat};
use std::io::Write;
use std::sync::Arc;

/// A rod of splats along x that rotates about the y axis.
#[derive(Debug)]
struct Rod(Splats);

impl Rod {
    fn new() -> Self {
        let mut splats = Splats::with_capacity(200, 0);
        for i in 0..200_u8 {
            let along = f32::from(i) / 200.0;
            let around = f32::from(i) * 2.4;
            splats.means.push([along, 0.05 * around.cos(), 0.05 * around.sin()]);
            // Thin along the local x axis, which points away from the rod.
            let half = 0.5 * around;
            let outwards = [half.cos(), half.sin(), 0.0, 0.0];
            splats.quats.push(quat::mul(outwards, [0.5_f32.sqrt(), 0.0, 0.0, 0.5_f32.sqrt()]));
            splats.log_scales.push([-6.0, -4.0, -4.0]);
            splats.opacity_logits.push(2.0);
            splats.sh.push([0.5; 3]);
        }
        Self(splats)
    }
}

impl DynamicScene for Rod {
    fn num_splats(&self) -> usize {
        self.0.len()
    }
    fn sh_degree(&self) -> usize {
        0
    }
    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let half = t * std::f32::consts::FRAC_PI_4;
        let turn = [half.cos(), 0.0, half.sin(), 0.0];
        out.clone_from(&self.0);
        out.means.iter_mut().for_each(|mean| *mean = quat::rotate(turn, *mean));
        out.quats.iter_mut().for_each(|q| *q = quat::mul(turn, *q));
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let source: Arc<dyn DynamicScene> = Arc::new(Rod::new());
    let mut edited = source.at(0.0)?;
    // A flag at the far end, and one splat painted red.
    for i in 0..50_u8 {
        edited.push_from(&edited.clone(), 199);
        let height = 0.06 + 0.004 * f32::from(i);
        if let Some(mean) = edited.means.last_mut() {
            mean[1] = height;
        }
    }
    edited.sh[0] = [1.0, -1.0, -1.0];

    let found = propagate(source, Arc::new(edited), &MotionOptions::default(), &|_, _| {})?;
    let report = &found.report;
    let end = found.scene.at(1.0)?;
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{} unchanged, {} recoloured, {} new; the flag's tip is now at {:.3?}",
        report.unchanged, report.recolored, report.edited, end.means[249]
    )?;
    Ok(())
}
