#version 300 es
// A pixel of a splat, premultiplied: opacity below 1/255 draws nothing, above 0.99 is capped. Colours are blended as stored, without
// a gamma curve, as in training.
precision highp float;

uniform vec2 u_size;

flat in vec2 v_center;
flat in vec3 v_conic;
flat in vec4 v_color;

out vec4 pixel;

void main() {
  vec2 d = v_center - vec2(gl_FragCoord.x, u_size.y - gl_FragCoord.y);
  float power = -0.5 * (v_conic.x * d.x * d.x + v_conic.z * d.y * d.y) - v_conic.y * d.x * d.y;
  if (power > 0.0) discard;
  float alpha = min(0.99, v_color.a * exp(power));
  if (alpha < 1.0 / 255.0) discard;
  pixel = vec4(v_color.rgb * alpha, alpha);
}
