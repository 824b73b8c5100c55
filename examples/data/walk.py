"""Makes the bytes of `walk.bvh` from the walk cycle inside the package `pybullet`.

The source is a table of poses of the humanoid in pybullet_data/humanoid/humanoid.urdf: a frame is
its duration, the root's position and rotation, then a quaternion (w, x, y, z) or a hinge angle a
joint. Its units are metres, it looks along +X, its right is +Z. What is changed: it looks along +Z,
lengths are centimetres, the seam of the loop is mended, and the loop runs four times.
"""

import json
import math
import xml.etree.ElementTree as ElementTree

CYCLES = 4

KEPT = 36
"""Frames taken as they are. The last two of the 38 rush to the start of the loop; in their place..."""

MENDED = 4
"""...stand this many, so that a stride lasts 40 frames and its halves (a step each) 20."""

# Joint in the URDF, its name in the BVH file, its columns in a frame; children follow parents.
JOINTS = [
    ("root", "Hips", 4),
    ("chest", "Chest", 8),
    ("neck", "Neck", 12),
    ("left_shoulder", "LeftShoulder", 39),
    ("left_elbow", "LeftElbow", 43),
    ("right_shoulder", "RightShoulder", 25),
    ("right_elbow", "RightElbow", 29),
    ("left_hip", "LeftHip", 30),
    ("left_knee", "LeftKnee", 34),
    ("left_ankle", "LeftAnkle", 35),
    ("right_hip", "RightHip", 16),
    ("right_knee", "RightKnee", 20),
    ("right_ankle", "RightAnkle", 21),
]
QUATERNIONS = [column for urdf, _, column in JOINTS if not urdf.endswith(("elbow", "knee"))]


def build(package):
    """Bytes of the BVH file from `package`, the folder `pybullet_data`."""
    # The file ends in a stray zero byte.
    urdf = ElementTree.fromstring((package / "humanoid/humanoid.urdf").read_bytes().rstrip(b"\0"))
    frames = json.loads((package / "data/motions/walker/0walk_forward.txt").read_text())["Frames"]
    frames, advance = close_loop(frames)
    rows = [row(frame, cycle * advance) for cycle in range(CYCLES) for frame in frames]
    lines = ["HIERARCHY", *hierarchy(urdf, "root", 0), "MOTION", f"Frames: {len(rows)}", "Frame Time: 0.0333333"]
    return "\n".join(lines + rows + [""]).encode()


def close_loop(frames):
    """One stride that leads back to its first pose, and how far it goes, metres.

    The mended frames are a cubic Hermite curve from the last kept frame to the first frame of the
    next stride, with the speeds found there. The second step ends as far on as the first does from
    the same phase.
    """
    kept = [list(frame) for frame in frames[:KEPT]]
    step = (KEPT + MENDED) // 2
    advance = kept[-1][1] + frames[step][1] - frames[KEPT - 1 - step][1]
    ahead = [shift(frames[k], advance) for k in (0, 1)]
    for column in QUATERNIONS:  # q and -q are one rotation: stay on the nearer side
        for a, b in ((kept[-1], kept[-2]), (kept[-1], ahead[0]), (ahead[0], ahead[1])):
            if sum(x * y for x, y in zip(a[column : column + 4], b[column : column + 4])) < 0:
                b[column : column + 4] = [-x for x in b[column : column + 4]]
    span = MENDED + 1
    stride = list(kept)
    for k in range(1, span):
        t = k / span
        h = (2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2)
        stride.append(
            [
                h[0] * p + h[1] * span * (p - before) + h[2] * q + h[3] * span * (after - q)
                for before, p, q, after in zip(kept[-2], kept[-1], ahead[0], ahead[1])
            ]
        )
    return stride, advance


def shift(frame, advance):
    """The frame, `advance` metres further on."""
    return [*frame[:1], frame[1] + advance, *frame[2:]]


def hierarchy(urdf, name, depth):
    """Lines of the BVH skeleton below and with joint `name`."""
    _, bvh_name, _ = next(joint for joint in JOINTS if joint[0] == name)
    pad = "  " * depth
    channels = "3 Zrotation Xrotation Yrotation"
    if depth == 0:
        channels = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    lines = [
        f"{pad}{'JOINT' if depth else 'ROOT'} {bvh_name}",
        pad + "{",
        f"{pad}  OFFSET {offset(numbers(urdf.find(f'joint[@name={name!r}]/origin').get('xyz')))}",
        f"{pad}  CHANNELS {channels}",
    ]
    children = {joint.get("name") for joint in urdf.findall("joint") if joint.find("parent").get("link") == name}
    moving = [joint[0] for joint in JOINTS if joint[0] in children]
    for child in moving:
        lines += hierarchy(urdf, child, depth + 1)
    if not moving:
        lines += [pad + "  End Site", pad + "  {", f"{pad}    OFFSET {offset(end(urdf, name))}", pad + "  }"]
    return lines + [pad + "}"]


def end(urdf, name):
    """Where the body part of a leaf ends: the wrist, the top of the head, the tip of the sole."""
    wrist = urdf.find(f"joint[@name={name.replace('elbow', 'wrist')!r}]/origin")
    if name.endswith("elbow"):
        return numbers(wrist.get("xyz"))
    shape = urdf.find(f"link[@name={name!r}]/collision")
    centre = numbers(shape.find("origin").get("xyz"))
    if name == "neck":
        return [centre[0], centre[1] + float(shape.find("geometry/sphere").get("radius")), centre[2]]
    box = numbers(shape.find("geometry/box").get("size"))
    return [centre[0] + box[0] / 2, centre[1] - box[1] / 2, centre[2]]


def numbers(text):
    """Three numbers of a URDF attribute."""
    return [float(word) for word in text.split()]


def offset(v):
    """A URDF vector (four units a metre) as BVH text."""
    return text([25 * v[2] * -1, 25 * v[1], 25 * v[0]])


def row(frame, advance):
    """A line of the MOTION block."""
    values = [-100 * frame[3], 100 * frame[2], 100 * (frame[1] + advance)]
    for urdf, _, column in JOINTS:
        if column in QUATERNIONS:
            w, x, y, z = frame[column : column + 4]
            values += euler(w, -z, y, x)  # the same turn of the axes as for vectors
        else:
            # A hinge about the source's +Z, which is -X here.
            values += [0.0, -math.degrees(frame[column]), 0.0]
    return text(values)


def euler(w, x, y, z):
    """Degrees about Z, X, Y (applied in that order from the left) of a quaternion of any length."""
    n = w * w + x * x + y * y + z * z
    sin_x = max(-1.0, min(1.0, 2 * (y * z + w * x) / n))
    return [
        math.degrees(math.atan2(-2 * (x * y - w * z), w * w - x * x + y * y - z * z)),
        math.degrees(math.asin(sin_x)),
        math.degrees(math.atan2(-2 * (x * z - w * y), w * w - x * x - y * y + z * z)),
    ]


def text(values):
    """Numbers with four decimals, and no negative zero: the same text on every machine."""
    return " ".join(f"{value:.4f}".replace("-0.0000", "0.0000") for value in values)
