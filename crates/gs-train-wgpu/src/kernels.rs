//! The kernels and the structs passed to them; a test compares both with the shaders.

use cuar::DescentImage;
use gs_raster_wgpu::gpu_struct;
use gs_raster_wgpu::kernels::{Access, DeviceFeatures, KernelDef};
use gs_raster_wgpu::layout::{Constant, GpuLayout, StructField};
use gs_raster_wgpu::shaders::WgslSource;

gpu_struct! {
    /// Uniforms of an image loss; see `shaders/train/image_loss.wgsl`.
    ImageLoss {
        /// Width and height, pixels.
        img_size: [u32; 2],
        /// C.
        num_channels: u32,
        /// Channel of this dispatch.
        channel: u32,
        /// First value of the image in its buffer.
        x_base: u32,
        /// First value of its gradient.
        v_base: u32,
        /// Index of the first partial sum of this dispatch.
        first_partial: u32,
        /// Weight of the gradient.
        factor: f32,
    }
}

gpu_struct! {
    /// Uniforms of `sum_partials`.
    SumPartials {
        /// Sums to add.
        num_partials: u32,
        /// Index of the running sum.
        slot: u32,
        /// Factor.
        scale: f32,
        /// Unused.
        pad0: u32,
    }
}

gpu_struct! {
    /// Uniforms of a step of Adam; see `shaders/train/adam.wgsl`.
    AdamStep {
        /// Values.
        num_values: u32,
        /// Values per row.
        columns: u32,
        /// First value of the gradient in its buffer.
        first_grad: u32,
        /// Flag of the first row.
        first_row: u32,
        /// 1 if rows can be skipped.
        skips: u32,
        /// Decay of the first moment.
        beta1: f32,
        /// Decay of the second moment.
        beta2: f32,
        /// 1 − `beta1`.
        rest1: f32,
        /// 1 − `beta2`.
        rest2: f32,
        /// 1 − `beta1`^step.
        correct1: f32,
        /// 1 − `beta2`^step.
        correct2: f32,
        /// Added to the root of the second moment.
        epsilon: f32,
    }
}

gpu_struct! {
    /// Uniforms of the passes over entries; see `shaders/train/offsets.wgsl`.
    Offsets {
        /// Entries.
        num_entries: u32,
        /// Degree of the offsets.
        sh_degree: u32,
        /// First row of the offsets of this dispatch.
        first_row: u32,
        /// Rows of the offsets of this dispatch.
        num_rows: u32,
    }
}

gpu_struct! {
    /// An edited splat in an image.
    Entry {
        /// Unit vector from the camera, world frame.
        towards: [f32; 3],
        /// Row among the image's splats.
        splat: u32,
        /// Colour without offsets, not clamped.
        color: [f32; 3],
        /// Row of the offsets.
        row: u32,
    }
}

gpu_struct! {
    /// Uniforms of the passes over a crop; see `shaders/train/crop.wgsl`.
    Crop {
        /// Width and height of the whole image, pixels.
        img_size: [u32; 2],
        /// First column and row of the crop.
        origin: [u32; 2],
        /// Its width and height, pixels.
        size: [u32; 2],
        /// First value of the change of colour among the planes of the whole image.
        features_base: u32,
        /// Unused.
        pad0: u32,
    }
}

/// Every struct that a binding of a shader may have: name, size, fields.
pub const LAYOUTS: &[(&str, usize, &[StructField])] = &[
    (ImageLoss::NAME, ImageLoss::SIZE, ImageLoss::FIELDS),
    (SumPartials::NAME, SumPartials::SIZE, SumPartials::FIELDS),
    (AdamStep::NAME, AdamStep::SIZE, AdamStep::FIELDS),
    (Offsets::NAME, Offsets::SIZE, Offsets::FIELDS),
    (Entry::NAME, Entry::SIZE, Entry::FIELDS),
    (Crop::NAME, Crop::SIZE, Crop::FIELDS),
];

/// Side of a block of windows, pixels.
pub const BLOCK: u32 = 16;
/// Invocations of a group.
pub const GROUP_SIZE: u32 = gs_raster_wgpu::layout::GROUP_SIZE;

/// Every constant that exists in Rust and in WGSL.
pub const CONSTANTS: &[(&str, Constant)] = &[
    ("BLOCK", Constant::Uint(BLOCK)),
    ("GROUP_SIZE", Constant::Uint(GROUP_SIZE)),
    ("FORE", Constant::Uint(DescentImage::FORE as u32)),
    ("BACK", Constant::Uint(DescentImage::BACK as u32)),
    ("LIVE", Constant::Uint(DescentImage::LIVE as u32)),
];

macro_rules! part {
    ($name:literal) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name))
    };
}

const U: Access = Access::Uniform;
const R: Access = Access::Read;
const W: Access = Access::Write;

macro_rules! kernels {
    ($($(#[$meta:meta])* $id:ident: $entry:literal [$($access:ident)*] = [$($name:literal),+];)+) => {
        $($(#[$meta])* pub static $id: KernelDef = KernelDef {
            name: $entry,
            source: &WgslSource {
                parts: &[$(($name, part!($name))),+],
                text: concat!($(part!($name)),+),
            },
            entry: $entry,
            bindings: &[$($access),*],
            workgroup_size: GROUP_SIZE,
            needs: DeviceFeatures { subgroups: false, float_atomics: false },
        };)+

        /// All kernels.
        pub static KERNELS: &[&KernelDef] = &[$(&$id),+];
    };
}

kernels! {
    /// Masked L1 and its gradient.
    MASKED_L1: "masked_l1" [U R R R W W] = ["shared/dispatch.wgsl", "train/image_loss.wgsl", "train/group_sum.wgsl", "train/masked_l1.wgsl"];
    /// SSIM per window.
    SSIM: "ssim" [U R R R W W] = ["shared/dispatch.wgsl", "train/image_loss.wgsl", "train/group_sum.wgsl", "train/window.wgsl", "train/ssim.wgsl"];
    /// Gradient of SSIM.
    SSIM_BWD: "ssim_bwd" [U R R R R W] = ["shared/dispatch.wgsl", "train/image_loss.wgsl", "train/window.wgsl", "train/ssim_bwd.wgsl"];
    /// Sum of the groups' sums.
    SUM_PARTIALS: "sum_partials" [U R W] = ["shared/dispatch.wgsl", "train/group_sum.wgsl", "train/sum_partials.wgsl"];
    /// Colours under offsets of harmonics.
    CHANGE_COLORS: "change_colors" [U R R W W] = ["shared/dispatch.wgsl", "shared/sh.wgsl", "train/offsets.wgsl", "train/change_colors.wgsl"];
    /// Gradient of the offsets.
    CHANGE_COLORS_BWD: "change_colors_bwd" [U R R R W] = ["shared/dispatch.wgsl", "shared/sh.wgsl", "train/offsets.wgsl", "train/change_colors_bwd.wgsl"];
    /// Render of a crop.
    COMPOSE: "compose" [U R R R W W W] = ["shared/dispatch.wgsl", "train/crop.wgsl", "train/compose.wgsl"];
    /// Gradient of the planes.
    COMPOSE_BWD: "compose_bwd" [U R R W] = ["shared/dispatch.wgsl", "train/crop.wgsl", "train/compose_bwd.wgsl"];
    /// One step of Adam.
    ADAM: "adam_step" [U R R R W W W] = ["shared/dispatch.wgsl", "train/adam.wgsl"];
}
