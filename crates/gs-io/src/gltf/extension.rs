//! Names and axes of `KHR_gaussian_splatting`.

use crate::axes::Axes;

pub(super) const EXTENSION: &str = "KHR_gaussian_splatting";
pub(super) const SPZ_EXTENSIONS: [&str; 2] =
    ["KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz"];
/// Axes in which files are written, those of the specification first.
pub(super) const USUAL_AXES: [Axes; 3] = [Axes::LUF, Axes::PLY, Axes::RUB];

/// Attribute name of SH coefficient `k`, for example
/// `KHR_gaussian_splatting:SH_DEGREE_1_COEF_0` for 1.
pub(super) fn harmonic_name(k: usize) -> String {
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
            "degree and index within it"
        );
    }
}
