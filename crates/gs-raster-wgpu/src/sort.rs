//! Stable radix sort of (key, value) pairs on the device.

use crate::buffers::GrowBuffer;
use crate::commands::Commands;
use crate::kernels::Kernel;
use crate::layout::{RADIX, SORT_BLOCK, Sort};
use crate::scan::ScanMemory;
use crate::{GpuContext, GpuError};

const DIGIT_BITS: u32 = RADIX.trailing_zeros();

/// Input of a sort. The number of items is known only on the device.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SortJob<'a> {
    /// Buffer that contains the number of items.
    pub counts: &'a wgpu::Buffer,
    /// Index of the number of items in `counts`.
    pub count_index: u32,
    /// Capacity, items.
    pub max_items: u32,
    /// Number of low key bits to sort by.
    pub bits: u32,
    /// Whether the values are the positions 0, 1, 2, …, which need no buffer.
    pub iota: bool,
}

/// Keys and values, twice, and histograms.
#[derive(Debug)]
pub(crate) struct SortMemory {
    pub keys: [GrowBuffer; 2],
    pub values: [GrowBuffer; 2],
    digit_counts: GrowBuffer,
    scan: ScanMemory,
}

impl SortMemory {
    pub(crate) fn new(keys: &'static str, values: &'static str) -> Self {
        Self {
            keys: [GrowBuffer::storage(keys), GrowBuffer::storage(keys)],
            values: [GrowBuffer::storage(values), GrowBuffer::storage(values)],
            digit_counts: GrowBuffer::storage("sort histograms"),
            scan: ScanMemory::default(),
        }
    }

    /// Ensures capacity for `max_items` pairs.
    pub(crate) fn ensure(&mut self, context: &GpuContext, max_items: u32) -> Result<(), GpuError> {
        for buffer in self.keys.iter_mut().chain(&mut self.values) {
            buffer.ensure(context, 4 * u64::from(max_items))?;
        }
        let counts = u64::from(max_items.div_ceil(SORT_BLOCK)) * u64::from(RADIX);
        self.digit_counts.ensure(context, 4 * counts)?;
        self.scan.ensure(context, counts)
    }

    /// Sorts `keys[0]` and `values[0]`; returns the index of the buffers with the result.
    pub(crate) fn encode(
        &self,
        context: &GpuContext,
        commands: &mut Commands<'_>,
        job: SortJob<'_>,
    ) -> Result<usize, GpuError> {
        let num_blocks = job.max_items.div_ceil(SORT_BLOCK);
        let items = u64::from(job.max_items);
        let digit_counts = self.digit_counts.get(context)?;
        let mut source = 0;
        for digit in 0..job.bits.div_ceil(DIGIT_BITS) {
            let uniform = Sort {
                shift: digit * DIGIT_BITS,
                num_blocks,
                count_index: job.count_index,
                max_items: job.max_items,
                iota: u32::from(job.iota && digit == 0),
                ..Sort::default()
            };
            let keys = [self.keys[source].get(context)?, self.keys[1 - source].get(context)?];
            let values = [self.values[source].get(context)?, self.values[1 - source].get(context)?];
            let buffers = [job.counts, keys[0], digit_counts];
            commands.dispatch(Kernel::SortCount, &uniform, &buffers, items, SORT_BLOCK)?;
            self.scan.encode(context, commands, digit_counts, num_blocks * RADIX)?;
            let buffers = [job.counts, keys[0], values[0], digit_counts, keys[1], values[1]];
            commands.dispatch(Kernel::SortScatter, &uniform, &buffers, items, SORT_BLOCK)?;
            source = 1 - source;
        }
        Ok(source)
    }
}
