// Reads a moving splat: docs/moving_splats.md, in the order of that page. Runs in browsers and in Node.

/** Files of a zip by their names: functions that give their bytes. */
export function filesOf(zip) {
  const view = new DataView(zip.buffer, zip.byteOffset, zip.byteLength);
  let end = zip.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end--;
  if (end < 0) throw new Error("this is no moving splat, or cut off");
  const files = new Map();
  let at = view.getUint32(end + 16, true);
  for (let count = view.getUint16(end + 10, true); count > 0; count--) {
    const method = view.getUint16(at + 10, true);
    const size = view.getUint32(at + 20, true);
    const [name, extra, comment] = [28, 30, 32].map((place) => view.getUint16(at + place, true));
    const local = view.getUint32(at + 42, true);
    const called = new TextDecoder().decode(zip.subarray(at + 46, at + 46 + name));
    const start = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    const packed = zip.subarray(start, start + size);
    files.set(called, () => (method === 0 ? Promise.resolve(packed) : inflated(packed)));
    at += 46 + name + extra + comment;
  }
  return files;
}

async function inflated(packed) {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Whole numbers, read one table after the other. */
export class Numbers {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }

  byte() {
    return this.view.getUint8(this.at++);
  }

  table(rows, columns) {
    const width = this.byte();
    const count = rows * columns;
    if (width < 1 || width > 4 || this.at + width * count > this.bytes.length) throw new Error("numbers are cut off");
    const found = new Int32Array(count);
    for (let column = 0; column < columns; column++) {
      let above = 0;
      for (let row = 0; row < rows; row++) {
        const place = this.at + column * rows + row;
        let folded = 0;
        for (let plane = 0; plane < width; plane++) folded |= this.bytes[place + plane * count] << (8 * plane);
        above += (folded >>> 1) ^ -(folded & 1);
        found[row * columns + column] = above;
      }
    }
    this.at += width * count;
    return found;
  }

  doubles(count) {
    const found = Array.from({ length: count }, (_, index) => this.view.getFloat64(this.at + 8 * index, true));
    this.at += 8 * count;
    return found;
  }

  count() {
    this.at += 4;
    return this.view.getUint32(this.at - 4, true);
  }
}

const SHARES = 65535;
const AXIS_STEPS = 512;
const FLOW_STEPS = 63;
const BURIED = 64;
const OFFSET_STEPS = 32;
const TORN = 2.0;
const WHOLE = 1 / 16;
const REACH = 2.1;
const THIN = 1e-4;
const THINNEST = 1e-5;

async function table(file, rows) {
  const numbers = new Numbers(await file());
  const columns = numbers.byte();
  return { columns, values: numbers.table(rows, columns) };
}

async function floats(file) {
  const bytes = await file();
  return new Float32Array(bytes.slice().buffer);
}

/** Gaussians that each move by themselves: nothing carries them. */
class Free {
  constructor(rows) {
    this.shape = [rows, 12];
  }
}

/** Points that fill a body. */
class Volume {
  static async of(body, file) {
    const carrier = new Volume();
    const rows = body.last - body.first;
    carrier.shape = [body.points, 3];
    carrier.spacing = body.spacing;
    carrier.points = await floats(file("points"));
    carrier.neighbours = await table(file("neighbours"), body.points);
    carrier.labels = await table(file("labels"), rows);
    carrier.weights = await table(file("weights"), rows);
    carrier.maps = new Float64Array(12 * body.points);
    carrier.sums = new Float64Array(9);
    carrier.inverse = new Float64Array(6);
    return carrier;
  }

  /** Affine maps of all points, b then G row by row, from their displacements. */
  prepare(moves) {
    for (let p = 0; p < this.shape[0]; p++) {
      // Where something has been torn off that does not count, unless all is stretched as a whole.
      if (this.fit(p, moves, TORN)[0] && this.fit(p, moves, Infinity)[1] > WHOLE) this.fit(p, moves, TORN);
    }
  }

  /** The map of a point, without neighbours that are `torn` times as far as at rest: whether there are any, and which
   * share of how displacements scatter it does not explain. */
  fit(p, moves, torn) {
    const { points, neighbours, maps, sums, inverse } = this;
    const { values, columns } = neighbours;
    const limit = (REACH * this.spacing) ** 2;
    const most = 3 * (torn * torn - 1);
    const px = points[3 * p], py = points[3 * p + 1], pz = points[3 * p + 2];
    const pu = moves[3 * p], pv = moves[3 * p + 1], pw = moves[3 * p + 2];
    let total = 1, cx = 0, cy = 0, cz = 0, su = 0, sv = 0, sw = 0, xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    let squares = 0, leftOut = false;
    sums.fill(0);
    for (let k = 0; k < columns; k++) {
      const offset = values[p * columns + k];
      if (offset === 0) continue;
      const q = 3 * (p + offset);
      const x = points[q] - px, y = points[q + 1] - py, z = points[q + 2] - pz;
      const u = moves[q] - pu, v = moves[q + 1] - pv, w = moves[q + 2] - pw;
      const square = x * x + y * y + z * z;
      if (square >= limit) continue;
      const now = (x + u) * (x + u) + (y + v) * (y + v) + (z + w) * (z + w);
      if (now > torn * torn * square) {
        leftOut = true;
        continue;
      }
      const weight = (1 - square / limit) ** 2;
      total += weight;
      squares += weight * (u * u + v * v + w * w);
      cx += weight * x, cy += weight * y, cz += weight * z;
      su += weight * u, sv += weight * v, sw += weight * w;
      xx += weight * x * x, xy += weight * x * y, xz += weight * x * z;
      yy += weight * y * y, yz += weight * y * z, zz += weight * z * z;
      sums[0] += weight * u * x, sums[1] += weight * u * y, sums[2] += weight * u * z;
      sums[3] += weight * v * x, sums[4] += weight * v * y, sums[5] += weight * v * z;
      sums[6] += weight * w * x, sums[7] += weight * w * y, sums[8] += weight * w * z;
    }
    const share = 1 / total;
    cx *= share, cy *= share, cz *= share, su *= share, sv *= share, sw *= share;
    xx = xx * share - cx * cx, xy = xy * share - cx * cy, xz = xz * share - cx * cz;
    yy = yy * share - cy * cy, yz = yz * share - cy * cz, zz = zz * share - cz * cz;
    inverse[0] = yy * zz - yz * yz, inverse[1] = xz * yz - xy * zz, inverse[2] = xy * yz - xz * yy;
    inverse[3] = xx * zz - xz * xz, inverse[4] = xy * xz - xx * yz, inverse[5] = xx * yy - xy * xy;
    const determinant = xx * inverse[0] + xy * inverse[1] + xz * inverse[2];
    const mean = (xx + yy + zz) / 3;
    const row = 12 * p;
    maps.fill(0, row, row + 12);
    let explained = 0;
    const scatter = squares * share - (su * su + sv * sv + sw * sw);
    const told = determinant > THIN * mean ** 3;
    if (told) {
      let size = 0;
      for (let i = 0; i < 3; i++) {
        const s = i === 0 ? su : i === 1 ? sv : sw;
        const a = sums[3 * i] * share - s * cx, b = sums[3 * i + 1] * share - s * cy, c = sums[3 * i + 2] * share - s * cz;
        const g = row + 3 + 3 * i;
        maps[g] = (a * inverse[0] + b * inverse[1] + c * inverse[2]) / determinant;
        maps[g + 1] = (a * inverse[1] + b * inverse[3] + c * inverse[4]) / determinant;
        maps[g + 2] = (a * inverse[2] + b * inverse[4] + c * inverse[5]) / determinant;
        size += maps[g] ** 2 + maps[g + 1] ** 2 + maps[g + 2] ** 2;
        explained += maps[g] * a + maps[g + 1] * b + maps[g + 2] * c;
      }
      const spread = maps[row + 3] + maps[row + 7] + maps[row + 11];
      if (size + 2 * spread > most) {
        const less = (Math.sqrt(spread * spread + size * most) - spread) / size;
        for (let entry = 3; entry < 12; entry++) maps[row + entry] *= less;
      }
      cx += px, cy += py, cz += pz;
    } else su = sv = sw = 0;
    for (let i = 0; i < 3; i++) {
      const g = row + 3 + 3 * i;
      const s = i === 0 ? su : i === 1 ? sv : sw;
      maps[row + i] = moves[3 * p + i] + s - (maps[g] * cx + maps[g + 1] * cy + maps[g + 2] * cz);
    }
    return [leftOut, !told ? 1 : scatter > 0 ? 1 - explained / scatter : 0];
  }

  /** The map of one Gaussian whose mean rests at x, y, z, into `map`. */
  map(row, x, y, z, map) {
    const { labels, weights, maps, points } = this;
    const first = row * labels.columns;
    const own = labels.values[first];
    let total = weights.values[row * weights.columns];
    const start = 12 * own;
    if (total === 0) {
      map.fill(0);
      for (let i = 0; i < 3; i++) map[i] = applied(maps, start, i, points[3 * own], points[3 * own + 1], points[3 * own + 2]);
      return;
    }
    const u = applied(maps, start, 0, x, y, z);
    const v = applied(maps, start, 1, x, y, z);
    const w = applied(maps, start, 2, x, y, z);
    for (let entry = 0; entry < 12; entry++) map[entry] = total * maps[start + entry];
    for (let k = 1; k < labels.columns; k++) {
      const weight = weights.values[row * weights.columns + k];
      const other = 12 * (own + labels.values[first + k]);
      const du = applied(maps, other, 0, x, y, z) - u;
      const dv = applied(maps, other, 1, x, y, z) - v;
      const dw = applied(maps, other, 2, x, y, z) - w;
      if (du * du + dv * dv + dw * dw > this.spacing * this.spacing) continue;
      total += weight;
      for (let entry = 0; entry < 12; entry++) map[entry] += weight * maps[other + entry];
    }
    const share = 1 / total;
    for (let entry = 0; entry < 12; entry++) map[entry] *= share;
  }
}

/** What the points of a body come apart into where they flow: `count` grains each, whose rows begin at `first`. */
class Grains {
  static async of(body, file, first) {
    const grains = new Grains();
    const whole = async (name, columns) => {
      const numbers = new Numbers(await file(name));
      const values = numbers.table(body.points, columns);
      if (numbers.at !== numbers.bytes.length) throw new Error(`${name} is longer than it says`);
      return values;
    };
    Object.assign(grains, { first, count: body.grains, scale: body.grain_scale, reach: body.spacing / OFFSET_STEPS });
    grains.offsets = await whole("grains", 3 * body.grains);
    grains.seen = await whole("grain_colours", 4);
    return grains;
  }

  /** A frame: grains where the points of a carrier are, and what is left of the Gaussians that follow these. */
  show(motion, body, carrier, { numbers, shift, flow }) {
    const { places, edges, opacities, header } = motion;
    const { first, count, offsets, seen, reach } = this;
    for (let p = 0; p < body.points; p++) {
      const share = flow[2 * p] / FLOW_STEPS;
      const shown = share > 0 && flow[2 * p + 1] < BURIED;
      const wider = 1 + flow[2 * p + 1] / FLOW_STEPS;
      const scale = this.scale * wider;
      for (let k = 0; k < count; k++) {
        const row = first + count * p + k;
        for (let i = 0; i < 3; i++) {
          const point = body.centre[i] + carrier.points[3 * p + i] + shift[i] + numbers[3 * p + i] * header.quantum;
          places[3 * row + i] = point + wider * reach * offsets[3 * (count * p + k) + i];
        }
        edges[9 * row] = edges[9 * row + 4] = edges[9 * row + 8] = scale;
        opacities[row] = shown ? (share * seen[4 * p + 3]) / 255 : 0;
      }
    }
    const { values, columns } = carrier.labels;
    for (let row = body.first; row < body.last; row++) {
      const start = (row - body.first) * columns;
      let most = 0;
      for (let k = 0; k < columns; k++) most = Math.max(most, flow[2 * (values[start] + (k ? values[start + k] : 0))]);
      opacities[row] = 1 - most / FLOW_STEPS;
    }
  }
}

// Symmetric matrices as xx, xy, xz, yy, yz, zz.
const ROW = [0, 0, 0, 1, 1, 2];
const COLUMN = [0, 1, 2, 1, 2, 2];
const INDEX = [0, 1, 2, 1, 3, 4, 2, 4, 5];

function accumulate(moments, weight, x) {
  for (let i = 0; i < 6; i++) moments[i] += weight * x[ROW[i]] * x[COLUMN[i]];
}

function adjugate([xx, xy, xz, yy, yz, zz]) {
  return [
    yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy,
    xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy,
  ];
}

function applied(maps, start, i, x, y, z) {
  const g = start + 3 + 3 * i;
  return maps[start + i] + maps[g] * x + maps[g + 1] * y + maps[g + 2] * z;
}

/** Eigenvalues of a symmetric matrix, ascending (Smith 1961, 10.1145/355578.366316). */
function eigenvalues(m) {
  const mean = (m[0] + m[3] + m[5]) / 3;
  const off = m[1] ** 2 + m[2] ** 2 + m[4] ** 2;
  const p = Math.sqrt(((m[0] - mean) ** 2 + (m[3] - mean) ** 2 + (m[5] - mean) ** 2 + 2 * off) / 6);
  if (p === 0) return [mean, mean, mean];
  const b = m.map((value, index) => (value - ([0, 3, 5].includes(index) ? mean : 0)) / p);
  const a = adjugate(b);
  const half = Math.max(-1, Math.min(1, (b[0] * a[0] + b[1] * a[1] + b[2] * a[2]) / 2));
  const angle = Math.acos(half) / 3;
  const high = mean + 2 * p * Math.cos(angle);
  const low = mean + 2 * p * Math.cos(angle + (2 * Math.PI) / 3);
  return [low, 3 * mean - high - low, high];
}

/** One level of cores: how they move what they stand for. */
class Level {
  static async of(file, has, number, rows) {
    const level = new Level();
    level.points = await floats(file(`${number}/points`));
    level.count = level.points.length / 12;
    level.labels = (await table(file(`${number}/labels`), rows)).values;
    level.fits = has(`${number}/neighbours`);
    level.sums = new Float64Array(15 * level.count);
    level.summed = new Float64Array(15);
    level.turns = new Float64Array(9 * level.count);
    level.rest = new Float64Array(6 * level.count);
    for (let core = 0; core < level.count; core++) {
      const offset = new Float64Array(3);
      for (let v = 0; v < 4; v++) {
        for (let i = 0; i < 3; i++) level.sums[15 * core + 3 + i] += level.points[12 * core + 3 * v + i] / 4;
      }
      for (let v = 0; v < 4; v++) {
        for (let i = 0; i < 3; i++) offset[i] = level.points[12 * core + 3 * v + i] - level.sums[15 * core + 3 + i];
        accumulate(level.rest.subarray(6 * core, 6 * core + 6), 0.25, offset);
      }
    }
    if (level.fits) {
      level.neighbours = await table(file(`${number}/neighbours`), rows);
      level.weights = await table(file(`${number}/weights`), rows);
      level.inverses = new Float64Array(6 * rows);
      level.fallen = new Uint8Array(rows);
      for (let row = 0; row < rows; row++) level.invert(row);
    }
    return level;
  }

  invert(row) {
    const columns = this.neighbours.columns;
    const place = new Float64Array(3);
    const moments = new Array(6).fill(0);
    for (let k = 0; k < columns; k++) {
      const weight = this.weights.values[row * columns + k] / SHARES;
      const core = this.neighbours.values[row * columns + k];
      for (let i = 0; i < 3; i++) place[i] += weight * this.sums[15 * core + 3 + i];
    }
    const offset = new Float64Array(3);
    for (let k = 0; k < columns; k++) {
      const weight = this.weights.values[row * columns + k] / SHARES;
      const core = this.neighbours.values[row * columns + k];
      for (let i = 0; i < 3; i++) offset[i] = this.sums[15 * core + 3 + i] - place[i];
      accumulate(moments, weight, offset);
      for (let i = 0; i < 6; i++) moments[i] += weight * this.rest[6 * core + i];
    }
    const [low, , high] = eigenvalues(moments);
    if (!(low > THINNEST * high)) {
      this.fallen[row] = 1;
      return;
    }
    const inverse = adjugate(moments);
    const determinant = moments[0] * inverse[0] + moments[1] * inverse[1] + moments[2] * inverse[2];
    for (let i = 0; i < 6; i++) this.inverses[6 * row + i] = inverse[i] / determinant;
  }

  /** Sums over the corners of every core, from their displacements. */
  prepare(moves) {
    const rigid = !this.fits || this.fallen.some((fallen) => fallen);
    for (let core = 0; core < this.count; core++) {
      const row = this.sums.subarray(15 * core, 15 * core + 15);
      row.fill(0, 0, 3), row.fill(0, 6);
      for (let v = 0; v < 4; v++) {
        for (let i = 0; i < 3; i++) {
          const move = moves[12 * core + 3 * v + i] / 4;
          row[i] += move;
          for (let j = 0; j < 3; j++) row[6 + 3 * i + j] += move * this.points[12 * core + 3 * v + j];
        }
      }
      if (rigid) this.turn(core, row);
    }
  }

  turn(core, row) {
    const rest = this.rest.subarray(6 * core, 6 * core + 6);
    const inverse = adjugate(rest);
    const determinant = rest[0] * inverse[0] + rest[1] * inverse[1] + rest[2] * inverse[2];
    const gradient = [1, 0, 0, 0, 1, 0, 0, 0, 1];
    if (determinant > 0) {
      for (let i = 0; i < 3; i++) {
        for (let j = 0; j < 3; j++) {
          for (let k = 0; k < 3; k++) {
            gradient[3 * i + j] += ((row[6 + 3 * i + k] - row[i] * row[3 + k]) * inverse[INDEX[3 * k + j]]) / determinant;
          }
        }
      }
    }
    rotate(gradient);
    this.turns.set(gradient, 9 * core);
  }

  map(row, map) {
    const { sums } = this;
    if (!this.fits || this.fallen[row]) {
      const core = this.labels[row];
      for (let i = 0; i < 3; i++) {
        let turned = 0;
        for (let j = 0; j < 3; j++) {
          const g = this.turns[9 * core + 3 * i + j] - (i === j ? 1 : 0);
          map[3 + 3 * i + j] = g;
          turned += g * sums[15 * core + 3 + j];
        }
        map[i] = sums[15 * core + i] - turned;
      }
      return;
    }
    const columns = this.neighbours.columns;
    const { summed, inverses } = this;
    summed.fill(0);
    for (let k = 0; k < columns; k++) {
      const weight = this.weights.values[row * columns + k] / SHARES;
      if (weight === 0) continue;
      const core = 15 * this.neighbours.values[row * columns + k];
      for (let entry = 0; entry < 15; entry++) summed[entry] += weight * sums[core + entry];
    }
    const at = 6 * row;
    const xx = inverses[at], xy = inverses[at + 1], xz = inverses[at + 2];
    const yy = inverses[at + 3], yz = inverses[at + 4], zz = inverses[at + 5];
    for (let i = 0; i < 3; i++) {
      const g = 6 + 3 * i;
      const a = summed[g] - summed[i] * summed[3];
      const b = summed[g + 1] - summed[i] * summed[4];
      const c = summed[g + 2] - summed[i] * summed[5];
      const g0 = a * xx + b * xy + c * xz, g1 = a * xy + b * yy + c * yz, g2 = a * xz + b * yz + c * zz;
      map[3 + 3 * i] = g0, map[4 + 3 * i] = g1, map[5 + 3 * i] = g2;
      map[i] = summed[i] - (g0 * summed[3] + g1 * summed[4] + g2 * summed[5]);
    }
  }
}

/** The rotation of a matrix, row by row, in its place. */
export function rotate(a) {
  const determinant = a[0] * (a[4] * a[8] - a[5] * a[7]) + a[1] * (a[5] * a[6] - a[3] * a[8]) + a[2] * (a[3] * a[7] - a[4] * a[6]);
  if (determinant > 1e-3) iterate(a);
  else nearest(a);
}

/** Of what is not inside out: the limit of (A + A^-T) / 2 (Higham 1986, 10.1137/0907079). */
function iterate(a) {
  for (let turn = 0; turn < 30; turn++) {
    const c0 = a[4] * a[8] - a[5] * a[7], c1 = a[5] * a[6] - a[3] * a[8], c2 = a[3] * a[7] - a[4] * a[6];
    const c3 = a[2] * a[7] - a[1] * a[8], c4 = a[0] * a[8] - a[2] * a[6], c5 = a[1] * a[6] - a[0] * a[7];
    const c6 = a[1] * a[5] - a[2] * a[4], c7 = a[2] * a[3] - a[0] * a[5], c8 = a[0] * a[4] - a[1] * a[3];
    const determinant = a[0] * c0 + a[1] * c1 + a[2] * c2;
    const share = 1 / determinant;
    const d0 = c0 * share - a[0], d4 = c4 * share - a[4], d8 = c8 * share - a[8];
    a[0] += d0 / 2, a[1] = (a[1] + c1 * share) / 2, a[2] = (a[2] + c2 * share) / 2;
    a[3] = (a[3] + c3 * share) / 2, a[4] += d4 / 2, a[5] = (a[5] + c5 * share) / 2;
    a[6] = (a[6] + c6 * share) / 2, a[7] = (a[7] + c7 * share) / 2, a[8] += d8 / 2;
    // It converges quadratically: what is left after a step of 1e-4 is 1e-8.
    if (Math.abs(determinant - 1) < 1e-8 && Math.abs(d0) + Math.abs(d4) + Math.abs(d8) < 1e-4) return;
  }
}

/** Of any: the quaternion that turns the axes nearest to where they are (Horn 1987, 10.1364/JOSAA.4.000629). */
function nearest(a) {
  const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = a;
  const k = [
    [xx + yy + zz, zy - yz, xz - zx, yx - xy],
    [zy - yz, xx - yy - zz, xy + yx, zx + xz],
    [xz - zx, xy + yx, yy - xx - zz, yz + zy],
    [yx - xy, zx + xz, yz + zy, zz - xx - yy],
  ];
  const vectors = [0, 1, 2, 3].map((i) => [0, 1, 2, 3].map((j) => (i === j ? 1 : 0)));
  // Eigenvectors by the rotations of Jacobi.
  for (let sweep = 0; sweep < 12; sweep++) {
    for (let p = 0; p < 3; p++) {
      for (let q = p + 1; q < 4; q++) {
        if (Math.abs(k[p][q]) < 1e-300) continue;
        const theta = (k[q][q] - k[p][p]) / (2 * k[p][q]);
        const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
        const c = 1 / Math.hypot(t, 1), s = t * c;
        for (const rows of [k, vectors]) {
          for (let i = 0; i < 4; i++) {
            const u = rows[i][p], v = rows[i][q];
            rows[i][p] = c * u - s * v, rows[i][q] = s * u + c * v;
          }
        }
        for (let i = 0; i < 4; i++) {
          const u = k[p][i], v = k[q][i];
          k[p][i] = c * u - s * v, k[q][i] = s * u + c * v;
        }
      }
    }
  }
  const best = [0, 1, 2, 3].reduce((found, i) => (k[i][i] > k[found][found] ? i : found), 0);
  const [w, x, y, z] = vectors.map((row) => row[best]);
  a[0] = 1 - 2 * (y * y + z * z), a[1] = 2 * (x * y - w * z), a[2] = 2 * (x * z + w * y);
  a[3] = 2 * (x * y + w * z), a[4] = 1 - 2 * (x * x + z * z), a[5] = 2 * (y * z - w * x);
  a[6] = 2 * (x * z - w * y), a[7] = 2 * (y * z + w * x), a[8] = 1 - 2 * (x * x + y * y);
}

/** Cores, and cores of cores. */
class Cores {
  static async of(body, file, has) {
    const carrier = new Cores();
    carrier.shape = [body.points, 3];
    carrier.levels = [];
    let count = 0;
    while (has(`${count}/points`)) count++;
    for (let number = 0; number < count; number++) {
      const below = number + 1 < count ? (await floats(file(`${number + 1}/points`))).length / 12 : body.last - body.first;
      carrier.levels.push(await Level.of(file, has, number, below));
    }
    return carrier;
  }

  prepare(moves) {
    const map = new Float64Array(12);
    for (const [number, level] of this.levels.entries()) {
      level.prepare(moves);
      const below = this.levels[number + 1];
      if (!below) return;
      moves = new Float64Array(12 * below.count);
      for (let core = 0; core < below.count; core++) {
        level.map(core, map);
        for (let v = 0; v < 4; v++) {
          const at = 12 * core + 3 * v;
          const [x, y, z] = below.points.subarray(at, at + 3);
          for (let i = 0; i < 3; i++) moves[at + i] = applied(map, 0, i, x, y, z);
        }
      }
    }
  }

  map(row, x, y, z, map) {
    this.levels.at(-1).map(row, map);
  }
}

/**
 * The motion of a splat.
 *
 * `means` (3 S) and `axes` (9 S; the axes of Gaussians, a unit vector a column, row by row) rest in the world, `scales`
 * (3 S). After `show(frame)`, `places` (3 S) and `edges` (9 S; the axes where they are now, times their lengths, a vector a
 * column) are those of the frame, and `gradients` (9 S) is F of each Gaussian.
 */
export class Motion {
  static async of(files, means, axes, scales) {
    const motion = new Motion();
    const header = JSON.parse(new TextDecoder().decode(await files.get("motion.json")()));
    if (header.format !== "gasp-moving-splat" || !(header.version <= 2)) {
      throw new Error(`a moving splat of version ${header.version} is not read here`);
    }
    Object.assign(motion, { header, files, means, axes, scales });
    // Behind the Gaussians of the file come the grains of what may flow.
    motion.count = means.length / 3;
    motion.total = header.bodies.reduce((sum, { grains = 0, points }) => sum + grains * points, motion.count);
    motion.places = new Float32Array(3 * motion.total);
    motion.places.set(means);
    motion.edges = new Float32Array(9 * motion.total);
    motion.opacities = new Float32Array(motion.total).fill(1, 0, motion.count);
    motion.gradients = new Float32Array(axes.length);
    for (let entry = 0; entry < axes.length; entry++) {
      motion.edges[entry] = axes[entry] * scales[3 * Math.floor(entry / 9) + (entry % 3)];
      motion.gradients[entry] = entry % 9 % 4 === 0 ? 1 : 0;
    }
    motion.bodies = [];
    let first = motion.count;
    for (const [number, body] of header.bodies.entries()) {
      const name = (file) => `motion/${number}/${file}`;
      const has = (file) => files.has(name(file));
      const file = (wanted) => {
        if (!has(wanted)) throw new Error(`this moving splat has lost ${name(wanted)}`);
        return files.get(name(wanted));
      };
      const kinds = { free: () => new Free(body.last - body.first), volume: () => Volume.of(body, file), cores: () => Cores.of(body, file, has) };
      const grains = body.grains ? await Grains.of(body, (wanted) => file(wanted)(), first) : null;
      first += (body.grains ?? 0) * body.points;
      motion.bodies.push({ body, carrier: await kinds[body.kind](), grains });
    }
    motion.frames = [];
    return motion;
  }

  /** Decode the frames up to this one, as they foretell each other. */
  async decode(frame) {
    while (this.frames.length <= frame) {
      const next = this.frames.length;
      if (next % this.header.frames_a_block === 0) {
        const name = `motion/frames_${String(next / this.header.frames_a_block).padStart(4, "0")}`;
        if (!this.files.has(name)) throw new Error(`this moving splat has lost ${name}`);
        this.block = new Numbers(await this.files.get(name)());
      }
      this.frames.push(this.bodies.map((one, index) => this.read(one, next, index)));
    }
  }

  read({ body, carrier, grains }, frame, index) {
    const shift = this.block.doubles(3);
    const numbers = this.foretold(...carrier.shape, frame, index, "numbers");
    const corrections = this.corrections(body, frame, index);
    // Most numbers are small, and all frames stay in memory.
    const small = numbers.every((value) => value === (value << 16) >> 16) ? Int16Array.from(numbers) : numbers;
    const flow = grains ? Uint8Array.from(this.foretold(body.points, 2, frame, index, "flow")) : null;
    return { shift, numbers: small, corrections, flow };
  }

  /** Whole numbers that the last frames of the same body foretell. */
  foretold(rows, columns, frame, index, name) {
    const kind = this.block.byte();
    const numbers = this.block.table(rows, columns);
    const [last, before] = [1, 2].map((ago) => this.frames[frame - ago]?.[index][name]);
    if (kind > 2 || (kind > 0 && !last) || (kind > 1 && !before)) throw new Error(`frame ${frame} is damaged`);
    if (kind === 1) for (let k = 0; k < numbers.length; k++) numbers[k] += last[k];
    if (kind === 2) for (let k = 0; k < numbers.length; k++) numbers[k] += 2 * last[k] - before[k];
    return numbers;
  }

  /** Rows that are corrected, and by how much; from version 2 on as changes of what they were in the last frame. */
  corrections(body, frame, index) {
    const count = this.block.count();
    if (!count) return { rows: [], numbers: [] };
    if (this.header.version < 2) return { rows: this.block.table(count, 1), numbers: this.block.table(count, 12) };
    const changes = this.block.count();
    const changed = new Set(this.block.table(changes, 1));
    const numbers = this.block.table(count, 12);
    const last = frame ? this.frames[frame - 1][index].corrections : { rows: [], numbers: [] };
    const places = new Map();
    last.rows.forEach((row, k) => places.set(row, k));
    const kept = Array.from(last.rows).filter((row) => !changed.has(row));
    const added = Array.from(changed).filter((row) => !places.has(row));
    const rows = Int32Array.from([...kept, ...added]).sort();
    if (rows.length !== count) throw new Error(`frame ${frame} is damaged`);
    rows.forEach((row, k) => {
      const at = places.get(row);
      if (at === undefined) return;
      for (let i = 0; i < 12; i++) numbers[12 * k + i] += last.numbers[12 * at + i];
    });
    return { rows, numbers };
  }

  async show(frame) {
    await this.decode(frame);
    this.bodies.forEach(({ body, carrier, grains }, index) => {
      const found = this.frames[frame][index];
      if (carrier instanceof Free) this.free(body, found);
      else this.carried(body, carrier, found);
      this.correct(body, found.corrections);
      grains?.show(this, body, carrier, found);
    });
  }

  carried(body, carrier, { numbers, shift }) {
    const { means, axes, scales, places, edges, gradients } = this;
    const { quantum } = this.header;
    const moves = new Float64Array(numbers.length);
    for (let k = 0; k < moves.length; k++) moves[k] = numbers[k] * quantum;
    carrier.prepare(moves);
    const map = new Float64Array(12);
    const [cx, cy, cz] = body.centre;
    for (let row = body.first; row < body.last; row++) {
      const m = 3 * row, e = 9 * row;
      const x = means[m] - cx, y = means[m + 1] - cy, z = means[m + 2] - cz;
      carrier.map(row - body.first, x, y, z, map);
      for (let i = 0; i < 3; i++) {
        const g0 = map[3 + 3 * i], g1 = map[4 + 3 * i], g2 = map[5 + 3 * i];
        const o = e + 3 * i;
        places[m + i] = means[m + i] + shift[i] + map[i] + g0 * x + g1 * y + g2 * z;
        gradients[o] = g0, gradients[o + 1] = g1, gradients[o + 2] = g2;
        gradients[o + i] += 1;
        edges[o] = (axes[o] + g0 * axes[e] + g1 * axes[e + 3] + g2 * axes[e + 6]) * scales[m];
        edges[o + 1] = (axes[o + 1] + g0 * axes[e + 1] + g1 * axes[e + 4] + g2 * axes[e + 7]) * scales[m + 1];
        edges[o + 2] = (axes[o + 2] + g0 * axes[e + 2] + g1 * axes[e + 5] + g2 * axes[e + 8]) * scales[m + 2];
      }
    }
  }

  free(body, { numbers, shift }) {
    const { means, axes, scales, places, edges, gradients } = this;
    for (let row = body.first; row < body.last; row++) {
      const at = 12 * (row - body.first);
      for (let i = 0; i < 3; i++) places[3 * row + i] = means[3 * row + i] + shift[i] + numbers[at + i] * this.header.quantum;
      for (let entry = 0; entry < 9; entry++) {
        edges[9 * row + entry] = axes[9 * row + entry] + numbers[at + 3 + entry] / AXIS_STEPS;
      }
      // F takes the axes at rest to where they are.
      for (let i = 0; i < 3; i++) {
        for (let j = 0; j < 3; j++) {
          let sum = 0;
          for (let k = 0; k < 3; k++) sum += edges[9 * row + 3 * i + k] * axes[9 * row + 3 * j + k];
          gradients[9 * row + 3 * i + j] = sum;
        }
      }
      for (let entry = 0; entry < 9; entry++) edges[9 * row + entry] *= scales[3 * row + (entry % 3)];
    }
  }

  correct(body, { rows, numbers }) {
    for (let k = 0; k < rows.length; k++) {
      const row = body.first + rows[k];
      for (let i = 0; i < 3; i++) this.places[3 * row + i] += numbers[12 * k + i] * this.header.quantum;
      for (let entry = 0; entry < 9; entry++) {
        this.edges[9 * row + entry] += (numbers[12 * k + 3 + entry] / AXIS_STEPS) * this.scales[3 * row + (entry % 3)];
      }
    }
  }
}
