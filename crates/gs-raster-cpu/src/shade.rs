//! [`Shade`]: what a forward pass draws each visible splat with. The only stage that reads SH, opacities and features.

use crate::lanes::wide;
use crate::prepared::CULLED;
use crate::project::Projected;
use crate::view::View;
use gs_core::{Real, RenderParams, Splats, UpstreamGrads, sh};
use rayon::prelude::*;

/// Splats shaded by one task.
const CHUNK: usize = 256;

/// The order of channels: RGB, depth, the caller's features, zero padding.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Layout {
    pub rgb: bool,
    pub depth: bool,
    pub features: usize,
}

impl Layout {
    pub(crate) fn new(params: &RenderParams, num_splats: usize, features: usize) -> Self {
        let features = features.checked_div(num_splats).unwrap_or(0);
        Self { rgb: params.rgb, depth: params.depth, features }
    }

    /// Channel of depth.
    pub(crate) fn depth_at(self) -> usize {
        if self.rgb { 3 } else { 0 }
    }

    /// First of the caller's channels.
    pub(crate) fn features_at(self) -> usize {
        self.depth_at() + usize::from(self.depth)
    }

    /// Channels up to the last one with an upstream gradient.
    pub(crate) fn used<F>(self, upstream: &UpstreamGrads<F>) -> usize {
        if !upstream.v_features.is_empty() {
            self.channels()
        } else if !upstream.v_depth.is_empty() {
            self.features_at()
        } else if !upstream.v_rgb.is_empty() {
            self.depth_at()
        } else {
            0
        }
    }

    /// Channels without padding.
    pub(crate) fn channels(self) -> usize {
        self.features_at() + self.features
    }
}

/// Values of a record before its channels.
pub(crate) const HEAD: usize = 6;

/// Everything the pixel stage reads of every visible splat, by rank.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shade<F> {
    pub layout: Layout,
    /// Channels per splat, padding included.
    pub stride: usize,
    /// `[V, HEAD + stride]`: centre, coefficients of `dx²`, `dx dy`, `dy²` and constant of `log2 α` (−∞ for a splat that draws nothing),
    /// channels. One record per splat, so that a tile touches as few cache lines as possible.
    pub records: Vec<F>,
    /// By splat: colour before the clamp, then opacity, 0 for a splat that is left out. SH is read in the order it is stored, which is
    /// several times faster than in depth order.
    shaded: Vec<[F; 4]>,
    /// By splat; bits 0 to 2: the colour channel was negative before the clamp.
    pub flags: Vec<u8>,
}

/// Marks, among the bits of [`Shade::flags`], a splat that is culled, or left out because its colour, opacity or a feature is not finite.
pub(crate) const DEAD: u8 = 128;

impl<F: Real> Shade<F> {
    /// Evaluates opacities, colours and features. Returns whether every opacity is still covered by the one its lists were made with.
    pub(crate) fn fill(
        &mut self,
        (visible, rank_of): (&[Projected<F>], &[u32]),
        view: &View<F>,
        splats: &Splats<F>,
        features: &[F],
        layout: Layout,
        stride: usize,
    ) -> bool {
        self.layout = layout;
        self.stride = stride;
        self.fill_shaded(rank_of, view, splats, features);
        let (length, shaded) = (HEAD + stride, &self.shaded);
        self.records.resize(visible.len() * length, F::zero());
        self.records
            .par_chunks_mut(CHUNK * length)
            .zip(visible.par_chunks(CHUNK))
            .map(|(records, visible)| {
                wide(
                    #[inline(always)]
                    || {
                        let mut covered = true;
                        // Fetched in one go: their cache misses overlap.
                        let mut fetched = [[F::zero(); 4]; CHUNK];
                        for (target, p) in fetched.iter_mut().zip(visible) {
                            *target = shaded[p.id as usize];
                        }
                        let rows = records.chunks_exact_mut(length).zip(visible);
                        for ((record, p), [r, g, b, opacity]) in rows.zip(fetched) {
                            let id = p.id as usize;
                            covered &= opacity <= p.opacity;
                            record.fill(F::zero());
                            record[..HEAD].copy_from_slice(&exponent(p, opacity));
                            if opacity == F::zero() {
                                continue;
                            }
                            let channels = &mut record[HEAD..];
                            if layout.rgb {
                                channels[..3].copy_from_slice(&[r, g, b].map(|x| x.max(F::zero())));
                            }
                            if layout.depth {
                                channels[layout.depth_at()] = p.depth;
                            }
                            channels[layout.features_at()..layout.channels()].copy_from_slice(
                                &features[id * layout.features..(id + 1) * layout.features],
                            );
                        }
                        covered
                    },
                )
            })
            .reduce(|| true, |a, b| a && b)
    }

    /// Evaluates colours and opacities in the order of the splats.
    fn fill_shaded(&mut self, rank_of: &[u32], view: &View<F>, splats: &Splats<F>, features: &[F]) {
        let layout = self.layout;
        self.shaded.resize(rank_of.len(), [F::zero(); 4]);
        self.flags.resize(rank_of.len(), DEAD);
        let chunks = self.shaded.par_chunks_mut(CHUNK).zip(self.flags.par_chunks_mut(CHUNK));
        chunks.enumerate().for_each(|(chunk, (shaded, flags))| {
            wide(
                #[inline(always)]
                || {
                    for (i, (shaded, flags)) in shaded.iter_mut().zip(flags).enumerate() {
                        let id = chunk * CHUNK + i;
                        (*shaded, *flags) = if rank_of[id] == CULLED {
                            ([F::zero(); 4], DEAD)
                        } else {
                            shade(view, splats, features, layout, id)
                        };
                    }
                },
            );
        });
    }
}

/// Centre and the coefficients of `log2 α`: base 2 is the base of the vector exponential.
#[inline(always)]
fn exponent<F: Real>(p: &Projected<F>, opacity: F) -> [F; HEAD] {
    let log2_e = F::from_double(std::f64::consts::LOG2_E);
    let half = -F::of(0.5) * log2_e;
    let [a, b, c] = p.conic;
    [p.mean[0], p.mean[1], half * a, -log2_e * b, half * c, opacity.log2()]
}

/// Colour, opacity and flags of one splat.
#[inline(always)]
fn shade<F: Real>(
    view: &View<F>,
    splats: &Splats<F>,
    features: &[F],
    layout: Layout,
    id: usize,
) -> ([F; 4], u8) {
    let finite = |x: &F| x.as_f32().is_finite();
    let opacity = splats.opacity(id);
    let own = &features[id * layout.features..(id + 1) * layout.features];
    let mut alive = finite(&opacity) && own.iter().all(finite);
    let (mut rgb, mut flags) = ([F::zero(); 3], 0);
    if layout.rgb {
        let (direction, _) = view.direction(splats.means[id]);
        rgb = sh::color(splats.sh_degree, splats.sh_of(id), direction);
        for c in 0..3 {
            // Before the clamp: −∞ would become a colour.
            alive &= finite(&rgb[c]);
            flags |= u8::from(rgb[c] < F::zero()) << c;
        }
    }
    if alive { ([rgb[0], rgb[1], rgb[2], opacity], flags) } else { ([F::zero(); 4], DEAD) }
}
