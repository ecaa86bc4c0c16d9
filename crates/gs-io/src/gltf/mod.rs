//! glTF 2.0 with Gaussian splats (`KHR_gaussian_splatting`, ratified by Khronos): `.glb` and
//! `.gltf` in and out, one frame.
//!
//! Splats are point primitives with an attribute each for centre, rotation (`xyzw`), standard
//! deviations (linear), opacity (linear) and every SH coefficient (the 3DGS basis). Attributes may
//! be quantised, sparse and interleaved; nodes place, turn and scale them, and all of that is
//! applied. SPZ inside (`KHR_gaussian_splatting_compression_spz`, also `_2`) is read.
//!
//! Axes: glTF names the sides of an asset left (x), up (y), front (z), [`Axes::LUF`];
//! splat-transform writes that, others RUB, or the axes of a PLY unchanged. See
//! [`AxesReading`](crate::AxesReading).

mod accessor;
mod container;
mod document;
mod ellipsoid;
mod node;
mod primitive;
mod read;
mod write;

pub(crate) use container::{GLB_MARK, looks_like_json};
pub use read::{External, read};
pub use write::{WriteOptions, write};

use crate::axes::Axes;

const FORMAT: &str = "glTF";
const EXTENSION: &str = "KHR_gaussian_splatting";
const SPZ_EXTENSIONS: [&str; 2] =
    ["KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz"];
/// Axes in which files are written, those of the specification first.
const USUAL_AXES: [Axes; 3] = [Axes::LUF, Axes::PLY, Axes::RUB];
/// Types of GLB chunks.
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// Attribute of SH coefficient `k` of all, for example `KHR_gaussian_splatting:SH_DEGREE_1_COEF_0`
/// for 1.
fn harmonic_name(k: usize) -> String {
    let degree = k.isqrt();
    format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_{}", k - degree * degree)
}

#[cfg(test)]
mod tests {
    use super::harmonic_name;

    #[test]
    fn coefficients_have_the_names_of_the_specification() {
        let short = |k| harmonic_name(k).replace("KHR_gaussian_splatting:SH_DEGREE_", "");
        assert_eq!(
            [0, 1, 3, 4, 8, 9, 15].map(short),
            ["0_COEF_0", "1_COEF_0", "1_COEF_2", "2_COEF_0", "2_COEF_4", "3_COEF_0", "3_COEF_6"],
            "degree and place in it"
        );
    }
}
