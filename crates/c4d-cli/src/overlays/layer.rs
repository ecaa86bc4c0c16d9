//! [`Layer`]: one overlay of a scene, as colours and as values.

use super::confidence::confidence;
use super::displacement::displacement;
use super::palette::{NEUTRAL, class_color, scale_colors, scale_entry};
use super::row_classes::Class;
use crate::args::OverlayArg;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::rigid_parts::rigid_parts;
use crate::scene::LoadedScene;
use amg::{Binding, RigidParts};
use gs_core::{DynamicScene, Extent, nearest_rank};
use gs_player::{Legend, Overlay};
use std::sync::Arc;

/// Colours of a scale; the entry after them is for splats without a value.
const SCALE: u8 = 255;
/// Share of the moving splats within the scale of `motion`; the others have its last colour.
const MOST: f64 = 0.99;

/// An overlay, and its values if it has any.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    /// Entries of the source and of the edited scene, for a run; else of the scene alone.
    pub(crate) overlay: Overlay,
    /// Values of the scene itself, `[N]`: world units for motion, 0 to 1 for the others; NaN for
    /// splats without a value.
    pub(crate) values: Option<Vec<f32>>,
}

impl Layer {
    /// Colour of each splat of the scene, `[N,3]`, 0 to 1.
    pub(crate) fn colors(&self) -> Vec<f32> {
        let [first, second] = &self.overlay.entries;
        let entries = if second.is_empty() { first } else { second };
        let color = |&entry: &u8| self.overlay.palette[usize::from(entry)];
        entries.iter().flat_map(color).map(|value| f32::from(value) / 255.0).collect()
    }
}

/// Data for the layers of a scene, computed on first use.
#[derive(Debug)]
pub(crate) struct LayerSource<'a> {
    /// The scene before the edit; the scene itself if it is not a run.
    pub(crate) source: &'a Arc<dyn DynamicScene>,
    opened: &'a LoadedScene,
    parts: Option<RigidParts>,
}

impl<'a> LayerSource<'a> {
    pub(crate) fn new(opened: &'a LoadedScene) -> Self {
        let source = opened.original.as_ref().unwrap_or(&opened.scene);
        Self { source, opened, parts: None }
    }

    /// The parts of the scene before the edit.
    pub(crate) fn parts(&mut self, console: &Console) -> Outcome<&RigidParts> {
        if self.parts.is_none() {
            let found = if self.opened.kind.is_frame() {
                let count = self.source.num_splats();
                RigidParts { moving: vec![false; count], parts: vec![0; count], num_parts: 0 }
            } else {
                rigid_parts(self.source.as_ref(), self.opened.edit_time, console)?
            };
            self.parts = Some(found);
        }
        self.parts.as_ref().ok_or_else(|| Failure::failed("the parts were not computed"))
    }

    /// Diameter of the moving splats, or of all splats if none moves, world units.
    pub(crate) fn figure_size(&mut self, console: &Console) -> Outcome<f64> {
        let splats = self.source.at(self.opened.edit_time).map_err(Failure::input)?;
        let moving = &self.parts(console)?.moving;
        let rows: Vec<usize> = (0..splats.len()).filter(|&row| moving[row]).collect();
        let figure = if rows.is_empty() { splats } else { splats.select(&rows) };
        Ok(2.0 * Extent::of(&figure).radius)
    }

    /// The overlay of this kind. `evidence` is ξ′ of every splat, or empty.
    pub(crate) fn layer(
        &mut self,
        kind: OverlayArg,
        evidence: &[f32],
        console: &Console,
    ) -> Outcome<Layer> {
        match kind {
            OverlayArg::Parts => self.parts_layer(console),
            OverlayArg::Motion => self.motion_layer(),
            OverlayArg::Confidence => self.confidence_layer(console),
            OverlayArg::Changed => self.changed_layer(),
            OverlayArg::Uncertainty => {
                self.binding(kind)?;
                Ok(self.uncertainty_layer(evidence))
            }
        }
    }

    /// Entries of the source and of the edited scene; the latter are empty if the scene is not a
    /// run.
    fn entries(&self, source: Vec<u8>, edited: impl FnOnce(&Binding) -> Vec<u8>) -> [Vec<u8>; 2] {
        let edited = self.opened.binding.as_deref().map(edited);
        [source, edited.unwrap_or_default()]
    }

    fn binding(&self, kind: OverlayArg) -> Outcome<&'a Binding> {
        self.opened.binding.as_deref().ok_or_else(|| {
            Failure::usage(format!(
                "the overlay `{}` compares a run with its source; {} is not a run",
                kind.name(),
                self.opened.path.display()
            ))
            .next("Specify the run folder that c4d propagate wrote, or choose parts or motion.")
        })
    }

    fn parts_layer(&mut self, console: &Console) -> Outcome<Layer> {
        let parts = self.parts(console)?;
        let last = u32::from(u8::MAX);
        let num_parts = parts.num_parts.min(last);
        #[expect(clippy::cast_possible_truncation, reason = "at most 255")]
        let entry = |part: u32| part.min(last) as u8;
        let source: Vec<u8> = parts.parts.iter().map(|&part| entry(part)).collect();
        let mut counts = vec![0_usize; num_parts as usize + 1];
        for &part in &source {
            counts[usize::from(part)] += 1;
        }
        let mut palette = vec![NEUTRAL];
        palette.extend((0..num_parts as usize).map(class_color));
        let classes = (1..=num_parts)
            .map(|part| (entry(part), format!("part {part}, {} splats", counts[part as usize])))
            .chain([(0, "no part".to_owned())]);
        let legend = Legend { classes: classes.collect(), scale: None };
        let entries = self.entries(source.clone(), |binding| {
            (0..binding.len())
                .map(|row| binding.heaviest(row).map_or(0, |id| source[id as usize]))
                .collect()
        });
        let title = "Parts that move rigidly, as `part N` selects them";
        Ok(Layer {
            overlay: overlay(OverlayArg::Parts, title, palette, legend, entries),
            values: None,
        })
    }

    fn motion_layer(&mut self) -> Outcome<Layer> {
        let time = self.opened.edit_time;
        let source = displacement(self.source.as_ref(), time)?;
        let edited = match &self.opened.original {
            Some(_) => displacement(self.opened.scene.as_ref(), time)?,
            None => Vec::new(),
        };
        let mut moving: Vec<f32> =
            source.iter().chain(&edited).copied().filter(|&far| far > 0.0).collect();
        let most = nearest_rank(&mut moving, MOST).unwrap_or(1.0);
        let entry = |far: &[f32]| -> Vec<u8> {
            far.iter().map(|far| scale_entry(far / most, SCALE)).collect()
        };
        let entries = [entry(&source), entry(&edited)];
        let high = format!("{most:.3} units");
        let title = "Largest distance from the position at the edited frame";
        let overlay =
            overlay(OverlayArg::Motion, title, scale(), scale_legend("0", &high), entries);
        let values = if self.opened.original.is_some() { edited } else { source };
        Ok(Layer { overlay, values: Some(values) })
    }

    fn confidence_layer(&mut self, console: &Console) -> Outcome<Layer> {
        let binding = self.binding(OverlayArg::Confidence)?;
        let size = self.figure_size(console)?;
        let found = confidence(self.source.as_ref(), binding, self.opened.edit_time, size)?;
        let entry = |value: &Option<f32>| value.map_or(SCALE, |value| scale_entry(value, SCALE));
        let entries = [
            vec![SCALE - 1; self.source.num_splats()],
            found.iter().map(entry).collect::<Vec<u8>>(),
        ];
        let mut legend = scale_legend("0", "1, exact");
        legend.classes.push((SCALE, "follows no source splat".to_owned()));
        let title = "Confidence of the match";
        let overlay = overlay(OverlayArg::Confidence, title, scale(), legend, entries);
        let values = found.iter().map(|value| value.unwrap_or(f32::NAN)).collect();
        Ok(Layer { overlay, values: Some(values) })
    }

    fn changed_layer(&mut self) -> Outcome<Layer> {
        let binding = self.binding(OverlayArg::Changed)?;
        let entries = self.entries(
            Class::of_source(binding).into_iter().map(Class::entry).collect(),
            |binding| binding.kinds().iter().map(|&kind| Class::of(kind).entry()).collect(),
        );
        let present = |class: &Class| entries.iter().any(|all| all.contains(&class.entry()));
        let mut palette = vec![NEUTRAL];
        palette.extend((1..Class::ALL.len()).map(class_color));
        let classes = Class::ALL.into_iter().filter(present);
        let classes = classes.map(|class| (class.entry(), class.label().to_owned())).collect();
        let legend = Legend { classes, scale: None };
        let title = "What the edit changed";
        let overlay = overlay(OverlayArg::Changed, title, palette, legend, entries);
        Ok(Layer { overlay, values: None })
    }

    fn uncertainty_layer(&mut self, evidence: &[f32]) -> Layer {
        let mut values = evidence.to_vec();
        values.resize(self.opened.scene.num_splats(), 0.0);
        let edited: Vec<u8> = values.iter().map(|&value| scale_entry(value, SCALE)).collect();
        let entries = match &self.opened.original {
            Some(original) => [vec![0; original.num_splats()], edited],
            None => [edited, Vec::new()],
        };
        let title = "Uncertainty of colours that the edited frame hides";
        let kind = OverlayArg::Uncertainty;
        let overlay = overlay(kind, title, scale(), scale_legend("0", "1"), entries);
        Layer { overlay, values: Some(values) }
    }
}

fn scale() -> Vec<[u8; 3]> {
    let mut palette = scale_colors(usize::from(SCALE));
    palette.push(NEUTRAL);
    palette
}

fn scale_legend(low: &str, high: &str) -> Legend {
    let scale = Some((0, low.to_owned(), SCALE - 1, high.to_owned()));
    Legend { classes: Vec::new(), scale }
}

fn overlay(
    kind: OverlayArg,
    title: &str,
    palette: Vec<[u8; 3]>,
    legend: Legend,
    entries: [Vec<u8>; 2],
) -> Overlay {
    let (name, title) = (kind.name().to_owned(), title.to_owned());
    Overlay { name, title, palette, legend, entries }
}
