//! Masked L1, SSIM and Adam on the device equal those on the CPU in double precision, at sizes
//! around the blocks of the shaders.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[path = "../../gs-raster-wgpu/tests/common/mod.rs"]
mod common;

use c4d_metrics::Ssim;
use common::{Mode, noise, raster};
use cuar::loss::masked_l1;
use gs_raster_wgpu::GpuContext;
use gs_raster_wgpu::device::{CommandMemory, Commands, GrowBuffer, read};
use gs_train_wgpu::{DeviceAdam, ImageLosses, ParameterSlice};
use test_support::compare::{assert_grad_close, widen};

/// Sizes around one pixel, one block and one group of pixels, and odd sizes.
const SIZES: [[u32; 2]; 8] =
    [[1, 1], [2, 3], [11, 1], [15, 17], [16, 16], [33, 16], [67, 45], [130, 21]];

fn context() -> GpuContext {
    raster(Mode::Portable).context().clone()
}

/// An image in [0,1), and a similar one.
fn images(values: usize) -> [Vec<f32>; 2] {
    let x: Vec<f32> = noise(1, values).iter().map(|v| 0.5 + 0.5 * v).collect();
    let y = x.iter().zip(noise(2, values)).map(|(x, n)| (x + 0.3 * n).clamp(0.0, 1.0)).collect();
    [x, y]
}

/// On, off, half, and weights of all sizes and signs.
fn masks(pixels: usize) -> [Vec<f32>; 4] {
    let half = (0..pixels).map(|p| f32::from(u8::from(p % 7 < 3))).collect();
    [vec![1.0; pixels], vec![0.0; pixels], half, noise(3, pixels)]
}

/// Value and gradient computed by `cuar`.
fn expected(
    ssim: bool,
    size: [u32; 2],
    channels: usize,
    [x, y, mask]: [&[f64]; 3],
    norm: f64,
) -> (f64, Vec<f64>) {
    let mut v_x = vec![0.0; x.len()];
    if !ssim {
        return (masked_l1(x, y, mask, norm, &mut v_x), v_x);
    }
    let masked = |image: &[f64]| -> Vec<f64> {
        let weight = |k: usize| mask[k / channels];
        let value = |(k, &v): (usize, &f64)| if weight(k) > 0.0 { weight(k) * v } else { 0.0 };
        image.iter().enumerate().map(value).collect()
    };
    let [width, height] = size.map(|side| side as usize);
    let (x, y) = (masked(x), masked(y));
    let loss = Ssim::new(width, height, channels).loss(&x, &y, norm, 1.0, &mut v_x, None);
    for (k, v) in v_x.iter_mut().enumerate() {
        *v *= mask[k / channels].max(0.0);
    }
    (loss, v_x)
}

#[test]
fn losses_and_gradients_match_the_cpu() {
    let context = context();
    for size in SIZES {
        let pixels = (size[0] * size[1]) as usize;
        for channels in [3, 1] {
            let mut losses = ImageLosses::new(&context, size, channels, 1).unwrap();
            let channels = channels as usize;
            let [x, y] = images(pixels * channels);
            let norm = 1.0 / (pixels * channels) as f32;
            for (which, mask) in masks(pixels).iter().enumerate() {
                for ssim in [false, true] {
                    let what = format!("{size:?}x{channels}, mask {which}, ssim {ssim}");
                    let inputs = [&x, &y, mask].map(|values| widen(values));
                    let inputs = [&inputs[0][..], &inputs[1], &inputs[2]];
                    let (value, v_x) = expected(ssim, size, channels, inputs, f64::from(norm));
                    let (got, v_got) = losses.evaluate(ssim, &x, &y, mask, norm).unwrap();
                    let error = (f64::from(got) - value).abs();
                    // 1 − SSIM has the rounding of SSIM itself.
                    let allowed = 2e-6 * value.abs() + if ssim { 3e-7 } else { 0.0 };
                    assert!(error <= allowed, "{what}: {got} {value}");
                    let flat = v_x.iter().all(|&v| v.abs() < 1e-12);
                    if flat {
                        let largest = v_got.iter().fold(0.0_f32, |a, b| a.max(b.abs()));
                        assert!(largest < 1e-9, "{what}: gradient of a constant is {largest}");
                    } else {
                        assert_grad_close(&what, &widen(&v_got), &v_x, 1e-4);
                    }
                }
            }
        }
    }
}

/// Negative control: a different mask gives a different loss.
#[test]
#[should_panic(expected = "a different mask")]
fn a_different_mask_is_detected() {
    let (size, pixels) = ([20, 20], 400);
    let mut losses = ImageLosses::new(&context(), size, 3, 2).unwrap();
    let [x, y] = images(3 * pixels);
    let [on, _, half, _] = masks(pixels);
    let inputs = [&x, &y, &on].map(|values| widen(values));
    let inputs = [&inputs[0][..], &inputs[1], &inputs[2]];
    let (_, v_x) = expected(true, size, 3, inputs, 1e-3);
    let (_, v_got) = losses.evaluate(true, &x, &y, &half, 1e-3).unwrap();
    assert_grad_close("a different mask", &widen(&v_got), &v_x, 1e-4);
}

/// Values outside the mask are ignored, even NaN. A NaN inside it makes the loss NaN, as on the
/// CPU.
#[test]
fn nan_values_behave_as_on_the_cpu() {
    let (size, pixels) = ([19, 13], 247);
    let mut losses = ImageLosses::new(&context(), size, 3, 2).unwrap();
    let [mut x, mut y] = images(3 * pixels);
    let mut mask = vec![1.0_f32; pixels];
    (mask[5], mask[6], mask[7]) = (0.0, f32::NAN, -1.0);
    (x[15], y[16], x[18], y[21]) = (f32::NAN, f32::INFINITY, f32::NAN, f32::NAN);
    for ssim in [false, true] {
        let (value, v_x) = losses.evaluate(ssim, &x, &y, &mask, 1e-3).unwrap();
        assert!(value.is_finite() && v_x.iter().all(|v| v.is_finite()), "outside, ssim {ssim}");
        let inputs = [&x, &y, &mask].map(|values| widen(values));
        let inputs = [&inputs[0][..], &inputs[1], &inputs[2]];
        let (cpu, v_cpu) = expected(ssim, size, 3, inputs, f64::from(1e-3_f32));
        assert!((f64::from(value) - cpu).abs() < 5e-6 * cpu, "outside, ssim {ssim}");
        assert_grad_close("outside", &widen(&v_x), &v_cpu, 1e-4);
    }
    x[0] = f32::NAN;
    let (value, v_x) = losses.evaluate(false, &x, &y, &mask, 1e-3).unwrap();
    assert!(value.is_nan() && v_x[0] == 0.0, "inside, L1: {value} {}", v_x[0]);
    assert!(v_x.iter().all(|v| v.is_finite()), "other pixels keep their gradient");
    let (value, v_x) = losses.evaluate(true, &x, &y, &mask, 1e-3).unwrap();
    assert!(value.is_nan() && v_x[0].is_nan(), "inside, SSIM: {value} {}", v_x[0]);
    let far = 3 * (12 * 19 + 18);
    assert!(v_x[far].is_finite(), "windows without it keep their gradient");
}

#[test]
fn losses_are_the_same_from_run_to_run() {
    let (size, pixels) = ([67, 45], 67 * 45);
    let mut losses = ImageLosses::new(&context(), size, 3, 2).unwrap();
    let [x, y] = images(3 * pixels);
    let [on, ..] = masks(pixels);
    for ssim in [false, true] {
        let first = losses.evaluate(ssim, &x, &y, &on, 1e-3).unwrap();
        assert_eq!(first, losses.evaluate(ssim, &x, &y, &on, 1e-3).unwrap(), "ssim {ssim}");
    }
}

#[test]
fn wrong_lengths_are_refused() {
    let mut losses = ImageLosses::new(&context(), [4, 3], 3, 1).unwrap();
    let message = losses.evaluate(false, &[0.0; 36], &[0.0; 35], &[0.0; 12], 1.0).unwrap_err();
    assert!(message.to_string().contains("`y` has 35 values, expected 36"), "{message}");
}

/// Values of a buffer.
fn values(context: &GpuContext, buffer: &GrowBuffer, count: usize) -> Vec<f32> {
    let mut staging = GrowBuffer::staging("values");
    staging.ensure(context, 4 * count as u64).unwrap();
    let mut commands = Commands::new(context);
    let staging = staging.get(context).unwrap();
    commands.copy((buffer.get(context).unwrap(), 0), (staging, 0), 4 * count as u64);
    commands.submit(&mut CommandMemory::default(), "values").unwrap();
    let mut values = vec![0.0_f32; count];
    read(context, staging, "values", bytemuck::cast_slice_mut(&mut values)).unwrap();
    values
}

#[test]
fn adam_matches_the_cpu() {
    let context = context();
    let rates = [0.1_f32, 0.0, 0.003];
    let rows = 700;
    let len = rows * rates.len();
    let start = noise(4, len);
    let skip: Vec<u32> = (0..rows).map(|row| u32::from(row % 5 == 2)).collect();
    // Two slices; the gradients of the second lie inside a longer buffer.
    let cut = 300;
    let first_grad = [0, 17];
    let mut params = [(); 2].map(|()| GrowBuffer::storage("parameters"));
    let mut grads = [(); 2].map(|()| GrowBuffer::storage("gradients"));
    params[0].upload(&context, &start[..cut * 3]).unwrap();
    params[1].upload(&context, &start[cut * 3..]).unwrap();
    let mut flags = GrowBuffer::storage("flags");
    flags.upload(&context, &skip).unwrap();
    let mut adam = DeviceAdam::new(&context, &rates).unwrap();
    let mut cpu = cuar::Adam::<f64>::new(len);
    let mut truth = widen(&start);
    for step in 0..6 {
        // Gradients of very different sizes; some are zero, one is denormal.
        let mut gradient = noise(5 + step, len);
        for (k, g) in gradient.iter_mut().enumerate() {
            *g *= [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0, 100.0][k % 9];
        }
        gradient[3..6].fill(0.0);
        gradient[6] = 1e-40;
        let shifted = [&[9.0; 17][..], &gradient[cut * 3..]].concat();
        grads[0].upload(&context, &gradient[..cut * 3]).unwrap();
        grads[1].upload(&context, &shifted).unwrap();
        let slices: Vec<ParameterSlice<'_>> = [0, 1]
            .map(|i| ParameterSlice {
                values: params[i].get(&context).unwrap(),
                grads: grads[i].get(&context).unwrap(),
                first_grad: first_grad[i],
                first_row: i * cut,
                rows: if i == 0 { cut } else { rows - cut },
                columns: 3,
            })
            .to_vec();
        let mut commands = Commands::new(&context);
        adam.encode(&mut commands, &slices, Some(flags.get(&context).unwrap())).unwrap();
        commands.submit(&mut CommandMemory::default(), "adam").unwrap();
        let rates = rates.map(f64::from);
        let rows = (0..skip.len()).filter(|&row| skip[row] == 0).map(|row| [row, row]);
        cpu.step(&mut truth, &widen(&gradient), &rates, rows);
    }
    let mut found = values(&context, &params[0], cut * 3);
    found.extend(values(&context, &params[1], (rows - cut) * 3));
    let [m, v] = adam.moments().unwrap();
    for k in 0..len {
        let (row, column) = (k / 3, k % 3);
        if skip[row] != 0 || column == 1 {
            assert_eq!(found[k].to_bits(), start[k].to_bits(), "value {k} must not change");
        }
        let close = (f64::from(found[k]) - truth[k]).abs() < 2e-6;
        // A denormal gradient may count as zero.
        assert!(close || k == 6, "value {k}: {} {}", found[k], truth[k]);
        if skip[row] != 0 {
            assert_eq!((m[k], v[k]), (0.0, 0.0), "moments {k} must not change");
        }
    }
    assert_grad_close("first moments", &widen(&m), &cpu.m, 1e-5);
    assert_grad_close("second moments", &widen(&v), &cpu.v, 1e-5);
}
