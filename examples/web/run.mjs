// Plays an asset in WebAssembly and prints the hash of its frames.
//
//   node run.mjs MODULE.wasm ASSET.sinew [EXPECTED_HASH]
//
// Exit status 1 where a hash differs from the one expected, or from the scalar one.

import { readFileSync } from "node:fs";

const [modulePath, assetPath, expected] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(modulePath));
const sinew = instance.exports;

const asset = readFileSync(assetPath);
const start = sinew.asset_buffer(asset.length);
new Uint8Array(sinew.memory.buffer, start, asset.length).set(asset);
if (sinew.load() !== 1) throw new Error(`${assetPath} is not a sound asset; run sinew verify`);

const vertices = sinew.vertex_count();
const flags = sinew.step(0, 0.5);
const y = new Float32Array(sinew.memory.buffer, sinew.positions(), 3 * vertices)
  .filter((_, at) => at % 3 === 1);
console.log(`${vertices} vertices, flags ${flags}, ${Math.min(...y).toFixed(3)} to ${Math.max(...y).toFixed(3)} m high`);

const hex = (hash) => BigInt.asUintN(64, hash).toString(16).padStart(16, "0");
const started = performance.now();
const best = hex(sinew.fingerprint(0, 0));
const seconds = (performance.now() - started) / 1000;
const scalar = hex(sinew.fingerprint(0, 1));
console.log(`fingerprint ${best}, scalar ${scalar} (${seconds.toFixed(2)} s)`);
if (best !== scalar || (expected && best !== expected)) {
  console.error(`differs: ${expected ?? scalar} expected`);
  process.exit(1);
}
