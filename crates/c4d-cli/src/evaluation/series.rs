//! [`Series`]: a value for each view and frame.

/// `[V][T]`; `None` where a frame has no value.
#[derive(Debug, Clone, Default)]
pub(crate) struct Series(pub(crate) Vec<Vec<Option<f64>>>);

impl Series {
    pub(crate) fn new(views: usize, frames: usize) -> Self {
        Self(vec![vec![None; frames]; views])
    }

    pub(crate) fn set(&mut self, view: usize, frame: usize, value: Option<f64>) {
        self.0[view][frame] = value.filter(|value| value.is_finite());
    }

    /// Mean of each view.
    pub(crate) fn means(&self) -> Vec<Option<f64>> {
        self.0.iter().map(|frames| mean(frames.iter().flatten().copied())).collect()
    }
}

/// Mean of the values; `None` if there are none.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values {
        sum += value;
        count += 1;
    }
    (count > 0).then(|| sum / count as f64)
}
