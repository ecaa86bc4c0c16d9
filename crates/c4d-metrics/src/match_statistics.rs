//! Statistics of the matches of an edit: their certainty and their distances.

use gs_core::nearest_rank;

/// A weighted match of an edited splat to a source splat.
#[derive(Debug, Clone, Copy)]
pub struct Match {
    /// Weight, positive; the weights of a row sum to 1.
    pub weight: f64,
    /// Distance at the time of the edit, world units.
    pub distance: f64,
}

/// Diagnostics of matches, not quality scores.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MatchStatistics {
    /// Mean over rows of `Σ w·d`, world units.
    pub mean_distance: f64,
    /// `exp` of the mean entropy of the rows' weights: effective number of source splats per row.
    pub perplexity: f64,
    /// Mean over rows of `(w₁ − w₂) / w₁`, the two largest weights: 1 if every row has one match.
    pub argmax_margin: f64,
    /// Share of the weight on matches farther than 3 times the median distance to the nearest
    /// source splat; `None` if most rows coincide with a source splat.
    pub cross_region_rate: Option<f64>,
}

/// Distance beyond which a match is far, in median distances to the nearest source splat.
const FAR: f64 = 3.0;

/// Statistics of the matches in `rows`; `nearest` is the distance of each row to the nearest source
/// splat, world units, `[N]`. `None` without rows.
pub fn match_statistics(rows: &[Vec<Match>], nearest: &[f64]) -> Option<MatchStatistics> {
    if rows.is_empty() {
        return None;
    }
    let far = FAR * nearest_rank(&mut nearest.to_vec(), 0.5)?;
    let (mut distance, mut entropy, mut margin, mut crossing) = (0.0, 0.0, 0.0, 0.0);
    for row in rows {
        let (mut first, mut second) = (0.0_f64, 0.0_f64);
        for entry in row {
            distance += entry.weight * entry.distance;
            if entry.weight > 0.0 {
                entropy -= entry.weight * entry.weight.ln();
            }
            if entry.distance > far {
                crossing += entry.weight;
            }
            second = second.max(entry.weight.min(first));
            first = first.max(entry.weight);
        }
        margin += if first > 0.0 { (first - second) / first } else { 0.0 };
    }
    let count = rows.len() as f64;
    Some(MatchStatistics {
        mean_distance: distance / count,
        perplexity: (entropy / count).exp(),
        argmax_margin: margin / count,
        cross_region_rate: (far > 0.0).then_some(crossing / count),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows on a line that match the splat below them; one in twenty matches the splat of a different row.
    #[test]
    fn swapped_matches_cross_regions() {
        let rate = |swap: bool| {
            let row = |i: usize| {
                let distance = if swap && i.is_multiple_of(20) { 40.0 } else { 1.0 };
                vec![Match { weight: 1.0, distance }]
            };
            let rows: Vec<_> = (0..200_usize).map(row).collect();
            match_statistics(&rows, &[1.0; 200]).unwrap().cross_region_rate.unwrap()
        };
        assert_eq!(rate(false), 0.0, "all are near");
        assert!((rate(true) - 0.05).abs() < 1e-9, "one in twenty: {}", rate(true));
    }

    #[test]
    fn even_and_single_matches() {
        let at = |weight: f64, distance: f64| Match { weight, distance };
        let even = vec![vec![at(0.25, 1.0); 4]; 3];
        let found = match_statistics(&even, &[1.0; 3]).unwrap();
        assert!((found.perplexity - 4.0).abs() < 1e-9, "four: {found:?}");
        assert_eq!(found.argmax_margin, 0.0, "equal weights");
        assert_eq!(found.cross_region_rate, Some(0.0), "near");
        let single = vec![vec![at(1.0, 1.0)], vec![at(1.0, 4.0)]];
        let found = match_statistics(&single, &[1.0; 2]).unwrap();
        assert!((found.perplexity - 1.0).abs() < 1e-9, "one: {found:?}");
        assert_eq!(found.argmax_margin, 1.0, "decided");
        assert_eq!(found.cross_region_rate, Some(0.5), "one of two is far");
        let found = match_statistics(&single, &[0.0; 2]).unwrap();
        assert_eq!(found.cross_region_rate, None, "every row lies on a source splat");
        assert_eq!(match_statistics(&[], &[]), None, "nothing matched");
    }
}
