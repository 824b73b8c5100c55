// Plays assets in a WebAssembly engine and compares the bits with what is committed.
//
//   node check.mjs MODULE.wasm FINGERPRINTS.toml ASSET.sinew...

import { readFileSync } from "node:fs";
import { basename } from "node:path";

const [modulePath, committedPath, ...assetPaths] = process.argv.slice(2);
if (assetPaths.length === 0) {
    console.error("usage: node check.mjs MODULE.wasm FINGERPRINTS.toml ASSET.sinew...");
    process.exit(2);
}
const committed = readFileSync(committedPath, "utf8");
let faults = 0;

function fail(text) {
    console.error(`error: ${text}`);
    faults += 1;
}

/** Loads bytes into a module of their own; returns its exports and the number of vertices. */
async function load(bytes) {
    const { instance } = await WebAssembly.instantiate(readFileSync(modulePath));
    const core = instance.exports;
    const place = core.reserve(bytes.length);
    new Uint8Array(core.memory.buffer, place, bytes.length).set(bytes);
    return [core, core.load(bytes.length)];
}

for (const path of assetPaths) {
    const name = basename(path, ".sinew");
    const bytes = readFileSync(path);
    const [core, vertices] = await load(bytes);
    if (vertices === 0) {
        fail(`${path} is not a sound asset`);
        continue;
    }
    const started = performance.now();
    const found = BigInt.asUintN(64, core.fingerprint()).toString(16).padStart(16, "0");
    const milliseconds = (performance.now() - started).toFixed(0);
    const table = committed.split(`[${name}]`)[1]?.split("[")[0] ?? "";
    const wanted = /frames = "([0-9a-f]{16})"/.exec(table)?.[1];
    if (found !== wanted) fail(`${name}: the frames hash to ${found}, committed is ${wanted}`);
    const middle = core.step(core.duration() / 2);
    const points = new Float32Array(core.memory.buffer, core.positions(), 3 * vertices);
    if (middle !== 0 || !points.every(Number.isFinite)) fail(`${name}: a frame was not whole`);
    console.log(`${name}: ${vertices} vertices, hash ${found}, all frames in ${milliseconds} ms`);

    // What is damaged must be refused, not played.
    bytes[bytes.length >> 1] ^= 1;
    const [damaged, accepted] = await load(bytes);
    if (accepted !== 0 || damaged.step(0) === 0) fail(`${name}: damage was not noticed`);
}
process.exit(faults === 0 ? 0 : 1);
