//! [`Run`]: a run with its source.

use super::LoadedScene;
use crate::failure::{Outcome, chain};
use crate::field::NetworkField;
use crate::run_folder::{CONFIG, RunConfig, SCENE, Stored, damaged};
use amg::{EditedScene, RowKind};
use std::path::Path;
use std::sync::Arc;

/// A run as stored, with its source opened.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) config: RunConfig,
    pub(crate) stored: Stored,
    pub(crate) source: LoadedScene,
}

impl Run {
    /// The edited scene; with its refined colours if it has any and `refined` is true.
    pub(crate) fn scene(&self, path: &Path, refined: bool) -> Outcome<EditedScene> {
        let Stored { edited, binding, .. } = &self.stored;
        let rows = self.stored.refined.as_ref().filter(|_| refined);
        let binding = match rows {
            Some(rows) => rows
                .rebind(edited, binding)
                .map_err(|error| damaged(path, SCENE, &chain(&error)))?,
            None => binding.clone(),
        };
        let edited = Arc::new(rows.map_or_else(|| edited.clone(), |rows| rows.apply(edited)));
        let (source, binding) = (self.source.scene.clone(), Arc::new(binding));
        let time = self.config.edit_time;
        match &self.source.network {
            Some(network) if binding.count(RowKind::Field) > 0 => {
                let field = Arc::new(NetworkField(network.clone()));
                EditedScene::with_field(source, edited, time, binding, field)
            }
            _ => {
                let aggregation =
                    self.config.aggregation().map_err(|what| damaged(path, CONFIG, &what))?;
                EditedScene::new(source, edited, time, binding, aggregation)
            }
        }
        .map_err(|error| damaged(path, SCENE, &chain(&error)))
    }
}
