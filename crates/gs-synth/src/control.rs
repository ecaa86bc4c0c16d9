//! Baseline without correspondences: the nearest source splat with a similar normal that is not a
//! floater, and the rigid motion around it. Uses only the source's motion.

use crate::oracle::{Tree, nearest_similar};
use crate::{EditedFrame, SynthError, SynthScene};
use gs_core::{DynamicScene, Splats, nearest_rank};

/// Number of neighbours that define the motion at a source splat.
const NEIGHBORS: usize = 24;
/// Times at which motions are compared.
const TIMES: usize = 9;
/// Largest change of distance between rigidly connected splats: in units
/// of the noise, and relative to the distance.
const NOISES: f32 = 3.0;
const STRAIN: f32 = 0.04;
/// Share of a neighbourhood's weight below which a source splat counts as a floater.
const MIN_SUPPORT: f32 = 0.3;

/// For every edited splat, the sources around its nearest one that move with it, and weights that
/// sum to 1.
///
/// # Errors
/// If the scene cannot be evaluated.
pub fn rigid_neighbors(
    source: &SynthScene,
    edited: &EditedFrame,
) -> Result<Vec<Vec<(u32, f32)>>, SynthError> {
    let frame1 = source.frame1();
    let mut frames = Vec::new();
    for &t in &source.time_range().frames(TIMES)[1..] {
        let mut splats = Splats::default();
        source.geometry_into(t, &mut splats)?;
        frames.push(splats.means);
    }
    let tree = Tree::new(frame1, (0..frame1.len()).collect());
    let near: Vec<Vec<(usize, f32)>> =
        frame1.means.iter().map(|&x| tree.nearest(x, NEIGHBORS + 1)).collect();
    let deviation = |i: usize, &(j, squared): &(usize, f32)| {
        let apart = |means: &Vec<[f32; 3]>| {
            (0..3).map(|a| (means[i][a] - means[j][a]).powi(2)).sum::<f32>().sqrt()
        };
        frames.iter().map(apart).fold(0.0, |worst: f32, d| worst.max((d - squared.sqrt()).abs()))
    };
    let mut deviations: Vec<f32> = (0..near.len())
        .flat_map(|i| near[i].iter().skip(1).map(move |n| deviation(i, n)))
        .collect();
    let mut spacings: Vec<f32> = near.iter().filter_map(|n| n.get(3)).map(|n| n.1.sqrt()).collect();
    let median = |values: &mut [f32]| nearest_rank(values, 0.5).unwrap_or(0.0);
    let (noise, h) = (median(&mut deviations), median(&mut spacings).max(f32::MIN_POSITIVE));
    let weights = |i: usize| -> (Vec<(u32, f32)>, f32) {
        let (mut row, mut kept, mut all) = (Vec::new(), 0.0, 0.0);
        for n in &near[i] {
            let spatial = frame1.opacity(n.0) * (-0.5 * n.1 / (2.0 * h).powi(2)).exp();
            let stiff = (NOISES * noise + STRAIN * n.1.sqrt()).max(f32::MIN_POSITIVE);
            let weight = spatial * (-0.5 * (deviation(i, n) / stiff).powi(2)).exp();
            if n.0 != i {
                (kept, all) = (kept + weight, all + spatial);
            }
            row.push((crate::math::row_id(n.0), weight));
        }
        (row, if all > 0.0 { kept / all } else { 1.0 })
    };
    let supports: Vec<f32> = (0..near.len()).map(|i| weights(i).1).collect();
    let rigid = (0..near.len()).filter(|&i| supports[i] > MIN_SUPPORT).collect();
    let rigid = Tree::new(frame1, rigid);
    let rows = (0..edited.splats.len()).map(|e| {
        let Some(nearest) = nearest_similar(frame1, &rigid, &edited.splats, e) else {
            return Vec::new();
        };
        let mut row = weights(nearest).0;
        let total: f32 = row.iter().map(|entry| entry.1).sum();
        for entry in &mut row {
            entry.1 /= total;
        }
        row
    });
    Ok(rows.collect())
}
