//! Device memory of [`crate::DeviceDescent`].

use crate::kernels::Entry;
use cuar::DescentImage;
use gs_raster_wgpu::device::GrowBuffer;
use gs_raster_wgpu::{GpuContext, GpuError};

/// Rows of the offsets that fit a binding.
#[derive(Debug)]
pub(crate) struct Run {
    pub first_row: usize,
    pub rows: usize,
    pub d_sh: GrowBuffer,
    pub v_sh: GrowBuffer,
}

/// Targets of a render.
#[derive(Debug)]
pub(crate) struct DeviceTargets {
    pub original: GrowBuffer,
    pub warp: GrowBuffer,
    pub flags: GrowBuffer,
    pub entries: GrowBuffer,
    /// Whether any pixel is [`DescentImage::FORE`] or [`DescentImage::BACK`].
    pub uses: [bool; 2],
}

impl Default for DeviceTargets {
    fn default() -> Self {
        let [original, warp, flags, entries] =
            ["originals", "targets", "flags", "edited splats"].map(GrowBuffer::storage);
        Self { original, warp, flags, entries, uses: [false; 2] }
    }
}

impl DeviceTargets {
    /// Bytes on the device.
    pub(crate) fn bytes(image: &DescentImage) -> usize {
        4 * (image.original.len() + image.warp.len())
            + image.flags.len()
            + size_of::<Entry>() * image.entries.len()
    }

    pub(crate) fn upload(
        &mut self,
        context: &GpuContext,
        image: &DescentImage,
    ) -> Result<(), GpuError> {
        self.original.upload(context, image.original)?;
        self.warp.upload(context, image.warp)?;
        let mut flags = image.flags.to_vec();
        flags.resize(flags.len().next_multiple_of(4), 0);
        self.flags.upload(context, &flags)?;
        let entry = |entry: &cuar::Entry| Entry {
            towards: entry.towards,
            splat: entry.local,
            color: entry.color,
            row: entry.row,
        };
        let entries: Vec<Entry> = image.entries.iter().map(entry).collect();
        self.entries.upload(context, &entries)?;
        self.uses = [DescentImage::FORE, DescentImage::BACK]
            .map(|bit| image.flags.iter().any(|flags| flags & bit != 0));
        Ok(())
    }
}

/// Memory of a step.
#[derive(Debug)]
pub(crate) struct StepBuffers {
    pub changes: GrowBuffer,
    pub render: GrowBuffer,
    pub v_render: GrowBuffer,
    pub fore: GrowBuffer,
    pub back: GrowBuffer,
    /// Number of pixels of the last step.
    pub pixels: usize,
}

impl StepBuffers {
    pub(crate) fn new() -> Self {
        let [changes, render, v_render, fore, back] =
            ["changes of colour", "crop", "gradient of a crop", "foreground", "background"]
                .map(GrowBuffer::storage);
        Self { changes, render, v_render, fore, back, pixels: 0 }
    }

    /// Makes room for a crop of `pixels` and as many entries.
    pub(crate) fn ensure(
        &mut self,
        context: &GpuContext,
        pixels: usize,
        entries: usize,
    ) -> Result<(), GpuError> {
        self.pixels = pixels;
        self.changes.ensure(context, (12 * entries) as u64)?;
        for plane in [&mut self.render, &mut self.v_render] {
            plane.ensure(context, (12 * pixels) as u64)?;
        }
        for mask in [&mut self.fore, &mut self.back] {
            mask.ensure(context, (4 * pixels) as u64)?;
        }
        Ok(())
    }
}
