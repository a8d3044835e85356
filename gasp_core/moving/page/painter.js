// Draws Gaussians with WebGL 2: a square for each, from the farthest to the nearest, as 3DGS projects and blends them.

import { rotate } from "./decoder.js";
import { programOf } from "./ground.js";

const WIDTH = 2048;

const VERTEX = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D gaussians;
uniform mat4 view;
uniform vec2 focal;
uniform vec2 size;
in vec2 corner;
in uint row;
out vec2 offset;
out vec4 colour;
out float depth;
flat out float steepness;

vec4 texel(uint number) {
  return texelFetch(gaussians, ivec2(number % ${WIDTH}u, number / ${WIDTH}u), 0);
}

void main() {
  vec4 place = texel(4u * row);
  vec4 upper = texel(4u * row + 1u);
  vec4 lower = texel(4u * row + 2u);
  colour = texel(4u * row + 3u);
  vec3 seen = (view * vec4(place.xyz, 1.0)).xyz;
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  if (seen.z < 0.01 || colour.a < 1.0 / 255.0) return;
  mat3 covariance = mat3(upper.x, upper.y, upper.z, upper.y, upper.w, lower.x, upper.z, lower.x, lower.y);
  vec2 beyond = 1.3 * 0.5 * size / focal;
  vec2 slope = clamp(seen.xy / seen.z, -beyond, beyond);
  mat3 jacobian = mat3(focal.x, 0.0, 0.0, 0.0, focal.y, 0.0, -focal.x * slope.x, -focal.y * slope.y, 0.0);
  mat3 projection = jacobian * mat3(view) / seen.z;
  mat3 projected = projection * covariance * transpose(projection);
  float a = projected[0][0] + 0.3, b = projected[0][1], c = projected[1][1] + 0.3;
  float middle = 0.5 * (a + c), spread = length(vec2(0.5 * (a - c), b));
  float larger = middle + spread, smaller = max(middle - spread, 0.1);
  vec2 along = spread > 1e-9 ? normalize(vec2(b, larger - a)) : vec2(1.0, 0.0);
  if (abs(b) < 1e-9) along = a >= c ? vec2(1.0, 0.0) : vec2(0.0, 1.0);
  // As far as it may be seen: alpha exp(-r^2 / 2) = 1 / 255.
  float reach = sqrt(2.0 * log(255.0 * colour.a));
  offset = reach * corner;
  vec2 pixels = offset.x * sqrt(larger) * along + offset.y * sqrt(smaller) * vec2(-along.y, along.x);
  vec2 centre = focal * seen.xy / seen.z;
  // Along the ray of a pixel matter is normal around a depth that changes evenly from pixel to pixel.
  vec3 away = covariance * vec3(view[0].z, view[1].z, view[2].z);
  vec2 shared = (projection * away).xy;
  vec2 slant = vec2(c * shared.x - b * shared.y, a * shared.y - b * shared.x) / (a * c - b * b);
  float variance = dot(away, vec3(view[0].z, view[1].z, view[2].z)) - dot(shared, slant);
  depth = seen.z + dot(slant, pixels);
  steepness = 1.702 * inversesqrt(max(variance, 1e-12));
  gl_Position = vec4((centre + pixels) / (0.5 * size) * vec2(1.0, -1.0), 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp usampler2D;
uniform usampler2D walls;
uniform bool walled;
in vec2 offset;
in vec4 colour;
in float depth;
flat in float steepness;
out vec4 painted;

void main() {
  float alpha = min(0.99, colour.a * exp(-0.5 * dot(offset, offset)));
  if (alpha < 1.0 / 255.0) discard;
  if (walled) {
    // What is before the wall of this pixel; the logistic law is within .01 of the normal one.
    float before = uintBitsToFloat(texelFetch(walls, ivec2(gl_FragCoord.xy), 0).x) - depth;
    alpha = 1.0 - pow(1.0 - alpha, 1.0 / (1.0 + exp(clamp(-steepness * before, -80.0, 80.0))));
  }
  painted = vec4(colour.rgb * alpha, alpha);
}`;

const C0 = 0.28209479177387814;

/** Real harmonics of degrees 1 to 3 along a unit vector, as 3DGS has them. */
function basis(x, y, z, bases, found) {
  found[0] = -0.4886025119029199 * y, found[1] = 0.4886025119029199 * z, found[2] = -0.4886025119029199 * x;
  if (bases < 8) return;
  const xx = x * x, yy = y * y, zz = z * z;
  found[3] = 1.0925484305920792 * x * y, found[4] = -1.0925484305920792 * y * z;
  found[5] = 0.31539156525252005 * (2 * zz - xx - yy), found[6] = -1.0925484305920792 * x * z;
  found[7] = 0.5462742152960396 * (xx - yy);
  if (bases < 15) return;
  found[8] = -0.5900435899266435 * y * (3 * xx - yy), found[9] = 2.890611442640554 * x * y * z;
  found[10] = -0.4570457994644658 * y * (4 * zz - xx - yy);
  found[11] = 0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy);
  found[12] = -0.4570457994644658 * x * (4 * zz - xx - yy), found[13] = 1.445305721320277 * z * (xx - yy);
  found[14] = -0.5900435899266435 * x * (xx - 3 * yy);
}

export class Painter {
  /** Of a splat's Gaussians, and the grains that a motion has behind them. */
  constructor(gl, trained, ground, motion) {
    this.gl = gl;
    const splat = { ...trained, count: motion.total, trained: trained.count, colours: new Float32Array(4 * motion.total) };
    splat.colours.set(trained.colours);
    for (const { body, grains } of motion.bodies) {
      for (let k = 0; grains && k < body.points * grains.count; k++) {
        const [at, from] = [4 * (grains.first + k), 4 * Math.floor(k / grains.count)];
        for (let i = 0; i < 3; i++) splat.colours[at + i] = (grains.seen[from + i] / 255 - 0.5) / C0;
        splat.colours[at + 3] = 1;
      }
    }
    this.splat = splat;
    this.ground = ground;
    const program = programOf(gl, VERTEX, FRAGMENT);
    this.program = program;
    this.uniforms = Object.fromEntries(
      ["gaussians", "view", "focal", "size", "walls", "walled"].map((name) => [name, gl.getUniformLocation(program, name)]),
    );
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    const row = gl.getAttribLocation(program, "row");
    this.rows = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.rows);
    gl.enableVertexAttribArray(row);
    gl.vertexAttribIPointer(row, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(row, 1);
    this.height = Math.ceil((4 * splat.count) / WIDTH);
    this.texels = new Float32Array(4 * WIDTH * this.height);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, WIDTH, this.height);
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.order = new Uint32Array(splat.count);
    this.depths = new Uint16Array(splat.count);
    this.starts = new Uint32Array(65537);
  }

  /** Take the Gaussians from where they are now. */
  take(motion) {
    const { texels, splat } = this;
    const { places, edges } = motion;
    for (let row = 0; row < splat.count; row++) {
      const at = 16 * row;
      const e = 9 * row;
      texels[at] = places[3 * row], texels[at + 1] = places[3 * row + 1], texels[at + 2] = places[3 * row + 2];
      const a = edges[e], b = edges[e + 1], c = edges[e + 2];
      const d = edges[e + 3], f = edges[e + 4], g = edges[e + 5];
      const h = edges[e + 6], i = edges[e + 7], j = edges[e + 8];
      texels[at + 4] = a * a + b * b + c * c;
      texels[at + 5] = a * d + b * f + c * g;
      texels[at + 6] = a * h + b * i + c * j;
      texels[at + 7] = d * d + f * f + g * g;
      texels[at + 8] = d * h + f * i + g * j;
      texels[at + 9] = h * h + i * i + j * j;
    }
    this.turns = null;
    this.motion = motion;
  }

  /** Colours as they are seen from a place: harmonics turn with the matter. */
  colour(eye) {
    const { texels, splat, motion } = this;
    const { colours, harmonics, bases, count, trained } = splat;
    if (bases && !this.turns) {
      this.turns = new Float32Array(9 * trained);
      const turn = new Float64Array(9);
      for (let row = 0; row < trained; row++) {
        for (let entry = 0; entry < 9; entry++) turn[entry] = motion.gradients[9 * row + entry];
        rotate(turn);
        this.turns.set(turn, 9 * row);
      }
    }
    const found = new Float64Array(15);
    for (let row = 0; row < count; row++) {
      const at = 16 * row + 12;
      let r = 0.5 + C0 * colours[4 * row], g = 0.5 + C0 * colours[4 * row + 1], b = 0.5 + C0 * colours[4 * row + 2];
      if (bases && row < trained) {
        const { places } = motion;
        const x = places[3 * row] - eye[0], y = places[3 * row + 1] - eye[1], z = places[3 * row + 2] - eye[2];
        const t = this.turns, o = 9 * row;
        const u = t[o] * x + t[o + 3] * y + t[o + 6] * z;
        const v = t[o + 1] * x + t[o + 4] * y + t[o + 7] * z;
        const w = t[o + 2] * x + t[o + 5] * y + t[o + 8] * z;
        const share = 1 / (Math.sqrt(u * u + v * v + w * w) || 1);
        // The splat's own axes: x right, y down, z away.
        basis(u * share, -w * share, v * share, bases, found);
        for (let k = 0; k < bases; k++) {
          const from = 3 * (bases * row + k);
          r += found[k] * harmonics[from], g += found[k] * harmonics[from + 1], b += found[k] * harmonics[from + 2];
        }
      }
      texels[at] = Math.max(0, r), texels[at + 1] = Math.max(0, g), texels[at + 2] = Math.max(0, b);
      texels[at + 3] = colours[4 * row + 3] * motion.opacities[row];
    }
  }

  /** Rows from the farthest to the nearest, by counting. */
  sort(view) {
    const { places } = this.motion;
    const { order, depths, starts } = this;
    const count = order.length;
    let [low, high] = [Infinity, -Infinity];
    const far = new Float32Array(count);
    for (let row = 0; row < count; row++) {
      const depth = view[2] * places[3 * row] + view[6] * places[3 * row + 1] + view[10] * places[3 * row + 2];
      far[row] = depth;
      if (depth < low) low = depth;
      if (depth > high) high = depth;
    }
    const steps = 65535 / Math.max(high - low, 1e-12);
    starts.fill(0);
    for (let row = 0; row < count; row++) {
      depths[row] = (high - far[row]) * steps;
      starts[depths[row] + 1]++;
    }
    for (let step = 0; step < 65536; step++) starts[step + 1] += starts[step];
    for (let row = 0; row < count; row++) order[starts[depths[row]]++] = row;
  }

  /** Paint what was taken, through a camera: view is column by column, x right, y down, z away. */
  paint({ view, eye, focal, width, height }) {
    const { gl, ground } = this;
    this.colour(eye);
    this.sort(view);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, this.height, gl.RGBA, gl.FLOAT, this.texels);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.rows);
    gl.bufferData(gl.ARRAY_BUFFER, this.order, gl.STREAM_DRAW);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    ground.draw({ view, eye, focal, width, height });
    gl.useProgram(this.program);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, ground.depths);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.uniform1i(this.uniforms.gaussians, 0);
    gl.uniform1i(this.uniforms.walls, 1);
    gl.uniform1i(this.uniforms.walled, ground.count > 0 ? 1 : 0);
    gl.uniformMatrix4fv(this.uniforms.view, false, view);
    gl.uniform2f(this.uniforms.focal, focal, focal);
    gl.uniform2f(this.uniforms.size, width, height);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.order.length);
  }
}
