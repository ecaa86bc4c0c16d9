//! `--set`, `--iteration` and `--strict` as options of a scene's reader.

use crate::args::{AxesArg, Global};
use crate::failure::{Failure, Outcome};
use clap::ValueEnum;
use gs_deform::IndexRule;
use gs_io::model_folder::Overrides;
use gs_io::repair::Damage;
use gs_io::{OpenOptions, SceneKind};

const FLAGS_4DGS: &str = "Flags of 4DGaussians models: no_dx, no_ds, no_dr, no_do, no_dshs, apply_rotation (true or false) and grid_pe (a number).";
const FLAGS_SWIFT4D: &str = "Flags of Swift4D models: activation (relu or none), index_rule (current or older), dynamic_thro, frames, time_divisor, n_levels, n_features_per_level, hashmap_size and base_resolution (numbers).";
const FLAGS_SEQUENCE: &str = "Flags of sequences: axes (ply, rub or luf), of SPZ and glTF files.";
const FLAGS_OTHERS: &str = "Flags of other trained scenes: time_duration=START,END for native 4D Gaussians, in the unit of training (0,10 for Neural 3D Video, 0,1 for D-NeRF); bound (a number) for Grid4D and DASH without cfg_args.";

/// Treatment of damaged rows.
pub(crate) fn damage(global: &Global) -> Damage {
    if global.strict { Damage::Fail } else { Damage::Drop }
}

/// Options given by the user for a scene of this kind.
pub(crate) fn open_options(global: &Global, kind: &SceneKind) -> Outcome<OpenOptions> {
    let mut options = OpenOptions::default();
    options.iteration = global.iteration;
    options.damage = damage(global);
    let flags = match kind {
        SceneKind::Model4dgs => FLAGS_4DGS,
        SceneKind::Swift4d => FLAGS_SWIFT4D,
        SceneKind::PlySequence => FLAGS_SEQUENCE,
        _ => FLAGS_OTHERS,
    };
    for setting in &global.set {
        set(&mut options, kind, setting)
            .map_err(|what| Failure::usage(format!("--set {setting}: {what}")).next(flags))?;
    }
    Ok(options)
}

fn set(options: &mut OpenOptions, kind: &SceneKind, setting: &str) -> Result<(), &'static str> {
    let (name, value) = setting.split_once('=').ok_or("expected FLAG=VALUE")?;
    match (kind, name) {
        (SceneKind::Model4dgs, _) => set_4dgs(&mut options.overrides, name, value)?,
        (SceneKind::Swift4d, _) => set_swift4d(&mut options.overrides, name, value)?,
        (SceneKind::PlySequence, "axes") => {
            let axes =
                AxesArg::from_str(value, true).map_err(|_no_axes| "expected ply, rub or luf")?;
            options.axes = Some(axes.axes());
        }
        (SceneKind::Gaussian4d, "time_duration") => {
            options.time_duration = Some(duration(value)?);
        }
        (SceneKind::Grid4d | SceneKind::Dash, "bound") => {
            let wrong = "expected a positive number";
            let bound = value.parse::<f32>().map_err(|_not_a_number| wrong)?;
            if !(bound.is_finite() && bound > 0.0) {
                return Err(wrong);
            }
            options.bound = Some(bound);
        }
        _ => return Err("this kind of scene has no such flag"),
    }
    Ok(())
}

fn duration(value: &str) -> Result<[f64; 2], &'static str> {
    let wrong = "expected START,END, two numbers, the second larger";
    let (start, end) = value.split_once(',').ok_or(wrong)?;
    let parse = |text: &str| text.trim().parse::<f64>().map_err(|_not_a_number| wrong);
    let (start, end) = (parse(start)?, parse(end)?);
    if !(start.is_finite() && end.is_finite() && start < end) {
        return Err(wrong);
    }
    Ok([start, end])
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
