//! scratch
#![allow(clippy::print_stdout)]
#[path = "../tests/common/mod.rs"]
mod common;
use common::*;
use cuar::*;
use gs_core::*;
use gs_raster_cpu::CpuRasterizer;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let n: usize = args[1].parse().unwrap();
    let w: u32 = args[2].parse().unwrap();
    let v: usize = args[3].parse().unwrap();
    let s: usize = args[4].parse().unwrap();
    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    let case = case(n, 3, v, (w, w * 3 / 4), flaws);
    let times = TimeRange::UNIT.frames(60);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    let eval = [0.13, 0.37, 0.61];
    let before = psnr(&case.scene, &case, &case.held_out, &eval);
    println!("before {before:?}");
    split(&case.scene, &case, &eval);
    for spec in &args[5..] {
        let mut p = RegressionParams::default();
        let mut o = RefineOptions { samples: s, ..RefineOptions::default() };
        for kv in spec.split(',') {
            let (k, x) = kv.split_once('=').unwrap_or((kv, "0"));
            let x: f64 = x.parse().unwrap();
            match k {
                "prior" => p.prior = x,
                "passes" => p.passes = x as usize,
                "floor" => o.min_uncertainty = x as f32,
                "eps" => o.epsilon = x as f32,
                "delta" => p.delta = x,
                "hold" => p.hold = x,
                "relax" => p.relaxation = x,
                "zeta" => o.weights.zeta = x,
                "keep" => o.keep_first_frame = x > 0.0,
                "def" => {}
                _ => panic!("{k}"),
            }
        }
        o.solver = Solver::Regression(p);
        let t = std::time::Instant::now();
        let refined = refine(
            &CpuRasterizer::default(),
            &case.scene,
            &case.edited,
            &views,
            &o,
            None,
            &mut NoObserver,
        )
        .unwrap();
        let secs = t.elapsed().as_secs_f64();
        let scene = refined.scene(&case.scene);
        let after = psnr(&scene, &case, &case.held_out, &eval);
        let r = &refined.report;
        println!(
            "== {spec}: {secs:.1}s inside {:+.3} outside {:+.3} ({:.2}) loss {:.3e}->{:.3e} held {:.3e}->{:.3e} masked {:.2} known {:.2} {:?}",
            after[0] - before[0],
            after[1] - before[1],
            after[1],
            r.loss_before,
            r.loss_after,
            r.held_out_before,
            r.held_out_after,
            r.masked_fraction,
            r.known_fraction,
            r.warnings
        );
        println!(
            "   trace {:?}",
            r.trace.iter().map(|t| format!("{:.3e}", t.loss)).collect::<Vec<_>>()
        );
        println!(
            "   timings {:?}",
            r.timings.iter().map(|t| format!("{} {:.1}", t.0, t.1)).collect::<Vec<_>>()
        );
        split(&scene, &case, &eval);
        locate(&scene, &case, 0.13, case.held_out[0], &refined);
    }
}

fn split(scene: &dyn DynamicScene, case: &Case, times: &[f32]) {
    // squared error outside the mask by uncertainty bucket
    let mut sums = [[0.0f64; 2]; 6];
    let mut tot = 0.0;
    for &t in times {
        for &view in &case.held_out {
            let camera = &case.cameras[view];
            let (at_t, at_1) = (case.scene.at(t).unwrap(), case.scene.at(0.0).unwrap());
            let u = render_uncertainty(&CpuRasterizer::default(), &at_t, &at_1, camera).unwrap();
            let m = artifact_mask(&u, 0.5, 0.0);
            let mean: f32 = u.data.iter().sum::<f32>() / u.data.len() as f32;
            let ours = render(scene, t, camera);
            let tru = render(&case.truth, t, camera);
            let mut e2 = 0.0;
            let mut cnt = 0.0;
            // edited coverage
            let feats: Vec<f32> = case.edited.iter().map(|&e| f32::from(u8::from(e))).collect();
            let r = CpuRasterizer::default();
            let mut p = r.prepare(&at_t, camera).unwrap();
            let cov = r
                .forward(
                    &mut p,
                    &at_t,
                    &feats,
                    &RenderParams { rgb: false, depth: false, ..RenderParams::default() },
                )
                .unwrap()
                .features_image();
            for p in 0..u.data.len() {
                if m.data[p] > 0.0 {
                    continue;
                }
                let c = cov.data[p];
                let b = if c <= 0.0 {
                    0
                } else if c < 0.01 {
                    1
                } else if c < 0.1 {
                    2
                } else if c < 0.5 {
                    3
                } else if c < 0.9 {
                    4
                } else {
                    5
                };
                let e: f64 = (0..3)
                    .map(|k| {
                        f64::from(
                            ours.data[p * 3 + k].clamp(0., 1.) - tru.data[p * 3 + k].clamp(0., 1.),
                        )
                        .powi(2)
                    })
                    .sum();
                sums[b][0] += e;
                sums[b][1] += 1.0;
                e2 += e;
                cnt += 3.0;
            }
            tot += e2;
            print!(
                "  [t{t} v{view} {:.2}dB meanU {mean:.4} live-out px {cnt}]",
                -10.0 * (e2 / cnt).log10()
            );
        }
    }
    println!();
    for (k, b) in ["0", "<.01", "<.1", "<.5", "<.9", "<=1"].iter().zip(sums) {
        println!(
            "    cov {k}: err share {:.3e}, px {}, mse {:.2e}",
            b[0],
            b[1],
            b[0] / b[1].max(1.0) / 3.0
        );
    }
    println!("    total {tot:.4e}");
}

fn locate(scene: &dyn DynamicScene, case: &Case, t: f32, view: usize, refined: &Refined) {
    let camera = &case.cameras[view];
    let (at_t, at_1) = (case.scene.at(t).unwrap(), case.scene.at(0.0).unwrap());
    let u = render_uncertainty(&CpuRasterizer::default(), &at_t, &at_1, camera).unwrap();
    let m = artifact_mask(&u, 0.5, 0.0);
    let ours = render(scene, t, camera);
    let old = render(&case.scene, t, camera);
    let tru = render(&case.truth, t, camera);
    let w = u.width;
    let mut list: Vec<(f64, usize)> = (0..u.data.len())
        .filter(|&p| m.data[p] == 0.0)
        .map(|p| {
            (
                (0..3)
                    .map(|k| f64::from(ours.data[p * 3 + k] - tru.data[p * 3 + k]).powi(2))
                    .sum::<f64>(),
                p,
            )
        })
        .collect();
    list.sort_by(|a, b| b.0.total_cmp(&a.0));
    let total: f64 = list.iter().map(|x| x.0).sum();
    let mut acc = 0.0;
    for (k, (e, p)) in list.iter().take(3000).enumerate() {
        acc += e;
        if k < 12 || k == 100 || k == 1000 || k == 2999 {
            println!(
                "    {k}: ({}, {}) e {e:.2e} cum {:.2} U {:.2e} old {:?} now {:?} truth {:?}",
                p % w,
                p / w,
                acc / total,
                u.data[*p],
                &old.data[p * 3..p * 3 + 3],
                &ours.data[p * 3..p * 3 + 3],
                &tru.data[p * 3..p * 3 + 3]
            );
        }
    }
    // splats near the worst pixel
    let (_, p) = list[0];
    let (px, py) = ((p % w) as f64 + 0.5, (p / w) as f64 + 0.5);
    let eye = camera.position().map(|x| x as f32);
    let after = scene.at(t).unwrap();
    let truth = case.truth.at(t).unwrap();
    let mut near: Vec<(f64, usize)> = (0..at_t.len())
        .filter_map(|i| {
            let q = camera.project(at_t.means[i].map(f64::from))?;
            let d = (q[0] - px).hypot(q[1] - py);
            (d < 3.0).then_some((camera.to_camera(at_t.means[i].map(f64::from))[2], i))
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (z, i) in near.iter().take(14) {
        let d = [0, 1, 2].map(|k| at_t.means[*i][k] - eye[k]);
        let l = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let d = d.map(|x| x / l);
        let c = |s: &Splats| sh::color(s.sh_degree, s.sh_of(*i), d);
        println!(
            "      z {z:.3} id {i} edited {} op {:.2} scale {:?} old {:?} now {:?} truth {:?} first {:?}",
            case.edited[*i],
            at_t.opacity_logits[*i],
            at_t.log_scales[*i],
            c(&at_t),
            c(&after),
            c(&truth),
            c(&at_1)
        );
    }
    let _ = refined;
    let crop = |im: &Image| {
        let (x0, y0) = ((p % w).saturating_sub(60), (p / w).saturating_sub(60));
        let mut out = Vec::new();
        for y in y0..(y0 + 120).min(im.height) {
            for x in x0..(x0 + 120).min(w) {
                out.extend(im.pixel(x, y).iter().map(|v| (v.clamp(0., 1.) * 255.) as u8));
            }
        }
        (out, ((x0 + 120).min(w) - x0), ((y0 + 120).min(im.height) - y0))
    };
    for (name, im) in [("old", &old), ("now", &ours), ("truth", &tru)] {
        let (d, cw, ch) = crop(im);
        let mut f = format!("P6 {cw} {ch} 255\n").into_bytes();
        f.extend(d);
        std::fs::write(format!("/tmp/diag/{name}.ppm"), f).unwrap();
    }
}
