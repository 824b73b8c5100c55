"""Checks .glb files with pygltflib and numpy, independently of sinew.

    python3 tests/python/check_glb.py FILE.glb ...

Checks what readers rely on: container lengths, alignment, accessor ranges, stated bounds,
indices, weights, joints, unit normals and rotations, key times. Exit status 1 on the first file
that fails.
"""

import struct
import sys

import numpy as np
import pygltflib

TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def check_container(path):
    data = open(path, "rb").read()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data)), "header"
    at, kinds = 12, []
    while at < length:
        size, kind = struct.unpack_from("<I4s", data, at)
        assert size % 4 == 0, "chunk alignment"
        kinds.append(kind)
        at += 8 + size
    assert at == length and kinds in ([b"JSON"], [b"JSON", b"BIN\0"]), "chunks"


def read(gltf, index):
    accessor = gltf.accessors[index]
    view = gltf.bufferViews[accessor.bufferView]
    kind = np.dtype(TYPES[accessor.componentType])
    width = WIDTHS[accessor.type]
    assert view.byteOffset % 4 == 0 and view.byteStride is None, "alignment"
    assert accessor.count * width * kind.itemsize == view.byteLength, "view length"
    end = view.byteOffset + view.byteLength
    assert end <= gltf.buffers[0].byteLength <= len(gltf.binary_blob()), "buffer length"
    data = gltf.binary_blob()[view.byteOffset:end]
    values = np.frombuffer(data, kind).reshape(accessor.count, width)
    assert np.isfinite(values).all(), "finite"
    if accessor.min:
        assert np.array_equal(values.min(axis=0), np.float32(accessor.min)), "min"
        assert np.array_equal(values.max(axis=0), np.float32(accessor.max)), "max"
    return values


def unit(vectors):
    return np.abs(np.linalg.norm(vectors, axis=1) - 1).max() < 1e-5


def check_mesh(gltf, mesh, skin):
    primitive = mesh.primitives[0]
    attributes = primitive.attributes
    positions = read(gltf, attributes.POSITION)
    assert gltf.accessors[attributes.POSITION].min, "bounds of positions"
    indices = read(gltf, primitive.indices)
    assert len(indices) % 3 == 0 and indices.max() < len(positions), "indices"
    if attributes.NORMAL is not None:
        normals = read(gltf, attributes.NORMAL)
        assert len(normals) == len(positions) and unit(normals), "normals"
    total = np.zeros(len(positions))
    sets = 0
    while getattr(attributes, f"WEIGHTS_{sets}", None) is not None:
        weights = read(gltf, getattr(attributes, f"WEIGHTS_{sets}")).astype(float)
        joints = read(gltf, getattr(attributes, f"JOINTS_{sets}"))
        assert len(weights) == len(joints) == len(positions), "influences"
        assert joints.max() < len(gltf.skins[skin].joints), "joint indices"
        assert (joints[weights == 0] == 0).all(), "joints without weight"
        assert (weights >= 0).all(), "negative weights"
        total += weights.sum(axis=1)
        sets += 1
    if skin is not None:
        assert sets > 0 and np.abs(total - 1).max() < 1e-6, "weights sum to one"
    targets = primitive.targets or []
    for target in targets:
        for accessor in target.values():
            assert len(read(gltf, accessor)) == len(positions), "morph targets"
    assert len(mesh.weights or []) == len(targets), "morph weights"
    return len(positions), len(indices) // 3, sets, len(targets)


def check_animation(gltf, animation):
    taken = set()
    for channel in animation.channels:
        target = (channel.target.node, channel.target.path)
        assert target not in taken, "two channels with one target"
        taken.add(target)
        sampler = animation.samplers[channel.sampler]
        times = read(gltf, sampler.input)[:, 0]
        assert gltf.accessors[sampler.input].min, "bounds of key times"
        assert times[0] >= 0 and (np.diff(times) > 0).all(), "key times"
        values = read(gltf, sampler.output)
        per_key = 3 if sampler.interpolation == "CUBICSPLINE" else 1
        if target[1] == "weights":
            per_key *= len(gltf.meshes[0].weights)
        assert len(values) == len(times) * per_key, "key values"
        if target[1] == "rotation" and per_key == 1:
            assert unit(values), "unit rotations"


def check(path):
    check_container(path)
    gltf = pygltflib.GLTF2().load(path)
    assert gltf.asset.generator == "sinew" and gltf.asset.version == "2.0", "asset"
    counts = (0, 0, 0, 0)
    for node in gltf.nodes:
        if node.mesh is not None:
            counts = check_mesh(gltf, gltf.meshes[node.mesh], node.skin)
    for skin in gltf.skins:
        assert len(set(skin.joints)) == len(skin.joints), "joints are unique"
        matrices = read(gltf, skin.inverseBindMatrices)
        assert len(matrices) == len(skin.joints), "inverse bind matrices"
        assert (matrices[:, [3, 7, 11, 15]] == [0, 0, 0, 1]).all(), "last rows"
    for animation in gltf.animations:
        check_animation(gltf, animation)
    names = "vertices", "triangles", "influence sets", "morph targets"
    about = ", ".join(f"{count} {name}" for count, name in zip(counts, names))
    print(f"{path}: {about}, {len(gltf.nodes)} nodes, {len(gltf.animations)} animations")


def main():
    for path in sys.argv[1:]:
        try:
            check(path)
        except AssertionError as error:
            sys.exit(f"{path}: {error}")


if __name__ == "__main__":
    main()
