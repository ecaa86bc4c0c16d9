//! Images of a render, one file per view, time and pass.

use super::losses::losses;
use super::render_job::RenderJob;
use super::views::Views;
use crate::args::{Format, Global, Pass, RenderArgs};
use crate::commands::export::note_losses;
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::output::{existing, output_failure};
use crate::part::{PartFolder, PartRecord};
use crate::passes::{self, PassImage};
use gs_core::{Camera, Image};
use gs_io::AtomicDir;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Folder of one view and pass; a single view has no subfolder.
fn stills_folder(root: &Path, views: &Views, camera: &Camera, pass: Pass) -> PathBuf {
    match views {
        Views::Fixed(cameras) if cameras.len() > 1 => {
            let index = cameras.iter().position(|other| std::ptr::eq(other, camera)).unwrap_or(0);
            let safe: String = camera
                .name
                .chars()
                .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' })
                .collect();
            root.join(format!("{index:03}_{safe}")).join(pass.name())
        }
        _ => root.join(pass.name()),
    }
}

pub(super) fn stills(
    args: &RenderArgs,
    global: &Global,
    job: &RenderJob<'_>,
    format: Format,
    part: Option<PartRecord>,
) -> Outcome {
    if format == Format::Flo && args.passes != [Pass::Flow] {
        return Err(Failure::usage("--format flo contains flow only").next("Add --passes flow."));
    }
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let mut depth_range = (f32::INFINITY, f32::NEG_INFINITY);
    if format == Format::Png && args.passes.contains(&Pass::Depth) {
        depth_range = depth_extent(job)?;
        job.console.note(format!(
            "depth is scaled: black is {}, white is {}",
            depth_range.0, depth_range.1
        ));
    }
    let then = job.splats_of_edit(&args.passes)?;
    let mut count = 0;
    job.render(|exposure| {
        for &pass in &args.passes {
            let folder = stills_folder(folder.path(), job.views, exposure.camera, pass);
            std::fs::create_dir_all(&folder).map_err(|error| Failure::write(&folder, &error))?;
            let path = |extension: &str| folder.join(format!("{:05}.{extension}", exposure.frame));
            match (job.image_of(pass, exposure, &then)?, format) {
                (PassImage::Flow(flow), Format::Exr) => {
                    let channels = ["forward.u", "forward.v", "A"];
                    images::write_exr(&path("exr"), &passes::flow_with_coverage(&flow), &channels)?;
                }
                (PassImage::Flow(flow), Format::Npy) => {
                    images::write_npy(&path("npy"), &passes::flow_image(&flow))?;
                }
                (PassImage::Flow(flow), Format::Flo) => {
                    let bytes =
                        cuar::encode_flo(&passes::flow_image(&flow)).map_err(Failure::failed)?;
                    let path = path("flo");
                    std::fs::write(&path, bytes).map_err(|error| Failure::write(&path, &error))?;
                }
                (PassImage::Flow(flow), _) => {
                    write_png(&path("png"), &cuar::flow_wheel(&passes::flow_image(&flow), None))?;
                }
                (PassImage::Overlay(_, Some(numbers)), Format::Exr) => {
                    images::write_exr(&path("exr"), &numbers, &["Y"])?;
                }
                (PassImage::Overlay(colors, None), Format::Exr) => {
                    images::write_exr(&path("exr"), &colors, &["R", "G", "B"])?;
                }
                (PassImage::Overlay(colors, numbers), Format::Npy) => {
                    images::write_npy(&path("npy"), &numbers.unwrap_or(colors))?;
                }
                (PassImage::Overlay(colors, _), _) => write_png(&path("png"), &colors)?,
                (PassImage::Grey(image), Format::Exr) => {
                    images::write_exr(&path("exr"), &image, channels(pass))?;
                }
                (PassImage::Grey(image), Format::Npy) => images::write_npy(&path("npy"), &image)?,
                (PassImage::Grey(mut image), _) => {
                    if pass == Pass::Depth {
                        stretch(&mut image, depth_range);
                    }
                    write_png(&path("png"), &image)?;
                }
            }
            count += 1;
        }
        Ok(())
    })?;
    if let Some(record) = part {
        PartFolder::write(record, folder.path())?;
    }
    folder.commit().map_err(|error| output_failure(&error))?;
    note_losses(&losses(format, args, job.times.len(), 0.0), job.console);
    job.console.output(&args.output, &[("images", count)]);
    Ok(())
}

/// Names of the channels of an EXR.
fn channels(pass: Pass) -> &'static [&'static str] {
    match pass {
        Pass::Alpha => &["A"],
        Pass::Depth => &["Z"],
        Pass::Uncertainty | Pass::Evidence | Pass::Mask => &["Y"],
        _ => &["R", "G", "B"],
    }
}

/// Smallest and largest depth over the clip, for the same scaling of all frames.
fn depth_extent(job: &RenderJob<'_>) -> Outcome<(f32, f32)> {
    let mut range = (f32::INFINITY, f32::NEG_INFINITY);
    RenderJob { share: None, ..*job }.expose(|exposure| {
        for &z in &exposure.output.depth {
            range = (range.0.min(z), range.1.max(z));
        }
        Ok(())
    })?;
    Ok(range)
}

fn stretch(image: &mut Image, (near, far): (f32, f32)) {
    let span = (far - near).max(f32::MIN_POSITIVE);
    for value in &mut image.data {
        *value = (*value - near) / span;
    }
}

fn write_png(path: &Path, image: &Image) -> Outcome {
    let file = File::create(path).map_err(|error| Failure::write(path, &error))?;
    images::write_png(BufWriter::new(file), path, image)
}
