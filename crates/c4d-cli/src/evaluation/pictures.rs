//! Image metrics: error against ground truth, preservation, temporal consistency.

use super::item::Item;
use super::series::{Series, mean};
use super::subject::Subject;
use super::truth::Truth;
use crate::console::Console;
use crate::device::{self, Device};
use crate::failure::{Failure, Outcome, chain};
use c4d_metrics::{
    EditedImage, FlowField, Ssim, SsimBorder, StaticFlicker, dilated, flip,
    mean_absolute_difference, motion_fidelity, ms_ssim, psnr, temporal_flickering, warp_error,
};
use gs_core::{
    Camera, DynamicScene, Image, RasterError, Rasterizer, RenderOutput, RenderParams, Splats,
};
use gs_raster_cpu::CpuRasterizer;
use std::collections::BTreeMap;

/// Contribution of edited splats above which a pixel belongs to the mask of the edit, 0 to 1.
const TOUCHED: f32 = 0.01;
/// Dilation of the mask, pixels, because pixels next to edited splats change slightly.
const GROWN: usize = 3;
/// Difference above which a background pixel counts as changed, 0 to 1. Rounding to 8 bits alone
/// can cause 1/255.
const CHANGED: f32 = 2.0 / 255.0;
/// Share of frames at the end of the clip used for `edit_fade`.
const LATE: f64 = 0.25;
/// Factor of displayed warp errors.
const PER_MILLE: f64 = 1e3;
/// Warp error at or below which the source's error counts as zero, so that a ratio is undefined.
const NO_ERROR: f64 = 1e-12;

/// Modifies the image of a view and frame before it is measured.
pub(crate) type Retouch<'a> = &'a dyn Fn(usize, usize, Image) -> Image;

/// Input of the image metrics: scene, views, times and ground truth.
pub(crate) struct Sight<'a> {
    pub(crate) subject: &'a Subject<'a>,
    pub(crate) cameras: &'a [Camera],
    pub(crate) times: &'a [f32],
    pub(crate) background: [f32; 3],
    pub(crate) truth: Option<Truth<'a>>,
    /// Degrades images of the edit in tests.
    pub(crate) retouch: Option<Retouch<'a>>,
    pub(crate) console: &'a Console,
}

/// Renders all views and computes the image metrics.
pub(crate) fn pictures(sight: &mut Sight<'_>, device: &Device) -> Outcome<Vec<Item>> {
    match device {
        Device::Cpu => Measuring::new(&CpuRasterizer::default(), sight)?.run(sight),
        #[cfg(feature = "gpu")]
        Device::Gpu(raster) => Measuring::new(raster, sight)?.run(sight),
    }
}

/// Splats of a scene at a frame and its neighbours.
#[derive(Default)]
struct Around {
    before: Splats,
    now: Splats,
    after: Splats,
}

impl Around {
    /// Advances to frame `i`.
    fn seek(&mut self, scene: &dyn DynamicScene, times: &[f32], i: usize) -> Outcome {
        let at = |i: usize, out: &mut Splats| {
            scene.at_into(times[i], out).map_err(|error| Failure::bad_input(chain(&error)))
        };
        if i == 0 {
            at(0, &mut self.now)?;
            self.before.clone_from(&self.now);
        } else {
            std::mem::swap(&mut self.before, &mut self.now);
            std::mem::swap(&mut self.now, &mut self.after);
        }
        if i + 1 < times.len() {
            at(i + 1, &mut self.after)
        } else {
            self.after.clone_from(&self.now);
            Ok(())
        }
    }
}

/// Images of the edit and of its source at the same time.
struct Pair {
    edit: Image,
    source: Image,
}

/// State of a view between frames.
struct ViewState<P> {
    /// Prepared splats of the source at the edited frame.
    first: P,
    /// Images of the edited frame.
    at_edit: Pair,
    /// Images of the previous frame, and the flow of the edit and of the source from that frame to
    /// this one.
    last: Option<(Pair, [FlowField; 2])>,
    edit_flicker: StaticFlicker,
    source_flicker: StaticFlicker,
}

struct Measuring<'r, R: Rasterizer> {
    raster: &'r R,
    views: Vec<ViewState<R::Prepared>>,
    edit_prepared: Option<R::Prepared>,
    source_prepared: Option<R::Prepared>,
    first_source: Splats,
    params: RenderParams,
    series: BTreeMap<&'static str, Series>,
    output: RenderOutput,
    first_frame: Vec<Option<f64>>,
}

/// The render rounded to 8 bits, as in a saved PNG.
fn quantised(output: &RenderOutput) -> Image {
    let image = output.rgb_image();
    let data = image.to_bytes().into_iter().map(|value| f32::from(value) / 255.0).collect();
    Image { data, ..image }
}

fn refused(error: &RasterError) -> Failure {
    device::failure(error)
}

fn failed(error: &cuar::CuarError) -> Failure {
    Failure::failed(chain(error))
}

/// Displacements of splats between two times, pixels.
fn moved(from: &Splats, to: &Splats, camera: &Camera) -> Outcome<Vec<[f32; 2]>> {
    cuar::displacements(from, to, camera).map_err(|error| failed(&error))
}

impl<'r, R: Rasterizer> Measuring<'r, R> {
    fn new(raster: &'r R, sight: &Sight<'_>) -> Outcome<Self> {
        let Sight { subject, cameras, background, times, .. } = sight;
        let params = RenderParams {
            background: background.map(f64::from),
            depth: false,
            ..RenderParams::default()
        };
        let at = |scene: &dyn DynamicScene| scene.at(subject.edit_time).map_err(Failure::input);
        let (first_edit, first_source) = (at(subject.scene)?, at(subject.source)?);
        let render = |splats: &Splats, camera: &Camera| -> Outcome<(Image, R::Prepared)> {
            let mut prepared = raster.prepare(splats, camera).map_err(|e| refused(&e))?;
            let output =
                raster.forward(&mut prepared, splats, &[], &params).map_err(|e| refused(&e))?;
            Ok((quantised(&output), prepared))
        };
        let mut first_frame = Vec::new();
        let mut views = Vec::new();
        for camera in *cameras {
            let (source, first) = render(&first_source, camera)?;
            let (edit, _) = render(&first_edit, camera)?;
            if let Some(known) = &subject.edit {
                let (given, _) = render(known.frame, camera)?;
                first_frame.push(psnr(&edit, &given));
            }
            views.push(ViewState {
                first,
                at_edit: Pair { edit, source },
                last: None,
                edit_flicker: StaticFlicker::default(),
                source_flicker: StaticFlicker::default(),
            });
        }
        let series = SERIES.map(|id| (id, Series::new(cameras.len(), times.len()))).into();
        Ok(Self {
            raster,
            views,
            edit_prepared: None,
            source_prepared: None,
            first_source,
            params,
            series,
            output: RenderOutput::default(),
            first_frame,
        })
    }

    fn run(mut self, sight: &mut Sight<'_>) -> Outcome<Vec<Item>> {
        let (mut edit, mut source) = (Around::default(), Around::default());
        let steps = (sight.times.len() * sight.cameras.len()) as u64;
        let mut progress = sight.console.progress("measure", steps);
        for frame in 0..sight.times.len() {
            edit.seek(sight.subject.scene, sight.times, frame)?;
            source.seek(sight.subject.source, sight.times, frame)?;
            if let Some(truth) = &mut sight.truth {
                truth.seek(sight.times[frame])?;
            }
            for view in 0..sight.cameras.len() {
                self.measure(sight, (view, frame), &edit, &source)?;
                progress.step();
            }
        }
        progress.finish();
        Ok(self.items(sight))
    }

    fn set(&mut self, id: &'static str, (view, frame): (usize, usize), value: Option<f64>) {
        if let Some(series) = self.series.get_mut(id) {
            series.set(view, frame, value);
        }
    }

    /// Renders colours and the features of the splats.
    fn render(
        &mut self,
        splats: &Splats,
        camera: &Camera,
        features: &[f32],
        of_source: bool,
    ) -> Outcome {
        let slot = if of_source { &mut self.source_prepared } else { &mut self.edit_prepared };
        let prepared = match slot {
            Some(prepared) => {
                self.raster.prepare_into(splats, camera, prepared).map_err(|e| refused(&e))?;
                prepared
            }
            None => slot.insert(self.raster.prepare(splats, camera).map_err(|e| refused(&e))?),
        };
        self.raster
            .forward_into(prepared, splats, features, &self.params, &mut self.output)
            .map_err(|e| refused(&e))
    }

    /// A flow from the features of the last render.
    fn flow(&self, channels: usize, first: usize) -> FlowField {
        let RenderOutput { width, height, features, alpha, .. } = &self.output;
        FlowField::normalized((*width, *height), features, (channels, first), alpha)
    }

    /// Pixels of the last render to which the first feature contributes.
    fn touched(&self, channels: usize) -> Vec<bool> {
        self.output.features.iter().step_by(channels).map(|&share| share > TOUCHED).collect()
    }

    fn measure(
        &mut self,
        sight: &mut Sight<'_>,
        at: (usize, usize),
        edit: &Around,
        source: &Around,
    ) -> Outcome {
        let (view, frame) = at;
        let camera = &sight.cameras[view];
        let t = sight.times[frame];
        let width = camera.width as usize;
        let has_next = frame + 1 < sight.times.len();
        let mark = |marks: Option<&Vec<bool>>, row: usize| {
            marks.map_or(0.0, |marks| f32::from(u8::from(marks[row])))
        };
        let known = sight.subject.edit.as_ref();

        let forth = moved(&edit.now, &edit.after, camera)?;
        let back = moved(&edit.now, &edit.before, camera)?;
        let features: Vec<f32> = (0..forth.len())
            .flat_map(|row| {
                let touched = mark(known.map(|edit| &edit.touched), row);
                let ([a, b], [c, d]) = (forth[row], back[row]);
                [touched, a, b, c, d]
            })
            .collect();
        self.render(&edit.now, camera, &features, false)?;
        let mut picture = quantised(&self.output);
        if let Some(retouch) = sight.retouch {
            picture = retouch(view, frame, picture);
        }
        let (edit_flow, edit_back) = (self.flow(5, 1), self.flow(5, 3));
        let mut mask = self.touched(5);

        let forth = moved(&source.now, &source.after, camera)?;
        let back = moved(&source.now, &source.before, camera)?;
        let to_edit = moved(&source.now, &self.first_source, camera)?;
        let features: Vec<f32> = (0..forth.len())
            .flat_map(|row| {
                let touched = mark(known.map(|edit| &edit.touched_source), row);
                let ([a, b], [c, d], [e, f]) = (forth[row], back[row], to_edit[row]);
                [touched, a, b, c, d, e, f]
            })
            .collect();
        self.render(&source.now, camera, &features, true)?;
        let before = quantised(&self.output);
        let (source_flow, back, to_edit) = (self.flow(7, 1), self.flow(7, 3), self.flow(7, 5));
        for (mask, touched) in mask.iter_mut().zip(self.touched(7)) {
            *mask |= touched;
        }
        let mask = dilated(&mask, width, GROWN);

        if let Some(truth) = &mut sight.truth {
            self.against_truth(truth.picture(camera, t)?.as_ref(), &picture, at);
        }
        if known.is_some() {
            let both = EditedImage { before: &before, after: &picture, mask: &mask };
            self.preservation(&both, at);
            if has_next {
                let fidelity = |inside| motion_fidelity(&edit_flow, &source_flow, &mask, inside);
                let values = [fidelity(false), fidelity(true)];
                self.set("motion_fidelity", at, values[0]);
                self.set("motion_fidelity_edit", at, values[1]);
            }
        }
        let pair = Pair { edit: picture, source: before };
        self.long(sight, at, &source.now, &pair, &to_edit)?;
        self.short(at, &pair, [&edit_back, &back]);
        let state = &mut self.views[view];
        state.edit_flicker.add(&pair.edit);
        state.source_flicker.add(&pair.source);
        if has_next {
            for flow in [&edit_flow, &source_flow] {
                state.edit_flicker.exclude_moving(flow);
                state.source_flicker.exclude_moving(flow);
            }
        }
        state.last = Some((pair, [edit_flow, source_flow]));
        Ok(())
    }

    fn against_truth(&mut self, truth: Option<&Image>, picture: &Image, at: (usize, usize)) {
        let Some(truth) = truth else { return };
        let bytes = truth.to_bytes().into_iter().map(|value| f32::from(value) / 255.0);
        let truth = &Image { data: bytes.collect(), ..*truth };
        self.set("psnr", at, psnr(picture, truth));
        if picture.data.len() == truth.data.len() {
            let mut ssim = Ssim::<f32>::new(picture.width, picture.height, picture.channels);
            let zero = ssim.value(&picture.data, &truth.data, SsimBorder::Zero);
            self.set("ssim", at, Some(f64::from(zero)));
            self.set("ssim_valid", at, Some(f64::from(ssim.mean(SsimBorder::Valid))));
        }
        self.set("ms_ssim", at, ms_ssim(picture, truth));
        self.set("flip", at, flip(picture, truth));
    }

    fn preservation(&mut self, both: &EditedImage<'_>, at: (usize, usize)) {
        let Image { width, height, channels, .. } = *both.before;
        let mut ssim = Ssim::<f32>::new(width, height, channels);
        ssim.value(&both.before.data, &both.after.data, SsimBorder::Zero);
        self.set("bg_psnr", at, both.background_psnr());
        self.set("bg_ssim", at, both.background_ssim(ssim.map()));
        self.set("bg_changed_frac", at, both.background_changed(CHANGED));
        self.set("edit_strength", at, both.strength());
    }

    /// Warp errors against the edited frame, along the source's flow.
    fn long(
        &mut self,
        sight: &Sight<'_>,
        at: (usize, usize),
        now: &Splats,
        pair: &Pair,
        to_edit: &FlowField,
    ) -> Outcome {
        let camera = &sight.cameras[at.0];
        if sight.times[at.1] == sight.subject.edit_time {
            return Ok(());
        }
        let forth = moved(&self.first_source, now, camera)?.concat();
        let params = RenderParams { rgb: false, ..self.params };
        let state = &mut self.views[at.0];
        let output = self
            .raster
            .forward(&mut state.first, &self.first_source, &forth, &params)
            .map_err(|e| refused(&e))?;
        let size = (output.width, output.height);
        let from_edit = FlowField::normalized(size, &output.features, (2, 0), &output.alpha);
        let visible = to_edit.visible(&from_edit);
        let first = &state.at_edit;
        let values = [
            warp_error(&pair.edit, &first.edit, to_edit, &visible),
            warp_error(&pair.source, &first.source, to_edit, &visible),
        ];
        self.set("warp_error_long", at, values[0].map(|error| PER_MILLE * error));
        self.set("warp_error_long_src", at, values[1].map(|error| PER_MILLE * error));
        Ok(())
    }

    /// Warp errors between the previous frame and this one, along the source's flow and along the
    /// edit's own.
    fn short(&mut self, at: (usize, usize), pair: &Pair, back: [&FlowField; 2]) {
        let Some((last, [own, flow])) = self.views[at.0].last.take() else { return };
        let visible = flow.visible(back[1]);
        for (ids, a, b) in [
            (["warp_error", "difference"], &last.edit, &pair.edit),
            (["warp_error_src", "difference_src"], &last.source, &pair.source),
        ] {
            let error = warp_error(a, b, &flow, &visible).map(|error| PER_MILLE * error);
            self.set(ids[0], at, error);
            self.set(ids[1], at, mean_absolute_difference(a, b));
        }
        let error = warp_error(&last.edit, &pair.edit, &own, &own.visible(back[0]));
        self.set("warp_error_own", at, error.map(|error| PER_MILLE * error));
    }

    fn items(self, sight: &Sight<'_>) -> Vec<Item> {
        let Self { series, views, first_frame, .. } = self;
        let of = |id: &str| &series[id];
        let frames = |id: &'static str| Item::of_frames(id, of(id));
        let mut items = Vec::new();
        let truth = match &sight.truth {
            Some(Truth::Scene { .. }) => "scene",
            Some(Truth::Photos(_)) => "photographs",
            None => "none",
        };
        for id in ["psnr", "ssim", "ssim_valid", "ms_ssim", "flip"] {
            items.push(match (truth, id) {
                ("none", _) => Item::missing(id, "no ground truth given (--truth)"),
                (_, "flip") => {
                    let degree = c4d_metrics::FLIP_PIXELS_PER_DEGREE;
                    frames(id).with("truth", truth).with("pixels_per_degree", degree)
                }
                (_, "ssim") => frames(id).with("truth", truth).with("border", "zero"),
                (_, "ssim_valid") => frames(id).with("truth", truth).with("border", "valid"),
                _ => frames(id).with("truth", truth),
            });
        }
        let edited = sight.subject.edit.is_some();
        let or_missing = |item: Item| {
            if edited {
                item
            } else {
                Item::missing(item.definition.id, "the scene is not a run: nothing was edited")
            }
        };
        let masked = |item: Item| {
            or_missing(item.with("mask_share", f64::from(TOUCHED)).with("mask_grown_px", GROWN))
        };
        for id in ["bg_psnr", "bg_ssim", "edit_strength"] {
            items.push(masked(frames(id)));
        }
        let levels = (f64::from(CHANGED) * 255.0).round();
        items.push(masked(frames("bg_changed_frac").with("threshold_levels", levels)));
        let count = sight.times.len();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of it"
        )]
        let late = ((count as f64 * LATE).ceil() as usize).min(count);
        let fades = of("edit_strength").0.iter().map(|frames| {
            let nearest = (0..count).min_by(|&a, &b| {
                let gap = |i: usize| (sight.times[i] - sight.subject.edit_time).abs();
                gap(a).total_cmp(&gap(b))
            })?;
            let first = frames[nearest].filter(|strength| *strength > 0.0)?;
            Some(mean(frames[count - late..].iter().flatten().copied())? / first)
        });
        items.push(masked(Item::of_views("edit_fade", fades.collect()).with("late_share", LATE)));
        items.push(or_missing(Item::of_views("first_frame_psnr", first_frame)));

        let flow = |item: Item| item.with("flow", "source, rendered, over coverage above 0.5");
        let own = |item: Item| item.with("flow", "each its own, rendered, over coverage above 0.5");
        for id in ["warp_error", "warp_error_src", "warp_error_long", "warp_error_long_src"] {
            items.push(flow(frames(id)));
        }
        items.push(own(frames("warp_error_own")));
        for (id, source, ratio) in [
            ("warp_error", "warp_error_src", "warp_error_ratio"),
            ("warp_error_own", "warp_error_src", "warp_error_own_ratio"),
            ("warp_error_long", "warp_error_long_src", "warp_error_long_ratio"),
        ] {
            let ratios = of(id).means().into_iter().zip(of(source).means()).map(|both| {
                let (edit, source) = (both.0?, both.1?);
                match (edit > NO_ERROR, source > NO_ERROR) {
                    (_, true) => Some(edit / source),
                    (false, false) => Some(1.0),
                    (true, false) => None,
                }
            });
            let item = Item::of_views(ratio, ratios.collect());
            items.push(if id == "warp_error_own" { own(item) } else { flow(item) });
        }
        let flickering = |id: &str| {
            of(id).means().into_iter().map(|mean| mean.map(temporal_flickering)).collect()
        };
        items.push(
            Item::of_views("temporal_flickering", flickering("difference")).with("frames", count),
        );
        items.push(
            Item::of_views("temporal_flickering_src", flickering("difference_src"))
                .with("frames", count),
        );
        let mut excess = of("difference").clone();
        for (edit, source) in excess.0.iter_mut().zip(&of("difference_src").0) {
            for (edit, source) in edit.iter_mut().zip(source) {
                *edit = edit.zip(*source).map(|(edit, source)| edit - source);
            }
        }
        items.push(Item::of_frames("flicker_excess", &excess).with("frames", count));
        let still = |item: Item| item.with("still_px", f64::from(StaticFlicker::STILL));
        let values = |of: fn(&ViewState<R::Prepared>) -> Option<f64>| -> Vec<Option<f64>> {
            views.iter().map(of).collect()
        };
        let edit = values(|view| view.edit_flicker.value());
        let source = values(|view| view.source_flicker.value());
        let excess = edit.iter().zip(&source).map(|(a, b)| a.zip(*b).map(|(a, b)| a - b));
        let excess = excess.collect();
        for (id, values) in [
            ("static_flicker", edit),
            ("static_flicker_src", source),
            ("static_flicker_excess", excess),
        ] {
            items.push(still(Item::of_views(id, values)));
        }
        items.push(masked(frames("motion_fidelity")));
        items.push(masked(frames("motion_fidelity_edit")));
        items
    }
}

/// Ids of the values stored per view and frame.
const SERIES: [&str; 18] = [
    "psnr",
    "ssim",
    "ssim_valid",
    "ms_ssim",
    "flip",
    "bg_psnr",
    "bg_ssim",
    "bg_changed_frac",
    "edit_strength",
    "warp_error",
    "warp_error_src",
    "warp_error_own",
    "warp_error_long",
    "warp_error_long_src",
    "difference",
    "difference_src",
    "motion_fidelity",
    "motion_fidelity_edit",
];
