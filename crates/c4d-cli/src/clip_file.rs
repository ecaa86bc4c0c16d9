//! Videos, animated images and contact sheets, from frames in order.

#[cfg(not(feature = "mp4"))]
use crate::animated_image::GIF_MAX_FPS;
#[cfg(feature = "webp")]
use crate::animated_image::WebpWriter;
use crate::animated_image::{AnimatedImage, GifWriter};
use crate::args::Format;
use crate::failure::{Failure, Outcome};
use crate::features::missing;
use crate::output::output_failure;
#[cfg(feature = "mp4")]
use crate::video::VideoWriter;
use crate::{images, renderer};
use gs_core::Image;
use gs_io::{AtomicFile, Existing};
use std::path::Path;

/// Largest number of frames on a contact sheet.
const SHEET_FRAMES: usize = 12;
/// Widest contact sheet, pixels.
const SHEET_WIDTH: usize = 2400;

/// Receives frames.
pub(crate) type Push<'a> = &'a mut dyn FnMut(&Image) -> Outcome;

/// Refuses a format whose writer this build lacks.
pub(crate) fn check_format(format: Format) -> Outcome {
    match format {
        Format::Mp4 if cfg!(not(feature = "mp4")) => Err(missing("mp4", "--format gif needs none")),
        Format::Webp if cfg!(not(feature = "webp")) => {
            Err(missing("webp", "--format gif needs none"))
        }
        Format::Exr if cfg!(not(feature = "exr")) => Err(missing("exr", "--format npy needs none")),
        _ => Ok(()),
    }
}

/// Whether files of the format have a frame rate.
pub(crate) fn plays(format: Format) -> bool {
    matches!(format, Format::Mp4 | Format::Webp | Format::Gif)
}

/// Writes the frames that `feed` pushes, `[height, width, 3]` each, as an MP4, WebP or GIF.
///
/// In a build without the video encoder an MP4 is refused ([`check_format`]).
pub(crate) fn write(
    to: (&Path, Existing),
    format: Format,
    fps: f64,
    feed: impl FnOnce(Push<'_>) -> Outcome,
) -> Outcome {
    match format {
        #[cfg(feature = "mp4")]
        Format::Mp4 => write_video(to, fps, feed),
        _ => write_loop(to, format, fps, feed),
    }
}

/// Writes an MP4; a GIF in a build without the video encoder.
pub(crate) fn write_playable(
    to: (&Path, Existing),
    fps: f64,
    feed: impl FnOnce(Push<'_>) -> Outcome,
) -> Outcome {
    #[cfg(feature = "mp4")]
    return write_video(to, fps, feed);
    #[cfg(not(feature = "mp4"))]
    write_loop(to, Format::Gif, fps.min(GIF_MAX_FPS), feed)
}

#[cfg(feature = "mp4")]
fn write_video(
    (path, existing): (&Path, Existing),
    fps: f64,
    feed: impl FnOnce(Push<'_>) -> Outcome,
) -> Outcome {
    let mut file =
        Some(AtomicFile::create(path, existing).map_err(|error| output_failure(&error))?);
    let mut writer: Option<VideoWriter<AtomicFile>> = None;
    feed(&mut |image| {
        if let Some(file) = file.take() {
            writer = Some(VideoWriter::new(file, path, image.width, image.height, fps)?);
        }
        writer.as_mut().map_or(Ok(()), |writer| writer.push(&image.to_bytes(), image.width))
    })?;
    let file = match writer {
        Some(writer) => writer.finish()?,
        None => return Err(Failure::usage("a video needs at least one frame")),
    };
    file.commit().map_err(|error| output_failure(&error))
}

/// Writes a GIF, or a WebP.
fn write_loop(
    (path, existing): (&Path, Existing),
    format: Format,
    fps: f64,
    feed: impl FnOnce(Push<'_>) -> Outcome,
) -> Outcome {
    let mut file =
        Some(AtomicFile::create(path, existing).map_err(|error| output_failure(&error))?);
    let mut writer: Option<AnimatedImage<AtomicFile>> = None;
    feed(&mut |image| {
        let (width, height) = (image.width, image.height);
        if let Some(file) = file.take() {
            writer = Some(match format {
                #[cfg(feature = "webp")]
                Format::Webp => {
                    AnimatedImage::Webp(Box::new(WebpWriter::new(file, path, width, height, fps)?))
                }
                _ => AnimatedImage::Gif(GifWriter::new(file, path, width, height, fps)?),
            });
        }
        writer.as_mut().map_or(Ok(()), |writer| writer.push(&image.to_bytes()))
    })?;
    let file = match writer {
        Some(writer) => writer.finish()?,
        None => return Err(Failure::usage("an animated image needs at least one frame")),
    };
    file.commit().map_err(|error| output_failure(&error))
}

/// Which of `count` frames a contact sheet shows: up to [`SHEET_FRAMES`], evenly spaced.
pub(crate) fn sheet_frames(count: usize) -> Vec<usize> {
    let shown = count.min(SHEET_FRAMES);
    (0..shown).map(|i| i * (count - 1) / (shown - 1).max(1)).collect()
}

/// Writes the frames that `feed` pushes onto one PNG. They are rounded to 8 bits before they are
/// reduced, so that frames read from PNGs give the same sheet.
pub(crate) fn write_sheet(
    (path, existing): (&Path, Existing),
    feed: impl FnOnce(Push<'_>) -> Outcome,
) -> Outcome {
    let mut file = AtomicFile::create(path, existing).map_err(|error| output_failure(&error))?;
    let mut cells = Vec::new();
    feed(&mut |image| {
        let data = image.to_bytes().into_iter().map(|value| f32::from(value) / 255.0).collect();
        cells.push(Image { data, ..*image });
        Ok(())
    })?;
    let sheet = renderer::contact_sheet(&cells, SHEET_WIDTH);
    images::write_png(&mut file, path, &sheet)?;
    file.commit().map_err(|error| output_failure(&error))
}
