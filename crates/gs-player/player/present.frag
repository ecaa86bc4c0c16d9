#version 300 es
// Composites the blended image over the background.
precision highp float;
precision highp sampler2D;

uniform sampler2D u_image;
uniform vec3 u_background;
// Size of the window over size of the image.
uniform vec2 u_ratio;

out vec4 pixel;

void main() {
  vec4 blended = u_ratio == vec2(1.0)
    ? texelFetch(u_image, ivec2(gl_FragCoord.xy), 0)
    : texture(u_image, gl_FragCoord.xy / u_ratio / vec2(textureSize(u_image, 0)));
  pixel = vec4(blended.rgb + (1.0 - blended.a) * u_background, 1.0);
}
