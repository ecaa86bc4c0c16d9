//! Losses of the formats of a render.

use crate::animated_image::GIF_MAX_FPS;
use crate::args::{Format, Pass, RenderArgs};
use crate::rates;
use gs_io::FormatLosses;

/// Losses of a render's format.
pub(super) fn losses(format: Format, args: &RenderArgs, frames: usize, fps: f64) -> FormatLosses {
    let mut losses = FormatLosses::none();
    match format {
        Format::Mp4 => {
            losses.push(
                "8 bits per channel, colour at half the resolution, slightly lossy \
                        (H.264, quantiser 16 to 20)",
            );
            losses.push("sides must be even: an odd last column or row is cut");
        }
        Format::Gif => {
            losses.push("255 colours per frame, dithered; changes of at most 3/255 are not drawn");
            if fps > GIF_MAX_FPS {
                losses.push(format!(
                    "{} frames per second become {GIF_MAX_FPS}, the highest rate that browsers \
                    play",
                    rates::rounded(fps)
                ));
            } else {
                losses.push("times are rounded to hundredths of a second");
            }
        }
        Format::Webp => {
            losses.push(
                "8 bits per channel, else exact; times are rounded to thousandths of a \
                        second",
            );
        }
        Format::Png => {
            losses.push("8 bits per channel; values are clipped to 0–1");
            if args.passes.contains(&Pass::Depth) {
                losses.push("depth is scaled to its range");
            }
            if args.passes.contains(&Pass::Flow) {
                losses.push("flow is encoded as colours");
            }
        }
        Format::Sheet if frames > 1 => {
            losses.push("8 bits per channel, reduced in size, at most twelve frames");
        }
        Format::Sheet => losses.push("8 bits per channel; values are clipped to 0–1"),
        Format::Exr | Format::Npy | Format::Flo => {}
    }
    losses
}
