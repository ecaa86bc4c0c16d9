//! Lists the adapters, renders a few splats on the best one (or a software one), and computes the
//! gradient of the image's brightness.
//!
//! `cargo run --release --example render`

#![allow(clippy::print_stdout, reason = "an example prints")]

use gs_core::{Camera, Rasterizer, RenderParams, Splats, UpstreamGrads, sh};
use gs_raster_wgpu::{AdapterChoice, GpuContext, WgpuRasterizer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for adapter in GpuContext::adapters() {
        println!("{adapter}");
    }
    let context = GpuContext::new(AdapterChoice::Auto)
        .or_else(|_| GpuContext::new(AdapterChoice::Software))?;
    println!("using {}", context.adapter().name);

    let mut splats = Splats::with_capacity(3, 0);
    for (x, color) in [(-0.8_f32, [0.9, 0.2, 0.2]), (0.0, [0.2, 0.8, 0.2]), (0.8, [0.2, 0.3, 0.9])]
    {
        splats.means.push([x, 0.0, 0.0]);
        splats.quats.push([1.0, 0.0, 0.0, 0.0]);
        splats.log_scales.push([-1.2; 3]);
        splats.opacity_logits.push(2.0);
        splats.sh.push(sh::dc_from_rgb(color));
    }
    let camera = Camera::look_at([0.0, 0.0, -3.0], [0.0; 3], [0.0, 1.0, 0.0], 0.9, 64, 24);

    let raster = WgpuRasterizer::new(context);
    let params = RenderParams::default();
    let mut prepared = raster.prepare(&splats, &camera)?;
    let out = raster.forward(&mut prepared, &splats, &[], &params)?;
    for row in out.alpha.chunks(out.width).step_by(2) {
        let line: String = row.iter().map(|&alpha| if alpha > 0.5 { '#' } else { '.' }).collect();
        println!("{line}");
    }

    let upstream = UpstreamGrads { v_rgb: vec![1.0; out.rgb.len()], ..UpstreamGrads::default() };
    let grads = raster.backward_colors(&mut prepared, &splats, &[], &params, &upstream)?;
    println!("brightness per unit of each splat's first coefficient: {:?}", grads.v_sh);
    Ok(())
}
