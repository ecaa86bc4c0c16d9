//! The building blocks as separate functions: prefix sum and
//! stable sort of host slices on the device.

use crate::buffers::GrowBuffer;
use crate::commands::{CommandMemory, Commands, read};
use crate::scan::ScanMemory;
use crate::sort::{SortJob, SortMemory};
use crate::{GpuContext, GpuError};

/// Largest number of values for which every index fits 32 bits.
const MAX_ITEMS: usize = 1 << 30;

fn count(context: &GpuContext, items: usize) -> Result<u32, GpuError> {
    let fitting = u32::try_from(items).ok().filter(|_| items <= MAX_ITEMS);
    fitting
        .ok_or_else(|| context.failed("counting", format!("{items} values, expected at most 2^30")))
}

/// Copies the start of `buffer` to the host, after `commands`. Waits for the device.
///
/// # Errors
/// If the device fails or has too little memory.
pub fn download<T: bytemuck::Pod>(
    context: &GpuContext,
    mut commands: Commands<'_>,
    buffer: &wgpu::Buffer,
    items: usize,
) -> Result<Vec<T>, GpuError> {
    let mut values = vec![T::zeroed(); items];
    let bytes = size_of_val(values.as_slice()) as u64;
    let mut staging = GrowBuffer::staging("download");
    let staging = staging.ensure(context, bytes)?;
    commands.copy((buffer, 0), (staging, 0), bytes);
    commands.submit(&mut CommandMemory::default(), "download")?;
    read(context, staging, "download", bytemuck::cast_slice_mut(&mut values))?;
    Ok(values)
}

impl GpuContext {
    /// Exclusive prefix sum; sums beyond 32 bits saturate.
    ///
    /// # Errors
    /// If the device fails or has too little memory.
    pub fn exclusive_scan(&self, values: &[u32]) -> Result<Vec<u32>, GpuError> {
        let num_items = count(self, values.len())?;
        let mut buffer = GrowBuffer::storage("prefix sum");
        buffer.upload(self, values)?;
        let mut memory = ScanMemory::default();
        memory.ensure(self, u64::from(num_items))?;
        let mut commands = Commands::new(self);
        memory.encode(self, &mut commands, buffer.get(self)?, num_items)?;
        download(self, commands, buffer.get(self)?, values.len())
    }

    /// Sorts pairs by the lowest `bits` bits of their keys, keeping the order of equal ones.
    ///
    /// # Errors
    /// If the device fails or has too little memory, or the lengths differ.
    pub fn sort_pairs(
        &self,
        keys: &[u32],
        values: &[u32],
        bits: u32,
    ) -> Result<(Vec<u32>, Vec<u32>), GpuError> {
        if keys.len() != values.len() {
            let message = format!("{} values for {} keys", values.len(), keys.len());
            return Err(self.failed("sort", message));
        }
        let max_items = count(self, keys.len())?;
        let mut memory = SortMemory::new("sort keys", "sort values");
        memory.ensure(self, max_items)?;
        memory.keys[0].upload(self, keys)?;
        memory.values[0].upload(self, values)?;
        let mut counts = GrowBuffer::storage("number of items");
        counts.upload(self, &[max_items])?;
        let mut commands = Commands::new(self);
        let counts = counts.get(self)?;
        let job = SortJob { counts, count_index: 0, max_items, bits: bits.min(32), iota: false };
        let result = memory.encode(self, &mut commands, job)?;
        let keys_out = download(self, commands, memory.keys[result].get(self)?, keys.len())?;
        let commands = Commands::new(self);
        let values_out = download(self, commands, memory.values[result].get(self)?, values.len())?;
        Ok((keys_out, values_out))
    }
}
