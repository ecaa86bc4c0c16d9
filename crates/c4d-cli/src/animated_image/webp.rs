//! Lossless animated WebP through libwebp.

use crate::failure::{Failure, Outcome};
use std::io::Write;
use std::path::{Path, PathBuf};
use webp_animation::{ColorMode, EncoderOptions, EncodingConfig, EncodingType};

/// A lossless animated WebP.
pub(crate) struct WebpWriter<W: Write> {
    encoder: webp_animation::Encoder,
    writer: W,
    path: PathBuf,
    fps: f64,
    frames: u32,
}

impl<W: Write> WebpWriter<W> {
    /// Largest side, pixels.
    const MAX_SIDE: usize = 16_383;
    /// Compression effort; higher values take much longer for little gain.
    const EFFORT: f32 = 30.0;

    pub(crate) fn new(
        writer: W,
        path: &Path,
        width: usize,
        height: usize,
        fps: f64,
    ) -> Outcome<Self> {
        let side = |pixels: usize| match u32::try_from(pixels) {
            Ok(side) if pixels <= Self::MAX_SIDE => Ok(side),
            _ => Err(Failure::usage(format!(
                "a WebP of {width}×{height} pixels: sides are limited to {}",
                Self::MAX_SIDE
            ))
            .next("Use a different --size.")),
        };
        let options = EncoderOptions {
            color_mode: ColorMode::Rgb,
            encoding_config: Some(EncodingConfig {
                encoding_type: EncodingType::Lossless,
                quality: Self::EFFORT,
                ..EncodingConfig::default()
            }),
            ..EncoderOptions::default()
        };
        let encoder =
            webp_animation::Encoder::new_with_options((side(width)?, side(height)?), options)
                .map_err(|error| Failure::write(path, &error))?;
        Ok(Self { encoder, writer, path: path.to_owned(), fps, frames: 0 })
    }

    /// Start time of a frame, milliseconds.
    fn start(&self, frame: u32) -> i32 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let start = (f64::from(frame) * 1000.0 / self.fps).round() as i32;
        start
    }

    pub(crate) fn push(&mut self, rgb: &[u8]) -> Outcome {
        let start = self.start(self.frames);
        self.frames += 1;
        self.encoder.add_frame(rgb, start).map_err(|error| Failure::write(&self.path, &error))
    }

    pub(crate) fn finish(mut self) -> Outcome<W> {
        let end = self.start(self.frames);
        let bytes =
            self.encoder.finalize(end).map_err(|error| Failure::write(&self.path, &error))?;
        self.writer.write_all(&bytes).map_err(|error| Failure::write(&self.path, &error))?;
        Ok(self.writer)
    }
}
