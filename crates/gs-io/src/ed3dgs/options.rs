//! Options besides the tensors on which the evaluation depends.

use crate::cfg_args::{CfgArgs, Value};

/// Iterations over which the deformation is blended in.
const ANNEALING: f64 = 1000.0;

/// Options of the training run, with the defaults of its classes, and the iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "options are named as in training")]
pub(super) struct TrainingOptions {
    pub(super) iteration: f64,
    pub(super) min_embeddings: f64,
    pub(super) max_embeddings: f64,
    pub(super) c2f_temporal_iter: f64,
    pub(super) deform_from_iter: f64,
    pub(super) use_anneal: bool,
    pub(super) use_coarse_temporal_embedding: bool,
    pub(super) no_c2f_temporal_embedding: bool,
    pub(super) no_coarse_deform: bool,
    pub(super) no_fine_deform: bool,
    /// Whether each component is deformed, in the order of `Component::ALL`; always true for means.
    pub(super) deforms: [bool; 5],
    pub(super) white_background: bool,
}

impl TrainingOptions {
    pub(super) fn read(cfg: &CfgArgs, iteration: u64) -> Self {
        let number =
            |name: &str, default: f64| cfg.get(name).and_then(Value::as_f64).unwrap_or(default);
        let flag =
            |name: &str, default: bool| cfg.get(name).and_then(Value::as_bool).unwrap_or(default);
        Self {
            iteration: iteration as f64,
            min_embeddings: number("min_embeddings", 30.0),
            max_embeddings: number("max_embeddings", 150.0),
            c2f_temporal_iter: number("c2f_temporal_iter", 20_000.0),
            deform_from_iter: number("deform_from_iter", 0.0),
            use_anneal: flag("use_anneal", true),
            use_coarse_temporal_embedding: flag("use_coarse_temporal_embedding", false),
            no_c2f_temporal_embedding: flag("no_c2f_temporal_embedding", false),
            no_coarse_deform: flag("no_coarse_deform", false),
            no_fine_deform: flag("no_fine_deform", false),
            deforms: [
                true,
                !flag("no_ds", false),
                !flag("no_dr", false),
                !flag("no_do", true),
                !flag("no_dc", false),
            ],
            white_background: flag("white_background", true),
        }
    }

    /// Factors of the components' changes.
    pub(super) fn factors(&self) -> [f64; 5] {
        let set_in = |since: f64| (since / ANNEALING).clamp(0.0, 1.0);
        let (first, second) = if self.use_anneal {
            (set_in(self.iteration), set_in(self.iteration - self.deform_from_iter))
        } else {
            (1.0, 1.0)
        };
        [first, first * second, first, first * second, second]
    }

    /// Number of rows to which a table of `entries` is
    /// resampled, for the coarse and the fine stage.
    pub(super) fn rows(&self, entries: usize) -> [f64; 2] {
        let (entries, minimum) = (entries as f64, self.min_embeddings);
        let fine = if self.no_c2f_temporal_embedding {
            entries
        } else {
            let done = self.iteration.min(self.c2f_temporal_iter) / self.c2f_temporal_iter;
            (minimum + (self.max_embeddings - minimum) * done).trunc()
        };
        [if self.use_coarse_temporal_embedding { minimum } else { fine }, fine]
    }

    pub(super) fn stages(&self) -> String {
        match (self.no_coarse_deform, self.no_fine_deform) {
            (false, false) => "coarse and fine",
            (true, false) => "fine",
            (false, true) => "coarse",
            (true, true) => "none: nothing moves",
        }
        .to_owned()
    }

    pub(super) fn deformed(&self) -> String {
        let names = ["positions", "scales", "rotations", "opacities", "colours"];
        let used = names.into_iter().zip(self.deforms).filter(|(_, used)| *used);
        used.map(|(name, _)| name).collect::<Vec<_>>().join(", ")
    }
}
