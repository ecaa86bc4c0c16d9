//! Flow as bytes and as a picture: Middlebury `.flo`, colour wheel.

use crate::CuarError;
use gs_core::Image;

/// Bytes `PIEH`, the float 202021.25.
const MAGIC: [u8; 4] = *b"PIEH";
/// Written for unknown components.
const UNKNOWN: f32 = 1e10;
/// Maximum side, pixels.
const MAX_SIDE: usize = 65_536;

/// Middlebury `.flo` bytes of a flow in pixels, `[H,W,2]`: magic, `i32` width and height, then
/// `f32 u, v` row by row, little-endian. NaN is written as the format's "unknown".
///
/// # Errors
/// If the image does not have two channels, or a side does not fit the header.
pub fn encode_flo(flow: &Image) -> Result<Vec<u8>, CuarError> {
    CuarError::check("flow channels", flow.channels, 2)?;
    CuarError::check("flow", flow.data.len(), flow.width * flow.height * 2)?;
    let side = |value: usize| {
        i32::try_from(value).ok().filter(|_| value <= MAX_SIDE).ok_or_else(|| {
            CuarError::input(format!("flow image side {value}, expected at most {MAX_SIDE} pixels"))
        })
    };
    let mut bytes = Vec::with_capacity(12 + flow.data.len() * 4);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&side(flow.width)?.to_le_bytes());
    bytes.extend_from_slice(&side(flow.height)?.to_le_bytes());
    for &value in &flow.data {
        let value = if value.is_finite() { value } else { UNKNOWN };
        bytes.extend_from_slice(&value.to_le_bytes());
    }
    Ok(bytes)
}

/// Steps of the Middlebury wheel between red, yellow, green, cyan, blue, magenta and red.
const WHEEL_STEPS: [usize; 6] = [15, 6, 4, 11, 13, 6];
const WHEEL_LEN: usize = 55;

/// The Middlebury wheel: `[55]` saturated colours from 0 to 1.
fn wheel() -> [[f32; 3]; WHEEL_LEN] {
    // each segment moves one channel: (index, whether it rises)
    const MOVES: [(usize, bool); 6] =
        [(1, true), (0, false), (2, true), (1, false), (0, true), (2, false)];
    let mut colors = [[0.0; 3]; WHEEL_LEN];
    let mut color = [1.0, 0.0, 0.0];
    let mut at = 0;
    for (steps, (channel, rises)) in WHEEL_STEPS.into_iter().zip(MOVES) {
        for step in 0..steps {
            let part = (255.0 * step as f32 / steps as f32).floor() / 255.0;
            color[channel] = if rises { part } else { 1.0 - part };
            colors[at] = color;
            at += 1;
        }
        color[channel] = if rises { 1.0 } else { 0.0 };
    }
    colors
}

/// Picture of a flow `[H,W,2]`: `[H,W,3]`, values 0 to 1. Hue is the direction (Middlebury's wheel:
/// red right, yellow down, cyan left, blue up), saturation the length relative to `max_px`
/// (default: the largest finite length in the image); longer is darkened. Unknown (NaN) pixels are
/// black. A flow of other than two channels gives an empty image.
pub fn flow_wheel(flow: &Image, max_px: Option<f32>) -> Image {
    if flow.channels != 2 {
        return Image::default();
    }
    let longest = flow
        .data
        .chunks_exact(2)
        .map(|uv| uv[0].hypot(uv[1]))
        .filter(|length| length.is_finite())
        .fold(0.0, f32::max);
    let scale = max_px.unwrap_or(longest).max(f32::MIN_POSITIVE);
    let colors = wheel();
    let mut out = Image::zeros(flow.width, flow.height, 3);
    for (rgb, uv) in out.data.chunks_exact_mut(3).zip(flow.data.chunks_exact(2)) {
        let length = uv[0].hypot(uv[1]) / scale;
        if !length.is_finite() {
            continue;
        }
        let turn = (-uv[1]).atan2(-uv[0]) / std::f32::consts::PI;
        let position = (turn + 1.0) * 0.5 * (WHEEL_LEN - 1) as f32;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 54: turn lies in [-1, 1]"
        )]
        let low = (position.floor() as usize).min(WHEEL_LEN - 1);
        let fraction = position - low as f32;
        for channel in 0..3 {
            let (a, b) = (colors[low][channel], colors[(low + 1) % WHEEL_LEN][channel]);
            let pure = a + (b - a) * fraction;
            rgb[channel] = if length <= 1.0 { 1.0 - length * (1.0 - pure) } else { 0.75 * pure };
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flo_layout() {
        let flow = Image::from_data(2, 1, 2, vec![1.5, -2.0, f32::NAN, 0.0]).unwrap();
        let bytes = encode_flo(&flow).unwrap();
        assert_eq!(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]), 202_021.25);
        assert_eq!(bytes[4..12], [2, 0, 0, 0, 1, 0, 0, 0], "width, height");
        let (words, rest) = bytes[12..].as_chunks::<4>();
        let values: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
        assert_eq!(values, [1.5, -2.0, UNKNOWN, 0.0], "NaN is written as unknown");
        assert!(rest.is_empty(), "{} bytes too many", rest.len());
    }

    #[test]
    fn images_of_other_shapes_are_refused() {
        assert!(encode_flo(&Image::zeros(3, 2, 3)).is_err(), "three channels");
        assert!(encode_flo(&Image::zeros(MAX_SIDE + 1, 1, 2)).is_err(), "too wide");
    }

    #[test]
    fn wheel_directions() {
        let flow =
            Image::from_data(5, 1, 2, vec![1.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0])
                .unwrap();
        let rgb = flow_wheel(&flow, None);
        let [right, down, left, up, still] = [0, 1, 2, 3, 4].map(|x| rgb.pixel(x, 0).to_vec());
        assert!(right[0] > 0.95 && right[1] < 0.1 && right[2] < 0.3, "red: {right:?}");
        assert!(down[0] > 0.7 && down[1] > 0.85 && down[2] < 0.1, "yellow: {down:?}");
        assert!(left[0] < 0.3 && left[1] > 0.7 && left[2] > 0.9, "cyan: {left:?}");
        assert!(up[2] > 0.9 && up[1] < 0.4, "blue: {up:?}");
        assert_eq!(still, [1.0; 3], "white");
        let unknown = flow_wheel(&Image::from_data(1, 1, 2, vec![f32::NAN, 0.0]).unwrap(), None);
        assert_eq!(unknown.data, [0.0; 3], "black");
    }
}
