//! Plans of Python Optimal Transport (`fixtures/uot/make_pot.py`), and two problems from its
//! reports.
#![expect(clippy::unwrap_used, reason = "tests may unwrap, helpers included")]

use test_support::compare::{assert_close, max_abs_diff};
use test_support::fixture;
use test_support::golden::Golden;
use uot::{Acceleration, EpsilonScaling, SinkhornParams, UotOutput, UotProblem, solve};

const ROWS: usize = 9;
const COLS: usize = 7;
const HELD: f64 = f64::INFINITY;

fn weights(lambda_a: f64, lambda_b: f64) -> SinkhornParams {
    SinkhornParams { lambda_ent: 0.2, lambda_a, lambda_b, tol: 1e-13, ..Default::default() }
}

/// The problem of the file as a matrix, or with the kept pairs only.
fn problem(golden: &Golden, sparse: bool, more: f64) -> UotProblem<'static> {
    let (cost, keep) = (golden.f64s("cost"), golden.f64s("keep"));
    let problem = if sparse {
        let (mut starts, mut cols, mut costs) = (vec![0], Vec::new(), Vec::new());
        for i in 0..ROWS {
            for j in 0..COLS {
                if keep[i * COLS + j] > 0.0 {
                    cols.push(u32::try_from(j).unwrap());
                    costs.push(cost[i * COLS + j]);
                }
            }
            starts.push(cols.len());
        }
        UotProblem::from_csr(starts, cols, costs, COLS)
    } else {
        UotProblem::from_cost(cost, ROWS, COLS)
    };
    let b = golden.f64s("b").iter().map(|b| more * b).collect();
    problem.unwrap().with_marginals(golden.f64s("a"), b).unwrap()
}

#[test]
fn plans_agree_with_pot() {
    let golden = Golden::open(fixture("uot/pot.safetensors"));
    let mut compared = 0;
    for (name, params, more, tol) in [
        ("sinkhorn", weights(HELD, HELD), 1.0, 1e-11),
        ("unbalanced", weights(1.5, 0.7), 1.0, 1e-11),
        ("rows_held", weights(HELD, 0.7), 1.0, 1e-11),
        ("cols_held", weights(1.5, HELD), 1.0, 1e-11),
        ("translation_invariant", weights(1.5, 1.5), 1.0, 1e-11),
        ("more_cols", weights(1.5, 0.7), 1.6, 1e-11),
    ] {
        for acceleration in [Acceleration::Auto, Acceleration::Plain, Acceleration::OverRelaxed] {
            for sparse in [false, true] {
                let name = if sparse { format!("{name}_sparse") } else { name.to_owned() };
                if !golden.has(&name) {
                    continue;
                }
                let problem = problem(&golden, sparse, more);
                let out = solve(&problem, &SinkhornParams { acceleration, ..params }).unwrap();
                assert!(out.converged, "{name} {acceleration:?}: {:?}", out.residuals.last());
                let plan = out.plan(&problem).unwrap();
                assert_close(
                    &format!("{name} {acceleration:?}"),
                    &plan,
                    &golden.f64s(&name),
                    tol,
                    0.0,
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 27, "every plan of the file is compared");
    // negative control
    let out = solve(&problem(&golden, false, 1.0), &weights(1.5, 0.71)).unwrap();
    let plan = out.plan(&problem(&golden, false, 1.0)).unwrap();
    assert!(
        max_abs_diff(&plan, &golden.f64s("unbalanced")) > 1e-6,
        "a different weight is detected"
    );
}

#[test]
fn small_entropy_weights_approach_the_linear_programme() {
    let golden = Golden::open(fixture("uot/pot.safetensors"));
    let (cost, exact) = (golden.f64s("cost"), golden.f64s("exact"));
    let value: f64 = cost.iter().zip(&exact).map(|(d, p)| d * p).sum();
    let problem = problem(&golden, false, 1.0);
    let mut last = f64::INFINITY;
    for lambda_ent in [0.1, 0.01, 0.001] {
        let params = SinkhornParams { lambda_ent, tol: 1e-9, ..weights(HELD, HELD) };
        let out = solve(&problem, &params).unwrap();
        assert!(out.converged, "λ0 = {lambda_ent}: {:?} in {}", out.residuals.last(), out.sweeps);
        let excess = out.transport_cost(&problem).unwrap() - value;
        // the entropy of a plan with n·m entries is at most ln(n·m)
        assert!(
            excess > -1e-9 && excess < lambda_ent * ((ROWS * COLS) as f64).ln(),
            "λ0 = {lambda_ent}: {excess}"
        );
        assert!(excess < last, "closer with every step");
        last = excess;
    }
    let params = SinkhornParams { lambda_ent: 0.001, ..weights(HELD, HELD) };
    let plan = solve(&problem, &params).unwrap().plan(&problem).unwrap();
    assert_close("plan at 0.001", &plan, &exact, 1e-6, 0.0);
}

fn two_by_two(off_diagonal: f64, params: &SinkhornParams) -> (UotProblem<'static>, UotOutput) {
    let problem = UotProblem::from_cost(vec![0.0, off_diagonal, off_diagonal, 0.0], 2, 2).unwrap();
    let problem = problem.with_marginals(vec![0.3, 0.7], vec![0.7, 0.3]).unwrap();
    let out = solve(&problem, params).unwrap();
    (problem, out)
}

/// POT issue 711: small λ0 with large marginal weights; needs tens of thousands of plain sweeps.
#[test]
fn nearly_balanced_problems_with_a_small_entropy_weight_are_solved() {
    for epsilon_scaling in [EpsilonScaling::Auto, EpsilonScaling::Off] {
        let params = SinkhornParams {
            lambda_ent: 0.01,
            lambda_a: 100.0,
            lambda_b: 100.0,
            epsilon_scaling,
            ..Default::default()
        };
        let (_, out) = two_by_two(1.0, &params);
        assert!(out.converged && out.sweeps < 400, "{} {:?}", out.sweeps, out.residuals.last());
        assert_close("objective", &[out.objective], &[0.398_851_125_65], 1e-10, 0.0);
        assert_close("mass", &[out.total_mass], &[0.998_005_844], 1e-8, 0.0);
    }
}

/// POT issue 54: costs of half a million λ0.
#[test]
fn kernels_that_underflow_are_solved() {
    let params = SinkhornParams { lambda_ent: 1e-4, ..Default::default() };
    let (problem, out) = two_by_two(50.0, &params);
    assert!(out.converged && out.sweeps < 1000, "{} {:?}", out.sweeps, out.residuals.last());
    let plan = out.plan(&problem).unwrap();
    assert_close("plan", &plan, &[0.458_240, 0.0, 0.0, 0.458_240], 1e-6, 0.0);
}
