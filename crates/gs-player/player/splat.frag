#version 300 es
// A pixel of a splat, premultiplied. Colours are blended as stored, without a gamma curve, as in training.
precision highp float;

uniform vec2 u_size;
// Lower left pixel of the cell.
uniform vec2 u_origin;

flat in vec2 v_center;
flat in vec3 v_conic;
flat in vec4 v_color;

out vec4 pixel;

// Documented in gs_core::image_formation; a test compares the values.
const float MAX_ALPHA = 0.99;
const float ALPHA_THRESHOLD = 1.0 / 255.0;

void main() {
  vec2 at = gl_FragCoord.xy - u_origin;
  vec2 d = v_center - vec2(at.x, u_size.y - at.y);
  float power = -0.5 * (v_conic.x * d.x * d.x + v_conic.z * d.y * d.y) - v_conic.y * d.x * d.y;
  if (power > 0.0) discard;
  float alpha = min(MAX_ALPHA, v_color.a * exp(power));
  if (alpha < ALPHA_THRESHOLD) discard;
  pixel = vec4(v_color.rgb * alpha, alpha);
}
