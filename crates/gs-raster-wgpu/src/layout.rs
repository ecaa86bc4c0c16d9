//! Structs shared with the device, declared once together with the
//! table that a test compares with the shaders.

/// Name, offset and size of a field, bytes.
pub type StructField = (&'static str, usize, usize);

/// Layout of a struct in memory.
pub trait GpuLayout {
    /// Name of the struct, the same in WGSL.
    const NAME: &'static str;
    /// Size, bytes.
    const SIZE: usize;
    /// Name, offset and size of every field, bytes.
    const FIELDS: &'static [StructField];
}

/// Declares a plain struct and its [`GpuLayout`]; needs `bytemuck` with `derive`.
#[macro_export]
macro_rules! gpu_struct {
    ($(#[$meta:meta])* $name:ident { $($(#[$field_meta:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }

        impl $crate::layout::GpuLayout for $name {
            const NAME: &'static str = stringify!($name);
            const SIZE: usize = size_of::<Self>();
            const FIELDS: &'static [$crate::layout::StructField] =
                &[$((stringify!($field), std::mem::offset_of!($name, $field), size_of::<$kind>()),)*];
        }
    };
}

gpu_struct! {
    /// Uniforms of a frame; see `shaders/shared/frame.wgsl`.
    Frame {
        /// First row of the world-to-camera matrix for points relative to `camera_pos`; the last
        /// entry is the remaining translation (rounding error of `camera_pos`).
        view0: [f32; 4],
        /// Second row.
        view1: [f32; 4],
        /// Third row.
        view2: [f32; 4],
        /// Camera centre, world units.
        camera_pos: [f32; 3],
        /// Degree of the harmonics.
        sh_degree: u32,
        /// Background colour.
        background: [f32; 3],
        /// 1 for the true derivative, 0 for the reference's.
        exact_gradients: u32,
        /// Focal lengths, pixels.
        focal: [f32; 2],
        /// Principal point minus half the image, pixels.
        center_offset: [f32; 2],
        /// Guard band, tangents.
        guard: [f32; 2],
        /// Width and height, pixels.
        img_size: [u32; 2],
        /// Tiles per row and column.
        tile_bounds: [u32; 2],
        /// `N`, number of splats.
        num_splats: u32,
        /// Capacity, (splat, tile) pairs.
        max_isects: u32,
        /// 1 if colour is composited.
        rgb: u32,
        /// 1 if depth is composited.
        depth: u32,
        /// `F`, features per splat.
        num_features: u32,
        /// Values per row of the gradients of projected quantities.
        grad_stride: u32,
        /// First value of the alpha plane.
        alpha_base: u32,
        /// First value of the depth plane.
        depth_base: u32,
        /// First value of the feature plane.
        features_base: u32,
        /// First channel of this dispatch.
        first_channel: u32,
        /// First splat of this dispatch.
        first_splat: u32,
        /// Splats of this dispatch.
        num_chunk_splats: u32,
        /// First pair whose gradient is kept by this dispatch.
        first_slot: u32,
        /// Pairs whose gradients are kept by this dispatch.
        num_slots: u32,
        /// Near plane, world units.
        near: f32,
        /// Added to the depth in the perspective divide, world units.
        divide: f32,
        /// Unused.
        pad0: u32,
        /// Unused.
        pad1: u32,
    }
}

gpu_struct! {
    /// Uniforms of a prefix sum.
    Scan {
        /// Number of values.
        num_items: u32,
        /// Unused.
        pad0: u32,
        /// Unused.
        pad1: u32,
        /// Unused.
        pad2: u32,
    }
}

gpu_struct! {
    /// Uniforms of one digit of the radix sort.
    Sort {
        /// Lowest bit of the digit.
        shift: u32,
        /// Blocks of keys.
        num_blocks: u32,
        /// Index of the number of items in the counts.
        count_index: u32,
        /// Capacity, items.
        max_items: u32,
        /// 1 if the values are the positions 0, 1, 2, ….
        iota: u32,
        /// Unused.
        pad0: u32,
        /// Unused.
        pad1: u32,
        /// Unused.
        pad2: u32,
    }
}

gpu_struct! {
    /// Channels of a splat in a pass of 4.
    Color4 {
        /// The four channels.
        a: [f32; 4],
    }
}

gpu_struct! {
    /// Channels of a splat in a pass of 8.
    Color8 {
        /// The first four.
        a: [f32; 4],
        /// The last four.
        b: [f32; 4],
    }
}

/// Every struct that a uniform or storage binding of a shader may have: name, size, fields.
pub const LAYOUTS: &[(&str, usize, &[StructField])] = &[
    (Frame::NAME, Frame::SIZE, Frame::FIELDS),
    (Scan::NAME, Scan::SIZE, Scan::FIELDS),
    (Sort::NAME, Sort::SIZE, Sort::FIELDS),
    (Color4::NAME, Color4::SIZE, Color4::FIELDS),
    (Color8::NAME, Color8::SIZE, Color8::FIELDS),
];

/// Invocations per group in passes over splats or pairs.
pub const GROUP_SIZE: u32 = 256;
/// Invocations per group in passes over tiles.
pub const TILE_LANES: u32 = 64;
/// Largest number of groups along one dimension of a dispatch.
pub const FOLD: u32 = 65_535;
/// Values per block of the prefix sum.
pub const SCAN_BLOCK: u32 = 1024;
/// Keys per block of the sort.
pub const SORT_BLOCK: u32 = 2048;
/// Number of values of one digit of the sort.
pub const RADIX: u32 = 256;

/// Value of a constant that exists in Rust and in WGSL.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constant {
    /// `u32`.
    Uint(u32),
    /// `f32`.
    Float(f32),
}

/// Every constant that exists in Rust and in WGSL, under the same name, besides those of the image
/// formation ([`gs_core::image_formation::CONSTANTS`]).
pub const CONSTANTS: &[(&str, Constant)] = &[
    ("GROUP_SIZE", Constant::Uint(GROUP_SIZE)),
    ("TILE_LANES", Constant::Uint(TILE_LANES)),
    ("FOLD", Constant::Uint(FOLD)),
    ("SCAN_BLOCK", Constant::Uint(SCAN_BLOCK)),
    ("SORT_BLOCK", Constant::Uint(SORT_BLOCK)),
    ("RADIX", Constant::Uint(RADIX)),
];
