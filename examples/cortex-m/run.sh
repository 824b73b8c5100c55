#!/usr/bin/env bash
# Builds the firmware with an asset in its flash, runs it on an emulated Cortex-M7 and prints what
# it measured.
#
#   run.sh [--asset FILE] [--check | --update]
#
# Without --asset, the bundled body with its walk and kneel is baked, as `sinew demo` does.
# --check compares with tests/budgets.toml and tests/golden/fingerprints.toml, --update commits the
# numbers. SINEW_TOOLCHAIN: see examples/toolchain.sh.
#
# Exit status: 0 done, 1 something is wrong, 2 usage, 77 skipped for want of a program.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
target=thumbv7em-none-eabihf
asset= mode=
while [ $# -gt 0 ]; do
    case $1 in
        --asset) [ $# -ge 2 ] || { echo "--asset needs a file" >&2; exit 2; }
                 asset=$(realpath "$2"); shift ;;
        --check | --update) mode=$1 ;;
        *) sed -n '2,12s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
    esac
    shift
done

. "$root/examples/toolchain.sh"
command -v qemu-system-arm > /dev/null || install qemu-system-arm ||
    skip "needs qemu-system-arm (Debian: apt-get install qemu-system-arm)"
toolchain $target core

if [ -z "$asset" ]; then
    asset=$here/target/human.sinew
    bundled "$asset"
fi

# The second firmware links only while no code in it can panic.
(cd "$here" && SINEW_ASSET=$asset "${build[@]}") || {
    echo "the firmware does not build; a_panic_path_is_linked means: the core can panic" >&2
    exit 1
}
firmware=$here/target/$target/release
timeout 600 qemu-system-arm -cpu cortex-m7 -machine mps2-an500 -nographic -icount shift=0 \
    -semihosting-config enable=on,target=native -kernel "$firmware/walk" < /dev/null |
    tee "$here/target/report.toml"

cd "$root"
cargo run --release --quiet -p sinew-tests --example budgets -- "$(basename "$asset" .sinew)" \
    "$here/target/report.toml" "$firmware/frame_only" $mode
