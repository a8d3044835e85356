// Reads the SOG that a moving splat is, and puts it into the world.

import { filesOf } from "./decoder.js";

const BASES = { 0: 0, 1: 3, 2: 8, 3: 15 };

/** Pixels of a lossless WebP as they are: a canvas of its own would multiply colours by what is not opaque. */
async function pixelsOf(gl, bytes) {
  const picture = await createImageBitmap(new Blob([bytes], { type: "image/webp" }), {
    premultiplyAlpha: "none",
    colorSpaceConversion: "none",
  });
  const { width, height } = picture;
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
  const target = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const pixels = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(target);
  gl.deleteTexture(texture);
  picture.close();
  return { pixels, width, height };
}

/** What a zip holds: files, and its Gaussians at rest in the world, with harmonics as trained. */
export async function openSplat(gl, zip) {
  const files = filesOf(zip);
  const json = async (name) => JSON.parse(new TextDecoder().decode(await files.get(name)()));
  const meta = await json("meta.json");
  const { origin } = await json("motion.json");
  const count = meta.count;
  const picture = async (name) => pixelsOf(gl, await files.get(name)());

  const means = new Float32Array(3 * count);
  const [low, high] = [await picture(meta.means.files[0]), await picture(meta.means.files[1])];
  for (let row = 0; row < count; row++) {
    const at = [0, 1, 2].map((i) => {
      const step = low.pixels[4 * row + i] + 256 * high.pixels[4 * row + i];
      const folded = meta.means.mins[i] + ((meta.means.maxs[i] - meta.means.mins[i]) * step) / 65535;
      return Math.sign(folded) * Math.expm1(Math.abs(folded));
    });
    means[3 * row] = at[0] + origin[0];
    means[3 * row + 1] = at[2] + origin[1];
    means[3 * row + 2] = -at[1] + origin[2];
  }

  const scales = new Float32Array(3 * count);
  const sizes = await picture(meta.scales.files[0]);
  for (let row = 0; row < count; row++) {
    for (let i = 0; i < 3; i++) scales[3 * row + i] = Math.exp(meta.scales.codebook[sizes.pixels[4 * row + i]]);
  }

  const axes = new Float32Array(9 * count);
  const turns = await picture(meta.quats.files[0]);
  for (let row = 0; row < count; row++) {
    const smaller = [0, 1, 2].map((i) => (turns.pixels[4 * row + i] / 127.5 - 1) * Math.SQRT1_2);
    const missing = Math.sqrt(Math.max(0, 1 - smaller[0] ** 2 - smaller[1] ** 2 - smaller[2] ** 2));
    smaller.splice(turns.pixels[4 * row + 3] - 252, 0, missing);
    const [w, x, y, z] = smaller;
    const r = [
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ];
    for (let k = 0; k < 3; k++) {
      axes[9 * row + k] = r[k];
      axes[9 * row + 3 + k] = r[6 + k];
      axes[9 * row + 6 + k] = -r[3 + k];
    }
  }

  const colours = new Float32Array(4 * count);
  const first = await picture(meta.sh0.files[0]);
  for (let row = 0; row < count; row++) {
    for (let i = 0; i < 3; i++) colours[4 * row + i] = meta.sh0.codebook[first.pixels[4 * row + i]];
    colours[4 * row + 3] = first.pixels[4 * row + 3] / 255;
  }
  const bases = meta.shN ? BASES[meta.shN.bands] : 0;
  const harmonics = new Float32Array(3 * bases * count);
  if (bases) {
    const [palette, labels] = [await picture(meta.shN.files[0]), await picture(meta.shN.files[1])];
    for (let row = 0; row < count; row++) {
      const label = labels.pixels[4 * row] + 256 * labels.pixels[4 * row + 1];
      const cell = Math.floor(label / 64) * palette.width + (label % 64) * bases;
      for (let k = 0; k < bases; k++) {
        for (let i = 0; i < 3; i++) {
          harmonics[3 * (bases * row + k) + i] = meta.shN.codebook[palette.pixels[4 * (cell + k) + i]];
        }
      }
    }
  }
  return { files, count, means, axes, scales, colours, harmonics, bases };
}
