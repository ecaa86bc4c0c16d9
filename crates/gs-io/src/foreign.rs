//! Files that are known but not read here, by their first bytes: what they are, and what to do.

/// A kind of file that is known but not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Foreign {
    /// What it is, as in "found …".
    pub name: &'static str,
    /// What to do with it, a sentence.
    pub next: &'static str,
    offset: usize,
    mark: &'static [u8],
}

/// For files that `c4d` writes and does not read.
const END: &str =
    "It is an end product: keep the scene or run that it was made from, to edit and export again.";
const PICTURE: &str = "c4d renders images and reads none: give the scene, not a picture of it.";
const USD: &str = "Export the splats as PLY from the program that made it, or give the scene that it was made from.";
const TORCH: &str =
    "It is a part of a model: give the model's folder, which holds point_cloud/iteration_N.";

const KNOWN: [Foreign; 17] = [
    known(0, b"Kg\0\0", "a .splatv clip", "Copy it again: it should open as a scene."),
    known(0, b"SP4D", "a .splat4d clip", "Copy it again: it should open as a scene."),
    known(
        0,
        b"#usda",
        "an OpenUSD text layer",
        "It opens in usdview, Omniverse and other programs with OpenUSD 26 or newer. It is an end product: keep the scene or run that it was made from, to edit and export again.",
    ),
    known(0, b"PXR-USDC", "a binary USD", USD),
    known(
        0,
        b"\x894DGS",
        "a .4dgs clip",
        "Export it as a PLY sequence from the program that made it.",
    ),
    known(0, b"glTF", "a binary glTF", "Export the splats as PLY from the program that made it."),
    known(
        0,
        b"<!doctype html",
        "an HTML page",
        "If c4d wrote it, open it in a browser: it plays by itself. It is an end product: keep the scene or run that it was made from.",
    ),
    known(4, b"ftyp", "an MP4 video", END),
    known(8, b"WEBP", "a WebP image or clip", END),
    known(0, b"GIF8", "a GIF image or clip", END),
    known(0, b"\x89PNG", "a PNG image", PICTURE),
    known(0, b"\xff\xd8\xff", "a JPEG image", PICTURE),
    known(0, b"\x76\x2f\x31\x01", "an OpenEXR image", PICTURE),
    known(0, b"PIEH", "a Middlebury flow image", PICTURE),
    known(0, b"\x93NUMPY", "a NumPy array", "Of arrays, c4d reads poses_bounds.npy only."),
    known(
        0,
        b"\x80\x02\x8a\x0al\xfc\x9cF",
        "a PyTorch file of before version 1.6",
        "Load and save it with a newer PyTorch; then give the folder of its model.",
    ),
    known(0, b"Namespace(", "the cfg_args of a model", TORCH),
];

const fn known(
    offset: usize,
    mark: &'static [u8],
    name: &'static str,
    next: &'static str,
) -> Foreign {
    Foreign { name, next, offset, mark }
}

/// A PyTorch archive: a zip whose entries say so.
pub(crate) const TORCH_ARCHIVE: Foreign = known(0, b"", "a PyTorch archive", TORCH);

/// Arrays of NumPy in a zip archive.
pub(crate) const NUMPY_ARCHIVE: Foreign = known(
    0,
    b"",
    "a NumPy archive",
    "Of arrays, c4d reads poses_bounds.npy only: export the splats as PLY from the program that made them.",
);

/// What `c4d export` writes beside a sequence; text, so its name says it.
pub(crate) const MANIFEST: Foreign = known(
    0,
    b"",
    "the manifest of an exported sequence",
    "It notes frame rate and times of the sequence of the same name: c4d info of that says more.",
);
/// End of its name.
pub(crate) const MANIFEST_ENDING: &str = ".manifest.json";

impl Foreign {
    /// The kind that the first bytes of a file announce.
    pub(crate) fn of(start: &[u8]) -> Option<Self> {
        let is = |kind: &&Self| {
            start
                .get(kind.offset..kind.offset + kind.mark.len())
                .is_some_and(|found| found.eq_ignore_ascii_case(kind.mark))
        };
        KNOWN.iter().find(is).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_found_where_they_are() {
        let name = |start: &[u8]| Foreign::of(start).map(|kind| kind.name);
        assert_eq!(name(b"\0\0\0\x18ftypisom"), Some("an MP4 video"), "not at the start");
        assert_eq!(name(b"<!DOCTYPE html>"), Some("an HTML page"), "whatever the case");
        assert_eq!(name(b"RIFF"), None, "cut before the mark");
        assert_eq!(name(b""), None, "nothing");
    }
}
