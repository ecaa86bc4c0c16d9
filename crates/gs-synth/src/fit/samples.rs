//! [`Samples`]: training data and loss.

use super::layer::{PANEL, Row};

/// Panels per step. Their gradients are added in this order for any number of threads.
pub(super) const PANELS: usize = 32;
/// Weight of squared quaternion differences relative to squared distances in figure sizes.
const QUAT_WEIGHT: f32 = 0.02;

/// Training data.
pub(super) struct Samples<'a> {
    /// Box coordinates of every splat.
    pub(super) places: Vec<[f32; 3]>,
    pub(super) times: &'a [f32],
    /// `[T][N]` displacements from time 0, figure sizes.
    pub(super) shifts: Vec<Vec<[f32; 3]>>,
    /// `[T][N]` differences of unit quaternions from time 0, on the same hemisphere.
    pub(super) rotations: Vec<Vec<[f32; 4]>>,
    pub(super) figure_size: f32,
}

impl Samples<'_> {
    #[inline(always)]
    pub(super) fn coords(&self, (row, time): (u32, u32)) -> [f32; 4] {
        let [x, y, z] = self.places[row as usize];
        [x, y, z, self.times[time as usize]]
    }

    /// Replaces the outputs by the gradient of the loss; returns the loss.
    #[inline(always)]
    pub(super) fn residuals(&self, picks: &[(u32, u32); PANEL], out: &mut [Vec<Row>; 2]) -> f32 {
        let mut loss = 0.0;
        let scale = 2.0 / (PANELS * PANEL) as f32;
        for (s, &(row, time)) in picks.iter().enumerate() {
            let (row, time) = (row as usize, time as usize);
            for (k, wanted) in self.shifts[time][row].iter().enumerate() {
                let miss = out[0][k][s] / self.figure_size - wanted;
                loss += miss * miss;
                out[0][k][s] = scale * miss / self.figure_size;
            }
            for (k, wanted) in self.rotations[time][row].iter().enumerate() {
                let miss = out[1][k][s] - wanted;
                loss += QUAT_WEIGHT * miss * miss;
                out[1][k][s] = scale * QUAT_WEIGHT * miss;
            }
        }
        loss
    }
}
