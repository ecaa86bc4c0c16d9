//! Image masks lifted to splats.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use gs_core::{Camera, Image, Splats, sh};
use gs_edit::{EditError, lift_masks};
use gs_raster_cpu::CpuRasterizer;

/// Two walls of 20 × 20 opaque splats, at z = 0 and, behind it and twice as wide, at z = 2.
fn walls() -> Splats {
    let mut splats = Splats::with_capacity(800, 0);
    for (z, spacing) in [(0.0_f32, 0.1_f32), (2.0, 0.2)] {
        for i in 0..400_u16 {
            let (row, column) = (f32::from(i / 20) - 9.5, f32::from(i % 20) - 9.5);
            splats.means.push([spacing * column, spacing * row, z]);
            splats.quats.push([1.0, 0.0, 0.0, 0.0]);
            splats.log_scales.push([(0.6 * spacing).ln(), (0.6 * spacing).ln(), -6.0]);
            splats.opacity_logits.push(5.0);
            splats.sh.push(sh::dc_from_rgb([0.5; 3]));
        }
    }
    splats
}

fn view(x: f64) -> Camera {
    Camera::look_at([x, 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.9, 120, 120)
}

/// White left of the middle of the picture.
fn left_half() -> Image {
    let data = (0..120 * 120).map(|i| f32::from(u8::from(i % 120 < 60))).collect();
    Image::from_data(120, 120, 1, data).unwrap()
}

#[test]
fn a_mask_selects_the_splats_visible_in_it() {
    let splats = walls();
    let views = [(view(0.0), left_half())];
    let found = lift_masks(&CpuRasterizer::default(), &splats, &views, &|_| {}).unwrap();
    let camera = view(0.0);
    for i in 0..splats.len() {
        let x = camera.project(splats.means[i].map(f64::from)).unwrap()[0];
        let hidden = i >= 400 && splats.means[i][0].abs() < 1.2 && splats.means[i][1].abs() < 1.2;
        if x > 70.0 {
            assert!(!found[i], "splat {i} at column {x}");
        } else if x < 50.0 && !hidden {
            assert!(found[i] || i >= 400, "splat {i} at column {x}");
        }
    }
    let front = found[..400].iter().filter(|&&f| f).count();
    assert!((180..=220).contains(&front), "half of the front wall: {front}");
}

#[test]
fn views_are_combined_and_sizes_are_checked() {
    let splats = walls();
    let black = Image::zeros(120, 120, 1);
    let views = [(view(0.0), left_half()), (view(0.2), black.clone()), (view(-0.2), black)];
    let found = lift_masks(&CpuRasterizer::default(), &splats, &views, &|_| {}).unwrap();
    assert!(found[..400].iter().all(|&f| !f), "outside the mask in two of three views");
    let wrong = [(view(0.0), Image::zeros(60, 120, 1))];
    let error = lift_masks(&CpuRasterizer::default(), &splats, &wrong, &|_| {}).unwrap_err();
    assert!(matches!(error, EditError::Raster(_)), "{error}");
}
