//! DINO's vision transformer, with the tensor names of the original release or of Hugging Face.

use crate::NetworkError;
use crate::clip::{row, unit, with_class};
use crate::patches::Patches;
use crate::preprocess::{Planes, bicubic};
use crate::transformer::{Gelu, LayerNames, LayerNorm, Transformer};
use crate::weights::Weights;
use ndarray::{Array1, Array2};

const KIND: &str = "those of dino_vitbase16_pretrain.pth or of facebook/dino-vitb16";
const EPSILON: f32 = 1e-6;
/// Added to the number of patches before the position grid is scaled, as in the original code.
const OFFSET: f64 = 0.1;

/// Features of images of any size.
///
/// Caron et al. 2021, Emerging Properties in Self-Supervised Vision Transformers.
#[derive(Debug, Clone)]
pub struct Dino {
    patches: Patches,
    class: Array1<f32>,
    /// `[1 + grid², width]`.
    positions: Array2<f32>,
    transformer: Transformer,
    norm: LayerNorm,
}

impl Dino {
    /// The network of these weights; all sizes follow from their shapes.
    ///
    /// # Errors
    /// If a tensor is missing, has a different shape, or is not finite.
    pub fn open(weights: &Weights) -> Result<Self, NetworkError> {
        let (embeddings, patch, norm) = if weights.has("embeddings.cls_token") {
            let [class, positions] = ["cls_token", "position_embeddings"];
            (
                [class, positions].map(|part| format!("embeddings.{part}")),
                "embeddings.patch_embeddings.projection",
                "layernorm",
            )
        } else {
            (["cls_token", "pos_embed"].map(str::to_owned), "patch_embed.proj", "norm")
        };
        let class = weights.values(&embeddings[0], &[1, 1, 0], KIND)?;
        let width = class.len();
        let positions = weights.values(&embeddings[1], &[1, 0, width], KIND)?;
        let rows = positions.len() / width.max(1);
        if rows < 2 || (rows - 1).isqrt().pow(2) != rows - 1 {
            return Err(NetworkError::Shape {
                name: embeddings[1].clone(),
                found: vec![1, rows, width],
                expected: vec![1, 197, width],
            });
        }
        let bias = format!("{patch}.bias");
        Ok(Self {
            patches: Patches::open(weights, &format!("{patch}.weight"), Some(&bias), width, KIND)?,
            class: Array1::from(class.to_vec()),
            positions: crate::weights::matrix(rows, width, positions.to_vec()),
            transformer: Transformer::open(
                weights,
                &layers(weights),
                (width, EPSILON),
                (Gelu::Exact, false),
                KIND,
            )?,
            norm: LayerNorm::open(weights, norm, width, EPSILON, KIND)?,
        })
    }

    /// Unit vector of features, the class token, of a preprocessed image of any size.
    ///
    /// # Errors
    /// If the image is smaller than a patch.
    pub fn features(&self, image: &Planes) -> Result<Vec<f32>, NetworkError> {
        let [rows, columns] = self.patches.grid(image);
        if rows == 0 || columns == 0 {
            return Err(NetworkError::Image {
                width: image.width,
                height: image.height,
                len: image.values.len(),
                min_side: self.patches.size,
            });
        }
        let mut x = with_class(&self.class, &self.patches.apply(image));
        x += &self.positions_for(rows, columns);
        let x = self.transformer.apply(x);
        Ok(unit(self.norm.apply(&row(&x, 0)).into_raw_vec_and_offset().0))
    }

    /// Position embeddings of a grid of patches, interpolated from those of the square training grid.
    fn positions_for(&self, rows: usize, columns: usize) -> Array2<f32> {
        let side = (self.positions.nrows() - 1).isqrt();
        if rows == side && columns == side {
            return self.positions.clone();
        }
        let width = self.positions.ncols();
        let mut positions = Array2::zeros((1 + rows * columns, width));
        positions.row_mut(0).assign(&self.positions.row(0));
        // The scale of the original code, from which PyTorch computes source coordinates, not the
        // ratio of the sizes.
        let scale = |count: usize| side as f64 / (count as f64 + OFFSET);
        for feature in 0..width {
            let plane: Vec<f32> = self.positions.column(feature).iter().skip(1).copied().collect();
            let resized =
                bicubic(&plane, [side, side], [rows, columns], [scale(rows), scale(columns)]);
            for (mut row, value) in positions.rows_mut().into_iter().skip(1).zip(resized) {
                row[feature] = value;
            }
        }
        positions
    }
}

fn layers(weights: &Weights) -> Vec<LayerNames> {
    let original = weights.count("blocks.", ".mlp.fc1.weight");
    if original > 0 {
        return (0..original)
            .map(|n| LayerNames {
                norms: ["norm1", "norm2"].map(|part| format!("blocks.{n}.{part}")),
                qkv: vec![format!("blocks.{n}.attn.qkv")],
                out: format!("blocks.{n}.attn.proj"),
                mlp: ["fc1", "fc2"].map(|part| format!("blocks.{n}.mlp.{part}")),
            })
            .collect();
    }
    let prefix = "encoder.layer.";
    (0..weights.count(prefix, ".intermediate.dense.weight"))
        .map(|n| LayerNames {
            norms: ["before", "after"].map(|part| format!("{prefix}{n}.layernorm_{part}")),
            qkv: ["query", "key", "value"]
                .map(|part| format!("{prefix}{n}.attention.attention.{part}"))
                .to_vec(),
            out: format!("{prefix}{n}.attention.output.dense"),
            mlp: ["intermediate", "output"].map(|part| format!("{prefix}{n}.{part}.dense")),
        })
        .collect()
}
