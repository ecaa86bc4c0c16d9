//! [`Subject`]: the measured scene and its source.

use crate::failure::{Failure, Outcome, chain};
use amg::{Binding, IdentityMap, IdentityParams};
use gs_core::{DynamicScene, Extent, Splats};

/// A scene, with its source and edit if it is a run.
#[derive(Debug)]
pub(crate) struct Subject<'a> {
    pub(crate) scene: &'a dyn DynamicScene,
    /// The scene before the edit; the scene itself if there was no edit.
    pub(crate) source: &'a dyn DynamicScene,
    /// Time of the edited frame.
    pub(crate) edit_time: f32,
    /// The edit; `None` if the scene is not a run.
    pub(crate) edit: Option<Edit<'a>>,
    /// Radius of the source at [`Subject::edit_time`], world units.
    pub(crate) radius: f64,
}

/// An edit, compared with the source by value, so that the result is the same for every propagation
/// method.
#[derive(Debug)]
pub(crate) struct Edit<'a> {
    /// The edited frame as given.
    pub(crate) frame: &'a Splats,
    /// Binding of its splats to the source.
    pub(crate) binding: &'a Binding,
    /// Whether the edit changed or added each splat, `[N]`.
    pub(crate) touched: Vec<bool>,
    /// For each edited splat, the source splat with the same geometry at the same position, if any.
    pub(crate) source_row: Vec<Option<u32>>,
    /// Whether the edit changed or removed each source splat.
    pub(crate) touched_source: Vec<bool>,
}

impl<'a> Subject<'a> {
    /// `edited` is the source, the edited frame as given and the binding, for a run.
    pub(crate) fn new(
        scene: &'a dyn DynamicScene,
        edited: Option<(&'a dyn DynamicScene, &'a Splats, &'a Binding)>,
        edit_time: f32,
    ) -> Outcome<Self> {
        let source = edited.map_or(scene, |(source, ..)| source);
        let at_edit = source.at(edit_time).map_err(Failure::input)?;
        let radius = Extent::of(&at_edit).radius;
        let edit = match edited {
            Some((_, frame, binding)) => Some(Edit::new(&at_edit, frame, binding)?),
            None => None,
        };
        Ok(Self { scene, source, edit_time, edit, radius })
    }
}

impl<'a> Edit<'a> {
    fn new(source: &Splats, frame: &'a Splats, binding: &'a Binding) -> Outcome<Self> {
        let params = IdentityParams::default();
        let map = IdentityMap::of(source, frame, &params)
            .map_err(|error| Failure::bad_input(chain(&error)))?;
        let touched: Vec<bool> =
            map.rows.iter().map(|row| !matches!(row, amg::Identity::Unchanged(_))).collect();
        let mut touched_source = vec![true; source.len()];
        for row in &map.rows {
            if let amg::Identity::Unchanged(id) = row {
                touched_source[*id as usize] = false;
            }
        }
        let source_row = map.rows.iter().map(|row| row.in_place()).collect();
        Ok(Self { frame, binding, touched, source_row, touched_source })
    }
}
