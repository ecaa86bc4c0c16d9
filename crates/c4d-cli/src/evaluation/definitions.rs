//! Definitions of the metrics: name, group, and preferred direction.

use crate::failure::{Failure, Outcome};
use c4d_metrics::Better;

/// Groups of metrics, in display order.
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

    /// Name in `--metrics`.
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

    /// Heading in a table.
    pub(crate) fn title(self) -> &'static str {
        match self {
            Self::Truth => "against ground truth",
            Self::Preservation => "preservation and strength of the edit",
            Self::Time => "temporal consistency",
            Self::Neural => "neural networks (--weights)",
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
    /// Unit and short description, at most 60 characters.
    pub(crate) what: &'static str,
}

const fn define(id: &'static str, group: Group, better: Better, what: &'static str) -> Definition {
    Definition { id, group, better, what }
}

use Better::{Higher, Lower, NearOne, NearZero, Neither};
use Group::{Cost, Matches, Motion, Neural, Preservation, Time, Truth};

/// All metrics, in display order.
pub(crate) const DEFINITIONS: [Definition; 71] = [
    define("psnr", Truth, Higher, "dB, against the ground truth"),
    define("ssim", Truth, Higher, "against the ground truth, zero padding, as in 3DGS"),
    define("ssim_valid", Truth, Higher, "against the ground truth, windows inside the image"),
    define("ms_ssim", Truth, Higher, "against the ground truth, five scales"),
    define("flip", Truth, Lower, "perceived difference from the ground truth, 0 to 1"),
    define("bg_psnr", Preservation, Higher, "dB, against the source, outside the edit"),
    define("bg_ssim", Preservation, Higher, "against the source, outside the edit"),
    define(
        "bg_changed_frac",
        Preservation,
        Lower,
        "share of background pixels that differ by more than 2/255",
    ),
    define("edit_strength", Preservation, Neither, "mean absolute change inside the edit, 0 to 1"),
    define(
        "edit_fade",
        Preservation,
        NearOne,
        "ratio of edit_strength: last quarter to edited frame",
    ),
    define(
        "first_frame_psnr",
        Preservation,
        Higher,
        "dB, edited frame of the run against the given edit",
    ),
    define("warp_error", Time, Neither, "×10³, successive frames along the source's flow"),
    define("warp_error_src", Time, Neither, "×10³, warp_error of the source"),
    define(
        "warp_error_ratio",
        Time,
        NearOne,
        "warp_error over the source's; below 1 can mean blur",
    ),
    define("warp_error_own", Time, Neither, "×10³, successive frames along the edit's own flow"),
    define("warp_error_own_ratio", Time, NearOne, "warp_error_own over warp_error_src"),
    define(
        "warp_error_long",
        Time,
        Neither,
        "×10³, edited frame to each frame along the source's flow",
    ),
    define("warp_error_long_src", Time, Neither, "×10³, warp_error_long of the source"),
    define("warp_error_long_ratio", Time, NearOne, "warp_error_long over the source's"),
    define("temporal_flickering", Time, Neither, "VBench score, 0 to 1; 1 for a still video"),
    define("temporal_flickering_src", Time, Neither, "temporal_flickering of the source, 0 to 1"),
    define("flicker_excess", Time, NearZero, "change per frame minus the source's, levels of 255"),
    define("static_flicker", Time, Neither, "standard deviation of static pixels, levels of 255"),
    define("static_flicker_src", Time, Neither, "static_flicker of the source, levels of 255"),
    define(
        "static_flicker_excess",
        Time,
        NearZero,
        "static_flicker minus the source's, levels of 255",
    ),
    define(
        "motion_fidelity",
        Time,
        Lower,
        "px, rendered flow against the source's, outside the edit",
    ),
    define(
        "motion_fidelity_edit",
        Time,
        Lower,
        "px, rendered flow against the source's, inside the edit",
    ),
    define("clip_text_sim", Neural, Higher, "cosine between edited frames and --prompt"),
    define(
        "clip_direction_sim",
        Neural,
        Higher,
        "cosine between change of frames and change of texts",
    ),
    define("clip_frame_consistency", Neural, Neither, "cosine between successive frames"),
    define(
        "clip_direction_consistency",
        Neural,
        Higher,
        "cosine between frame-to-frame changes of edit and source",
    ),
    define(
        "vbench_subject_consistency",
        Neural,
        Neither,
        "DINO similarity to previous and first frame, 0 to 1",
    ),
    define(
        "vbench_subject_consistency_src",
        Neural,
        Neither,
        "subject consistency of the source, 0 to 1",
    ),
    define(
        "vbench_background_consistency",
        Neural,
        Neither,
        "CLIP similarity to previous and first frame, 0 to 1",
    ),
    define(
        "vbench_background_consistency_src",
        Neural,
        Neither,
        "background consistency of the source, 0 to 1",
    ),
    define(
        "vbench_consistency",
        Neural,
        Neither,
        "mean of subject and background consistency, 0 to 1",
    ),
    define("lpips_alex", Neural, Lower, "perceptual distance to the ground truth, AlexNet"),
    define("lpips_vgg", Neural, Lower, "perceptual distance to the ground truth, VGG-16"),
    define("jitter", Motion, Neither, "mean second difference of edited splats, scene radii"),
    define("jitter_src", Motion, Neither, "jitter of the nearest source splats, scene radii"),
    define("jitter_ratio", Motion, NearOne, "jitter over the source's"),
    define("drift", Motion, Lower, "mean motion error of unedited splats, scene radii"),
    define("drift_median", Motion, Lower, "median motion error of unedited splats, scene radii"),
    define("drift_p95", Motion, Lower, "95th percentile of drift over splats, scene radii"),
    define("drift_max", Motion, Lower, "largest motion error of unedited splats, scene radii"),
    define("isometry", Motion, Neither, "relative change of distances between edited neighbours"),
    define("isometry_src", Motion, Neither, "isometry of the nearest source splats"),
    define("isometry_excess", Motion, NearZero, "isometry minus the source's"),
    define("ndd_edit", Motion, Neither, "neighbourhood distance deviation of edited splats"),
    define("ndd_src", Motion, Neither, "neighbourhood distance deviation, nearest source splats"),
    define("ndd_excess", Motion, NearZero, "ndd_edit minus ndd_src"),
    define(
        "scale_blowup",
        Motion,
        Lower,
        "share of splats with an axis over 4 times its first length",
    ),
    define("nan_count", Motion, Lower, "number of non-finite values"),
    define("match_rows", Matches, Neither, "number of edited splats with blended motion"),
    define(
        "match_coverage_edit",
        Matches,
        Neither,
        "share of edited splats or anchors with a match",
    ),
    define("match_mass", Matches, Neither, "total transported mass"),
    define("mean_cost", Matches, Neither, "mean distance between matches, scene radii"),
    define(
        "entropy_perplexity",
        Matches,
        Neither,
        "effective number of source splats per edited splat",
    ),
    define("argmax_margin", Matches, Neither, "margin of the best match; 1 if it is the only one"),
    define(
        "cross_region_rate",
        Matches,
        Lower,
        "share of matches beyond 3 median nearest distances",
    ),
    define("sinkhorn_iters", Matches, Neither, "number of sweeps of the transport solver"),
    define("marginal_residual", Matches, Neither, "last residual of the transport solver"),
    define("time_total", Cost, Lower, "s, total, as recorded when the run was made"),
    define("time_motion", Cost, Lower, "s, motion stage"),
    define("time_identity", Cost, Lower, "s, finding unedited splats (part of time_motion)"),
    define("time_match", Cost, Lower, "s, anchors or regions and matching (part of time_motion)"),
    define("time_cuar", Cost, Lower, "s, refinement"),
    define("time_cuar_images", Cost, Lower, "s, images of the refinement (part of time_cuar)"),
    define("splats", Cost, Neither, "number of splats of the edited scene"),
    define("splats_src", Cost, Neither, "number of splats of the source"),
    define("bytes_run", Cost, Neither, "bytes, size of scene.c4d"),
];

/// Ids of the metrics in a list of ids and groups, in the order of the table. `core`, the default,
/// is every metric except the neural ones; `all` is every metric.
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
