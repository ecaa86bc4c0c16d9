//! [`Evaluator`]: renders a supervised image with the current offsets and differentiates its loss.

use crate::{
    Crop, CuarError, DescentEngine, DescentImage, Entry, RefineOptions,
    loss::{L1Shape, LossParts, Objective, Targets},
    sample::{BACK, FORE, LIVE, Sample, live_tiles},
};
use gs_core::{
    Camera, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, TileSet, UpstreamGrads, sh,
};
use rayon::prelude::*;

/// Which derivatives of the objective are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Derivatives {
    /// No derivatives: only the values, exact and with the L1 smoothed with width δ.
    Loss(f64),
    /// The gradient with respect to splat colours.
    Gradient,
    /// The gradient of the smoothed L1 (width δ), with a bound of its second derivative.
    Curvature(f64),
}

/// The offsets being refined, shared by all images.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Offsets<'a> {
    /// `[E,K,3]`.
    pub d_sh: &'a [[f32; 3]],
    pub sh_degree: usize,
}

/// Channels of an evaluation: the change of colour, and the coverage by edited splats.
const CHANNELS: usize = 4;

/// Renders and differentiates samples; owns the work memory.
pub(crate) struct Evaluator<P> {
    prepared: Option<P>,
    features: Vec<f32>,
    output: RenderOutput,
    upstream: UpstreamGrads,
    grads: RenderGrads,
    objective: Option<(Crop, Objective<f32>)>,
    /// Crop's render, `[h,w,3]`.
    pub render: Vec<f32>,
    v_render: Vec<f32>,
    curvature: Vec<f32>,
    masks: [Vec<f32>; 2],
    /// Change of colour per entry before the clamp at 0.
    pub changes: Vec<[f32; 3]>,
    /// Per entry: gradient with respect to its (clamped) colour, and the curvature.
    pub color_grads: Vec<[f32; 4]>,
    /// Seconds in prepare, forward, loss, backward.
    pub secs: [f64; 4],
}

impl<P> Default for Evaluator<P> {
    fn default() -> Self {
        Self {
            prepared: None,
            features: Vec::new(),
            output: RenderOutput::default(),
            upstream: UpstreamGrads::default(),
            grads: RenderGrads::default(),
            objective: None,
            render: Vec::new(),
            v_render: Vec::new(),
            curvature: Vec::new(),
            masks: Default::default(),
            changes: Vec::new(),
            color_grads: Vec::new(),
            secs: [0.0; 4],
        }
    }
}

impl<P> Evaluator<P> {
    /// One step of `engine` on `sample`, number `index`.
    pub(crate) fn step_on<R: Rasterizer<Prepared = P>>(
        &mut self,
        engine: &mut dyn DescentEngine<P>,
        raster: &R,
        (index, sample): (usize, &mut Sample<P>),
        camera: &Camera,
    ) -> Result<(), CuarError> {
        let clock = std::time::Instant::now();
        let Sample { splats, prepared, original, warp, flags, entries, crop, .. } = sample;
        let live = || live_tiles(*crop, flags, camera);
        let prepared = prepared_or(prepared, &mut self.prepared, raster, (splats, camera), live)?;
        self.secs[0] += clock.elapsed().as_secs_f64();
        let size = [camera.width as usize, camera.height as usize];
        let image = DescentImage { index, size, crop: *crop, original, warp, flags, entries };
        Ok(engine.step(&image, prepared)?)
    }

    /// Renders `sample` with `offsets` and compares it with its targets. Fills `changes` and
    /// `render`, and `color_grads` unless `derivatives` is [`Derivatives::Loss`].
    pub(crate) fn evaluate<R: Rasterizer<Prepared = P>>(
        &mut self,
        raster: &R,
        sample: &mut Sample<P>,
        camera: &Camera,
        offsets: Offsets,
        options: &RefineOptions,
        derivatives: Derivatives,
    ) -> Result<LossParts, CuarError> {
        let clock = std::time::Instant::now();
        let mut laps = [0.0; 5];
        let mut lap = |index: usize| laps[index] = clock.elapsed().as_secs_f64();
        let Sample { splats, prepared, entries, crop, flags, .. } = sample;
        let live = || live_tiles(*crop, flags, camera);
        let prepared = prepared_or(prepared, &mut self.prepared, raster, (splats, camera), live)?;
        lap(0);

        let full = [camera.width as usize, camera.height as usize];
        change_colors(entries, offsets, &mut self.changes);
        let params = RenderParams {
            rgb: false,
            depth: false,
            background: options.background,
            ..RenderParams::default()
        };
        self.features.clear();
        self.features.resize(splats.len() * CHANNELS, 0.0);
        for (entry, change) in entries.iter().zip(&self.changes) {
            let out = &mut self.features[entry.local as usize * CHANNELS..];
            for channel in 0..3 {
                let before = entry.color[channel];
                out[channel] = (before + change[channel]).max(0.0) - before.max(0.0);
            }
            out[3] = 1.0;
        }
        raster.forward_into(prepared, splats, &self.features, &params, &mut self.output)?;
        lap(1);

        self.render.clone_from(&sample.original);
        let image = &self.output.features;
        for (p, flags) in sample.flags.iter().enumerate() {
            if flags & LIVE == 0 {
                continue;
            }
            let q = (crop.y + p / crop.width) * full[0] + crop.x + p % crop.width;
            for channel in 0..3 {
                self.render[p * 3 + channel] += image[q * CHANNELS + channel];
            }
        }
        for (mask, bit) in self.masks.iter_mut().zip([FORE, BACK]) {
            mask.clear();
            mask.extend(sample.flags.iter().map(|flags| f32::from(u8::from(flags & bit != 0))));
        }
        if self
            .objective
            .as_ref()
            .is_none_or(|(size, _)| (size.width, size.height) != (crop.width, crop.height))
        {
            let objective =
                Objective::new(crop.width, crop.height, full[0] * full[1], options.weights);
            self.objective = Some((*crop, objective));
        }
        let Some((_, objective)) = &mut self.objective else {
            return Err(CuarError::input("no objective"));
        };
        let targets = Targets {
            original: &sample.original,
            warp: &sample.warp,
            fore: &self.masks[0],
            back: &self.masks[1],
        };
        let (shape, curvature) = match derivatives {
            Derivatives::Curvature(delta) => (L1Shape::Smooth(delta), Some(&mut self.curvature)),
            Derivatives::Loss(delta) if delta > 0.0 => (L1Shape::Smooth(delta), None),
            _ => (L1Shape::Exact, None),
        };
        let parts =
            objective.evaluate(&self.render, &targets, shape, &mut self.v_render, curvature);
        lap(2);

        if !matches!(derivatives, Derivatives::Loss(_)) {
            let plane = &mut self.upstream.v_features;
            plane.clear();
            plane.resize(full[0] * full[1] * CHANNELS, 0.0);
            for (p, flags) in sample.flags.iter().enumerate() {
                if flags & LIVE == 0 {
                    continue;
                }
                let q = (crop.y + p / crop.width) * full[0] + crop.x + p % crop.width;
                let out = &mut plane[q * CHANNELS..(q + 1) * CHANNELS];
                out[..3].copy_from_slice(&self.v_render[p * 3..p * 3 + 3]);
                if matches!(derivatives, Derivatives::Curvature(_)) {
                    // (Σ w δ)² ≤ (Σ w)·Σ w δ²
                    out[3] = self.curvature[p] * self.output.features[q * CHANNELS + 3];
                }
            }
            raster.backward_colors_into(
                prepared,
                splats,
                &self.features,
                &params,
                &self.upstream,
                &mut self.grads,
            )?;
            let v_features = &self.grads.v_features;
            self.color_grads.clear();
            self.color_grads.extend(entries.iter().map(|entry| {
                let at = entry.local as usize * CHANNELS;
                [0, 1, 2, 3].map(|channel| v_features[at + channel])
            }));
        }
        lap(3);
        for (secs, k) in self.secs.iter_mut().zip(0..4) {
            *secs += laps[k] - if k == 0 { 0.0 } else { laps[k - 1] };
        }
        Ok(parts)
    }
}

/// The prepared state stored with a sample, else the spare state, prepared for the sample and its
/// live tiles.
fn prepared_or<'a, R: Rasterizer>(
    kept: &'a mut Option<R::Prepared>,
    spare: &'a mut Option<R::Prepared>,
    raster: &R,
    (splats, camera): (&Splats, &Camera),
    live: impl FnOnce() -> TileSet,
) -> Result<&'a mut R::Prepared, CuarError> {
    if let Some(kept) = kept {
        return Ok(kept);
    }
    match spare {
        Some(spare) => {
            raster.prepare_tiles_into(splats, camera, &live(), spare)?;
            Ok(spare)
        }
        none => Ok(none.insert(raster.prepare_tiles(splats, camera, &live())?)),
    }
}

/// `Y(d)·Δ` per entry.
fn change_colors(entries: &[Entry], offsets: Offsets, out: &mut Vec<[f32; 3]>) {
    let coeffs = sh::num_coeffs(offsets.sh_degree);
    entries
        .par_iter()
        .with_min_len(1024)
        .map(|entry| {
            let basis = sh::basis(offsets.sh_degree, entry.towards);
            let d_sh = &offsets.d_sh[entry.row as usize * coeffs..][..coeffs];
            let mut change = [0.0; 3];
            for (value, coefficient) in basis.iter().zip(d_sh) {
                for channel in 0..3 {
                    change[channel] += value * coefficient[channel];
                }
            }
            change
        })
        .collect_into_vec(out);
}
