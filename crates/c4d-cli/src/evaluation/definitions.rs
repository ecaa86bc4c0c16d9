//! What is measured: names, groups, and which way is better.

use crate::failure::{Failure, Outcome};
use c4d_metrics::Better;

/// What metrics are about, in the order in which they are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Group {
    Truth,
    Preservation,
    Time,
    Neural,
    Motion,
    Matches,
    Cost,
}

impl Group {
    pub(crate) const ALL: [Self; 7] = [
        Self::Truth,
        Self::Preservation,
        Self::Time,
        Self::Neural,
        Self::Motion,
        Self::Matches,
        Self::Cost,
    ];

    /// Whether its metrics have a value for each view.
    pub(crate) fn is_of_views(self) -> bool {
        matches!(self, Self::Truth | Self::Preservation | Self::Time | Self::Neural)
    }

    /// As `--metrics` takes it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Truth => "truth",
            Self::Preservation => "preservation",
            Self::Time => "time",
            Self::Neural => "neural",
            Self::Motion => "motion",
            Self::Matches => "matches",
            Self::Cost => "cost",
        }
    }

    /// Above its part of a table.
    pub(crate) fn title(self) -> &'static str {
        match self {
            Self::Truth => "against the truth",
            Self::Preservation => "what the edit keeps and changes",
            Self::Time => "over time",
            Self::Neural => "by neural networks (--weights)",
            Self::Motion => "motion of splats",
            Self::Matches => "matches (diagnostics)",
            Self::Cost => "cost",
        }
    }
}

/// A metric.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Definition {
    pub(crate) id: &'static str,
    pub(crate) group: Group,
    pub(crate) better: Better,
    /// Unit and meaning, in a few words.
    pub(crate) what: &'static str,
}

const fn define(id: &'static str, group: Group, better: Better, what: &'static str) -> Definition {
    Definition { id, group, better, what }
}

use Better::{Higher, Lower, NearOne, NearZero, Neither};
use Group::{Cost, Matches, Motion, Neural, Preservation, Time, Truth};

/// Every metric, in the order in which it is shown.
pub(crate) const DEFINITIONS: [Definition; 71] = [
    define("psnr", Truth, Higher, "dB"),
    define("ssim", Truth, Higher, "zeros beyond the border, as 3DGS"),
    define("ssim_valid", Truth, Higher, "windows inside only, as scikit-image"),
    define("ms_ssim", Truth, Higher, "five scales"),
    define("flip", Truth, Lower, "what a viewer sees, 0 to 1"),
    define("bg_psnr", Preservation, Higher, "dB, outside the edit, against the source"),
    define("bg_ssim", Preservation, Higher, "outside the edit, against the source"),
    define(
        "bg_changed_frac",
        Preservation,
        Lower,
        "share of the background off by more than 2/255",
    ),
    define("edit_strength", Preservation, Neither, "mean change inside the edit, 0 to 1"),
    define("edit_fade", Preservation, NearOne, "strength late over that of the edited frame"),
    define("first_frame_psnr", Preservation, Higher, "dB, edited frame against the edit as given"),
    define("warp_error", Time, Neither, "to the next frame along the source's motion, ×10³"),
    define("warp_error_src", Time, Neither, "the same of the source"),
    define("warp_error_ratio", Time, NearOne, "edit over source; below 1 can be blur"),
    define("warp_error_own", Time, Neither, "to the next frame along the edit's own motion, ×10³"),
    define("warp_error_own_ratio", Time, NearOne, "over the source's along its own"),
    define("warp_error_long", Time, Neither, "to the edited frame along the source's motion, ×10³"),
    define("warp_error_long_src", Time, Neither, "the same of the source"),
    define("warp_error_long_ratio", Time, NearOne, "edit over source"),
    define("temporal_flickering", Time, Neither, "VBench's, 1 for a still video"),
    define("temporal_flickering_src", Time, Neither, "the same of the source"),
    define("flicker_excess", Time, NearZero, "levels of 255 a frame more than the source"),
    define("static_flicker", Time, Neither, "levels of 255, where nothing moves"),
    define("static_flicker_src", Time, Neither, "the same of the source"),
    define("static_flicker_excess", Time, NearZero, "edit minus source"),
    define("motion_fidelity", Time, Lower, "px, flow against the source's, outside the edit"),
    define("motion_fidelity_edit", Time, Lower, "px, inside the edit"),
    define("clip_text_sim", Neural, Higher, "cosine of edited frames and --prompt"),
    define("clip_direction_sim", Neural, Higher, "cosine of the change of frames and of texts"),
    define("clip_frame_consistency", Neural, Neither, "cosine of successive frames"),
    define(
        "clip_direction_consistency",
        Neural,
        Higher,
        "cosine of changes between frames, edit and source",
    ),
    define("vbench_subject_consistency", Neural, Neither, "DINO, to the last and the first frame"),
    define("vbench_subject_consistency_src", Neural, Neither, "the same of the source"),
    define("vbench_background_consistency", Neural, Neither, "CLIP, to the last and first frame"),
    define("vbench_background_consistency_src", Neural, Neither, "the same of the source"),
    define("vbench_consistency", Neural, Neither, "mean of subject and background"),
    define("lpips_alex", Neural, Lower, "perceptual distance, AlexNet"),
    define("lpips_vgg", Neural, Lower, "perceptual distance, VGG-16"),
    define("jitter", Motion, Neither, "second difference of edited splats, in scene radii"),
    define("jitter_src", Motion, Neither, "the same of the nearest source splats"),
    define("jitter_ratio", Motion, NearOne, "edit over source"),
    define("drift", Motion, Lower, "unedited splats against their own motion, in scene radii"),
    define("drift_median", Motion, Lower, "median"),
    define("drift_p95", Motion, Lower, "95th percentile"),
    define("drift_max", Motion, Lower, "largest"),
    define("isometry", Motion, Neither, "change of lengths between edited neighbours"),
    define("isometry_src", Motion, Neither, "the same of the nearest source splats"),
    define("isometry_excess", Motion, NearZero, "edit minus source"),
    define("ndd_edit", Motion, Neither, "neighbourhood distance deviation of edited splats"),
    define("ndd_src", Motion, Neither, "the same of the nearest source splats"),
    define("ndd_excess", Motion, NearZero, "edit minus source"),
    define("scale_blowup", Motion, Lower, "share of splats with an axis 4 times its first"),
    define("nan_count", Motion, Lower, "values that are not finite"),
    define("match_rows", Matches, Neither, "edited splats whose motion is blended"),
    define("match_coverage_edit", Matches, Neither, "share of edited splats, or anchors, matched"),
    define("match_mass", Matches, Neither, "transported mass"),
    define("mean_cost", Matches, Neither, "mean distance of matches, in scene radii"),
    define("entropy_perplexity", Matches, Neither, "source splats that a splat follows"),
    define("argmax_margin", Matches, Neither, "1 where one is followed alone"),
    define("cross_region_rate", Matches, Lower, "share beyond 3 median nearest distances"),
    define("sinkhorn_iters", Matches, Neither, "sweeps of the transport solve"),
    define("marginal_residual", Matches, Neither, "its last residual"),
    define("time_total", Cost, Lower, "s, as recorded when the run was made"),
    define("time_motion", Cost, Lower, "s, the motion stage"),
    define("time_identity", Cost, Lower, "s of it, which splats are the source's"),
    define("time_match", Cost, Lower, "s of it, anchors or regions and their matches"),
    define("time_cuar", Cost, Lower, "s, the refinement"),
    define("time_cuar_images", Cost, Lower, "s of it, its images"),
    define("splats", Cost, Neither, "of the edit"),
    define("splats_src", Cost, Neither, "of the source"),
    define("bytes_run", Cost, Neither, "of scene.c4d"),
];

/// The definitions that a list of ids and groups names, in the order of the table. `core` is
/// everything but the neural metrics, and the default; `all` is everything.
pub(crate) fn chosen(list: &[String]) -> Outcome<Vec<&'static str>> {
    let all = || DEFINITIONS.iter().map(|definition| definition.id);
    let default = ["core".to_owned()];
    let list = if list.is_empty() { &default } else { list };
    let mut ids = Vec::new();
    for name in list {
        let before = ids.len();
        ids.extend(
            DEFINITIONS
                .iter()
                .filter(|d| match name.as_str() {
                    "all" => true,
                    "core" => d.group != Neural,
                    name => d.id == name || d.group.name() == name,
                })
                .map(|d| d.id),
        );
        if ids.len() == before {
            return Err(Failure::usage(format!("--metrics {name}: no such metric or group")).next(
                format!(
                    "Groups: core, all, {}. Metrics: {}.",
                    Group::ALL.map(Group::name).join(", "),
                    all().collect::<Vec<_>>().join(", ")
                ),
            ));
        }
    }
    // In the order of the table, each once.
    Ok(all().filter(|id| ids.contains(id)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_groups_lie_together() {
        for (i, a) in DEFINITIONS.iter().enumerate() {
            assert!(DEFINITIONS[..i].iter().all(|b| a.id != b.id), "{} twice", a.id);
        }
        assert!(DEFINITIONS.is_sorted_by_key(|definition| definition.group), "in order");
    }

    #[test]
    fn lists_name_metrics_and_groups() {
        let list =
            |names: &[&str]| chosen(&names.iter().map(|&n| n.to_owned()).collect::<Vec<_>>());
        assert_eq!(list(&["drift", "psnr"]).unwrap(), ["psnr", "drift"], "in the table's order");
        assert_eq!(list(&["truth"]).unwrap().len(), 5, "a group");
        assert_eq!(list(&["all", "psnr"]).unwrap().len(), DEFINITIONS.len(), "each once");
        assert_eq!(list(&["core"]).unwrap(), list(&[]).unwrap(), "the default");
        assert!(!list(&["core"]).unwrap().contains(&"lpips_alex"), "core needs no weights");
        assert!(list(&["lpips"]).is_err(), "unknown");
    }
}
