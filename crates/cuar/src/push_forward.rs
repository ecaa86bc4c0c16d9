//! [`push_forward()`]: frame 1 warped forward along its flow ([`crate::WarpForm::Paper`]).

use crate::{WarpParams, warp::FirstFrame};

/// Eq. 13 as written: colours `[H,W,3]` and validity `[H,W]` (0 or 1) at frame `t`, from the output
/// of `flow::render_landing` on frame 1.
pub(crate) fn push_forward(
    frame: &FirstFrame,
    (landing, coverage): (&[f32], &[f32]),
    params: &WarpParams,
) -> (Vec<f32>, Vec<f32>) {
    let (w, h) = (frame.width, frame.height);
    let depth_of = |p: usize| match landing[p * 3 + 2] / coverage[p] {
        z if coverage[p] > 0.0 && z.is_finite() => z,
        // only background
        _ => f32::MAX,
    };
    let mut nearest = vec![f32::INFINITY; w * h];
    for p in 0..w * h {
        let z = depth_of(p);
        for (target, share) in targets(w, h, p, &landing[p * 3..]) {
            // a pixel is also distributed to its neighbours, which it does not hide
            if share >= 0.25 {
                nearest[target] = nearest[target].min(z);
            }
        }
    }
    let mut rgb = vec![0.0; w * h * 3];
    let mut weight = vec![0.0; w * h];
    for p in 0..w * h {
        let z = depth_of(p);
        for (target, share) in targets(w, h, p, &landing[p * 3..]) {
            if z > nearest[target] * (1.0 + params.depth_tolerance) {
                continue;
            }
            weight[target] += share;
            for channel in 0..3 {
                rgb[target * 3 + channel] += share * frame.rgb[p * 3 + channel];
            }
        }
    }
    for (rgb, weight) in rgb.chunks_exact_mut(3).zip(&mut weight) {
        // pixels with less weight are at the edge of a hole
        let known = *weight >= 0.25;
        for value in rgb {
            *value = if known { *value / *weight } else { 0.0 };
        }
        *weight = f32::from(u8::from(known));
    }
    (rgb, weight)
}

/// Pixels of a `w × h` image that pixel `p`, displaced by `moved` pixels, is distributed to, with
/// its share in each.
fn targets(w: usize, h: usize, p: usize, moved: &[f32]) -> impl Iterator<Item = (usize, f32)> {
    let (tx, ty) = ((p % w) as f32 + moved[0], (p / w) as f32 + moved[1]);
    let (floor_x, floor_y) = (tx.floor(), ty.floor());
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().filter_map(move |(dx, dy)| {
        let (px, py) = (floor_x + dx, floor_y + dy);
        let share = (1.0 - (tx - px).abs()) * (1.0 - (ty - py).abs());
        let inside = px >= 0.0 && py >= 0.0 && px < w as f32 && py < h as f32;
        if !inside || share.is_nan() || share <= 0.0 {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "inside the image, checked above"
        )]
        let target = py as usize * w + px as usize;
        Some((target, share))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_pixel_motion_shifts_and_the_nearest_pixel_occludes() {
        let frame = FirstFrame::ramp();
        let params = WarpParams::default();
        let mut landing = [3.0, -2.0, 4.0].repeat(12 * 9);
        let coverage = vec![1.0; 12 * 9];
        let (rgb, valid) = push_forward(&frame, (&landing, &coverage), &params);
        let at = |x: usize, y: usize| (y * 12 + x) * 3;
        assert!((rgb[at(5, 3)] - frame.rgb[at(2, 5)]).abs() < 1e-6, "moved right and up");
        assert_eq!(valid[3 * 12 + 1], 0.0, "no pixel arrives here");
        // a nearer pixel that does not move
        landing[at(5, 3)..at(5, 3) + 3].copy_from_slice(&[0.0, 0.0, 2.0]);
        let (rgb, _) = push_forward(&frame, (&landing, &coverage), &params);
        assert!(
            (rgb[at(5, 3)] - frame.rgb[at(5, 3)]).abs() < 1e-6,
            "in front of the pixel that arrives"
        );
        landing[at(5, 3) + 2] = 6.0;
        let (rgb, _) = push_forward(&frame, (&landing, &coverage), &params);
        assert!(
            (rgb[at(5, 3)] - frame.rgb[at(2, 5)]).abs() < 1e-6,
            "behind the pixel that arrives"
        );
    }
}
