//! Problems with listed pairs, unmatched options, exact marginals, warm starts and posteriors.
#![expect(clippy::unwrap_used, reason = "tests may unwrap, helpers included")]

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use test_support::compare::assert_close;
use uot::{
    EntropyReference, NO_ROW, Sinkhorn, SinkhornParams, UotError, UotOutput, UotProblem,
    WelschParams, solve,
};

const ENFORCED: f64 = f64::INFINITY;

#[derive(Clone, Debug)]
struct Pairs {
    rows: usize,
    cols: usize,
    starts: Vec<usize>,
    ids: Vec<u32>,
    costs: Vec<f64>,
}

impl Pairs {
    /// Random pairs, in random order within a row; every row and column has at least one unless
    /// `density` is 0.
    fn random(rows: usize, cols: usize, density: f64, scale: f64, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (mut starts, mut ids, mut costs) = (vec![0], Vec::new(), Vec::new());
        for i in 0..rows {
            let kept = |j: usize, draw: f64| draw < density || j % rows == i || i % cols == j;
            let mut row: Vec<usize> = (0..cols).filter(|&j| kept(j, rng.random())).collect();
            if seed % 2 == 1 {
                row.reverse();
            }
            for j in row {
                ids.push(u32::try_from(j).unwrap());
                costs.push(scale * rng.random::<f64>());
            }
            starts.push(ids.len());
        }
        Self { rows, cols, starts, ids, costs }
    }

    fn problem(&self) -> UotProblem<'static> {
        let (starts, ids, costs) = (self.starts.clone(), self.ids.clone(), self.costs.clone());
        UotProblem::from_csr(starts, ids, costs, self.cols).unwrap()
    }

    fn transposed(&self) -> Self {
        let mut rows = vec![Vec::new(); self.cols];
        for i in 0..self.rows {
            for at in self.starts[i]..self.starts[i + 1] {
                rows[self.ids[at] as usize].push((u32::try_from(i).unwrap(), self.costs[at]));
            }
        }
        let mut other = Self {
            rows: self.cols,
            cols: self.rows,
            starts: vec![0],
            ids: Vec::new(),
            costs: Vec::new(),
        };
        for row in rows {
            other.ids.extend(row.iter().map(|entry| entry.0));
            other.costs.extend(row.iter().map(|entry| entry.1));
            other.starts.push(other.ids.len());
        }
        other
    }

    /// Row and column of every listed pair.
    fn pairs(&self) -> Vec<(usize, usize)> {
        let row = |i: usize| (self.starts[i]..self.starts[i + 1]).map(move |at| (i, at));
        (0..self.rows).flat_map(row).map(|(i, at)| (i, self.ids[at] as usize)).collect()
    }
}

fn weights(lambda_ent: f64, lambda_a: f64, lambda_b: f64) -> SinkhornParams {
    SinkhornParams { lambda_ent, lambda_a, lambda_b, tol: 1e-12, ..SinkhornParams::default() }
}

fn marginal(len: usize, seed: u64) -> Vec<f64> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let raw: Vec<f64> = (0..len).map(|_| 0.2 + rng.random::<f64>()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

/// Sums over rows and columns of a plan in the problem's order.
fn sums(pairs: &Pairs, plan: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut rows, mut cols) = (vec![0.0; pairs.rows], vec![0.0; pairs.cols]);
    for (&(i, j), p) in pairs.pairs().iter().zip(plan) {
        rows[i] += p;
        cols[j] += p;
    }
    (rows, cols)
}

fn same_bits(x: &UotOutput, y: &UotOutput) -> bool {
    let bits = |out: &UotOutput| -> Vec<u64> {
        out.f.iter().chain(&out.g).chain(&out.col_mass).map(|x| x.to_bits()).collect()
    };
    bits(x) == bits(y) && x.sweeps == y.sweeps
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 32, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(5),
        ..ProptestConfig::default()
    })]

    #[test]
    fn full_support_is_the_dense_problem(
        n in 1_usize..25, m in 1_usize..25, seed in 0_u64..1000,
        lambda_ent in 0.02..0.5, lambda_a in 0.05..9.0, lambda_b in 0.05..9.0, hold in 0..4,
    ) {
        let pairs = Pairs::random(n, m, 2.0, 4.0, 2 * seed);
        let (a, b) = (marginal(n, seed), marginal(m, seed + 1));
        let lambda_a = if hold & 1 > 0 { ENFORCED } else { lambda_a };
        let lambda_b = if hold & 2 > 0 { ENFORCED } else { lambda_b };
        let params = weights(lambda_ent, lambda_a, lambda_b);
        let sparse = pairs.problem().with_marginals(a.clone(), b.clone()).unwrap();
        let dense = UotProblem::from_cost(pairs.costs.clone(), n, m).unwrap();
        let dense = dense.with_marginals(a, b).unwrap();
        let (x, y) = (solve(&sparse, &params).unwrap(), solve(&dense, &params).unwrap());
        prop_assert!(x.converged && y.converged, "{:?} {:?}", x.residuals.last(), y.residuals.last());
        assert_close("plan", &x.plan(&sparse).unwrap(), &y.plan(&dense).unwrap(), 1e-10, 1e-7);
        assert_close("entries", &x.plan_entries(&sparse).unwrap(), &x.plan(&sparse).unwrap(), 0.0, 1e-14);
        assert_close("objective", &[x.objective], &[y.objective], 1e-9, 1e-9);
        prop_assert_eq!(&x.correspondence(&sparse).unwrap().rows, &y.correspondence(&dense).unwrap().rows);
        let (p, q) = (x.col_posterior(&sparse).unwrap(), y.col_posterior(&dense).unwrap());
        assert_close("column posterior", &p.shares, &q.shares, 1e-9, 0.0);
    }

    #[test]
    fn conditions_of_the_optimum(
        n in 1_usize..40, m in 1_usize..40, seed in 0_u64..1000, density in 0.05..0.6,
        lambda_ent in 0.02..0.5, lambda_a in 0.2..9.0, lambda_b in 0.2..9.0, options in 0..8,
    ) {
        let pairs = Pairs::random(n, m, density, 5.0, seed);
        let (a, b) = (marginal(n, seed), marginal(m, seed + 1));
        let (costs_a, costs_b) = (vec![2.0; n], (0..m).map(|j| 1.0 + (j % 3) as f64).collect::<Vec<_>>());
        let mut problem = pairs.problem().with_marginals(a.clone(), b.clone()).unwrap();
        if options & 1 > 0 {
            problem = problem.with_unmatched_rows(costs_a.clone()).unwrap();
        }
        if options & 2 > 0 {
            problem = problem.with_unmatched_cols(costs_b.clone()).unwrap();
        }
        let lambda_b = if options & 4 > 0 { ENFORCED } else { lambda_b };
        let params = weights(lambda_ent, lambda_a, lambda_b);
        let out = solve(&problem, &params).unwrap();
        prop_assert!(out.converged, "residual {:?} in {}", out.residuals.last(), out.sweeps);
        let plan = out.plan_entries(&problem).unwrap();
        let (rows, cols) = sums(&pairs, &plan);
        assert_close("row_mass", &out.row_mass, &rows, 1e-14, 1e-9);
        assert_close("col_mass", &out.col_mass, &cols, 1e-14, 1e-9);
        for (k, (&(i, j), p)) in pairs.pairs().iter().zip(&plan).enumerate() {
            let expected = a[i] * b[j] * ((out.f[i] + out.g[j] - pairs.costs[k]) / lambda_ent).exp();
            prop_assert!((p - expected).abs() <= 1e-10 * expected, "entry {k}");
        }
        // stationarity, including mass without counterpart
        let free = |k: usize, potential: f64, weight: f64, cost: &[f64], mass: &[f64]| {
            let expected = if mass.is_empty() { 0.0 } else {
                weight * ((potential - cost[k]) / lambda_ent).exp()
            };
            let found = mass.get(k).copied().unwrap_or(0.0);
            assert!((found - expected).abs() <= 1e-12 + 1e-9 * expected, "unmatched {k}");
            found
        };
        for i in 0..n {
            let total = rows[i] + free(i, out.f[i], a[i], &costs_a, &out.unmatched_row_mass);
            prop_assert!((out.f[i] + lambda_a * (total / a[i]).ln()).abs() < 1e-8, "row {i}");
        }
        for j in 0..m {
            let total = cols[j] + free(j, out.g[j], b[j], &costs_b, &out.unmatched_col_mass);
            if lambda_b.is_infinite() {
                prop_assert!((total / b[j] - 1.0).abs() < 1e-9, "column {j} is enforced");
            } else {
                prop_assert!((out.g[j] + lambda_b * (total / b[j]).ln()).abs() < 1e-8, "column {j}");
            }
        }
        // the objective written out
        let kl = |x: f64, y: f64| x * (x / y).ln() - x + y;
        let mut value = lambda_ent * (a.iter().sum::<f64>() * b.iter().sum::<f64>() - plan.iter().sum::<f64>());
        for (k, (&(i, j), p)) in pairs.pairs().iter().zip(&plan).enumerate() {
            value += p * pairs.costs[k] + lambda_ent * p * (p / (a[i] * b[j])).ln();
        }
        for i in 0..n {
            let extra = out.unmatched_row_mass.get(i).copied();
            value += extra.map_or(0.0, |x| x * costs_a[i] + lambda_ent * kl(x, a[i]));
            value += lambda_a * kl(rows[i] + extra.unwrap_or(0.0), a[i]);
        }
        for j in 0..m {
            let extra = out.unmatched_col_mass.get(j).copied();
            value += extra.map_or(0.0, |x| x * costs_b[j] + lambda_ent * kl(x, b[j]));
            if lambda_b.is_finite() {
                value += lambda_b * kl(cols[j] + extra.unwrap_or(0.0), b[j]);
            }
        }
        prop_assert!((value - out.objective).abs() < 1e-8 * (1.0 + value.abs()), "{value} {}", out.objective);
        // posteriors
        let by_col = out.col_posterior(&problem).unwrap();
        for j in 0..m {
            let (ids, shares) = by_col.column(j);
            let sum = shares.iter().sum::<f64>() + by_col.unmatched[j];
            prop_assert!((sum - 1.0).abs() < 1e-12, "column {j} sums to {sum}");
            prop_assert!(ids.windows(2).all(|pair| pair[0] < pair[1]), "ascending rows");
            if options & 6 == 6 {
                let none = out.unmatched_col_mass[j] / b[j];
                prop_assert!((by_col.unmatched[j] - none).abs() < 1e-9, "unmatched mass belongs to none");
            }
        }
        // swapping the sides transposes the plan
        let other = pairs.transposed();
        let mut swapped = other.problem().with_marginals(b, a).unwrap();
        if options & 2 > 0 {
            swapped = swapped.with_unmatched_rows(costs_b).unwrap();
        }
        if options & 1 > 0 {
            swapped = swapped.with_unmatched_cols(costs_a).unwrap();
        }
        let back = solve(&swapped, &weights(lambda_ent, lambda_b, lambda_a)).unwrap();
        let (x, y) = (out.plan(&problem).unwrap(), back.plan(&swapped).unwrap());
        for i in 0..n {
            for j in 0..m {
                let (p, q) = (x[i * m + j], y[j * n + i]);
                prop_assert!((p - q).abs() <= 1e-7 * p, "entry {i},{j}: {p:e} {q:e}");
            }
        }
        // a warm start from its own potentials gives the same plan immediately; from those of
        // a different weight, also the same plan
        let solver = Sinkhorn::new(params).unwrap();
        let warm = solver.solve_from(&problem, &out.g).unwrap();
        prop_assert!(warm.converged && warm.sweeps <= 3, "{} sweeps", warm.sweeps);
        let near = solve(&problem, &weights(1.3 * lambda_ent, lambda_a, lambda_b)).unwrap();
        let warm = solver.solve_from(&problem, &near.g).unwrap();
        prop_assert!(warm.converged, "{:?}", warm.residuals.last());
        assert_close("warm plan", &warm.plan_entries(&problem).unwrap(), &plan, 1e-10, 1e-7);
    }
}

#[test]
fn unmatched_columns_are_a_mixture_with_an_outlier_class() {
    // rows free, columns exact: every column is the softmax of its likelihoods, including
    // "unmatched"
    let pairs = Pairs::random(6, 40, 0.4, 3.0, 4);
    let problem = pairs.problem().with_unmatched_cols(vec![1.2; 40]).unwrap();
    let out = solve(&problem, &weights(0.5, 1e-9, ENFORCED)).unwrap();
    let posterior = out.col_posterior(&problem).unwrap();
    for j in 0..40 {
        let likelihood = |cost: f64| (-cost / 0.5).exp();
        let own: Vec<f64> = pairs
            .pairs()
            .iter()
            .zip(&pairs.costs)
            .filter(|((_, col), _)| *col == j)
            .map(|(_, &cost)| likelihood(cost) / 6.0)
            .collect();
        let total = own.iter().sum::<f64>() + likelihood(1.2);
        assert_close(
            "shares",
            posterior.column(j).1,
            &own.iter().map(|x| x / total).collect::<Vec<_>>(),
            1e-8,
            0.0,
        );
        assert!((posterior.unmatched[j] - likelihood(1.2) / total).abs() < 1e-8, "none");
    }
}

#[test]
fn results_are_bit_identical_for_any_number_of_threads() {
    let pairs = Pairs::random(700, 3000, 0.01, 8.0, 9);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let problem = pairs.problem().with_unmatched_cols(vec![4.0; 3000]).unwrap();
            let out = solve(&problem, &weights(0.02, 1.0, ENFORCED)).unwrap();
            let posterior = out.col_posterior(&problem).unwrap();
            (out, posterior)
        })
    };
    let one = run(1);
    assert!(one.0.converged, "{:?}", one.0.residuals.last());
    for threads in [2, 7] {
        let other = run(threads);
        assert!(same_bits(&one.0, &other.0) && one.1 == other.1, "{threads} threads");
    }
}

#[test]
fn rows_and_columns_without_candidates_carry_no_mass() {
    // row 1 and column 2 have no pairs
    let problem =
        || UotProblem::from_csr(vec![0, 2, 2, 3], vec![0, 1, 1], vec![0.1, 0.4, 0.0], 3).unwrap();
    let out = solve(&problem(), &weights(0.1, 1.0, 1.0)).unwrap();
    assert!(out.converged, "{:?}", out.residuals);
    assert!(out.row_mass[1] == 0.0 && out.col_mass[2] == 0.0, "no mass");
    assert!(out.f[1] == 0.0 && out.g[2] == 0.0, "potential 0");
    let found = out.correspondence(&problem()).unwrap();
    assert_eq!((found.rows[2], found.tie_counts[2]), (NO_ROW, 0), "nothing to match");
    let top = out.top_rows(&problem(), 2).unwrap();
    assert_eq!((top[1].row, top[1].share), (NO_ROW, 0.0), "column 0 has one candidate");
    let by_col = out.col_posterior(&problem()).unwrap();
    assert!(by_col.unmatched[2] == 1.0 && by_col.column(2).0.is_empty(), "{by_col:?}");
    for (a, b, text) in [(ENFORCED, 1.0, "row 1"), (1.0, ENFORCED, "column 2")] {
        let error = solve(&problem(), &weights(0.1, a, b)).unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
    }
    // a point of weight 0 receives no mass, and a candidate of weight 0 gives none
    let (a, b) = (vec![0.5, 0.0, 0.5], vec![0.5, 0.5, 0.0]);
    let held = problem().with_marginals(a, b).unwrap();
    assert!(
        solve(&held, &weights(0.1, ENFORCED, ENFORCED)).unwrap().converged,
        "row 1 has no mass"
    );
    let starved = problem().with_marginals(vec![1.0; 3], vec![1.0, 0.0, 1.0]).unwrap();
    let out = solve(&starved, &weights(0.1, 1.0, 1.0)).unwrap();
    assert!(out.converged && out.row_mass[2] == 0.0, "row 2 can send to column 1 only");
    let free = problem().with_unmatched_rows(vec![0.3; 3]).unwrap();
    let out = solve(&free, &weights(0.1, ENFORCED, 1.0)).unwrap();
    assert!((out.unmatched_row_mass[1] - 1.0 / 3.0).abs() < 1e-12, "row 1 stays unmatched");
}

#[test]
fn costs_of_any_magnitude_are_solved() {
    // up to ten thousand λ0 between candidates
    for (scale, lambda_a, lambda_b) in [
        (1e4, 50.0, 1.0),
        (1e4, 50.0, ENFORCED),
        (1e4, 1.0, ENFORCED),
        (20.0, ENFORCED, ENFORCED),
        (1e-6, 1.0, 1.0),
    ] {
        let pairs = Pairs::random(60, 60, 0.1, scale, 12);
        let params = SinkhornParams { tol: 1e-7, ..weights(1.0, lambda_a, lambda_b) };
        let problem = pairs.problem();
        let out = solve(&problem, &params).unwrap();
        assert!(out.converged, "{scale} {lambda_a} {lambda_b}: {:?}", out.residuals.last());
        assert!(out.sweeps < 300, "{scale} {lambda_a} {lambda_b}: {} sweeps", out.sweeps);
        let (_, cols) = sums(&pairs, &out.plan_entries(&problem).unwrap());
        assert_close("col_mass", &out.col_mass, &cols, 1e-12, 1e-6);
        if lambda_b.is_infinite() {
            assert_close("held", &cols, &[1.0 / 60.0; 60], 1e-7, 0.0);
        }
    }
}

#[test]
fn bad_input_is_an_error() {
    let check = |error: UotError, text: &str| {
        let message = error.to_string();
        assert!(message.contains(text), "{message:?} should mention {text:?}");
    };
    let csr = |starts: &[usize], ids: &[u32], costs: &[f64], cols| {
        UotProblem::from_csr(starts.to_vec(), ids.to_vec(), costs.to_vec(), cols)
    };
    check(csr(&[], &[], &[], 2).unwrap_err(), "row");
    check(csr(&[0], &[], &[], 2).unwrap_err(), "row");
    check(csr(&[0, 1], &[0], &[1.0], 0).unwrap_err(), "column");
    check(csr(&[0, 0], &[], &[], 2).unwrap_err(), "candidate");
    check(csr(&[1, 1], &[0], &[1.0], 2).unwrap_err(), "row_starts[0]");
    check(csr(&[0, 2, 1], &[0], &[1.0], 2).unwrap_err(), "row_starts[2]");
    check(csr(&[0, 2], &[0], &[1.0], 2).unwrap_err(), "row_starts[1]");
    check(csr(&[0, usize::MAX], &[0], &[1.0], 2).unwrap_err(), "row_starts[1]");
    check(csr(&[0, 1], &[2], &[1.0], 2).unwrap_err(), "cols[0] = 2");
    check(csr(&[0, 3], &[1, 0, 1], &[1.0; 3], 2).unwrap_err(), "cols[2] = 1");
    check(csr(&[0, 1], &[0], &[1.0, 2.0], 2).unwrap_err(), "costs has 2");
    for cost in [f64::NAN, f64::INFINITY] {
        check(csr(&[0, 1], &[0], &[cost], 2).unwrap_err(), "costs[0]");
    }
    let problem = || csr(&[0, 2], &[0, 1], &[0.0, 1.0], 2).unwrap();
    check(problem().with_unmatched_cols(vec![1.0]).unwrap_err(), "unmatched_cols has 1");
    check(problem().with_unmatched_rows(vec![f64::NAN]).unwrap_err(), "unmatched_rows[0]");
    let solver = Sinkhorn::new(SinkhornParams::default()).unwrap();
    check(solver.solve_from(&problem(), &[0.0]).unwrap_err(), "g has 1");
    check(solver.solve_from(&problem(), &[0.0, f64::NAN]).unwrap_err(), "g[1]");
    let unequal = problem().with_marginals(vec![1.0], vec![1.0, 1.0]).unwrap();
    check(solve(&unequal, &weights(0.1, ENFORCED, ENFORCED)).unwrap_err(), "sums to 1 and b to 2");
    assert!(
        solve(&unequal, &weights(0.1, ENFORCED, 1.0)).unwrap().converged,
        "one side may give way"
    );
    let free = problem().with_unmatched_cols(vec![1.0; 2]).unwrap();
    let params = SinkhornParams { reference: EntropyReference::Entropy, ..Default::default() };
    check(solve(&free, &params).unwrap_err(), "unmatched");
    let points = [[0.0], [1.0]];
    let near = UotProblem::welsch(&points, &points, &WelschParams::default()).unwrap();
    let out = solve(&near, &SinkhornParams::default()).unwrap();
    check(out.col_posterior(&near).unwrap_err(), "top_rows");
    check(out.plan_entries(&near).unwrap_err(), "plan_column");
}
