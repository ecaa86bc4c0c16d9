//! Stands for the encoder in builds without the feature `webp`.

use crate::failure::Outcome;
use crate::features::missing;
use std::convert::Infallible;
use std::io::Write;
use std::marker::PhantomData;
use std::path::Path;

/// An animated WebP that cannot be written.
pub(crate) struct WebpWriter<W: Write> {
    none: Infallible,
    writer: PhantomData<W>,
}

impl<W: Write> WebpWriter<W> {
    /// Always an error.
    pub(crate) fn new(
        _writer: W,
        _path: &Path,
        _width: usize,
        _height: usize,
        _fps: f64,
    ) -> Outcome<Self> {
        missing("webp", "Use --format gif or mp4").map(|none| Self { none, writer: PhantomData })
    }

    pub(crate) fn push(&mut self, _rgb: &[u8]) -> Outcome {
        match self.none {}
    }

    pub(crate) fn finish(self) -> Outcome<W> {
        match self.none {}
    }
}
