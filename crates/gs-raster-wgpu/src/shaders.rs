//! The concatenated WGSL sources. The only file that includes them.

/// A shader module: its parts and their concatenation. WGSL allows declarations in any order, so
/// concatenation is sufficient as an import system.
#[derive(Debug)]
pub struct WgslSource {
    /// File name in `shaders/` and text of every part.
    pub parts: &'static [(&'static str, &'static str)],
    /// The concatenated parts.
    pub text: &'static str,
}

impl WgslSource {
    /// File and line (from 1) of line `line` (from 1) of the joined text.
    pub fn locate(&self, line: usize) -> (&'static str, usize) {
        let mut before = 0;
        for (name, text) in self.parts {
            let lines = text.lines().count();
            if line <= before + lines {
                return (name, line - before);
            }
            before += lines;
        }
        ("end of the shader", line - before)
    }
}

macro_rules! part {
    ($name:literal) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name))
    };
}

macro_rules! sources {
    ($($(#[$meta:meta])* $id:ident = [$($name:literal),+ $(,)?];)+) => {
        $($(#[$meta])* pub static $id: WgslSource = WgslSource {
            parts: &[$(($name, part!($name))),+],
            text: concat!($(part!($name)),+),
        };)+
    };
}

sources! {
    /// Project, cull, bound.
    PROJECT = ["shared/dispatch.wgsl", "shared/frame.wgsl", "shared/activation.wgsl", "shared/projection.wgsl", "project.wgsl"];
    /// Gather visible splats.
    COMPACT = ["shared/dispatch.wgsl", "shared/frame.wgsl", "compact_visible.wgsl"];
    /// Prefix sum.
    SCAN = ["shared/dispatch.wgsl", "scan.wgsl"];
    /// Histogram of a digit.
    SORT_COUNT = ["shared/dispatch.wgsl", "shared/sort.wgsl", "sort_count.wgsl"];
    /// Scatter by a digit.
    SORT_SCATTER = ["shared/dispatch.wgsl", "shared/sort.wgsl", "sort_scatter.wgsl"];
    /// Tiles per splat.
    COUNT_TILES = ["shared/dispatch.wgsl", "shared/frame.wgsl", "count_tiles.wgsl"];
    /// (Splat, tile) pairs.
    EMIT_ISECTS = ["shared/dispatch.wgsl", "shared/frame.wgsl", "emit_isects.wgsl"];
    /// Pairs of each tile.
    TILE_RANGES = ["shared/dispatch.wgsl", "shared/frame.wgsl", "tile_ranges.wgsl"];
    /// Opacity and channels, 4 at once.
    SHADE_4 = ["shared/dispatch.wgsl", "shared/frame.wgsl", "shared/activation.wgsl", "shared/sh.wgsl", "variants/channels_4.wgsl", "shade.wgsl"];
    /// Opacity and channels, 8 at once.
    SHADE_8 = ["shared/dispatch.wgsl", "shared/frame.wgsl", "shared/activation.wgsl", "shared/sh.wgsl", "variants/channels_8.wgsl", "shade.wgsl"];
    /// Composite, 4 channels.
    RASTERIZE_4 = ["shared/frame.wgsl", "shared/tile.wgsl", "variants/channels_4.wgsl", "rasterize.wgsl"];
    /// Composite, 8 channels.
    RASTERIZE_8 = ["shared/frame.wgsl", "shared/tile.wgsl", "variants/channels_8.wgsl", "rasterize.wgsl"];
    /// Add slots, full backward, 4 channels.
    SUM_FULL_4 = ["shared/dispatch.wgsl", "shared/frame.wgsl", "variants/channels_4.wgsl", "variants/backward_full.wgsl", "sum_slots.wgsl"];
    /// Add slots, full backward, 8 channels.
    SUM_FULL_8 = ["shared/dispatch.wgsl", "shared/frame.wgsl", "variants/channels_8.wgsl", "variants/backward_full.wgsl", "sum_slots.wgsl"];
    /// Add slots, channels alone, 4 of them.
    SUM_COLORS_4 = ["shared/dispatch.wgsl", "shared/frame.wgsl", "variants/channels_4.wgsl", "variants/backward_colors.wgsl", "sum_slots.wgsl"];
    /// Add slots, channels alone, 8 of them.
    SUM_COLORS_8 = ["shared/dispatch.wgsl", "shared/frame.wgsl", "variants/channels_8.wgsl", "variants/backward_colors.wgsl", "sum_slots.wgsl"];
    /// Backward of shading.
    SHADE_BWD = ["shared/dispatch.wgsl", "shared/frame.wgsl", "shared/sh.wgsl", "shade_bwd.wgsl"];
    /// Backward of projection.
    PROJECT_BWD = ["shared/dispatch.wgsl", "shared/frame.wgsl", "shared/activation.wgsl", "shared/projection.wgsl", "project_bwd.wgsl"];
}

/// A backward pass over tiles with its chosen variants.
macro_rules! tile_backward {
    ($($id:ident = $body:literal $scope:literal $channels:literal $sum:literal $sink:literal $entry:literal;)+) => {
        sources! { $(
            /// Backward over tiles; see the parts.
            $id = ["shared/frame.wgsl", "shared/tile.wgsl", $channels, $scope, $sum, $sink, "shared/tile_backward.wgsl", $body, $entry];
        )+ }
    };
}

tile_backward! {
    FULL_4_SHARED_SLOTS = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_4.wgsl" "variants/sum_shared.wgsl" "variants/sink_slots.wgsl" "variants/entry_shared.wgsl";
    FULL_8_SHARED_SLOTS = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_8.wgsl" "variants/sum_shared.wgsl" "variants/sink_slots.wgsl" "variants/entry_shared.wgsl";
    FULL_4_SHARED_ATOMIC = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_4.wgsl" "variants/sum_shared.wgsl" "variants/sink_atomic.wgsl" "variants/entry_shared.wgsl";
    FULL_8_SHARED_ATOMIC = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_8.wgsl" "variants/sum_shared.wgsl" "variants/sink_atomic.wgsl" "variants/entry_shared.wgsl";
    FULL_4_SUBGROUP_SLOTS = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_4.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_slots.wgsl" "variants/entry_subgroup.wgsl";
    FULL_8_SUBGROUP_SLOTS = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_8.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_slots.wgsl" "variants/entry_subgroup.wgsl";
    FULL_4_SUBGROUP_ATOMIC = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_4.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_atomic.wgsl" "variants/entry_subgroup.wgsl";
    FULL_8_SUBGROUP_ATOMIC = "rasterize_bwd.wgsl" "variants/backward_full.wgsl" "variants/channels_8.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_atomic.wgsl" "variants/entry_subgroup.wgsl";
    COLORS_4_SHARED_SLOTS = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_4.wgsl" "variants/sum_shared.wgsl" "variants/sink_slots.wgsl" "variants/entry_shared.wgsl";
    COLORS_8_SHARED_SLOTS = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_8.wgsl" "variants/sum_shared.wgsl" "variants/sink_slots.wgsl" "variants/entry_shared.wgsl";
    COLORS_4_SHARED_ATOMIC = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_4.wgsl" "variants/sum_shared.wgsl" "variants/sink_atomic.wgsl" "variants/entry_shared.wgsl";
    COLORS_8_SHARED_ATOMIC = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_8.wgsl" "variants/sum_shared.wgsl" "variants/sink_atomic.wgsl" "variants/entry_shared.wgsl";
    COLORS_4_SUBGROUP_SLOTS = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_4.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_slots.wgsl" "variants/entry_subgroup.wgsl";
    COLORS_8_SUBGROUP_SLOTS = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_8.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_slots.wgsl" "variants/entry_subgroup.wgsl";
    COLORS_4_SUBGROUP_ATOMIC = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_4.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_atomic.wgsl" "variants/entry_subgroup.wgsl";
    COLORS_8_SUBGROUP_ATOMIC = "rasterize_colors_bwd.wgsl" "variants/backward_colors.wgsl" "variants/channels_8.wgsl" "variants/sum_subgroup.wgsl" "variants/sink_atomic.wgsl" "variants/entry_subgroup.wgsl";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_located() {
        let first = SCAN.parts[0].1.lines().count();
        assert_eq!(SCAN.locate(1), ("shared/dispatch.wgsl", 1), "first line");
        assert_eq!(SCAN.locate(first + 2), ("scan.wgsl", 2), "second part");
    }
}
