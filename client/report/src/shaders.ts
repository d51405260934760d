// The shaders that draw surface, layout and seams. Both views share one indexed buffer of quantized places. A triangle
// gets its number, and through it its chart and values, from its provoking vertex, which no other triangle has as its
// provoking vertex (model.ts).

export const TEXTURE_WIDTH = 4096;

// Part of all vertex shaders of the map: decodes places on the surface and in the map.
const FETCH = /* glsl */ `
precision highp float;
precision highp int;
precision highp usampler2D;
uniform vec3 uLow;
uniform float uSize;
uniform vec2 uUvLow;
uniform float uUvSize;
uniform mat4 projectionMatrix, modelViewMatrix;
ivec2 texel(int i) { return ivec2(i % ${TEXTURE_WIDTH}, i / ${TEXTURE_WIDTH}); }
vec3 surfaceOf(uvec4 place) { return uLow + uSize * vec3(place.xyz) / 65535.0; }
vec2 mapOf(uvec2 uv) { return uUvLow + uUvSize * vec2(uv) / 65535.0; }
`;

export const FACE_VERTEX = /* glsl */ `${FETCH}
in uvec4 aPlace;             // x, y, z, normal
in uvec2 aUv;
in uint aFace;               // that this vertex provokes
uniform usampler2D tFace;    // stretch, angle, faults, marked
uniform usampler2D tChart;   // chart, material + 1 and visibility above 24 bits
#ifdef TEXTURED
in uvec2 aFine;              // the remainder of aUv plus a half, in 65535ths
in uvec4 aColor;             // sRGB and alpha: what the image is multiplied by
uniform mat3 uTransform;     // to places in the image, v downwards
out vec2 vImage;
out vec4 vFactor;
#ifdef NORMALS
uniform mat3 uToNormals;
out vec2 vAtNormals;
#endif
#endif
flat out int vFace;
flat out uvec4 vValues;
flat out uvec2 vGroup;
out vec3 vEye;
out vec3 vNormal;
out vec2 vUv;
vec3 unpackNormal(uint code) {
  vec2 p = vec2(float(code & 255u), float(code >> 8)) / 127.5 - 1.0;
  vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  return normalize(n);
}
void main() {
  vFace = int(aFace);
  vValues = texelFetch(tFace, texel(vFace), 0);
  vGroup = texelFetch(tChart, texel(vFace), 0).xy;
  vUv = mapOf(aUv);
#ifdef TEXTURED
  vec2 at = uUvLow + uUvSize * (vec2(aUv) + vec2(aFine) / 65535.0 - 0.5) / 65535.0;
  vImage = (uTransform * vec3(at.x, 1.0 - at.y, 1.0)).xy;
#ifdef NORMALS
  vAtNormals = (uToNormals * vec3(at.x, 1.0 - at.y, 1.0)).xy;
#endif
  vec4 c = vec4(aColor) / 255.0;
  vFactor = vec4(mix(c.rgb / 12.92, pow((c.rgb + 0.055) / 1.055, vec3(2.4)), greaterThan(c.rgb, vec3(0.04045))), c.a);
#endif
  vNormal = mat3(modelViewMatrix) * unpackNormal(aPlace.w);
#ifdef LAYOUT
  vec4 eye = modelViewMatrix * vec4(vUv, 0.0, 1.0);
#else
  vec4 eye = modelViewMatrix * vec4(surfaceOf(aPlace), 1.0);
#endif
  vEye = eye.xyz;
  gl_Position = projectionMatrix * eye;
}`;

export const PICK_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
flat in int vFace;
out vec4 color;
void main() {
  int id = vFace + 1;
  color = vec4(id & 255, (id >> 8) & 255, (id >> 16) & 255, id >> 24) / 255.0;
}`;

export const MODES = ['checker', 'charts', 'stretch', 'angle', 'seams', 'colour', 'textured'] as const;
export type Mode = (typeof MODES)[number];

// Viridis and cividis, by polynomials: both rise evenly in lightness, so that they read without colours too.
const SCALES = /* glsl */ `
vec3 viridis(float t) {
  return vec3(0.2777, 0.0054, 0.3341) + t * (vec3(0.1051, 1.4046, 1.3846) + t * (vec3(-0.3309, 0.2148, 0.0951) +
    t * (vec3(-4.6342, -5.7991, -19.3324) + t * (vec3(6.2283, 14.1799, 56.6906) + t * (vec3(4.7764, -13.7451, -65.3530) +
    t * vec3(-5.4355, 4.6459, 26.3124))))));
}
vec3 cividis(float t) {
  vec3 a = vec3(0.0, 0.126, 0.302), b = vec3(0.337, 0.365, 0.424), c = vec3(0.659, 0.612, 0.459), d = vec3(0.996, 0.910, 0.220);
  return t < 0.4 ? mix(a, b, t / 0.4) : t < 0.7 ? mix(b, c, (t - 0.4) / 0.3) : mix(c, d, (t - 0.7) / 0.3);
}`;

export const FACE_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
precision highp usampler2D;
uniform sampler2D tMaterial;
uniform int uMode, uHover, uSelected, uMaterials;
uniform bool uMarks;
uniform float uChecker, uStretchTop, uAngleTop, uLight;
flat in int vFace;
flat in uvec4 vValues;
flat in uvec2 vGroup;
in vec3 vEye;
in vec3 vNormal;
in vec2 vUv;
out vec4 color;
#ifdef TEXTURED
uniform sampler2D tImage;
uniform vec4 uFactor;        // linear
uniform int uAlpha;          // 0: opaque, 1: mask, 2: blend
uniform float uCutoff;
uniform vec3 uPage;          // the background
in vec2 vImage;
in vec4 vFactor;
#ifdef NORMALS
uniform sampler2D tNormals;
uniform float uNormalScale;
in vec2 vAtNormals;
// The normal of the normal map, on the side of n. The tangent frame follows MikkTSpace within a triangle: the
// tangent points where u grows, and the other axis against v, which points down in the image. side: -1 if n was turned round.
vec3 bentNormal(vec3 n, float side) {
  vec3 px = dFdx(vEye), py = dFdy(vEye);
  vec2 ux = dFdx(vAtNormals), uy = dFdy(vAtNormals);
  float area = sign(ux.x * uy.y - uy.x * ux.y);
  vec3 along = area * (px * uy.y - py * ux.y), down = area * (py * ux.x - px * uy.x);
  vec3 tangent = along - n * dot(n, along);
  vec3 m = 2.0 * texture(tNormals, vAtNormals).xyz - 1.0;
  if (area == 0.0 || !(dot(tangent, tangent) > 0.0)) return n;
  tangent = normalize(tangent);
  vec3 up = cross(n, tangent);
  if (dot(up, down) > 0.0) up = -up;
  return normalize(side * uNormalScale * (m.x * tangent + m.y * up) + m.z * n);
}
// How much lighter the bent normal makes the surface, in light from the upper left.
float relief(vec3 n, vec3 bent) {
  const vec3 light = vec3(-0.48, 0.60, 0.64);
  return 0.85 * (1.0 + dot(bent, light)) / (1.0 + max(dot(n, light), -0.9));
}
#endif
#endif
${SCALES}
// Hues by the golden angle, lightness in three steps.
vec3 chartColor(uint chart) {
  float h = fract(float(chart) * 0.61803398875 + 0.58), l = 0.55 + 0.16 * float(chart % 3u) - 0.08;
  vec3 hue = clamp(abs(fract(h + vec3(0.0, 2.0 / 3.0, 1.0 / 3.0)) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
  return l + 0.30 * (hue - dot(hue, vec3(0.30, 0.55, 0.15)));
}
float squares(vec2 p) {
  vec2 w = max(fwidth(p), 1e-6);
  vec2 i = 2.0 * (abs(fract((p - 0.5 * w) * 0.5) - 0.5) - abs(fract((p + 0.5 * w) * 0.5) - 0.5)) / w;
  return 0.5 - 0.5 * i.x * i.y;
}
vec3 surfaceColor() {
#ifdef TEXTURED
  vec4 texel = texture(tImage, vImage) * uFactor * vFactor;
  if (uAlpha == 1 && texel.a < uCutoff || uAlpha == 2 && texel.a < 0.004) discard;
  vec3 display = mix(12.92 * texel.rgb, 1.055 * pow(texel.rgb, vec3(1.0 / 2.4)) - 0.055, greaterThan(texel.rgb, vec3(0.0031308)));
  return uAlpha == 2 ? mix(uPage, display, texel.a) : display;
#else
  float stretch = float(vValues.x) / 254.0 * 4.0, angle = float(vValues.y) / 254.0;
  bool hasArea = vValues.x != 255u;
  if (uMode == 0) {
    float fine = squares(vUv * uChecker), coarse = squares(vUv * uChecker / 4.0);
    vec3 tint = 0.5 + 0.5 * cos(6.2832 * (vec3(0.0, 0.33, 0.67) + 0.55 * vUv.x + 0.25 * vUv.y));
    return mix(vec3(0.24), vec3(0.94), fine) * mix(0.80, 1.0, coarse) * mix(vec3(1.0), 0.55 + 0.6 * tint, 0.55);
  }
  if (uMode == 1) return chartColor(vGroup.x);
  if (uMode == 2) return hasArea ? viridis(clamp(stretch / uStretchTop, 0.0, 1.0)) : vec3(0.85, 0.1, 0.5);
  if (uMode == 3) return cividis(clamp(180.0 * angle * angle / uAngleTop, 0.0, 1.0));
  if (uMode == 4) return mix(vec3(0.62), chartColor(vGroup.x), 0.12) * (0.3 + 0.9 * float(vGroup.y >> 24) / 254.0);
  return texelFetch(tMaterial, ivec2(int(vGroup.y & 0xffffffu), 0), 0).rgb;
#endif
}
void main() {
  vec3 c = surfaceColor();
#ifndef LAYOUT
  vec3 flatNormal = normalize(cross(dFdx(vEye), dFdy(vEye)));
  vec3 n = normalize(vNormal);
  float side = dot(n, flatNormal) < 0.0 ? -1.0 : 1.0;
  n *= side;
  if (!(dot(n, flatNormal) > 0.82)) n = flatNormal;
#ifdef NORMALS
  c *= relief(n, bentNormal(n, side));
#endif
  float facing = abs(dot(n, normalize(vEye)));
  c *= uMode == 6 ? 0.6 + 0.4 * facing : 0.34 + 0.66 * facing;
  if (!gl_FrontFacing && uMode != 0 && uMode != 6) c *= 0.72;
#endif
  if (uMarks && vValues.w != 0u) c = mix(c, vec3(0.90, 0.10, 0.42), 0.85);
  if (uSelected >= 0) c = int(vGroup.x) == uSelected ? mix(c, vec3(1.0), 0.12) : mix(c, vec3(uLight), 0.72);
  if (vFace == uHover) c = mix(vec3(1.0, 0.72, 0.0), c, 0.15);
  color = vec4(c, 1.0);
}`;

// A segment as a rectangle of a fixed width on the screen, or in the map.
export const LINE_VERTEX = /* glsl */ `${FETCH}
in uvec3 ends;               // places, and the seam's visibility; 255: no seam
flat out uint vVisibility;
uniform usampler2D tPlace, tUv;
uniform vec2 uViewport;      // pixels
uniform float uWidth;        // pixels; LAYOUT with uWidthInMap: of the map
uniform bool uWidthInMap;
void main() {
  vVisibility = ends.z;
  int a = int(ends.x), b = int(ends.y);
#ifdef LAYOUT
  vec4 p = projectionMatrix * modelViewMatrix * vec4(mapOf(texelFetch(tUv, texel(a), 0).xy), 0.0, 1.0);
  vec4 q = projectionMatrix * modelViewMatrix * vec4(mapOf(texelFetch(tUv, texel(b), 0).xy), 0.0, 1.0);
#else
  vec4 p = projectionMatrix * modelViewMatrix * vec4(surfaceOf(texelFetch(tPlace, texel(a), 0)), 1.0);
  vec4 q = projectionMatrix * modelViewMatrix * vec4(surfaceOf(texelFetch(tPlace, texel(b), 0)), 1.0);
#endif
  vec2 along = (q.xy / q.w - p.xy / p.w) * uViewport;
  along = length(along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
  float width = uWidthInMap ? uWidth * projectionMatrix[1][1] * uViewport.y * 0.5 : uWidth;
  int k = gl_VertexID;
  bool atEnd = k == 1 || k == 2 || k == 4, isLeft = k == 0 || k == 1 || k == 3;
  vec4 at = atEnd ? q : p;
  vec2 side = vec2(-along.y, along.x) * (isLeft ? 1.0 : -1.0) + along * (atEnd ? 1.0 : -1.0) * (uWidthInMap ? 1.0 : 0.5);
  at.xy += side * width / uViewport * at.w;
#ifndef LAYOUT
  at.z -= 0.0006 * at.w;
#endif
  gl_Position = at;
}`;

// Edges of all triangles, a pixel wide.
export const WIRE_VERTEX = /* glsl */ `${FETCH}
in uvec4 aPlace;
in uvec2 aUv;
void main() {
#ifdef LAYOUT
  gl_Position = projectionMatrix * modelViewMatrix * vec4(mapOf(aUv), 0.0, 1.0);
#else
  gl_Position = projectionMatrix * modelViewMatrix * vec4(surfaceOf(aPlace), 1.0);
  gl_Position.z -= 0.0004 * gl_Position.w;
#endif
}`;

export const LINE_FRAGMENT = /* glsl */ `
precision highp float;
uniform vec4 uColor;
out vec4 color;
void main() { color = uColor; }`;

// Draws in one colour or, with uByVisibility, hidden seams blue, seams in the open red, and ends of the surface grey.
export const SEAM_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
uniform vec4 uColor;
uniform bool uByVisibility;
flat in uint vVisibility;
out vec4 color;
void main() {
  color = uColor;
  if (!uByVisibility) return;
  float t = float(vVisibility) / 254.0;
  vec3 middle = vec3(0.96, 0.72, 0.10);
  vec3 c = t < 0.5 ? mix(vec3(0.10, 0.42, 0.90), middle, 2.0 * t) : mix(middle, vec3(0.86, 0.08, 0.22), 2.0 * t - 1.0);
  color = vVisibility == 255u ? vec4(0.25, 0.25, 0.30, 0.8) : vec4(c, 1.0);
}`;

// The tiles behind the layout, with a grid of texels where they are large enough to be seen.
export const GRID_VERTEX = /* glsl */ `
precision highp float;
out vec2 vClip;
void main() {
  vClip = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(vClip, 0.9999, 1.0);
}`;

export const GRID_FRAGMENT = /* glsl */ `
precision highp float;
uniform vec2 uCentre, uHalf, uViewport;
uniform float uTexels;
uniform vec3 uPage, uTile, uInk;
uniform vec4 uTiles;         // low and high
in vec2 vClip;
out vec4 color;
float lines(vec2 p, vec2 w) {
  vec2 d = abs(fract(p - 0.5) - 0.5) / w;
  return 1.0 - min(min(d.x, d.y), 1.0);
}
void main() {
  vec2 uv = uCentre + vClip * uHalf;
  vec2 pixel = 2.0 * uHalf / uViewport;
  bool isInside = all(greaterThanEqual(uv, uTiles.xy)) && all(lessThanEqual(uv, uTiles.zw));
  vec3 c = isInside ? uTile : uPage;
  float size = 1.0 / (uTexels * pixel.x);
  if (isInside) {
    c = mix(c, uInk, 0.22 * lines(uv * uTexels, pixel * uTexels) * smoothstep(5.0, 12.0, size));
    c = mix(c, uInk, 0.16 * lines(uv * 8.0, pixel * 8.0));
  }
  vec2 border = abs(uv - round(uv)) / pixel;
  bool nearTiles = all(greaterThanEqual(uv, uTiles.xy - pixel)) && all(lessThanEqual(uv, uTiles.zw + pixel));
  if (nearTiles && min(border.x, border.y) < 1.0) c = mix(c, uInk, 0.75);
  color = vec4(c, 1.0);
}`;
