//! Description of a network in the report.

use super::flags::Flags;
use super::network::Tensors;
use super::network_shape::NetworkShape;
use crate::model_folder::{ModelReport, Origin};
use gs_deform::Component;

/// Adds a description of the network to `report`.
pub(super) fn describe(
    report: &mut ModelReport,
    shape: &NetworkShape,
    flags: &Flags,
    tensors: &Tensors<'_>,
) {
    (report.width, report.channels) = (shape.width, shape.channels);
    (report.levels, report.depth) = (shape.levels, shape.depth);
    report.mask = match (shape.has_static_mlp, shape.has_empty_voxel) {
        (true, _) => "static_mlp",
        (false, true) => "empty_voxel",
        (false, false) => "none",
    };
    if !shape.has_sh_head {
        report.warnings.push(
            "the network has no SH head: it is from a revision of autumn 2023, which does not \
            deform opacity and SH"
                .to_owned(),
        );
    }
    for component in Component::ALL {
        let name = component.head_name();
        let in_use = flags.deform[component as usize];
        if in_use {
            report.heads.push(name);
        }
        let set_by_user = report
            .flags
            .get(component as usize)
            .is_some_and(|flag| flag.origin == Origin::Override);
        match tensors.looks_untrained(name, shape.width) {
            Some(true) => {
                report.untrained_heads.push(name);
                if in_use {
                    report.warnings.push(format!(
                        "head {name} is switched on but its weights look untrained; if the scene looks wrong, switch it off"
                    ));
                }
            }
            Some(false) if !in_use && !set_by_user && shape.has_sh_head => report.warnings.push(format!(
                "head {name} is switched off but its weights look trained; if the scene looks wrong, switch it on"
            )),
            _ => {}
        }
    }
}
