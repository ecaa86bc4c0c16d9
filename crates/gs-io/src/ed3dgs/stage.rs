//! Builds the two stages from the tensors of a file.

use super::Ed3dgsError;
use super::options::TrainingOptions;
use crate::pth::{Layers, Tensor};
use gs_deform::{EmbeddingStage, Head};

/// Names of the heads in the order of `Component::ALL`.
const HEADS: [&str; 5] =
    ["pos_deform", "scales_deform", "rotations_deform", "opacity_deform", "rgb_deform"];
/// Largest number of rows of a table; published ones have up to 250.
const MAX_ROWS: f64 = 1e6;

/// The stages in use, coarse first.
pub(super) fn stages(
    layers: &Layers<'_>,
    options: &TrainingOptions,
) -> Result<Vec<EmbeddingStage>, Ed3dgsError> {
    if !layers.has("feature_out_f.0.weight") && !layers.has("feature_out_c.0.weight") {
        return Err(Ed3dgsError::OtherNetwork { found: layers.summary() });
    }
    let weight = layers.need("weight")?;
    let &[entries, dims] = weight.shape() else {
        return Err(table_error(weight, "[times, numbers]"));
    };
    if entries == 0 || dims == 0 {
        return Err(table_error(weight, "some times"));
    }
    let table = weight.to_f32s();
    let factors = options.factors();
    let used = [("c", options.no_coarse_deform), ("f", options.no_fine_deform)];
    let mut stages = Vec::new();
    for ((suffix, skipped), rows) in used.into_iter().zip(options.rows(entries)) {
        if skipped {
            continue;
        }
        if !(1.0..=MAX_ROWS).contains(&rows) {
            return Err(Ed3dgsError::TableRows { rows });
        }
        let mut heads = [const { None }; 5];
        for (index, head) in HEADS.iter().enumerate() {
            if !options.deforms[index] {
                continue;
            }
            let name = |layer: u8| format!("{head}_{suffix}.{layer}");
            #[expect(clippy::cast_possible_truncation, reason = "a factor from 0 to 1")]
            let factor = factors[index] as f32;
            let head = Head { hidden: layers.linear(&name(1))?, out: layers.linear(&name(3))? };
            heads[index] = Some((head, factor));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number within bounds"
        )]
        let rows = rows as usize;
        stages.push(EmbeddingStage {
            times: resampled(&table, dims, rows),
            trunk: layers.sequence(|index| format!("feature_out_{suffix}.{}", 2 * index))?,
            heads,
        });
    }
    Ok(stages)
}

fn table_error(weight: &Tensor<'_>, expected: &'static str) -> Ed3dgsError {
    Ed3dgsError::Table { shape: weight.shape().to_vec(), expected }
}

/// A table of `dims` columns resampled linearly to `rows` rows, with the ends aligned.
fn resampled(table: &[f32], dims: usize, rows: usize) -> Vec<f32> {
    let last = table.len() / dims - 1;
    let mut out = Vec::with_capacity(rows * dims);
    for row in 0..rows {
        let position = row as f64 * last as f64 / (rows.max(2) - 1) as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the last row"
        )]
        let lower = (position.floor() as usize).min(last);
        let (upper, fraction) = ((lower + 1).min(last), position - lower as f64);
        let value = |row: usize, k: usize| f64::from(table[row * dims + k]);
        #[expect(clippy::cast_possible_truncation, reason = "activations are single precision")]
        out.extend(
            (0..dims)
                .map(|k| ((1.0 - fraction) * value(lower, k) + fraction * value(upper, k)) as f32),
        );
    }
    out
}

/// Mean time offset of the training cameras, which is added to the time of a new view.
pub(super) fn mean_offset(layers: &Layers<'_>) -> f64 {
    let offsets = layers.get("offsets").map(Tensor::to_f32s).unwrap_or_default();
    let used: Vec<f64> =
        offsets.into_iter().filter(|&offset| offset != 0.0).map(f64::from).collect();
    if used.is_empty() { 0.0 } else { used.iter().sum::<f64>() / used.len() as f64 }
}
