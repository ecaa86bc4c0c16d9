//! [`Subject`]: the scene that is measured, and what it was before the edit.

use crate::failure::{Failure, Outcome, chain};
use amg::{Binding, IdentityMap, IdentityParams};
use gs_core::{DynamicScene, Extent, Splats};

/// A scene with its past, if it has one.
#[derive(Debug)]
pub(crate) struct Subject<'a> {
    pub(crate) scene: &'a dyn DynamicScene,
    /// The scene before the edit; the scene itself if there was no edit.
    pub(crate) source: &'a dyn DynamicScene,
    /// Time of the edited frame.
    pub(crate) edit_time: f32,
    /// What the edit did, if there was one.
    pub(crate) edit: Option<Edit<'a>>,
    /// Of the source at [`Subject::edit_time`], world units.
    pub(crate) radius: f64,
}

/// What an edit did, by value: the same for every method that propagates it.
#[derive(Debug)]
pub(crate) struct Edit<'a> {
    /// The edit as it was given, at the edited frame.
    pub(crate) frame: &'a Splats,
    /// What each of its splats follows.
    pub(crate) binding: &'a Binding,
    /// Whether each splat of the edit was touched.
    pub(crate) touched: Vec<bool>,
    /// Source splat that each splat of the edit is, where that one is.
    pub(crate) source_row: Vec<Option<u32>>,
    /// Whether each splat of the source was touched or removed.
    pub(crate) touched_source: Vec<bool>,
}

impl<'a> Subject<'a> {
    /// A scene, or an edited one with its source, the edit as given and its binding.
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
