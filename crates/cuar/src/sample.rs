//! One supervised image, and how it is made ([`Builder`]).

use crate::{
    CuarError, RefineOptions, WarpForm,
    compact::{gather, needed_rows},
    engine::DescentImage,
    flow::{affine_motion, render_flow},
    plan::ViewTime,
    uncertainty::{direction, eye, threshold, xi},
    warp::{FirstFrame, WARP_CHANNELS, fetch, push_forward, trace},
};
use gs_core::{Camera, Rasterizer, RenderOutput, RenderParams, Splats, sh};
use rayon::prelude::*;

/// Pixel bits of [`Sample::flags`]: the warp supervises here.
pub(crate) const FORE: u8 = DescentImage::FORE;
/// The render before supervises here.
pub(crate) const BACK: u8 = DescentImage::BACK;
/// An edited splat shows here.
pub(crate) const LIVE: u8 = DescentImage::LIVE;
/// Half a window of SSIM: beyond this margin masked images are zero and contribute nothing.
const MARGIN: usize = 5;

/// Rectangle of the image, pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// An edited splat in an image.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Row among the image's splats.
    pub local: u32,
    /// Row among the edited splats.
    pub row: u32,
    /// Unit vector from the camera, world frame.
    pub towards: [f32; 3],
    /// Colour before refinement, not clamped.
    pub color: [f32; 3],
}

/// One supervised image.
pub(crate) struct Sample<P> {
    pub at: ViewTime,
    pub crop: Crop,
    /// Render before refinement, `[h,w,3]` of the crop.
    pub original: Vec<f32>,
    /// Warped frame 1, `[h,w,3]` of the crop; 0 where unknown.
    pub warp: Vec<f32>,
    pub flags: Vec<u8>,
    /// Ascending by row.
    pub entries: Vec<Entry>,
    /// The splats needed, colours absent unless opacity is refined.
    pub splats: Splats,
    pub prepared: Option<P>,
}

impl<P> Sample<P> {
    /// Bytes held, without the prepared state.
    pub(crate) fn bytes(&self) -> usize {
        self.crop.width * self.crop.height * (6 * 4 + 1)
            + self.entries.len() * size_of::<Entry>()
            + self.splats.len() * 44
            + self.splats.sh.len() * 12
    }

    /// Bytes of a prepared state, roughly: per splat (projection, order, colours, lists) and per pixel (channels, transmittance).
    pub(crate) fn prepared_bytes(&self, camera: &Camera) -> usize {
        self.splats.len() * 400 + camera.width as usize * camera.height as usize * 28
    }

    /// Foreground mask of the crop, 0 or 1, `[h,w]`.
    pub(crate) fn fore(&self) -> Vec<f32> {
        self.flags.iter().map(|&flags| f32::from(flags & FORE)).collect()
    }
}

/// Shares over pixels, for the report.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Counts {
    pub pixels: u64,
    /// M.
    pub masked: u64,
    /// M where the warp is known.
    pub known: u64,
}

/// A sample, and what it tells about the whole.
pub(crate) struct Made<P> {
    pub sample: Sample<P>,
    pub counts: Counts,
    /// Per entry: whether its ξ exceeds the mask's threshold (Eq. 17 for one splat).
    pub doubtful: Vec<bool>,
}

/// What samples are made from.
pub(crate) struct Source<'a, R> {
    pub raster: &'a R,
    pub options: &'a RefineOptions,
    pub edited: &'a [bool],
    /// Row among the edited splats, or `u32::MAX`.
    pub row_of: &'a [u32],
    pub first: &'a Splats,
}

/// Makes samples one at a time; owns the memory of full-scene passes.
pub(crate) struct Builder<P> {
    prepared: Option<P>,
    output: RenderOutput,
}

impl<P> Default for Builder<P> {
    fn default() -> Self {
        Self { prepared: None, output: RenderOutput::default() }
    }
}

/// Channels composited to make a sample: those of the warp, ξ, and which splats are edited.
const CHANNELS: usize = WARP_CHANNELS + 2;

impl<P> Builder<P> {
    fn render<R: Rasterizer<Prepared = P>>(
        &mut self,
        source: &Source<R>,
        splats: &Splats,
        camera: &Camera,
        features: &[f32],
        depth: bool,
    ) -> Result<(), CuarError> {
        let background = source.options.background;
        let params = RenderParams { background, depth, ..RenderParams::default() };
        let prepared = match &mut self.prepared {
            Some(prepared) => {
                source.raster.prepare_into(splats, camera, prepared)?;
                prepared
            }
            none => none.insert(source.raster.prepare(splats, camera)?),
        };
        source.raster.forward_into(prepared, splats, features, &params, &mut self.output)?;
        Ok(())
    }

    /// The trusted render of frame 1.
    pub(crate) fn first_frame<R: Rasterizer<Prepared = P>>(
        &mut self,
        source: &Source<R>,
        camera: &Camera,
    ) -> Result<FirstFrame, CuarError> {
        self.render(source, source.first, camera, &[], true)?;
        let min = source.options.warp_params.min_coverage;
        let depth = self.output.depth.iter().zip(&self.output.alpha);
        Ok(FirstFrame {
            width: self.output.width,
            height: self.output.height,
            rgb: self.output.rgb.clone(),
            depth: depth
                .map(|(&z, &alpha)| if alpha >= min && alpha > 0.0 { z / alpha } else { f32::NAN })
                .collect(),
        })
    }

    /// The sample of `camera` at the time of `splats`; `None` where no edited splat shows.
    pub(crate) fn sample<R: Rasterizer<Prepared = P>>(
        &mut self,
        source: &Source<R>,
        at: ViewTime,
        splats: &Splats,
        camera: &Camera,
        frame: &FirstFrame,
    ) -> Result<Option<Made<P>>, CuarError> {
        let options = source.options;
        let features = source.features(splats, camera);
        self.render(source, splats, camera, &features, false)?;
        let (w, h) = (self.output.width, self.output.height);
        let channel = |k: usize| -> Vec<f32> {
            self.output.features.iter().skip(k).step_by(CHANNELS).copied().collect()
        };
        let uncertainty = channel(WARP_CHANNELS);
        let threshold = threshold(&uncertainty, options.epsilon, options.min_uncertainty);
        let mask: Vec<bool> = uncertainty.iter().map(|&u| f64::from(u) > threshold).collect();
        let live: Vec<bool> = channel(WARP_CHANNELS + 1).iter().map(|&e| e > 0.0).collect();
        let Some(crop) = bounding(&live, w, h) else { return Ok(None) };

        let (warp, known) = self.warp(source, splats, camera, frame)?;
        let mut counts = Counts::default();
        let mut sample = Sample {
            at,
            crop,
            original: Vec::with_capacity(crop.width * crop.height * 3),
            warp: Vec::with_capacity(crop.width * crop.height * 3),
            flags: Vec::with_capacity(crop.width * crop.height),
            entries: Vec::new(),
            splats: Splats::default(),
            prepared: None,
        };
        for y in crop.y..crop.y + crop.height {
            for p in y * w + crop.x..y * w + crop.x + crop.width {
                sample.original.extend_from_slice(&self.output.rgb[p * 3..p * 3 + 3]);
                let fore = live[p] && mask[p] && known[p] > 0.0;
                let back = live[p] && !mask[p];
                let rgb: &[f32] = if fore { &warp[p * 3..p * 3 + 3] } else { &[0.0; 3] };
                sample.warp.extend_from_slice(rgb);
                let bit = |on: bool, bit: u8| if on { bit } else { 0 };
                sample.flags.push(bit(fore, FORE) | bit(back, BACK) | bit(live[p], LIVE));
                counts.pixels += u64::from(live[p]);
                counts.masked += u64::from(live[p] && mask[p]);
                counts.known += u64::from(fore);
            }
        }
        let rows = needed_rows(splats, source.edited, camera, &live, options.opacity);
        // a splat whose colour is broken draws nothing in the full scene either
        let drawn = |&row: &u32| splats.is_finite(row as usize);
        let rows: Vec<u32> = rows.into_iter().filter(drawn).collect();
        sample.splats = gather(splats, &rows, options.opacity);
        let eye = eye(camera);
        let mut doubtful = Vec::new();
        for (local, &id) in (0_u32..).zip(&rows) {
            let row = source.row_of[id as usize];
            let Some(towards) = direction(eye, splats.means[id as usize]) else { continue };
            if row != u32::MAX {
                let color = sh::color(splats.sh_degree, splats.sh_of(id as usize), towards);
                sample.entries.push(Entry { local, row, towards, color });
                let xi = features[id as usize * CHANNELS + WARP_CHANNELS];
                doubtful.push(f64::from(xi) > threshold);
            }
        }
        Ok(Some(Made { sample, counts, doubtful }))
    }

    /// Frame 1 at this frame's pixels, `[H,W,3]`, and where it is known, `[H,W]`.
    fn warp<R: Rasterizer<Prepared = P>>(
        &self,
        source: &Source<R>,
        splats: &Splats,
        camera: &Camera,
        frame: &FirstFrame,
    ) -> Result<(Vec<f32>, Vec<f32>), CuarError> {
        let (w, h) = (self.output.width, self.output.height);
        if source.options.warp == WarpForm::Paper {
            let flow = render_flow(source.raster, source.first, source.first, splats, camera)?;
            return Ok(push_forward(frame, &flow.flow));
        }
        let params = &source.options.warp_params;
        let output = &self.output;
        let mut rgb = vec![0.0; w * h * 3];
        let mut known = vec![0.0; w * h];
        rgb.par_chunks_mut(w * 3).zip(known.par_chunks_mut(w)).enumerate().for_each(
            |(y, (rgb, known))| {
                for x in 0..w {
                    let p = y * w + x;
                    let sums = &output.features[p * CHANNELS..];
                    let found = trace(sums, output.alpha[p], (x, y), params).and_then(|trace| {
                        fetch(frame, trace, &output.rgb[p * 3..p * 3 + 3], params)
                    });
                    if let Some(color) = found {
                        rgb[x * 3..x * 3 + 3].copy_from_slice(&color);
                        known[x] = 1.0;
                    }
                }
            },
        );
        Ok((rgb, known))
    }
}

impl<R> Source<'_, R> {
    fn features(&self, splats: &Splats, camera: &Camera) -> Vec<f32> {
        let eye = eye(camera);
        let mut features = vec![0.0_f32; splats.len() * CHANNELS];
        features.par_chunks_mut(CHANNELS).with_min_len(1024).enumerate().for_each(|(i, out)| {
            if let Some(back) = affine_motion(camera, splats, self.first, i) {
                out[..2].copy_from_slice(&back.shift);
                out[2..6].copy_from_slice(&back.linear);
                out[6..9].copy_from_slice(&back.place);
                out[9] = back.place.iter().map(|x| x * x).sum();
            }
            out[WARP_CHANNELS] = xi(splats, self.first, i, eye);
            out[WARP_CHANNELS + 1] = f32::from(u8::from(self.edited[i]));
            if !out.iter().all(|value| value.is_finite()) {
                out.fill(0.0);
            }
        });
        features
    }
}

/// The rectangle around `live`, with [`MARGIN`].
fn bounding(live: &[bool], w: usize, h: usize) -> Option<Crop> {
    let (mut x0, mut x1, mut y0, mut y1) = (w, 0, h, 0);
    for (p, _) in live.iter().enumerate().filter(|(_, live)| **live) {
        let (x, y) = (p % w, p / w);
        (x0, x1, y0, y1) = (x0.min(x), x1.max(x + 1), y0.min(y), y1.max(y + 1));
    }
    if x0 >= x1 {
        return None;
    }
    let (x, y) = (x0.saturating_sub(MARGIN), y0.saturating_sub(MARGIN));
    Some(Crop { x, y, width: (x1 + MARGIN).min(w) - x, height: (y1 + MARGIN).min(h) - y })
}
