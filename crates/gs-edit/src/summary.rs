//! [`Summary`]: statistics of a selection.

use crate::color::{ColorStats, hsv};
use gs_core::{Splats, nearest_rank};

/// Statistics of a selection. Lengths are world units.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Number of selected splats.
    pub selected: usize,
    /// Number of all splats.
    pub total: usize,
    /// Lower and upper corner of the bounding box of the centres; `None` for an empty selection.
    pub bounds: Option<([f64; 3], [f64; 3])>,
    /// Mean of the centres.
    pub center: [f64; 3],
    /// 10th, 50th and 90th percentile of the opacities.
    pub opacity: [f64; 3],
    /// The same percentiles of the largest standard deviations, world units.
    pub size: [f64; 3],
    /// Mean base colour, RGB, weighted by area; displayable colours are 0 to 1.
    pub color: [f64; 3],
    /// Its hue, degrees; `None` for grey.
    pub hue: Option<f64>,
}

impl Summary {
    /// Statistics of the splats that are `selected`, `[N]`.
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

/// 10th, 50th and 90th percentile; 0 for no values.
fn deciles(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut values: Vec<f64> = values.collect();
    [0.1, 0.5, 0.9].map(|share| nearest_rank(&mut values, share).unwrap_or(0.0))
}
