//! `--set` and `--iteration` as overrides of a model folder.

use crate::args::{AxesArg, Global};
use crate::failure::{Failure, Outcome};
use clap::ValueEnum;
use gs_deform::IndexRule;
use gs_io::model_folder::Overrides;
use gs_io::repair::Damage;
use gs_io::{Axes, SceneKind, SourceOptions};

const FLAGS_4DGS: &str = "Flags of 4DGaussians models: no_dx, no_ds, no_dr, no_do, no_dshs, apply_rotation (true or false) and grid_pe (a number).";
const FLAGS_SWIFT4D: &str = "Flags of Swift4D models: activation (relu or none), index_rule (current or older), dynamic_thro, frames, time_divisor, n_levels, n_features_per_level, hashmap_size and base_resolution (numbers).";

/// What damaged rows do.
pub(crate) fn damage(global: &Global) -> Damage {
    if global.strict { Damage::Fail } else { Damage::Drop }
}

const FLAGS_SEQUENCE: &str = "Flags of sequences: axes (ply, rub or luf), of SPZ and glTF files.";

/// Axes of the files of a sequence, as the user decided.
pub(crate) fn sequence_axes(global: &Global) -> Outcome<Option<Axes>> {
    let mut chosen = None;
    for setting in &global.set {
        let value = setting.strip_prefix("axes=");
        let axes =
            value.and_then(|value| AxesArg::from_str(value, true).ok()).ok_or_else(|| {
                Failure::usage(format!("--set {setting}: no such flag of a sequence"))
                    .next(FLAGS_SEQUENCE)
            })?;
        chosen = Some(axes.axes());
    }
    Ok(chosen)
}

/// What the user decided about a model of this kind.
pub(crate) fn overrides(global: &Global, kind: &SceneKind) -> Outcome<Overrides> {
    let mut overrides =
        Overrides { iteration: global.iteration, damage: damage(global), ..Overrides::default() };
    let swift4d = *kind == SceneKind::Swift4d;
    for setting in &global.set {
        let set = |overrides: &mut Overrides| {
            let (name, value) = setting.split_once('=').ok_or("expected FLAG=VALUE")?;
            if swift4d {
                set_swift4d(overrides, name, value)
            } else {
                set_4dgs(overrides, name, value)
            }
        };
        set(&mut overrides).map_err(|what| {
            Failure::usage(format!("--set {setting}: {what}")).next(if swift4d {
                FLAGS_SWIFT4D
            } else {
                FLAGS_4DGS
            })
        })?;
    }
    Ok(overrides)
}

const FLAGS_OTHERS: &str = "Flags of other trained scenes: time_duration=START,END for native 4D Gaussians, in the unit of training (0,10 for Neural 3D Video, 0,1 for D-NeRF); bound (a number) for Grid4D and DASH without cfg_args.";

/// What the user decided about a trained scene of another kind.
pub(crate) fn source_options(global: &Global, kind: &SceneKind) -> Outcome<SourceOptions> {
    let mut options = SourceOptions {
        iteration: global.iteration,
        damage: damage(global),
        ..SourceOptions::default()
    };
    for setting in &global.set {
        set_source(&mut options, kind, setting).map_err(|what| {
            Failure::usage(format!("--set {setting}: {what}")).next(FLAGS_OTHERS)
        })?;
    }
    Ok(options)
}

fn set_source(
    options: &mut SourceOptions,
    kind: &SceneKind,
    setting: &str,
) -> Result<(), &'static str> {
    let (name, value) = setting.split_once('=').ok_or("expected FLAG=VALUE")?;
    match (kind, name) {
        (SceneKind::Gaussian4d, "time_duration") => {
            let wrong = "expected START,END, two numbers, the second larger";
            let (start, end) = value.split_once(',').ok_or(wrong)?;
            let parse = |text: &str| text.trim().parse::<f64>().map_err(|_not_a_number| wrong);
            let (start, end) = (parse(start)?, parse(end)?);
            if !(start.is_finite() && end.is_finite() && start < end) {
                return Err(wrong);
            }
            options.time_duration = Some([start, end]);
            Ok(())
        }
        (SceneKind::Grid4d | SceneKind::Dash, "bound") => {
            let wrong = "expected a positive number";
            let bound = value.parse::<f32>().map_err(|_not_a_number| wrong)?;
            if !(bound.is_finite() && bound > 0.0) {
                return Err(wrong);
            }
            options.bound = Some(bound);
            Ok(())
        }
        _ => Err("no such flag of this kind of scene"),
    }
}

fn number<T: std::str::FromStr>(value: &str) -> Result<Option<T>, &'static str> {
    value.parse().map(Some).map_err(|_not_a_number| "expected a number")
}

fn set_4dgs(overrides: &mut Overrides, name: &str, value: &str) -> Result<(), &'static str> {
    if name == "grid_pe" {
        overrides.grid_pe = number(value)?;
        return Ok(());
    }
    let flag = match value {
        "true" | "True" | "1" => true,
        "false" | "False" | "0" => false,
        _ => return Err("expected true or false"),
    };
    let slot = match name {
        "no_dx" => &mut overrides.no_dx,
        "no_ds" => &mut overrides.no_ds,
        "no_dr" => &mut overrides.no_dr,
        "no_do" => &mut overrides.no_do,
        "no_dshs" => &mut overrides.no_dshs,
        "apply_rotation" => &mut overrides.apply_rotation,
        _ => return Err("no such flag"),
    };
    *slot = Some(flag);
    Ok(())
}

fn set_swift4d(overrides: &mut Overrides, name: &str, value: &str) -> Result<(), &'static str> {
    let flags = &mut overrides.swift4d;
    match name {
        "activation" => {
            flags.trunk_relu = Some(match value.to_ascii_lowercase().as_str() {
                "relu" => true,
                "none" => false,
                _ => return Err("expected relu or none"),
            });
        }
        "index_rule" => {
            flags.index_rule = Some(match value {
                "current" => IndexRule::Current,
                "older" => IndexRule::Older,
                _ => return Err("expected current or older"),
            });
        }
        "dynamic_thro" => flags.dynamic_thro = number(value)?,
        "frames" => flags.frames = number(value)?,
        "time_divisor" => flags.time_divisor = number(value)?,
        "n_levels" => flags.n_levels = number(value)?,
        "n_features_per_level" => flags.n_features_per_level = number(value)?,
        "hashmap_size" => flags.hashmap_size = number(value)?,
        "base_resolution" => flags.base_resolution = number(value)?,
        _ => return Err("no such flag"),
    }
    Ok(())
}
