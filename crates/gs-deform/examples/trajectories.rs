//! Builds a scene from three frames and evaluates it between them.

use gs_core::{DynamicScene, Splats};
use gs_deform::TabulatedScene;
use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let frame = |x: f32| Splats {
        means: vec![[x, 0.0, 0.0]],
        quats: vec![[1.0, 0.0, 0.0, 0.0]],
        log_scales: vec![[-3.0; 3]],
        opacity_logits: vec![2.0],
        sh: vec![[0.0; 3]],
        sh_degree: 0,
    };
    let scene = TabulatedScene::new(vec![frame(0.0), frame(1.0), frame(4.0)])?;
    let mut out = std::io::stdout().lock();
    for t in scene.time_range().frames(9) {
        writeln!(out, "t = {t:.3}: x = {:.3}", scene.at(t)?.means[0][0])?;
    }
    Ok(())
}
