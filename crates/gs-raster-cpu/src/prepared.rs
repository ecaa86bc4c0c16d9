//! [`Prepared`]: geometry projected for one camera, and the memory of every later stage.

use crate::bins::{self, Block, MACRO, MACRO_TILES, MacroTile};
use crate::lanes::{self, Lane};
use crate::project::{CULLED, Projected, project};
use crate::shade::{DEAD, Shade};
use crate::times::{StageTimes, timed};
use crate::view::{TILE, TILE_PIXELS, View};
use gs_core::{Camera, RasterError, Real, Splats, TileSet, check_tiles};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Splats projected per task.
const CHUNK: usize = 1024;

/// Geometry projected for one camera, ready to composite: projected splats in
/// depth order and the list of every 16×16 tile.
///
/// Reusable while means, quaternions, log-scales and camera are unchanged. The lists omit tiles in
/// which a splat's alpha is below 1/255 at its current opacity. If a later forward pass has a
/// larger opacity, the lists are rebuilt from the existing projection (without projecting or
/// sorting), so the image always equals that of a new [`Prepared`].
#[derive(Debug, Clone, Default)]
pub struct Prepared<F> {
    pub(crate) view: View<F>,
    /// The tiles that have lists; `None` for all.
    tiles: Option<TileSet>,
    pub(crate) num_splats: usize,
    pub(crate) sh_degree: usize,
    /// Indexed by splat; rows of culled splats are stale.
    projected: Vec<Projected<F>>,
    chunk_keys: Vec<Vec<u64>>,
    /// Depth bits, then index: keys are unique, so an unstable sort suffices.
    keys: Vec<u64>,
    /// In depth order; the position is the splat's rank.
    pub(crate) visible: Vec<Projected<F>>,
    /// Rank of every splat, or [`CULLED`].
    pub(crate) rank_of: Vec<u32>,
    pub(crate) blocks: Vec<Block>,
    pub(crate) macros: Vec<MacroTile>,
    pub(crate) shade: Shade<F>,
    pub(crate) composited: Vec<Composited<F>>,
    /// Whether `shade` and `composited` hold a forward pass of this geometry.
    pub(crate) has_forward: bool,
    /// Gradients of projected quantities, by rank.
    pub(crate) sums: Vec<F>,
    pub(crate) times: StageTimes,
}

/// Results of compositing one macro tile, tile by tile; `sums` is written by the backward pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Composited<F> {
    /// Records of the macro tile's items, side by side; its tiles share most of them.
    pub records: Vec<F>,
    /// `[tiles, channels, 256]`.
    pub planes: Vec<F>,
    /// `[tiles, 256]`, negative where the pixel stopped.
    pub transmittance: Vec<F>,
    /// `[tiles, 256]`, list index at which the pixel stopped.
    pub stops: Vec<u32>,
    /// `[items, moments and channels]`.
    pub sums: Vec<F>,
    /// Evaluated samples.
    pub evaluated: u64,
}

impl<F: Real> Composited<F> {
    pub(crate) fn resize(&mut self, channels: usize) {
        self.planes.resize(MACRO_TILES * channels * TILE_PIXELS, F::zero());
        self.transmittance.resize(MACRO_TILES * TILE_PIXELS, F::zero());
        self.stops.resize(MACRO_TILES * TILE_PIXELS, 0);
    }
}

/// Projection of consecutive splats.
struct ProjectChunk<'a, F> {
    view: &'a View<F>,
    splats: &'a Splats<F>,
    first: usize,
    rows: &'a mut [Projected<F>],
    keys: &'a mut Vec<u64>,
}

impl<F: Lane> WithSimd for ProjectChunk<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let Self { view, splats, first, rows, keys } = self;
        project(s, view, splats, first, rows, |id, depth| {
            keys.push(u64::from(depth.as_f32().to_bits()) << 32 | id as u64);
        });
    }
}

impl<F: Lane> Prepared<F> {
    /// Projects, sorts and bins; with `tiles`, other tiles get empty lists.
    pub(crate) fn update(
        &mut self,
        splats: &Splats<F>,
        camera: &Camera,
        tiles: Option<&TileSet>,
    ) -> Result<(), RasterError> {
        camera.check()?;
        splats.check_shapes()?;
        if let Some(tiles) = tiles {
            check_tiles(tiles, camera)?;
        }
        let num_splats = splats.len();
        if num_splats >= CULLED as usize {
            return Err(RasterError::Device(format!(
                "{num_splats} splats, expected fewer than {CULLED}"
            )));
        }
        self.view = View::new(camera);
        self.tiles = tiles.cloned();
        self.num_splats = num_splats;
        self.sh_degree = splats.sh_degree;
        self.has_forward = false;

        let mut times = self.times;
        timed(&mut times.project, || self.project(splats));
        timed(&mut times.sort, || self.sort());
        self.times = times;
        self.bin();
        Ok(())
    }

    #[expect(clippy::cast_possible_truncation, reason = "the number of splats was checked")]
    fn project(&mut self, splats: &Splats<F>) {
        let num_splats = self.num_splats;
        let (view, tiles, arch) = (&self.view, self.tiles.as_ref(), lanes::arch());
        self.projected.resize(num_splats, Projected::default());
        self.chunk_keys.resize_with(num_splats.div_ceil(CHUNK), Vec::new);
        self.projected.par_chunks_mut(CHUNK).zip(&mut self.chunk_keys).enumerate().for_each(
            |(chunk, (rows, keys))| {
                keys.clear();
                let first = chunk * CHUNK;
                arch.dispatch(ProjectChunk { view, splats, first, rows: &mut *rows, keys });
                if let Some(tiles) = tiles {
                    keys.retain(|&key| {
                        let rect = rows[key as u32 as usize - first].rect;
                        tiles.overlaps(rect.map(|tile| usize::from(tile) * TILE))
                    });
                }
            },
        );
    }

    /// By depth, ties by index.
    #[expect(clippy::cast_possible_truncation, reason = "the number of splats was checked")]
    fn sort(&mut self) {
        self.keys.clear();
        for keys in &self.chunk_keys {
            self.keys.extend_from_slice(keys);
        }
        self.keys.par_sort_unstable();

        let projected = &self.projected;
        self.visible.resize(self.keys.len(), Projected::default());
        self.visible
            .par_iter_mut()
            .zip(&self.keys)
            .with_min_len(CHUNK)
            .for_each(|(row, &key)| *row = projected[key as u32 as usize]);
        self.rank_of.clear();
        self.rank_of.resize(self.num_splats, CULLED);
        for (rank, &key) in self.keys.iter().enumerate() {
            self.rank_of[key as u32 as usize] = rank as u32;
        }
    }

    /// Builds the lists for the opacities in `visible`.
    pub(crate) fn bin(&mut self) {
        let Self { visible, view, tiles, blocks, macros, times, .. } = self;
        timed(&mut times.bin, || bins::bin(visible, view, tiles.as_ref(), blocks, macros));
    }
}

impl<F: Real> Prepared<F> {
    /// Frees everything except the projection and the lists, for caches of many prepared views. The
    /// next forward pass allocates again; a backward pass needs a forward pass first.
    pub fn trim(&mut self) {
        self.projected = Vec::new();
        self.chunk_keys = Vec::new();
        self.keys = Vec::new();
        self.shade = Shade::default();
        self.composited = Vec::new();
        self.sums = Vec::new();
        self.has_forward = false;
    }

    /// Times of the stages of the last calls with this state.
    pub fn stage_times(&self) -> StageTimes {
        self.times
    }

    /// Image size `[W, H]`, pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.view.width, self.view.height]
    }

    /// Number of splats passed to `prepare`.
    pub fn num_splats(&self) -> usize {
        self.num_splats
    }

    /// Number of splats that were not culled.
    pub fn num_visible(&self) -> usize {
        self.visible.len()
    }

    /// Splat–tile pairs in the lists.
    pub fn num_isects(&self) -> usize {
        self.macros.iter().flat_map(|m| &m.lists).map(|list| list.items.len()).sum()
    }

    /// Splat–tile pairs of the 3σ rectangles alone, as the reference counts them.
    pub fn num_rect_isects(&self) -> usize {
        (0..self.num_splats)
            .filter_map(|id| self.tile_rect(id))
            .map(|[x0, y0, x1, y1]| usize::from(x1 - x0) * usize::from(y1 - y0))
            .sum()
    }

    /// Pixel–splat samples that the last forward pass evaluated.
    pub fn num_evaluated(&self) -> u64 {
        self.composited.iter().map(|tile| tile.evaluated).sum()
    }

    /// 3σ radius of a splat in pixels; 0 if it is culled, or was excluded from the last forward
    /// pass because its colour, opacity or a feature was not finite.
    ///
    /// # Panics
    /// If `id` is out of range.
    pub fn radius(&self, id: usize) -> u32 {
        self.drawn(id).map_or(0, |p| p.radius)
    }

    /// Rectangle of 16-pixel tiles `x0, y0, x1, y1` (upper bounds exclusive) to which a splat is
    /// clipped; `None` where [`Prepared::radius`] is 0.
    ///
    /// # Panics
    /// If `id` is out of range.
    pub fn tile_rect(&self, id: usize) -> Option<[u16; 4]> {
        self.drawn(id).map(|p| p.rect)
    }

    fn drawn(&self, id: usize) -> Option<&Projected<F>> {
        let rank = self.rank_of[id];
        let dead = || self.has_forward && self.shade.flags[id] & DEAD != 0;
        (rank != CULLED && !dead()).then(|| &self.visible[rank as usize])
    }

    /// First pixel of tile `tile` of macro tile `macro_id`; `None` if it lies outside the image.
    pub(crate) fn tile_origin(view: &View<F>, macro_id: usize, tile: usize) -> Option<[usize; 2]> {
        let grid = bins::macro_grid(view.tiles);
        let tx = macro_id % grid[0] * MACRO + tile % MACRO;
        let ty = macro_id / grid[0] * MACRO + tile / MACRO;
        (tx < view.tiles[0] && ty < view.tiles[1]).then_some([tx * TILE, ty * TILE])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CpuRasterizer;
    use gs_core::{Rasterizer, RenderGrads, RenderOutput, RenderParams, UpstreamGrads};

    /// The exact culling removes entries of the rectangle lists, and image and gradients stay
    /// bit-identical.
    #[test]
    fn culling_does_not_change_the_image() {
        let phase = |i: usize, k: usize| ((i * 37 + k * 101) % 89) as f32 / 44.0 - 1.0;
        let count = 400;
        let splats = Splats::<f32> {
            means: (0..count).map(|i| [0, 1, 2].map(|k| phase(i, k))).collect(),
            quats: (0..count).map(|i| [3, 4, 5, 6].map(|k| phase(i, k))).collect(),
            log_scales: (0..count).map(|i| [7, 8, 9].map(|k| phase(i, k) - 2.5)).collect(),
            opacity_logits: (0..count).map(|i| 3.0 * phase(i, 10)).collect(),
            sh: (0..count).map(|i| [11, 12, 13].map(|k| phase(i, k))).collect(),
            sh_degree: 0,
        };
        let camera = Camera::look_at([0.0, 0.0, -4.0], [0.0; 3], [0.0, -1.0, 0.0], 0.8, 130, 90);
        let (raster, params) = (CpuRasterizer::default(), RenderParams::default());
        let upstream = UpstreamGrads {
            v_rgb: (0..3 * 130 * 90).map(|i| phase(i, 14)).collect(),
            ..UpstreamGrads::default()
        };
        let run = |prepared: &mut Prepared<f32>| -> (RenderOutput, RenderGrads, RenderGrads) {
            let out = raster.forward(prepared, &splats, &[], &params).unwrap();
            let grads = raster.backward(prepared, &splats, &[], &params, &upstream).unwrap();
            let colors =
                raster.backward_colors(prepared, &splats, &[], &params, &upstream).unwrap();
            (out, grads, colors)
        };
        let mut culled = raster.prepare(&splats, &camera).unwrap();
        let mut listed = culled.clone();
        // With this opacity every ellipse contains its rectangle.
        for p in &mut listed.visible {
            (p.opacity, p.log_opacity) = (f32::INFINITY, 1e6);
        }
        listed.bin();
        assert_eq!(listed.num_isects(), listed.num_rect_isects(), "the whole rectangles");
        assert!(culled.num_isects() < culled.num_rect_isects(), "the ellipse culls");
        assert!(run(&mut culled) == run(&mut listed), "image and gradients");
        assert_eq!(listed.num_isects(), listed.num_rect_isects(), "still the whole rectangles");
    }
}
