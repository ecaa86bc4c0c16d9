//! Temporal metrics on videos with known motion.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use c4d_metrics::{
    FlowField, StaticFlicker, mean_absolute_difference, motion_fidelity, temporal_flickering,
    warp_error,
};
use gs_core::Image;

const SIZE: (usize, usize) = (48, 40);

/// A smooth texture, moved right by `dx` and down by `dy` pixels.
fn texture(dx: f32, dy: f32) -> Image {
    let mut image = Image::zeros(SIZE.0, SIZE.1, 3);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let (u, v) = (x as f32 - dx, y as f32 - dy);
            for (c, value) in image.pixel_mut(x, y).iter_mut().enumerate() {
                *value = 0.5 + 0.4 * (0.3 * u + 0.2 * v + c as f32).sin();
            }
        }
    }
    image
}

fn uniform(dx: f32, dy: f32) -> FlowField {
    let data = std::iter::repeat_n([dx, dy], SIZE.0 * SIZE.1).flatten().collect();
    FlowField::of(&Image::from_data(SIZE.0, SIZE.1, 2, data).unwrap())
}

fn flat(value: f32) -> Image {
    Image::from_data(SIZE.0, SIZE.1, 3, vec![value; SIZE.0 * SIZE.1 * 3]).unwrap()
}

/// Adds noise of up to ±`levels` of 255, different for each pixel and frame.
fn noisy(image: &Image, levels: f32, frame: usize) -> Image {
    let mut state = u32::try_from(frame).unwrap() + 1;
    let data = image.data.iter().map(|value| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let sign = if state >> 31 == 0 { 1.0 } else { -1.0 };
        value + sign * levels / 255.0
    });
    Image { data: data.collect(), ..*image }
}

/// Mean flickering, static flicker and warp error of a video whose surface moves by `step` pixels
/// per frame.
fn measured(video: &[Image], step: (f32, f32)) -> [f64; 3] {
    let mut still = StaticFlicker::default();
    let (flow, back) = (uniform(step.0, step.1), uniform(-step.0, -step.1));
    let visible = flow.visible(&back);
    let (mut difference, mut error) = (0.0, 0.0);
    for frame in video {
        still.add(frame);
    }
    still.exclude_moving(&flow);
    for pair in video.windows(2) {
        difference += mean_absolute_difference(&pair[0], &pair[1]).unwrap();
        error += warp_error(&pair[0], &pair[1], &flow, &visible).unwrap();
    }
    let pairs = (video.len() - 1) as f64;
    let flicker = temporal_flickering(difference / pairs);
    [flicker, still.value().unwrap_or(f64::NAN), error / pairs]
}

#[test]
fn constant_and_alternating_videos() {
    let constant = vec![texture(0.0, 0.0); 4];
    assert_eq!(measured(&constant, (0.0, 0.0)), [1.0, 0.0, 0.0], "constant");
    let alternating: Vec<Image> = (0..4_u8).map(|t| flat(f32::from(t % 2))).collect();
    let [flicker, still, error] = measured(&alternating, (0.0, 0.0));
    assert_eq!([flicker, error], [0.0, 1.0], "black and white alternate");
    assert!((still - 127.5).abs() < 1e-9, "half of the range: {still}");
}

#[test]
fn the_exact_flow_of_a_shift_has_no_warp_error() {
    let (a, b) = (texture(0.0, 0.0), texture(3.0, -2.0));
    let (flow, back) = (uniform(3.0, -2.0), uniform(-3.0, 2.0));
    let visible = flow.visible(&back);
    let inside = visible.iter().filter(|visible| **visible).count();
    assert_eq!(inside, (SIZE.0 - 3) * (SIZE.1 - 2), "what leaves the image is not compared");
    assert!(warp_error(&a, &b, &flow, &visible).unwrap() < 1e-6, "exact");
    let still = uniform(0.0, 0.0);
    assert!(warp_error(&a, &b, &still, &still.visible(&still)).unwrap() > 1e-3, "no flow");
    let half = texture(1.5, 0.0);
    let flow = uniform(1.5, 0.0);
    let between = warp_error(&a, &half, &flow, &flow.visible(&uniform(-1.5, 0.0))).unwrap();
    assert!(between < 1e-4, "between pixels: {between}");
}

#[test]
fn occluded_and_boundary_pixels_are_excluded() {
    // The left half moves by 4 pixels and occludes a part of the static right half.
    let mut forth = Image::zeros(SIZE.0, SIZE.1, 2);
    let mut back = forth.clone();
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 / 2 {
            forth.pixel_mut(x, y)[0] = 4.0;
            back.pixel_mut(x, y)[0] = -4.0;
        }
    }
    let (forth, back) = (FlowField::of(&forth), FlowField::of(&back));
    let visible = forth.visible(&back);
    let row = &visible[5 * SIZE.0..][..SIZE.0];
    assert!(row[4..18].iter().all(|visible| *visible), "the moving half is seen");
    assert!(row[20..25].iter().all(|visible| !visible), "the seam is not");
    assert!(row[26..].iter().all(|visible| *visible), "the still half is");
    let mut holes = forth.clone();
    holes.clone_from(&FlowField::of(&Image::from_data(1, 1, 2, vec![f32::NAN; 2]).unwrap()));
    assert_eq!(holes.visible(&holes), [false], "unknown");
}

#[test]
fn noise_increases_all_three_metrics() {
    let clean: Vec<Image> = (0..5).map(|_| texture(0.0, 0.0)).collect();
    let noise: Vec<Image> = clean.iter().enumerate().map(|(t, f)| noisy(f, 2.0, t)).collect();
    let (clean, noise) = (measured(&clean, (0.0, 0.0)), measured(&noise, (0.0, 0.0)));
    assert!(noise[0] < clean[0], "flickering: {noise:?}");
    assert!(noise[1] > clean[1] + 1.0, "static flicker: {noise:?}");
    assert!(noise[2] > clean[2] + 1e-5, "warp error: {noise:?}");
}

#[test]
fn moving_and_unknown_pixels_are_not_static() {
    let mut still = StaticFlicker::default();
    still.add(&flat(0.0));
    still.add(&flat(1.0));
    still.exclude_moving(&uniform(0.2, 0.0));
    assert!(still.value().is_some(), "slow enough");
    still.exclude_moving(&uniform(0.2, 0.2));
    assert_eq!(still.value(), None, "moves");
    let mut unknown = StaticFlicker::default();
    unknown.add(&flat(0.0));
    unknown.add(&flat(1.0));
    unknown.exclude_moving(&uniform(f32::NAN, f32::NAN));
    assert_eq!(unknown.value(), None, "unknown");
}

#[test]
fn flows_are_compared_where_both_are_known() {
    let mut mask = vec![false; SIZE.0 * SIZE.1];
    mask[0] = true;
    let (a, b) = (uniform(1.0, 0.0), uniform(1.0, 2.0));
    assert_eq!(motion_fidelity(&a, &b, &mask, false), Some(2.0), "outside");
    assert_eq!(motion_fidelity(&a, &a, &mask, true), Some(0.0), "inside");
    let unknown = uniform(f32::NAN, 0.0);
    assert_eq!(motion_fidelity(&a, &unknown, &mask, false), None, "unknown");
    let features: Vec<f32> = vec![9.0, 1.0, 0.5, 9.0, 1.0, 0.5];
    let flow = FlowField::normalized((2, 1), &features, (3, 1), &[0.5, 0.8]);
    assert!(flow.vectors()[0][0].is_nan(), "half covered");
    assert_eq!(flow.vectors()[1], [1.0 / 0.8, 0.5 / 0.8], "over the coverage");
}
