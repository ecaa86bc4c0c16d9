//! Times the structured solver on two clouds of `n` points (first argument, default 10 000) on an
//! articulated figure, before and after an edit. Further arguments: cutoff κ (6), `f32` or `f64`
//! storage, tolerance (1e-9).
#![expect(clippy::print_stdout, reason = "an example that prints its measurements")]

mod figure;

use figure::figure;
use std::error::Error;
use std::time::Instant;
use uot::{MedianMode, Sinkhorn, SinkhornParams, Storage, UotProblem, WelschParams};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |k: usize, default: &str| -> String {
        arguments.get(k).map_or_else(|| default.to_owned(), Clone::clone)
    };
    let n: usize = argument(0, "10000").parse()?;
    let cutoff: f64 = argument(1, "6").parse()?;
    let storage = if argument(2, "f64") == "f32" { Storage::F32 } else { Storage::F64 };
    let tol: f64 = argument(3, "1e-9").parse()?;
    let src = figure(n, 1, 0.0);
    let edit = figure(n, 2, 0.02);

    let clock = Instant::now();
    let median = uot::median_distance(&src, &edit, MedianMode::Auto)?;
    println!("median    {:>9.3} s  {:.6} (exact: {})", secs(clock), median.value, median.exact);

    let clock = Instant::now();
    let params = WelschParams { cutoff, storage, ..WelschParams::default() };
    let problem = UotProblem::welsch(&src, &edit, &params)?;
    println!("problem   {:>9.3} s  (median again)", secs(clock));

    let clock = Instant::now();
    let out =
        Sinkhorn::new(SinkhornParams { tol, ..SinkhornParams::default() })?.solve(&problem)?;
    println!(
        "solve     {:>9.3} s  {} matvecs, {:.3e} stored entries ({:.1} % of n·m), converged: {}, mass {:.6}",
        secs(clock),
        out.matvecs,
        out.stored_entries as f64,
        out.stored_entries as f64 / (n as f64).powi(2) * 100.0,
        out.converged,
        out.total_mass,
    );

    let clock = Instant::now();
    let matches = out.correspondence(&problem)?;
    let covered = matches.w_best.iter().filter(|&&w| w > 0.02).count();
    println!("matches   {:>9.3} s  {covered} of {n} within reach", secs(clock));
    Ok(())
}

fn secs(since: Instant) -> f64 {
    since.elapsed().as_secs_f64()
}
