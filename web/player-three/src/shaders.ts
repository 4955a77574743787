// GLSL ES 3.00. A vertex is four uint16, as `PackedVertices` in player-core/src/types.ts has them.

/** Source of a vertex: an attribute; the texture at gl_VertexID; the texture at an attribute, corner by corner. */
export type Feed = "attribute" | "texture" | "corner";

export const PRECISION = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
`;

export const POSITION = /* glsl */ `
uniform vec3 boxMinimum;
uniform vec3 boxSize;

vec3 positionOf(uvec4 texel) {
  return boxMinimum + boxSize * (vec3(texel.xyz) / 65535.0);
}
`;

export const NORMAL = /* glsl */ `
vec3 normalOf(uvec4 texel) {
  vec2 code = vec2(float(texel.w & 255u), float(texel.w >> 8u)) / 127.5 - 1.0;
  vec3 n = vec3(code, 1.0 - abs(code.x) - abs(code.y));
  float fold = max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -fold : fold;
  n.y += n.y >= 0.0 ? -fold : fold;
  return normalize(n);
}
`;

const FROM_ATTRIBUTE = /* glsl */ `
in uvec4 texel;
in vec4 rgba;

int vertexNumber() { return gl_VertexID; }

void readVertex(int vertex, out vec3 position, out vec3 normal) {
  position = positionOf(texel);
  normal = normalOf(texel);
}

vec3 readColor(int vertex) { return rgba.rgb; }
`;

// here and next: the texels of vertex 0 in the two frames between which `blend` lies; behind: added to the number of a vertex that
// does not move.
export const FROM_TEXTURE = /* glsl */ `
uniform usampler2D vertices;
uniform sampler2D colors;
uniform int movingCount;
uniform int here;
uniform int next;
uniform int behind;
uniform float blend;

ivec2 placeOf(int number) {
  int width = textureSize(vertices, 0).x;
  return ivec2(number % width, number / width);
}

uvec4 texelAt(int number) { return texelFetch(vertices, placeOf(number), 0); }

vec3 colorAt(int number) { return texelFetch(colors, placeOf(number), 0).rgb; }

void readVertex(int vertex, out vec3 position, out vec3 normal) {
  bool moves = vertex < movingCount;
  uvec4 first = texelAt(vertex + (moves ? here : behind));
  position = positionOf(first);
  normal = normalOf(first);
  if (moves && blend > 0.0) {
    uvec4 second = texelAt(vertex + next);
    position = mix(position, positionOf(second), blend);
    normal = mix(normal, normalOf(second), blend);
  }
}

vec3 readColor(int vertex) {
  bool moves = vertex < movingCount;
  vec3 first = colorAt(vertex + (moves ? here : behind));
  return moves && blend > 0.0 ? mix(first, colorAt(vertex + next), blend) : first;
}
`;

const AT_VERTEX = /* glsl */ `
int vertexNumber() { return gl_VertexID; }
`;

const AT_CORNER = /* glsl */ `
in uint corner;

int vertexNumber() { return int(corner); }
`;

const FEEDS: Readonly<Record<Feed, string>> = {
  attribute: FROM_ATTRIBUTE,
  texture: FROM_TEXTURE + AT_VERTEX,
  corner: FROM_TEXTURE + AT_CORNER,
};

const SURFACE_VERTEX = /* glsl */ `
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform bool hasColors;
out vec3 scenePosition;
centroid out vec3 sceneNormal;
centroid out vec3 ownColor;
out vec3 toEye; // in the scene's own axes, any length
#ifdef PLACES
in vec2 place; // in PLACE_SCALEths of the texture's sides, more where it has none
centroid out vec2 texturePlace;
#endif
#ifdef EDGES
out vec3 barycentric;
#endif

void main() {
  int vertex = vertexNumber();
  readVertex(vertex, scenePosition, sceneNormal);
  ownColor = hasColors ? readColor(vertex) : vec3(0.0);
  vec4 seen = modelViewMatrix * vec4(scenePosition, 1.0);
  toEye = -(seen.xyz * mat3(modelViewMatrix));
  gl_Position = projectionMatrix * seen;
#ifdef PATCHES
  if (vertex < movingCount) gl_Position = vec4(0.0, 0.0, 2.0, 1.0); // nowhere
#endif
#ifdef PLACES
  texturePlace = place / float(PLACE_SCALE);
#endif
#ifdef EDGES
  int k = gl_VertexID % 3;
  barycentric = vec3(k == 0, k == 1, k == 2);
#endif
}
`;

/** Vertex shader of what is drawn. With `corner`, three vertices a triangle and the distances to its edges. */
export function surfaceVertex(feed: Feed): string {
  return PRECISION + POSITION + NORMAL + FEEDS[feed] + SURFACE_VERTEX;
}

// The picture's smaller copies are blurred ones: what touches the ground is sharp by the first, what hangs above is soft by the last.
const SHADOW = /* glsl */ `
uniform sampler2D shadow;

float blurred(vec2 uv, float lod) {
  vec2 d = exp2(lod) * 0.6 / vec2(textureSize(shadow, 0));
  return 0.25 * (textureLod(shadow, uv + d, lod).a + textureLod(shadow, uv - d, lod).a
    + textureLod(shadow, uv + vec2(d.x, -d.y), lod).a + textureLod(shadow, uv + vec2(-d.x, d.y), lod).a);
}

// 1 at the borders of the shadow's picture.
float darkAt(vec2 place) {
  vec2 uv = 0.5 + 0.5 * place;
  return min(1.2 * (0.3 * blurred(uv, 1.5) + 0.35 * blurred(uv, 3.0) + 0.4 * blurred(uv, 4.5)), 0.8);
}
`;

// The face's own normal comes from the picture: it looks at the viewer however the face is wound, which makes shading two-sided.
export const SURFACE_FRAGMENT = `${PRECISION}
uniform int mode; // the number of a Mode in modes.ts; -1: the shadow on the ground, seen from below
uniform vec3 up; // in the scene's own axes, as all here
uniform vec2 ground; // where it is along that, and 1 / the height of what stands on it
uniform bool flatNormals;
uniform float exposure;
uniform bool hasColors;
uniform vec3 clay; // of a surface without colours of its own
uniform vec3 color; // of its track
uniform vec3 edgeColor;
in vec3 scenePosition;
centroid in vec3 sceneNormal;
centroid in vec3 ownColor;
in vec3 toEye;
#ifdef PLACES
uniform sampler2D image;
uniform bool hasImage;
centroid in vec2 texturePlace;
#endif
#ifdef EDGES
in vec3 barycentric;
#endif
#ifdef FLOOR
uniform mat4 toFloor; // to where x and z are 1 at the borders of the shadow's picture, and y is 0 on the floor, 1 where that takes no shadow
${SHADOW}
#endif
out vec4 fragment;

const float FACING_LIGHT = 0.87; // on what looks at the viewer
const float RELIEF = 0.5; // share of the light's differences that captured colours take (guess)

// A matte surface in a soft room: a large lamp beside the viewer, a bright ceiling, a warm floor. What looks down close to the floor is in the
// dark, which stands in for what surfaces hide from each other.
vec3 lightOn(vec3 n) {
  vec3 eye = normalize(toEye);
  vec3 lamp = normalize(eye + 0.7 * up + 0.5 * normalize(cross(up, eye) + 1e-6));
  float key = pow(max((dot(n, lamp) + 0.3) / 1.3, 0.0), 1.3);
  float sky = 0.5 + 0.5 * dot(n, up);
  float height = (dot(scenePosition, up) - ground.x) * ground.y; // 0 on the floor, 1 at the top
  float hidden = (1.0 - sky) * exp(-7.0 * max(height, 0.0));
  vec3 ambient = mix(vec3(0.27, 0.255, 0.245), vec3(0.43, 0.44, 0.46), sky);
  return ambient * (1.0 - 0.6 * hidden) + 0.68 * key * vec3(1.0, 0.985, 0.96);
}

#ifdef EDGES
// A line of one pixel; where triangles are no larger than lines, an even tone.
float edge() {
  vec3 width = fwidth(barycentric);
  vec3 inside = smoothstep(vec3(0.0), width * 0.9, barycentric);
  float widest = max(width.x, max(width.y, width.z));
  return (1.0 - min(inside.x, min(inside.y, inside.z))) * mix(1.0, 0.45, smoothstep(0.35, 1.0, widest));
}
#endif

void main() {
  vec3 facing = normalize(cross(dFdx(scenePosition), dFdy(scenePosition)));
  bool seenFromOutside = dot(facing, sceneNormal) >= 0.0;
  vec3 n = flatNormals ? (seenFromOutside ? facing : -facing) : normalize(sceneNormal);
  bool isOwn = hasColors;
  vec3 own = hasColors ? ownColor : clay;
#ifdef PLACES
  vec3 texel = texture(image, texturePlace).rgb; // of all fragments: its derivatives need their neighbours
  if (hasImage && max(texturePlace.x, texturePlace.y) <= 1.0) {
    isOwn = true;
    own = texel;
  }
#endif
  if (mode < 0) {
    float near = 1.0 - gl_FragCoord.z;
    fragment = vec4(0.0, 0.0, 0.0, near * near);
    return;
  }
  vec3 result;
  if (mode == NORMAL_MODE) result = 0.5 * (n + 1.0);
  else if (mode == TRACKS_MODE) result = color;
  else if (mode == COLOR_MODE && isOwn) result = own;
  else {
    // Multisampling shows slivers of faces behind the silhouette: lit from outside as their neighbours, they are no dark dots.
    float inside = seenFromOutside ? 0.0 : smoothstep(0.1, 0.5, -dot(n, normalize(toEye)));
    vec3 light = mix(lightOn(n), lightOn(-n), inside);
    result = exposure * own * (isOwn ? 1.0 + RELIEF * (light - FACING_LIGHT) : light); // captured colours have light in them already
#ifdef FLOOR
    vec3 place = (toFloor * vec4(scenePosition, 1.0)).xyz;
    if (!isOwn && abs(place.y) < 1.0) result *= 1.0 - darkAt(place.xz) * (1.0 - abs(place.y)) * max(dot(n, up), 0.0); // and shadows
#endif
  }
#ifdef EDGES
  result = mix(result, edgeColor, edge());
#endif
  fragment = vec4(result, 1.0);
}
`;

export const GROUND_VERTEX = `${PRECISION}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
out vec2 place; // 1 at the borders of the shadow's picture

void main() {
  place = position.xz;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}
`;

export const GROUND_FRAGMENT = `${PRECISION}${SHADOW}
uniform float rim;
uniform float glow; // of the ground's middle
in vec2 place;
out vec4 fragment;

void main() {
  float dark = darkAt(place);
  float light = glow * pow(max(1.0 - length(place) / rim, 0.0), 1.5);
  fragment = vec4(vec3(light * (1.0 - dark)), light + dark * (1.0 - light));
}
`;

/** Vertex shader that draws each vertex as the pixel of its number. */
export function readbackVertex(feed: Feed): string {
  return `${PRECISION}${POSITION}${NORMAL}${FEEDS[feed]}
uniform ivec2 targetSize;
flat out uvec3 bits;

void main() {
  vec3 position, normal;
  int vertex = vertexNumber();
  readVertex(vertex, position, normal);
  bits = floatBitsToUint(position);
  vec2 pixel = vec2(vertex % targetSize.x, vertex / targetSize.x);
  gl_Position = vec4((pixel + 0.5) / vec2(targetSize) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
}
`;
}

/** Marks a pixel where something was drawn; cleared ones are 0 or 1. */
export const DRAWN = 7;

/** The bits of the position as float32, and DRAWN. */
export const READBACK_FRAGMENT = `${PRECISION}
flat in uvec3 bits;
out uvec4 fragment;

void main() {
  fragment = uvec4(bits, ${DRAWN}u);
}
`;
