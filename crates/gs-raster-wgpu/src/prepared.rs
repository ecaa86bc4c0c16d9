//! [`GpuPrepared`]: geometry projected for one camera, and the device memory of every stage.

use crate::buffers::GrowBuffer;
use crate::channel_passes::{Channels, camera_frame, to_u32};
use crate::commands::{CommandMemory, Commands, PassTiming};
use crate::kernels::Kernel;
use crate::layout::{Frame, GROUP_SIZE};
use crate::scan::ScanMemory;
use crate::sort::{SortJob, SortMemory};
use crate::{GpuContext, GpuError};
use gs_core::{Camera, RasterError, Splats};

/// Initial capacity for (splat, tile) pairs, per splat; it grows when a frame needs more.
const FIRST_ISECTS_PER_SPLAT: usize = 4;
const LEAST_ISECTS: usize = 4096;
/// Largest number of splats whose parameters can be indexed with 32 bits.
const MAX_SPLATS: usize = 1 << 28;

/// Geometry projected for one camera, on the device, and the memory of every later stage.
///
/// Reusable while means, quaternions, log-scales and camera are
/// unchanged; the tile lists are valid for every opacity.
#[derive(Debug)]
pub struct GpuPrepared {
    /// The device that owns the memory.
    context: GpuContext,
    pub(crate) frame: Frame,
    pub(crate) num_splats: usize,
    /// Whether the lists on the device are out of date; the next submission rebuilds them.
    pub(crate) stale: bool,
    pub(crate) max_isects: u32,
    /// Pairs of the last submission.
    pub(crate) num_isects: u32,
    /// The last forward pass, for its backward pass.
    pub(crate) forward: Option<Forward>,
    /// The appearance that is on the device.
    pub(crate) resident: Option<Forward>,
    pub(crate) timings: Vec<PassTiming>,
    pub(crate) memory: DeviceMemory,
}

/// Channels and degree of a forward pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Forward {
    pub channels: Channels,
    pub sh_degree: usize,
}

/// Device buffers.
#[derive(Debug)]
pub(crate) struct DeviceMemory {
    pub commands: CommandMemory,
    pub means: GrowBuffer,
    pub quats: GrowBuffer,
    pub log_scales: GrowBuffer,
    pub opacity_logits: GrowBuffer,
    pub sh: Vec<GrowBuffer>,
    pub features: GrowBuffer,
    pub projected: GrowBuffer,
    pub rects: GrowBuffer,
    /// Flags, then their prefix sum; the last entry is the number of visible splats.
    pub visible: GrowBuffer,
    pub depth_sort: SortMemory,
    pub depth_result: usize,
    /// Tile counts by depth rank, then their prefix sum; the last entry is the number of pairs.
    pub isect_offsets: GrowBuffer,
    pub tile_sort: SortMemory,
    pub isect_splats: GrowBuffer,
    pub entries: GrowBuffer,
    pub tile_ranges: GrowBuffer,
    pub scan: ScanMemory,
    pub colors: Vec<GrowBuffer>,
    pub image: GrowBuffer,
    pub pixel_states: GrowBuffer,
    pub counts_staging: GrowBuffer,
    pub image_staging: GrowBuffer,
    pub v_image: GrowBuffer,
    pub slots: GrowBuffer,
    pub splat_grads: GrowBuffer,
    pub v_params: GrowBuffer,
    pub v_sh: Vec<GrowBuffer>,
    pub v_features: GrowBuffer,
    pub v_params_staging: GrowBuffer,
    pub v_sh_staging: Vec<GrowBuffer>,
    pub v_features_staging: GrowBuffer,
}

impl Default for DeviceMemory {
    fn default() -> Self {
        let storage = GrowBuffer::storage;
        Self {
            commands: CommandMemory::default(),
            means: storage("means"),
            quats: storage("quaternions"),
            log_scales: storage("log-scales"),
            opacity_logits: storage("opacities"),
            sh: Vec::new(),
            features: storage("features"),
            projected: storage("projected splats"),
            rects: storage("tile rectangles"),
            visible: storage("visibility"),
            depth_sort: SortMemory::new("depth keys", "splat ids"),
            depth_result: 0,
            isect_offsets: storage("tile counts"),
            tile_sort: SortMemory::new("tile keys", "pair slots"),
            isect_splats: storage("splats of pairs"),
            entries: storage("tile lists"),
            tile_ranges: storage("tile ranges"),
            scan: ScanMemory::default(),
            colors: Vec::new(),
            image: storage("image"),
            pixel_states: storage("transmittances"),
            counts_staging: GrowBuffer::staging("counts, for reading"),
            image_staging: GrowBuffer::staging("image, for reading"),
            v_image: storage("upstream gradients"),
            slots: storage("gradients of pairs"),
            splat_grads: storage("gradients of projected splats"),
            v_params: storage("gradients of geometry"),
            v_sh: Vec::new(),
            v_features: storage("gradients of features"),
            v_params_staging: GrowBuffer::staging("gradients of geometry, for reading"),
            v_sh_staging: Vec::new(),
            v_features_staging: GrowBuffer::staging("gradients of features, for reading"),
        }
    }
}

impl GpuPrepared {
    pub(crate) fn new(context: GpuContext) -> Self {
        Self {
            context,
            frame: Frame::default(),
            num_splats: 0,
            stale: true,
            max_isects: 0,
            num_isects: 0,
            forward: None,
            resident: None,
            timings: Vec::new(),
            memory: DeviceMemory::default(),
        }
    }

    /// Fails if the memory belongs to a different device.
    pub(crate) fn check_owner(&self, context: &GpuContext) -> Result<(), GpuError> {
        if self.context.is(context) {
            return Ok(());
        }
        Err(context.failed("preparation", "the prepared state belongs to a different device"))
    }

    /// Image size `[W, H]`, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.frame.img_size
    }

    /// Number of splats passed to `prepare`.
    pub fn num_splats(&self) -> usize {
        self.num_splats
    }

    /// Pixels of the image.
    pub(crate) fn num_pixels(&self) -> usize {
        self.frame.img_size.map(|side| side as usize).iter().product()
    }

    /// Uploads geometry; the next submission builds the lists. After an error there are no splats.
    pub(crate) fn update(
        &mut self,
        context: &GpuContext,
        splats: &Splats,
        camera: &Camera,
    ) -> Result<(), RasterError> {
        camera.check()?;
        splats.check_shapes()?;
        let num_splats = splats.len();
        if num_splats > MAX_SPLATS {
            let message = format!("{num_splats} splats, expected at most {MAX_SPLATS}");
            return Err(RasterError::Device(message));
        }
        if !self.context.is(context) {
            *self = Self::new(context.clone());
        }
        let resident = self.resident.filter(|_| self.num_splats == num_splats);
        self.clear();
        let m = &mut self.memory;
        m.means.upload(context, &splats.means)?;
        m.quats.upload(context, &splats.quats)?;
        m.log_scales.upload(context, &splats.log_scales)?;
        m.opacity_logits.upload(context, &splats.opacity_logits)?;
        self.num_splats = num_splats;
        self.resident = resident;
        Ok(self.set_camera(context, camera)?)
    }

    /// Removes the splats but keeps the memory.
    fn clear(&mut self) {
        self.num_splats = 0;
        self.frame.num_splats = 0;
        self.stale = true;
        self.forward = None;
        self.resident = None;
    }

    /// Sets the camera for the splats on the device; the next submission builds
    /// the lists. After an error there are no splats.
    pub(crate) fn set_camera(
        &mut self,
        context: &GpuContext,
        camera: &Camera,
    ) -> Result<(), GpuError> {
        let result = self.allocate(context, camera);
        if result.is_err() {
            self.clear();
        }
        result
    }

    fn allocate(&mut self, context: &GpuContext, camera: &Camera) -> Result<(), GpuError> {
        self.stale = true;
        self.forward = None;
        let num_splats = self.num_splats;
        let mut frame = camera_frame(camera, to_u32(num_splats));
        // The number of pairs of the last frame predicts that of the next one to within a quarter.
        let guess = to_u32((num_splats * FIRST_ISECTS_PER_SPLAT).max(LEAST_ISECTS));
        let last = self.num_isects.saturating_add(self.num_isects / 4);
        self.max_isects = guess.max(last).min(max_isects(context));
        frame.max_isects = self.max_isects;
        self.frame = frame;

        let m = &mut self.memory;
        let rows = num_splats as u64;
        m.projected.ensure(context, 32 * rows)?;
        m.rects.ensure(context, 8 * rows)?;
        m.visible.ensure(context, 4 * (rows + 1))?;
        m.isect_offsets.ensure(context, 4 * (rows + 1))?;
        m.scan.ensure(context, rows + 1)?;
        m.depth_sort.ensure(context, to_u32(num_splats))?;
        let tiles = u64::from(frame.tile_bounds[0]) * u64::from(frame.tile_bounds[1]);
        m.tile_ranges.ensure(context, 8 * tiles)?;
        m.counts_staging.ensure(context, 8)?;
        self.ensure_isects(context)
    }

    fn ensure_isects(&mut self, context: &GpuContext) -> Result<(), GpuError> {
        let m = &mut self.memory;
        m.tile_sort.ensure(context, self.max_isects)?;
        m.isect_splats.ensure(context, 4 * u64::from(self.max_isects))?;
        m.entries.ensure(context, 8 * u64::from(self.max_isects))?;
        Ok(())
    }

    /// Ensures capacity for `needed` pairs.
    pub(crate) fn grow_isects(
        &mut self,
        context: &GpuContext,
        needed: u32,
    ) -> Result<(), GpuError> {
        let allowed = max_isects(context);
        if needed > allowed {
            // This count does not predict that of the next frame.
            self.num_isects = 0;
            let many = if needed == u32::MAX { "at least " } else { "" };
            let limit =
                format!("allows: {many}{needed} (splat, tile) pairs, expected at most {allowed}");
            return Err(context.memory_error("tile lists", 8 * u64::from(needed), limit));
        }
        // A quarter more, so that the lists do not grow every frame while the camera moves.
        self.max_isects = needed.saturating_add(needed / 4).min(allowed);
        self.frame.max_isects = self.max_isects;
        self.stale = true;
        self.ensure_isects(context)
    }

    /// Appends project → compact → depth sort → pairs → tile sort → ranges.
    pub(crate) fn encode_prepare(
        &mut self,
        context: &GpuContext,
        commands: &mut Commands<'_>,
    ) -> Result<(), GpuError> {
        let (frame, rows) = (self.frame, self.num_splats as u64);
        let num_splats = frame.num_splats;
        let m = &self.memory;
        let (projected, rects) = (m.projected.get(context)?, m.rects.get(context)?);
        let visible = m.visible.get(context)?;
        let inputs = [&m.means, &m.quats, &m.log_scales, &m.opacity_logits];
        let mut buffers = Vec::with_capacity(7);
        for input in inputs {
            buffers.push(input.get(context)?);
        }
        buffers.extend([projected, rects, visible]);
        commands.dispatch(Kernel::Project, &frame, &buffers, rows + 1, GROUP_SIZE)?;
        m.scan.encode(context, commands, visible, num_splats + 1)?;

        let sort = &m.depth_sort;
        let buffers =
            [visible, projected, sort.keys[0].get(context)?, sort.values[0].get(context)?];
        commands.dispatch(Kernel::Compact, &frame, &buffers, rows, GROUP_SIZE)?;
        let job = SortJob {
            counts: visible,
            count_index: num_splats,
            max_items: num_splats,
            bits: 32,
            iota: false,
        };
        let depth_result = sort.encode(context, commands, job)?;
        let splat_ids = sort.values[depth_result].get(context)?;

        let offsets = m.isect_offsets.get(context)?;
        let buffers = [visible, splat_ids, rects, offsets];
        commands.dispatch(Kernel::CountTiles, &frame, &buffers, rows + 1, GROUP_SIZE)?;
        m.scan.encode(context, commands, offsets, num_splats + 1)?;

        let sort = &m.tile_sort;
        let isect_splats = m.isect_splats.get(context)?;
        let pairs = u64::from(self.max_isects);
        let keys = sort.keys[0].get(context)?;
        let buffers = [offsets, splat_ids, rects, projected, keys, isect_splats];
        commands.dispatch(Kernel::EmitIsects, &frame, &buffers, pairs, GROUP_SIZE)?;
        let tiles = frame.tile_bounds[0] * frame.tile_bounds[1];
        // The number of tiles is itself a key: that of pairs that cannot draw.
        let bits = u32::BITS - tiles.leading_zeros();
        let job = SortJob {
            counts: offsets,
            count_index: num_splats,
            max_items: self.max_isects,
            bits,
            iota: true,
        };
        let result = sort.encode(context, commands, job)?;
        let ranges = m.tile_ranges.get(context)?;
        commands.clear(ranges, 8 * u64::from(tiles));
        let (keys, slots) = (sort.keys[result].get(context)?, sort.values[result].get(context)?);
        let buffers = [offsets, keys, slots, isect_splats, m.entries.get(context)?, ranges];
        commands.dispatch(Kernel::TileRanges, &frame, &buffers, pairs, GROUP_SIZE)?;
        self.memory.depth_result = depth_result;
        Ok(())
    }

    /// Appends the copy of the counts that [`GpuPrepared::check_room`] reads.
    pub(crate) fn encode_counts(
        &self,
        context: &GpuContext,
        commands: &mut Commands<'_>,
    ) -> Result<(), GpuError> {
        let at = 4 * self.num_splats as u64;
        let staging = self.memory.counts_staging.get(context)?;
        commands.copy((self.memory.visible.get(context)?, at), (staging, 0), 4);
        commands.copy((self.memory.isect_offsets.get(context)?, at), (staging, 4), 4);
        Ok(())
    }

    /// Whether all pairs of the last submission fit. If not, grows the
    /// lists; the caller then repeats the submission.
    pub(crate) fn check_room(&mut self, context: &GpuContext) -> Result<bool, GpuError> {
        let mut counts = [0_u32; 2];
        let staging = self.memory.counts_staging.get(context)?;
        crate::commands::read(context, staging, "counting", bytemuck::bytes_of_mut(&mut counts))?;
        self.num_isects = counts[1];
        if self.num_isects > self.max_isects {
            self.grow_isects(context, self.num_isects)?;
            return Ok(false);
        }
        self.stale = false;
        Ok(true)
    }
}

/// Largest number of (splat, tile) pairs: each list is one binding.
fn max_isects(context: &GpuContext) -> u32 {
    u32::try_from(context.max_binding_bytes() / 8).unwrap_or(u32::MAX - 1).min(1 << 30)
}
