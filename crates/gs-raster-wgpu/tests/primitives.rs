//! Prefix sum and stable sort in isolation, at lengths around block boundaries.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{MODES, Mode, raster};
use gs_raster_wgpu::kernels::DeviceFeatures;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Lengths 0, 1, and around one group, one scan block, one sort block and two scan levels.
const LENGTHS: [usize; 15] =
    [0, 1, 2, 255, 256, 257, 1023, 1024, 1025, 2047, 2048, 2049, 4096, 100_003, 1 << 20];

fn numbers(seed: u64, len: usize, below: u32) -> Vec<u32> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..len).map(|_| rng.random_range(0..below)).collect()
}

#[test]
fn scan_is_the_running_sum() {
    let context = raster(Mode::Portable).context().clone();
    for len in LENGTHS {
        let values = numbers(1, len, 4000);
        let expected: Vec<u32> = values
            .iter()
            .scan(0, |sum, value| {
                let before = *sum;
                *sum += value;
                Some(before)
            })
            .collect();
        assert_eq!(context.exclusive_scan(&values).unwrap(), expected, "{len} values");
    }
}

#[test]
fn scan_of_three_levels() {
    let context = raster(Mode::Portable).context().clone();
    let len = (1 << 20) + 1025;
    let scanned = context.exclusive_scan(&vec![3; len]).unwrap();
    let wrong = scanned.iter().enumerate().position(|(i, &sum)| sum as usize != 3 * i);
    assert_eq!(wrong, None, "first wrong position");
}

#[test]
fn scan_saturates_instead_of_wrapping() {
    let context = raster(Mode::Portable).context().clone();
    let scanned = context.exclusive_scan(&vec![1 << 22; 3000]).unwrap();
    for (i, &sum) in scanned.iter().enumerate() {
        let expected = u32::try_from(i << 22).unwrap_or(u32::MAX);
        assert_eq!(sum, expected, "at {i}");
    }
}

fn check_sort(keys: &[u32], bits: u32, what: &str) {
    let context = raster(Mode::Portable).context().clone();
    let values: Vec<u32> = (0..).take(keys.len()).map(|i: u32| i ^ 0x5a5a).collect();
    let mut expected: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
    expected.sort_by_key(|(key, _)| u64::from(*key) % (1 << bits));
    let (sorted, moved) = context.sort_pairs(keys, &values, bits).unwrap();
    let ours: Vec<(u32, u32)> = sorted.into_iter().zip(moved).collect();
    let wrong = ours.iter().zip(&expected).position(|(a, b)| a != b);
    assert_eq!(wrong, None, "{what}, {} keys: first wrong position", keys.len());
    assert_eq!(ours.len(), expected.len(), "{what}");
}

#[test]
fn sort_is_stable_at_every_length() {
    for len in LENGTHS {
        check_sort(&numbers(2, len, u32::MAX), 32, "random keys");
        check_sort(&numbers(3, len, 5), 8, "five keys, one digit");
        check_sort(&vec![7; len.min(5000)], 32, "equal keys");
    }
}

#[test]
fn sort_ignores_bits_above_the_requested_ones() {
    let keys: Vec<u32> = numbers(4, 5000, 1 << 16).iter().map(|key| key | 0xabcd_0000).collect();
    check_sort(&keys, 16, "high bits set");
}

/// Sorting by depth and then by tile equals sorting by (tile, depth, index).
#[test]
fn two_stable_sorts_order_by_tile_then_depth_then_index() {
    let context = raster(Mode::Portable).context().clone();
    let len = 10_000;
    let depths = numbers(5, len, 50);
    let tiles = numbers(6, len, 300);
    let ids: Vec<u32> = (0..).take(len).collect();
    let (_, by_depth) = context.sort_pairs(&depths, &ids, 32).unwrap();
    let tile_keys: Vec<u32> = by_depth.iter().map(|&id| tiles[id as usize]).collect();
    let (_, ours) = context.sort_pairs(&tile_keys, &by_depth, 9).unwrap();
    let mut expected = ids;
    expected.sort_by_key(|&id| (tiles[id as usize], depths[id as usize], id));
    assert_eq!(ours, expected, "order");
}

/// Negative control: the check of stability detects an unstable order.
#[test]
fn a_swapped_tie_is_detected() {
    let keys = [1_u32, 1, 0];
    let (_, order) = raster(Mode::Portable).context().sort_pairs(&keys, &[10, 11, 12], 32).unwrap();
    assert_eq!(order, [12, 10, 11], "stable");
    assert_ne!(order, [12, 11, 10], "unstable");
}

#[test]
fn different_lengths_are_refused() {
    let error = raster(Mode::Portable).context().sort_pairs(&[1, 2], &[1], 32).unwrap_err();
    assert!(error.to_string().contains("1 values for 2 keys"), "{error}");
}

#[test]
fn every_mode_has_a_device() {
    for mode in MODES {
        let raster = raster(mode);
        eprintln!(
            "{mode:?}: {}, using {:?}",
            raster.context().adapter(),
            raster.context().features()
        );
        if mode == Mode::Portable {
            assert_eq!(raster.context().features(), DeviceFeatures::default(), "core WGSL only");
            assert!(raster.context().max_binding_bytes() <= 128 << 20, "default limits");
        }
    }
}
