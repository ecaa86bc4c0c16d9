//! Flags of a 4DGaussians training run, determined by the network, `cfg_args` or the user.

use super::network_shape::NetworkShape;
use crate::cfg_args::{CfgArgs, Value};
use crate::model_folder::{FlagReport, ModelReport, Origin, Overrides};

/// Resolved flags.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Flags {
    /// Deformed components in the order of `Component::ALL`.
    pub(super) deform: [bool; 5],
    pub(super) apply_rotation: bool,
    pub(super) grid_pe: u32,
}

/// Names of the `no_*` flags in the order of `Component::ALL`.
const NO_FLAGS: [&str; 5] = ["no_dx", "no_ds", "no_dr", "no_do", "no_dshs"];
/// Their defaults: opacity and SH are not deformed.
const NO_DEFAULTS: [bool; 5] = [false, false, false, true, true];

/// A configuration family, by the shape of the network: whether opacity and SH are deformed.
fn family(shape: &NetworkShape) -> Option<(&'static str, bool)> {
    match (shape.width, shape.channels, shape.levels) {
        (128, 16, 2) => Some(("dynerf or multipleview", true)),
        (128, 16, 3) => Some(("hypernerf or dycheck", false)),
        (256, _, _) => Some(("a revision of 2023", false)),
        (_, 32, _) => Some(("dnerf", false)),
        _ => None,
    }
}

/// Resolves all flags and reports them.
pub(super) fn resolve(
    shape: &NetworkShape,
    cfg: Option<&CfgArgs>,
    overrides: &Overrides,
    report: &mut ModelReport,
) -> Result<Flags, String> {
    let given =
        [overrides.no_dx, overrides.no_ds, overrides.no_dr, overrides.no_do, overrides.no_dshs];
    // If the file has the network's group of arguments, flags missing from it did not exist in that
    // revision and have their defaults. A file without that group does not describe the network.
    let has_group = cfg.is_some_and(|cfg| cfg.get("net_width").is_some());
    let guess = family(shape).filter(|_| !has_group);
    let mut deform = [false; 5];
    for index in 0..5 {
        let name = NO_FLAGS[index];
        let in_cfg = cfg.and_then(|cfg| cfg.get(name)).and_then(Value::as_bool);
        let (no, origin) = match (given[index], in_cfg, guess) {
            (Some(no), _, _) => (no, Origin::Override),
            // Revisions that did not deform SH rendered the stored opacity regardless of the flag.
            (None, _, _) if !shape.has_sh_head && index >= 3 => (true, Origin::Inferred),
            (None, Some(no), _) => (no, Origin::CfgArgs),
            (None, None, Some((_, appearance))) if index >= 3 => (!appearance, Origin::FamilyGuess),
            (None, None, _) => (NO_DEFAULTS[index], Origin::Default),
        };
        deform[index] = !no;
        report.flags.push(FlagReport { name, value: no.to_string(), origin });
    }
    if let (Some((family, appearance)), false) = (guess, given[3].is_some() && given[4].is_some()) {
        let what = if appearance { "are deformed" } else { "are not deformed" };
        report.warnings.push(format!(
            "cfg_args does not describe the network; it has the shape of {family} models, so \
            opacity and SH {what}"
        ));
    }
    let in_cfg = cfg.and_then(|cfg| cfg.get("apply_rotation")).and_then(Value::as_bool);
    let (apply_rotation, origin) = match (overrides.apply_rotation, in_cfg) {
        (Some(value), _) => (value, Origin::Override),
        (None, Some(value)) => (value, Origin::CfgArgs),
        (None, None) => (false, Origin::Default),
    };
    let value = apply_rotation.to_string();
    report.flags.push(FlagReport { name: "apply_rotation", value, origin });
    let grid_pe = resolve_grid_pe(shape, cfg, overrides, report)?;
    check_against_cfg(shape, cfg, report)?;
    Ok(Flags { deform, apply_rotation, grid_pe })
}

fn resolve_grid_pe(
    shape: &NetworkShape,
    cfg: Option<&CfgArgs>,
    overrides: &Overrides,
    report: &mut ModelReport,
) -> Result<u32, String> {
    let in_cfg = cfg
        .and_then(|cfg| cfg.get("grid_pe"))
        .and_then(Value::as_u64)
        .and_then(|value| u32::try_from(value).ok());
    let (value, origin) = match (shape.encoded, overrides.grid_pe, in_cfg) {
        (false, _, _) => (0, Origin::Inferred),
        (true, Some(value), _) => (value, Origin::Override),
        (true, None, Some(value)) => (value, Origin::CfgArgs),
        (true, None, None) => {
            return Err(
                "its trunk expects encoded features, but their frequency is not recorded; \
                       set grid_pe (2 or more, as in training)"
                    .to_owned(),
            );
        }
    };
    match (shape.encoded, value) {
        (true, 0) => {
            return Err("its trunk expects encoded features, which contradicts grid_pe = 0; pass \
                       grid_pe (2 or more, as in training)"
                .to_owned());
        }
        (true, 1) => {
            return Err("was trained with grid_pe = 1, which the reference implementation cannot evaluate either: its trunk expects an encoding that is then not computed".to_owned());
        }
        _ => {}
    }
    report.flags.push(FlagReport { name: "grid_pe", value: value.to_string(), origin });
    Ok(value)
}

/// Tensors take precedence over `cfg_args`; a contradiction means
/// that the files are from different runs.
fn check_against_cfg(
    shape: &NetworkShape,
    cfg: Option<&CfgArgs>,
    report: &mut ModelReport,
) -> Result<(), String> {
    let Some(cfg) = cfg else { return Ok(()) };
    if cfg.get("no_grid").and_then(Value::as_bool) == Some(true) {
        return Err(
            "was trained with no_grid, which the reference implementation cannot evaluate either"
                .to_owned(),
        );
    }
    let planes = cfg.get("kplanes_config");
    let channels = planes.and_then(|planes| planes.get("output_coordinate_dim"));
    let levels = cfg.get("multires").and_then(|value| match value {
        Value::List(items) => Some(items.len()),
        _ => None,
    });
    let stated = [
        ("net_width", cfg.get("net_width").and_then(Value::as_u64), shape.width),
        ("output_coordinate_dim", channels.and_then(Value::as_u64), shape.channels),
        ("the number of multires levels", levels.map(|levels| levels as u64), shape.levels),
    ];
    for (name, stated, found) in stated {
        if let Some(stated) = stated.filter(|&stated| stated != found as u64) {
            report.warnings.push(format!(
                "cfg_args has {name} {stated}, the network has {found}: cfg_args may belong to \
                a different run, check the flags"
            ));
        }
    }
    Ok(())
}
