#!/usr/bin/env bash
# Builds a firmware for each stage with an asset in its flash, runs it on an emulated Cortex-M and
# prints what it measured.
#
#   run.sh [--board m3|m4|m7|m33] [--check | --update | --count | --micromath] [CASE...]
#   run.sh [--board m3|m4|m7|m33] --stage STAGE --asset FILE
#   run.sh [--board m3|m4|m7|m33] --draw OUT.png [--asset FILE]
#   run.sh [--board m3|m4|m7|m33] --log
#
# The board is a Cortex-M7 unless another is named: M3 without floating point (mps2-an385), M4F
# (mps2-an386), M7 (mps2-an500), M33 (mps2-an505).
# Cases are those of tests/cases.rs, as STAGE.NAME; without any, all. --check compares with
# tests/budgets.toml, and the output's hash with this machine's; --update commits the numbers. --count
# compares `cost` with the operations that an M7 executes (tests/python/count_operations.py). With
# --asset, a file of your own. --draw lets the firmware draw a frame into a framebuffer and write it down; the
# asset is the bundled body unless another is named. --micromath prints instructions with the core's
# approximate arithmetic. --log compares the decoded log of a firmware with
# log.out. SINEW_TOOLCHAIN: see examples/toolchain.sh.
#
# Exit status: 0 done, 1 something is wrong, 2 usage, 77 skipped for want of a program.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
board=m7 stage=skin asset= picture= mode= wanted=()
usage() {
    sed -n '2,23s/^# \{0,1\}//p' "$0" >&2
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
        --check | --update | --count | --log | --micromath) mode=$1 ;;
        -*) usage ;;
        *) wanted+=("$1") ;;
    esac
    shift
done

target=thumbv7em-none-eabihf
case $board in
    m3) cpu=cortex-m3 machine=mps2-an385 target=thumbv7m-none-eabi ;;
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

# features STAGE: what the firmware of a stage is built with.
features() {
    local list=
    case $1 in laplacian | modes | parts) list=$1 ;; actor) list=parts ;; esac
    [ "$mode" != --micromath ] || list=$list,micromath
    echo "--features=$list"
}

# measure CASE FILE HASH: the case is STAGE.NAME; the hash of its output, or - where unknown.
measure() {
    if [ "$mode" = --count ]; then
        (cd "$here" && SINEW_STAGE=${1%%.*} SINEW_ASSET=$2 "${build[@]}" \
            "$(features "${1%%.*}")" --target-dir "$here/target/$board" --bin counted) &&
            python3 "$root/tests/python/count_operations.py" "$firmware/counted" --name "$1"
        return
    fi
    # The second firmware links only while no code in it can panic.
    (cd "$here" && SINEW_STAGE=${1%%.*} SINEW_ASSET=$2 "${build[@]}" \
        "$(features "${1%%.*}")" --target-dir "$here/target/$board" --bin stage --bin frame_only) || {
        echo "$1 does not build; a_panic_path_is_linked means: it can panic" >&2
        return 1
    }
    if [ "$mode" = --micromath ]; then
        emulate "$firmware/stage" | sed -n "s/^icount_\(.*\)/$1 with micromath: \1/p"
        return
    fi
    emulate "$firmware/stage" > "$here/target/report.toml" || { cat "$here/target/report.toml" >&2; return 1; }
    (cd "$root" && RUSTFLAGS= cargo run --release --quiet -p sinew-tests --example budgets -- "$board" "$1" "$3" \
        "$here/target/report.toml" "$firmware/frame_only" $mode)
}

if [ "$mode" = --log ]; then
    (cd "$here" && SINEW_ASSET=$root/tests/golden/arm.sinew DEFMT_LOG=info "${build[@]}" --features log \
        --target-dir "$here/target/$board" --bin log)
    emulate "$firmware/log" > "$here/target/log.raw"
    (cd "$root/examples/decode" && RUSTFLAGS= cargo run --release --locked --quiet -- "$firmware/log") \
        < "$here/target/log.raw" | diff "$here/log.out" - && echo "the log is as in log.out"
    exit
fi
if [ -n "$picture" ]; then
    [ -n "$asset" ] || { asset=$here/target/human.sinew && RUSTFLAGS= bundled "$asset"; }
    (cd "$here" && SINEW_PICTURE=$picture SINEW_ASSET=$asset "${build[@]}" \
        --features laplacian,modes,parts --target-dir "$here/target/$board" --bin draw)
    emulate "$firmware/draw"
    echo "$picture"
    exit
fi
if [ -n "$asset" ]; then
    measure "$stage.$(basename "$asset" .sinew)" "$asset" -
    exit
fi
cases=$here/target/cases
mkdir -p "$cases"
(cd "$root" && RUSTFLAGS= cargo run --release --quiet -p sinew-tests --example cases -- "$cases" \
    "${wanted[@]}") > "$here/target/cases.txt"
failed=0
while read -r case file hash; do
    measure "$case" "$file" "$hash" || failed=1
done < "$here/target/cases.txt"
exit $failed
