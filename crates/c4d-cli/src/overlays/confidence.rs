//! [`confidence`]: how well the source determines the motion of edited splats.

use crate::failure::{Failure, Outcome, chain};
use amg::{Binding, RowKind};
use gs_core::{DynamicScene, Splats};
use rayon::prelude::*;

/// Times at which distances are compared, evenly spaced over the clip.
const TIMES: usize = 8;
/// Change of distance at which the confidence is 1/e, as a share of `size`: two groups of a scene
/// count as one rigid body up to this misfit (`amg::RigidParts`).
const MISFIT: f64 = 0.01;

/// Confidence in the motion of each row of `binding`, 0 to 1; `None` for rows that follow no source
/// splat. 1 for rows that are source splats; the confidence of the descent for descendants; for
/// blends `exp(−e / (0.01 size))` with `e = max_t Σ_i w_i | ‖x_i(t) − x_0(t)‖ − ‖x_i − x_0‖ |`, the
/// change since `time`, the time of the edited frame, of the distances between the sources `i` and
/// the one with the largest weight, 0. `size` is the size of the moving figure, world units.
pub(crate) fn confidence(
    source: &dyn DynamicScene,
    binding: &Binding,
    time: f32,
    size: f64,
) -> Outcome<Vec<Option<f32>>> {
    let failed = |error| Failure::bad_input(chain(&error));
    let mut now = Splats::default();
    source.geometry_into(time, &mut now).map_err(failed)?;
    let then = now.means.clone();
    let mut worst = vec![0.0_f64; binding.len()];
    for t in source.time_range().frames(TIMES) {
        source.geometry_into(t, &mut now).map_err(failed)?;
        worst.par_iter_mut().enumerate().with_min_len(256).for_each(|(row, worst)| {
            if binding.kinds()[row] == RowKind::Blended {
                let change = change_of_distances(binding, row, &then, &now.means);
                // A distance that is not finite gives no confidence.
                *worst = if change.is_finite() { worst.max(change) } else { f64::INFINITY };
            }
        });
    }
    let mut inherited = binding.surface().map_or(&[][..], |surface| &surface.inherited).iter();
    #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
    let of_row = |(row, &kind): (usize, &RowKind)| match kind {
        RowKind::Unchanged | RowKind::Recolored | RowKind::Moved | RowKind::Copied => Some(1.0),
        RowKind::Descendant => inherited.next().map(|inherited| inherited.confidence),
        RowKind::Blended if worst[row] == 0.0 => Some(1.0),
        RowKind::Blended => Some((-worst[row] / (MISFIT * size)).exp() as f32),
        RowKind::Static | RowKind::Field => None,
    };
    Ok(binding.kinds().iter().enumerate().map(of_row).collect())
}

fn change_of_distances(binding: &Binding, row: usize, then: &[[f32; 3]], now: &[[f32; 3]]) -> f64 {
    let (ids, weights) = binding.row(row);
    let Some(heaviest) = binding.heaviest(row) else { return 0.0 };
    let distance = |means: &[[f32; 3]], i: usize| {
        let (a, b) = (means[ids[i] as usize], means[heaviest as usize]);
        (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum::<f64>().sqrt()
    };
    let change = |i| f64::from(weights[i]) * (distance(now, i) - distance(then, i)).abs();
    (0..ids.len()).map(change).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::{SceneError, TimeRange};

    /// Two bodies that rotate about the origin by opposite angles.
    #[derive(Debug)]
    struct Turning;

    impl DynamicScene for Turning {
        fn num_splats(&self) -> usize {
            4
        }

        fn sh_degree(&self) -> usize {
            0
        }

        fn time_range(&self) -> TimeRange {
            TimeRange::UNIT
        }

        fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
            let at = |angle: f32, radius: f32| [radius * angle.cos(), radius * angle.sin(), 0.0];
            *out = Splats {
                means: vec![at(t, 1.0), at(t, 1.2), at(-t, 1.0), at(-t, 1.2)],
                quats: vec![[1.0, 0.0, 0.0, 0.0]; 4],
                log_scales: vec![[0.0; 3]; 4],
                opacity_logits: vec![0.0; 4],
                sh: vec![[0.0; 3]; 4],
                sh_degree: 0,
            };
            Ok(())
        }
    }

    #[test]
    fn confidence_is_high_for_one_body_and_low_across_two() {
        let rows = [vec![(0, 0.5), (1, 0.5)], vec![(0, 0.5), (3, 0.5)], vec![], vec![(2, 1.0)]];
        let binding = Binding::blending(&rows, 4).unwrap();
        let found = confidence(&Turning, &binding, 0.0, 1.0).unwrap();
        assert!(found[0].unwrap() > 0.99, "a rotation keeps distances: {found:?}");
        assert!(found[1].unwrap() < 0.01, "the two bodies part: {found:?}");
        assert_eq!((found[2], found[3]), (None, Some(1.0)), "no source, one source");
    }
}
