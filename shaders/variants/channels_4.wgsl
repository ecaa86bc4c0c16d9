// Needs: nothing
// Channels composited at once: 4.

const QUADS: u32 = 1u;
const CHANNELS: u32 = 4u;

struct Color4 {
    a: vec4f,
}

alias Color = Color4;

fn color_add_scaled(x: Color, weight: f32, y: Color) -> Color {
    return Color(x.a + weight * y.a);
}

fn color_dot(x: Color, y: Color) -> f32 {
    return dot(x.a, y.a);
}

fn color_quad(x: Color, quad: u32) -> vec4f {
    return x.a;
}

fn color_with(x: Color, channel: u32, value: f32) -> Color {
    var out = x;
    out.a[channel] = value;
    return out;
}
