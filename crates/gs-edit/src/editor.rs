//! [`Editor`]: splats, the current selection, and steps applied to them.

use crate::action::{Action, GraftPose, Pivot};
use crate::color::{ColorStats, LUMA, base_color, set_base_color, weight};
use crate::color_map::ColorMap;
use crate::error::EditError;
use crate::evaluate::SelectorInput;
use crate::resources::Resources;
use crate::script::Step;
use crate::style::{NoStyleTransfer, StyleTransfer};
use crate::transport;
use amg::Similarity;
use gs_core::{Image, Real, Splats, activation, quat};

/// Maximum opacity that edits produce: rasterisers composite at most 0.99, and the logit of 1 is
/// infinite.
pub const MAX_OPACITY: f64 = 0.9999;

/// Maximum number of pixels used for statistics; larger pictures are subsampled.
const MAX_PIXELS: usize = 1 << 16;

/// Minimum coverage of pixels that are used.
const MIN_COVERAGE: f32 = 0.5;

/// Splats, the current selection, and the steps applied so far. Rows that no step selects keep
/// their bits and their order; copies and grafts are appended.
#[derive(Debug, Clone)]
pub struct Editor {
    splats: Splats,
    origins: Vec<Option<u32>>,
    selected: Vec<bool>,
    /// Explanation of an empty selection, for messages.
    selection: String,
}

impl Editor {
    /// An editor in which all splats are selected.
    ///
    /// # Errors
    /// If the arrays have inconsistent lengths.
    pub fn new(splats: Splats) -> Result<Self, EditError> {
        splats.check_shapes()?;
        let rows = 0..splats.len();
        Ok(Self {
            origins: rows.map(|row| u32::try_from(row).ok()).collect(),
            selected: vec![true; splats.len()],
            selection: "the input has no splats".to_owned(),
            splats,
        })
    }

    /// The current splats.
    pub fn splats(&self) -> &Splats {
        &self.splats
    }

    /// The current splats, consuming the editor.
    pub fn into_splats(self) -> Splats {
        self.splats
    }

    /// Flags of the splats that the next action changes, `[N]`.
    pub fn selected(&self) -> &[bool] {
        &self.selected
    }

    /// Input row of each splat, or of the splat it was copied from, `[N]`; `None` for grafts.
    pub fn origins(&self) -> &[Option<u32>] {
        &self.origins
    }

    /// Applies one step, which must not be [`Action::Style`].
    ///
    /// # Errors
    /// If the step fails; the splats are then unchanged.
    pub fn apply(&mut self, step: &Step, resources: &Resources) -> Result<(), EditError> {
        self.apply_with(step, resources, &mut NoStyleTransfer)
    }

    /// Applies one step; `style` fits the patterns of [`Action::Style`].
    ///
    /// # Errors
    /// If the step fails; the splats are then unchanged.
    pub fn apply_with(
        &mut self,
        step: &Step,
        resources: &Resources,
        style: &mut dyn StyleTransfer,
    ) -> Result<(), EditError> {
        match step {
            Step::Select(selector) => {
                let frame =
                    SelectorInput { splats: &self.splats, origins: &self.origins, resources };
                self.selected = selector.evaluate(frame)?;
                self.selection =
                    format!("the last `--select` selects none of {} splats", self.splats.len());
                Ok(())
            }
            Step::Act(action) => self.act(action, resources, style),
        }
    }

    fn rows(&self) -> Vec<usize> {
        (0..self.splats.len()).filter(|&row| self.selected[row]).collect()
    }

    fn act(
        &mut self,
        action: &Action,
        resources: &Resources,
        style: &mut dyn StyleTransfer,
    ) -> Result<(), EditError> {
        let name = action.name();
        let rows = self.rows();
        if rows.is_empty() && !matches!(action, Action::Graft { .. }) {
            return Err(EditError::EmptySelection { action: name, why: self.selection.clone() });
        }
        match action {
            Action::Delete => return self.retain(name, |selected| !selected),
            Action::Keep => return self.retain(name, |selected| selected),
            Action::Duplicate => {
                let copies = self.splats.select(&rows);
                let origins = rows.iter().map(|&row| self.origins[row]).collect();
                self.append(&copies, origins);
                return Ok(());
            }
            Action::Graft { file, pose } => {
                let found = resources.splats.get(file);
                let graft = found.ok_or_else(|| missing("splats", file))?;
                graft.check_shapes()?;
                let graft =
                    pose.similarity().transform(&graft.with_sh_degree(self.splats.sh_degree));
                check_finite(name, &graft, 0..graft.len())?;
                self.append(&graft, vec![None; graft.len()]);
                return Ok(());
            }
            _ => {}
        }
        let mut part = self.splats.select(&rows);
        match action {
            Action::Translate(offset) => {
                // Rotations and harmonics keep their bits.
                for mean in &mut part.means {
                    *mean = [0, 1, 2].map(|k| (f64::from(mean[k]) + offset[k]).as_f32());
                }
            }
            Action::Rotate { degrees, pivot } => {
                let turn = Similarity { rotation: rotation(*degrees), ..Similarity::IDENTITY };
                part = about(turn, pivot_of(&part, *pivot)).transform(&part);
            }
            Action::Scale { factor, pivot } => {
                let scale = Similarity { scale: *factor, ..Similarity::IDENTITY };
                part = about(scale, pivot_of(&part, *pivot)).transform(&part);
            }
            Action::Opacity(factor) => {
                for logit in &mut part.opacity_logits {
                    *logit = scaled_opacity(*logit, *factor);
                }
            }
            Action::MatchColors { image, sliced } => {
                let picture = resources.images.get(image).ok_or_else(|| missing("image", image))?;
                match_colors(&mut part, picture, *sliced)
                    .ok_or_else(|| EditError::EmptyImage(image.clone()))?;
            }
            Action::Style { image, strength } => {
                let picture = resources.images.get(image).ok_or_else(|| missing("image", image))?;
                let before = part.clone();
                match_colors(&mut part, picture, true)
                    .ok_or_else(|| EditError::EmptyImage(image.clone()))?;
                let mut matched = self.splats.clone();
                write_rows(&mut matched, &rows, &part);
                let styled = style
                    .transfer(&matched, &self.selected, picture)
                    .map_err(|source| EditError::Style { name: image.clone(), source })?;
                styled.check_shapes()?;
                part.sh = styled.select(&rows).sh;
                mix(&mut part, &before, *strength);
            }
            _ => {
                if let Some(map) = color_map(action, &part) {
                    let coeffs = part.sh_coeffs();
                    part.sh.chunks_exact_mut(coeffs).for_each(|sh| map.apply_sh(sh));
                }
            }
        }
        check_finite(name, &part, rows.iter().copied())?;
        write_rows(&mut self.splats, &rows, &part);
        Ok(())
    }

    fn retain(
        &mut self,
        name: &'static str,
        keeps: impl Fn(bool) -> bool,
    ) -> Result<(), EditError> {
        let kept: Vec<usize> =
            (0..self.splats.len()).filter(|&row| keeps(self.selected[row])).collect();
        if kept.is_empty() {
            return Err(EditError::NothingLeft(name));
        }
        self.splats = self.splats.select(&kept);
        self.origins = kept.iter().map(|&row| self.origins[row]).collect();
        self.selected = kept.iter().map(|&row| self.selected[row]).collect();
        self.selection =
            "the selected splats were deleted; select others with `--select` first".into();
        Ok(())
    }

    /// Appends splats of the same SH degree and selects them alone.
    fn append(&mut self, splats: &Splats, origins: Vec<Option<u32>>) {
        self.selected.fill(false);
        for row in 0..splats.len() {
            self.splats.push_from(splats, row);
            self.selected.push(true);
        }
        self.origins.extend(origins);
        self.selection = "the graft has no splats".into();
    }
}

impl GraftPose {
    /// The similarity from the world frame of the file to that of the input.
    pub fn similarity(&self) -> Similarity {
        Similarity {
            scale: self.scale,
            rotation: rotation(self.degrees),
            mirrored: false,
            translation: self.translation,
        }
    }
}

/// Replaces `rows` of `splats` by the rows of `part`, which has the same SH degree.
fn write_rows(splats: &mut Splats, rows: &[usize], part: &Splats) {
    let coeffs = splats.sh_coeffs();
    for (i, &row) in rows.iter().enumerate() {
        splats.means[row] = part.means[i];
        splats.quats[row] = part.quats[i];
        splats.log_scales[row] = part.log_scales[i];
        splats.opacity_logits[row] = part.opacity_logits[i];
        splats.sh[row * coeffs..(row + 1) * coeffs].copy_from_slice(part.sh_of(i));
    }
}

/// Mixes the harmonics of `part` with those of `before`: `strength` of `part`, 0 to 1.
fn mix(part: &mut Splats, before: &Splats, strength: f64) {
    for (new, old) in part.sh.iter_mut().zip(&before.sh) {
        for (new, &old) in new.iter_mut().zip(old) {
            *new = (f64::from(old) + strength * (f64::from(*new) - f64::from(old))).as_f32();
        }
    }
}

fn missing(kind: &'static str, name: &str) -> EditError {
    EditError::Missing { kind, name: name.to_owned() }
}

/// Unit quaternion of rotations about x, then y, then z, fixed axes: `R_z·R_y·R_x`.
fn rotation(degrees: [f64; 3]) -> [f64; 4] {
    let half = degrees.map(|angle| 0.5 * angle.rem_euclid(720.0).to_radians());
    let about = |axis: usize| {
        let mut q = [half[axis].cos(), 0.0, 0.0, 0.0];
        q[axis + 1] = half[axis].sin();
        q
    };
    quat::normalize(quat::mul(about(2), quat::mul(about(1), about(0))))
}

/// `map` with the fixed point `pivot` instead of the origin.
fn about(map: Similarity, pivot: [f64; 3]) -> Similarity {
    let turned = map.apply_vector(pivot);
    Similarity { translation: [0, 1, 2].map(|k| pivot[k] - turned[k]), ..map }
}

/// The point, or the mean of the finite centres.
fn pivot_of(splats: &Splats, pivot: Pivot) -> [f64; 3] {
    if let Pivot::Point(point) = pivot {
        return point;
    }
    let (mut sum, mut count) = ([0.0; 3], 0.0_f64);
    for mean in splats.means.iter().filter(|mean| mean.iter().all(|v| v.is_finite())) {
        for k in 0..3 {
            sum[k] += f64::from(mean[k]);
        }
        count += 1.0;
    }
    sum.map(|total| total / count.max(1.0))
}

fn scaled_opacity(logit: f32, factor: f64) -> f32 {
    if factor == 1.0 {
        return logit;
    }
    let opacity = activation::sigmoid(f64::from(logit));
    // Opacities above the limit are not lowered by a factor above 1.
    let limit = if factor > 1.0 { MAX_OPACITY.max(opacity) } else { 1.0 };
    activation::logit((factor * opacity).min(limit)).as_f32()
}

fn color_map(action: &Action, part: &Splats) -> Option<ColorMap> {
    Some(match action {
        Action::Color { rgb, strength } => {
            let rows: Vec<usize> = (0..part.len()).collect();
            let mean = ColorStats::of_splats(part, &rows)?.mean;
            let luma = (0..3).map(|c| LUMA[c] * mean[c]).sum();
            ColorMap::color(*rgb, *strength, luma)
        }
        Action::Hue(degrees) => ColorMap::hue(*degrees),
        Action::Saturation(factor) => ColorMap::saturation(*factor),
        Action::Brightness(amount) => ColorMap::brightness(*amount),
        Action::Levels { black, white } => ColorMap::levels(*black, *white),
        Action::Tint { rgb, strength } => ColorMap::tint(*rgb, *strength),
        _ => return None,
    })
}

/// Colours of a picture with equal weights, `None` if no pixel is covered.
fn pixels(image: &Image) -> Option<Vec<([f64; 3], f64)>> {
    let count = image.width * image.height;
    let step = count.div_ceil(MAX_PIXELS).max(1);
    let covered = |pixel: &&[f32]| {
        pixel.len() >= 3
            && pixel.iter().all(|v| v.is_finite())
            && pixel.get(3).is_none_or(|&coverage| coverage >= MIN_COVERAGE)
    };
    let colors: Vec<_> = image
        .data
        .chunks_exact(image.channels.max(1))
        .filter(covered)
        .step_by(step)
        .map(|pixel| ([0, 1, 2].map(|c| f64::from(pixel[c])), 1.0))
        .collect();
    (!colors.is_empty()).then_some(colors)
}

/// `None` if the picture has no covered pixels.
fn match_colors(part: &mut Splats, picture: &Image, sliced: bool) -> Option<()> {
    let rows: Vec<usize> = (0..part.len()).collect();
    let target = pixels(picture)?;
    let source_stats = ColorStats::of_splats(part, &rows)?;
    let map = transport::gaussian(&source_stats, &ColorStats::of(target.iter().copied())?);
    let coeffs = part.sh_coeffs();
    part.sh.chunks_exact_mut(coeffs).for_each(|sh| map.apply_sh(sh));
    if sliced {
        let mut colors: Vec<[f64; 3]> = rows.iter().map(|&row| base_color(part, row)).collect();
        let mut weights: Vec<f64> = rows.iter().map(|&row| weight(part, row)).collect();
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            weights.fill(1.0);
        }
        transport::sliced(&mut colors, &weights, &target);
        for (&row, rgb) in rows.iter().zip(colors) {
            set_base_color(part, row, rgb);
        }
    }
    Some(())
}

/// Rejects values that overflowed. `rows` are the row numbers for messages, one per splat.
fn check_finite(
    action: &'static str,
    splats: &Splats,
    rows: impl Iterator<Item = usize>,
) -> Result<(), EditError> {
    let coeffs = splats.sh_coeffs();
    for (i, row) in rows.enumerate() {
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        let sh = splats.sh[i * coeffs..(i + 1) * coeffs].iter().all(|rgb| finite(rgb));
        let fields = [
            ("means", finite(&splats.means[i])),
            ("quats", finite(&splats.quats[i])),
            // Infinities with a meaning are allowed: no extent, opacity 0 or 1.
            ("log_scales", splats.log_scales[i].iter().all(|&v| v < f32::INFINITY)),
            ("opacity_logits", !splats.opacity_logits[i].is_nan()),
            ("sh", sh),
        ];
        if let Some((field, _)) = fields.into_iter().find(|(_, sound)| !sound) {
            return Err(EditError::NotFinite { action, field, row });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_about_x_then_y_then_z() {
        let turned = |degrees, v| quat::rotate(rotation(degrees), v);
        let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-12);
        assert!(close(turned([90.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]), "y to z");
        assert!(close(turned([0.0, 0.0, 90.0], [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]), "x to y");
        assert!(close(turned([90.0, 0.0, 90.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]), "x first");
    }

    #[test]
    fn opacities_are_limited() {
        let raised = |opacity: f64, factor| {
            activation::sigmoid(f64::from(scaled_opacity(
                activation::logit(opacity).as_f32(),
                factor,
            )))
        };
        assert!((raised(0.3, 2.0) - 0.6).abs() < 1e-6, "doubled");
        assert!((raised(0.8, 2.0) - MAX_OPACITY).abs() < 1e-6, "limited");
        assert_eq!(scaled_opacity(f32::INFINITY, 2.0), f32::INFINITY, "opaque stays opaque");
    }
}
