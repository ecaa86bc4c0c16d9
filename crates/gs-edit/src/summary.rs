//! [`Summary`]: what a selection is, in numbers.

use crate::color::{ColorStats, hsv};
use gs_core::Splats;

/// Numbers of a selection. Lengths are world units.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Splats of the selection.
    pub selected: usize,
    /// All splats.
    pub total: usize,
    /// Lower and upper corner of the centres; `None` of nothing.
    pub bounds: Option<([f64; 3], [f64; 3])>,
    /// Mean of the centres.
    pub center: [f64; 3],
    /// Opacities: a tenth, half and nine tenths of the splats are at or below.
    pub opacity: [f64; 3],
    /// Largest standard deviations, likewise.
    pub size: [f64; 3],
    /// Mean base colour by area, 0 to 1 where displayable.
    pub color: [f64; 3],
    /// Its hue, degrees; `None` for grey.
    pub hue: Option<f64>,
}

impl Summary {
    /// Of the splats that are `selected`, `[N]`.
    pub fn of(splats: &Splats, selected: &[bool]) -> Self {
        let rows: Vec<usize> = (0..splats.len()).filter(|&row| selected[row]).collect();
        let part = splats.select(&rows);
        let bounds = part.bounds().map(|(low, high)| (low.map(f64::from), high.map(f64::from)));
        let mut center = [0.0; 3];
        for mean in &part.means {
            for k in 0..3 {
                center[k] += f64::from(mean[k]) / rows.len() as f64;
            }
        }
        let every: Vec<usize> = (0..part.len()).collect();
        let color = ColorStats::of_splats(&part, &every).map_or([0.0; 3], |stats| stats.mean);
        Self {
            selected: rows.len(),
            total: splats.len(),
            bounds,
            center,
            opacity: deciles(every.iter().map(|&i| f64::from(part.opacity(i)))),
            size: deciles(
                part.log_scales
                    .iter()
                    .map(|logs| f64::from(logs[0].max(logs[1]).max(logs[2])).exp()),
            ),
            color,
            hue: hsv(color).0,
        }
    }
}

/// The values at a tenth, the middle and nine tenths of the order; 0 of none.
fn deciles(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let at = |tenths: usize| sorted.get(sorted.len() * tenths / 10).copied().unwrap_or(0.0);
    [at(1), at(5), at(9)]
}
