#!/usr/bin/env python3
"""Compares the BVH reader's joint positions with two independent readers from PyPI.

Run from the project's root: `python3 tests/python/check_bvh.py` (needs numpy, pybvh, bvhio, and the
recordings in ../shared/data/bvh). It lets `cargo test` dump the world position of every joint in
every frame, and demands of each file that pybvh or bvhio agrees to 1e-4 of the skeleton's height.

Where neither can (`EXPLAINED`), the reason is stated and checked against the equations themselves,
written out below in NumPy, and against what the other reader does wrong.
"""

import json
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import bvhio
import numpy as np
import pybvh

TOLERANCE = 1e-4

EXPLAINED = {
    "mh_benchmark_pose.bvh": (
        "MakeHuman adds position channels to the OFFSET; 133 joints below the root have channels "
        "that stay at zero. bvhio replaces the OFFSET, which collapses those joints onto their "
        "parents; pybvh refuses position channels below the root."
    ),
}


def dump(folder):
    """Lets the Rust side write its positions; returns [(stem, description, positions)]."""
    command = ["cargo", "test", "-q", "-p", "sinew-tests", "--test", "import_text"]
    environment = {**os.environ, "SINEW_DUMP_DIR": folder}
    subprocess.run(
        [*command, "dump_joint_positions"], env=environment, check=True, stdout=subprocess.DEVNULL
    )
    for path in sorted(Path(folder).glob("*.json")):
        described = json.loads(path.read_text())
        values = np.fromfile(path.with_suffix(".f64"), dtype="<f8")
        shape = (described["frames"], len(described["joints"]), 3)
        yield path.stem, described, values.reshape(shape)


def by_pybvh(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        motion = pybvh.read_bvh_file(path)
        nodes = motion.node_positions()
    return nodes[:, [i for i, node in enumerate(motion.nodes) if not node.is_end_site()]]


def by_bvhio(path, frames):
    """World positions in the listed frames only: it is slow."""
    root = bvhio.readAsHierarchy(str(path))
    positions = []
    for frame in frames:
        root.loadPose(int(frame), recursive=True)
        positions.append([joint.PositionWorld.to_tuple() for joint, _, _ in root.layout()])
    return np.array(positions)


def by_equations(path, positions_add):
    """The plain reading of the format: T = OFFSET, or the position channels, or both; R = product
    of the channels' rotations in their order; world = parent * T * R."""
    words = path.read_text().split()
    offsets, parents, channels, stack, at = [], [], [], [], 0
    while words[at] != "MOTION":
        if words[at] in ("ROOT", "JOINT"):
            parents.append(stack[-1] if stack else None)
            offsets.append(None)
            channels.append([])
            opened = len(parents) - 1
        elif words[at] == "End":
            opened = None
        elif words[at] == "{":
            stack.append(opened)
        elif words[at] == "}":
            stack.pop()
        elif words[at] == "OFFSET" and stack[-1] is not None:
            offsets[stack[-1]] = np.array(words[at + 1 : at + 4], dtype=float)
        elif words[at] == "CHANNELS":
            channels[stack[-1]] = words[at + 2 : at + 2 + int(words[at + 1])]
        at += 1
    at = words.index("Time:", at) + 2
    rows = np.array(words[at:], dtype=float).reshape(-1, sum(map(len, channels)))
    count = len(rows)
    world, turns, column = [], [], 0
    for parent, offset, names in zip(parents, offsets, channels):
        translation = np.tile(offset, (count, 1))
        turn = np.tile(np.eye(3), (count, 1, 1))
        for name in names:
            value, axis = rows[:, column], "XYZ".index(name[0])
            column += 1
            if name.endswith("position"):
                translation[:, axis] = value + (offset[axis] if positions_add else 0)
                continue
            cosine, sine = np.cos(np.radians(value)), np.sin(np.radians(value))
            step = np.tile(np.eye(3), (count, 1, 1))
            a, b = (axis + 1) % 3, (axis + 2) % 3
            step[:, a, a], step[:, a, b], step[:, b, a], step[:, b, b] = cosine, -sine, sine, cosine
            turn = turn @ step
        if parent is not None:
            translation = world[parent] + np.einsum("fij,fj->fi", turns[parent], translation)
            turn = turns[parent] @ turn
        world.append(translation)
        turns.append(turn)
    return np.stack(world, axis=1)


def worst(ours, theirs, height):
    return np.linalg.norm(ours - theirs, axis=2).max() / height


def check(described, ours):
    path = Path(described["source"])
    # The size of the posed body: the largest distance between two joints of the first frame.
    first = ours[0]
    height = np.linalg.norm(first[:, None] - first[None], axis=2).max()
    frames = np.unique(np.linspace(0, len(ours) - 1, 60).astype(int))
    results = {}
    try:
        results["pybvh"] = worst(ours, by_pybvh(path), height)
    except ValueError as error:
        print(f"    pybvh refuses: {str(error).splitlines()[0][-90:]}")
    results["bvhio"] = worst(ours[frames], by_bvhio(path, frames), height)
    explained = EXPLAINED.get(path.name)
    results["equations"] = worst(ours, by_equations(path, explained is not None), height)
    agreeing = [name for name in ("pybvh", "bvhio") if results.get(name, 1) <= TOLERANCE]
    good = results["equations"] <= 1e-9 and bool(agreeing) != (explained is not None)
    if explained:
        replaced = by_equations(path, False)[frames]
        good &= worst(replaced, by_bvhio(path, frames), height) <= TOLERANCE
        print(f"    explained: {explained}")
    shown = ", ".join(f"{name} {value:.1e}" for name, value in results.items())
    print(f"{'ok  ' if good else 'FAIL'} {path.name}: {ours.shape[0]} frames, {shown}")
    return good


def main():
    with tempfile.TemporaryDirectory() as folder:
        results = [check(described, ours) for _, described, ours in dump(folder)]
    if not results:
        print("SKIPPED: needs the recordings in ../shared/data/bvh")
        return 0
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
