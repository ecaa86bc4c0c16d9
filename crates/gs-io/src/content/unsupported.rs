//! Known file formats that are not read, recognised by their
//! first bytes, with a next step for the user.

/// A known file format that is not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnsupportedFormat {
    /// Name of the format, to complete "found …".
    pub name: &'static str,
    /// Next step for the user, a sentence.
    pub next: &'static str,
    offset: usize,
    mark: &'static [u8],
}

/// For files that `c4d` writes and does not read.
const END: &str = "It cannot be read back: keep the scene or run from which it was made for further edits and \
    exports.";
const PICTURE: &str = "c4d does not read images: use the scene instead.";
const USD: &str = "Export the splats as PLY from the program that made it, or use the scene from \
                  which it was made.";
const TORCH: &str =
    "It is part of a model: use the model's folder, which contains point_cloud/iteration_N.";

const UNPACK: &str = "Unpack it and use the contents.";

const KNOWN: [UnsupportedFormat; 22] = [
    known(0, b"Kg\0\0", "a .splatv clip", "Copy it again: it should be readable as a scene."),
    known(0, b"SP4D", "a .splat4d clip", "Copy it again: it should be readable as a scene."),
    known(
        0,
        b"#usda",
        "an OpenUSD text layer",
        "It opens in usdview, Omniverse and other programs with OpenUSD 26 or newer, but cannot \
        be read back: keep the scene or run from which it was made for further edits and exports.",
    ),
    known(0, b"PXR-USDC", "a binary USD", USD),
    known(0, b"\x894DGS", "a .4dgs clip", "Copy it again: it should be readable as a scene."),
    known(4, b"ftyp", "an MP4 video", END),
    known(8, b"WEBP", "a WebP image or clip", END),
    known(0, b"GIF8", "a GIF image or clip", END),
    known(0, b"\x89PNG", "a PNG image", PICTURE),
    known(0, b"\xff\xd8\xff", "a JPEG image", PICTURE),
    known(0, b"\x76\x2f\x31\x01", "an OpenEXR image", PICTURE),
    known(0, b"PIEH", "a Middlebury flow image", PICTURE),
    known(0, b"\x93NUMPY", "a NumPy array", "c4d reads only the array file poses_bounds.npy."),
    known(
        0,
        b"\x80\x02\x8a\x0al\xfc\x9cF",
        "a PyTorch file from before version 1.6",
        "It can be read as part of a model: use the model's folder.",
    ),
    known(0, b"Namespace(", "the cfg_args of a model", TORCH),
    known(0, b"\x1f\x8b", "a gzip archive", "Unpack it (gunzip) and use the contents."),
    known(0, b"BZh", "a bzip2 archive", UNPACK),
    known(0, b"\xfd7zXZ\0", "an xz archive", UNPACK),
    known(0, b"\x28\xb5\x2f\xfd", "a Zstandard archive", UNPACK),
    known(0, b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", UNPACK),
    known(0, b"Rar!\x1a\x07", "a RAR archive", UNPACK),
    known(257, b"ustar", "a tar archive", UNPACK),
];

const fn known(
    offset: usize,
    mark: &'static [u8],
    name: &'static str,
    next: &'static str,
) -> UnsupportedFormat {
    UnsupportedFormat { name, next, offset, mark }
}

/// A PyTorch archive, recognised by its zip entries.
const TORCH_ARCHIVE: UnsupportedFormat = known(0, b"", "a PyTorch archive", TORCH);

/// Networks without splats, recognised by a name in the file; the first match is used.
const NETWORKS: [(&[u8], UnsupportedFormat); 6] = [
    (b"feature_out_f", known(0, b"", "the network of an E-D3DGS model", NEXT_TO_PLY)),
    (b"deformation_net", known(0, b"", "the network of a 4DGaussians model", NEXT_TO_PLY)),
    (b"xyzt_encoding", known(0, b"", "the network of a DASH model", NEXT_TO_FOLDER)),
    (b"xyt_encoding", known(0, b"", "the network of a Grid4D model", NEXT_TO_FOLDER)),
    (b"_node_radius", known(0, b"", "the control nodes of an SC-GS model", NEXT_TO_FOLDER)),
    (
        b"gaussian_warp",
        known(0, b"", "the network of a Deformable-3D-Gaussians model", NEXT_TO_FOLDER),
    ),
];
const NEXT_TO_PLY: &str = "It contains no splats. Rename it to deformation.pth, put it next to point_cloud/iteration_N/point_cloud.ply from the same training run, and use the folder that contains point_cloud and cfg_args.";
const NEXT_TO_FOLDER: &str = "It contains no splats. Put it at deform/iteration_N/deform.pth, where deform is next to the folder point_cloud from the same training run, and use the folder that contains both.";

/// A PyTorch archive that does not contain a scene, by its first bytes.
pub(crate) fn torch_archive(start: &[u8]) -> UnsupportedFormat {
    let has = |mark: &[u8]| start.windows(mark.len()).any(|window| window == mark);
    NETWORKS.iter().find(|(mark, _)| has(mark)).map_or(TORCH_ARCHIVE, |(_, format)| *format)
}

/// Arrays of NumPy in a zip archive.
pub(crate) const NUMPY_ARCHIVE: UnsupportedFormat = known(
    0,
    b"",
    "a NumPy archive",
    "c4d reads only the NumPy files poses_bounds.npy and params.npz (Dynamic 3D Gaussians): \
    export the splats as PLY from the program that made them.",
);

/// The manifest that `c4d export` writes next to a sequence; a text file, recognised by its name.
pub(crate) const MANIFEST: UnsupportedFormat = known(
    0,
    b"",
    "the manifest of an exported sequence",
    "It records the frame rate and times of the sequence of the same name; run c4d info on that sequence.",
);
/// End of the manifest's name.
pub(crate) const MANIFEST_ENDING: &str = ".manifest.json";

/// Pointers that version-control systems write in place of large files.
const POINTERS: [UnsupportedFormat; 4] = [
    known(
        0,
        b"version https://git-lfs.github.com/spec/",
        "a Git LFS pointer",
        "Fetch the file: `git lfs install`, then `git lfs pull` in its repository, or download it from the repository's web page.",
    ),
    known(
        0,
        b"version http://git-media.io/",
        "a Git LFS pointer",
        "Fetch the file: `git lfs pull` in its repository.",
    ),
    known(
        0,
        b"# xet version",
        "a Xet pointer",
        "Fetch the file: `git xet checkout` in its repository, or download it from the repository's web page.",
    ),
    known(
        0,
        b"/annex/objects/",
        "a git-annex pointer",
        "Fetch the file: `git annex get` in its repository.",
    ),
];

/// A web page saved or sent instead of a file.
const HTML: UnsupportedFormat = known(
    0,
    b"",
    "an HTML page",
    "A clip that c4d exported as HTML plays in a browser; keep the scene or run from which it was \
    made. Any other page was saved instead of the download: download the file itself.",
);
/// Beginnings of such pages after white space, ignoring case.
const PAGES: [&[u8]; 3] = [b"<!doctype html", b"<html", b"<head"];

/// An error message of a web server or API in place of a file.
const ANSWER: UnsupportedFormat = known(
    0,
    b"",
    "an error message from a web server",
    "Open it as text to see why the download failed, then download the file itself.",
);
/// Beginnings of such messages after white space, ignoring case; for JSON objects the first key.
const ANSWERS: [&[u8]; 14] = [
    b"<?xml",
    b"<error",
    b"404",
    b"403",
    b"not found",
    b"entry not found",
    b"repository not found",
    b"access denied",
    b"forbidden",
    b"unauthorized",
    b"invalid username or password",
    b"too many requests",
    b"internal server error",
    b"bad gateway",
];
const ANSWER_KEYS: [&[u8]; 7] = [
    b"\"error\"",
    b"\"errors\"",
    b"\"message\"",
    b"\"detail\"",
    b"\"status\"",
    b"\"statuscode\"",
    b"\"success\"",
];

/// Scenes of the GaussianSplats3D viewer.
const KSPLAT: UnsupportedFormat = known(
    0,
    b"",
    "a .ksplat scene",
    "Convert it to PLY, for example with SuperSplat or splat-transform, or use the file from \
    which it was made.",
);
/// Largest plausible numbers of sections and splats of a `.ksplat`; its magic alone is not unique.
const KSPLAT_MAX_SECTIONS: u32 = 1 << 20;
const KSPLAT_MAX_SPLATS: u32 = 1 << 30;

impl UnsupportedFormat {
    /// The format indicated by the first bytes of a file.
    pub(crate) fn of(start: &[u8]) -> Option<Self> {
        Self::stand_in(start)
            .or_else(|| KNOWN.iter().find(|kind| kind.is_at_start_of(start)).copied())
            .or_else(|| is_ksplat(start).then_some(KSPLAT))
    }

    /// A stand-in for a file, by its first bytes: a pointer of Git LFS or
    /// similar, a web page, or a server's error message.
    pub fn stand_in(start: &[u8]) -> Option<Self> {
        if let Some(pointer) = POINTERS.iter().find(|kind| kind.is_at_start_of(start)) {
            return Some(*pointer);
        }
        let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
        let begins = |text: &[u8], with: &[u8]| {
            text.get(..with.len()).is_some_and(|found| found.eq_ignore_ascii_case(with))
        };
        if PAGES.iter().any(|page| begins(start, page)) {
            return Some(HTML);
        }
        let key = start.strip_prefix(b"{").map(<[u8]>::trim_ascii_start);
        let is_answer = ANSWERS.iter().any(|answer| begins(start, answer))
            || key.is_some_and(|text| ANSWER_KEYS.iter().any(|key| begins(text, key)));
        is_answer.then_some(ANSWER)
    }

    fn is_at_start_of(&self, start: &[u8]) -> bool {
        start
            .get(self.offset..self.offset + self.mark.len())
            .is_some_and(|found| found.eq_ignore_ascii_case(self.mark))
    }
}

/// Version 0.1, then the capacity and number of sections, the capacity and number of splats.
fn is_ksplat(start: &[u8]) -> bool {
    let Some(rest) = start.strip_prefix(&[0, 1, 0, 0]) else { return false };
    let mut counts = rest.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
    let mut next = || counts.next().unwrap_or_default();
    let (max_sections, sections, max_splats, splats) = (next(), next(), next(), next());
    (1..=max_sections).contains(&sections)
        && max_sections <= KSPLAT_MAX_SECTIONS
        && (1..=max_splats).contains(&splats)
        && max_splats <= KSPLAT_MAX_SPLATS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn magic_bytes_are_found_at_their_offsets() {
        let name = |start: &[u8]| UnsupportedFormat::of(start).map(|kind| kind.name);
        assert_eq!(
            name(b"\0\0\0\x18ftypisom"),
            Some("an MP4 video"),
            "magic bytes not at the start"
        );
        assert_eq!(name(b"<!DOCTYPE html>"), Some("an HTML page"), "ignoring case");
        assert_eq!(
            name(b"\xef\xbb\xbf\r\n<HTML lang=en>"),
            Some("an HTML page"),
            "any form of beginning"
        );
        for answer in [
            &b"404: Not Found"[..],
            b"<?xml version=\"1.0\"?><Error><Code>NoSuchKey</Code></Error>",
            b"{\"error\":\"Repository not found\"}",
            b"{ \"Message\": \"denied\"}",
            b"Access Denied",
        ] {
            assert_eq!(name(answer), Some("an error message from a web server"), "{answer:?}");
        }
        assert_eq!(name(b"\x1f\x8b\x08"), Some("a gzip archive"), "packed");
        assert_eq!(name(&[&[0; 257][..], b"ustar"].concat()), Some("a tar archive"), "packed");
        assert_eq!(name(b"RIFF"), None, "truncated before the magic bytes");
        assert_eq!(name(b""), None, "nothing");
        let network = |start: &[u8]| torch_archive(start).name;
        assert!(network(b"PK gaussian_warp _node_radius").contains("SC-GS"), "more specific");
        assert!(network(b"PK gaussian_warp").contains("Deformable"), "network");
        assert_eq!(network(b"PK weights"), "a PyTorch archive", "any other");
    }

    #[test]
    fn pointers_are_distinguished_from_files() {
        let lfs = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n";
        assert_eq!(
            UnsupportedFormat::stand_in(lfs).map(|kind| kind.name),
            Some("a Git LFS pointer"),
            "LFS"
        );
        for whole in
            [&b"version 3"[..], b"ply\n", b"PK\x03\x04", b"[1, 2]", b"{\"frames\": []}", b""]
        {
            assert_eq!(UnsupportedFormat::stand_in(whole), None, "{whole:?} is the file itself");
        }
    }

    #[test]
    fn formats_without_magic_are_recognised_by_their_numbers() {
        let ksplat = |counts: [u32; 4]| {
            let counts = counts.iter().flat_map(|count| count.to_le_bytes());
            [0_u8, 1, 0, 0].into_iter().chain(counts).collect::<Vec<u8>>()
        };
        let name = |bytes: &[u8]| UnsupportedFormat::of(bytes).map(|kind| kind.name);
        assert_eq!(name(&ksplat([1, 1, 40, 40])), Some("a .ksplat scene"), "one section");
        assert_eq!(name(&ksplat([1, 2, 40, 40])), None, "more sections than there is room for");
        assert_eq!(name(&ksplat([0x8000_0f00, 3, 1, 1])), None, "a TrueType font");
    }
}
