//! Pictures inside a page.

use super::color_ramp::heat;
use super::page::escape;
use crate::failure::{Failure, Outcome};
use base64::Engine as _;
use c4d_metrics::{FLIP_PIXELS_PER_DEGREE, flip_map};
use gs_core::Image;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use std::fmt::Write as _;

/// A picture as a JPEG in a `data:` address; `quality` is 1 to 100.
pub(crate) fn data_uri(image: &Image, quality: u8) -> Outcome<String> {
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(
            &image.to_bytes(),
            side(image.width),
            side(image.height),
            if image.channels == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 },
        )
        .map_err(Failure::failed)?;
    Ok(format!(
        "data:image/jpeg;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(bytes)
    ))
}

/// Two pictures and their difference.
pub(crate) struct Triple<'a> {
    pub(crate) before: (&'a str, &'a Image),
    pub(crate) after: (&'a str, &'a Image),
    /// Caption.
    pub(crate) caption: String,
}

impl Triple<'_> {
    /// The three side by side; the map is ꟻLIP's.
    pub(crate) fn html(&self, quality: u8) -> Outcome<String> {
        let map = flip_map(self.after.1, self.before.1, FLIP_PIXELS_PER_DEGREE);
        let map = heat(&map.unwrap_or_default());
        let mut cells = String::new();
        for (title, image) in [self.before, self.after, ("perceived difference", &map)] {
            let _ = write!(
                cells,
                "<div><img alt=\"{0}\" src=\"{1}\"><span>{0}</span></div>",
                escape(title),
                data_uri(image, quality)?
            );
        }
        Ok(format!(
            "<figure class=\"triple\"><div class=\"row\">{cells}</div><figcaption>{}</figcaption></figure>",
            escape(&self.caption)
        ))
    }
}

/// Two pictures with a divider; `before` is shown on its left.
pub(crate) fn wipe(before: &Image, after: &Image, label: &str, quality: u8) -> Outcome<String> {
    Ok(format!(
        "<div class=\"wipe\"><img alt=\"before\" src=\"{}\"><img class=\"over\" alt=\"after\" src=\"{}\"><span>{}</span></div>",
        data_uri(before, quality)?,
        data_uri(after, quality)?,
        escape(label)
    ))
}
