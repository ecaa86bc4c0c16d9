//! [`Shade`]: colours, opacities and features of the visible splats for a forward pass. The only
//! stage that reads SH, opacities and features.

use crate::harmonics::{Harmonics, touch};
use crate::lanes::{self, Lane, wide};
use crate::project::CULLED;
use crate::project::Projected;
use crate::vector::{GROUP, Quad, registers};
use crate::view::View;
use gs_core::{Real, RenderParams, Ring, Splats, UpstreamGrads};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Splats shaded per task.
const CHUNK: usize = 256;

/// The order of channels: RGB, depth, the caller's features, zero padding.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct ChannelLayout {
    pub rgb: bool,
    pub depth: bool,
    pub features: usize,
}

impl ChannelLayout {
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

/// All values that the pixel stage reads of the visible splats, by rank.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shade<F> {
    pub layout: ChannelLayout,
    /// Channels per splat, padding included.
    pub stride: usize,
    /// `[V, HEAD + stride]`: centre, coefficients of `dx²`, `dx dy`, `dy²` and constant of `log2 α`
    /// (−∞ for a splat that draws nothing), channels. One record per splat, so that a tile reads as
    /// few cache lines as possible.
    pub records: Vec<F>,
    /// By splat: colour before the clamp, then opacity, 0 for an excluded splat. SH is read in
    /// storage order, which is several times faster than in depth order.
    shaded: Vec<[F; 4]>,
    /// By splat; bits 0 to 2: the colour channel was negative before the clamp.
    pub flags: Vec<u8>,
}

/// Bit of [`Shade::flags`] for a splat that is culled, or excluded because
/// its colour, opacity or a feature is not finite.
pub(crate) const DEAD: u8 = 128;

impl<F: Lane> Shade<F> {
    /// Evaluates opacities, colours and features. Returns whether no opacity
    /// exceeds the one for which its lists were built.
    pub(crate) fn fill(
        &mut self,
        (visible, rank_of): (&[Projected<F>], &[u32]),
        view: &View<F>,
        splats: &Splats<F>,
        features: &[F],
        layout: ChannelLayout,
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
                        // Fetched in one loop, so that the cache misses overlap.
                        let mut fetched = [[F::zero(); 4]; CHUNK];
                        for (target, p) in fetched.iter_mut().zip(visible) {
                            *target = shaded[p.id as usize];
                        }
                        let rows = records.chunks_exact_mut(length).zip(visible);
                        for ((record, p), [r, g, b, opacity]) in rows.zip(fetched) {
                            let id = p.id as usize;
                            covered &= opacity <= p.opacity;
                            let Some((head, channels)) = record.split_first_chunk_mut() else {
                                continue;
                            };
                            *head = exponent(p, opacity);
                            // No loop over all channels here: the copy calls
                            // would cost more than the work.
                            if layout.rgb {
                                let rgb = [r, g, b].map(|x| x.max(F::zero()));
                                if let Some(channels) = channels.first_chunk_mut() {
                                    *channels = rgb;
                                }
                            }
                            if layout.depth {
                                let drawn = opacity != F::zero();
                                channels[layout.depth_at()] =
                                    if drawn { p.depth } else { F::zero() };
                            }
                            let rest = &mut channels[layout.features_at()..];
                            if rest.is_empty() {
                                continue;
                            }
                            rest.fill(F::zero());
                            if opacity != F::zero() {
                                rest[..layout.features].copy_from_slice(
                                    &features[id * layout.features..(id + 1) * layout.features],
                                );
                            }
                        }
                        covered
                    },
                )
            })
            .reduce(|| true, |a, b| a && b)
    }

    /// Opacity of a splat in the last forward pass, 0 if it was excluded.
    pub(crate) fn opacity(&self, id: u32) -> F {
        self.shaded[id as usize][3]
    }

    /// Evaluates colours and opacities in the order of the splats.
    fn fill_shaded(&mut self, rank_of: &[u32], view: &View<F>, splats: &Splats<F>, features: &[F]) {
        let (layout, arch) = (self.layout, lanes::arch());
        self.shaded.resize(rank_of.len(), [F::zero(); 4]);
        self.flags.resize(rank_of.len(), DEAD);
        self.shaded
            .par_chunks_mut(CHUNK)
            .zip(self.flags.par_chunks_mut(CHUNK))
            .zip(rank_of.par_chunks(CHUNK))
            .enumerate()
            .for_each(|(chunk, ((shaded, flags), ranks))| {
                let first = chunk * CHUNK;
                arch.dispatch(ShadeChunk {
                    view,
                    splats,
                    features,
                    layout,
                    first,
                    ranks,
                    shaded,
                    flags,
                });
            });
    }
}

/// Colours and opacities of consecutive splats from `first`.
struct ShadeChunk<'a, F> {
    view: &'a View<F>,
    splats: &'a Splats<F>,
    features: &'a [F],
    layout: ChannelLayout,
    first: usize,
    ranks: &'a [u32],
    shaded: &'a mut [[F; 4]],
    flags: &'a mut [u8],
}

impl<F: Lane> WithSimd for ShadeChunk<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let Self { splats, layout, first, ranks, shaded, flags, .. } = self;
        let view = self.view.splat(s);
        let mut harmonics = Harmonics::zero(splats.sh_degree);
        // Means and opacity logits; colours and opacities.
        let (mut geometry, mut out) = (Quad::zero(), Quad::zero());
        let (mut visible, mut count) = ([0; CHUNK], 0);
        for (i, &rank) in ranks.iter().enumerate() {
            if rank == CULLED {
                (shaded[i], flags[i]) = ([F::zero(); 4], DEAD);
            } else {
                visible[count] = i;
                count += 1;
            }
        }
        if layout.rgb {
            touch(splats, first, &visible[..count]);
        }
        for visible in visible[..count].chunks(GROUP) {
            for (place, &i) in visible.iter().enumerate() {
                let [x, y, z] = splats.means[first + i];
                geometry.0[place] = [x, y, z, splats.opacity_logits[first + i]];
                if layout.rgb {
                    harmonics.put(place, splats.sh_of(first + i));
                }
            }
            for k in 0..registers::<S, F>() {
                let [x, y, z, logit] = geometry.load(s, k);
                let mut rgb = [logit.like(0.0); 3];
                if layout.rgb {
                    let (direction, _) = view.direction([x, y, z]);
                    rgb = harmonics.colors(s, k, direction);
                }
                out.store(s, k, [rgb[0], rgb[1], rgb[2], logit.sigmoid()]);
            }
            for (place, &i) in visible.iter().enumerate() {
                let values = out.0[place];
                let id = first + i;
                let features = &self.features[id * layout.features..(id + 1) * layout.features];
                // Tested before the clamp, which would replace −∞ by 0.
                let alive = values.iter().chain(features).all(|x| x.as_f32().is_finite());
                let negative = |c: usize| u8::from(values[c] < F::zero()) << c;
                (shaded[i], flags[i]) = if alive {
                    (values, negative(0) | negative(1) | negative(2))
                } else {
                    ([F::zero(); 4], DEAD)
                };
            }
        }
    }
}

/// Centre and the coefficients of `log2 α`; base 2, because the vector exponential is `2^x`.
#[inline(always)]
fn exponent<F: Real>(p: &Projected<F>, opacity: F) -> [F; HEAD] {
    let log2_e = F::from_double(std::f64::consts::LOG2_E);
    let log_opacity = if opacity == p.opacity { p.log_opacity } else { opacity.ln() };
    let half = -F::of(0.5) * log2_e;
    let [a, b, c] = p.conic;
    [p.mean[0], p.mean[1], half * a, -log2_e * b, half * c, log2_e * log_opacity]
}
