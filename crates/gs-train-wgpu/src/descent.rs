//! [`DeviceDescent`]: `cuar`'s Adam with images, gradients and moments on the device.

use crate::descent_memory::{DeviceTargets, Run, StepBuffers};
use crate::image_loss::{DeviceImage, ImageLosses};
use crate::kernels::{
    CHANGE_COLORS, CHANGE_COLORS_BWD, COMPOSE, COMPOSE_BWD, Crop, GROUP_SIZE, Offsets,
};
use crate::weights::TermWeights;
use crate::{DeviceAdam, ParameterSlice};
use cuar::loss::LossParts;
use cuar::{DescentEngine, DescentImage, DescentTask};
use gs_core::{RasterError, RenderParams, sh};
use gs_raster_wgpu::device::{CommandMemory, Commands, GrowBuffer, Stamps, download, row_chunks};
use gs_raster_wgpu::{GpuContext, GpuError, GpuPrepared, PassTiming, WgpuRasterizer};
use std::collections::HashMap;

/// Channels of the change of colour.
const CHANNELS: usize = 3;
/// Terms of the loss.
const TERMS: usize = 3;
/// Maximum number of steps whose losses stay on the device.
const MAX_PENDING: usize = 256;

/// Steps of [`cuar::refine_with`] on the device. A step is one submission. Only the losses, on
/// request, and offsets and moments, at checkpoints, are copied to the host. Images are uploaded
/// once as long as they fit the memory of the task.
#[derive(Debug)]
pub struct DeviceDescent {
    raster: WgpuRasterizer,
    weights: TermWeights,
    sh_degree: usize,
    /// Offsets and their gradients, in runs of rows that fit a binding.
    runs: Vec<Run>,
    adam: DeviceAdam,
    images: HashMap<usize, DeviceTargets>,
    /// Memory for an image that is not kept.
    spare: DeviceTargets,
    /// Free bytes for images.
    free: usize,
    work: StepBuffers,
    losses: ImageLosses,
    /// Steps whose losses are still on the device.
    pending: usize,
    finished: Vec<LossParts>,
    commands: CommandMemory,
    stamps: Option<Stamps>,
}

fn index(context: &GpuContext, value: usize) -> Result<u32, GpuError> {
    u32::try_from(value).map_err(|error| context.failed("a step", format!("{value}: {error}")))
}

fn shape(what: &'static str, found: usize, expected: usize) -> Result<(), RasterError> {
    if found == expected { Ok(()) } else { Err(RasterError::Shape { what, found, expected }) }
}

impl DeviceDescent {
    /// An engine for prepared states of `raster`.
    ///
    /// # Errors
    /// If the device has too little memory.
    pub fn new(raster: WgpuRasterizer) -> Result<Self, RasterError> {
        let context = raster.context();
        Ok(Self {
            weights: TermWeights::default(),
            sh_degree: 0,
            runs: Vec::new(),
            adam: DeviceAdam::new(context, &[])?,
            images: HashMap::new(),
            spare: DeviceTargets::default(),
            free: 0,
            work: StepBuffers::new(),
            losses: ImageLosses::new(context, [1, 1], 3, TERMS * MAX_PENDING)?,
            pending: 0,
            finished: Vec::new(),
            commands: CommandMemory::default(),
            stamps: None,
            raster,
        })
    }

    /// Images that are kept on the device.
    pub fn num_kept(&self) -> usize {
        self.images.len()
    }

    /// Times of the passes of the last step, if the context was made with
    /// [`timestamps`](gs_raster_wgpu::GpuOptions::timestamps) and the adapter has them; otherwise
    /// empty. Waits for the device; at most once per step.
    ///
    /// # Errors
    /// If the device fails.
    pub fn timings(&mut self) -> Result<Vec<PassTiming>, RasterError> {
        let stamps = self.stamps.take().map(|stamps| stamps.read(self.raster.context()));
        Ok(stamps.transpose()?.unwrap_or_default())
    }

    /// Uploads the image if it is not on the device, and keeps it there if there is room.
    fn provide(&mut self, image: &DescentImage) -> Result<(), RasterError> {
        let pixels = image.crop.width * image.crop.height;
        for (what, found, expected) in [
            ("original", image.original.len(), CHANNELS * pixels),
            ("warp", image.warp.len(), CHANNELS * pixels),
            ("flags", image.flags.len(), pixels),
        ] {
            shape(what, found, expected)?;
        }
        if self.images.contains_key(&image.index) {
            return Ok(());
        }
        let bytes = DeviceTargets::bytes(image);
        if bytes > self.free {
            // Waits, because otherwise uploads accumulate.
            self.collect()?;
            return Ok(self.spare.upload(self.raster.context(), image)?);
        }
        let context = self.raster.context();
        let mut kept = DeviceTargets::default();
        kept.upload(context, image)?;
        self.images.insert(image.index, kept);
        self.free -= bytes;
        Ok(())
    }

    /// Moves the losses on the device to the host.
    fn collect(&mut self) -> Result<(), RasterError> {
        if self.pending == 0 {
            return Ok(());
        }
        let sums = self.losses.take()?;
        for terms in sums.as_chunks::<TERMS>().0.iter().take(self.pending) {
            let [fore_l1, fore_ssim, back_l1] = terms.map(f64::from);
            let shaped_l1 = [fore_l1, back_l1];
            self.finished.push(LossParts { fore_l1, fore_ssim, back_l1, shaped_l1 });
        }
        self.pending = 0;
        Ok(())
    }

    /// Appends the losses of the crop and the gradient of its render.
    fn encode_losses(
        &self,
        commands: &mut Commands<'_>,
        own: &DeviceTargets,
        full_pixels: usize,
    ) -> Result<(), GpuError> {
        let (context, work) = (self.raster.context(), &self.work);
        let v_render = work.v_render.get(context)?;
        commands.clear(v_render, (12 * work.pixels) as u64);
        let x = DeviceImage { buffer: work.render.get(context)?, first: 0 };
        let v_x = DeviceImage { buffer: v_render, first: 0 };
        let norm = 1.0 / (CHANNELS * full_pixels) as f32;
        let slot = index(context, TERMS * self.pending)?;
        let TermWeights { fore_l1, fore_ssim, back_l1 } = self.weights;
        let fore = (x, own.warp.get(context)?, work.fore.get(context)?);
        let back = (x, own.original.get(context)?, work.back.get(context)?);
        let losses = &self.losses;
        if own.uses[0] {
            losses.encode_masked_l1(commands, fore, (norm, fore_l1), v_x, slot)?;
            losses.encode_ssim(commands, fore, (norm, fore_ssim), v_x, slot + 1)?;
        }
        if own.uses[1] {
            losses.encode_masked_l1(commands, back, (norm, back_l1), v_x, slot + 2)?;
        }
        Ok(())
    }

    /// Appends a pass over entries once for every run of rows.
    fn encode_runs(
        &self,
        commands: &mut Commands<'_>,
        num_entries: usize,
        mut append: impl FnMut(&mut Commands<'_>, &Run, &Offsets) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let context = self.raster.context();
        for run in &self.runs {
            let uniform = Offsets {
                num_entries: index(context, num_entries)?,
                sh_degree: index(context, self.sh_degree)?,
                first_row: index(context, run.first_row)?,
                num_rows: index(context, run.rows)?,
            };
            append(commands, run, &uniform)?;
        }
        Ok(())
    }
}

impl DescentEngine<GpuPrepared> for DeviceDescent {
    fn begin(
        &mut self,
        task: &DescentTask,
        d_sh: &[[f32; 3]],
        adam: &cuar::Adam<f32>,
    ) -> Result<(), RasterError> {
        let context = self.raster.context();
        let coeffs = sh::num_coeffs(task.sh_degree);
        shape("rates", task.rates.len(), 3 * coeffs)?;
        let rows = d_sh.len() / coeffs;
        shape("offsets", d_sh.len(), rows * coeffs)?;
        self.weights = task.weights.into();
        self.sh_degree = task.sh_degree;
        self.images.clear();
        self.free = task.memory;
        self.runs.clear();
        for (first_row, rows) in row_chunks(rows, 12 * coeffs, context.max_binding_bytes()) {
            let [mut values, mut grads] =
                ["offsets", "gradients of offsets"].map(GrowBuffer::storage);
            let own = &d_sh[first_row * coeffs..(first_row + rows) * coeffs];
            values.upload(context, own)?;
            grads.ensure(context, size_of_val(own) as u64)?;
            self.runs.push(Run { first_row, rows, d_sh: values, v_sh: grads });
        }
        self.adam = DeviceAdam::new(context, task.rates)?;
        (self.adam.beta1, self.adam.beta2) = (adam.beta1, adam.beta2);
        self.adam.epsilon = adam.epsilon;
        let lengths: Vec<usize> = self.runs.iter().map(|run| 3 * coeffs * run.rows).collect();
        let steps = u32::try_from(adam.step).unwrap_or(u32::MAX);
        self.adam.restore(steps, &lengths, [&adam.m, &adam.v])?;
        self.collect()?;
        self.finished.clear();
        Ok(())
    }

    fn step(
        &mut self,
        image: &DescentImage,
        prepared: &mut GpuPrepared,
    ) -> Result<(), RasterError> {
        let size = prepared.size();
        for (axis, what) in ["width", "height"].into_iter().enumerate() {
            shape(what, image.size[axis], size[axis] as usize)?;
        }
        if self.pending == MAX_PENDING {
            self.collect()?;
        }
        self.provide(image)?;
        let context = self.raster.context().clone();
        let context = &context;
        let (crop, entries) = (image.crop, image.entries.len());
        let pixels = crop.width * crop.height;
        self.work.ensure(context, pixels, entries)?;
        let crop_size = [index(context, crop.width)?, index(context, crop.height)?];
        self.losses.resize(crop_size)?;
        let own = self.images.get(&image.index).unwrap_or(&self.spare);
        let (raster, work) = (&self.raster, &self.work);

        let features = raster.features_on_device(prepared, CHANNELS)?;
        let mut commands = Commands::new(context);
        commands.clear(&features, (4 * CHANNELS * prepared.num_splats()) as u64);
        let (listed, changes) = (own.entries.get(context)?, work.changes.get(context)?);
        self.encode_runs(&mut commands, entries, |commands, run, uniform| {
            let buffers = [listed, run.d_sh.get(context)?, changes, &features];
            commands.dispatch(&CHANGE_COLORS, uniform, &buffers, entries as u64, GROUP_SIZE)
        })?;
        let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
        raster.encode_forward(prepared, &mut commands, &params)?;

        let full_pixels = image.size[0] * image.size[1];
        let uniform = Crop {
            img_size: size,
            origin: [index(context, crop.x)?, index(context, crop.y)?],
            size: crop_size,
            // The plane before it is alpha.
            features_base: index(context, full_pixels)?,
            pad0: 0,
        };
        let (flags, original) = (own.flags.get(context)?, own.original.get(context)?);
        let (render, fore) = (work.render.get(context)?, work.fore.get(context)?);
        let planes = raster.image_buffer(prepared)?;
        let buffers = [planes, original, flags, render, fore, work.back.get(context)?];
        commands.dispatch(&COMPOSE, &uniform, &buffers, pixels as u64, GROUP_SIZE)?;
        self.encode_losses(&mut commands, own, full_pixels)?;
        let v_planes = raster.upstream_buffer(prepared)?;
        commands.clear(v_planes, raster.image_bytes(prepared)?);
        let buffers = [work.v_render.get(context)?, flags, v_planes];
        commands.dispatch(&COMPOSE_BWD, &uniform, &buffers, pixels as u64, GROUP_SIZE)?;

        raster.encode_backward_colors(prepared, &mut commands, &params)?;
        let v_features = raster.feature_grads(prepared)?;
        let columns = 3 * sh::num_coeffs(self.sh_degree);
        self.encode_runs(&mut commands, entries, |commands, run, uniform| {
            let v_sh = run.v_sh.get(context)?;
            commands.clear(v_sh, (4 * columns * run.rows) as u64);
            let buffers = [listed, changes, v_features, v_sh];
            commands.dispatch(&CHANGE_COLORS_BWD, uniform, &buffers, entries as u64, GROUP_SIZE)
        })?;
        let mut slices = Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            slices.push(ParameterSlice {
                values: run.d_sh.get(context)?,
                grads: run.v_sh.get(context)?,
                first_grad: 0,
                first_row: run.first_row,
                rows: run.rows,
                columns,
            });
        }
        self.adam.encode(&mut commands, &slices, None)?;
        self.stamps = Some(commands.submit(&mut self.commands, "a step of the refinement")?);
        self.pending += 1;
        Ok(())
    }

    fn losses(&mut self) -> Result<Vec<LossParts>, RasterError> {
        self.collect()?;
        Ok(std::mem::take(&mut self.finished))
    }

    fn render(&mut self) -> Result<Vec<f32>, RasterError> {
        let (context, work) = (self.raster.context(), &self.work);
        let buffer = work.render.get(context)?;
        Ok(download(context, Commands::new(context), buffer, CHANNELS * work.pixels)?)
    }

    fn read(
        &mut self,
        d_sh: &mut [[f32; 3]],
        adam: &mut cuar::Adam<f32>,
    ) -> Result<(), RasterError> {
        let (context, coeffs) = (self.raster.context(), sh::num_coeffs(self.sh_degree));
        let rows = self.runs.iter().map(|run| run.rows).sum::<usize>();
        shape("offsets", d_sh.len(), rows * coeffs)?;
        for run in &self.runs {
            let (commands, buffer) = (Commands::new(context), run.d_sh.get(context)?);
            let values: Vec<[f32; 3]> = download(context, commands, buffer, run.rows * coeffs)?;
            d_sh[run.first_row * coeffs..][..values.len()].copy_from_slice(&values);
        }
        [adam.m, adam.v] = self.adam.moments()?;
        adam.step = u64::from(self.adam.step);
        Ok(())
    }
}
