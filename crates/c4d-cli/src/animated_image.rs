//! Animated images that loop: GIF and lossless WebP, one frame in memory at a time.

#[cfg(feature = "webp")]
mod webp;

#[cfg(feature = "webp")]
pub(crate) use webp::WebpWriter;

use crate::failure::{Failure, Outcome};
use color_quant::NeuQuant;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A looping image being written.
pub(crate) enum AnimatedImage<W: Write> {
    Gif(GifWriter<W>),
    #[cfg(feature = "webp")]
    Webp(Box<WebpWriter<W>>),
}

impl<W: Write> AnimatedImage<W> {
    /// Appends a frame of RGB bytes.
    pub(crate) fn push(&mut self, rgb: &[u8]) -> Outcome {
        match self {
            Self::Gif(writer) => writer.push(rgb),
            #[cfg(feature = "webp")]
            Self::Webp(writer) => writer.push(rgb),
        }
    }

    /// Completes the image and returns the writer.
    pub(crate) fn finish(self) -> Outcome<W> {
        match self {
            Self::Gif(writer) => writer.finish(),
            #[cfg(feature = "webp")]
            Self::Webp(writer) => writer.finish(),
        }
    }
}

/// Largest frame rate of a GIF; browsers treat shorter delays as
/// errors and play at 10 frames per second.
pub(crate) const GIF_MAX_FPS: f64 = 50.0;
/// Palette entry for unchanged pixels.
const TRANSPARENT: u8 = 255;
/// A pixel is redrawn if a channel differs by more than this (of 255) from its last drawn value, so
/// that static parts neither flicker nor take space, regardless of palette and dithering.
const HOLD: u8 = 3;
/// Share of the rounding error that is diffused to neighbouring pixels, in parts of
/// [`DITHER_PARTS`]; diffusing all of it causes grain.
const DITHER: i32 = 12;
/// Denominator of [`DITHER`].
const DITHER_PARTS: i32 = 16;

/// A GIF: every frame has its own palette of 255 colours and draws only the changed rectangle, and
/// in it only the changed pixels.
pub(crate) struct GifWriter<W: Write> {
    encoder: gif::Encoder<W>,
    path: PathBuf,
    width: usize,
    fps: f64,
    frames: u32,
    /// Colour of every pixel when it was last drawn, before dithering.
    drawn: Vec<[u8; 3]>,
}

impl<W: Write> GifWriter<W> {
    pub(crate) fn new(
        writer: W,
        path: &Path,
        width: usize,
        height: usize,
        fps: f64,
    ) -> Outcome<Self> {
        let failed = |error: gif::EncodingError| Failure::write(path, &error);
        let side = |pixels: usize| {
            u16::try_from(pixels).map_err(|_too_large| {
                Failure::usage(format!(
                    "a GIF of {width}×{height} pixels: sides are limited to 65535"
                ))
                .next("Use a different --size.")
            })
        };
        let mut encoder =
            gif::Encoder::new(writer, side(width)?, side(height)?, &[]).map_err(failed)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
        Ok(Self { encoder, path: path.to_owned(), width, fps, frames: 0, drawn: Vec::new() })
    }

    fn push(&mut self, rgb: &[u8]) -> Outcome {
        let (pixels, _) = rgb.as_chunks::<3>();
        let changed: Vec<bool> = if self.drawn.is_empty() {
            self.drawn = pixels.to_vec();
            vec![true; pixels.len()]
        } else {
            let differs =
                |(new, old): (&[u8; 3], &[u8; 3])| (0..3).any(|k| new[k].abs_diff(old[k]) > HOLD);
            pixels.iter().zip(&self.drawn).map(differs).collect()
        };
        for (i, _) in changed.iter().enumerate().filter(|(_, changed)| **changed) {
            self.drawn[i] = pixels[i];
        }
        let area = Area::around(&changed, self.width);
        let palette = Palette::of(pixels, &changed);
        let buffer = palette.draw(pixels, &changed, &area, self.width);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the whole image fits, so do its parts"
        )]
        let short = |pixels: usize| pixels as u16;
        let frame = gif::Frame {
            delay: self.delay(),
            dispose: gif::DisposalMethod::Keep,
            transparent: Some(TRANSPARENT),
            left: short(area.left),
            top: short(area.top),
            width: short(area.width),
            height: short(area.height),
            palette: Some(palette.colours.as_flattened().to_vec()),
            buffer: Cow::Owned(buffer),
            ..gif::Frame::default()
        };
        self.frames += 1;
        self.encoder.write_frame(&frame).map_err(|error| Failure::write(&self.path, &error))
    }

    /// Delay in hundredths of a second, rounded so that the clip keeps its total duration.
    fn delay(&self) -> u16 {
        let fps = self.fps.min(GIF_MAX_FPS);
        let start = |frame: u32| (f64::from(frame) * 100.0 / fps).round();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let delay = (start(self.frames + 1) - start(self.frames)).clamp(2.0, 65535.0) as u16;
        delay
    }

    fn finish(self) -> Outcome<W> {
        self.encoder.into_inner().map_err(|error| Failure::write(&self.path, &error))
    }
}

/// The smallest rectangle that contains all changed pixels; one pixel if there are none.
struct Area {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Area {
    fn around(changed: &[bool], width: usize) -> Self {
        let (mut left, mut right) = (width, 0);
        let (mut top, mut bottom) = (usize::MAX, 0);
        for (y, row) in changed.chunks_exact(width).enumerate() {
            let Some(first) = row.iter().position(|&changed| changed) else { continue };
            let last = row.iter().rposition(|&changed| changed).unwrap_or(first);
            (left, right) = (left.min(first), right.max(last));
            (top, bottom) = (top.min(y), y);
        }
        if left > right {
            return Self { left: 0, top: 0, width: 1, height: 1 };
        }
        Self { left, top, width: right - left + 1, height: bottom - top + 1 }
    }
}

/// Colours of one frame.
struct Palette {
    colours: Vec<[u8; 3]>,
    /// `None` if every colour has its own entry.
    quantiser: Option<NeuQuant>,
}

impl Palette {
    /// Entries besides the transparent one.
    const COLOURS: usize = TRANSPARENT as usize;
    /// Approximate number of samples for training the quantiser; smaller sets are used completely,
    /// so that rare colours are not missed.
    const SAMPLES: usize = 40_000;

    fn of(pixels: &[[u8; 3]], changed: &[bool]) -> Self {
        let shown = || pixels.iter().zip(changed).filter(|(_, changed)| **changed).map(|(p, _)| *p);
        let mut distinct = BTreeSet::new();
        for colour in shown() {
            distinct.insert(colour);
            if distinct.len() > Self::COLOURS {
                let rgba: Vec<u8> = shown().flat_map(|[r, g, b]| [r, g, b, 255]).collect();
                // The quantiser takes steps of 1 to 30 pixels.
                let step = (rgba.len() / 4 / Self::SAMPLES).clamp(1, 30);
                let step = i32::try_from(step).unwrap_or(30);
                let quantiser = NeuQuant::new(step, Self::COLOURS, &rgba);
                let flat = quantiser.color_map_rgb();
                return Self { colours: flat.as_chunks().0.to_vec(), quantiser: Some(quantiser) };
            }
        }
        Self { colours: distinct.into_iter().collect(), quantiser: None }
    }

    fn index_of(&self, [r, g, b]: [u8; 3]) -> usize {
        match &self.quantiser {
            Some(quantiser) => quantiser.index_of(&[r, g, b, 255]),
            None => self.colours.binary_search(&[r, g, b]).unwrap_or(0),
        }
    }

    /// Palette indices of the area; unchanged pixels are transparent. Rounding errors are diffused
    /// to the pixels not yet drawn (Floyd–Steinberg), rows in alternating directions.
    fn draw(&self, pixels: &[[u8; 3]], changed: &[bool], area: &Area, width: usize) -> Vec<u8> {
        let mut indices = vec![TRANSPARENT; area.width * area.height];
        // Diffused errors of this row and the next, with one pixel of margin on either side.
        let mut here = vec![[0_i32; 3]; area.width + 2];
        let mut below = here.clone();
        for y in 0..area.height {
            let rightwards = y % 2 == 0;
            for step in 0..area.width {
                let x = if rightwards { step } else { area.width - 1 - step };
                let i = (area.top + y) * width + area.left + x;
                if !changed[i] {
                    continue;
                }
                let owed = here[x + 1];
                #[expect(clippy::cast_sign_loss, reason = "clamped")]
                let wanted = [0, 1, 2].map(|k| {
                    (i32::from(pixels[i][k]) + owed[k] / DITHER_PARTS).clamp(0, 255) as u8
                });
                let index =
                    self.index_of(if self.quantiser.is_some() { wanted } else { pixels[i] });
                #[expect(clippy::cast_possible_truncation, reason = "at most 255 colours")]
                let entry = index as u8;
                indices[y * area.width + x] = entry;
                let shown = self.colours[index];
                let (ahead, behind) = if rightwards { (x + 2, x) } else { (x, x + 2) };
                for k in 0..3 {
                    let error = (i32::from(wanted[k]) - i32::from(shown[k])) * DITHER;
                    here[ahead][k] += error * 7 / 16;
                    below[behind][k] += error * 3 / 16;
                    below[x + 1][k] += error * 5 / 16;
                    below[ahead][k] += error / 16;
                }
            }
            std::mem::swap(&mut here, &mut below);
            below.fill([0; 3]);
        }
        indices
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{AnimationDecoder, Delay};
    use std::io::Cursor;
    use std::time::Duration;

    const WIDTH: usize = 48;
    const HEIGHT: usize = 33;

    /// A bright square that moves over a gradient.
    fn frame(f: usize) -> Vec<u8> {
        let pixel = |x: usize, y: usize| -> [u8; 3] {
            let inside = (5 * f..5 * f + 12).contains(&x) && (4..16).contains(&y);
            let channel = |value: usize| u8::try_from(value % 256).unwrap();
            if inside { [250, 40, 30] } else { [channel(5 * x), channel(7 * y), channel(x + y)] }
        };
        (0..HEIGHT).flat_map(|y| (0..WIDTH).flat_map(move |x| pixel(x, y))).collect()
    }

    fn write(fps: f64, frames: usize, gif: bool) -> Vec<u8> {
        let path = Path::new("loop");
        let mut writer = if gif {
            AnimatedImage::Gif(GifWriter::new(Vec::new(), path, WIDTH, HEIGHT, fps).unwrap())
        } else {
            AnimatedImage::Webp(Box::new(
                WebpWriter::new(Vec::new(), path, WIDTH, HEIGHT, fps).unwrap(),
            ))
        };
        (0..frames).for_each(|f| writer.push(&frame(f)).unwrap());
        writer.finish().unwrap()
    }

    fn read(bytes: Vec<u8>, gif: bool) -> Vec<image::Frame> {
        let bytes = Cursor::new(bytes);
        if gif {
            let decoder = image::codecs::gif::GifDecoder::new(bytes).unwrap();
            decoder.into_frames().collect_frames().unwrap()
        } else {
            let decoder = image::codecs::webp::WebPDecoder::new(bytes).unwrap();
            decoder.into_frames().collect_frames().unwrap()
        }
    }

    fn seconds(frames: &[image::Frame]) -> f64 {
        frames.iter().map(|frame| Duration::from(frame.delay()).as_secs_f64()).sum()
    }

    #[test]
    #[cfg(feature = "webp")]
    fn webp_round_trips_exactly() {
        let bytes = write(30.0, 7, false);
        let decoder = webp_animation::Decoder::new(&bytes).unwrap();
        for (f, found) in decoder.into_iter().enumerate() {
            let rgb: Vec<u8> =
                found.data().chunks(4).flat_map(|rgba| &rgba[..3]).copied().collect();
            assert!(rgb == frame(f), "frame {f} reads back exactly");
        }
        // The second reader rounds when it composites frames.
        let frames = read(bytes, false);
        assert_eq!(frames.len(), 7, "frames");
        for (f, found) in frames.iter().enumerate() {
            let rgb = image::DynamicImage::from(found.buffer().clone()).to_rgb8().into_raw();
            let worst = rgb.iter().zip(frame(f)).map(|(a, b)| a.abs_diff(b)).max();
            assert!(worst <= Some(1), "frame {f}: off by {worst:?}");
        }
        assert!((seconds(&frames) - 7.0 / 30.0).abs() < 2e-3, "{} s", seconds(&frames));
    }

    #[test]
    fn gif_is_close_and_static_parts_do_not_change() {
        let frames = read(write(30.0, 6, true), true);
        assert_eq!(frames.len(), 6, "frames");
        let mut last: Option<Vec<u8>> = None;
        for (f, found) in frames.iter().enumerate() {
            let rgb = image::DynamicImage::from(found.buffer().clone()).to_rgb8().into_raw();
            let expected = frame(f);
            let error: f64 =
                rgb.iter().zip(&expected).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>()
                    / rgb.len() as f64;
            assert!(error < 6.0, "frame {f}: {error} of 255 on average");
            if let Some(last) = &last {
                // The last row never changes.
                let row = 3 * WIDTH * (HEIGHT - 1)..;
                assert!(rgb[row.clone()] == last[row], "static parts do not flicker");
            }
            last = Some(rgb);
        }
        assert!((seconds(&frames) - 0.2).abs() < 0.011, "{} s", seconds(&frames));
    }

    #[test]
    fn few_colours_are_exact_and_unchanged_frames_are_not_drawn() {
        let flat = |level: u8| [level, 0, 90].repeat(WIDTH * HEIGHT);
        let mut writer = GifWriter::new(Vec::new(), Path::new("x"), WIDTH, HEIGHT, 200.0).unwrap();
        for level in [10, 10, 11, 200] {
            writer.push(&flat(level)).unwrap();
        }
        let frames = read(writer.finish().unwrap(), true);
        let first = |f: usize| frames[f].buffer().get_pixel(5, 5).0;
        assert_eq!([0, 1, 2, 3].map(|f| first(f)[0]), [10, 10, 10, 200], "held, then drawn");
        assert_eq!(frames[3].delay(), Delay::from_numer_denom_ms(20, 1), "no shorter than 20 ms");
    }

    #[test]
    fn unsupported_sizes_are_refused() {
        let path = Path::new("x");
        assert!(GifWriter::new(Vec::new(), path, 70_000, 8, 30.0).is_err(), "GIF");
        assert!(WebpWriter::new(Vec::new(), path, 16_384, 8, 30.0).is_err(), "WebP");
    }
}
