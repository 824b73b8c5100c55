"""Plays a bundled BVH clip on the bundled body with nothing but NumPy, and compares.

An independent float64 computation of what `sinew play` does: read the GLB and the BVH, retarget as
documented in host/src/fit/retarget.rs, skin linearly. It shares no code with sinew and writes the
joint correspondence out by hand.

    python3 tests/python/play_oracle.py --npy out.npy             # exit 1 above --tolerance
    python3 tests/python/play_oracle.py --motion examples/data/kneel.bvh --write oracle.npy

The array is float32 [frames, vertices, 3], metres, in the GLB's vertex order.
"""

import argparse
import json
import struct
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "examples/data"

# The bundled body names its joints as CMU does. Per clip family: the source joint of each limb
# joint, the spine from above the hips to the thorax, the neck from above the thorax to the head.
BODY_SPINE = ["LowerBack", "Spine", "Spine1"]
BODY_NECK = ["Neck", "Neck1", "Head"]
LIMBS = {
    "Shoulder": "Collar",
    "Arm": "Shoulder",
    "ForeArm": "Elbow",
    "Hand": "Wrist",
    "UpLeg": "Hip",
    "Leg": "Knee",
    "Foot": "Ankle",
}
# Limb joints that swing onto the source's bone, and the joint at the bone's other end.
SWING = {"Arm": "ForeArm", "ForeArm": "Hand", "UpLeg": "Leg", "Leg": "Foot"}


def read_glb(path):
    """Positions, normals-free skin and skeleton of a GLB with one skinned mesh."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + size])
    blob = data[28 + size :]
    kinds = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
    widths = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}

    def read(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        kind, width = kinds[accessor["componentType"]], widths[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = np.frombuffer(blob, kind, accessor["count"] * width, start)
        return flat.reshape(accessor["count"], width).astype(np.float64)

    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    skin = document["skins"][0]
    parent = {c: k for k, node in enumerate(document["nodes"]) for c in node.get("children", [])}
    order = {node: k for k, node in enumerate(skin["joints"])}
    weights = np.hstack([read(attributes[f"WEIGHTS_{k}"]) for k in (0, 1)])
    return {
        "positions": read(attributes["POSITION"]),
        "joints": np.hstack([read(attributes[f"JOINTS_{k}"]) for k in (0, 1)]).astype(int),
        "weights": weights / weights.sum(1, keepdims=True),
        "names": [document["nodes"][k]["name"] for k in skin["joints"]],
        "parents": [order.get(parent.get(k), -1) for k in skin["joints"]],
        "offsets": np.array([document["nodes"][k]["translation"] for k in skin["joints"]]),
        "inverse_bind": read(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1),
    }


def axis_rotation(axis, angle):
    """Rotation matrices `[frames, 3, 3]` about x, y or z."""
    cos, sin = np.cos(angle), np.sin(angle)
    k = "XYZ".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    out = np.zeros(angle.shape + (3, 3))
    out[..., k, k] = 1
    out[..., i, i] = out[..., j, j] = cos
    out[..., i, j], out[..., j, i] = -sin, sin
    return out


def read_bvh(path):
    """Skeleton and model-space motion: rotations `[frames, joints, 3, 3]` and positions."""
    words = iter(path.read_text().split())
    names, parents, offsets, channels, ends, stack = [], [], [], [], {}, []
    for word in words:
        if word in ("ROOT", "JOINT"):
            names.append(next(words))
            parents.append(stack[-1] if stack else -1)
            offsets.append(None)
            channels.append([])
            opened = len(names) - 1
        elif word == "End":
            next(words)
            opened = ~stack[-1]  # an end site of joint stack[-1]
        elif word == "{":
            stack.append(opened)
        elif word == "}":
            stack.pop()
        elif word == "OFFSET":
            value = np.array([float(next(words)) for _ in range(3)])
            if stack[-1] < 0:
                ends[~stack[-1]] = value
            else:
                offsets[stack[-1]] = value
        elif word == "CHANNELS":
            channels[stack[-1]] = [next(words) for _ in range(int(next(words)))]
        elif word == "MOTION":
            break
    next(words), next(words), next(words), next(words), next(words)  # Frames: N Frame Time: T
    width = sum(len(c) for c in channels)
    values = np.array([float(word) for word in words])
    values = values[: len(values) // width * width].reshape(-1, width)
    rotations = np.empty((len(values), len(names), 3, 3))
    positions = np.empty((len(values), len(names), 3))
    column = 0
    for k, names_of_channels in enumerate(channels):
        local = np.broadcast_to(np.eye(3), (len(values), 3, 3))
        offset = np.tile(offsets[k], (len(values), 1))
        for channel in names_of_channels:
            if channel.endswith("rotation"):
                local = local @ axis_rotation(channel[0], np.radians(values[:, column]))
            else:
                offset[:, "XYZ".index(channel[0])] = values[:, column]
            column += 1
        if parents[k] < 0:
            rotations[:, k], positions[:, k] = local, offset
        else:
            up = rotations[:, parents[k]]
            rotations[:, k] = up @ local
            positions[:, k] = positions[:, parents[k]] + (up @ offset[:, :, None])[:, :, 0]
    return {
        "names": names,
        "parents": parents,
        "offsets": np.array(offsets),
        "ends": ends,
        "rotations": rotations,
        "positions": positions,
    }


def rest_positions(skeleton):
    """Model-space joint positions when every rotation is the identity."""
    out = np.zeros((len(skeleton["names"]), 3))
    for k, parent in enumerate(skeleton["parents"]):
        out[k] = skeleton["offsets"][k] + (out[parent] if parent >= 0 else 0)
    return out


def swing(a, b):
    """The smallest rotation that takes direction `a` to direction `b`."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    v, c = np.cross(a, b), a @ b
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + c)


def between(a, b, fraction):
    """Rotations `fraction` of the way from `a` to `b`, `[frames, 3, 3]`, about one axis each."""
    turn = np.swapaxes(a, -1, -2) @ b
    vector = np.stack([turn[:, (k + 2) % 3, (k + 1) % 3] - turn[:, (k + 1) % 3, (k + 2) % 3] for k in range(3)], 1)
    sin = np.linalg.norm(vector, axis=1) / 2
    angle = np.arctan2(sin, (np.trace(turn, axis1=1, axis2=2) - 1) / 2) * fraction
    axis = vector / np.maximum(np.linalg.norm(vector, axis=1), 1e-300)[:, None]
    cross = np.zeros_like(turn)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        cross[:, j, i], cross[:, i, j] = axis[:, k], -axis[:, k]
    sin, cos = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return a @ (np.eye(3) + sin * cross + (1 - cos) * (cross @ cross))


def facing(points, index, hip, arm):
    """Horizontal direction the body looks in, from its left and right hips and shoulders."""
    across = points[index["Left" + hip]] - points[index["Right" + hip]]
    across = across + points[index["Left" + arm]] - points[index["Right" + arm]]
    return np.array([-across[2], 0, across[0]])  # across x up


def retarget(body, motion, keep_origin):
    """Model-space rotations and positions `[frames, joints]` of the body's joints."""
    at = {name: k for k, name in enumerate(body["names"])}
    of = {name: k for k, name in enumerate(motion["names"])}
    rest, source_rest = rest_positions(body), rest_positions(motion)

    # One turn about the vertical makes both rest poses look the same way.
    f, g = facing(source_rest, of, "Hip", "Shoulder"), facing(rest, at, "UpLeg", "Arm")
    yaw = axis_rotation("Y", np.array(np.arctan2(f[2] * g[0] - f[0] * g[2], f @ g)))
    turns = yaw @ motion["rotations"] @ yaw.T
    source_rest = source_rest @ yaw.T
    source_positions = motion["positions"] @ yaw.T

    # Where each body joint takes its motion from: rotations since rest, [frames, 3, 3].
    driver = {"Hips": turns[:, of["Hips"]]}
    spine = [turns[:, of[n]] for n in ("Chest", "Chest2") if n in of]
    neck = [turns[:, of[n]] for n in ("Neck", "Head") if n in of]
    for names, chain in ((BODY_SPINE, [driver["Hips"], *spine]), (BODY_NECK, [(spine or [driver["Hips"]])[-1], *neck])):
        for k, name in enumerate(names, 1):
            whole, part = divmod(k * (len(chain) - 1), len(names))
            driver[name] = chain[whole] if part == 0 else between(chain[whole], chain[whole + 1], part / len(names))
    for side in ("Left", "Right"):
        for target, source in LIMBS.items():
            if side + source in of:
                driver[side + target] = turns[:, of[side + source]]

    # How each joint's rest frame must turn so that the rest poses agree.
    align = {}
    for k, name in enumerate(body["names"]):
        above = body["parents"][k]
        align[name] = align[body["names"][above]] if above >= 0 else np.eye(3)
        if name not in driver:
            continue
        side, part = ("Left", name[4:]) if name.startswith("Left") else ("Right", name[5:])
        if part in SWING:
            bone = rest[at[side + SWING[part]]] - rest[k]
            joint = of[side + LIMBS[part]]
            tip = side + LIMBS[SWING[part]]
            # A rig without wrists ends its forearm at an end site.
            end = source_rest[of[tip]] if tip in of else source_rest[joint] + yaw @ motion["ends"][joint]
            align[name] = swing(align[name] @ bone, end - source_rest[joint]) @ align[name]
        elif part == "Foot":
            bone = rest[at[side + "ToeBase"]] - rest[k]
            other = yaw @ motion["ends"][of[side + "Ankle"]]
            angle = np.arctan2(bone[0], bone[2]), np.arctan2(other[0], other[2])
            align[name] = axis_rotation("Y", np.array(angle[1] - angle[0]))

    frames = len(turns)
    rotations = np.empty((frames, len(body["names"]), 3, 3))
    for k, name in enumerate(body["names"]):
        above = body["parents"][k]
        if name in driver:
            rotations[:, k] = driver[name] @ align[name]
        else:
            rotations[:, k] = rotations[:, above]

    # The middle of the hip sockets follows the source's, scaled by the length of the legs.
    def leg(points, index, names):
        chain = [[points[index[s + n]] for n in names] for s in ("Left", "Right")]
        return sum(np.linalg.norm(a - b) + np.linalg.norm(b - c) for a, b, c in chain) / 2

    scale = leg(rest, at, ("UpLeg", "Leg", "Foot")) / leg(source_rest, of, ("Hip", "Knee", "Ankle"))
    middle = scale * (source_positions[:, of["LeftHip"]] + source_positions[:, of["RightHip"]]) / 2

    def positions(root):
        out = np.empty((frames, len(body["names"]), 3))
        for k, above in enumerate(body["parents"]):
            if above < 0:
                out[:, k] = root
            else:
                out[:, k] = out[:, above] + rotations[:, above] @ body["offsets"][k]
        return out

    loose = positions(np.zeros(3))
    root = middle - (loose[:, at["LeftUpLeg"]] + loose[:, at["RightUpLeg"]]) / 2
    if not keep_origin:
        root[:, [0, 2]] -= middle[0, [0, 2]]
    return rotations, positions(root)


def floor_lift(body, rotations, positions):
    """Metres that bring the median over all frames of the lowest point of the feet to y = 0."""
    feet = [k for k, name in enumerate(body["names"]) if name.endswith(("Foot", "ToeBase"))]
    heaviest = np.take_along_axis(body["joints"], body["weights"].argmax(1)[:, None], 1)[:, 0]
    chosen = np.isin(heaviest, feet)
    part = {**body, **{key: body[key][chosen] for key in ("positions", "joints", "weights")}}
    lowest = sorted(skin(part, rotations, positions, k)[:, 1].min() for k in range(len(rotations)))
    return -lowest[len(lowest) // 2]


def skin(body, rotations, positions, frame):
    """Linear blend skinning of one frame, `[vertices, 3]`."""
    world = np.tile(np.eye(4), (len(body["names"]), 1, 1))
    world[:, :3, :3] = rotations[frame]
    world[:, :3, 3] = positions[frame]
    palette = (world @ body["inverse_bind"])[:, :3]
    points = np.hstack([body["positions"], np.ones((len(body["positions"]), 1))])
    out = np.zeros_like(body["positions"])
    for slot in range(body["joints"].shape[1]):
        used = body["weights"][:, slot] > 0
        moved = (palette[body["joints"][used, slot]] @ points[used][:, :, None])[:, :, 0]
        out[used] += body["weights"][used, slot, None] * moved
    return out


def main():
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, default=DATA / "human.glb")
    parser.add_argument("--motion", type=Path, default=DATA / "walk.bvh")
    parser.add_argument("--lift", type=float, help="metres added to the height; soles on the floor where absent")
    parser.add_argument("--keep-origin", action="store_true", help="start where the clip starts")
    parser.add_argument("--npy", type=Path, help="output of `sinew play` to compare with")
    parser.add_argument("--write", type=Path, help="where to write this computation")
    parser.add_argument("--tolerance", type=float, default=0.02, help="millimetres")
    options = parser.parse_args()

    body, motion = read_glb(options.body), read_bvh(options.motion)
    rotations, positions = retarget(body, motion, options.keep_origin)
    lift = floor_lift(body, rotations, positions) if options.lift is None else options.lift
    positions = positions + [0, lift, 0]
    frames = len(rotations)
    print(f"{frames} frames, {len(body['positions'])} vertices, lifted by {lift:.9f} m")
    if options.write:
        out = np.lib.format.open_memmap(options.write, "w+", np.float32, (frames, len(body["positions"]), 3))
        for k in range(frames):
            out[k] = skin(body, rotations, positions, k)
        out.flush()
    if options.npy is None:
        return 0
    other = np.load(options.npy, mmap_mode="r")
    if other.shape != (frames, len(body["positions"]), 3):
        print(f"shape {other.shape}, expected {(frames, len(body['positions']), 3)}")
        return 1
    worst, total = 0.0, 0.0
    for k in range(frames):
        error = 1000 * np.linalg.norm(other[k] - skin(body, rotations, positions, k), axis=1)
        if not np.isfinite(error).all():
            print(f"frame {k}: not finite")
            return 1
        if error.max() > worst:
            worst, place = error.max(), (k, int(error.argmax()))
        total += error.mean()
    place = f" (frame {place[0]}, vertex {place[1]})" if worst > 0 else ""
    print(f"max {worst:.6f} mm{place}, mean {total / frames:.6f} mm, tolerance {options.tolerance} mm")
    return 0 if worst <= options.tolerance else 1


if __name__ == "__main__":
    sys.exit(main())
