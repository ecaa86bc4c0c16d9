//! Messages about damaged rows.

use crate::args::Global;
use crate::console::Console;
use crate::model_flags::damage;
use gs_io::repair::{Damage, RepairReport};
use std::path::Path;

/// Reports the treatment of damaged rows and of meaningful infinities.
pub(crate) fn say_repair(path: &Path, report: RepairReport, global: &Global, console: &Console) {
    if let Some(warning) = report.warning(damage(global) == Damage::Drop) {
        console.warn(format!("{}: {warning}", path.display()));
    }
    if let Some(note) = report.infinities.note() {
        console.note(format!("{}: {note}", path.display()));
    }
}
