// Draws what is solid with WebGL 2, by a ray through every pixel, as `gasp_core.rendering.scenery` does.

import { Numbers } from "./decoder.js";

const MOST = 64;
const KINDS = { plane: 0, sphere: 1, box: 2, "signed distance field": 3 };
/** Textures of fields, each a sampler of its own. */
const MOST_FIELDS = 4;
const FIRST_UNIT = 2;
/** Of the table of solids, a row for each: see `Ground.rows`. */
const COLUMNS = 8;
/** Whole numbers of a field in a spacing. */
const STEPS = 64;

const SCREEN = `#version 300 es
in vec2 corner;
void main() {
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const FIELDS = [...Array(MOST_FIELDS).keys()];

const RAYS = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
uniform mat4 view;
uniform vec3 eye;
uniform float focal;
uniform vec2 size;
uniform vec3 middle;
uniform float reach;
uniform float spacing;
uniform int count;
uniform sampler2D solids;
${FIELDS.map((number) => `uniform sampler3D field${number};`).join("\n")}
layout(location = 0) out vec4 colour;
layout(location = 1) out uint bits;

const float NOTHING = 1e30;
const vec3 GROUND = vec3(0.80, 0.80, 0.79);
const vec3 SOLID = vec3(0.72, 0.66, 0.58);

/** A collider: place is its point, center or first node; extent its normal, half extents, radius or last node. */
struct Solid { int kind; bool inside; int field; vec3 place; float step; vec3 extent; vec3 at; vec3 center; mat3 turn; };

Solid solidOf(int number) {
  vec4 row[${COLUMNS}];
  for (int k = 0; k < ${COLUMNS}; k++) row[k] = texelFetch(solids, ivec2(k, number), 0);
  return Solid(
    int(row[0].x), row[0].y > 0.5, int(row[0].z), row[1].xyz, row[1].w, row[2].xyz, row[3].xyz, row[4].xyz,
    mat3(row[5].xyz, row[6].xyz, row[7].xyz)
  );
}

/** Brightness of a plane with lines, smoothed over blur metres. */
float lines(vec3 position, vec3 normal, float blur) {
  vec3 n = abs(normal);
  vec2 cell = (n.z >= n.x && n.z >= n.y ? position.xy : n.y >= n.x ? position.xz : position.yz) / spacing;
  float width = max(blur / spacing, 1e-6);
  vec2 away = abs(cell - round(cell));
  vec2 covered = clamp((0.015 + 0.5 * width - away) / width, 0.0, min(1.0, 0.03 / width));
  if (width > 0.5) covered = vec2(0.03);
  return (1.0 - 0.14 * covered.x) * (1.0 - 0.14 * covered.y);
}

/** Signed distance in spacings, at a place in spacings from the first node. */
float fieldAt(int number, vec3 place, vec3 last) {
  vec3 share = (clamp(place, vec3(0.0), last) + 0.5) / (last + 1.0);
${FIELDS.map((number) => `  if (number == ${number}) return textureLod(field${number}, share.zyx, 0.0).x;`).join("\n")}
  return 1.0;
}

/** Sphere tracing (Hart 1996): where a ray first goes in, or comes out of what matter is inside of. */
float traced(Solid solid, vec3 origin, vec3 ray) {
  vec3 start = (origin - solid.place) / solid.step, way = ray / solid.step;
  vec3 safe = mix(way, vec3(1e-12), lessThan(abs(way), vec3(1e-12)));
  vec3 one = -start / safe, other = (solid.extent - start) / safe;
  vec3 low = min(one, other), high = max(one, other);
  float depth = max(0.0, max(low.x, max(low.y, low.z))), end = min(high.x, min(high.y, high.z));
  if (depth >= end) return NOTHING;
  float speed = length(way), before = depth;
  float value = fieldAt(solid.field, start + depth * way, solid.extent), was = value;
  for (int turn = 0; turn < 2000; turn++) {
    if (solid.inside ? was < 0.0 && value >= 0.0 : was > 0.0 && value <= 0.0) {
      for (int half_ = 0; half_ < 12; half_++) {
        float between = 0.5 * (before + depth);
        if ((fieldAt(solid.field, start + between * way, solid.extent) < 0.0) == (was < 0.0)) before = between;
        else depth = between;
      }
      return depth;
    }
    if (depth >= end) return NOTHING;
    was = value, before = depth;
    depth = min(depth + max(0.9 * abs(value), 0.1) / speed, end);
    value = fieldAt(solid.field, start + depth * way, solid.extent);
  }
  return NOTHING;
}

float met_at(Solid solid, vec3 origin, vec3 ray) {
  if (solid.kind == 3) return traced(solid, origin, ray);
  vec3 place = origin - solid.place;
  float entry, leave;
  if (solid.kind == 0) {
    // Seen from behind it is not there.
    float height = dot(place, solid.extent), falling = -dot(ray, solid.extent);
    return height > 0.0 && falling > 0.0 ? height / falling : NOTHING;
  } else if (solid.kind == 1) {
    float a = dot(ray, ray), b = dot(ray, place);
    float root = b * b - a * (dot(place, place) - solid.extent.x * solid.extent.x);
    if (root < 0.0) return NOTHING;
    entry = (-b - sqrt(root)) / a, leave = (-b + sqrt(root)) / a;
  } else {
    vec3 safe = mix(ray, vec3(1e-12), lessThan(abs(ray), vec3(1e-12)));
    vec3 one = (-solid.extent - place) / safe, other = (solid.extent - place) / safe;
    vec3 low = min(one, other), high = max(one, other);
    entry = max(low.x, max(low.y, low.z)), leave = min(high.x, min(high.y, high.z));
    if (entry > leave) return NOTHING;
  }
  float chosen = solid.inside ? leave : entry;
  return chosen > 0.0 ? chosen : NOTHING;
}

vec3 normalOf(Solid solid, vec3 position) {
  vec3 local = position - solid.place;
  if (solid.kind == 1) return normalize(local);
  if (solid.kind == 2) {
    vec3 share = abs(local) / solid.extent;
    float most = max(share.x, max(share.y, share.z));
    return sign(local) * vec3(greaterThanEqual(share, vec3(most)));
  }
  vec3 node = local / solid.step, slope;
  for (int axis = 0; axis < 3; axis++) {
    vec3 aside = vec3(0.0);
    aside[axis] = 0.5;
    slope[axis] = fieldAt(solid.field, node + aside, solid.extent) - fieldAt(solid.field, node - aside, solid.extent);
  }
  return slope == vec3(0.0) ? vec3(0.0, 0.0, 1.0) : normalize(slope);
}

void main() {
  vec2 slope = (gl_FragCoord.xy - 0.5 * size) / focal * vec2(1.0, -1.0);
  vec3 ray = vec3(slope, 1.0) * mat3(view);
  float depth = NOTHING;
  int met = -1;
  for (int i = 0; i < count; i++) {
    Solid solid = solidOf(i);
    // What moves is met in its own frame.
    float found = met_at(solid, (eye - solid.at) * solid.turn + solid.center, ray * solid.turn);
    if (found < depth) depth = found, met = i;
  }
  colour = vec4(0.0);
  bits = floatBitsToUint(depth);
  if (met < 0) return;
  Solid solid = solidOf(met);
  vec3 position = eye + depth * ray;
  vec3 local = (position - solid.at) * solid.turn + solid.center;
  if (solid.kind == 0) {
    float weight = smoothstep(0.0, 1.0, clamp((4.5 - distance(position, middle) / reach) / 3.0, 0.0, 1.0));
    float slant = abs(dot(ray, solid.turn * solid.extent)) / length(ray);
    colour = weight * vec4(GROUND * lines(local, solid.extent, depth / (focal * slant)), 1.0);
  } else {
    vec3 normal = solid.turn * normalOf(solid, local);
    if (solid.inside) normal = -normal;
    float light = 0.55 + 0.45 * max(dot(normal, normalize(vec3(0.35, -0.5, 1.6))), 0.0);
    colour = vec4(SOLID * light, 1.0);
  }
}`;

export function programOf(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  // The square that everything is drawn with, wherever it is bound.
  gl.bindAttribLocation(program, 0, "corner");
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

/** The largest of 1, 2, 5 times a power of ten that is not above a length. */
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [5, 2, 1].find((step) => step * power <= length * (1 + 1e-12));
}

function doubles(bytes, count) {
  if (bytes.length !== 8 * count) throw new Error("poses are cut off");
  return new Float64Array(bytes.slice().buffer);
}

/** Colliders of the header: `draw` paints them, and `depths` is a texture of how far they are [m], bits of floats. */
export class Ground {
  static async of(gl, header, files) {
    const ground = new Ground(gl, header);
    await ground.fetch(header, files);
    return ground;
  }

  constructor(gl, { camera }) {
    this.gl = gl;
    this.count = 0;
    this.depths = gl.createTexture();
    this.fields = [];
    this.movers = [];
    this.middle = camera?.target ?? [0, 0, 0];
    this.reach = camera?.reach ?? (camera ? 0.5 * Math.hypot(...camera.position.map((value, i) => value - camera.target[i])) : 1);
    this.spacing = roundLength(this.reach / 4);
    this.fit(1, 1);
  }

  /** What is drawn of them, and what that takes. */
  async fetch({ colliders = [], frames }, files) {
    const { gl } = this;
    const rows = [];
    for (const [number, one] of colliders.entries()) {
      if (!(one.kind in KINDS) || rows.length === MOST) continue;
      if (one.nodes && (this.fields.length === MOST_FIELDS || Math.max(...one.nodes) > gl.getParameter(gl.MAX_3D_TEXTURE_SIZE))) continue;
      const file = async (name) => {
        const path = `motion/colliders/${number}/${name}`;
        if (!files.has(path)) throw new Error(`this moving splat has lost ${path}`);
        return files.get(path)();
      };
      if (one.moves) this.movers.push({ row: rows.length, poses: doubles(await file("poses"), 7 * frames) });
      rows.push(Ground.row(one, this.fields.length));
      if (one.nodes) this.fields.push(this.field(one.nodes, await file("field")));
    }
    this.count = rows.length;
    if (!this.count) return;
    this.table = new Float32Array(rows.flat());
    this.solids = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.solids);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, COLUMNS, this.count);
    this.program = programOf(gl, SCREEN, RAYS);
    this.frame = gl.createFramebuffer();
    this.colours = gl.createTexture();
    this.width = 0;
    this.show(0);
  }

  /** A collider as the shader has it, where it stands in the scene. */
  static row(one, field) {
    const sign = one.side === "inside" ? -1 : 1;
    const extent = one.normal?.map((value) => sign * value) ?? one.half_extents ?? one.nodes?.map((n) => n - 1) ?? [one.radius, 0, 0];
    return [
      ...[KINDS[one.kind], one.side === "inside" ? 1 : 0, field, 0],
      ...[...(one.point ?? one.center ?? one.origin), one.spacing ?? 0],
      ...[...extent, 0],
      ...[...(one.moves ?? [0, 0, 0]), 0],
      ...[...(one.moves ?? [0, 0, 0]), 0],
      ...[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
    ];
  }

  /** Signed distances in spacings, as a texture. */
  field([nx, ny, nz], bytes) {
    const { gl } = this;
    const table = new Numbers(bytes);
    const numbers = table.table(nx * ny, nz);
    if (table.at !== bytes.length) throw new Error("a field is longer than it says");
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_3D, texture);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_3D, gl[name], gl.LINEAR);
    for (const name of ["TEXTURE_WRAP_S", "TEXTURE_WRAP_T", "TEXTURE_WRAP_R"]) gl.texParameteri(gl.TEXTURE_3D, gl[name], gl.CLAMP_TO_EDGE);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.R16F, nz, ny, nx, 0, gl.RED, gl.FLOAT, Float32Array.from(numbers, (value) => value / STEPS));
    return texture;
  }

  /** What moves, where it is in a frame. */
  show(frame) {
    if (!this.count) return;
    const { gl, table } = this;
    for (const { row, poses } of this.movers) {
      const [x, y, z, w, a, b, c] = poses.subarray(7 * frame, 7 * frame + 7);
      const at = 4 * COLUMNS * row;
      table.set([x, y, z], at + 12);
      // Columns of the rotation.
      table.set([1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)], at + 20);
      table.set([2 * (a * b - w * c), 1 - 2 * (a * a + c * c), 2 * (b * c + w * a)], at + 24);
      table.set([2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b)], at + 28);
    }
    gl.bindTexture(gl.TEXTURE_2D, this.solids);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, COLUMNS, this.count, gl.RGBA, gl.FLOAT, table);
  }

  /** Textures of the picture's size; of one pixel where there is nothing to draw. */
  fit(width, height) {
    const { gl } = this;
    if (this.width === width && this.height === height) return;
    [this.width, this.height] = [width, height];
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.depths);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, width, height, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, null);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
    if (this.count) {
      gl.bindTexture(gl.TEXTURE_2D, this.colours);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      gl.bindTexture(gl.TEXTURE_2D, this.depths);
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.colours, 0);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, gl.TEXTURE_2D, this.depths, 0);
      gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Paint onto a clear canvas; the square's corners are bound as attribute 0. */
  draw({ view, eye, focal, width, height }) {
    if (!this.count) return;
    const { gl, program } = this;
    this.fit(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.disable(gl.BLEND);
    gl.useProgram(program);
    const at = (name) => gl.getUniformLocation(program, name);
    gl.uniformMatrix4fv(at("view"), false, view);
    gl.uniform3fv(at("eye"), eye);
    gl.uniform1f(at("focal"), focal);
    gl.uniform2f(at("size"), width, height);
    gl.uniform3fv(at("middle"), this.middle);
    gl.uniform1f(at("reach"), this.reach);
    gl.uniform1f(at("spacing"), this.spacing);
    gl.uniform1i(at("count"), this.count);
    gl.uniform1i(at("solids"), 0);
    gl.bindTexture(gl.TEXTURE_2D, this.solids);
    for (const number of FIELDS) {
      // A sampler without a texture of its kind must not share a unit with one of another.
      gl.uniform1i(at(`field${number}`), FIRST_UNIT + number);
      gl.activeTexture(gl.TEXTURE0 + FIRST_UNIT + number);
      gl.bindTexture(gl.TEXTURE_3D, this.fields[number] ?? null);
    }
    gl.activeTexture(gl.TEXTURE0);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.frame);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.enable(gl.BLEND);
  }
}
