//! Prefix sum of any length on the device.

use crate::buffers::GrowBuffer;
use crate::commands::Commands;
use crate::kernels::Kernel;
use crate::layout::{SCAN_BLOCK, Scan};
use crate::{GpuContext, GpuError};

/// Block totals, level by level.
#[derive(Debug, Default)]
pub(crate) struct ScanMemory {
    levels: Vec<GrowBuffer>,
}

impl ScanMemory {
    /// Ensures capacity for a scan of `num_items` values.
    pub(crate) fn ensure(&mut self, context: &GpuContext, num_items: u64) -> Result<(), GpuError> {
        let mut blocks = num_items.div_ceil(u64::from(SCAN_BLOCK)).max(1);
        let mut level = 0;
        loop {
            if self.levels.len() == level {
                self.levels.push(GrowBuffer::storage("totals of a prefix sum"));
            }
            self.levels[level].ensure(context, 4 * blocks)?;
            if blocks == 1 {
                return Ok(());
            }
            blocks = blocks.div_ceil(u64::from(SCAN_BLOCK));
            level += 1;
        }
    }

    /// Replaces `values` by their exclusive prefix sum; sums beyond 32 bits saturate.
    pub(crate) fn encode(
        &self,
        context: &GpuContext,
        commands: &mut Commands<'_>,
        values: &wgpu::Buffer,
        num_items: u32,
    ) -> Result<(), GpuError> {
        self.encode_level(context, commands, values, num_items, 0)
    }

    fn encode_level(
        &self,
        context: &GpuContext,
        commands: &mut Commands<'_>,
        values: &wgpu::Buffer,
        num_items: u32,
        level: usize,
    ) -> Result<(), GpuError> {
        let totals = self.levels[level].get(context)?;
        let uniform = Scan { num_items, ..Scan::default() };
        let items = u64::from(num_items);
        commands.dispatch(Kernel::ScanBlocks, &uniform, &[values, totals], items, SCAN_BLOCK)?;
        let blocks = num_items.div_ceil(SCAN_BLOCK);
        if blocks > 1 {
            self.encode_level(context, commands, totals, blocks, level + 1)?;
            commands.dispatch(Kernel::ScanAdd, &uniform, &[values, totals], items, SCAN_BLOCK)?;
        }
        Ok(())
    }
}
