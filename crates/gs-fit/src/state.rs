//! [`FitState`], for checkpoints, and [`FitObserver`], for progress.

use gs_core::Image;

/// State from which a fit can be resumed, as flat arrays with names. Resuming fails with
/// [`FitError::State`](crate::FitError::State) if an array is missing or has a different length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitState {
    /// Hash of the inputs and options; a state can resume only fits with the same hash.
    pub fingerprint: u64,
    /// Completed steps.
    pub step: u64,
    /// Named arrays.
    pub arrays: Vec<(String, Vec<f32>)>,
    /// Named arrays of counts and row numbers.
    pub counts: Vec<(String, Vec<u32>)>,
}

/// Progress of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FitProgress {
    /// Completed steps.
    pub done: usize,
    /// Total number of steps.
    pub total: usize,
    /// Mean loss of the last steps; `None` before the first step.
    pub loss: Option<f32>,
    /// Current number of splats.
    pub splats: usize,
}

/// Current state of one view.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct FitPreview {
    /// Name of the view.
    pub name: String,
    /// The scene before the fit, `[H,W,3]`.
    pub original: Image,
    /// The target of the fit, `[H,W,3]`.
    pub target: Image,
    /// The current render, `[H,W,3]`.
    pub now: Image,
}

/// Callbacks of a fit. Every method has a default that does nothing.
pub trait FitObserver {
    /// Called after every few steps.
    fn progress(&mut self, progress: &FitProgress) {
        let _ = progress;
    }

    /// Called before the first step, during the search for splats of removed objects: number of
    /// completed rounds, and their maximum number.
    fn carving(&mut self, done: usize, most: usize) {
        let _ = (done, most);
    }

    /// Called at intervals of [`crate::FitOptions::preview_secs`] or more.
    fn preview(&mut self, preview: &FitPreview) {
        let _ = preview;
    }

    /// Called at intervals of [`crate::FitOptions::checkpoint_secs`] or more, and before a cancelled fit returns,
    /// with a state that the caller can store.
    fn checkpoint(&mut self, state: &FitState) {
        let _ = state;
    }

    /// Called after every step; `true` ends the fit with [`crate::FitError::Cancelled`].
    fn cancelled(&mut self) -> bool {
        false
    }
}

/// An observer that does nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoFitObserver;

impl FitObserver for NoFitObserver {}
