//! Flags of a Swift4D training run, determined by the tensors, `cfg_args` or the user.

use super::network::Params;
use super::settings::Settings;
use crate::cfg_args::{CfgArgs, Value};
use crate::model_folder::{FlagReport, ModelReport, Origin, Swift4dOverrides};
use gs_deform::GridShape;

/// Values of every published configuration.
const PUBLISHED: GridShape = GridShape { levels: 16, features: 4, log2_table: 15, base: 16 };
const DYNAMIC_THRO: f32 = 7.0;
/// Frames of DyNeRF and MeetRoom clips, and the divisor of their times.
const CLIP: u32 = 300;
/// The same for the time windows of VRU scenes.
const VRU_WINDOW: u32 = 20;

/// A value of `cfg_args`. Values that are not literals count as
/// missing, with a warning when the file was read.
fn literal<'a>(cfg: Option<&'a CfgArgs>, name: &str) -> Option<&'a Value> {
    cfg?.get(name).filter(|value| !matches!(value, Value::Other(_)))
}

/// A number: the user's, else the one in `cfg_args`, else a default.
fn number(
    name: &'static str,
    given: Option<u32>,
    cfg: Option<&CfgArgs>,
    default: u32,
) -> Result<(u32, Origin), String> {
    if let Some(value) = given {
        return Ok((value, Origin::Override));
    }
    let Some(value) = literal(cfg, name) else {
        return Ok((default, Origin::Default));
    };
    let number = value.as_u64().and_then(|value| u32::try_from(value).ok());
    let number = number.ok_or_else(|| format!("comes with a cfg_args whose {name} is not a valid number ({value:?}); correct it or override {name}"))?;
    Ok((number, Origin::CfgArgs))
}

/// Resolves all flags except the index rule, and reports them.
pub(super) fn resolve(
    params: &Params<'_>,
    cfg: Option<&CfgArgs>,
    overrides: &Swift4dOverrides,
    report: &mut ModelReport,
) -> Result<Settings, String> {
    let shape = resolve_shape(params, cfg, overrides, report)?;
    let trunk_relu = resolve_activation(cfg, overrides, report)?;
    let (dynamic_thro, origin) = resolve_threshold(cfg, overrides)?;
    push(report, "dynamic_thro", &dynamic_thro, origin);
    let (clip, guess) =
        if is_vru(cfg) { (VRU_WINDOW, Origin::FamilyGuess) } else { (CLIP, Origin::Default) };
    let or_guess = |given: Option<u32>| given.map_or((clip, guess), |n| (n, Origin::Override));
    let (frames, origin) = or_guess(overrides.frames);
    push(report, "frames", &frames, origin);
    let (time_divisor, origin) = or_guess(overrides.time_divisor);
    push(report, "time_divisor", &time_divisor, origin);
    if frames == 0 || time_divisor == 0 || frames - 1 > time_divisor {
        return Err(format!(
            "cannot have {frames} frames at times i/{time_divisor}: the last must not be beyond \
            time 1; correct frames or time_divisor"
        ));
    }
    let stated = cfg.and_then(|cfg| cfg.get("n_neurons")).and_then(Value::as_u64);
    if let Some(stated) = stated.filter(|&stated| stated != params.width() as u64) {
        report.warnings.push(format!(
            "cfg_args has n_neurons {stated}, the network has {}: cfg_args may belong to a different \
            run, check the flags",
            params.width()
        ));
    }
    Ok(Settings {
        shape,
        trunk_relu,
        dynamic_thro,
        frames: frames as usize,
        time_divisor: time_divisor as usize,
    })
}

fn push(report: &mut ModelReport, name: &'static str, value: &dyn ToString, origin: Origin) {
    report.flags.push(FlagReport { name, value: value.to_string(), origin });
}

fn resolve_shape(
    params: &Params<'_>,
    cfg: Option<&CfgArgs>,
    overrides: &Swift4dOverrides,
    report: &mut ModelReport,
) -> Result<GridShape, String> {
    let small = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let (levels, levels_from) =
        number("n_levels", overrides.n_levels, cfg, small(PUBLISHED.levels))?;
    let (features, features_from) = number(
        "n_features_per_level",
        overrides.n_features_per_level,
        cfg,
        small(PUBLISHED.features),
    )?;
    let (base, base_from) =
        number("base_resolution", overrides.base_resolution, cfg, PUBLISHED.base)?;
    let mut shape = GridShape {
        levels: levels as usize,
        features: features as usize,
        log2_table: PUBLISHED.log2_table,
        base,
    };
    shape.check().map_err(|error| error.to_string())?;
    let found = params.encoder_len();
    let (log2_table, mut table_from) =
        number("hashmap_size", overrides.hashmap_size, cfg, PUBLISHED.log2_table)?;
    shape.log2_table = log2_table;
    if table_from == Origin::Default {
        // If it is not stated, the size of the table is inferred from its length.
        let fits = |log2_table: &u32| {
            params.expected_len(&GridShape { log2_table: *log2_table, ..shape }) == found
        };
        if let Some(log2_table) = (3..=30).find(fits) {
            (shape.log2_table, table_from) = (log2_table, Origin::Inferred);
        }
    }
    shape.check().map_err(|error| error.to_string())?;
    if params.expected_len(&shape) != found {
        return Err(format!(
            "has {found} values in `enc_model.params`, but n_levels {levels}, n_features_per_level {features}, hashmap_size {}, base_resolution {base} and {} neurons make {}; cfg_args may be missing or from a different run; set these flags as in training",
            shape.log2_table,
            params.width(),
            params.expected_len(&shape)
        ));
    }
    push(report, "n_levels", &levels, levels_from);
    push(report, "n_features_per_level", &features, features_from);
    push(report, "hashmap_size", &shape.log2_table, table_from);
    push(report, "base_resolution", &base, base_from);
    Ok(shape)
}

fn resolve_activation(
    cfg: Option<&CfgArgs>,
    overrides: &Swift4dOverrides,
    report: &mut ModelReport,
) -> Result<bool, String> {
    let (relu, origin) = match (overrides.trunk_relu, literal(cfg, "activation")) {
        (Some(relu), _) => (relu, Origin::Override),
        (None, Some(Value::None)) => (false, Origin::CfgArgs),
        (None, Some(Value::Str(name))) if name.eq_ignore_ascii_case("none") => {
            (false, Origin::CfgArgs)
        }
        (None, Some(Value::Str(name))) if name.eq_ignore_ascii_case("relu") => {
            (true, Origin::CfgArgs)
        }
        (None, Some(other)) => {
            return Err(format!(
                "was trained with activation {other:?} according to cfg_args, expected ReLU or None"
            ));
        }
        (None, None) => {
            return Err(
                "does not record whether its trunk ends in a ReLU, and there is no cfg_args; set \
                activation=none for coffee_martini, vrheadset, trimming and basketball, \
                activation=relu for the other published scenes, or the other value if the motion \
                looks torn apart"
                    .to_owned(),
            );
        }
    };
    push(report, "activation", &if relu { "relu" } else { "none" }, origin);
    Ok(relu)
}

fn resolve_threshold(
    cfg: Option<&CfgArgs>,
    overrides: &Swift4dOverrides,
) -> Result<(f32, Origin), String> {
    let (threshold, origin) = match (overrides.dynamic_thro, literal(cfg, "dynamic_thro")) {
        (Some(value), _) => (value, Origin::Override),
        (None, Some(value)) => {
            let number = value.as_f64().ok_or_else(|| format!("comes with a cfg_args whose dynamic_thro is not a number ({value:?}); correct it or override dynamic_thro"))?;
            #[expect(clippy::cast_possible_truncation, reason = "scores are single precision")]
            let single = number as f32;
            (single, Origin::CfgArgs)
        }
        (None, None) => (DYNAMIC_THRO, Origin::Default),
    };
    if threshold.is_nan() {
        return Err("has a dynamic_thro that is not a number; set dynamic_thro".to_owned());
    }
    Ok((threshold, origin))
}

/// Whether the configuration or the data belong to the VRU data
/// set, whose times are scaled differently.
fn is_vru(cfg: Option<&CfgArgs>) -> bool {
    ["configs", "source_path", "expname"].iter().any(|key| {
        cfg.and_then(|cfg| cfg.get(key))
            .and_then(Value::as_str)
            .is_some_and(|text| text.to_ascii_lowercase().contains("vru"))
    })
}
