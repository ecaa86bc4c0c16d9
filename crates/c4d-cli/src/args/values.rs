//! Values of flags: image sizes, crops, colours.

/// Part of an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crop {
    pub(crate) size: (u32, u32),
    /// Column and row of the first pixel.
    pub(crate) origin: [u32; 2],
}

pub(super) fn parse_crop(text: &str) -> Result<Crop, String> {
    let parse = || {
        let mut parts = text.split('+');
        let size = parse_size(parts.next()?).ok()?;
        let mut side = || parts.next()?.trim().parse().ok().filter(|side| *side <= 16_384);
        let origin = [side()?, side()?];
        parts.next().is_none().then_some(Crop { size, origin })
    };
    parse().ok_or_else(|| "expected WxH+X+Y in pixels, for example 240x240+250+180".to_owned())
}

pub(super) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |part: &str| {
        part.trim().parse::<u32>().ok().filter(|&pixels| (1..=16_384).contains(&pixels))
    };
    text.split_once(['x', 'X', '×'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| {
            format!(
                "invalid image size `{text}`: expected WIDTHxHEIGHT, 1 to 16384 \
                               pixels each, for example 960x720"
            )
        })
}

pub(super) fn parse_background(text: &str) -> Result<[f32; 3], String> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    let channels: Vec<f32> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    <[f32; 3]>::try_from(channels)
        .ok()
        .filter(|rgb| rgb.iter().all(|channel| (0.0..=1.0).contains(channel)))
        .ok_or_else(|| {
            format!(
                "invalid colour `{text}`: expected black, white or R,G,B with values from 0 to 1"
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_colours() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)), "plain");
        assert!(parse_size("0x480").is_err() && parse_size("640").is_err(), "malformed");
        assert_eq!(parse_background("1,0.5,0"), Ok([1.0, 0.5, 0.0]), "triple");
        assert!(parse_background("1,2,3").is_err(), "out of range");
    }
}
