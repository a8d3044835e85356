// Decodes frames of a moving splat with the page's decoder: node decode.mjs DECODER SPLAT REST OUT FRAME...
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";

const [decoder, splat, rest, out, ...frames] = process.argv.slice(2);
// What a page has inside is no module by its name.
copyFileSync(decoder, `${out}.mjs`);
const { Motion, filesOf } = await import(`${out}.mjs`);
const numbers = new Float32Array(readFileSync(rest).buffer.slice(0));
const count = numbers.length / 15;
const files = filesOf(new Uint8Array(readFileSync(splat)));
const motion = await Motion.of(files, ...[[0, 3], [3, 12], [12, 15]].map((part) => numbers.slice(...part.map((x) => x * count))));
const found = [];
for (const frame of frames) {
  await motion.show(Number(frame));
  found.push(...[motion.places, motion.edges, motion.gradients].map((array) => Buffer.from(array.slice().buffer)));
}
writeFileSync(out, Buffer.concat(found));
