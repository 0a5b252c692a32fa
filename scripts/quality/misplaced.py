#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A COLMAP data set (images/ or a reduced images_N/, sparse/0/*.bin) of which every EVERY-th training photo has a wrong
pose, for docs/training.md: turned by 4 to 12 degrees and moved by a tenth of the cameras' spread, in directions drawn at
random. With --gone it lacks these photos in place. What it holds out OUT/test.txt names for `raysplats train OUT
--test-list`: every eighth photo, as in DATA. OUT must not exist; its photos are links."""
import argparse
import pathlib
import struct
import sys

import numpy as np
from few_photos import FOLDERS, HELD_OUT, read_images
from poses import poses, rotation

TURN, SHIFT = np.radians((4, 12)), 0.1
SEED = 5


def quaternion_product(a, b):
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def misplaced(rng, pose, spread):
    """The number, pose and camera of images.bin, with another pose."""
    number, *numbers, camera = struct.unpack("<I7dI", pose)
    old = np.array(numbers[:4])
    angle, axis = rng.uniform(*TURN), rng.normal(size=3)
    turn = quaternion_product(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis / np.linalg.norm(axis))]), old)
    centre = -rotation(*old).T @ np.array(numbers[4:]) + SHIFT * spread * rng.normal(size=3)
    return struct.pack("<I7dI", number, *turn, *(-rotation(*turn) @ centre), camera)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", type=pathlib.Path)
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    parser.add_argument("every", metavar="EVERY", type=int)
    parser.add_argument("--gone", action="store_true", help="leave these photos out")
    arguments = parser.parse_args()
    data, out, every = arguments.data, arguments.out, arguments.every
    if every < 1:
        parser.error(f"every {every}-th photo is none")
    images = read_images(data / "sparse/0/images.bin")
    photos = next((data / name for name in FOLDERS if (data / name / images[0][0]).exists()), None)
    if photos is None:
        sys.exit(f"{data} has {images[0][0]} in none of {', '.join(FOLDERS)}")
    train = [name for i, (name, *_) in enumerate(images) if i % HELD_OUT]
    wrong = set(train[every // 2::every])
    centres = np.array([centre for _, centre in poses(data / "sparse/0").values()])
    spread = np.median(np.linalg.norm(centres - np.median(centres, 0), axis=1))
    rng, rows = np.random.default_rng(SEED), []
    (out / photos.name).mkdir(parents=True)
    (out / "sparse/0").mkdir(parents=True)
    for name, _, pose, seen in images:
        if name in wrong:
            if arguments.gone:
                continue
            pose = misplaced(rng, pose, spread)
        target = out / photos.name / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.symlink_to((photos / name).resolve())
        rows.append(pose + name.encode() + b"\0" + seen)
    (out / "sparse/0/images.bin").write_bytes(struct.pack("<Q", len(rows)) + b"".join(rows))
    for name in ("cameras.bin", "points3D.bin"):
        (out / "sparse/0" / name).write_bytes((data / "sparse/0" / name).read_bytes())
    (out / "test.txt").write_text("".join(name + "\n" for name, *_ in images[::HELD_OUT]))
    print(f"{out}: {len(wrong)} of {len(train)} training photos {'left out' if arguments.gone else 'misplaced'}")


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(str(error))
