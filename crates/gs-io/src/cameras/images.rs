//! Image sizes from image headers, without decoding.

use std::path::Path;

/// Width and height of an image file, pixels; `None` if the file is missing or not a PNG or JPEG.
pub(super) fn image_size(path: &Path) -> Option<(u32, u32)> {
    let size = imagesize::size(path).ok()?;
    Some((size.width.try_into().ok()?, size.height.try_into().ok()?))
}

/// Looks up image sizes and counts missing images.
#[derive(Debug, Default)]
pub(super) struct Sizes {
    found: usize,
    missing: usize,
}

impl Sizes {
    pub(super) fn of(&mut self, path: &Path) -> Option<(u32, u32)> {
        self.of_first(&[path])
    }

    /// The size of the first of these files that exists.
    pub(super) fn of_first(&mut self, paths: &[impl AsRef<Path>]) -> Option<(u32, u32)> {
        let size = paths.iter().find_map(|path| image_size(path.as_ref()));
        *(if size.is_some() { &mut self.found } else { &mut self.missing }) += 1;
        size
    }

    /// A note with the number of missing images and the fallback.
    pub(super) fn note(&self, instead: &str) -> Option<String> {
        (self.missing > 0).then(|| {
            format!(
                "{} of {} images are missing: {instead}",
                self.missing,
                self.found + self.missing
            )
        })
    }
}

/// A size read from a file as a pixel count; 0, which is invalid for cameras, if it is out of
/// range.
pub(crate) fn pixels(size: f64) -> u32 {
    let whole = size.round();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be in range"
    )]
    let count = if (0.0..=f64::from(u32::MAX)).contains(&whole) { whole as u32 } else { 0 };
    count
}

/// Last part of a path written with either slash.
pub(super) fn basename(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// A file's name without its last extension.
pub(super) fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Whether a name has this extension, ignoring case.
pub(crate) fn has_extension(name: &str, extension: &str) -> bool {
    name.rsplit_once('.').is_some_and(|(_, found)| found.eq_ignore_ascii_case(extension))
}

/// Whether a name is that of an image.
pub(super) fn is_image(name: &str) -> bool {
    ["png", "jpg", "jpeg"].iter().any(|extension| has_extension(name, extension))
}
