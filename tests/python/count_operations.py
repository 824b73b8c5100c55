#!/usr/bin/env python3
"""Counts the floating-point operations that a frame really executes, and compares them with `cost`.

Run from the project's root: `python3 tests/python/count_operations.py ELF [--slack 0.15]`, where ELF
is the firmware `counted` that `examples/cortex-m/run.sh --count` builds. QEMU logs every block of
instructions that the emulated Cortex-M executes; multiplications and divisions between the marks of
a frame are added up, for each kind of frame for which the stage states a bound. `cost` must never
be below them; above the costliest kind that it covers, at most so much.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import threading
from collections import Counter

EMULATOR = [
    "qemu-system-arm", "-cpu", "cortex-m7", "-machine", "mps2-an500", "-nographic",
    "-icount", "shift=0", "-semihosting-config", "enable=on,target=native",
    "-d", "in_asm,exec,nochain",
]  # fmt: skip
INSTRUCTION = re.compile(r"^0x([0-9a-f]+):\s+(?:[0-9a-f]{4} ?)+\s+(\S+)")
EXECUTED = re.compile(r"^Trace \d+: (\S+) \[\w+/([0-9a-f]+)/")
MULTIPLY = ("vmul", "vnmul", "vmla", "vmls", "vnmla", "vnmls", "vfma", "vfms", "vfnma", "vfnms")
KINDS = {"mul_adds": MULTIPLY, "divisions": ("vdiv",), "adds": ("vadd", "vsub"), "roots": ("vsqrt",)}


def kinds_of(mnemonic):
    operation = mnemonic.split(".")[0]
    return [kind for kind, names in KINDS.items() if operation in names]


def frames(lines):
    """Yields a counter for each marked frame.

    A block is known by where its translation lies: the emulator translates a shorter one from the
    same address where its time slice ends, and says so where it stopped before a block.
    """
    fresh, blocks, inside, block, counts, start, last = {}, {}, False, None, None, None, None
    for line in lines:
        if line.startswith("Trace"):
            found = EXECUTED.match(line)
            if not found:
                continue
            place, start = found[1], int(found[2], 16)
            if start in fresh:
                blocks[place] = fresh.pop(start)
            name = line.rstrip().rsplit("] ", 1)[-1]
            last = None
            if name == "frame_begins":
                inside, counts = True, Counter()
            elif name == "frame_ends" and inside:
                inside = False
                yield counts
            elif inside:
                last = blocks.get(place, {})
                counts.update(last)
        elif line.startswith("Stopped execution") and last is not None:
            counts.subtract(last)
            last = None
        elif line.startswith("IN:"):
            block = Counter()
            start = None
        elif block is not None and (found := INSTRUCTION.match(line)):
            if start is None:
                start = int(found[1], 16)
                fresh[start] = block
            block["instructions"] += 1
            block.update(kinds_of(found[2]))


def run(elf):
    """The counters of all marked frames, and the bounds that the firmware printed."""
    with tempfile.TemporaryDirectory() as folder:
        pipe = os.path.join(folder, "log")
        os.mkfifo(pipe)
        emulator = subprocess.Popen(
            [*EMULATOR, "-D", pipe, "-kernel", elf],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
        )
        printed = []
        reader = threading.Thread(target=lambda: printed.extend(emulator.stdout))
        reader.start()
        with open(pipe, encoding="latin-1") as log:
            found = list(frames(log))
        reader.join()
        if emulator.wait() != 0:
            sys.exit(f"{elf}: the firmware failed")
    lines = dict(line.strip().split(" = ") for line in printed if " = " in line)
    names = [lines[f"frame_{at}"] for at in range(1, len(found) + 1)]
    bounds = {name: int(value) for name, value in lines.items() if name.startswith("bound_")}
    return list(zip(names, found)), bounds


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("elf")
    arguments.add_argument("--slack", type=float, default=0.15)
    arguments.add_argument("--name", default="frame")
    given = arguments.parse_args()
    found, bounds = run(given.elf)
    most, failed = {}, False
    for name, frame in found:
        for kind in ("mul_adds", "divisions"):
            if f"bound_{name}_{kind}" in bounds:
                most[name, kind] = max(most.get((name, kind), 0), frame[kind])
    if not most:
        sys.exit(f"{given.elf}: no marked frame, or no bound")
    for (name, kind), executed in most.items():
        bound = bounds[f"bound_{name}_{kind}"]
        # Kinds of frames that share a bound: the costliest shows how tight that is.
        peers = [other for (peer, of), other in most.items()
                 if of == kind and bounds[f"bound_{peer}_{kind}"] == bound]  # fmt: skip
        above = bound / executed - 1 if executed else float(bound > 0)
        loose = kind == "mul_adds" and bound > (1 + given.slack) * max(peers)
        fault = "BELOW" if executed > bound else "LOOSE" if loose else ""
        failed |= bool(fault)
        print(f"{given.name:<24} {name:<18} {kind:<10} {executed:>9} executed, {bound:>9} bound"
              f" ({above:+.1%}) {fault}")  # fmt: skip
    sys.exit(failed)


if __name__ == "__main__":
    main()
