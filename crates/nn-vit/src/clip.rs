//! CLIP's two towers, with the tensor names of Hugging Face's `openai/clip-vit-…`.

use crate::NetworkError;
use crate::patches::Patches;
use crate::preprocess::Planes;
use crate::tokenizer::CONTEXT;
use crate::transformer::{Gelu, LayerNames, LayerNorm, Transformer};
use crate::weights::Weights;
use ndarray::{Array1, Array2, Axis, concatenate};

const KIND: &str = "those of Hugging Face's openai/clip-vit-base-patch32 or a similar network";
/// Epsilon of layer normalisation in OpenAI's networks.
const EPSILON: f32 = 1e-5;

/// Image and text features in one space.
///
/// Radford et al. 2021, Learning Transferable Visual Models From Natural Language Supervision.
#[derive(Debug, Clone)]
pub struct ClipNetwork {
    patches: Patches,
    class: Array1<f32>,
    /// `[1 + patches, width]`.
    positions: Array2<f32>,
    before: LayerNorm,
    vision: Transformer,
    after: LayerNorm,
    /// `[features, width]`.
    image_projection: Array2<f32>,
    tokens: Array2<f32>,
    /// `[77, width]`.
    text_positions: Array2<f32>,
    text: Transformer,
    text_norm: LayerNorm,
    text_projection: Array2<f32>,
}

fn layers(weights: &Weights, tower: &str) -> Vec<LayerNames> {
    let prefix = format!("{tower}.encoder.layers.");
    (0..weights.count(&prefix, ".mlp.fc1.weight"))
        .map(|n| LayerNames {
            norms: ["layer_norm1", "layer_norm2"].map(|part| format!("{prefix}{n}.{part}")),
            qkv: ["q", "k", "v"].map(|part| format!("{prefix}{n}.self_attn.{part}_proj")).to_vec(),
            out: format!("{prefix}{n}.self_attn.out_proj"),
            mlp: ["fc1", "fc2"].map(|part| format!("{prefix}{n}.mlp.{part}")),
        })
        .collect()
}

impl ClipNetwork {
    /// The network of these weights; all sizes follow from their shapes.
    ///
    /// # Errors
    /// If a tensor is missing, has a different shape, or is not finite.
    pub fn open(weights: &Weights) -> Result<Self, NetworkError> {
        let vision = |part: &str| format!("vision_model.{part}");
        let text = |part: &str| format!("text_model.{part}");
        let class = weights.vector(&vision("embeddings.class_embedding"), 0, KIND)?;
        let width = class.len();
        let patch = vision("embeddings.patch_embedding.weight");
        let positions =
            weights.matrix(&vision("embeddings.position_embedding.weight"), [0, width], KIND)?;
        let grid = positions.nrows().saturating_sub(1).isqrt();
        if grid == 0 || grid * grid + 1 != positions.nrows() {
            return Err(NetworkError::Shape {
                name: vision("embeddings.position_embedding.weight"),
                found: positions.shape().to_vec(),
                expected: vec![50, width],
            });
        }
        let tokens = weights.matrix(&text("embeddings.token_embedding.weight"), [0, 0], KIND)?;
        let text_width = tokens.ncols();
        let norm = |name: String, width| LayerNorm::open(weights, &name, width, EPSILON, KIND);
        Ok(Self {
            patches: Patches::open(weights, &patch, None, width, KIND)?,
            positions,
            // The name is misspelt in the files.
            before: norm(vision("pre_layrnorm"), width)?,
            vision: Transformer::open(
                weights,
                &layers(weights, "vision_model"),
                (width, EPSILON),
                (Gelu::Quick, false),
                KIND,
            )?,
            after: norm(vision("post_layernorm"), width)?,
            image_projection: weights.matrix("visual_projection.weight", [0, width], KIND)?,
            class,
            text_positions: weights.matrix(
                &text("embeddings.position_embedding.weight"),
                [CONTEXT, text_width],
                KIND,
            )?,
            text: Transformer::open(
                weights,
                &layers(weights, "text_model"),
                (text_width, EPSILON),
                (Gelu::Quick, true),
                KIND,
            )?,
            text_norm: norm(text("final_layer_norm"), text_width)?,
            text_projection: weights.matrix("text_projection.weight", [0, text_width], KIND)?,
            tokens,
        })
    }

    /// Side of the images, pixels: 224 for the usual networks.
    pub fn image_size(&self) -> usize {
        (self.positions.nrows().saturating_sub(1)).isqrt() * self.patches.size
    }

    /// Number of features.
    pub fn num_features(&self) -> usize {
        self.image_projection.nrows()
    }

    /// Unit vector of features, `[num_features]`, of a preprocessed image of the network's size.
    ///
    /// # Errors
    /// If the image has a different size.
    pub fn image_features(&self, image: &Planes) -> Result<Vec<f32>, NetworkError> {
        let side = self.image_size();
        if image.width != side || image.height != side {
            return Err(NetworkError::Image {
                width: image.width,
                height: image.height,
                len: image.values.len(),
                min_side: side,
            });
        }
        let patches = self.patches.apply(image);
        let mut x = with_class(&self.class, &patches);
        x += &self.positions;
        let x = self.vision.apply(self.before.apply(&x));
        let class = self.after.apply(&row(&x, 0));
        Ok(unit(class.dot(&self.image_projection.t()).into_raw_vec_and_offset().0))
    }

    /// Unit vector of features, `[num_features]`, of a text encoded by
    /// [`Tokenizer::encode`](crate::Tokenizer::encode).
    ///
    /// # Errors
    /// If a token is not in the vocabulary of the weights.
    pub fn text_features(&self, tokens: &[u32; CONTEXT]) -> Result<Vec<f32>, NetworkError> {
        let mut x = self.text_positions.clone();
        for (mut row, &token) in x.rows_mut().into_iter().zip(tokens) {
            let token = token as usize;
            if token >= self.tokens.nrows() {
                return Err(NetworkError::Shape {
                    name: "text_model.embeddings.token_embedding.weight".to_owned(),
                    found: self.tokens.shape().to_vec(),
                    expected: vec![token + 1, self.tokens.ncols()],
                });
            }
            row += &self.tokens.row(token);
        }
        let x = self.text_norm.apply(&self.text.apply(x));
        // The end of the text is the largest token.
        let end = (0..CONTEXT).rev().max_by_key(|&at| tokens[at]).unwrap_or_default();
        Ok(unit(row(&x, end).dot(&self.text_projection.t()).into_raw_vec_and_offset().0))
    }
}

/// One row as a matrix.
pub(crate) fn row(x: &Array2<f32>, at: usize) -> Array2<f32> {
    x.row(at).insert_axis(Axis(0)).to_owned()
}

/// The class token before the patches.
pub(crate) fn with_class(class: &Array1<f32>, patches: &Array2<f32>) -> Array2<f32> {
    let class = class.view().insert_axis(Axis(0));
    concatenate(Axis(0), &[class, patches.view()]).unwrap_or_default()
}

/// The vector divided by its length.
pub(crate) fn unit(mut values: Vec<f32>) -> Vec<f32> {
    let length = values.iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    for value in &mut values {
        *value /= length;
    }
    values
}
