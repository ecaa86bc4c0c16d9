//! The exact median equals that of all sorted distances, for any size, ties and dimension.
#![expect(clippy::unwrap_used, reason = "tests may unwrap, helpers included")]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use uot::{MedianMode, UotError, median_distance};

fn brute<const D: usize>(src: &[[f64; D]], edit: &[[f64; D]]) -> (f64, f64) {
    let mut all: Vec<f64> = src
        .iter()
        .flat_map(|p| edit.iter().map(|q| p.iter().zip(q).map(|(x, y)| (x - y).powi(2)).sum()))
        .collect();
    all.sort_by(f64::total_cmp);
    let (low, high): (f64, f64) = (all[(all.len() - 1) / 2], all[all.len() / 2]);
    (low.sqrt(), 0.5 * (low.sqrt() + high.sqrt()))
}

fn check<const D: usize>(what: &str, src: &[[f64; D]], edit: &[[f64; D]]) {
    let found = median_distance(src, edit, MedianMode::Exact).unwrap();
    let (lower, value) = brute(src, edit);
    assert!((found.lower - lower).abs() <= 1e-14 * lower, "{what}: lower {} {lower}", found.lower);
    assert!((found.value - value).abs() <= 1e-14 * value, "{what}: {} {value}", found.value);
    assert!(found.exact && found.pairs == src.len() * edit.len(), "{what}: all pairs ranked");
}

fn cloud<const D: usize>(n: usize, seed: u64) -> Vec<[f64; D]> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..n).map(|_| std::array::from_fn(|_| rng.random::<f64>())).collect()
}

#[test]
fn medians_of_small_clouds_of_every_parity() {
    for n in 1..12 {
        for m in 1..12 {
            check(&format!("{n}x{m}"), &cloud::<3>(n, n as u64), &cloud::<3>(m, 100 + m as u64));
        }
    }
}

#[test]
fn medians_of_clouds_that_need_a_bracket() {
    check("smooth 3-D", &cloud::<3>(1500, 1), &cloud::<3>(1201, 2));
    check("smooth 1-D", &cloud::<1>(1500, 3), &cloud::<1>(1200, 4));
    check("smooth 5-D", &cloud::<5>(1100, 5), &cloud::<5>(900, 6));
}

#[test]
fn medians_of_a_hundred_thousand_ties() {
    let lattice: Vec<[f64; 3]> = (0..2197)
        .map(|k| [f64::from(k % 13), f64::from(k / 13 % 13), f64::from(k / 169)])
        .collect();
    check("lattice", &lattice, &lattice[..1800]);
    // one value for more pairs than are collected at most
    let (left, right) = (vec![[0.0, 0.0]; 2000], vec![[3.0, 4.0]; 1501]);
    check("two clumps", &left, &right);
    let mut three = vec![[0.0, 0.0]; 1000];
    three.extend(vec![[1.0, 0.0]; 1000]);
    check("three values, rank at a border", &three, &vec![[0.0, 0.0]; 1500]);
}

#[test]
fn medians_with_outliers() {
    let mut src = cloud::<3>(1300, 7);
    src[5] = [1e9, -1e9, 1e8];
    src[6] = [-1e140, 0.0, 0.0];
    check("far outliers", &src, &cloud::<3>(1300, 8));
}

#[test]
fn sampled_median_is_within_its_stated_rank_error() {
    let (src, edit) = (cloud::<3>(700, 9), cloud::<3>(600, 10));
    let mode = MedianMode::Sampled { pairs: 100_000, seed: 3 };
    let found = median_distance(&src, &edit, mode).unwrap();
    assert!(!found.exact && found.pairs == 100_000, "marked as sampled");
    assert!((found.rank_error - 0.008_517).abs() < 1e-5, "Hoeffding bound: {}", found.rank_error);
    let below = src
        .iter()
        .flat_map(|p| edit.iter().map(|q| p.iter().zip(q).map(|(x, y)| (x - y).powi(2)).sum()))
        .filter(|d: &f64| d.sqrt() < found.value)
        .count();
    let rank = below as f64 / (700.0 * 600.0);
    assert!((rank - 0.5).abs() < found.rank_error, "rank {rank}");
    assert_eq!(found, median_distance(&src, &edit, mode).unwrap(), "same seed, same value");
}

#[test]
fn bad_input_is_an_error() {
    let good = [[0.0, 1.0]];
    for (bad, expected) in [
        (vec![], "the column side is empty"),
        (vec![[0.0, 0.0], [f64::NAN, 0.0]], "cols[1] = NaN"),
        (vec![[f64::INFINITY, 0.0]], "cols[0] = inf"),
        (vec![[1e200, 0.0]], "magnitude at most 1e150"),
    ] {
        let error = median_distance(&good, &bad, MedianMode::Auto).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let none = MedianMode::Sampled { pairs: 0, seed: 0 };
    let error = median_distance(&good, &good, none).unwrap_err();
    assert!(matches!(error, UotError::BadParam { name: "pairs", .. }), "{error}");
}
