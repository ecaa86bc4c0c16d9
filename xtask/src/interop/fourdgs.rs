//! Clips as `.4dgs`, in both directions, with the format's reference implementation in Python.

use super::Trip;
use super::compare::{VISIBLE, difference};
use super::peers::{checked, fourdgs, python};
use anyhow::Result;
use gs_core::Splats;
use gs_io::frame;
use std::path::Path;

/// Frames of the clip that `c4d` writes.
const FRAMES: &str = "9";
/// Times that are compared, as shares of the clip. The second and the fourth lie between frames.
const TIMES: [&str; 5] = ["0", "0.3", "0.5", "0.7", "1"];

impl Trip {
    /// Rows of the table: how each side evaluates the other's files.
    pub(super) fn fourdgs(&self, folder: &Path) -> Result<Vec<String>> {
        let package = fourdgs();
        let mut table = Vec::new();
        self.c4d(&["export", "source", "--frames", FRAMES, "-w", "-o", "ours.4dgs"])?;
        let read = self.evaluated_by_package(folder, "ours.4dgs")?;
        let truth = self.evaluated("source")?;
        push(&mut table, &format!("c4d → {package}"), &truth, &read);
        for (command, what) in
            [("lines", "lines, fades and windows"), ("convert", "`fourdgs convert` of the frames")]
        {
            let source = (command == "convert").then_some("source");
            let arguments = source.into_iter().chain(["theirs.4dgs"]);
            self.package(folder, command, arguments)?;
            let truth = self.evaluated_by_package(folder, "theirs.4dgs")?;
            let read = self.evaluated("theirs.4dgs")?;
            push(&mut table, &format!("{package} → c4d, {what}"), &truth, &read);
        }
        Ok(table)
    }

    fn package<'a>(
        &self,
        folder: &Path,
        command: &str,
        arguments: impl IntoIterator<Item = &'a str>,
    ) -> Result<()> {
        let script = include_str!("fourdgs.py");
        let mut program = python(folder);
        program.args(["-c", script, command]).args(arguments).current_dir(&self.files);
        checked(&mut program).map(drop)
    }

    /// The visible splats at [`TIMES`], as the package evaluates the file.
    fn evaluated_by_package(&self, folder: &Path, file: &str) -> Result<Vec<Splats>> {
        self.package(folder, "read", std::iter::once(file).chain(TIMES))?;
        (0..TIMES.len()).map(|number| self.visible(&format!("fourdgs_{number}.ply"))).collect()
    }

    /// The visible splats at [`TIMES`], as `c4d` evaluates a scene.
    fn evaluated(&self, scene: &str) -> Result<Vec<Splats>> {
        let at = |time: &&str| {
            self.c4d(&["export", scene, "--time", time, "-w", "-o", "moment.ply"])?;
            self.visible("moment.ply")
        };
        TIMES.iter().map(at).collect()
    }

    fn visible(&self, file: &str) -> Result<Splats> {
        let splats = frame::read_file(self.files.join(file))?.splats;
        // Rounding may move an opacity across the threshold: half of it is not missed.
        let is_visible = |&row: &usize| splats.opacity(row) >= 0.5 * VISIBLE;
        Ok(splats.select(&(0..splats.len()).filter(is_visible).collect::<Vec<_>>()))
    }
}

fn push(table: &mut Vec<String>, what: &str, truth: &[Splats], read: &[Splats]) {
    for ((time, truth), read) in TIMES.iter().zip(truth).zip(read) {
        let off = difference(truth, read);
        table.push(format!(
            "| {what} | {time} | {} of {} | {} |",
            read.len(),
            truth.len(),
            off.columns()
        ));
    }
}
