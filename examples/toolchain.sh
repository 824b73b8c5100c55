# Shell functions that the examples share. Source this; it changes nothing by itself.

# skip REASON: ends the script as skipped.
skip() {
    echo "SKIPPED: $1" >&2
    exit 77
}

# install PACKAGE...: installs Debian packages where that takes no password.
install() {
    [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null || return 1
    { apt-get install -y --no-install-recommends "$@" ||
        { apt-get update && apt-get install -y --no-install-recommends "$@"; }; } > /dev/null 2>&1
}

# toolchain TARGET CRATES: sets the array `build` to a command that builds for the target, with
# rustup's target or else with Debian's compiler, which builds the standard CRATES from source.
# SINEW_TOOLCHAIN=rustup or =debian takes only that way.
toolchain() {
    with_rustup "$1" || with_debian "$1" "$2" ||
        skip "needs the target $1 (rustup target add $1) or Debian's rustc-web and rust-web-src"
}

with_rustup() {
    [ "${SINEW_TOOLCHAIN:-rustup}" = rustup ] && command -v rustup > /dev/null || return 1
    rustup target list --installed | grep -qx "$1" || rustup target add "$1" > /dev/null 2>&1 ||
        return 1
    build=(cargo build --release --locked --quiet --target "$1")
}

with_debian() {
    [ "${SINEW_TOOLCHAIN:-debian}" = debian ] || return 1
    [ -x /usr/bin/cargo ] && [ -x /usr/bin/rustc ] && [ -d /usr/lib/rustlib/src/rust/library ] ||
        install rustc-web cargo-web rust-web-src || return 1
    local linker variable
    linker=$(ls "$(rustc --print sysroot)"/lib/rustlib/*/bin/rust-lld 2> /dev/null | head -n 1)
    [ -n "$linker" ] || { command -v ld.lld > /dev/null || install lld; } || return 1
    variable=CARGO_TARGET_$(echo "$1" | tr 'a-z-' 'A-Z_')_LINKER
    build=(env RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc "$variable=${linker:-ld.lld}"
        /usr/bin/cargo build --release --locked --quiet "-Zbuild-std=$2" --target "$1")
}

# bundled FILE: bakes the bundled body with its walk and kneel, the same bytes as `sinew demo`.
bundled() {
    mkdir -p "$(dirname "$1")"
    (cd "$root" && cargo run --release --quiet -p sinew-host -- bake --quiet \
        --mesh examples/data/human.glb --motion examples/data/walk.bvh \
        --motion examples/data/kneel.bvh --free-feet --output "$1")
}
