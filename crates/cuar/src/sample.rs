//! [`Sample`]: one supervised image; [`Builder`] makes them.

use crate::{
    CuarError, Rejection, SupervisionStats, WarpForm,
    descent_image::{Crop, DescentImage, Entry},
    first_frame_visibility,
    flow::render_landing,
    push_forward::push_forward,
    sample_source::{CHANNELS, COLOR_CHANGE, EDITED, KNOWN_SHARE, Source},
    splat_visibility::{edited_tiles, footprints, gather, needed_rows},
    supervision_stats::PixelSource,
    uncertainty::{change, direction, eye, shown_colors, threshold},
    view_sampler::ViewTime,
    warp::{FirstFrame, fetch, trace},
};
use gs_core::{Camera, Rasterizer, RenderOutput, RenderParams, Splats, TileSet, sh};
use rayon::prelude::*;

/// Pixel bit of [`Sample::flags`]: the warp supervises here.
pub(crate) const FORE: u8 = DescentImage::FORE;
/// Pixel bit: the render before refinement supervises here.
pub(crate) const BACK: u8 = DescentImage::BACK;
/// Pixel bit: an edited splat is visible here.
pub(crate) const LIVE: u8 = DescentImage::LIVE;
/// Beyond this margin, pixels, masked images are zero and contribute nothing to SSIM.
const MARGIN: usize = c4d_metrics::SSIM_RADIUS;

/// One supervised image.
pub(crate) struct Sample<P> {
    pub at: ViewTime,
    pub crop: Crop,
    /// Render before refinement, `[h,w,3]` of the crop.
    pub original: Vec<f32>,
    /// Warped frame 1, `[h,w,3]` of the crop; 0 where unknown.
    pub warp: Vec<f32>,
    pub flags: Vec<u8>,
    /// Visible edited splats, ascending by row.
    pub entries: Vec<Entry>,
    /// The splats needed, without colours.
    pub splats: Splats,
    pub prepared: Option<P>,
}

impl<P> Sample<P> {
    /// Size in memory without the prepared state, bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.crop.width * self.crop.height * (6 * 4 + 1)
            + self.entries.len() * size_of::<Entry>()
            + self.splats.len() * 56
    }

    /// Bytes of a prepared state, roughly: per splat (projection, order, colours, lists) and per
    /// pixel (channels, transmittance).
    pub(crate) fn prepared_bytes(&self, camera: &Camera) -> usize {
        self.splats.len() * 400 + camera.width as usize * camera.height as usize * 28
    }

    /// Foreground mask of the crop, 0 or 1, `[h,w]`.
    pub(crate) fn fore(&self) -> Vec<f32> {
        self.flags.iter().map(|&flags| f32::from(flags & FORE)).collect()
    }
}

/// Tiles of the image of `camera` with a [`LIVE`] pixel; `flags` are those of `crop`.
pub(crate) fn live_tiles(crop: Crop, flags: &[u8], camera: &Camera) -> TileSet {
    let mut tiles = TileSet::new(camera.width as usize, camera.height as usize);
    for (row, flags) in flags.chunks_exact(crop.width.max(1)).enumerate() {
        for (column, _) in flags.iter().enumerate().filter(|(_, flags)| **flags & LIVE != 0) {
            let (x, y) = (crop.x + column, crop.y + row);
            tiles.insert([x, y, x + 1, y + 1]);
        }
    }
    tiles
}

/// A sample, with its counts.
pub(crate) struct Made<P> {
    pub sample: Sample<P>,
    pub stats: SupervisionStats,
    /// Whether the floor, not ε·mean(U), is the threshold of the mask.
    pub floored: bool,
    /// Per entry: whether its ξ exceeds the mask's threshold (Eq. 17 for one splat).
    pub uncertain: Vec<bool>,
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

/// What a render contains besides the features.
#[derive(Debug, Clone, Copy)]
enum Planes<'a> {
    /// Colour and depth.
    Surface,
    /// Colour.
    Color,
    /// Nothing, and only these tiles.
    Features(&'a TileSet),
}

impl<P> Builder<P> {
    fn render<R: Rasterizer<Prepared = P>>(
        &mut self,
        source: &Source<R>,
        splats: &Splats,
        camera: &Camera,
        features: &[f32],
        planes: Planes,
    ) -> Result<(), CuarError> {
        let (rgb, depth, tiles) = match planes {
            Planes::Surface => (true, true, None),
            Planes::Color => (true, false, None),
            Planes::Features(tiles) => (false, false, Some(tiles)),
        };
        let background = source.options.background;
        let params = RenderParams { background, rgb, depth, ..RenderParams::default() };
        let raster = source.raster;
        let prepared = match &mut self.prepared {
            Some(prepared) => prepared,
            none => none.insert(raster.unprepared(camera)?),
        };
        match tiles {
            Some(tiles) => raster.prepare_tiles_into(splats, camera, tiles, prepared)?,
            None => raster.prepare_into(splats, camera, prepared)?,
        }
        source.raster.forward_into(prepared, splats, features, &params, &mut self.output)?;
        Ok(())
    }

    /// The render of frame 1 that supervises other times.
    pub(crate) fn first_frame<R: Rasterizer<Prepared = P>>(
        &mut self,
        source: &Source<R>,
        camera: &Camera,
    ) -> Result<FirstFrame, CuarError> {
        let none = vec![0.0; source.first.len()];
        self.render(source, source.first, camera, &none, Planes::Surface)?;
        let params = &source.options.warp_params;
        let min = params.min_coverage;
        let carries = source.options.warp == WarpForm::Backward && params.min_known_color <= 1.0;
        let weights = match &mut self.prepared {
            Some(prepared) if carries => {
                let pixels = self.output.width * self.output.height;
                let drawn = RenderParams {
                    background: source.options.background,
                    depth: true,
                    ..RenderParams::default()
                };
                first_frame_visibility::splat_weights(
                    source.raster,
                    prepared,
                    source.first,
                    &drawn,
                    pixels,
                )?
            }
            _ => Vec::new(),
        };
        let depth = self.output.depth.iter().zip(&self.output.alpha);
        Ok(FirstFrame {
            width: self.output.width,
            height: self.output.height,
            rgb: self.output.rgb.clone(),
            depth: depth
                .map(|(&z, &alpha)| if alpha >= min && alpha > 0.0 { z / alpha } else { f32::NAN })
                .collect(),
            splat_weights: weights,
            colors: shown_colors(source.first, camera),
        })
    }

    /// The sample of `camera` at the time of `splats`; `None` if no edited splat is visible.
    pub(crate) fn sample<R: Rasterizer<Prepared = P> + Sync>(
        &mut self,
        source: &Source<R>,
        at: ViewTime,
        splats: &Splats,
        camera: &Camera,
        frame: &FirstFrame,
    ) -> Result<Option<Made<P>>, CuarError> {
        let options = source.options;
        // The threshold depends on all pixels, everything else only on those that edited splats
        // reach.
        let colors = shown_colors(splats, camera);
        let xi: Vec<f32> = colors
            .par_iter()
            .zip(&frame.colors)
            .with_min_len(1024)
            .map(
                |colors| {
                    if let (Some(now), Some(then)) = colors { change(*now, *then) } else { 0.0 }
                },
            )
            .collect();
        self.render(source, splats, camera, &xi, Planes::Color)?;
        let uncertainty = std::mem::take(&mut self.output.features);
        let rgb = std::mem::take(&mut self.output.rgb);
        let footprints = footprints(source.raster, splats, camera);
        let tiles = edited_tiles(&footprints, source.edited, camera);
        let features = source.features(splats, camera, frame, &colors, |i| {
            footprints[i].is_some_and(|footprint| tiles.overlaps(footprint.pixels))
        });
        self.render(source, splats, camera, &features, Planes::Features(&tiles))?;
        self.output.rgb = rgb;
        let (w, h) = (self.output.width, self.output.height);
        let threshold = threshold(&uncertainty, options.epsilon, options.min_uncertainty);
        let mask: Vec<bool> = uncertainty.iter().map(|&u| f64::from(u) > threshold).collect();
        let pixels = self.output.features.chunks_exact(CHANNELS);
        let live: Vec<bool> = pixels.map(|sums| sums[EDITED] > 0.0).collect();
        let Some(crop) = bounding(&live, w, h) else { return Ok(None) };

        let selected: Vec<bool> =
            mask.iter().zip(&live).map(|(mask, live)| *mask && *live).collect();
        let (warp, pixel_sources) = self.warp(source, splats, camera, frame, &selected)?;
        let mut stats = SupervisionStats::default();
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
                let fore = selected[p] && !matches!(pixel_sources[p], PixelSource::Rejected(_));
                let back = live[p] && !mask[p];
                let rgb: &[f32] = if fore { &warp[p * 3..p * 3 + 3] } else { &[0.0; 3] };
                sample.warp.extend_from_slice(rgb);
                let bit = |on: bool, bit: u8| if on { bit } else { 0 };
                sample.flags.push(bit(fore, FORE) | bit(back, BACK) | bit(live[p], LIVE));
                stats.live += u64::from(live[p]);
                if selected[p] {
                    stats.count(pixel_sources[p]);
                }
            }
        }
        let rows = needed_rows(&footprints, source.edited, &TileSet::around(&live, w, h));
        // a splat with a non-finite colour is not drawn in the full scene either
        let drawn = |&row: &u32| splats.is_finite(row as usize);
        let rows: Vec<u32> = rows.into_iter().filter(drawn).collect();
        sample.splats = gather(splats, &rows);
        let eye = eye(camera);
        let by_surface = stats.surface >= stats.splat_colors;
        let mut uncertain = Vec::new();
        for (local, &id) in (0_u32..).zip(&rows) {
            let row = source.row_of[id as usize];
            let Some(towards) = direction(eye, splats.means[id as usize]) else { continue };
            if row != u32::MAX {
                let color = sh::color(splats.sh_degree, splats.sh_of(id as usize), towards);
                let is_constrained =
                    by_surface || features[id as usize * CHANNELS + KNOWN_SHARE] >= 0.5;
                sample.entries.push(Entry { local, row, towards, color, is_constrained });
                uncertain.push(f64::from(xi[id as usize]) > threshold);
            }
        }
        let floored = threshold <= f64::from(options.min_uncertainty);
        Ok(Some(Made { sample, stats, floored, uncertain }))
    }

    /// Frame 1 warped to this frame, `[H,W,3]`, and the source of each pixel, `[H,W]`; only for the
    /// pixels in `selected`.
    fn warp<R: Rasterizer<Prepared = P>>(
        &self,
        source: &Source<R>,
        splats: &Splats,
        camera: &Camera,
        frame: &FirstFrame,
        selected: &[bool],
    ) -> Result<(Vec<f32>, Vec<PixelSource>), CuarError> {
        let (w, h) = (self.output.width, self.output.height);
        if source.options.warp == WarpForm::Paper {
            let (landing, coverage) = render_landing(source.raster, source.first, splats, camera)?;
            let params = &source.options.warp_params;
            let (rgb, known) = push_forward(frame, (&landing, &coverage), params);
            let nothing = PixelSource::Rejected(Rejection::NothingLanded);
            let pixel_source =
                |&known: &f32| if known > 0.0 { PixelSource::Surface } else { nothing };
            return Ok((rgb, known.iter().map(pixel_source).collect()));
        }
        let params = &source.options.warp_params;
        let output = &self.output;
        let mut rgb = vec![0.0; w * h * 3];
        let mut pixel_sources = vec![PixelSource::Rejected(Rejection::Uncovered); w * h];
        rgb.par_chunks_mut(w * 3).zip(pixel_sources.par_chunks_mut(w)).enumerate().for_each(
            |(y, (rgb, pixel_sources))| {
                for x in (0..w).filter(|x| selected[y * w + x]) {
                    let p = y * w + x;
                    let sums = &output.features[p * CHANNELS..(p + 1) * CHANNELS];
                    let (alpha, now) = (output.alpha[p], &output.rgb[p * 3..p * 3 + 3]);
                    let found = trace(sums, alpha, (x, y), params)
                        .and_then(|trace| fetch(frame, trace, now, params));
                    let out = &mut rgb[x * 3..x * 3 + 3];
                    pixel_sources[x] = match found {
                        Ok(color) => {
                            out.copy_from_slice(&color);
                            PixelSource::Surface
                        }
                        Err(_)
                            if sums[KNOWN_SHARE] >= params.min_known_color * alpha
                                && alpha > 0.0 =>
                        {
                            for channel in 0..3 {
                                out[channel] = now[channel] + sums[COLOR_CHANGE + channel];
                            }
                            PixelSource::SplatColors
                        }
                        Err(rejection) => PixelSource::Rejected(rejection),
                    };
                }
            },
        );
        Ok((rgb, pixel_sources))
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
