//! MP4 files, H.264 through the built-in encoder.

use crate::failure::{Failure, Outcome};
use muxide::api::{Muxer, MuxerBuilder, VideoCodec};
use openh264::OpenH264API;
use openh264::encoder::{
    Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, QpRange, RateControlMode,
    UsageType, VuiConfig,
};
use openh264::formats::{RgbSliceU8, YUVBuffer};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Quantiser range: constant quality without visible loss for splat renders.
const QP: QpRange = QpRange::new(16, 20);
/// Smallest side of the built-in encoder, pixels.
const MIN_SIDE: usize = 16;
/// Largest long and short side of the built-in encoder, pixels.
const MAX_SIDES: (usize, usize) = (3840, 2160);
/// Seconds between key frames, so that players can seek.
const KEY_FRAME_SECS: f64 = 1.0;

/// A video being written.
pub(crate) struct VideoWriter<W: Write> {
    encoder: Encoder,
    muxer: Muxer<W>,
    path: PathBuf,
    width: usize,
    height: usize,
    fps: f64,
    frames: u32,
}

/// Size of a video of a `width`×`height` render. H.264 needs even
/// sides, so an odd last column or row is cut.
pub(crate) fn even_size(width: usize, height: usize) -> (usize, usize) {
    (width & !1, height & !1)
}

impl<W: Write> VideoWriter<W> {
    /// Starts a video of `width`×`height` RGB bytes, cut to even sides, on `writer`; `path` is for
    /// messages.
    pub(crate) fn new(
        writer: W,
        path: &Path,
        width: usize,
        height: usize,
        fps: f64,
    ) -> Outcome<Self> {
        let (width, height) = even_size(width, height);
        let (long, short) = (width.max(height), width.min(height));
        if short < MIN_SIDE || long > MAX_SIDES.0 || short > MAX_SIDES.1 {
            return Err(Failure::usage(format!(
                "a video of {width}×{height} pixels: the built-in encoder supports {MIN_SIDE} to \
                {}×{}",
                MAX_SIDES.0, MAX_SIDES.1
            ))
            .next("Choose a different --size (--side-by-side doubles the width)."));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let key_period = (fps * KEY_FRAME_SECS).clamp(1.0, 600.0) as u32;
        #[expect(clippy::cast_possible_truncation, reason = "frame rates are small")]
        let config = EncoderConfig::new()
            .rate_control_mode(RateControlMode::Off)
            .qp(QP)
            .usage_type(UsageType::CameraVideoRealTime)
            .skip_frames(false)
            .max_frame_rate(FrameRate::from_hz(fps as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(key_period))
            // The encoder library converts colours with BT.601,
            // limited range; the stream must declare it.
            .vui(VuiConfig::bt601());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)
            .map_err(|error| Failure::failed(format!("video encoder: {error}")))?;
        let size = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
        let muxer = MuxerBuilder::new(writer)
            .video(VideoCodec::H264, size(width), size(height), fps)
            .build()
            .map_err(|error| Failure::write(path, &error))?;
        Ok(Self { encoder, muxer, path: path.to_owned(), width, height, fps, frames: 0 })
    }

    /// Appends a frame of `source_width`×`source_height` RGB bytes.
    pub(crate) fn push(&mut self, rgb: &[u8], source_width: usize) -> Outcome {
        let mut cut = Vec::with_capacity(self.width * self.height * 3);
        for row in rgb.chunks_exact(source_width * 3).take(self.height) {
            cut.extend_from_slice(&row[..self.width * 3]);
        }
        let yuv = YUVBuffer::from_rgb8_source(RgbSliceU8::new(&cut, (self.width, self.height)));
        let bits = self
            .encoder
            .encode(&yuv)
            .map_err(|error| Failure::failed(format!("video encoder: {error}")))?;
        let key = matches!(bits.frame_type(), FrameType::IDR | FrameType::I);
        let data = bits.to_vec();
        self.muxer
            .write_video(f64::from(self.frames) / self.fps, &data, key)
            .map_err(|error| Failure::write(&self.path, &error))?;
        self.frames += 1;
        Ok(())
    }

    /// Completes the video and returns the writer.
    pub(crate) fn finish(mut self) -> Outcome<W> {
        self.muxer.finish_in_place().map_err(|error| Failure::write(&self.path, &error))?;
        Ok(self.muxer.into_writer())
    }
}
