//! Stands for the encoder in builds without the feature `mp4`.

use crate::failure::Outcome;
use crate::features::missing;
use std::convert::Infallible;
use std::io::Write;
use std::marker::PhantomData;
use std::path::Path;

/// A video that cannot be written.
pub(crate) struct VideoWriter<W: Write> {
    none: Infallible,
    writer: PhantomData<W>,
}

impl<W: Write> VideoWriter<W> {
    /// Always an error.
    pub(crate) fn new(
        _writer: W,
        _path: &Path,
        _width: usize,
        _height: usize,
        _fps: f64,
    ) -> Outcome<Self> {
        missing("mp4", "Use --format gif or webp").map(|none| Self { none, writer: PhantomData })
    }

    pub(crate) fn push(&mut self, _rgb: &[u8], _source_width: usize) -> Outcome {
        match self.none {}
    }

    pub(crate) fn finish(self) -> Outcome<W> {
        match self.none {}
    }
}
