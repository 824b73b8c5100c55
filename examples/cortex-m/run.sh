#!/usr/bin/env bash
# Builds the firmware with an asset in its flash, runs it on an emulated Cortex-M7 and prints what
# it measured.
#
#   run.sh [--asset FILE] [--check | --update]
#
# Without --asset, the bundled body with its walk and kneel is baked, as `sinew demo` does.
# --check compares with tests/budgets.toml and tests/golden/fingerprints.toml, --update commits the
# numbers. SINEW_TOOLCHAIN=rustup or =debian takes only that way to a compiler for the target.
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

skip() {
    echo "SKIPPED: $1" >&2
    exit 77
}

# install PACKAGE...: installs them where that is possible without a password.
install() {
    [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null || return 1
    { apt-get install -y --no-install-recommends "$@" ||
        { apt-get update && apt-get install -y --no-install-recommends "$@"; }; } > /dev/null 2>&1
}

command -v qemu-system-arm > /dev/null || install qemu-system-arm ||
    skip "needs qemu-system-arm (Debian: apt-get install qemu-system-arm)"

# The target's core library as rustup has it.
with_rustup() {
    [ "${SINEW_TOOLCHAIN:-rustup}" = rustup ] && command -v rustup > /dev/null || return 1
    (cd "$here" && rustup target list --installed | grep -qx $target ||
        rustup target add $target) > /dev/null 2>&1 || return 1
    build=(cargo build --release --locked)
}

# The target's core library built from Debian's copy of its source.
with_debian() {
    [ "${SINEW_TOOLCHAIN:-debian}" = debian ] || return 1
    [ -x /usr/bin/cargo ] && [ -x /usr/bin/rustc ] && [ -d /usr/lib/rustlib/src/rust/library ] ||
        install rustc-web cargo-web rust-web-src || return 1
    local linker
    linker=$(ls "$(rustc --print sysroot)"/lib/rustlib/*/bin/rust-lld 2> /dev/null | head -n 1)
    [ -n "$linker" ] || linker=$(command -v ld.lld) ||
        { install lld && linker=$(command -v ld.lld); } || return 1
    build=(env RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc
        CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER="$linker"
        /usr/bin/cargo build --release --locked -Zbuild-std=core)
}

with_rustup || with_debian ||
    skip "needs the target $target (rustup target add $target) or Debian's rust-web-src"

host() { (cd "$root" && cargo run --release --quiet "$@"); }

if [ -z "$asset" ]; then
    asset=$here/target/human.sinew
    mkdir -p "$here/target"
    host -p sinew-host -- bake --quiet --mesh examples/data/human.glb \
        --motion examples/data/walk.bvh --motion examples/data/kneel.bvh --output "$asset"
fi

# The second firmware links only while no code in it can panic.
(cd "$here" && SINEW_ASSET=$asset "${build[@]}" --quiet) || {
    echo "the firmware does not build; a_panic_path_is_linked means: the core can panic" >&2
    exit 1
}
firmware=$here/target/$target/release
timeout 600 qemu-system-arm -cpu cortex-m7 -machine mps2-an500 -nographic -icount shift=0 \
    -semihosting-config enable=on,target=native -kernel "$firmware/walk" < /dev/null |
    tee "$here/target/report.toml"

host -p sinew-tests --example budgets -- "$(basename "$asset" .sinew)" \
    "$here/target/report.toml" "$firmware/frame_only" $mode
