//! Scores as Markdown.

use super::method::Method;
use super::score::Score;
use gs_synth::TruthCase;
use std::fmt::Write;

/// Mean over the seeds, per case and method, then the summary.
pub(super) fn motion(cases: &[TruthCase], methods: &[Method], scores: &[Score]) -> String {
    let mut text = String::from(
        "| case | method | EPE % | of edited splats | share of KNN | p95 % | bad5 % | contact % | rot ° (rigid) | jitter / truth (source's own) | NDD (truth) | PSNR dB | s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for case in cases {
        let of = |method: Method| {
            scores.iter().filter(move |score| score.case == case.name() && score.method == method)
        };
        let mean = |method: Method, value: fn(&Score) -> f64| {
            let values: Vec<f64> = of(method).map(value).collect();
            values.iter().sum::<f64>() / values.len().max(1) as f64
        };
        let knn = mean(Method::Knn, |score| score.epe);
        for &method in methods {
            let value = |of: fn(&Score) -> f64| mean(method, of);
            let _ = writeln!(
                text,
                "| {} | {} | {:.3} | {:.3} | {:.2} | {:.2} | {:.1} | {:.2} | {:.1} ({:.1}) | {:.2} ({:.2}) | {:.3} ({:.3}) | {:.1} | {:.2} |",
                case.name(),
                method.name(),
                value(|s| s.epe),
                value(|s| s.epe_edited),
                value(|s| s.epe) / knn.max(1e-12),
                value(|s| s.p95),
                value(|s| s.bad5),
                value(|s| s.contact),
                value(|s| s.rot_deg),
                value(|s| s.rot_rigid_deg),
                value(|s| s.jitter_ratio),
                value(|s| s.jitter_ratio_source),
                value(|s| s.ndd),
                value(|s| s.ndd_truth),
                value(|s| s.psnr),
                value(|s| s.seconds),
            );
        }
    }
    text
}
