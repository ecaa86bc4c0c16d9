//! [`DeviceAdam`]: moments of one group of parameters, on the device.

use crate::kernels::{ADAM, AdamStep, GROUP_SIZE};
use gs_core::RasterError;
use gs_raster_wgpu::device::{Commands, GrowBuffer, download};
use gs_raster_wgpu::{GpuContext, GpuError};

/// Rows of parameters on the device, 32-bit floats. Parameters larger than a binding are split into
/// several slices.
#[derive(Debug, Clone, Copy)]
pub struct ParameterSlice<'a> {
    /// `[rows, columns]`, from the start of the buffer.
    pub values: &'a wgpu::Buffer,
    /// Gradients of the parameters.
    pub grads: &'a wgpu::Buffer,
    /// First value of the gradients in their buffer.
    pub first_grad: usize,
    /// Number of the first row.
    pub first_row: usize,
    /// Number of rows.
    pub rows: usize,
    /// Values per row.
    pub columns: usize,
}

/// Adam over rows of parameters, with a rate per column; rows can be skipped. Conventions as in
/// `cuar::Adam`.
#[derive(Debug)]
pub struct DeviceAdam {
    /// Decay of the first moment. Default 0.9.
    pub beta1: f32,
    /// Decay of the second moment. Default 0.999.
    pub beta2: f32,
    /// Added to the root of the second moment. Default 1e-15, as in 3DGS.
    pub epsilon: f32,
    /// Number of steps so far.
    pub step: u32,
    context: GpuContext,
    rates: GrowBuffer,
    columns: usize,
    /// First and second moments of each slice of the group, and its number of values.
    moments: Vec<([GrowBuffer; 2], u64)>,
}

impl DeviceAdam {
    /// Zero moments; `rates` has one learning rate per column.
    ///
    /// # Errors
    /// If the device has too little memory.
    pub fn new(context: &GpuContext, rates: &[f32]) -> Result<Self, GpuError> {
        let mut own = Self {
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-15,
            step: 0,
            context: context.clone(),
            rates: GrowBuffer::storage("rates"),
            columns: rates.len(),
            moments: Vec::new(),
        };
        own.rates.upload(context, rates)?;
        Ok(own)
    }

    /// Appends one step along the negative gradients of `slices`, which must be the same at every
    /// call. `skip` has a flag per splat; rows whose flag is not 0 are unchanged, bit for bit.
    ///
    /// # Errors
    /// If the shape of a slice differs from that of the step before, or the device has too little
    /// memory.
    pub fn encode(
        &mut self,
        commands: &mut Commands<'_>,
        slices: &[ParameterSlice<'_>],
        skip: Option<&wgpu::Buffer>,
    ) -> Result<(), RasterError> {
        let context = &self.context;
        let wrong = |what, found, expected| Err(RasterError::Shape { what, found, expected });
        if self.moments.is_empty() {
            for slice in slices {
                let num_values = (slice.rows * slice.columns) as u64;
                let mut moments = [(); 2].map(|()| GrowBuffer::storage("moments"));
                for moment in &mut moments {
                    moment.ensure(context, 4 * num_values)?;
                }
                self.moments.push((moments, num_values));
            }
        }
        if self.moments.len() != slices.len() {
            return wrong("parameter slices", slices.len(), self.moments.len());
        }
        self.step += 1;
        let exponent = i32::try_from(self.step).unwrap_or(i32::MAX);
        for (slice, (moments, num_values)) in slices.iter().zip(&self.moments) {
            let found = slice.rows * slice.columns;
            if found as u64 != *num_values || slice.columns != self.columns {
                return wrong("parameters", found, usize::try_from(*num_values).unwrap_or(0));
            }
            let index = |value: usize| u32::try_from(value).unwrap_or(u32::MAX);
            let uniform = AdamStep {
                num_values: index(found),
                columns: index(slice.columns),
                first_grad: index(slice.first_grad),
                first_row: index(slice.first_row),
                skips: u32::from(skip.is_some()),
                beta1: self.beta1,
                beta2: self.beta2,
                rest1: 1.0 - self.beta1,
                rest2: 1.0 - self.beta2,
                correct1: 1.0 - self.beta1.powi(exponent),
                correct2: 1.0 - self.beta2.powi(exponent),
                epsilon: self.epsilon,
            };
            let rates = self.rates.get(context)?;
            let (m, v) = (moments[0].get(context)?, moments[1].get(context)?);
            let buffers = [slice.grads, rates, skip.unwrap_or(rates), slice.values, m, v];
            commands.dispatch(&ADAM, &uniform, &buffers, *num_values, GROUP_SIZE)?;
        }
        Ok(())
    }

    /// Restores the state after `step` steps with these first and second moments: slices of
    /// `lengths` values, concatenated.
    ///
    /// # Errors
    /// If the lengths are inconsistent, or the device has too little memory.
    pub fn restore(
        &mut self,
        step: u32,
        lengths: &[usize],
        moments: [&[f32]; 2],
    ) -> Result<(), RasterError> {
        let expected = lengths.iter().sum();
        for own in moments {
            if own.len() != expected {
                return Err(RasterError::Shape { what: "moments", found: own.len(), expected });
            }
        }
        self.step = step;
        self.moments.clear();
        let mut first = 0;
        for &length in lengths {
            let mut buffers = [(); 2].map(|()| GrowBuffer::storage("moments"));
            for (buffer, values) in buffers.iter_mut().zip(moments) {
                buffer.upload(&self.context, &values[first..first + length])?;
            }
            self.moments.push((buffers, length as u64));
            first += length;
        }
        Ok(())
    }

    /// First and second moments, slices concatenated; empty before the first step. Waits for the
    /// device.
    ///
    /// # Errors
    /// If the device fails.
    pub fn moments(&self) -> Result<[Vec<f32>; 2], GpuError> {
        let mut out = [Vec::new(), Vec::new()];
        for (moments, num_values) in &self.moments {
            for (moment, out) in moments.iter().zip(&mut out) {
                let (context, items) = (&self.context, usize::try_from(*num_values).unwrap_or(0));
                let values: Vec<f32> =
                    download(context, Commands::new(context), moment.get(context)?, items)?;
                out.extend_from_slice(&values);
            }
        }
        Ok(out)
    }
}
