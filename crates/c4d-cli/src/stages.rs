//! [`Stages`]: progress of work whose stages report their own fractions.

use crate::console::Console;
use crate::progress::StageProgress;
use std::sync::Mutex;

/// Progress of the stages of one piece of work, one after another. When it is dropped, the last
/// stage ends.
pub(crate) struct Stages<'a> {
    console: &'a Console,
    current: Mutex<Option<(&'static str, StageProgress)>>,
}

impl<'a> Stages<'a> {
    pub(crate) fn new(console: &'a Console) -> Self {
        Self { console, current: Mutex::new(None) }
    }

    /// `fraction` (0 to 1) of the stage `name` is done; a new name begins the next stage.
    pub(crate) fn set(&self, name: &'static str, fraction: f32) {
        let Ok(mut current) = self.current.lock() else { return };
        if current.as_ref().is_none_or(|(running, _)| *running != name)
            && let Some((_, finished)) = current.replace((name, self.console.percent(name)))
        {
            finished.finish();
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 0..=100"
        )]
        if let Some((_, bar)) = current.as_mut() {
            bar.set((fraction.clamp(0.0, 1.0) * 100.0) as u64);
        }
    }
}
