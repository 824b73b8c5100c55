// Runs the Khronos glTF validator.
//
//     npm install --prefix out/node gltf-validator
//     node tests/node/validate_glb.mjs FILE.glb ...
//
// Exit status 1 if a file has errors or warnings.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";

const require = createRequire(resolve("out/node/package.json"));
const validator = require("gltf-validator");

let failed = false;
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)));
  const { numErrors, numWarnings, numInfos, messages } = report.issues;
  console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos`);
  for (const message of messages.filter(({ severity }) => severity < 2)) {
    console.log(`  ${message.pointer}: ${message.code}: ${message.message}`);
  }
  failed ||= numErrors + numWarnings > 0;
}
process.exit(failed ? 1 : 0);
