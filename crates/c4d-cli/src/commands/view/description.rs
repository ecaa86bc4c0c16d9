//! Description of a splat: its class, the source of its motion, and the reason.

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::overlays::{Class, LayerSource, confidence, displacement};
use crate::scene::LoadedScene;
use amg::{Binding, RigidParts, RowKind};
use gs_core::{DynamicScene, Splats, sh};
use serde::Serialize;

/// Maximum number of listed sources of a blend.
const LISTED: usize = 4;

/// Facts about one splat.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Description {
    pub(super) title: String,
    pub(super) facts: Vec<(&'static str, String)>,
}

/// Data for the descriptions of a scene's splats, at the edited frame.
#[derive(Debug)]
pub(super) struct Descriptions {
    /// The scene before the edit; the scene itself if it is not a run.
    source: Side,
    edited: Option<Edited>,
    parts: RigidParts,
    /// Motion method: the fact `method` of the run.
    method: Option<String>,
}

#[derive(Debug)]
struct Side {
    splats: Splats,
    displacement: Vec<f32>,
}

#[derive(Debug)]
struct Edited {
    side: Side,
    binding: std::sync::Arc<Binding>,
    confidence: Vec<Option<f32>>,
    classes_of_source: Vec<Class>,
    size: f64,
}

impl Side {
    fn of(scene: &dyn DynamicScene, time: f32) -> Outcome<Self> {
        let splats = scene.at(time).map_err(Failure::input)?;
        Ok(Self { splats, displacement: displacement(scene, time)? })
    }

    /// Facts that apply to every splat.
    fn facts(&self, row: usize) -> Vec<(&'static str, String)> {
        let splats = &self.splats;
        let size = splats.log_scales[row].iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b)).exp();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        let [r, g, b] = splats.sh_of(row)[0]
            .map(|dc| (255.0 * (0.5 + sh::C0 * dc).clamp(0.0, 1.0)).round() as u8);
        let [x, y, z] = splats.means[row];
        vec![
            ("Position at the edited frame", format!("{x:.3}, {y:.3}, {z:.3}")),
            ("Size", format!("{size:.4} units")),
            ("Opacity", format!("{:.2}", splats.opacity(row))),
            ("Base colour", format!("#{r:02x}{g:02x}{b:02x}")),
            ("Moves by up to", format!("{:.3} units", self.displacement[row])),
        ]
    }
}

impl Descriptions {
    pub(super) fn of(
        opened: &LoadedScene,
        layers: &mut LayerSource<'_>,
        console: &Console,
    ) -> Outcome<Self> {
        let time = opened.edit_time;
        let parts = layers.parts(console)?.clone();
        let source = Side::of(layers.source.as_ref(), time)?;
        let edited = match &opened.binding {
            Some(binding) => {
                let size = layers.figure_size(console)?;
                Some(Edited {
                    side: Side::of(opened.scene.as_ref(), time)?,
                    confidence: confidence(layers.source.as_ref(), binding, time, size)?,
                    classes_of_source: Class::of_source(binding),
                    binding: binding.clone(),
                    size,
                })
            }
            None => None,
        };
        let method = opened.facts.iter().find(|fact| fact.0 == "method");
        Ok(Self { source, edited, parts, method: method.map(|fact| fact.1.clone()) })
    }

    /// Description of a splat of the scene, or of the scene before the edit if `before` is set;
    /// `None` if the row does not exist.
    pub(super) fn describe(&self, before: bool, row: usize) -> Option<Description> {
        match &self.edited {
            Some(edited) if !before => self.of_edited(edited, row),
            _ => self.of_source(row),
        }
    }

    fn part(&self, row: usize) -> String {
        match (self.parts.parts.get(row), self.parts.moving.get(row)) {
            (Some(&part), _) if part > 0 => format!("part {part}"),
            (_, Some(true)) => "moves, but belongs to no part".to_owned(),
            _ => "none: it does not move".to_owned(),
        }
    }

    fn of_source(&self, row: usize) -> Option<Description> {
        if row >= self.source.splats.len() {
            return None;
        }
        let mut facts = self.source.facts(row);
        facts.push(("Part", self.part(row)));
        facts.push(("Motion", "its own".to_owned()));
        if let Some(edited) = &self.edited {
            facts.push(("The edit", edited.classes_of_source[row].label().to_owned()));
        }
        Some(Description { title: format!("Splat {row}"), facts })
    }

    fn of_edited(&self, edited: &Edited, row: usize) -> Option<Description> {
        let Edited { side, binding, .. } = edited;
        let kind = *binding.kinds().get(row)?;
        let mut facts = side.facts(row);
        let (motion, why) = self.motion(edited, row, kind);
        facts.push(("The edit", Class::of(kind).label().to_owned()));
        facts.push(("Motion", motion));
        facts.push(("Reason", why));
        if let Some(id) = binding.heaviest(row) {
            facts.push(("Part that it follows", self.part(id as usize)));
        }
        if let Some(confidence) = edited.confidence[row] {
            facts.push(("Confidence", format!("{confidence:.2}")));
        }
        Some(Description { title: format!("Splat {row} of the edit"), facts })
    }

    /// Source of the motion of an edited splat, and the reason.
    fn motion(&self, edited: &Edited, row: usize, kind: RowKind) -> (String, String) {
        let (ids, weights) = edited.binding.row(row);
        let first = ids.first().copied().unwrap_or_default();
        match kind {
            RowKind::Unchanged => (
                format!("that of source splat {first}, exactly"),
                format!("all its values equal those of source splat {first}"),
            ),
            RowKind::Recolored => (
                format!("that of source splat {first}, exactly"),
                format!("its position, rotation and size equal those of source splat {first}"),
            ),
            RowKind::Moved | RowKind::Copied => {
                let group = edited.binding.group_of().get(row).map_or(0, |group| *group as usize);
                let center = self.source.splats.means[first as usize].map(f64::from);
                let change = edited.binding.groups().get(group);
                let change = change.map(|group| group.similarity.describe(center, edited.size));
                let change = change.unwrap_or_default();
                if kind == RowKind::Copied {
                    return (
                        format!("that of the surface of source splat {first}, {change}"),
                        "the edit copied it together with others, but not the splats that replace it"
                            .to_owned(),
                    );
                }
                (
                    format!("that of source splat {first}, {change}"),
                    "the edit moved it together with others".to_owned(),
                )
            }
            RowKind::Blended => {
                let mut order: Vec<usize> = (0..ids.len()).collect();
                order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
                let listed: Vec<String> = order
                    .iter()
                    .take(LISTED)
                    .map(|&i| format!("{} ({:.0} %)", ids[i], 100.0 * weights[i]))
                    .collect();
                let more = ids.len().saturating_sub(LISTED);
                let more = if more > 0 { format!(" and {more} more") } else { String::new() };
                let nearest = ids
                    .iter()
                    .map(|&id| self.distance(&edited.side, row, id as usize))
                    .fold(f32::INFINITY, f32::min);
                let method = self.method.as_deref().unwrap_or("unknown method");
                (
                    format!("a blend of source splats {}{more}", listed.join(", ")),
                    format!(
                        "it equals no source splat; the guide ({method}) selected these, the nearest is {nearest:.3} units away"
                    ),
                )
            }
            RowKind::Static => (
                "none: it is static".to_owned(),
                "its surroundings are static, or no source splat is within reach".to_owned(),
            ),
            RowKind::Field => (
                "the scene's deformation network at its position".to_owned(),
                "the baseline `deformnet` was chosen".to_owned(),
            ),
            RowKind::Descendant => (
                format!("that of source splat {first}, exactly"),
                "the edited frame does not show it; it belongs to a surface that was edited"
                    .to_owned(),
            ),
        }
    }

    fn distance(&self, side: &Side, row: usize, source: usize) -> f32 {
        let Some(b) = self.source.splats.means.get(source) else { return f32::INFINITY };
        let a = side.splats.means[row];
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt()
    }
}
