//! Mapping of PLY columns to the parameters of a Gaussian.

use super::PlyError;
use super::appearance::{self, Appearance};
use super::header::{Element, Header, PropertyKind};
use gs_core::sh;
use std::collections::HashMap;

/// A Gaussian scene as declared in the header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// `N`.
    pub num_splats: u64,
    /// SH degree, from the number of `f_rest_*` columns; at most 3, higher ones are cut.
    pub sh_degree: usize,
    /// Whether all of `nx`, `ny`, `nz` are present.
    pub has_normals: bool,
    /// Columns that are not part of the 3DGS layout.
    pub extra_columns: Vec<String>,
    /// Index of the element.
    pub(crate) element: usize,
    /// Property index of: x y z, dc, rest (channel-major), opacity, scale, rot, and the filter if
    /// there is one.
    pub(crate) columns: Vec<usize>,
    pub(crate) appearance: Appearance,
}

/// Columns before the `f_rest_*`.
pub(crate) const LEADING: [&str; 6] = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"];
/// Columns after them.
pub(crate) const TRAILING: [&str; 8] =
    ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];
/// Unused columns that 3DGS writes.
pub(crate) const NORMALS: [&str; 3] = ["nx", "ny", "nz"];

impl Header {
    /// Finds the columns of a Gaussian scene.
    ///
    /// # Errors
    /// If the file is of a different kind, or has no rows.
    pub fn gaussians(&self) -> Result<Layout, PlyError> {
        let element = self.elements.iter().position(|element| element.name == "vertex");
        let packed =
            |element: &Element| element.properties.iter().any(|p| p.name == "packed_position");
        if self.elements.first().is_some_and(|first| first.name == "chunk")
            || element.is_some_and(|index| packed(&self.elements[index]))
        {
            return Err(PlyError::Compressed);
        }
        let names = |element: &Element| -> Vec<String> {
            element.properties.iter().map(|property| property.name.clone()).collect()
        };
        let Some(element) = element else {
            let found: Vec<&str> = self.elements.iter().map(|e| e.name.as_str()).collect();
            return Err(PlyError::MissingColumns {
                missing: vec!["element vertex".to_owned()],
                looks_like: format!("a file with the elements {}", list_or_none(&found)),
                next: NEXT,
            });
        };
        let vertex = &self.elements[element];
        // One pass over the names; searching the list for each would take quadratic time.
        let scalars: HashMap<&str, usize> = vertex
            .properties
            .iter()
            .enumerate()
            .filter(|(_, property)| matches!(property.kind, PropertyKind::Scalar(_)))
            .map(|(index, property)| (property.name.as_str(), index))
            .collect();
        let scalar = |name: &str| scalars.get(name).copied();
        let rest = names(vertex).iter().filter(|name| rest_index(name).is_some()).count();
        let mut missing = Vec::new();
        let mut column = |name: &str| {
            scalar(name).unwrap_or_else(|| {
                missing.push(name.to_owned());
                0
            })
        };
        let mut columns: Vec<usize> = LEADING[..3].iter().map(|name| column(name)).collect();
        let has_dc = LEADING[3..].iter().any(|name| scalar(name).is_some());
        let rgb = appearance::RGB.map(scalar);
        let mut look = Appearance::default();
        if let (false, [Some(red), Some(_), Some(_)]) = (has_dc, rgb) {
            look.rgb = appearance::scalar_type(vertex, red);
            columns.extend(rgb.into_iter().flatten());
        } else {
            columns.extend(LEADING[3..].iter().map(|name| column(name)));
        }
        let rest_columns: Vec<usize> = (0..rest).map(|i| column(&format!("f_rest_{i}"))).collect();
        columns.push(column(TRAILING[0]));
        let scales = [1, 2, 3].map(|axis| scalar(TRAILING[axis]));
        look.surfels = matches!(scales, [Some(_), Some(_), None]);
        look.isotropic = matches!(scales, [Some(_), None, None]);
        let axes = match (look.isotropic, look.surfels) {
            (true, _) => [1, 1, 1],
            // Surfels: an arbitrary column, whose values are replaced.
            (_, true) => [1, 2, 2],
            _ => [1, 2, 3],
        };
        columns.extend(axes.iter().map(|&axis| column(TRAILING[axis])));
        columns.extend(TRAILING[4..].iter().map(|name| column(name)));
        if let Some(filter) = scalar(appearance::FILTER) {
            look.filter = true;
            columns.push(filter);
        }
        if !missing.is_empty() {
            let looks_like = looks_like(&names(vertex));
            return Err(PlyError::MissingColumns { missing, looks_like, next: NEXT });
        }
        let stored = degree_of_rest(rest).ok_or(PlyError::ShColumns { found: rest })?;
        let sh_degree = stored.min(sh::MAX_DEGREE);
        look.cut_degree = (stored > sh_degree).then_some(stored);
        // The first coefficients of each channel are kept.
        let kept = sh::num_coeffs(sh_degree) - 1;
        let channels = rest_columns.chunks(rest_columns.len() / 3 + usize::from(rest == 0));
        let kept: Vec<usize> = channels.flat_map(|channel| &channel[..kept]).copied().collect();
        columns.splice(6..6, kept);
        if vertex.count == 0 {
            return Err(PlyError::Empty);
        }
        let used = |name: &str| {
            LEADING.contains(&name)
                || TRAILING.contains(&name)
                || NORMALS.contains(&name)
                || rest_index(name).is_some()
                || name == appearance::FILTER
                || (look.rgb.is_some() && appearance::RGB.contains(&name))
        };
        Ok(Layout {
            num_splats: vertex.count,
            sh_degree,
            has_normals: NORMALS.iter().all(|name| scalar(name).is_some()),
            extra_columns: names(vertex).into_iter().filter(|name| !used(name)).collect(),
            element,
            columns,
            appearance: look,
        })
    }
}

/// SH degree of a file with `rest` `f_rest_*` columns.
fn degree_of_rest(rest: usize) -> Option<usize> {
    /// Highest degree that is accepted and cut; no trainer exceeds 4.
    const HIGHEST: usize = 10;
    (0..=HIGHEST).find(|degree| 3 * ((degree + 1) * (degree + 1) - 1) == rest)
}

const NEXT: &str = "export a \"Gaussian Splat PLY\" from your editor";

fn rest_index(name: &str) -> Option<usize> {
    name.strip_prefix("f_rest_")?.parse().ok()
}

fn list_or_none(names: &[&str]) -> String {
    if names.is_empty() { "(none)".to_owned() } else { names.join(", ") }
}

/// Probable kind of a vertex table without the Gaussian columns.
fn looks_like(names: &[String]) -> String {
    let has = |name: &str| names.iter().any(|found| found == name);
    let starts = |prefix: &str| names.iter().any(|found| found.starts_with(prefix));
    let guess = if starts("f_anchor_feat") || starts("f_offset") {
        "anchors of Scaffold-GS, whose Gaussians only its network can generate"
    } else if has("scale_1") && !has("scale_2") && has("rot_0") {
        "2D Gaussian surfels (2DGS)"
    } else if has("x") && has("red") && !has("rot_0") {
        "a plain point cloud"
    } else if has("x") && !has("rot_0") {
        "a plain point cloud or mesh"
    } else {
        "Gaussians of a different kind"
    };
    let shown: Vec<&str> = names.iter().map(String::as_str).take(12).collect();
    let more = if names.len() > shown.len() { ", …" } else { "" };
    format!("{guess} with {}{more}", list_or_none(&shown))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(columns: &[&str], count: u64) -> Result<Layout, PlyError> {
        use std::fmt::Write;
        let mut text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n");
        for column in columns {
            writeln!(text, "property float {column}").unwrap();
        }
        Header::parse(format!("{text}end_header\n").as_bytes()).unwrap().gaussians()
    }

    #[test]
    fn any_order_and_extra_columns() {
        let mut columns: Vec<&str> = TRAILING.iter().chain(&LEADING).copied().collect();
        columns.insert(3, "label");
        let found = layout(&columns, 5).unwrap();
        assert_eq!((found.num_splats, found.sh_degree), (5, 0), "size");
        assert_eq!(found.extra_columns, ["label"], "extra");
        assert!(!found.has_normals, "normals are optional");
    }

    #[test]
    fn other_kinds_of_files_are_named() {
        let cases: [(&[&str], &str); 4] = [
            (&["x", "y", "z", "red", "green", "blue"], "a plain point cloud with x, y, z, red"),
            (&["x", "y", "z", "f_offset_0", "f_anchor_feat_0"], "Scaffold-GS"),
            (&["x", "scale_0", "scale_1", "rot_0"], "2DGS"),
            (&["rot_0", "y"], "a different kind"),
        ];
        for (columns, needle) in cases {
            let error = layout(columns, 1).unwrap_err().to_string();
            assert!(error.contains(needle), "{error}");
            assert!(error.contains("opacity"), "names what is missing: {error}");
        }
        let all: Vec<&str> = LEADING.iter().chain(&TRAILING).copied().collect();
        assert_eq!(layout(&all, 0), Err(PlyError::Empty), "no rows");
        let odd: Vec<&str> = all.iter().copied().chain(["f_rest_0", "f_rest_1"]).collect();
        assert_eq!(layout(&odd, 1), Err(PlyError::ShColumns { found: 2 }), "odd count");
        let gap: Vec<&str> = all.iter().copied().chain(["f_rest_7"]).collect();
        assert!(matches!(layout(&gap, 1), Err(PlyError::MissingColumns { .. })), "gap");
    }

    #[test]
    fn columns_that_affect_the_appearance_are_found() {
        let all: Vec<&str> = LEADING.iter().chain(&TRAILING).copied().collect();
        let without = |gone: &[&str]| -> Vec<&str> {
            all.iter().copied().filter(|name| !gone.contains(name)).collect()
        };
        let rgb = [without(&["f_dc_0", "f_dc_1", "f_dc_2"]), vec!["red", "green", "blue"]].concat();
        let found = layout(&rgb, 1).unwrap();
        assert_eq!(found.appearance.rgb, Some(super::super::Scalar::F32), "colours");
        assert!(found.extra_columns.is_empty(), "they are used: {:?}", found.extra_columns);
        let both = [all.clone(), vec!["red", "green", "blue"]].concat();
        let found = layout(&both, 1).unwrap();
        assert_eq!((found.appearance.rgb, found.extra_columns.len()), (None, 3), "SH win");
        assert!(layout(&rgb[..rgb.len() - 1], 1).is_err(), "two channels are not a colour");
        assert!(layout(&without(&["scale_2"]), 1).unwrap().appearance.surfels, "surfels");
        assert!(layout(&without(&["scale_1"]), 1).is_err(), "a different axis is missing");
        let balls = layout(&without(&["scale_1", "scale_2"]), 1).unwrap();
        assert!(balls.appearance.isotropic, "one size for all axes");
        assert!(layout(&without(&["scale_0", "scale_1", "scale_2"]), 1).is_err(), "no size");
        let filtered = [all.clone(), vec!["filter_3D"]].concat();
        let found = layout(&filtered, 1).unwrap();
        assert!(found.appearance.filter && found.extra_columns.is_empty(), "a filter");
        assert_eq!(found.columns.last(), Some(&all.len()), "its column");
        let names: Vec<String> = (0..72).map(|i| format!("f_rest_{i}")).collect();
        let higher = [all, names.iter().map(String::as_str).collect()].concat();
        let found = layout(&higher, 1).unwrap();
        assert_eq!((found.sh_degree, found.appearance.cut_degree), (3, Some(4)), "degree 4");
        // Channel 1 begins at f_rest_24 in the file, and at the 16th kept coefficient.
        assert_eq!((found.columns[6], found.columns[6 + 15]), (14, 14 + 24), "by channel");
    }

    #[test]
    fn compressed_files_are_named() {
        let text = "ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\nelement vertex 1\nproperty uint packed_position\nend_header\n";
        let header = Header::parse(text.as_bytes()).unwrap();
        assert_eq!(header.gaussians(), Err(PlyError::Compressed), "chunk first");
    }
}
