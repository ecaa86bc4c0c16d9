#version 300 es
// One splat as a rectangle of pixels: projection of a Gaussian with the Jacobian of the perspective at its centre (EWA), clipped to
// whole tiles around three standard deviations, as in training.
// One instance is one splat, farthest first; four vertices are the corners of its rectangle.
precision highp float;
precision highp int;
precision highp sampler2D;

uniform sampler2D u_geometry;
uniform sampler2D u_appearance;
// Colours over those of the appearances, and their shares; as many texels per line, or 0 for none.
uniform sampler2D u_overlay;
uniform int u_overlay_per_line;
uniform int u_geometry_per_line;
uniform int u_appearance_per_line;
uniform int u_appearance_texels;
uniform int u_sh_degree;
// Row counts of groups a, same motion and shared; 1 for the second scene.
uniform ivec3 u_groups;
uniform int u_second;
// World to camera by rows; camera centre; near plane; focal lengths, principal point and size of the image, pixels.
uniform vec4 u_view[3];
uniform vec3 u_eye;
uniform float u_near;
uniform vec2 u_focal;
uniform vec2 u_principal;
uniform vec2 u_size;

in uint a_row;

flat out vec2 v_center;
flat out vec3 v_conic;
flat out vec4 v_color;

// Documented in gs_core::image_formation; a test compares the values.
const float GUARD_BAND = 1.3;
const float EPS2D = 0.3;
const float EXTENT_SIGMAS = 3.0;
const float MIN_DISCRIMINANT = 0.1;
const float TILE_SIZE = 16.0;
const float ALPHA_THRESHOLD = 1.0 / 255.0;

vec4 geometry(int row, int texel) {
  return texelFetch(u_geometry, ivec2((row % u_geometry_per_line) * 3 + texel, row / u_geometry_per_line), 0);
}

vec4 appearance(int row, int texel) {
  return texelFetch(u_appearance, ivec2((row % u_appearance_per_line) * u_appearance_texels + texel, row / u_appearance_per_line), 0);
}

// Appearances are stored as: first alone, same motion of the first, shared, same motion of the second, second alone.
int appearance_row(int row) {
  if (u_second == 0) return row;
  int same_motion = u_groups.y;
  int shared_from = u_groups.x + same_motion;
  if (row < shared_from) return row + same_motion + u_groups.z;
  return row < shared_from + u_groups.z ? row : row + same_motion;
}

vec3 sh(int row, int k) {
  return appearance(row, k).rgb;
}

// Colour towards direction d; real spherical harmonics in the order and with the signs of 3DGS files.
vec3 shade(int row, vec3 base, vec3 d) {
  vec3 color = base;
  float x = d.x, y = d.y, z = d.z;
  if (u_sh_degree > 0) {
    color += 0.4886025119029199 * (-y * sh(row, 1) + z * sh(row, 2) - x * sh(row, 3));
  }
  if (u_sh_degree > 1) {
    color += 1.0925484305920792 * (x * y * sh(row, 4) - y * z * sh(row, 5) - x * z * sh(row, 7))
      + 0.31539156525252005 * (2.0 * z * z - x * x - y * y) * sh(row, 6)
      + 0.5462742152960396 * (x * x - y * y) * sh(row, 8);
  }
  if (u_sh_degree > 2) {
    color += -0.5900435899266435 * y * (3.0 * x * x - y * y) * sh(row, 9)
      + 2.890611442640554 * x * y * z * sh(row, 10)
      - 0.4570457994644658 * y * (4.0 * z * z - x * x - y * y) * sh(row, 11)
      + 0.3731763325901154 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y) * sh(row, 12)
      - 0.4570457994644658 * x * (4.0 * z * z - x * x - y * y) * sh(row, 13)
      + 1.445305721320277 * z * (x * x - y * y) * sh(row, 14)
      - 0.5900435899266435 * x * (x * x - 3.0 * y * y) * sh(row, 15);
  }
  return max(color, 0.0);
}

mat3 rotation(vec4 q) {
  float x = q.x, y = q.y, z = q.z, w = q.w;
  // Columns.
  return mat3(
    1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
    2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
    2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
  );
}

void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  int row = int(a_row);
  vec3 mean = geometry(row, 0).xyz;
  vec3 ray = mean - u_eye;
  vec3 t = vec3(dot(u_view[0].xyz, ray), dot(u_view[1].xyz, ray), dot(u_view[2].xyz, ray));
  if (t.z <= u_near) return;
  vec4 color = appearance(appearance_row(row), 0);
  if (color.a < ALPHA_THRESHOLD) return;
  // Pixel centres at half-integers, rows downwards.
  vec2 center = u_focal * t.xy / t.z + u_principal;

  vec2 limit = GUARD_BAND * u_size / (2.0 * u_focal);
  vec2 clamped = clamp(t.xy / t.z, -limit, limit) * t.z;
  mat3 view = transpose(mat3(u_view[0].xyz, u_view[1].xyz, u_view[2].xyz));
  mat3 m = view * rotation(geometry(row, 1));
  vec3 scale = geometry(row, 2).xyz;
  m[0] *= scale.x;
  m[1] *= scale.y;
  m[2] *= scale.z;
  mat3 rows = transpose(m);
  // Rows of J times the square root of the covariance (the covariance is its product with its transpose).
  vec3 jx = rows * vec3(u_focal.x / t.z, 0.0, -u_focal.x * clamped.x / (t.z * t.z));
  vec3 jy = rows * vec3(0.0, u_focal.y / t.z, -u_focal.y * clamped.y / (t.z * t.z));
  float a = dot(jx, jx) + EPS2D;
  float b = dot(jx, jy);
  float c = dot(jy, jy) + EPS2D;
  float det = a * c - b * b;
  if (!(det > 0.0) || !(a < 1e30) || !(c < 1e30)) return;

  float mid = 0.5 * (a + c);
  float radius = ceil(EXTENT_SIGMAS * sqrt(mid + sqrt(max(MIN_DISCRIMINANT, mid * mid - det))));
  // The reference samples pixel i at coordinate i, half a pixel less.
  vec2 corner = center - 0.5;
  vec2 tiles = ceil(u_size / TILE_SIZE);
  vec2 low = clamp(trunc((corner - radius) / TILE_SIZE), vec2(0.0), tiles) * TILE_SIZE;
  vec2 high = clamp(trunc((corner + radius + TILE_SIZE - 1.0) / TILE_SIZE), vec2(0.0), tiles) * TILE_SIZE;
  // Limited to the pixels where alpha can be 1/255 or more, plus a margin of one pixel for rounding.
  vec2 reach = sqrt(2.0 * log(color.a / ALPHA_THRESHOLD) * vec2(a, c)) + 1.0;
  low = max(low, floor(center - reach));
  high = min(min(high, ceil(center + reach)), u_size);
  if (low.x >= high.x || low.y >= high.y) return;

  v_center = center;
  v_conic = vec3(c, -b, a) / det;
  v_color = vec4(shade(appearance_row(row), color.rgb, normalize(mean - u_eye)), color.a);
  if (u_overlay_per_line > 0) {
    int at = appearance_row(row);
    vec4 over = texelFetch(u_overlay, ivec2(at % u_overlay_per_line, at / u_overlay_per_line), 0);
    v_color.rgb = mix(v_color.rgb, over.rgb, over.a);
  }
  vec2 at = mix(low, high, vec2(gl_VertexID & 1, gl_VertexID >> 1));
  gl_Position = vec4(2.0 * at.x / u_size.x - 1.0, 1.0 - 2.0 * at.y / u_size.y, 0.0, 1.0);
}
