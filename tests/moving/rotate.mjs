// Rotations of matrices with the page's decoder: node rotate.mjs DECODER MATRICES OUT
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";

const [decoder, matrices, out] = process.argv.slice(2);
copyFileSync(decoder, `${out}.mjs`);
const { rotate } = await import(`${out}.mjs`);
const numbers = new Float64Array(readFileSync(matrices).buffer.slice(0));
for (let first = 0; first < numbers.length; first += 9) rotate(numbers.subarray(first, first + 9));
writeFileSync(out, Buffer.from(numbers.buffer));
