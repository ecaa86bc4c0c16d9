//! [`ImageLosses`]: masked L1 and SSIM of images on the device.

use crate::kernels::{
    BLOCK, GROUP_SIZE, ImageLoss, MASKED_L1, SSIM, SSIM_BWD, SUM_PARTIALS, SumPartials,
};
use gs_core::RasterError;
use gs_raster_wgpu::device::{CommandMemory, Commands, GrowBuffer, download, read};
use gs_raster_wgpu::{GpuContext, GpuError};

/// An image `[H,W,C]` on the device, or its gradient.
#[derive(Debug, Clone, Copy)]
pub struct DeviceImage<'a> {
    /// 32-bit floats.
    pub buffer: &'a wgpu::Buffer,
    /// Index of the first value of the image.
    pub first: usize,
}

/// Masked L1 and SSIM for images of one size at a time, with their work memory and running sums of
/// their values.
#[derive(Debug)]
pub struct ImageLosses {
    context: GpuContext,
    size: [u32; 2],
    channels: u32,
    partials: GrowBuffer,
    planes: GrowBuffer,
    losses: GrowBuffer,
    num_slots: usize,
}

impl ImageLosses {
    /// For images of `[W, H]` pixels and `channels` channels, with `num_slots` running sums.
    ///
    /// # Errors
    /// If the device has too little memory.
    pub fn new(
        context: &GpuContext,
        size: [u32; 2],
        channels: u32,
        num_slots: usize,
    ) -> Result<Self, GpuError> {
        let mut own = Self {
            context: context.clone(),
            size,
            channels,
            partials: GrowBuffer::storage("sums of losses"),
            planes: GrowBuffer::storage("derivatives of windows"),
            losses: GrowBuffer::storage("losses"),
            num_slots,
        };
        own.losses.ensure(context, 4 * num_slots as u64)?;
        own.resize(size)?;
        Ok(own)
    }

    /// Changes the image size; running sums are kept.
    ///
    /// # Errors
    /// If the device has too little memory.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), GpuError> {
        self.size = size;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let (blocks, groups) = (self.blocks(), pixels.div_ceil(u64::from(GROUP_SIZE)));
        let windows = u64::from(blocks[0]) * u64::from(blocks[1]) * u64::from(self.channels);
        self.partials.ensure(&self.context, 4 * groups.max(windows))?;
        self.planes.ensure(&self.context, 12 * pixels)?;
        Ok(())
    }

    /// `[W, H]`, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    fn blocks(&self) -> [u32; 2] {
        self.size.map(|side| side.div_ceil(BLOCK))
    }

    fn uniform(
        &self,
        x: DeviceImage<'_>,
        v_x: DeviceImage<'_>,
        factor: f32,
    ) -> Result<ImageLoss, GpuError> {
        let index = |value: usize| {
            let fits = u32::try_from(value);
            fits.map_err(|error| self.context.failed("losses", format!("value {value}: {error}")))
        };
        Ok(ImageLoss {
            img_size: self.size,
            num_channels: self.channels,
            x_base: index(x.first)?,
            v_base: index(v_x.first)?,
            factor,
            ..ImageLoss::default()
        })
    }

    fn add_up(&self, commands: &mut Commands<'_>, sum: SumPartials) -> Result<(), GpuError> {
        let buffers = [self.partials.get(&self.context)?, self.losses.get(&self.context)?];
        commands.dispatch_groups(&SUM_PARTIALS, &sum, &buffers, [1, 1]);
        Ok(())
    }

    /// Appends `norm · Σ m·|x − y|` (added to running sum `slot`) and `share` times its derivative
    /// (added to `v_x`, 0 at x = y). Pixels with a weight of at most 0 are ignored.
    ///
    /// # Errors
    /// If sizes exceed 32 bits.
    pub fn encode_masked_l1(
        &self,
        commands: &mut Commands<'_>,
        (x, y, mask): (DeviceImage<'_>, &wgpu::Buffer, &wgpu::Buffer),
        (norm, share): (f32, f32),
        v_x: DeviceImage<'_>,
        slot: u32,
    ) -> Result<(), GpuError> {
        let uniform = self.uniform(x, v_x, norm * share)?;
        let buffers = [x.buffer, y, mask, v_x.buffer, self.partials.get(&self.context)?];
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        commands.dispatch(&MASKED_L1, &uniform, &buffers, pixels, GROUP_SIZE)?;
        let num_partials = self.size[0] * self.size[1];
        let num_partials = num_partials.div_ceil(GROUP_SIZE);
        self.add_up(commands, SumPartials { num_partials, slot, scale: norm, pad0: 0 })
    }

    /// Appends `norm · Σ (1 − SSIM(m·x, m·y))` over windows and channels (added to running sum
    /// `slot`) and `share` times its derivative (added to `v_x`). Windows are zero-padded beyond
    /// the image.
    ///
    /// # Errors
    /// If sizes exceed 32 bits.
    pub fn encode_ssim(
        &self,
        commands: &mut Commands<'_>,
        (x, y, mask): (DeviceImage<'_>, &wgpu::Buffer, &wgpu::Buffer),
        (norm, share): (f32, f32),
        v_x: DeviceImage<'_>,
        slot: u32,
    ) -> Result<(), GpuError> {
        let context = &self.context;
        let (planes, partials) = (self.planes.get(context)?, self.partials.get(context)?);
        let blocks = self.blocks();
        let per_channel = blocks[0] * blocks[1];
        for channel in 0..self.channels {
            let uniform = ImageLoss {
                channel,
                first_partial: channel * per_channel,
                ..self.uniform(x, v_x, norm * share)?
            };
            let buffers = [x.buffer, y, mask, planes, partials];
            commands.dispatch_groups(&SSIM, &uniform, &buffers, blocks);
            let buffers = [x.buffer, y, mask, planes, v_x.buffer];
            commands.dispatch_groups(&SSIM_BWD, &uniform, &buffers, blocks);
        }
        let num_partials = per_channel * self.channels;
        self.add_up(commands, SumPartials { num_partials, slot, scale: norm, pad0: 0 })
    }

    /// Reads the running sums and sets them to 0. Waits for the device.
    ///
    /// # Errors
    /// If the device fails.
    pub fn take(&mut self) -> Result<Vec<f32>, GpuError> {
        let context = &self.context;
        let losses = self.losses.get(context)?;
        let sums = download(context, Commands::new(context), losses, self.num_slots)?;
        let mut commands = Commands::new(context);
        commands.clear(losses, 4 * self.num_slots as u64);
        commands.submit(&mut CommandMemory::default(), "clearing losses")?;
        Ok(sums)
    }

    /// Masked L1 (with `ssim`, SSIM loss) of host images and its gradient with respect to `x`:
    /// [`ImageLosses::encode_masked_l1`] or [`ImageLosses::encode_ssim`] alone, for callers without
    /// device buffers.
    ///
    /// # Errors
    /// If a length does not fit the size, or the device fails.
    pub fn evaluate(
        &mut self,
        ssim: bool,
        x: &[f32],
        y: &[f32],
        mask: &[f32],
        norm: f32,
    ) -> Result<(f32, Vec<f32>), RasterError> {
        let context = self.context.clone();
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let values = pixels * self.channels as usize;
        for (what, found, expected) in
            [("x", x.len(), values), ("y", y.len(), values), ("mask", mask.len(), pixels)]
        {
            if found != expected {
                return Err(RasterError::Shape { what, found, expected });
            }
        }
        let mut buffers = [(); 4].map(|()| GrowBuffer::storage("images of a loss"));
        for (buffer, values) in buffers.iter_mut().zip([x, y, mask]) {
            buffer.upload(&context, values)?;
        }
        buffers[3].ensure(&context, 4 * values as u64)?;
        let mut staging = GrowBuffer::staging("gradient of a loss");
        staging.ensure(&context, 4 * values as u64)?;
        let [x, y, mask, v_x] = [0, 1, 2, 3].map(|i: usize| buffers[i].get(&context));
        let (x, v_x) =
            (DeviceImage { buffer: x?, first: 0 }, DeviceImage { buffer: v_x?, first: 0 });
        let images = (x, y?, mask?);
        let mut commands = Commands::new(&context);
        if ssim {
            self.encode_ssim(&mut commands, images, (norm, 1.0), v_x, 0)?;
        } else {
            self.encode_masked_l1(&mut commands, images, (norm, 1.0), v_x, 0)?;
        }
        let staging = staging.get(&context)?;
        commands.copy((v_x.buffer, 0), (staging, 0), 4 * values as u64);
        commands.submit(&mut CommandMemory::default(), "loss")?;
        let mut gradient = vec![0.0_f32; values];
        read(&context, staging, "loss", bytemuck::cast_slice_mut(&mut gradient))?;
        Ok((self.take()?[0], gradient))
    }
}
