#!/usr/bin/env bash
# Builds a firmware for each stage with an asset in its flash, runs it on an emulated Cortex-M7 and
# prints what it measured.
#
#   run.sh [--check | --update] [CASE...]
#   run.sh --stage STAGE --asset FILE
#
# Cases are those of tests/cases.rs, as STAGE.NAME; without any, all. --check compares with
# tests/budgets.toml and tests/golden/fingerprints.toml, --update commits the numbers. With --asset,
# a file of your own. SINEW_TOOLCHAIN: see examples/toolchain.sh.
#
# Exit status: 0 done, 1 something is wrong, 2 usage, 77 skipped for want of a program.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
target=thumbv7em-none-eabihf
stage=skin asset= mode= wanted=()
usage() {
    sed -n '2,13s/^# \{0,1\}//p' "$0" >&2
    exit 2
}
while [ $# -gt 0 ]; do
    case $1 in
        --stage | --asset)
            [ $# -ge 2 ] || usage
            [ "$1" = --stage ] && stage=$2 || asset=$(realpath "$2")
            shift ;;
        --check | --update) mode=$1 ;;
        -*) usage ;;
        *) wanted+=("$1") ;;
    esac
    shift
done

. "$root/examples/toolchain.sh"
command -v qemu-system-arm > /dev/null || install qemu-system-arm ||
    skip "needs qemu-system-arm (Debian: apt-get install qemu-system-arm)"
toolchain $target core
firmware=$here/target/$target/release

# measure CASE FILE: the case is STAGE.NAME.
measure() {
    # The second firmware links only while no code in it can panic.
    (cd "$here" && SINEW_STAGE=${1%%.*} SINEW_ASSET=$2 "${build[@]}") || {
        echo "$1 does not build; a_panic_path_is_linked means: it can panic" >&2
        return 1
    }
    timeout 600 qemu-system-arm -cpu cortex-m7 -machine mps2-an500 -nographic -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$firmware/stage" < /dev/null \
        > "$here/target/report.toml" || { cat "$here/target/report.toml" >&2; return 1; }
    (cd "$root" && cargo run --release --quiet -p sinew-tests --example budgets -- "$1" \
        "$here/target/report.toml" "$firmware/frame_only" $mode)
}

if [ -n "$asset" ]; then
    measure "$stage.$(basename "$asset" .sinew)" "$asset"
    exit
fi
cases=$here/target/cases
mkdir -p "$cases"
(cd "$root" && cargo run --release --quiet -p sinew-tests --example cases -- "$cases") \
    > "$here/target/cases.txt"
failed=0
while read -r case file; do
    if [ ${#wanted[@]} -gt 0 ] && [[ " ${wanted[*]} " != *" $case "* ]]; then
        continue
    fi
    measure "$case" "$file" || failed=1
done < "$here/target/cases.txt"
exit $failed
