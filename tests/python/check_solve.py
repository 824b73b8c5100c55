#!/usr/bin/env python3
"""Solves a recording and compares how independent readers from PyPI read the BVH that is written.

Run from the project's root: `python3 tests/python/check_solve.py [TAKE]` (needs numpy, pybvh, bvhio;
without a take, ../shared/data/c3d/cmu_02_05.c3d). Every order of rotation channels is written;
pybvh and bvhio must agree with the equations of the format to 1e-6 of the body's height.
"""

import itertools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from check_bvh import by_bvhio, by_equations, by_pybvh, worst

TOLERANCE = 1e-6
DEFAULT = Path("../shared/data/c3d/cmu_02_05.c3d")


def main():
    take = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    if not take.exists():
        print(f"SKIPPED: needs {take}, which is not here")
        return 0
    good, first = True, None
    with tempfile.TemporaryDirectory() as folder:
        for order in map("".join, itertools.permutations("XYZ")):
            path = Path(folder) / f"{order}.bvh"
            command = ["cargo", "run", "-q", "--", "-q", "solve", str(take), "--output", str(path)]
            subprocess.run([*command, "--order", order], check=True)
            ours = by_equations(path, False)
            first = ours if first is None else first
            pose = ours[0]
            height = np.linalg.norm(pose[:, None] - pose[None], axis=2).max()
            frames = np.unique(np.linspace(0, len(ours) - 1, 40).astype(int))
            errors = {
                "pybvh": worst(ours, by_pybvh(path), height),
                "bvhio": worst(ours[frames], by_bvhio(path, frames), height),
                "first order": worst(ours, first, height),
            }
            fits = all(error <= TOLERANCE for error in errors.values())
            good &= fits
            shown = ", ".join(f"{name} {error:.1e}" for name, error in errors.items())
            print(f"{'ok  ' if fits else 'FAIL'} {order}: {len(ours)} frames, {shown}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
