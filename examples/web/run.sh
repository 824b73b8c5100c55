#!/usr/bin/env bash
# Builds the core for WebAssembly, with and without vector instructions, plays the bundled body in
# Node, runs every case of tests/cases.rs, and compares the hashes with this machine's.
#
# Exit status: 0 done, 1 something is wrong, 77 skipped for want of a program.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
target=wasm32-unknown-unknown

. "$root/examples/toolchain.sh"
command -v node > /dev/null || skip "needs node"
rustup target list --installed 2> /dev/null | grep -qx $target ||
    rustup target add $target > /dev/null 2>&1 ||
    skip "needs the target $target (rustup target add $target)"

asset=$here/target/human.sinew
bundled "$asset"
cases=$(cd "$root" && cargo run --release --quiet -p sinew-tests --example cases -- \
    "$here/target/cases")

for features in "" +simd128; do
    echo "target features: ${features:-none}"
    (cd "$here" && RUSTFLAGS="-C target-feature=$features" \
        cargo build --release --quiet --locked --target $target)
    module=$here/target/$target/release/sinew_web.wasm
    node "$here/run.mjs" "$module" "$asset" "$(awk '$1 == "skin.human" { print $3 }' <<< "$cases")"
    while read -r case file hash; do
        node "$here/run.mjs" "$module" "$file" "$hash" "${case%%.*}"
    done <<< "$cases"
done
