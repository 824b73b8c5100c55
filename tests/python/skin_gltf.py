"""Skins a glTF file at a given time, independently of sinew.

    python3 tests/python/skin_gltf.py FILE.gltf TIME [VERTEX ...]

Prints the sum of all skinned positions and the given vertices. Numbers come from pygltflib and
numpy, the equations from the glTF 2.0 specification. Reads what the sample models need: one
skinned mesh, LINEAR keys, data URIs.
"""

import base64
import sys

import numpy as np
import pygltflib

TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read(gltf, index):
    """Accessor `index` as [count, width], tightly packed or strided."""
    accessor = gltf.accessors[index]
    view = gltf.bufferViews[accessor.bufferView]
    uri = gltf.buffers[view.buffer].uri
    data = base64.b64decode(uri.split(",", 1)[1]) if uri else gltf.binary_blob()
    kind = np.dtype(TYPES[accessor.componentType])
    width = WIDTHS[accessor.type]
    start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    stride = view.byteStride or width * kind.itemsize
    strides = (stride, kind.itemsize)
    raw = np.ndarray((accessor.count, width), kind, data, start, strides)
    return raw.astype(np.float64)


def rotation_matrix(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def slerp(a, b, u):
    dot = np.dot(a, b)
    if dot < 0:
        b, dot = -b, -dot
    angle = np.arccos(min(dot, 1.0))
    if angle < 1e-9:
        return a + (b - a) * u
    return (np.sin((1 - u) * angle) * a + np.sin(u * angle) * b) / np.sin(angle)


def sample(gltf, sampler, path, time):
    assert (sampler.interpolation or "LINEAR") == "LINEAR"
    times, values = read(gltf, sampler.input)[:, 0], read(gltf, sampler.output)
    time = np.clip(time, times[0], times[-1])
    key = min(np.searchsorted(times, time, "right") - 1, len(times) - 2)
    u = (time - times[key]) / (times[key + 1] - times[key])
    if path == "rotation":
        return slerp(values[key], values[key + 1], u)
    return values[key] * (1 - u) + values[key + 1] * u


def skin(gltf, time):
    """Skinned positions [vertices, 3] of the first node with a skin."""
    parts = []
    for node in gltf.nodes:
        parts.append({
            "translation": np.array(node.translation or [0, 0, 0], float),
            "rotation": np.array(node.rotation or [0, 0, 0, 1], float),
            "scale": np.array(node.scale or [1, 1, 1], float),
        })
    animated = set()
    for channel in gltf.animations[0].channels if gltf.animations else []:
        target = channel.target
        sampler = gltf.animations[0].samplers[channel.sampler]
        parts[target.node][target.path] = sample(gltf, sampler, target.path, time)
        animated.add(target.node)

    local = []
    for i, (node, part) in enumerate(zip(gltf.nodes, parts)):
        matrix = np.eye(4)
        if node.matrix and i not in animated:
            matrix = np.array(node.matrix, float).reshape(4, 4).T
        else:
            matrix[:3, :3] = rotation_matrix(part["rotation"]) * part["scale"]
            matrix[:3, 3] = part["translation"]
        local.append(matrix)
    parent = {child: i for i, node in enumerate(gltf.nodes) for child in node.children or []}

    def model(i):
        return model(parent[i]) @ local[i] if i in parent else local[i]

    node = next(node for node in gltf.nodes if node.skin is not None)
    skin = gltf.skins[node.skin]
    inverse = read(gltf, skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    palette = np.array([model(joint) @ inverse[i] for i, joint in enumerate(skin.joints)])
    attributes = gltf.meshes[node.mesh].primitives[0].attributes
    position = read(gltf, attributes.POSITION)
    joints = read(gltf, attributes.JOINTS_0).astype(int)
    weights = read(gltf, attributes.WEIGHTS_0)
    weights /= weights.sum(axis=1, keepdims=True)
    blended = np.einsum("vk,vkij->vij", weights, palette[joints])
    return np.einsum("vij,vj->vi", blended[:, :3, :3], position) + blended[:, :3, 3]


def main():
    gltf = pygltflib.GLTF2().load(sys.argv[1])
    positions = skin(gltf, float(sys.argv[2]))
    print("vertices", len(positions))
    print("sum", *positions.sum(axis=0))
    for vertex in map(int, sys.argv[3:]):
        print(vertex, *positions[vertex])


if __name__ == "__main__":
    main()
