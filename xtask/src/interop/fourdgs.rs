//! Clips as `.4dgs`, in both directions, with the format's reference implementation in Python.

use super::compare::{VISIBLE, difference, paired};
use super::peers::{checked, fourdgs, python};
use super::round_trips::RoundTrips;
use anyhow::Result;
use gs_core::Splats;
use gs_io::frame;
use std::fs;
use std::path::{Path, PathBuf};

/// Frames of the clip that `c4d` writes.
const FRAMES: &str = "9";
/// Compared times, as shares of the clip. The second and the fourth lie between frames.
const TIMES: [&str; 5] = ["0", "0.3", "0.5", "0.7", "1"];

impl RoundTrips {
    /// Rows of the table: how each program evaluates the other's files.
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
        let moment = |number: usize| self.files.join(format!("fourdgs_{number}.ply"));
        for old in (0..TIMES.len()).map(moment).filter(|old| old.exists()) {
            fs::remove_file(old)?;
        }
        self.package(folder, "read", std::iter::once(file).chain(TIMES))?;
        let at = |file: PathBuf| {
            if file.exists() { Self::visible(&file) } else { Ok(Splats::default()) }
        };
        (0..TIMES.len()).map(|number| at(moment(number))).collect()
    }

    /// The visible splats at [`TIMES`], as `c4d` evaluates a scene.
    fn evaluated(&self, scene: &str) -> Result<Vec<Splats>> {
        let at = |time: &&str| {
            self.c4d(&["export", scene, "--time", time, "-w", "-o", "moment.ply"])?;
            Self::visible(&self.files.join("moment.ply"))
        };
        TIMES.iter().map(at).collect()
    }

    fn visible(file: &Path) -> Result<Splats> {
        let splats = frame::read_file(file)?.splats;
        // Rounding may move an opacity across the threshold, so half of it is accepted.
        let is_visible = |&row: &usize| splats.opacity(row) >= 0.5 * VISIBLE;
        Ok(splats.select(&(0..splats.len()).filter(is_visible).collect::<Vec<_>>()))
    }
}

fn push(table: &mut Vec<String>, what: &str, truth: &[Splats], read: &[Splats]) {
    for ((time, truth), read) in TIMES.iter().zip(truth).zip(read) {
        let both = paired(truth, read);
        let off = if both.is_empty() {
            "– | – | – | – | –".to_owned()
        } else {
            difference(&truth.select(&both), read).columns()
        };
        table.push(format!(
            "| {what} | {time} | {} | {} | {} | {off} |",
            truth.len(),
            truth.len() - both.len(),
            read.len() - both.len()
        ));
    }
}
