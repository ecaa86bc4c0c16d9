//! The kernels: source, entry point, bindings. Bind group layouts and pipelines are built from this
//! table, and a test compares it with the shaders' declarations.

use crate::shaders::{self, WgslSource};

/// Kind of a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Uniform buffer.
    Uniform,
    /// Storage buffer, read only.
    Read,
    /// Storage buffer, read and written.
    Write,
    /// Binding number not used by this kernel.
    None,
}

/// Required device features beyond core WGSL.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeviceFeatures {
    /// Subgroup operations.
    pub subgroups: bool,
    /// Atomic addition of floats.
    pub float_atomics: bool,
}

/// One entry point.
#[derive(Debug)]
pub struct KernelDef {
    /// Name in labels, messages and timings.
    pub name: &'static str,
    /// The joined module.
    pub source: &'static WgslSource,
    /// Name of the entry point.
    pub entry: &'static str,
    /// Bindings of group 0, by number.
    pub bindings: &'static [Access],
    /// Invocations per group.
    pub workgroup_size: u32,
    /// Optional features.
    pub needs: DeviceFeatures,
}

const U: Access = Access::Uniform;
const R: Access = Access::Read;
const W: Access = Access::Write;
const X: Access = Access::None;
const CORE: DeviceFeatures = DeviceFeatures { subgroups: false, float_atomics: false };

macro_rules! kernels {
    ($($id:ident: $source:ident $entry:literal [$($access:ident)*] $size:literal $needs:expr;)+) => {
        /// The kernels; each is an index into [`KERNELS`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs, reason = "each kernel is documented in the header of its shader")]
        pub enum Kernel { $($id,)+ }

        /// All kernels, in the order of [`Kernel`].
        pub static KERNELS: &[KernelDef] = &[$(KernelDef {
            name: stringify!($id),
            source: &shaders::$source,
            entry: $entry,
            bindings: &[$($access),*],
            workgroup_size: $size,
            needs: $needs,
        },)+];
    };
}

const SUBGROUP: DeviceFeatures = DeviceFeatures { subgroups: true, float_atomics: false };
const ATOMIC: DeviceFeatures = DeviceFeatures { subgroups: false, float_atomics: true };
const BOTH: DeviceFeatures = DeviceFeatures { subgroups: true, float_atomics: true };

kernels! {
    Project: PROJECT "project" [U R R R R W W W] 256 CORE;
    Compact: COMPACT "compact" [U R R W W] 256 CORE;
    ScanBlocks: SCAN "scan_blocks" [U W W] 256 CORE;
    ScanAdd: SCAN "scan_add" [U W W] 256 CORE;
    SortCount: SORT_COUNT "sort_count" [U R R W] 256 CORE;
    SortScatter: SORT_SCATTER "sort_scatter" [U R R R R W W] 256 CORE;
    CountTiles: COUNT_TILES "count_tiles" [U R R R W] 256 CORE;
    EmitIsects: EMIT_ISECTS "emit_isects" [U R R R R W W] 256 CORE;
    TileRanges: TILE_RANGES "find_ranges" [U R R R R W W] 256 CORE;
    Shade4: SHADE_4 "shade" [U R R R R W W] 256 CORE;
    Shade8: SHADE_8 "shade" [U R R R R W W] 256 CORE;
    Rasterize4: RASTERIZE_4 "rasterize" [U R R R R W W] 64 CORE;
    Rasterize8: RASTERIZE_8 "rasterize" [U R R R R W W] 64 CORE;
    SumFull4: SUM_FULL_4 "sum_slots" [U R R R W] 256 CORE;
    SumFull8: SUM_FULL_8 "sum_slots" [U R R R W] 256 CORE;
    SumColors4: SUM_COLORS_4 "sum_slots" [U R R R W] 256 CORE;
    SumColors8: SUM_COLORS_8 "sum_slots" [U R R R W] 256 CORE;
    ShadeBwd: SHADE_BWD "shade_bwd" [U R R R R W W W] 256 CORE;
    ProjectBwd: PROJECT_BWD "project_bwd" [U R R R R R R W] 256 CORE;
    Full4SharedSlots: FULL_4_SHARED_SLOTS "main" [U R R R R R R W] 64 CORE;
    Full8SharedSlots: FULL_8_SHARED_SLOTS "main" [U R R R R R R W] 64 CORE;
    Full4SharedAtomic: FULL_4_SHARED_ATOMIC "main" [U R R R R R R W] 64 ATOMIC;
    Full8SharedAtomic: FULL_8_SHARED_ATOMIC "main" [U R R R R R R W] 64 ATOMIC;
    Full4SubgroupSlots: FULL_4_SUBGROUP_SLOTS "main" [U R R R R R R W] 64 SUBGROUP;
    Full8SubgroupSlots: FULL_8_SUBGROUP_SLOTS "main" [U R R R R R R W] 64 SUBGROUP;
    Full4SubgroupAtomic: FULL_4_SUBGROUP_ATOMIC "main" [U R R R R R R W] 64 BOTH;
    Full8SubgroupAtomic: FULL_8_SUBGROUP_ATOMIC "main" [U R R R R R R W] 64 BOTH;
    Colors4SharedSlots: COLORS_4_SHARED_SLOTS "main" [U R R R X R R W] 64 CORE;
    Colors8SharedSlots: COLORS_8_SHARED_SLOTS "main" [U R R R X R R W] 64 CORE;
    Colors4SharedAtomic: COLORS_4_SHARED_ATOMIC "main" [U R R R X R R W] 64 ATOMIC;
    Colors8SharedAtomic: COLORS_8_SHARED_ATOMIC "main" [U R R R X R R W] 64 ATOMIC;
    Colors4SubgroupSlots: COLORS_4_SUBGROUP_SLOTS "main" [U R R R X R R W] 64 SUBGROUP;
    Colors8SubgroupSlots: COLORS_8_SUBGROUP_SLOTS "main" [U R R R X R R W] 64 SUBGROUP;
    Colors4SubgroupAtomic: COLORS_4_SUBGROUP_ATOMIC "main" [U R R R X R R W] 64 BOTH;
    Colors8SubgroupAtomic: COLORS_8_SUBGROUP_ATOMIC "main" [U R R R X R R W] 64 BOTH;
}

impl From<Kernel> for &'static KernelDef {
    fn from(kernel: Kernel) -> Self {
        kernel.def()
    }
}

impl Kernel {
    /// The kernel's row of [`KERNELS`].
    pub fn def(self) -> &'static KernelDef {
        &KERNELS[self as usize]
    }

    /// Shading of 4 or 8 channels.
    pub(crate) fn shade(channels: u32) -> Self {
        if channels == 4 { Self::Shade4 } else { Self::Shade8 }
    }

    /// Compositing of 4 or 8 channels.
    pub(crate) fn rasterize(channels: u32) -> Self {
        if channels == 4 { Self::Rasterize4 } else { Self::Rasterize8 }
    }

    /// Backward over tiles of 4 or 8 channels, with geometry or for the
    /// channels alone, using the features of the device.
    pub(crate) fn rasterize_bwd(channels: u32, geometry: bool, needs: DeviceFeatures) -> Self {
        match (geometry, channels == 4, needs.subgroups, needs.float_atomics) {
            (true, true, false, false) => Self::Full4SharedSlots,
            (true, true, false, true) => Self::Full4SharedAtomic,
            (true, true, true, false) => Self::Full4SubgroupSlots,
            (true, true, true, true) => Self::Full4SubgroupAtomic,
            (true, false, false, false) => Self::Full8SharedSlots,
            (true, false, false, true) => Self::Full8SharedAtomic,
            (true, false, true, false) => Self::Full8SubgroupSlots,
            (true, false, true, true) => Self::Full8SubgroupAtomic,
            (false, true, false, false) => Self::Colors4SharedSlots,
            (false, true, false, true) => Self::Colors4SharedAtomic,
            (false, true, true, false) => Self::Colors4SubgroupSlots,
            (false, true, true, true) => Self::Colors4SubgroupAtomic,
            (false, false, false, false) => Self::Colors8SharedSlots,
            (false, false, false, true) => Self::Colors8SharedAtomic,
            (false, false, true, false) => Self::Colors8SubgroupSlots,
            (false, false, true, true) => Self::Colors8SubgroupAtomic,
        }
    }

    /// Addition of slots after [`Kernel::rasterize_bwd`].
    pub(crate) fn sum_slots(channels: u32, geometry: bool) -> Self {
        match (geometry, channels == 4) {
            (true, true) => Self::SumFull4,
            (true, false) => Self::SumFull8,
            (false, true) => Self::SumColors4,
            (false, false) => Self::SumColors8,
        }
    }
}
