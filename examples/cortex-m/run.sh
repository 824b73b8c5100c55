#!/usr/bin/env bash
# Builds a firmware for each stage with an asset in its flash, runs it on an emulated Cortex-M and
# prints what it measured.
#
#   run.sh [--board m4|m7|m33] [--check | --update | --count] [CASE...]
#   run.sh [--board m4|m7|m33] --stage STAGE --asset FILE
#   run.sh [--board m4|m7|m33] --draw OUT.png [--asset FILE]
#
# The board is a Cortex-M7 unless another is named: M4F (mps2-an386), M7 (mps2-an500), M33 (an505).
# Cases are those of tests/cases.rs, as STAGE.NAME; without any, all. --check compares with
# tests/budgets.toml and tests/golden/fingerprints.toml, --update commits the numbers. --count
# compares `cost` with the operations that an M7 executes (tests/python/count_operations.py). With
# --asset, a file of your own. --draw lets the firmware draw a frame into a framebuffer and write it down; the
# asset is the bundled body unless another is named. SINEW_TOOLCHAIN: see examples/toolchain.sh.
#
# Exit status: 0 done, 1 something is wrong, 2 usage, 77 skipped for want of a program.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
board=m7 stage=skin asset= picture= mode= wanted=()
usage() {
    sed -n '2,18s/^# \{0,1\}//p' "$0" >&2
    exit 2
}
while [ $# -gt 0 ]; do
    case $1 in
        --board | --stage | --asset | --draw)
            [ $# -ge 2 ] || usage
            case $1 in
                --board) board=$2 ;;
                --stage) stage=$2 ;;
                --asset) asset=$(realpath "$2") ;;
                --draw) picture=$(realpath -m "$2") ;;
            esac
            shift ;;
        --check | --update | --count) mode=$1 ;;
        -*) usage ;;
        *) wanted+=("$1") ;;
    esac
    shift
done

target=thumbv7em-none-eabihf
case $board in
    m4) cpu=cortex-m4 machine=mps2-an386 ;;
    m7) cpu=cortex-m7 machine=mps2-an500 ;;
    m33) cpu=cortex-m33 machine=mps2-an505 target=thumbv8m.main-none-eabihf ;;
    *) usage ;;
esac

. "$root/examples/toolchain.sh"
command -v qemu-system-arm > /dev/null || install qemu-system-arm ||
    skip "needs qemu-system-arm (Debian: apt-get install qemu-system-arm)"
toolchain $target core
firmware=$here/target/$board/$target/release
export RUSTFLAGS="-C target-cpu=$cpu"

emulate() {
    timeout 600 qemu-system-arm -cpu $cpu -machine $machine -nographic -icount shift=0 \
        -semihosting-config enable=on,target=native -kernel "$1" < /dev/null
}

# measure CASE FILE: the case is STAGE.NAME.
measure() {
    if [ "$mode" = --count ]; then
        (cd "$here" && SINEW_STAGE=${1%%.*} SINEW_ASSET=$2 "${build[@]}" \
            --target-dir "$here/target/$board" --bin counted) &&
            python3 "$root/tests/python/count_operations.py" "$firmware/counted" --name "$1"
        return
    fi
    # The second firmware links only while no code in it can panic.
    (cd "$here" && SINEW_STAGE=${1%%.*} SINEW_ASSET=$2 "${build[@]}" \
        --target-dir "$here/target/$board" --bin stage --bin frame_only) || {
        echo "$1 does not build; a_panic_path_is_linked means: it can panic" >&2
        return 1
    }
    emulate "$firmware/stage" > "$here/target/report.toml" || { cat "$here/target/report.toml" >&2; return 1; }
    (cd "$root" && RUSTFLAGS= cargo run --release --quiet -p sinew-tests --example budgets -- "$board" "$1" \
        "$here/target/report.toml" "$firmware/frame_only" $mode)
}

if [ -n "$picture" ]; then
    [ -n "$asset" ] || { asset=$here/target/human.sinew && RUSTFLAGS= bundled "$asset"; }
    (cd "$here" && SINEW_PICTURE=$picture SINEW_ASSET=$asset "${build[@]}" \
        --target-dir "$here/target/$board" --bin draw)
    emulate "$firmware/draw"
    echo "$picture"
    exit
fi
if [ -n "$asset" ]; then
    measure "$stage.$(basename "$asset" .sinew)" "$asset"
    exit
fi
cases=$here/target/cases
mkdir -p "$cases"
(cd "$root" && RUSTFLAGS= cargo run --release --quiet -p sinew-tests --example cases -- "$cases") \
    > "$here/target/cases.txt"
failed=0
while read -r case file; do
    if [ ${#wanted[@]} -gt 0 ] && [[ " ${wanted[*]} " != *" $case "* ]]; then
        continue
    fi
    measure "$case" "$file" || failed=1
done < "$here/target/cases.txt"
exit $failed
