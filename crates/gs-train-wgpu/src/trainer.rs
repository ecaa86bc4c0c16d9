//! [`Trainer`]: optimisation steps that never leave the device.

use crate::image_loss::{ImageLosses, Plane};
use crate::{DeviceAdam, Targets};
use gs_core::{RasterError, RenderParams, sh};
use gs_raster_wgpu::device::{CommandMemory, Commands, GrowBuffer, Stamps};
use gs_raster_wgpu::{GpuPrepared, Group, PassTiming, WgpuRasterizer};

/// Terms of the loss.
const NUM_TERMS: usize = 3;

/// Weights of the terms of the loss, each a mean over all pixels and channels of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Of `mean fore·|render − warp|`.
    pub fore_l1: f32,
    /// Of `1 − mean SSIM(fore·render, fore·warp)`.
    pub fore_ssim: f32,
    /// Of `mean back·|render − original|`.
    pub back_l1: f32,
}

impl Weights {
    /// Eqs. 18 and 20: `(1 − ζ)((1 − η)·L1 + η·(1 − SSIM)) + ζ·L1 of the background`.
    #[expect(clippy::cast_possible_truncation, reason = "weights of a loss in single precision")]
    pub fn refinement(eta: f64, zeta: f64) -> Self {
        Self {
            fore_l1: ((1.0 - zeta) * (1.0 - eta)) as f32,
            fore_ssim: ((1.0 - zeta) * eta) as f32,
            back_l1: zeta as f32,
        }
    }
}

/// Learning rates; a group whose rate is 0 is not touched, and its gradient not computed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rates {
    /// Of means, world units.
    pub means: f32,
    /// Of raw quaternions.
    pub quats: f32,
    /// Of log-scales.
    pub log_scales: f32,
    /// Of opacity logits.
    pub opacity_logits: f32,
    /// Of the harmonics' first coefficient.
    pub sh_dc: f32,
    /// Of the others.
    pub sh_rest: f32,
}

impl Rates {
    fn geometry(&self) -> bool {
        self.means != 0.0 || self.quats != 0.0 || self.log_scales != 0.0
    }

    fn harmonics(&self) -> bool {
        self.sh_dc != 0.0 || self.sh_rest != 0.0
    }

    /// One rate per column.
    fn columns(&self, group: Group, sh_degree: usize) -> Vec<f32> {
        match group {
            Group::Means => vec![self.means; 3],
            Group::Quats => vec![self.quats; 4],
            Group::LogScales => vec![self.log_scales; 3],
            Group::OpacityLogits => vec![self.opacity_logits],
            Group::Sh => {
                let mut rates = vec![self.sh_rest; 3 * sh::num_coeffs(sh_degree)];
                rates[..3].fill(self.sh_dc);
                rates
            }
        }
    }
}

/// How to optimise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainOptions {
    /// Terms of the loss.
    pub weights: Weights,
    /// Learning rates.
    pub rates: Rates,
    /// Background and convention of the gradients; colour is composited, depth and features are
    /// not, whatever it says.
    pub params: RenderParams,
}

/// Losses since they were last read, means over steps.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StepLosses {
    /// Steps.
    pub steps: u32,
    /// First term, without its weight.
    pub fore_l1: f32,
    /// Second term.
    pub fore_ssim: f32,
    /// Third term.
    pub back_l1: f32,
    /// Their weighted sum.
    pub total: f32,
}

/// Steps forward → losses → backward → Adam over splats on the device, from as many views as there
/// are.
///
/// Prepare one view with [`gs_core::Rasterizer::prepare`], upload its colours with
/// [`WgpuRasterizer::upload_appearance`], and make the other views with
/// [`WgpuRasterizer::prepare_view`]: all share their parameters. Read the result with
/// [`WgpuRasterizer::read_parameters`].
#[derive(Debug)]
pub struct Trainer {
    raster: WgpuRasterizer,
    options: TrainOptions,
    groups: Vec<(Group, DeviceAdam)>,
    losses: Option<ImageLosses>,
    /// Flags of rows left out, and their number.
    skip: Option<(GrowBuffer, usize)>,
    memory: CommandMemory,
    /// Since the losses were read.
    steps: u32,
    stamps: Option<Stamps>,
}

impl Trainer {
    /// For splats of degree `sh_degree`. Rows whose flag in `skip` is set keep their values; empty
    /// for none, else one flag per splat.
    ///
    /// # Errors
    /// If the device has too little memory.
    pub fn new(
        raster: WgpuRasterizer,
        sh_degree: usize,
        options: TrainOptions,
        skip: &[bool],
    ) -> Result<Self, RasterError> {
        let context = raster.context();
        let rates = options.rates;
        let mut groups = Vec::new();
        for (group, trained) in [
            (Group::Means, rates.means != 0.0),
            (Group::Quats, rates.quats != 0.0),
            (Group::LogScales, rates.log_scales != 0.0),
            (Group::OpacityLogits, rates.opacity_logits != 0.0),
            (Group::Sh, rates.harmonics()),
        ] {
            if trained {
                groups.push((group, DeviceAdam::new(context, &rates.columns(group, sh_degree))?));
            }
        }
        let mut flags = None;
        if !skip.is_empty() {
            let values: Vec<u32> = skip.iter().map(|&skip| u32::from(skip)).collect();
            let mut buffer = GrowBuffer::storage("rows left out");
            buffer.upload(context, &values)?;
            flags = Some((buffer, skip.len()));
        }
        let params = RenderParams { rgb: true, depth: false, ..options.params };
        Ok(Self {
            raster,
            options: TrainOptions { params, ..options },
            groups,
            losses: None,
            skip: flags,
            memory: CommandMemory::default(),
            steps: 0,
            stamps: None,
        })
    }

    /// What a forward pass must have on the device: the `params` for
    /// [`WgpuRasterizer::upload_appearance`].
    pub fn params(&self) -> &RenderParams {
        &self.options.params
    }

    /// One step from one view. Nothing is read back, except two counts when the view's lists have
    /// to be made: at its first step, and at every step if geometry is trained.
    ///
    /// # Errors
    /// If the targets have another size than the view, no colours are on the device, or the device
    /// fails.
    pub fn step(
        &mut self,
        prepared: &mut GpuPrepared,
        targets: &Targets,
    ) -> Result<(), RasterError> {
        let TrainOptions { weights, rates, params } = self.options;
        if rates.geometry() {
            // Another view's step may have moved the splats.
            self.raster.geometry_changed(prepared);
        }
        self.make_room(prepared, targets)?;
        let Some(losses) = &self.losses else { return Err(RasterError::NoForward) };
        let context = self.raster.context();
        let mut commands = Commands::new(context);
        self.raster.encode_forward(prepared, &mut commands, &params)?;

        let v_image = self.raster.upstream_buffer(prepared)?;
        commands.clear(v_image, self.raster.image_bytes(prepared)?);
        let x = Plane { buffer: self.raster.image_buffer(prepared)?, first: 0 };
        let v_x = Plane { buffer: v_image, first: 0 };
        let norm = 1.0 / (3.0 * targets.size[0] as f32 * targets.size[1] as f32);
        let fore = (x, targets.warp.get(context)?, targets.fore.get(context)?);
        let back = (x, targets.original.get(context)?, targets.back.get(context)?);
        if weights.fore_l1 != 0.0 {
            losses.encode_masked_l1(&mut commands, fore, (norm, weights.fore_l1), v_x, 0)?;
        }
        if weights.fore_ssim != 0.0 {
            losses.encode_ssim(&mut commands, fore, (norm, weights.fore_ssim), v_x, 1)?;
        }
        if weights.back_l1 != 0.0 {
            losses.encode_masked_l1(&mut commands, back, (norm, weights.back_l1), v_x, 2)?;
        }

        let everything = rates.geometry() || rates.opacity_logits != 0.0;
        self.raster.encode_backward(prepared, &mut commands, &params, everything)?;
        let skip = self.skip.as_ref().map(|(flags, _)| flags.get(context)).transpose()?;
        for (group, adam) in &mut self.groups {
            let slices = self.raster.parameters(prepared, *group)?;
            adam.encode(&mut commands, &slices, skip)?;
        }
        self.stamps = Some(commands.submit(&mut self.memory, "training step")?);
        self.steps += 1;
        Ok(())
    }

    /// Verifies shapes, and makes loss memory for the size of this image.
    fn make_room(&mut self, prepared: &GpuPrepared, targets: &Targets) -> Result<(), RasterError> {
        let size = prepared.size();
        for (axis, what) in
            ["width of the targets", "height of the targets"].into_iter().enumerate()
        {
            let (found, expected) = (targets.size[axis] as usize, size[axis] as usize);
            if found != expected {
                return Err(RasterError::Shape { what, found, expected });
            }
        }
        if let Some((_, found)) = self.skip
            && found != prepared.num_splats()
        {
            let expected = prepared.num_splats();
            return Err(RasterError::Shape { what: "skip", found, expected });
        }
        match &mut self.losses {
            Some(losses) => losses.resize(size)?,
            none => *none = Some(ImageLosses::new(self.raster.context(), size, 3, NUM_TERMS)?),
        }
        Ok(())
    }

    /// Means of the losses since the last call; the only thing that waits for the device.
    ///
    /// # Errors
    /// If the device fails.
    pub fn losses(&mut self) -> Result<StepLosses, RasterError> {
        let sums =
            self.losses.as_mut().map_or_else(|| Ok(vec![0.0; NUM_TERMS]), ImageLosses::take)?;
        let steps = std::mem::take(&mut self.steps);
        let [fore_l1, fore_ssim, back_l1] = [0, 1, 2].map(|term| sums[term] / steps.max(1) as f32);
        let w = self.options.weights;
        let total = w.fore_l1 * fore_l1 + w.fore_ssim * fore_ssim + w.back_l1 * back_l1;
        Ok(StepLosses { steps, fore_l1, fore_ssim, back_l1, total })
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

    /// The optimiser of a group, if it is trained.
    pub fn optimizer(&self, group: Group) -> Option<&DeviceAdam> {
        self.groups.iter().find(|(own, _)| *own == group).map(|(_, adam)| adam)
    }
}
