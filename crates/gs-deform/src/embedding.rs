//! [`EmbeddingScene`]: splats with one embedding each; a network maps it
//! and the time to a deformation, as in E-D3DGS.

use crate::linear::{Activation, Linear, PANEL, Packed};
use crate::network::Component;
use crate::{FieldError, Head};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// One stage of the deformation as a checkpoint stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct EmbeddingStage {
    /// Embeddings of evenly spaced times from 0 to 1, `[R, D]` row-major; between them they are
    /// interpolated linearly.
    pub times: Vec<f32>,
    /// Layers on the embeddings of time and splat, concatenated:
    /// ReLU between them, none after the last.
    pub trunk: Vec<Linear>,
    /// Heads in use, in the order of [`Component::ALL`], each with a factor for its output.
    pub heads: [Option<(Head, f32)>; 5],
}

/// A verified stage.
#[derive(Debug)]
struct Stage {
    times: Vec<f32>,
    dims: usize,
    trunk: Vec<Packed>,
    heads: Vec<(Component, [Packed; 2], f32)>,
}

/// Splats deformed by two stages in sequence: a model of E-D3DGS, at times 0 to
/// 1. All changes are added to stored parameters.
#[derive(Debug)]
pub struct EmbeddingScene {
    canonical: Splats,
    /// `[N, G]`.
    embeddings: Vec<f32>,
    embedding_dims: usize,
    stages: Vec<Stage>,
    time_offset: f64,
}

impl EmbeddingScene {
    /// A scene from its parts. `embeddings` is `[N, G]`; `time_offset` is added to every time.
    ///
    /// # Errors
    /// Names the first part that does not fit or is not finite.
    pub fn new(
        canonical: Splats,
        embeddings: Vec<f32>,
        stages: Vec<EmbeddingStage>,
        time_offset: f64,
    ) -> Result<Self, FieldError> {
        canonical.check_shapes()?;
        let n = canonical.len();
        let embedding_dims = embeddings.len().checked_div(n).unwrap_or(0);
        if embedding_dims == 0 || embedding_dims * n != embeddings.len() {
            return Err(FieldError::Shape {
                tensor: "embedding".to_owned(),
                found: vec![embeddings.len()],
                expected: format!("[{n}, 1 or more]"),
            });
        }
        let finite = |name: &str, values: &[f32]| {
            if values.iter().all(|value| value.is_finite()) {
                return Ok(());
            }
            Err(FieldError::NotFinite { tensor: name.to_owned() })
        };
        finite("embedding", &embeddings)?;
        if !time_offset.is_finite() {
            return Err(FieldError::NotFinite { tensor: "offsets".to_owned() });
        }
        let mut verified = Vec::with_capacity(stages.len());
        for EmbeddingStage { times, trunk, heads } in stages {
            finite("weight", &times)?;
            let inputs = trunk.first().map_or(0, Linear::num_inputs);
            let dims = inputs.saturating_sub(embedding_dims);
            if dims == 0 || times.is_empty() || times.len() % dims != 0 {
                return Err(FieldError::Shape {
                    tensor: "feature_out.0".to_owned(),
                    found: vec![trunk.first().map_or(0, Linear::num_outputs), inputs],
                    expected: format!(
                        "inputs for an embedding of time and one of {embedding_dims} numbers"
                    ),
                });
            }
            let mut width = inputs;
            for (index, layer) in trunk.iter().enumerate() {
                layer.check(&format!("feature_out.{}", 2 * index), width, None)?;
                width = layer.num_outputs();
            }
            let mut packed = Vec::new();
            for (component, head) in Component::ALL.into_iter().zip(heads) {
                let Some((head, factor)) = head else { continue };
                let name = component.head_name();
                head.hidden.check(&format!("{name}.1"), width, None)?;
                let hidden = head.hidden.num_outputs();
                head.out.check(&format!("{name}.3"), hidden, Some(component.num_outputs()))?;
                if component == Component::Sh && canonical.sh_degree != 3 {
                    return Err(FieldError::Unsupported(format!(
                        "colours are deformed, which needs SH degree 3, found {}",
                        canonical.sh_degree
                    )));
                }
                let layers = [Packed::new(&head.hidden), Packed::new(&head.out)];
                packed.push((component, layers, factor));
            }
            let trunk = trunk.iter().map(Packed::new).collect();
            verified.push(Stage { times, dims, trunk, heads: packed });
        }
        Ok(Self { canonical, embeddings, embedding_dims, stages: verified, time_offset })
    }

    /// The stored splats, before any deformation.
    pub fn canonical(&self) -> &Splats {
        &self.canonical
    }

    fn evaluate(&self, t: f32, all: bool, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        out.means.clone_from(&self.canonical.means);
        out.quats.clone_from(&self.canonical.quats);
        out.log_scales.clone_from(&self.canonical.log_scales);
        if all {
            out.opacity_logits.clone_from(&self.canonical.opacity_logits);
            out.sh.clone_from(&self.canonical.sh);
            out.sh_degree = self.canonical.sh_degree;
        }
        let time = f64::from(t) + self.time_offset;
        for stage in &self.stages {
            self.deform(stage, &stage.embedding(time), all, out);
        }
        Ok(())
    }

    fn deform(&self, stage: &Stage, time: &[f32], all: bool, out: &mut Splats) {
        let coeffs = self.canonical.sh_coeffs();
        let dims = self.embedding_dims;
        let shown = if all { out.means.len() } else { 0 };
        let (mut logits, mut sh) =
            (&mut out.opacity_logits[..shown], &mut out.sh[..shown * coeffs]);
        let mut work = Vec::with_capacity(self.canonical.len().div_ceil(PANEL));
        let geometry = out
            .means
            .chunks_mut(PANEL)
            .zip(out.log_scales.chunks_mut(PANEL))
            .zip(out.quats.chunks_mut(PANEL))
            .zip(self.embeddings.chunks(PANEL * dims));
        for (((means, log_scales), quats), embeddings) in geometry {
            let count = if all { means.len() } else { 0 };
            let (own_logits, rest) = std::mem::take(&mut logits).split_at_mut(count);
            logits = rest;
            let (own_sh, rest) = std::mem::take(&mut sh).split_at_mut(count * coeffs);
            sh = rest;
            work.push(Rows {
                means,
                log_scales,
                quats,
                logits: own_logits,
                sh: own_sh,
                embeddings,
            });
        }
        let arch = Arch::new();
        work.into_par_iter().for_each_init(
            || Scratch::new(stage),
            |scratch, rows| arch.dispatch(Evaluate { stage, time, dims, rows, scratch }),
        );
    }
}

impl Stage {
    /// Embedding of a time: linear between the rows, reflected beyond the first and the last.
    fn embedding(&self, t: f64) -> Vec<f32> {
        let rows = self.times.len() / self.dims;
        let last = (rows - 1) as f64;
        // Reflection has a period of twice the length.
        let folded = if last > 0.0 { (t * last).rem_euclid(2.0 * last) } else { 0.0 };
        let position = if folded > last { 2.0 * last - folded } else { folded };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the number of rows"
        )]
        let row = (position.floor() as usize).min(rows - 1);
        let (fraction, next) = (position - row as f64, (row + 1).min(rows - 1));
        let value = |row: usize, k: usize| f64::from(self.times[row * self.dims + k]);
        #[expect(clippy::cast_possible_truncation, reason = "activations are single precision")]
        let embedding = (0..self.dims)
            .map(|k| ((1.0 - fraction) * value(row, k) + fraction * value(next, k)) as f32)
            .collect();
        embedding
    }
}

/// Rows of one panel.
struct Rows<'a> {
    means: &'a mut [[f32; 3]],
    log_scales: &'a mut [[f32; 3]],
    quats: &'a mut [[f32; 4]],
    logits: &'a mut [f32],
    sh: &'a mut [[f32; 3]],
    embeddings: &'a [f32],
}

/// Working memory of one thread, feature-major panels.
struct Scratch {
    input: Vec<f32>,
    a: Vec<f32>,
    b: Vec<f32>,
    hidden: Vec<f32>,
    out: Vec<f32>,
}

impl Scratch {
    fn new(stage: &Stage) -> Self {
        let inputs = stage.trunk.first().map_or(0, Packed::num_inputs);
        let hidden = stage.heads.iter().map(|(_, layers, _)| &layers[0]);
        let widest = stage.trunk.iter().chain(hidden).map(Packed::panel_len).max().unwrap_or(0);
        let outputs = stage.heads.iter().map(|(_, layers, _)| layers[1].panel_len()).max();
        Self {
            input: vec![0.0; inputs * PANEL],
            a: vec![0.0; widest],
            b: vec![0.0; widest],
            hidden: vec![0.0; widest],
            out: vec![0.0; outputs.unwrap_or(0)],
        }
    }
}

struct Evaluate<'a, 'b> {
    stage: &'a Stage,
    time: &'a [f32],
    /// `G`.
    dims: usize,
    rows: Rows<'b>,
    scratch: &'a mut Scratch,
}

impl WithSimd for Evaluate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { stage, time, dims, rows, scratch } = self;
        let Scratch { input, a, b, hidden, out } = scratch;
        for (k, value) in time.iter().enumerate() {
            input[k * PANEL..(k + 1) * PANEL].fill(*value);
        }
        for (i, embedding) in rows.embeddings.chunks_exact(dims).enumerate() {
            for (k, value) in embedding.iter().enumerate() {
                input[(time.len() + k) * PANEL + i] = *value;
            }
        }
        // Heads begin with a ReLU; it is applied here, after the last layer.
        for (index, layer) in stage.trunk.iter().enumerate() {
            let from: &[f32] = if index == 0 { input } else { a };
            layer.apply(simd, from, b, Activation::Relu);
            std::mem::swap(a, b);
        }
        for (component, [first, last], factor) in &stage.heads {
            let appearance = matches!(component, Component::OpacityLogits | Component::Sh);
            if appearance && rows.logits.is_empty() {
                continue;
            }
            first.apply(simd, a, hidden, Activation::Relu);
            last.apply(simd, hidden, out, Activation::None);
            match component {
                Component::Means => add(rows.means.as_flattened_mut(), 3, *factor, out),
                Component::LogScales => add(rows.log_scales.as_flattened_mut(), 3, *factor, out),
                Component::Quats => add(rows.quats.as_flattened_mut(), 4, *factor, out),
                Component::OpacityLogits => add(rows.logits, 1, *factor, out),
                Component::Sh => add(rows.sh.as_flattened_mut(), 48, *factor, out),
            }
        }
    }
}

/// Adds the panel, times `factor`, to rows of `width` values.
#[inline(always)]
fn add(values: &mut [f32], width: usize, factor: f32, panel: &[f32]) {
    for (i, row) in values.chunks_exact_mut(width).enumerate() {
        for (k, value) in row.iter_mut().enumerate() {
            *value += factor * panel[k * PANEL + i];
        }
    }
}

impl DynamicScene for EmbeddingScene {
    fn num_splats(&self) -> usize {
        self.canonical.len()
    }

    fn sh_degree(&self) -> usize {
        self.canonical.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, true, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, false, out)
    }

    fn fades(&self) -> bool {
        let fading = |stage: &Stage| {
            stage.heads.iter().any(|(component, ..)| *component == Component::OpacityLogits)
        };
        self.stages.iter().any(fading)
    }
}
