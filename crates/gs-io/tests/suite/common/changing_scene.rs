//! A small scene in which every attribute of some splats changes and of others does not, for tests
//! of writers.

use gs_core::Splats;
use gs_deform::TabulatedScene;

/// Pseudo-random number in [−1, 1) from a counter.
fn noise(counter: u32) -> f32 {
    let mut x = counter.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    x = (x ^ x >> 15).wrapping_mul(0x85eb_ca6b);
    x = (x ^ x >> 13).wrapping_mul(0xc2b2_ae35);
    ((x ^ x >> 16) >> 8) as f32 / 8_388_608.0 - 1.0
}

/// `n` splats over `frames` frames in a box of about 4 units. Row `i` moves if `i & 1`, rotates if
/// `i & 2`, changes colour if `i & 4`, opacity if `i & 8`, size if `i & 16`, smoothly; quaternions
/// are unnormalised and of either sign.
pub(crate) fn scene(n: usize, frames: usize, sh_degree: usize) -> TabulatedScene {
    let coeffs = (sh_degree + 1) * (sh_degree + 1);
    let frame = |f: usize| {
        let t = f as f32 / frames.saturating_sub(1).max(1) as f32;
        let mut splats = Splats::with_capacity(n, sh_degree);
        for i in 0..n {
            let seed = u32::try_from(i).unwrap() * 64;
            let r = |k: u32| noise(seed + k);
            let on = |bit: usize| if i & bit == 0 { 0.0 } else { 1.0 };
            let swing = (3.0 * t + r(0)).sin() - r(0).sin();
            splats.means.push([0, 1, 2].map(|k| 2.0 * r(1 + k) + on(1) * 0.5 * swing * r(4 + k)));
            let angle = on(2) * 2.5 * t;
            let (s, c) = (0.5 * (angle + r(7))).sin_cos();
            // Some frames store the other sign of the same rotation.
            let length = if (i + f).is_multiple_of(3) { -1.5 } else { 0.7 };
            splats.quats.push([c, s * 0.6, 0.0, s * 0.8].map(|q| length * q));
            splats.log_scales.push([0, 1, 2].map(|k| -4.0 + r(8 + k) + on(16) * 0.4 * swing));
            splats.opacity_logits.push(2.0 * r(11) + on(8) * 1.5 * swing);
            for c in 0..coeffs {
                let k = 12 + u32::try_from(c).unwrap() * 3;
                splats.sh.push([0, 1, 2].map(|channel| r(k + channel) + on(4) * 0.3 * swing));
            }
        }
        splats
    };
    TabulatedScene::new((0..frames).map(frame).collect()).unwrap()
}
