#!/usr/bin/env bash
# Builds the core for WebAssembly, with and without vector instructions, plays the golden asset and
# the bundled body in Node, and compares the bits with those of a desktop.
#
# Exit status: 0 the same, 1 not, 77 skipped for want of a program.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
. "$root/examples/toolchain.sh"

command -v node > /dev/null || install nodejs || skip "needs node (Debian: apt-get install nodejs)"
target=wasm32-unknown-unknown
toolchain $target std,panic_abort
bundled "$here/target/human.sinew"

for features in -simd128 +simd128; do
    echo "target feature $features"
    (cd "$here" && RUSTFLAGS="-C target-feature=$features" \
        "${build[@]}" --target-dir "target/$features")
    node "$here/check.mjs" "$here/target/$features/$target/release/sinew_web.wasm" \
        "$root/tests/golden/fingerprints.toml" \
        "$root/tests/golden/arm.sinew" "$here/target/human.sinew"
done
