"""Compares the C3D reader and writer with the PyPI packages ezc3d and c3d.

Run from the project's root:

    SINEW_DUMP_DIR=out/c3d cargo test -p sinew-tests --test import_markers dump_for_other_readers
    python3 tests/python/check_c3d.py out/c3d

For every recording in ../shared/data: our points against what each package reads from the same
file, in units in the last place of a 32-bit coordinate; then the file that we wrote from it, read
by each package, against our points as 32-bit numbers, where the difference must be 0. A third
reader of 30 lines takes everything from the header: it covers the files that both packages refuse.
Exit status 1 if anything disagrees that is not listed in KNOWN, with the evidence given there.
"""

import json
import sys
import warnings
from pathlib import Path

import c3d
import ezc3d
import numpy as np

DATA = Path(__file__).resolve().parents[2] / ".." / "shared" / "data"

# Disagreements in which the other reader is wrong or refuses, and why.
KNOWN = {
    ("ezc3d", "sample20_phasespace"): "has no POINT group; ezc3d then reports 0 points",
}


def read_ezc3d(path):
    """Points [frames, points, 3] in source units, NaN where missing, and labels."""
    # Its ignore_bad_formatting crashes Python on sample18, so that refusals stay refusals.
    content = ezc3d.c3d(str(path))
    points = content["data"]["points"][:3].transpose(2, 1, 0)
    labels = []
    number = 1
    while True:
        name = "LABELS" + ("" if number == 1 else str(number))
        if name not in content["parameters"]["POINT"]:
            break
        labels += content["parameters"]["POINT"][name]["value"]
        number += 1
    return points, labels


def read_py_c3d(path):
    """The same with the package c3d."""
    with open(path, "rb") as file:
        reader = c3d.Reader(file)
        frames = [points for _, points, _ in reader.read_frames()]
        has_labels = reader.get("POINT:LABELS") is not None
        labels = [label.strip() for label in reader.point_labels] if has_labels else []
    if not frames:
        return np.zeros((0, 0, 3)), labels
    points = np.array(frames, dtype=np.float64)
    points[points[:, :, 3] < 0, :3] = np.nan
    return points[:, :, :3], labels


def read_by_header(path):
    """The same from the header alone, which is right in all these files: no parameter is read."""
    data = Path(path).read_bytes()
    order = {84: "<", 85: "<", 86: ">"}[data[(data[0] - 1) * 512 + 3]]
    is_dec = data[(data[0] - 1) * 512 + 3] == 85

    def reals(values):
        if not is_dec:
            return values.view(order + "f4").astype(np.float64)
        words = values.view("<u2").reshape(-1, 2)[:, ::-1]
        return np.ascontiguousarray(words).view("<f4").ravel().astype(np.float64) / 4

    points, analog, first, last = np.frombuffer(data, order + "u2", 4, 2)
    start = (int(np.frombuffer(data, order + "u2", 1, 16)[0]) - 1) * 512
    scale = reals(np.frombuffer(data, np.uint8, 4, 12))[0]
    words, frames = int(points) * 4 + int(analog), int(last) - int(first) + 1
    size = 4 if scale < 0 else 2
    content = np.frombuffer(data, np.uint8, frames * words * size, start)
    if scale < 0:
        table = reals(content)
    else:
        table = content.view(order + "i2").astype(np.float64)
    table = table.reshape(frames, words)[:, : int(points) * 4].reshape(frames, int(points), 4).copy()
    if scale > 0:
        table[:, :, :3] *= scale
    table[table[:, :, 3] < 0, :3] = np.nan
    return table[:, :, :3], []


def ulps(ours, theirs):
    """Largest difference in units in the last place of a 32-bit number, or what is wrong."""
    if theirs.shape[1:] != ours.shape[1:] or theirs.shape[0] > ours.shape[0]:
        return f"shape {theirs.shape}, ours {ours.shape}"
    # ezc3d leaves out frames at the end in which nothing is seen.
    if np.isfinite(ours[theirs.shape[0] :]).any():
        return f"{theirs.shape[0]} frames, ours {ours.shape[0]}"
    ours = ours[: theirs.shape[0]]
    missing = np.isnan(ours).any(axis=2)
    if (missing != np.isnan(theirs).any(axis=2)).any():
        return f"{missing.sum()} missing, theirs {np.isnan(theirs).any(axis=2).sum()}"
    seen = ~missing
    if not seen.any():
        return 0.0
    place = np.spacing(np.abs(ours[seen]).astype(np.float32)).astype(np.float64)
    return float((np.abs(ours[seen] - theirs[seen]) / place).max())


def verdict(reader, name, ours, path, limit, labels=None):
    """One line, and whether the two agree.

    A reader may refuse a recording, but not what we wrote (where `labels` are given).
    """
    try:
        theirs, their_labels = reader(path)
    except BaseException as error:  # ezc3d raises more than Exception
        return f"refuses ({str(error)[:60]})", labels is None
    result = ulps(ours, theirs)
    if isinstance(result, str):
        known = next((why for (who, part), why in KNOWN.items() if who in reader.__name__ and part in name), None)
        return f"{result}" + (f" [known: {known}]" if known else ""), known is not None
    # The package c3d does not know LABELS2.
    known = 255 if reader is read_py_c3d else len(labels or [])
    if labels is not None and their_labels[:known] != labels[:known]:
        return "labels differ", False
    return f"{result:.3g} ulp", result <= limit


def main(folder):
    """Prints one line a recording; gives the number of disagreements."""
    warnings.simplefilter("ignore")
    bad = 0
    for facts_path in sorted(Path(folder).glob("*.json")):
        facts = json.loads(facts_path.read_text())
        labels = facts["labels"]
        values = np.fromfile(facts_path.with_suffix(".f64"), "<f8")
        ours = values.reshape(facts["frames"], len(labels), 3)
        rounded = ours.astype(np.float32).astype(np.float64)
        written = facts_path.with_suffix(".c3d")
        checks = [("written/ezc3d", read_ezc3d, rounded, written, 0.0, labels),
                  ("written/c3d", read_py_c3d, rounded, written, 0.0, labels)]
        if facts["source"]:
            source = DATA / facts["source"]
            checks = [("ezc3d", read_ezc3d, ours, source, 1.0, None),
                      ("c3d", read_py_c3d, ours, source, 1.0, None),
                      ("header alone", read_by_header, ours, source, 0.0, None)] + checks
        for what, reader, points, path, limit, wanted in checks:
            text, good = verdict(reader, facts_path.stem, points, path, limit, wanted)
            bad += not good
            print(f"{'ok ' if good else 'BAD'} {facts_path.stem:55} {what:14} {text}")
    print(f"{bad} disagreements")
    return bad


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(1 if main(sys.argv[1]) else 0)
