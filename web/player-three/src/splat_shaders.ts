// GLSL ES 3.00 of splats: binds them to the mesh of a frame (FORMAT.md, "Splats"; core/decoder/splats.cpp does the same) and projects
// them by the local affine approximation (EWA), as analysis/appearance/splat_raster.py.

import { SPLATS_WIDTH, SPLAT_WEIGHT } from "@meshreel/player-core/types";
import { FROM_TEXTURE, POSITION, NORMAL, PRECISION } from "./shaders.ts";

/** A triangle around each splat, at the depth of its middle: around the ellipse within which it is drawn, along the axes of that. */
export const SPLAT_VERTEX = `${PRECISION}${POSITION}${NORMAL}${FROM_TEXTURE}
const float BLUR = 0.3; // pixels squared, added to variances: no splat falls between pixels
const float THIN = 0.1; // third scale of the shorter one
const float TURN = 6.283185307179586 / 65536.0;
const float LEAST = 255.0; // opacity, of which one part is drawn

uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec2 viewport; // pixels
uniform usampler2D splats;
uniform float splatUnit; // m, of scales of level 0
in uint order;
flat out vec4 ownColor;
out vec2 deviations; // from the middle

uvec4 wordsAt(int texel) {
  return texelFetch(splats, ivec2(texel % ${SPLATS_WIDTH}, texel / ${SPLATS_WIDTH}), 0);
}

bool isLacking(uint start, int frame) {
  uint word = start + uint(frame >> 5);
  return start > 0u && ((wordsAt(int(word >> 2u))[word & 3u] >> uint(frame & 31)) & 1u) == 1u;
}

vec3 cornerAt(uint vertex) {
  vec3 position, normal;
  readVertex(int(vertex), position, normal);
  return position;
}

void main() {
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0); // nowhere
  uvec4 place = wordsAt(2 * int(order));
  uvec4 own = wordsAt(2 * int(order) + 1);
  ownColor = vec4(own.zzzz >> uvec4(0, 8, 16, 24) & 255u) / 255.0;
  if (ownColor.a * LEAST < 1.0 || isLacking(own.w, here / movingCount)) return;
  vec3 p = cornerAt(place.x), q = cornerAt(place.y) - p, r = cornerAt(place.z) - p;
  vec3 normal = cross(q, r);
  if (normal == vec3(0.0)) return;
  normal = normalize(normal);
  vec3 first = normalize(q), second = cross(normal, first);
  vec2 weights = vec2(place.w & 65535u, place.w >> 16u) / ${SPLAT_WEIGHT}.0;
  vec4 seen = modelViewMatrix * vec4(p + weights.x * q + weights.y * r + uintBitsToFloat(own.x) * normal, 1.0);
  if (seen.z > -1e-6) return;

  float turn = TURN * float(own.y & 65535u), cosine = cos(turn), sine = sin(turn);
  vec2 scales = splatUnit * exp2(vec2(own.y >> 16u & 255u, own.y >> 24u) / -8.0);
  mat3 axes = mat3(modelViewMatrix) * mat3(
    scales.x * (cosine * first + sine * second), scales.y * (cosine * second - sine * first), THIN * scales.y * normal);
  vec2 ray = seen.xy / -seen.z;
  vec2 focal = 0.5 * viewport * vec2(projectionMatrix[0][0], projectionMatrix[1][1]) / -seen.z;
  vec3 across = focal.x * (vec3(axes[0].x, axes[1].x, axes[2].x) + ray.x * vec3(axes[0].z, axes[1].z, axes[2].z));
  vec3 up = focal.y * (vec3(axes[0].y, axes[1].y, axes[2].y) + ray.y * vec3(axes[0].z, axes[1].z, axes[2].z));
  float xx = dot(across, across) + BLUR, xy = dot(across, up), yy = dot(up, up) + BLUR;
  float middle = 0.5 * (xx + yy), spread = length(vec2(0.5 * (xx - yy), xy));
  vec2 variances = vec2(middle + spread, max(middle - spread, BLUR));
  vec2 longer = abs(xy) > 1e-6 * middle ? normalize(vec2(xy, variances.x - xx)) : (xx >= yy ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
  deviations = sqrt(2.0 * log(LEAST * ownColor.a)) * (gl_VertexID == 0 ? vec2(0.0, 2.0) : vec2(sqrt(3.0) * float(2 * gl_VertexID - 3), -1.0));
  vec2 pixels = deviations.x * sqrt(variances.x) * longer + deviations.y * sqrt(variances.y) * vec2(-longer.y, longer.x);
  gl_Position = projectionMatrix * seen;
  gl_Position.xy += gl_Position.w * pixels / (0.5 * viewport);
}
`;

/** Premultiplied; colours as the screen shows them. */
export const SPLAT_FRAGMENT = `${PRECISION}
const float MOST = 0.999; // opacity
flat in vec4 ownColor;
in vec2 deviations;
out vec4 fragment;

void main() {
  float alpha = min(ownColor.a * exp(-0.5 * dot(deviations, deviations)), MOST);
  if (alpha < 1.0 / 255.0) discard;
  fragment = vec4(alpha * ownColor.rgb, alpha);
}
`;
