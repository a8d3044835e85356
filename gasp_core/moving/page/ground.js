// Draws what is solid with WebGL 2, by a ray through every pixel, as `gasp_core.rendering.scenery` does.

const MOST = 64;
const KINDS = { plane: 0, sphere: 1, box: 2 };

const SCREEN = `#version 300 es
in vec2 corner;
void main() {
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const RAYS = `#version 300 es
precision highp float;
precision highp int;
uniform mat4 view;
uniform vec3 eye;
uniform float focal;
uniform vec2 size;
uniform vec3 middle;
uniform float reach;
uniform float spacing;
uniform int count;
uniform ivec2 kinds[${MOST}];
uniform vec3 places[${MOST}];
uniform vec3 extents[${MOST}];
layout(location = 0) out vec4 colour;
layout(location = 1) out uint bits;

const float NOTHING = 1e30;
const vec3 GROUND = vec3(0.80, 0.80, 0.79);
const vec3 SOLID = vec3(0.72, 0.66, 0.58);

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

void main() {
  vec2 slope = (gl_FragCoord.xy - 0.5 * size) / focal * vec2(1.0, -1.0);
  vec3 ray = vec3(slope, 1.0) * mat3(view);
  float depth = NOTHING;
  int met = -1;
  for (int i = 0; i < count; i++) {
    vec3 place = eye - places[i];
    vec3 extent = extents[i];
    bool inside = kinds[i].y == 1;
    float found = NOTHING;
    if (kinds[i].x == 0) {
      // Seen from behind it is not there.
      float height = dot(place, extent), falling = -dot(ray, extent);
      if (height > 0.0 && falling > 0.0) found = height / falling;
    } else {
      float entry, leave;
      if (kinds[i].x == 1) {
        float a = dot(ray, ray), b = dot(ray, place);
        float root = b * b - a * (dot(place, place) - extent.x * extent.x);
        if (root < 0.0) continue;
        entry = (-b - sqrt(root)) / a, leave = (-b + sqrt(root)) / a;
      } else {
        vec3 safe = mix(ray, vec3(1e-12), lessThan(abs(ray), vec3(1e-12)));
        vec3 one = (-extent - place) / safe, other = (extent - place) / safe;
        vec3 low = min(one, other), high = max(one, other);
        entry = max(low.x, max(low.y, low.z)), leave = min(high.x, min(high.y, high.z));
        if (entry > leave) continue;
      }
      float chosen = inside ? leave : entry;
      if (chosen > 0.0) found = chosen;
    }
    if (found < depth) depth = found, met = i;
  }
  colour = vec4(0.0);
  bits = floatBitsToUint(depth);
  if (met < 0) return;
  vec3 position = eye + depth * ray;
  if (kinds[met].x == 0) {
    vec3 normal = extents[met];
    float weight = smoothstep(0.0, 1.0, clamp((4.5 - distance(position, middle) / reach) / 3.0, 0.0, 1.0));
    float slant = abs(dot(ray, normal)) / length(ray);
    colour = weight * vec4(GROUND * lines(position, normal, depth / (focal * slant)), 1.0);
  } else {
    vec3 local = position - places[met];
    vec3 normal = normalize(local);
    if (kinds[met].x == 2) {
      vec3 share = abs(local) / extents[met];
      float most = max(share.x, max(share.y, share.z));
      normal = sign(local) * vec3(greaterThanEqual(share, vec3(most)));
    }
    if (kinds[met].y == 1) normal = -normal;
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

/** Colliders of the header: `draw` paints them, and `depths` is a texture of how far they are [m], bits of floats. */
export class Ground {
  constructor(gl, { colliders, camera }) {
    this.gl = gl;
    const drawn = (colliders ?? []).filter(({ kind }) => kind in KINDS).slice(0, MOST);
    this.count = drawn.length;
    this.depths = gl.createTexture();
    if (!this.count) {
      this.fit(1, 1);
      return;
    }
    const sign = ({ side }) => (side === "inside" ? -1 : 1);
    this.kinds = new Int32Array(drawn.flatMap((one) => [KINDS[one.kind], one.side === "inside" ? 1 : 0]));
    this.places = new Float32Array(drawn.flatMap((one) => one.point ?? one.center));
    this.extents = new Float32Array(
      drawn.flatMap((one) => one.normal?.map((value) => sign(one) * value) ?? one.half_extents ?? [one.radius, 0, 0]),
    );
    this.middle = camera?.target ?? [0, 0, 0];
    this.reach = camera?.reach ?? (camera ? 0.5 * Math.hypot(...camera.position.map((value, i) => value - camera.target[i])) : 1);
    this.spacing = roundLength(this.reach / 4);
    this.program = programOf(gl, SCREEN, RAYS);
    this.frame = gl.createFramebuffer();
    this.colours = gl.createTexture();
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
    gl.uniform2iv(at("kinds"), this.kinds);
    gl.uniform3fv(at("places"), this.places);
    gl.uniform3fv(at("extents"), this.extents);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.frame);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.enable(gl.BLEND);
  }
}
