//! The goldens of `fixtures/uot` (80-bit arithmetic, stationary to 1e-15) are reproduced by the
//! dense and the structured solver, in values and in the number of products.
#![expect(clippy::unwrap_used, reason = "tests may unwrap, helpers included")]

use test_support::compare::{assert_close, max_abs_diff};
use test_support::fixture;
use test_support::golden::Golden;
use uot::{
    Acceleration, Bandwidth, Correspondence, EntropyReference, SinkhornParams, Storage, UotOutput,
    UotProblem, WelschParams, solve,
};

/// One case and weight set of a golden file.
struct Case<'g> {
    golden: &'g Golden,
    name: String,
    weights: String,
}

impl Case<'_> {
    fn get(&self, what: &str) -> Vec<f64> {
        self.golden.f64s(&format!("{}/{}/{what}", self.name, self.weights))
    }

    fn points(&self, what: &str) -> Vec<[f64; 3]> {
        points(self.golden, &format!("{}/{what}", self.name))
    }

    fn params(&self) -> SinkhornParams {
        let s = self.get("scalars");
        SinkhornParams {
            lambda_ent: s[0],
            lambda_a: s[1],
            lambda_b: s[2],
            tol: 1e-12,
            ..SinkhornParams::default()
        }
    }

    fn gamma(&self) -> f64 {
        self.golden.f64s(&format!("{}/geom", self.name))[0]
    }

    fn label(&self) -> String {
        format!("{}/{}", self.name, self.weights)
    }
}

fn points(golden: &Golden, name: &str) -> Vec<[f64; 3]> {
    golden.f64s(name).as_chunks::<3>().0.to_vec()
}

fn for_each_case(mut check: impl FnMut(&Case<'_>)) {
    let mut count = 0;
    for file in ["small", "mid", "anchors"] {
        let golden = Golden::open(fixture(&format!("uot/{file}.safetensors")));
        for name in golden.names() {
            if let Some(prefix) = name.strip_suffix("/scalars") {
                let (case, weights) = prefix.split_once('/').unwrap();
                check(&Case { golden: &golden, name: case.into(), weights: weights.into() });
                count += 1;
            }
        }
    }
    assert_eq!(count, 40, "every weight set of every case is visited");
}

struct Limits {
    potential: f64,
    mass: f64,
    plan: f64,
    objective: f64,
    margin: f64,
}

fn check_output(
    case: &Case<'_>,
    problem: &UotProblem<'_>,
    out: &UotOutput,
    limits: &Limits,
    how: &str,
) {
    let label = format!("{} {how}", case.label());
    assert!(out.converged, "{label}: not converged, residual {:?}", out.residuals.last());
    let scalars = case.get("scalars");
    for (what, values) in [("f", &out.f), ("g", &out.g)] {
        assert_close(&format!("{label} {what}"), values, &case.get(what), limits.potential, 0.0);
    }
    for (what, values) in [("row_mass", &out.row_mass), ("col_mass", &out.col_mass)] {
        assert_close(&format!("{label} {what}"), values, &case.get(what), 0.0, limits.mass);
    }
    assert_close(&format!("{label} mass"), &[out.total_mass], &scalars[3..4], 0.0, limits.mass);
    assert_close(
        &format!("{label} objective"),
        &[out.objective],
        &scalars[6..7],
        0.0,
        limits.objective,
    );
    let transport = out.transport_cost(problem).unwrap();
    let slack = 10.0 * limits.mass;
    assert_close(&format!("{label} <D,P>"), &[transport], &scalars[7..8], 1e-15, slack);
    if case.golden.has(&format!("{}/plan", case.label())) {
        let expected = case.get("plan");
        let plan = out.plan(problem).unwrap();
        assert_close(&format!("{label} plan"), &plan, &expected, 0.0, limits.plan);
        let m = problem.num_cols();
        let column = out.plan_column(problem, m - 1).unwrap();
        let last: Vec<f64> = plan.iter().skip(m - 1).step_by(m).copied().collect();
        assert_eq!(column, last, "{label}: one column equals that of the plan");
    }
    let found = out.correspondence(problem).unwrap();
    check_correspondence(case, &found, limits, &label);
    check_top_rows(problem, out, &found, &label);
}

fn check_correspondence(case: &Case<'_>, found: &Correspondence, limits: &Limits, label: &str) {
    let key = |what: &str| format!("{}/{what}", case.label());
    let rows = case.golden.i32s(&key("corr"));
    let ties = case.golden.i32s(&key("tie_count"));
    let margins = case.get("corr_margin");
    assert_close(
        &format!("{label} near_share"),
        &found.near_share,
        &case.get("near_share"),
        10.0 * limits.mass,
        0.0,
    );
    assert_close(&format!("{label} margins"), &found.margins, &margins, 2.0 * limits.plan, 0.0);
    let src = case.points("src");
    for j in 0..rows.len() {
        let (expected, actual) = (rows[j].cast_unsigned() as usize, found.rows[j] as usize);
        if ties[j] == 1 && margins[j] > limits.margin {
            assert_eq!(actual, expected, "{label}: column {j}");
        } else if margins[j] == 0.0 && limits.plan < 1e-5 {
            assert_eq!(actual, expected, "{label}: lowest tied row of column {j}");
            assert_eq!(found.tie_counts[j], ties[j].cast_unsigned(), "{label}: ties of column {j}");
            assert!(src[actual] == src[expected] || case.name != "dup", "{label}: duplicates tie");
        }
    }
}

fn check_top_rows(problem: &UotProblem<'_>, out: &UotOutput, found: &Correspondence, label: &str) {
    let k = 4.min(problem.num_rows());
    let top = out.top_rows(problem, 4).unwrap();
    assert_eq!(top.len(), k * problem.num_cols(), "{label}: k rows a column");
    for (j, best) in top.chunks(k).enumerate() {
        let column = out.plan_column(problem, j).unwrap();
        let mut order: Vec<usize> = (0..column.len()).collect();
        order.sort_by(|&p, &q| column[q].total_cmp(&column[p]));
        for (rank, (entry, &row)) in best.iter().zip(&order).enumerate() {
            let share = column[row] / out.col_mass[j];
            assert!(
                (entry.share - share).abs() <= 1e-6 * share,
                "{label}: column {j} rank {rank}: {} against {share}",
                entry.share
            );
            let own = column[entry.row as usize] / out.col_mass[j];
            assert!((entry.share - own).abs() <= 1e-6 * own, "{label}: share of its own row");
        }
        if found.tie_counts[j] == 1 {
            assert_eq!(best[0].row, found.rows[j], "{label}: column {j}");
            let same = (best[0].weight - found.w_best[j]).abs() <= 0.0;
            assert!(same, "{label}: weight of column {j}");
        }
    }
}

const DENSE: Limits =
    Limits { potential: 1e-11, mass: 1e-10, plan: 1e-10, objective: 1e-12, margin: 1e-9 };

#[test]
fn the_dense_solver_agrees_with_the_goldens() {
    for_each_case(|case| {
        let (src, edit) = (case.points("src"), case.points("edit"));
        let params = WelschParams {
            bandwidth: Bandwidth::MedianTimes(case.gamma()),
            ..WelschParams::default()
        };
        let problem = UotProblem::welsch_dense(&src, &edit, &params).unwrap();
        let geom = case.golden.f64s(&format!("{}/geom", case.name));
        let scale = problem.scale().unwrap();
        let median = scale.median.unwrap();
        assert_close(
            "d_med, lower, beta",
            &[median.value, median.lower, scale.beta],
            &geom[1..],
            0.0,
            1e-15,
        );
        if case.golden.has(&format!("{}/cost", case.name)) {
            let cost = case.golden.f64s(&format!("{}/cost", case.name));
            assert_close("cost", problem.cost_matrix().unwrap(), &cost, 1e-15, 1e-13);
        }
        let out = solve(&problem, &case.params()).unwrap();
        check_output(case, &problem, &out, &DENSE, "dense");
    });
}

#[test]
fn every_acceleration_converges_to_the_same_plan() {
    for_each_case(|case| {
        let (src, edit) = (case.points("src"), case.points("edit"));
        let bandwidth = Bandwidth::MedianTimes(case.gamma());
        let params = WelschParams { bandwidth, ..WelschParams::default() };
        let problem = UotProblem::welsch_dense(&src, &edit, &params).unwrap();
        for acceleration in [Acceleration::Plain, Acceleration::OverRelaxed, Acceleration::Anderson]
        {
            // plain sweeps stop farther from the solution: 1/(1 − φ1φ2) times the last change
            let tol = if acceleration == Acceleration::Plain { 1e-14 } else { 1e-12 };
            let params = SinkhornParams { acceleration, tol, ..case.params() };
            let out = solve(&problem, &params).unwrap();
            assert_close(
                &format!("{} {acceleration:?} f", case.label()),
                &out.f,
                &case.get("f"),
                1e-11,
                0.0,
            );
            assert_close(
                &format!("{} {acceleration:?} g", case.label()),
                &out.g,
                &case.get("g"),
                1e-11,
                0.0,
            );
        }
    });
}

#[test]
fn the_structured_solver_agrees_with_the_goldens() {
    for (cutoff, storage, limits) in [
        (
            8.0,
            Storage::F64,
            Limits { potential: 1e-10, mass: 1e-10, plan: 1e-9, objective: 1e-11, margin: 1e-8 },
        ),
        (
            6.0,
            Storage::F64,
            Limits { potential: 2e-9, mass: 2e-9, plan: 1e-6, objective: 1e-9, margin: 1e-5 },
        ),
        (
            8.0,
            Storage::F32,
            Limits { potential: 2e-5, mass: 2e-5, plan: 1e-3, objective: 1e-5, margin: 1e-3 },
        ),
    ] {
        for_each_case(|case| {
            let (src, edit) = (case.points("src"), case.points("edit"));
            let bandwidth = Bandwidth::MedianTimes(case.gamma());
            let params = WelschParams { bandwidth, cutoff, storage, ..WelschParams::default() };
            let problem = UotProblem::welsch(&src, &edit, &params).unwrap();
            let out = solve(&problem, &case.params()).unwrap();
            check_output(case, &problem, &out, &limits, &format!("cutoff {cutoff} {storage:?}"));
        });
    }
}

#[test]
fn masses_for_the_other_references_agree_with_the_goldens() {
    for_each_case(|case| {
        let (src, edit) = (case.points("src"), case.points("edit"));
        let bandwidth = Bandwidth::MedianTimes(case.gamma());
        let params = WelschParams { bandwidth, cutoff: 8.0, ..WelschParams::default() };
        let problem = UotProblem::welsch(&src, &edit, &params).unwrap();
        let scalars = case.get("scalars");
        for (reference, expected) in
            [(EntropyReference::Entropy, scalars[4]), (EntropyReference::PLogP, scalars[5])]
        {
            let out = solve(&problem, &SinkhornParams { reference, ..case.params() }).unwrap();
            let label = format!("{} {reference:?}", case.label());
            assert_close(&label, &[out.total_mass], &[expected], 0.0, 1e-10);
        }
    });
}

#[test]
fn first_order_conditions_of_the_dense_plan() {
    for_each_case(|case| {
        let (src, edit) = (case.points("src"), case.points("edit"));
        let bandwidth = Bandwidth::MedianTimes(case.gamma());
        let params = WelschParams { bandwidth, ..WelschParams::default() };
        let problem = UotProblem::welsch_dense(&src, &edit, &params).unwrap();
        let solver = case.params();
        let plan = solve(&problem, &solver).unwrap().plan(&problem).unwrap();
        let worst = first_order(&problem, &plan, &solver);
        assert!(worst < 1e-11, "{}: residual {worst:e}", case.label());
        // negative control: a plan with an error of 1e-8 is detected
        let spoiled: Vec<f64> = plan.iter().map(|p| p * (1.0 + 1e-8)).collect();
        let worst = first_order(&problem, &spoiled, &solver);
        assert!(worst > 1e-9, "{}: a wrong plan has residual {worst:e}", case.label());
    });
}

/// `max |D + λ0 ln(P/ab) + λ1 ln(P1/a) + λ2 ln(Pᵀ1/b)|`.
fn first_order(problem: &UotProblem<'_>, plan: &[f64], params: &SinkhornParams) -> f64 {
    let (n, m) = (problem.num_rows(), problem.num_cols());
    let cost = problem.cost_matrix().unwrap();
    let rows: Vec<f64> = plan.chunks(m).map(|row| row.iter().sum()).collect();
    let mut cols = vec![0.0; m];
    for (k, p) in plan.iter().enumerate() {
        cols[k % m] += p;
    }
    let scale = (n * m) as f64;
    (0..n * m)
        .map(|k| {
            cost[k]
                + params.lambda_ent * (plan[k] * scale).ln()
                + params.lambda_a * (rows[k / m] * n as f64).ln()
                + params.lambda_b * (cols[k % m] * m as f64).ln()
        })
        .fold(0.0, |worst, value| worst.max(value.abs()))
}

#[test]
fn numbers_of_sweeps_are_within_limits() {
    let golden = Golden::open(fixture("uot/anchors.safetensors"));
    let (src, edit) = (points(&golden, "anchors/src"), points(&golden, "anchors/edit"));
    let gamma = golden.f64s("anchors/geom")[0];
    let params =
        WelschParams { bandwidth: Bandwidth::MedianTimes(gamma), ..WelschParams::default() };
    let problem = UotProblem::welsch_dense(&src, &edit, &params).unwrap();
    for (lambda_ent, lambda, acceleration, ceiling) in [
        (0.1, 1.0, Acceleration::OverRelaxed, 92),
        (0.05, 11.0, Acceleration::OverRelaxed, 342),
        (0.1, 1.0, Acceleration::Anderson, 52),
        (0.05, 11.0, Acceleration::Anderson, 186),
        (0.1, 1.0, Acceleration::Auto, 52),
        (0.05, 11.0, Acceleration::Auto, 186),
        (0.1, 1.0, Acceleration::Plain, 288),
        (0.05, 11.0, Acceleration::Plain, 5378),
    ] {
        let (lambda_a, lambda_b) = (lambda, lambda);
        let params = SinkhornParams {
            lambda_ent,
            lambda_a,
            lambda_b,
            tol: 1e-12,
            acceleration,
            ..SinkhornParams::default()
        };
        let out = solve(&problem, &params).unwrap();
        // one product after the last sweep gives the row masses
        let used = out.matvecs - 1;
        assert!(out.converged, "({lambda_ent}, {lambda}) {acceleration:?} converges");
        assert!(
            used <= ceiling,
            "({lambda_ent}, {lambda}) {acceleration:?}: {used} products, at most {ceiling} expected"
        );
    }
}

#[test]
fn wrong_weights_are_detected() {
    let golden = Golden::open(fixture("uot/mid.safetensors"));
    let (src, edit) = (points(&golden, "mid/src"), points(&golden, "mid/edit"));
    let bandwidth = Bandwidth::MedianTimes(0.15);
    let problem =
        UotProblem::welsch(&src, &edit, &WelschParams { bandwidth, ..WelschParams::default() })
            .unwrap();
    let wrong = SinkhornParams { lambda_ent: 0.1001, ..SinkhornParams::default() };
    let out = solve(&problem, &wrong).unwrap();
    let expected = golden.f64s("mid/l0_0.05_l1_0.6_l2_0.6/f");
    assert!(max_abs_diff(&out.f, &expected) > 1e-3, "other weights give other potentials");
}
