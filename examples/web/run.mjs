// Plays an asset in WebAssembly and prints the hash of its frames.
//
//   node run.mjs MODULE.wasm ASSET.sinew [EXPECTED_HASH]
//   node run.mjs MODULE.wasm ASSET.sinew EXPECTED_HASH STAGE
//
// With a stage of tests/stages, that instead of the frames. Exit status 1 where a hash differs from the one expected, or from the scalar one.

import { readFileSync } from "node:fs";

const [modulePath, assetPath, expected, stage] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(modulePath));
const sinew = instance.exports;

const write = (bytes) => {
  const start = sinew.asset_buffer(bytes.length);
  new Uint8Array(sinew.memory.buffer, start, bytes.length).set(bytes);
};
write(Buffer.from(stage ?? ""));
const stageIndex = sinew.stage_named();
if (stage && stageIndex < 0) throw new Error(`there is no stage ${stage}`);
write(readFileSync(assetPath));
if (sinew.load() !== 1) throw new Error(`${assetPath} is not a sound asset; run sinew verify`);

const hex = (hash) => BigInt.asUintN(64, hash).toString(16).padStart(16, "0");
const compare = (best, scalar) => {
  if (best !== scalar || (expected && best !== expected)) {
    console.error(`differs: ${expected ?? scalar} expected`);
    process.exit(1);
  }
};
if (stage) {
  const [best, scalar] = [0, 1].map((which) => hex(sinew.stage(stageIndex, which)));
  console.log(`${stage}: ${best}, scalar ${scalar}`);
  compare(best, scalar);
  process.exit(0);
}

const vertices = sinew.vertex_count();
const flags = sinew.step(0, 0.5);
const y = new Float32Array(sinew.memory.buffer, sinew.positions(), 3 * vertices)
  .filter((_, at) => at % 3 === 1);
console.log(`${vertices} vertices, flags ${flags}, ${Math.min(...y).toFixed(3)} to ${Math.max(...y).toFixed(3)} m high`);

const started = performance.now();
const best = hex(sinew.fingerprint(0, 0));
const seconds = (performance.now() - started) / 1000;
const scalar = hex(sinew.fingerprint(0, 1));
console.log(`fingerprint ${best}, scalar ${scalar} (${seconds.toFixed(2)} s)`);
compare(best, scalar);
