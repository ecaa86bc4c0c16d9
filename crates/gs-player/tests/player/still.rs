//! Test scenes made of given frames.

use gs_core::{DynamicScene, SceneError, Splats, TimeRange};

/// Returns the nearest of the given frames at any time.
#[derive(Debug)]
pub(crate) struct Frames(pub(crate) Vec<Splats>);

impl DynamicScene for Frames {
    fn num_splats(&self) -> usize {
        self.0[0].len()
    }

    fn sh_degree(&self) -> usize {
        self.0[0].sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let last = self.0.len() - 1;
        out.clone_from(&self.0[((t * last as f32).round() as usize).min(last)]);
        Ok(())
    }
}

/// `n` round splats in a row.
pub(crate) fn row_of(n: usize) -> Splats {
    let mut splats = Splats::with_capacity(n, 0);
    for i in 0..n {
        splats.means.push([i as f32, 0.0, 5.0]);
        splats.quats.push([1.0, 0.0, 0.0, 0.0]);
        splats.log_scales.push([-2.0; 3]);
        splats.opacity_logits.push(2.0);
        splats.sh.push([0.3; 3]);
    }
    splats
}
