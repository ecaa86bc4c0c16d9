// Needs: nothing
// Channels composited at once: 8.

const QUADS: u32 = 2u;
const CHANNELS: u32 = 8u;

struct Color8 {
    a: vec4f,
    b: vec4f,
}

alias Color = Color8;

fn color_add_scaled(x: Color, weight: f32, y: Color) -> Color {
    return Color(x.a + weight * y.a, x.b + weight * y.b);
}

fn color_dot(x: Color, y: Color) -> f32 {
    return dot(x.a, y.a) + dot(x.b, y.b);
}

fn color_quad(x: Color, quad: u32) -> vec4f {
    return select(x.a, x.b, quad == 1u);
}

fn color_with(x: Color, channel: u32, value: f32) -> Color {
    var out = x;
    if channel < 4u {
        out.a[channel] = value;
    } else {
        out.b[channel - 4u] = value;
    }
    return out;
}
