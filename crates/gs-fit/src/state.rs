//! [`FitState`] of a running fit, for checkpoints, and [`FitObserver`], which follows it.

use gs_core::Image;

/// State from which a fit can be resumed, as plain arrays.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitState {
    /// Hash of the inputs and options; a state fits only the fit it came from.
    pub fingerprint: u64,
    /// Steps done.
    pub step: u64,
    /// Named arrays.
    pub arrays: Vec<(String, Vec<f32>)>,
    /// Named arrays of counts and row numbers.
    pub counts: Vec<(String, Vec<u32>)>,
}

/// Progress of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitProgress {
    /// Steps done.
    pub done: usize,
    /// Steps in all.
    pub total: usize,
    /// Mean loss of the last steps; `None` before the first.
    pub loss: Option<f32>,
    /// Splats now.
    pub splats: usize,
}

/// One view as it stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitPreview {
    /// Name of the view.
    pub name: String,
    /// The scene before, `[H,W,3]`.
    pub original: Image,
    /// What is fitted, `[H,W,3]`.
    pub target: Image,
    /// The fit, `[H,W,3]`.
    pub now: Image,
}

/// Follows a fit. Every method has a default that does nothing.
pub trait FitObserver {
    /// Called after every few steps.
    fn progress(&mut self, progress: &FitProgress) {
        let _ = progress;
    }

    /// Called as often as the options say.
    fn preview(&mut self, preview: &FitPreview) {
        let _ = preview;
    }

    /// To be stored by the caller; called as often as the options say, and before a cancelled fit
    /// returns.
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
pub struct NoObserver;

impl FitObserver for NoObserver {}
