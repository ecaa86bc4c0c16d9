//! Evaluation of a [`Selector`].

use crate::color::{base_color, hsv};
use crate::error::EditError;
use crate::reach;
use crate::resources::Resources;
use crate::selector::{Selector, SplatProperty};
use gs_core::Splats;

/// Input of the evaluation: the splats at the current step.
#[derive(Debug, Clone, Copy)]
pub struct SelectorInput<'a> {
    /// The splats.
    pub splats: &'a Splats,
    /// Input row of each splat, or of the splat it was copied from, `[N]`; `None` for grafts.
    pub origins: &'a [Option<u32>],
    /// Files and motion that selectors refer to.
    pub resources: &'a Resources,
}

impl Selector {
    /// Flags of the selected splats, `[N]`.
    ///
    /// # Errors
    /// If a row or part does not exist, or a resource in [`crate::ResourceNames`] was not loaded.
    pub fn evaluate(&self, frame: SelectorInput<'_>) -> Result<Vec<bool>, EditError> {
        let splats = frame.splats;
        let rows = 0..splats.len();
        let centre = |i: usize| splats.means[i].map(f64::from);
        Ok(match self {
            Self::All => vec![true; splats.len()],
            Self::Box { min, max } => rows
                .map(|i| (0..3).all(|axis| (min[axis]..=max[axis]).contains(&centre(i)[axis])))
                .collect(),
            Self::Sphere { center, radius } => {
                rows.map(|i| distance(centre(i), *center) <= *radius).collect()
            }
            Self::Plane { normal, offset } => rows
                .map(|i| (0..3).map(|k| normal[k] * centre(i)[k]).sum::<f64>() >= *offset)
                .collect(),
            Self::Range(field, bounds) => {
                rows.map(|i| bounds.contain(property(splats, i, *field))).collect()
            }
            Self::Color { rgb, tolerance } => rows
                .map(|i| {
                    let color = base_color(splats, i).map(|c| c.clamp(0.0, 1.0));
                    distance(color, *rgb) <= *tolerance
                })
                .collect(),
            Self::Hue { from, to } => rows
                .map(|i| {
                    hsv(base_color(splats, i)).0.is_some_and(|hue| {
                        if from <= to {
                            hue >= *from && hue <= *to
                        } else {
                            hue >= *from || hue <= *to
                        }
                    })
                })
                .collect(),
            Self::Mask(path) => {
                let mask = frame.resources.masks.get(path).ok_or_else(|| missing("mask", path))?;
                by_origin(frame, |row| mask.get(row).copied().unwrap_or(false))
            }
            Self::Moving => {
                let motion =
                    frame.resources.motion.as_ref().ok_or_else(|| missing("motion", "moving"))?;
                by_origin(frame, |row| motion.moving.get(row).copied().unwrap_or(false))
            }
            Self::Part(part) => {
                let motion =
                    frame.resources.motion.as_ref().ok_or_else(|| missing("motion", "part"))?;
                let num_parts = motion.parts.iter().copied().max().unwrap_or(0);
                if *part > num_parts {
                    return Err(EditError::Part { part: *part, num_parts });
                }
                by_origin(frame, |row| motion.parts.get(row) == Some(part))
            }
            Self::Ids(path) => {
                let listed = listed(path, frame.resources)?;
                by_origin(frame, |row| listed[row])
            }
            Self::Connected { point, gap, of } => {
                let inside = match of {
                    Some(of) => of.evaluate(frame)?,
                    None => vec![true; splats.len()],
                };
                let ids: Vec<usize> = rows.filter(|&i| inside[i]).collect();
                let points: Vec<[f64; 3]> = ids.iter().map(|&i| centre(i)).collect();
                let gap = gap.unwrap_or_else(|| reach::default_gap(&points));
                let found = reach::connected(&points, *point, gap);
                let mut selected = vec![false; splats.len()];
                for (&id, found) in ids.iter().zip(found) {
                    selected[id] = found;
                }
                selected
            }
            Self::Near(distance, inner) => {
                let inside = inner.evaluate(frame)?;
                let near = within_of(splats, &inside, *distance);
                near.iter().zip(&inside).map(|(near, inside)| *near && !*inside).collect()
            }
            Self::Grow(distance, inner) => {
                let inside = inner.evaluate(frame)?;
                let near = within_of(splats, &inside, *distance);
                near.iter().zip(&inside).map(|(near, inside)| *near || *inside).collect()
            }
            Self::Shrink(distance, inner) => {
                let inside = inner.evaluate(frame)?;
                let outside: Vec<bool> = inside.iter().map(|inside| !inside).collect();
                let near = within_of(splats, &outside, *distance);
                near.iter().zip(&inside).map(|(near, inside)| !*near && *inside).collect()
            }
            Self::Not(inner) => inner.evaluate(frame)?.iter().map(|inside| !inside).collect(),
            Self::And(terms) => combined(terms, frame, true, |a, b| a && b)?,
            Self::Or(terms) => combined(terms, frame, false, |a, b| a || b)?,
        })
    }
}

fn combined(
    terms: &[Selector],
    frame: SelectorInput<'_>,
    neutral: bool,
    join: impl Fn(bool, bool) -> bool,
) -> Result<Vec<bool>, EditError> {
    let mut selected = vec![neutral; frame.splats.len()];
    for term in terms {
        for (own, other) in selected.iter_mut().zip(term.evaluate(frame)?) {
            *own = join(*own, other);
        }
    }
    Ok(selected)
}

fn missing(kind: &'static str, name: &str) -> EditError {
    EditError::Missing { kind, name: name.to_owned() }
}

fn by_origin(frame: SelectorInput<'_>, selects: impl Fn(usize) -> bool) -> Vec<bool> {
    frame.origins.iter().map(|origin| origin.is_some_and(|row| selects(row as usize))).collect()
}

/// Flags of the input rows in a list, `[N]`.
fn listed(path: &str, resources: &Resources) -> Result<Vec<bool>, EditError> {
    let ranges = resources.ids.get(path).ok_or_else(|| missing("ids", path))?;
    let num_splats = resources.num_splats;
    let mut listed = vec![false; num_splats];
    for &(low, high) in ranges {
        let rows = usize::try_from(low).ok().zip(usize::try_from(high).ok());
        let Some((low, high)) = rows.filter(|&(_, high)| high < num_splats) else {
            return Err(EditError::Id { file: path.to_owned(), id: high, num_splats });
        };
        listed[low..=high].fill(true);
    }
    Ok(listed)
}

/// Flags of the splats at most `distance` from a splat of `inside`.
fn within_of(splats: &Splats, inside: &[bool], distance: f64) -> Vec<bool> {
    let points: Vec<[f64; 3]> = splats.means.iter().map(|mean| mean.map(f64::from)).collect();
    let sources: Vec<[f64; 3]> =
        points.iter().zip(inside).filter(|(_, inside)| **inside).map(|(point, _)| *point).collect();
    reach::within(&points, &sources, distance)
}

fn property(splats: &Splats, row: usize, field: SplatProperty) -> f64 {
    let mean = || splats.means[row].map(f64::from);
    let rgb = || base_color(splats, row).map(|c| c.clamp(0.0, 1.0));
    match field {
        SplatProperty::Opacity => f64::from(splats.opacity(row)),
        SplatProperty::Size => {
            let logs = splats.log_scales[row];
            f64::from(logs[0].max(logs[1]).max(logs[2])).exp()
        }
        SplatProperty::X => mean()[0],
        SplatProperty::Y => mean()[1],
        SplatProperty::Z => mean()[2],
        SplatProperty::Red => rgb()[0],
        SplatProperty::Green => rgb()[1],
        SplatProperty::Blue => rgb()[2],
        SplatProperty::Saturation => hsv(rgb()).1,
        SplatProperty::Brightness => hsv(rgb()).2,
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [0, 1, 2].map(|k| a[k] - b[k]);
    d[0].hypot(d[1]).hypot(d[2])
}
