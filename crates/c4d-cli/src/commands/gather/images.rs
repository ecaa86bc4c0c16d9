//! Joins the images of `c4d render --part`.

use crate::args::{Format, Global};
use crate::clip_file;
use crate::commands::render::format_of;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames;
use crate::output::{existing, output_failure};
use crate::part::{Part, broken};
use gs_core::Image;
use gs_io::AtomicDir;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Folder of the images of a clip's frames: one view, colours only.
const FRAMES: &str = "rgb/";

pub(super) fn join(
    parts: &[Part<Vec<String>>],
    output: &Path,
    global: &Global,
    console: &Console,
) -> Outcome {
    let (first, record, _) = &parts[0];
    let length = |name: &str| record.work(name).as_array().map_or(0, Vec::len);
    let moves = record.work("moving camera") == &Value::Bool(true);
    let views = if moves { 1 } else { length("cameras") };
    let (images, passes) = (length("times") * views, length("passes"));
    let mut files: Vec<(PathBuf, &str)> = Vec::with_capacity(images * passes);
    for (path, record, names) in parts {
        let expected = record.range(images).len() * passes;
        if names.len() != expected {
            let found = names.len();
            return Err(broken(path, &format!("{found} images, expected {expected}")));
        }
        files.extend(names.iter().map(|name| (path.join(name), name.as_str())));
    }
    files.sort_by(|a, b| a.1.cmp(b.1));
    if let Some(pair) = files.windows(2).find(|pair| pair[0].1 == pair[1].1) {
        return Err(broken(&pair[1].0, "another part also contains this image"));
    }
    let format = format_of(output)?;
    clip_file::check_format(format)?;
    if format == Format::Png {
        return copy(&files, output, global, console);
    }
    let is_png = |name: &str| Path::new(name).extension().is_some_and(|end| end == "png");
    let is_frame = |name: &str| name.starts_with(FRAMES) && is_png(name);
    if !files.iter().all(|(_, name)| is_frame(name)) {
        return Err(Failure::usage(format!(
            "{}: not colour images of one view, which a {} requires",
            first.display(),
            if format == Format::Sheet { "sheet" } else { "video" }
        ))
        .next("Use -o FOLDER. For videos, make the parts with one view, --passes rgb and --format png."));
    }
    let to = (output, existing(global));
    if format == Format::Sheet {
        let picks = clip_file::sheet_frames(files.len());
        clip_file::write_sheet(to, |push| {
            picks.iter().try_for_each(|&frame| push(&open(&files[frame].0)?))
        })?;
    } else {
        let fps = record.work("frame rate").as_f64().filter(|fps| *fps > 0.0);
        let fps = fps.ok_or_else(|| broken(first, "its frame rate is not a number"))?;
        let mut progress = console.progress("encode", files.len() as u64);
        clip_file::write(to, format, fps, |push| {
            files.iter().try_for_each(|(path, _)| {
                push(&open(path)?)?;
                progress.step();
                Ok(())
            })
        })?;
        progress.finish();
        console.note(frames::playing(files.len(), fps));
    }
    console.output(output, &[]);
    Ok(())
}

/// Copies the images into one folder.
fn copy(files: &[(PathBuf, &str)], output: &Path, global: &Global, console: &Console) -> Outcome {
    let folder =
        AtomicDir::create(output, existing(global)).map_err(|error| output_failure(&error))?;
    for (path, name) in files {
        let to = folder.path().join(name);
        if let Some(parent) = to.parent() {
            std::fs::create_dir_all(parent).map_err(|error| Failure::write(parent, &error))?;
        }
        std::fs::copy(path, &to).map_err(|error| Failure::write(&to, &error))?;
    }
    folder.commit().map_err(|error| output_failure(&error))?;
    console.output(output, &[("images", files.len())]);
    Ok(())
}

/// The values of an 8-bit PNG.
fn open(path: &Path) -> Outcome<Image> {
    let refused = |error: &dyn std::fmt::Display| broken(path, &error.to_string());
    let bytes = gs_io::read_file(path).map_err(|error| refused(&error))?;
    let rgb = image::load_from_memory(&bytes).map_err(|error| refused(&error))?.into_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let data = rgb.into_raw().into_iter().map(|value| f32::from(value) / 255.0).collect();
    Image::from_data(width, height, 3, data).map_err(|error| refused(&error))
}
