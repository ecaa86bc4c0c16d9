//! `cameras.txt` and `images.txt`: one line per camera, two lines per image, comments after `#`.

use super::{ColmapCamera, ColmapImage, lens_models::by_name};
use crate::cameras::CamerasError;
use std::str::FromStr;

/// Largest number of characters of a line that are quoted in a message.
const SHOWN: usize = 60;

fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()))
}

fn shown(line: &str) -> String {
    format!("`{}`", line.chars().take(SHOWN).collect::<String>())
}

fn number<T: FromStr>(field: Option<&str>, at: &str, what: &str) -> Result<T, CamerasError> {
    let text = field.ok_or_else(|| CamerasError::malformed(at, what, "the end of the line"))?;
    text.parse().map_err(|_unparsable| CamerasError::malformed(at, what, shown(text)))
}

/// Parses a `cameras.txt`: lines `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`.
///
/// # Errors
/// If a line does not have that form, or names an unknown model.
pub fn parse_cameras_txt(text: &str) -> Result<Vec<ColmapCamera>, CamerasError> {
    let mut cameras = Vec::new();
    for (line_number, line) in lines(text) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let at = format!("line {line_number}");
        let mut fields = line.split_ascii_whitespace();
        let id = number(fields.next(), &at, "a camera id")?;
        let name = fields.next().unwrap_or_default();
        let (model, params) = by_name(name).ok_or_else(|| {
            CamerasError::malformed(&at, "the name of a lens model, such as PINHOLE", shown(name))
        })?;
        let width = number(fields.next(), &at, "a width")?;
        let height = number(fields.next(), &at, "a height")?;
        let params = (0..params)
            .map(|_| number(fields.next(), &at, &format!("{params} parameters of {model}")))
            .collect::<Result<_, _>>()?;
        cameras.push(ColmapCamera { id, model, width, height, params });
    }
    Ok(cameras)
}

/// Parses an `images.txt`: per image a line `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, then a
/// line of points, which may be empty.
///
/// # Errors
/// If a line does not have that form.
pub fn parse_images_txt(text: &str) -> Result<Vec<ColmapImage>, CamerasError> {
    let mut images = Vec::new();
    let mut lines = lines(text);
    while let Some((line_number, line)) = lines.next() {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let at = format!("line {line_number}");
        let mut fields = line.split_ascii_whitespace();
        let id = number(fields.next(), &at, "an image id")?;
        let mut numbers = [0.0; 7];
        for value in &mut numbers {
            *value = number(fields.next(), &at, "a quaternion and a translation (7 numbers)")?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        let camera_id = number(fields.next(), &at, "a camera id")?;
        // The rest of the line, because names may contain spaces.
        let name = fields.collect::<Vec<_>>().join(" ");
        if name.is_empty() {
            return Err(CamerasError::malformed(&at, "an image name", "the end of the line"));
        }
        images.push(ColmapImage {
            id,
            quat: [w, x, y, z],
            translation: [tx, ty, tz],
            camera_id,
            name,
        });
        let Some((points_number, points)) = lines.next() else { break };
        let fields = points.split_ascii_whitespace();
        if fields.clone().count() % 3 != 0 || fields.clone().any(|f| f.parse::<f64>().is_err()) {
            return Err(CamerasError::malformed(
                format!("line {points_number}"),
                "the points of the image above (X Y POINT_ID …, or an empty line)",
                shown(points),
            ));
        }
    }
    Ok(images)
}
