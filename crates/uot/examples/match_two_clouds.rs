//! Matches the points of two rings. The second is larger, slightly rotated, and has three
//! additional points.
#![expect(clippy::print_stdout, reason = "an example that prints its result")]

use uot::{Bandwidth, Sinkhorn, SinkhornParams, UotError, UotProblem, WelschParams};

fn main() -> Result<(), UotError> {
    let ring = |k: u32, radius: f64, turn: f64| {
        let angle = f64::from(k) * std::f64::consts::TAU / 40.0 + turn;
        [radius * angle.cos(), radius * angle.sin()]
    };
    let ring_points: Vec<[f64; 2]> = (0..40).map(|k| ring(k, 1.0, 0.0)).collect();
    let mut other: Vec<[f64; 2]> = (0..40).map(|k| ring(k, 1.05, 0.02)).collect();
    other.extend([[0.0, 2.4], [0.1, 2.5], [-0.1, 2.5]]);

    // β = 0.1 · median pair distance
    let cost = WelschParams { bandwidth: Bandwidth::MedianTimes(0.1), ..WelschParams::default() };
    let problem = UotProblem::welsch(&ring_points, &other, &cost)?;
    let out = Sinkhorn::new(SinkhornParams::default())?.solve(&problem)?;
    let matches = out.correspondence(&problem)?;

    println!(
        "converged: {} after {} sweeps; mass {:.3}, transport cost {:.3}",
        out.converged,
        out.sweeps,
        out.total_mass,
        out.transport_cost(&problem)?
    );
    for (j, (&row, &weight)) in matches.rows.iter().zip(&matches.w_best).enumerate() {
        // transported mass does not identify an outlier; the closeness of its best partner does
        if weight > 0.02 {
            println!("column {j:2} <- row {row:2}  (w = {weight:.3})");
        } else {
            println!("column {j:2} has no partner");
        }
    }
    Ok(())
}
