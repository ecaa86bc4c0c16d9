//! Properties of any problem: symmetry, scaling laws, bounds, order and thread independence,
//! degenerate clouds.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use test_support::compare::assert_close;
use uot::{
    Acceleration, Bandwidth, EntropyReference, SinkhornParams, Storage, UotError, UotOutput,
    UotProblem, WelschParams, solve,
};

/// A folded sheet of `n` points with noise: near, middle and far pairs.
fn sheet(n: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..n)
        .map(|_| {
            let (s, t) = (rng.random::<f64>() * 4.0, rng.random::<f64>());
            [s.sin() + 0.02 * rng.random::<f64>(), t, s.cos() * s + 0.02 * rng.random::<f64>()]
        })
        .collect()
}

fn welsch(gamma: f64, cutoff: f64) -> WelschParams {
    let bandwidth = Bandwidth::MedianTimes(gamma);
    WelschParams { bandwidth, cutoff, ..WelschParams::default() }
}

fn weights(lambda_ent: f64, lambda_a: f64, lambda_b: f64) -> SinkhornParams {
    SinkhornParams { lambda_ent, lambda_a, lambda_b, tol: 1e-12, ..SinkhornParams::default() }
}

fn assert_same_bits(what: &str, x: &[f64], y: &[f64]) {
    assert_eq!(x.len(), y.len(), "{what}: length");
    for (k, (x, y)) in x.iter().zip(y).enumerate() {
        assert_eq!(x.to_bits(), y.to_bits(), "{what}[{k}]: {x:e} against {y:e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(11),
        ..ProptestConfig::default()
    })]

    #[test]
    fn fixed_point_bounds_and_swap(
        n in 1_usize..60, m in 1_usize..60, seed in 0_u64..1000,
        lambda_ent in 0.02..0.4, lambda_a in 0.05..12.0, lambda_b in 0.05..12.0, gamma in 0.05..0.5,
    ) {
        let (src, edit) = (sheet(n, seed), sheet(m, seed + 5000));
        let params = weights(lambda_ent, lambda_a, lambda_b);
        let problem = UotProblem::welsch(&src, &edit, &welsch(gamma, 9.0)).unwrap();
        let out = solve(&problem, &params).unwrap();
        prop_assert!(out.converged, "residual {:?}", out.residuals.last());
        let plan = out.plan(&problem).unwrap();
        let rows: Vec<f64> = plan.chunks(m).map(|row| row.iter().sum()).collect();
        let cols: Vec<f64> = (0..m).map(|j| plan.iter().skip(j).step_by(m).sum()).collect();
        assert_close("row_mass", &out.row_mass, &rows, 0.0, 1e-11);
        assert_close("col_mass", &out.col_mass, &cols, 0.0, 1e-11);
        // f = −λ1 ln(P1/a), g = −λ2 ln(Pᵀ1/b)
        let f: Vec<f64> = rows.iter().map(|r| -lambda_a * (r * n as f64).ln()).collect();
        let g: Vec<f64> = cols.iter().map(|c| -lambda_b * (c * m as f64).ln()).collect();
        assert_close("f", &out.f, &f, 3e-11, 0.0);
        assert_close("g", &out.g, &g, 3e-11, 0.0);
        // (Pᵀ1)_j = b_j S_j^{λ0/(λ0+λ2)}, S_j = Σ_i a_i ũ_i K_ij
        let dense = UotProblem::welsch_dense(&src, &edit, &welsch(gamma, 9.0)).unwrap();
        let cost = dense.cost_matrix().unwrap();
        for j in 0..m {
            let s: f64 = (0..n)
                .map(|i| ((out.f[i] - cost[i * m + j]) / lambda_ent).exp() / n as f64)
                .sum();
            let expected = s.powf(lambda_ent / (lambda_ent + lambda_b)) / m as f64;
            prop_assert!((cols[j] - expected).abs() < 1e-9 * expected, "column {j}");
            // every column keeps at least the share of an unrelated one
            let inlier = cols.iter().copied().fold(0.0, f64::max);
            let bound = (-1.0 / (lambda_ent + lambda_b)).exp();
            prop_assert!(cols[j] >= bound * inlier * (1.0 - 1e-9), "outlier bound, column {j}");
        }
        // the dense solver gives the same plan, and no nearby plan has a lower objective
        let reference = solve(&dense, &params).unwrap();
        assert_close("sparse f", &out.f, &reference.f, 1e-10, 0.0);
        assert_close("sparse g", &out.g, &reference.g, 1e-10, 0.0);
        let value = objective(&plan, cost, n, m, &params);
        prop_assert!((value - out.objective).abs() < 1e-10 * (1.0 + value.abs()), "{value} {}", out.objective);
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let other: Vec<f64> =
            plan.iter().map(|p| p * (1.0 + 0.02 * (rng.random::<f64>() - 0.5))).collect();
        prop_assert!(objective(&other, cost, n, m, &params) > value, "a minimum");
        // swapping the sides transposes the plan
        let swapped = UotProblem::welsch(&edit, &src, &welsch(gamma, 9.0)).unwrap();
        let back = solve(&swapped, &weights(lambda_ent, lambda_b, lambda_a)).unwrap();
        let transposed = back.plan(&swapped).unwrap();
        for i in 0..n {
            for j in 0..m {
                let (p, q) = (plan[i * m + j], transposed[j * n + i]);
                prop_assert!((p - q).abs() <= 1e-8 * p, "entry {i},{j}: {p:e} {q:e}");
            }
        }
    }
}

fn objective(plan: &[f64], cost: &[f64], n: usize, m: usize, params: &SinkhornParams) -> f64 {
    let kl = |x: f64, y: f64| x * (x / y).ln() - x + y;
    let (a, b) = (1.0 / n as f64, 1.0 / m as f64);
    let entries: f64 =
        plan.iter().zip(cost).map(|(p, d)| p * d + params.lambda_ent * kl(*p, a * b)).sum();
    let rows: f64 = plan.chunks(m).map(|row| kl(row.iter().sum(), a)).sum();
    let cols: f64 = (0..m).map(|j| kl(plan.iter().skip(j).step_by(m).sum(), b)).sum();
    entries + params.lambda_a * rows + params.lambda_b * cols
}

#[test]
fn plans_of_the_references_differ_by_the_documented_factor() {
    let (src, edit) = (sheet(70, 1), sheet(50, 2));
    let problem = UotProblem::welsch(&src, &edit, &welsch(0.1, 8.0)).unwrap();
    let params = weights(0.1, 1.0, 0.6);
    let kl = solve(&problem, &params).unwrap();
    let all = 1.7;
    let pairs = 70.0_f64 * 50.0;
    for (reference, factor) in [
        (EntropyReference::Entropy, pairs.powf(0.1 / all)),
        (EntropyReference::PLogP, (pairs / std::f64::consts::E).powf(0.1 / all)),
    ] {
        let other = solve(&problem, &SinkhornParams { reference, ..params }).unwrap();
        let expected: Vec<f64> = kl.plan(&problem).unwrap().iter().map(|p| p * factor).collect();
        let plan = other.plan(&problem).unwrap();
        assert_close("plan", &plan, &expected, 0.0, 1e-10);
        assert_close("row mass", &[other.row_mass.iter().sum()], &[other.total_mass], 0.0, 1e-10);
        assert_eq!(
            kl.correspondence(&problem).unwrap().rows,
            other.correspondence(&problem).unwrap().rows,
            "{reference:?}: same matches"
        );
        // value of the objective written out for this reference
        let dense = UotProblem::welsch_dense(&src, &edit, &welsch(0.1, 8.0)).unwrap();
        let cost = dense.cost_matrix().unwrap();
        let extra = if reference == EntropyReference::Entropy { 1.0 } else { 0.0 };
        let entropy: f64 =
            plan.iter().zip(cost).map(|(p, d)| p * d + 0.1 * (p * p.ln() - extra * p)).sum();
        let zero_entropy = SinkhornParams { lambda_ent: 0.0, ..params };
        let rest = objective(&plan, &vec![0.0; plan.len()], 70, 50, &zero_entropy);
        assert_close("objective", &[other.objective], &[entropy + rest], 0.0, 1e-9);
    }
}

#[test]
fn shifting_the_cost_scales_the_plan() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let cost: Vec<f64> = (0..30 * 20).map(|_| rng.random::<f64>() * 3.0 - 1.0).collect();
    let shifted: Vec<f64> = cost.iter().map(|d| d + 0.7).collect();
    let params = weights(0.2, 0.8, 1.5);
    let problems = [cost, shifted].map(|cost| UotProblem::from_cost(cost, 30, 20).unwrap());
    let plans = problems.each_ref().map(|p| solve(p, &params).unwrap().plan(p).unwrap());
    let factor = (-0.7_f64 / 2.5).exp();
    let expected: Vec<f64> = plans[0].iter().map(|p| p * factor).collect();
    assert_close("plan", &plans[1], &expected, 0.0, 1e-9);
}

#[test]
fn tiny_lambda_stays_finite_and_dual_feasible() {
    let (src, edit) = (sheet(40, 5), sheet(30, 6));
    let problem = UotProblem::welsch_dense(&src, &edit, &welsch(0.3, 8.0)).unwrap();
    let out = solve(&problem, &weights(1e-4, 0.3, 0.5)).unwrap();
    assert!(out.f.iter().chain(&out.g).all(|x| x.is_finite()), "finite at λ0 = 1e-4");
    let cost = problem.cost_matrix().unwrap();
    // without the entropy, the dual requires f + g ≤ D
    for (k, d) in cost.iter().enumerate() {
        assert!(out.f[k / 30] + out.g[k % 30] <= d + 2e-3, "entry {k}");
    }
}

#[test]
fn a_small_entropy_weight_gives_the_best_assignment() {
    let mut rng = Pcg64Mcg::seed_from_u64(77);
    for _ in 0..5 {
        let cost: Vec<f64> = (0..36).map(|_| rng.random::<f64>()).collect();
        let best = best_assignment(&cost, 6);
        let problem = UotProblem::from_cost(cost, 6, 6).unwrap();
        let params = SinkhornParams { tol: 1e-4, ..weights(2e-3, 100.0, 100.0) };
        let found = solve(&problem, &params).unwrap().correspondence(&problem).unwrap();
        let rows: Vec<usize> = found.rows.iter().map(|&row| row as usize).collect();
        assert_eq!(rows, best, "rows of the columns");
    }
}

/// Row of each column in the cheapest one-to-one assignment, by exhaustive search.
fn best_assignment(cost: &[f64], n: usize) -> Vec<usize> {
    fn extend(
        cost: &[f64],
        n: usize,
        rows: &mut Vec<usize>,
        spent: f64,
        best: &mut (f64, Vec<usize>),
    ) {
        if rows.len() == n && spent < best.0 {
            *best = (spent, rows.clone());
        }
        for row in 0..n {
            if rows.len() < n && !rows.contains(&row) {
                let price = cost[row * n + rows.len()];
                rows.push(row);
                extend(cost, n, rows, spent + price, best);
                rows.pop();
            }
        }
    }
    let mut best = (f64::INFINITY, Vec::new());
    extend(cost, n, &mut Vec::new(), 0.0, &mut best);
    best.1
}

#[test]
fn both_dense_kernels_agree_at_the_switch() {
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let cost: Vec<f64> = (0..25 * 35).map(|_| rng.random::<f64>()).collect();
    let spread = |range: f64| {
        let mut cost = cost.clone();
        (cost[0], cost[1]) = (0.0, range);
        UotProblem::from_cost(cost, 25, 35).unwrap()
    };
    // (max − min)/λ0 = 200 is the border; one entry at the far end carries no mass on either side
    // of it
    let params = weights(0.01, 1.0, 1.0);
    let scaled = solve(&spread(1.999_999), &params).unwrap();
    let logs = solve(&spread(2.000_001), &params).unwrap();
    assert!(scaled.converged && logs.converged, "both converge");
    assert_close("f", &logs.f, &scaled.f, 1e-10, 0.0);
    assert_close("g", &logs.g, &scaled.g, 1e-10, 0.0);
}

#[test]
fn duplicates_share_rows_equally() {
    let (mut src, edit) = (sheet(40, 12), sheet(33, 13));
    let copy = src[3];
    src.extend([copy, copy]);
    let problem = UotProblem::welsch(&src, &edit, &welsch(0.2, 8.0)).unwrap();
    let out = solve(&problem, &weights(0.05, 1.0, 1.0)).unwrap();
    let plan = out.plan(&problem).unwrap();
    for j in 0..33 {
        let [p, q, r] = [3, 40, 41].map(|i: usize| plan[i * 33 + j]);
        assert!((p - q).abs() <= 1e-12 * p && (p - r).abs() <= 1e-12 * p, "column {j}");
    }
    let matches = out.correspondence(&problem).unwrap();
    for (j, &row) in matches.rows.iter().enumerate() {
        assert!(row != 40 && row != 41, "lowest of tied rows, column {j}");
        assert_eq!(matches.tie_counts[j], if row == 3 { 3 } else { 1 }, "column {j}");
    }
    assert!(matches.rows.contains(&3), "the repeated point is the best of a column");
}

#[test]
fn order_of_the_points_does_not_matter() {
    let (src, edit) = (sheet(300, 20), sheet(260, 21));
    let params = weights(0.1, 1.0, 1.0);
    let problem = UotProblem::welsch(&src, &edit, &welsch(0.08, 5.0)).unwrap();
    let out = solve(&problem, &params).unwrap();
    let flip = |points: &[[f64; 3]]| -> Vec<[f64; 3]> { points.iter().rev().copied().collect() };
    let (src2, edit2) = (flip(&src), flip(&edit));
    let problem2 = UotProblem::welsch(&src2, &edit2, &welsch(0.08, 5.0)).unwrap();
    let out2 = solve(&problem2, &params).unwrap();
    let back = |values: &[f64]| -> Vec<f64> { values.iter().rev().copied().collect() };
    assert_same_bits("f", &out.f, &back(&out2.f));
    assert_same_bits("g", &out.g, &back(&out2.g));
    let rows: Vec<u32> =
        out2.correspondence(&problem2).unwrap().rows.iter().rev().map(|row| 299 - row).collect();
    assert_eq!(out.correspondence(&problem).unwrap().rows, rows, "matches follow the points");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let (src, edit) = (sheet(2500, 30), sheet(2300, 31));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let structured = UotProblem::welsch(&src, &edit, &welsch(0.05, 5.0)).unwrap();
            let dense = UotProblem::welsch_dense(&src[..400], &edit[..300], &welsch(0.05, 5.0));
            let dense = dense.unwrap();
            let params = weights(0.05, 1.0, 11.0);
            let logs = SinkhornParams { max_sweeps: 30, ..weights(0.002, 0.1, 0.1) };
            let outputs: [UotOutput; 3] = [
                solve(&structured, &params).unwrap(),
                solve(&dense, &params).unwrap(),
                solve(&dense, &logs).unwrap(),
            ];
            let matches = outputs[0].correspondence(&structured).unwrap();
            let cost = outputs[0].transport_cost(&structured).unwrap();
            (structured.scale(), outputs, matches, cost)
        })
    };
    let (one, many) = (run(1), run(5));
    assert_eq!(one.0, many.0, "scale");
    for (x, y) in one.1.iter().zip(&many.1) {
        assert_same_bits("f", &x.f, &y.f);
        assert_same_bits("g", &x.g, &y.g);
        assert_same_bits("row_mass", &x.row_mass, &y.row_mass);
        assert_same_bits("residuals", &x.residuals, &y.residuals);
    }
    assert_eq!(one.2, many.2, "matches");
    assert_same_bits("⟨D,P⟩", &[one.3], &[many.3]);
}

#[test]
fn plain_sweeps_decrease_the_objective() {
    let (src, edit) = (sheet(80, 40), sheet(70, 41));
    let problem = UotProblem::welsch(&src, &edit, &welsch(0.1, 6.0)).unwrap();
    let params = SinkhornParams { acceleration: Acceleration::Plain, ..weights(0.1, 1.0, 1.0) };
    let out = solve(&problem, &params).unwrap();
    let phi = 1.0 / 1.1_f64;
    for pair in out.residuals[1..].windows(2) {
        assert!(
            pair[1] <= pair[0] * phi * phi * 1.000_001 + 1e-15,
            "contraction by φ1φ2: {pair:?}"
        );
    }
}

#[test]
fn feature_term_equals_the_explicit_cost() {
    let (src, edit) = (sheet(90, 50), sheet(80, 51));
    let extra = |i: usize, j: usize| ((i * 7 + j * 3) % 5) as f64 * 0.4 - 0.1;
    let params = welsch(0.15, 8.0);
    let problem = UotProblem::welsch_with(&src, &edit, &params, extra).unwrap();
    let beta = problem.scale().unwrap().beta;
    let mut cost = Vec::new();
    for (i, p) in src.iter().enumerate() {
        for (j, q) in edit.iter().enumerate() {
            let r2: f64 = p.iter().zip(q).map(|(x, y)| (x - y).powi(2)).sum();
            cost.push(1.0 - (-r2 / (2.0 * beta * beta) - extra(i, j).max(0.0)).exp());
        }
    }
    let dense = UotProblem::from_cost(cost, 90, 80).unwrap();
    let solver = weights(0.05, 11.0, 1.0);
    let (x, y) = (solve(&problem, &solver).unwrap(), solve(&dense, &solver).unwrap());
    assert_close("f", &x.f, &y.f, 1e-10, 0.0);
    assert_close("g", &x.g, &y.g, 1e-10, 0.0);
    assert_close("plan", &x.plan(&problem).unwrap(), &y.plan(&dense).unwrap(), 0.0, 1e-8);
    assert_close(
        "⟨D,P⟩",
        &[x.transport_cost(&problem).unwrap()],
        &[y.transport_cost(&dense).unwrap()],
        0.0,
        1e-9,
    );
    // an infinite term excludes the pair
    let cut = UotProblem::welsch_with(&src, &edit, &params, |_, _| f64::INFINITY).unwrap();
    let none = solve(&cut, &solver).unwrap().correspondence(&cut).unwrap();
    assert!(none.w_best.iter().all(|&w| w <= 0.0), "nothing is near");
}

#[test]
fn degenerate_clouds_have_defined_results() {
    let params = SinkhornParams { tol: 1e-12, ..SinkhornParams::default() };
    let run = |src: &[[f64; 2]], edit: &[[f64; 2]]| {
        let problem = UotProblem::welsch(src, edit, &WelschParams::default()).unwrap();
        let out = solve(&problem, &params).unwrap();
        assert!(out.converged, "converges");
        let matches = out.correspondence(&problem).unwrap();
        (problem, out, matches)
    };
    // all points coincide: zero cost everywhere, the plan is a bᵀ
    let (problem, out, matches) = run(&[[2.0, 1.0]; 9], &[[2.0, 1.0]; 20]);
    assert!(problem.scale().unwrap().beta <= 0.0, "β = 0");
    assert_close("mass", &[out.total_mass, out.objective], &[1.0, 0.0], 1e-14, 0.0);
    assert!(matches.rows.iter().all(|&row| row == 0), "lowest of nine tied rows");
    assert!(matches.tie_counts.iter().all(|&ties| ties == 9), "nine ties");
    // no overlap at all: every pair costs 1, mass e^{−1/Λ}
    let left: Vec<[f64; 2]> = (0..11).map(|k| [f64::from(k) * 1e-6, 0.0]).collect();
    let right: Vec<[f64; 2]> = (0..7).map(|k| [1e6, f64::from(k) * 1e-6]).collect();
    let fixed = WelschParams { bandwidth: Bandwidth::Fixed(0.1), ..WelschParams::default() };
    let problem = UotProblem::welsch(&left, &right, &fixed).unwrap();
    let out = solve(&problem, &params).unwrap();
    let matches = out.correspondence(&problem).unwrap();
    assert_close("mass", &[out.total_mass], &[(-1.0_f64 / 2.1).exp()], 0.0, 1e-11);
    assert_eq!(matches.rows, vec![0; 7], "all rows tie");
    assert_eq!(matches.tie_counts, vec![11; 7], "all rows tie");
    assert!(matches.w_best.iter().all(|&w| w <= 0.0), "nobody is covered");
    assert!(matches.near_share.iter().all(|&s| s < 1e-12), "only background");
    // one point on a side
    let (_, out, matches) = run(&[[0.0, 0.0]], &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
    assert_eq!(matches.rows, [0, 0, 0], "the only row");
    assert!(matches.margins.iter().all(|&margin| margin >= 1.0), "no second row");
    assert!(out.col_mass[0] > out.col_mass[1], "the coincident point gets more");
    let (_, _, matches) = run(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], &[[1.9, 0.0]]);
    assert_eq!(matches.rows, [2], "nearest of three");
}

#[test]
fn marginals_are_equivalent_to_repeated_points() {
    // weight 2 on a point equals two copies of the point
    let (src, edit) = (sheet(12, 60), sheet(9, 61));
    let mut doubled = src.clone();
    doubled.push(src[4]);
    let params = WelschParams { bandwidth: Bandwidth::Fixed(0.4), ..welsch(0.1, 8.0) };
    let mut a = vec![1.0 / 13.0; 12];
    a[4] = 2.0 / 13.0;
    let b = vec![1.0 / 9.0; 9];
    let weighted = UotProblem::welsch(&src, &edit, &params).unwrap().with_marginals(a, b).unwrap();
    let repeated = UotProblem::welsch(&doubled, &edit, &params).unwrap();
    let solver = weights(0.1, 1.0, 2.0);
    let (x, y) = (solve(&weighted, &solver).unwrap(), solve(&repeated, &solver).unwrap());
    assert_close("g", &x.g, &y.g, 1e-11, 0.0);
    assert_close("row 4", &[x.row_mass[4]], &[y.row_mass[4] + y.row_mass[12]], 0.0, 1e-10);
    assert_close("objective", &[x.objective], &[y.objective], 0.0, 1e-11);

    let mut zero = vec![1.0; 12];
    zero[7] = 0.0;
    let problem = UotProblem::welsch(&src, &edit, &params).unwrap();
    let problem = problem.with_marginals(zero, vec![1.0; 9]).unwrap();
    let out = solve(&problem, &solver).unwrap();
    assert!(out.converged && out.row_mass[7] <= 0.0, "weight zero empties its row");
    assert!(out.objective.is_finite() && out.total_mass > 0.0, "the rest is solved");
    let reference = EntropyReference::Entropy;
    let error = solve(&problem, &SinkhornParams { reference, ..solver }).unwrap_err();
    assert_eq!(error, UotError::NonUniformMarginals { reference }, "no global factor here");
}

#[test]
fn non_convergence_is_reported_in_the_output() {
    let (src, edit) = (sheet(30, 70), sheet(30, 71));
    let problem = UotProblem::welsch(&src, &edit, &welsch(0.1, 6.0)).unwrap();
    for max_sweeps in [1, 2, 5] {
        let out = solve(&problem, &SinkhornParams { max_sweeps, ..weights(0.05, 11.0, 11.0) });
        let out = out.unwrap();
        assert!(!out.converged && out.sweeps == max_sweeps, "{max_sweeps} sweeps are too few");
        assert_eq!(out.residuals.len(), max_sweeps, "one residual per sweep");
        assert!(out.f.iter().chain(&out.g).all(|x| x.is_finite()), "usable potentials");
    }
}

#[test]
fn invalid_input_is_an_error() {
    let points = sheet(5, 80);
    let problem = UotProblem::welsch(&points, &points, &WelschParams::default()).unwrap();
    let check = |error: UotError, text: &str| {
        let message = error.to_string();
        assert!(message.contains(text), "{message:?} should mention {text:?}");
    };
    for (params, text) in [
        (SinkhornParams { lambda_ent: 0.0, ..Default::default() }, "lambda_ent"),
        (SinkhornParams { lambda_a: f64::NAN, ..Default::default() }, "lambda_a"),
        (SinkhornParams { lambda_b: -1.0, ..Default::default() }, "lambda_b"),
        (SinkhornParams { tol: f64::NAN, ..Default::default() }, "tol"),
        (SinkhornParams { max_sweeps: 0, ..Default::default() }, "max_sweeps"),
        (SinkhornParams { lambda_ent: 0.001, ..Default::default() }, "welsch_dense"),
    ] {
        check(solve(&problem, &params).unwrap_err(), text);
    }
    let f32s = WelschParams { storage: Storage::F32, ..WelschParams::default() };
    let stored = UotProblem::welsch(&points, &points, &f32s).unwrap();
    check(solve(&stored, &weights(0.01, 1.0, 1.0)).unwrap_err(), "Storage::F64");
    check(UotProblem::from_cost(vec![], 0, 3).unwrap_err(), "row side");
    check(UotProblem::from_cost(vec![1.0; 5], 2, 3).unwrap_err(), "expected 6");
    check(UotProblem::from_cost(vec![1.0, f64::NAN], 1, 2).unwrap_err(), "cost[1]");
    let empty: [[f64; 3]; 0] = [];
    check(UotProblem::welsch(&points, &empty, &f32s).unwrap_err(), "column side");
    for params in [welsch(0.0, 4.0), welsch(0.1, -1.0), welsch(f64::INFINITY, 4.0)] {
        let error = UotProblem::welsch(&points, &points, &params).unwrap_err();
        check(error, "above zero");
    }
    let uniform = || UotProblem::from_cost(vec![1.0; 6], 2, 3).unwrap();
    check(uniform().with_marginals(vec![1.0], vec![1.0; 3]).unwrap_err(), "a has 1");
    check(uniform().with_marginals(vec![1.0; 2], vec![0.0; 3]).unwrap_err(), "b[0]");
    check(uniform().with_marginals(vec![1.0, -1.0], vec![1.0; 3]).unwrap_err(), "a[1]");
    let out = solve(&problem, &SinkhornParams::default()).unwrap();
    check(out.plan(&uniform()).unwrap_err(), "5x5");
    check(out.plan_column(&problem, 5).unwrap_err(), "j = 5");
    check(out.top_rows(&problem, 0).unwrap_err(), "k = 0");
}
