//! Writing 3DGS PLY files.

use super::layout::{LEADING, NORMALS, TRAILING};
use gs_core::{Splats, sh};
use rayon::prelude::*;
use std::io::{self, Write};

/// Rows formatted between two writes.
const BLOCK: usize = 1 << 15;
/// Rows formatted per task.
const CHUNK: usize = 1 << 11;

/// Options for writing a PLY file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WriteOptions {
    /// Write the unused columns `nx ny nz` as zeros. Default true,
    /// because readers with fixed row sizes need them.
    pub normals: bool,
    /// Comment lines of the header; line breaks become spaces.
    pub comments: Vec<String>,
    /// SH degree of the file, coefficients cut or zero-padded; `None` keeps the splats' own.
    pub sh_degree: Option<usize>,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { normals: true, comments: Vec::new(), sh_degree: None }
    }
}

impl WriteOptions {
    fn degree(&self, splats: &Splats) -> usize {
        self.sh_degree.unwrap_or(splats.sh_degree).min(sh::MAX_DEGREE)
    }

    /// Floats of a row at SH degree `degree`.
    fn columns(&self, degree: usize) -> usize {
        let normals = if self.normals { NORMALS.len() } else { 0 };
        LEADING.len() + normals + 3 * (sh::num_coeffs(degree) - 1) + TRAILING.len()
    }

    fn header(&self, rows: usize, degree: usize) -> String {
        let normals: &[&str] = if self.normals { &NORMALS } else { &[] };
        let rest = 3 * (sh::num_coeffs(degree) - 1);
        let names = LEADING[..3]
            .iter()
            .chain(normals)
            .chain(&LEADING[3..])
            .map(|&name| name.to_owned())
            .chain((0..rest).map(|i| format!("f_rest_{i}")))
            .chain(TRAILING.iter().map(|&name| name.to_owned()));
        let one_line = |comment: &String| -> String {
            comment.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
        };
        let mut lines = vec!["ply".to_owned(), "format binary_little_endian 1.0".to_owned()];
        lines.extend(self.comments.iter().map(|comment| format!("comment {}", one_line(comment))));
        lines.push(format!("element vertex {rows}"));
        lines.extend(names.map(|name| format!("property float {name}")));
        lines.push("end_header\n".to_owned());
        lines.join("\n")
    }

    /// Size of the file written by [`write()`], bytes.
    pub fn file_size(&self, splats: &Splats) -> u64 {
        let degree = self.degree(splats);
        let header = self.header(splats.len(), degree).len() as u64;
        header + splats.len() as u64 * 4 * self.columns(degree) as u64
    }
}

/// Writes a binary little-endian 3DGS PLY, columns in the order of the reference implementation.
///
/// # Errors
/// If the arrays of `splats` have inconsistent lengths ([`io::ErrorKind::InvalidInput`]) or writing
/// fails.
pub fn write(splats: &Splats, options: &WriteOptions, out: &mut impl Write) -> io::Result<()> {
    splats.check_shapes().map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
    let degree = options.degree(splats);
    out.write_all(options.header(splats.len(), degree).as_bytes())?;
    let stride = 4 * options.columns(degree);
    let mut buffer = vec![0; stride * splats.len().min(BLOCK)];
    for first in (0..splats.len()).step_by(BLOCK) {
        let rows = BLOCK.min(splats.len() - first);
        let block = &mut buffer[..rows * stride];
        block.par_chunks_mut(CHUNK * stride).enumerate().for_each(|(chunk, bytes)| {
            for (i, row) in bytes.chunks_exact_mut(stride).enumerate() {
                format_row(splats, first + chunk * CHUNK + i, degree, options.normals, row);
            }
        });
        out.write_all(block)?;
    }
    Ok(())
}

fn format_row(splats: &Splats, i: usize, degree: usize, normals: bool, row: &mut [u8]) {
    let mut cells = row.as_chunks_mut::<4>().0.iter_mut();
    let mut put = |value: f32| {
        if let Some(cell) = cells.next() {
            *cell = value.to_le_bytes();
        }
    };
    splats.means[i].into_iter().for_each(&mut put);
    if normals {
        [0.0; 3].into_iter().for_each(&mut put);
    }
    let coefficients = splats.sh_of(i);
    coefficients[0].into_iter().for_each(&mut put);
    for channel in 0..3 {
        for k in 1..sh::num_coeffs(degree) {
            put(coefficients.get(k).map_or(0.0, |rgb| rgb[channel]));
        }
    }
    put(splats.opacity_logits[i]);
    splats.log_scales[i].into_iter().for_each(&mut put);
    splats.quats[i].into_iter().for_each(&mut put);
}
