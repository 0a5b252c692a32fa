#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A data set (transforms_train.json, as of `raysplats generate`) with training photos made worse, for
docs/training.md (poses) and docs/experiments.md (box):

poses  every camera turned by 0.5 degrees and moved by 1 % of the extent (1.1 times the largest distance of a camera from
       their mean) in directions drawn at random, less the motion and the scale that all have in common
box    a grey box of a quarter of the width, at another place in each, painted into every third photo

usage: scripts/quality/disturb.py poses|box DATA OUT        (OUT is made anew; box needs Pillow)"""
import json
import pathlib
import shutil
import sys

import numpy as np

ANGLE, SHIFT = np.radians(0.5), 0.01
EVERY, PART = 3, 0.25
SEED = 17


def cross_matrix(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rotation(turn):
    """Rodrigues' formula."""
    angle = np.linalg.norm(turn)
    k = cross_matrix(turn / angle)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def directions(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def without_common_part(turns, shifts, places):
    """Less the shift, turn and scale about the middle that come closest to all, by least squares; shifts and places in
    extents."""
    rows, wanted = [], []
    for turn, shift, place in zip(turns, shifts, places):
        rows.append(np.hstack([np.eye(3), -cross_matrix(place), place[:, None]]))
        rows.append(np.hstack([np.zeros((3, 3)), np.eye(3), np.zeros((3, 1))]))
        wanted += [shift, turn]
    common = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=None)[0]
    moved = [common[:3] + np.cross(common[3:6], place) + common[6] * place for place in places]
    return turns - common[3:6], shifts - np.array(moved)


def disturb_poses(folder, frames):
    matrices = np.array([frame["transform_matrix"] for frame in frames], float)
    centers = matrices[:, :3, 3]
    middle = centers.mean(0)
    extent = 1.1 * np.linalg.norm(centers - middle, axis=1).max()
    rng = np.random.default_rng(SEED)
    turns, shifts = without_common_part(ANGLE * directions(rng, len(frames)), SHIFT * directions(rng, len(frames)),
                                        (centers - middle) / extent)
    for frame, matrix, turn, shift in zip(frames, matrices, turns, shifts):
        matrix[:3, :3] = rotation(turn) @ matrix[:3, :3]
        matrix[:3, 3] += extent * shift
        frame["transform_matrix"] = matrix.tolist()


def paint_boxes(folder, frames):
    from PIL import Image, ImageDraw

    rng = np.random.default_rng(SEED)
    for frame in frames[::EVERY]:
        path = folder / frame["file_path"]
        path = path if path.suffix else path.with_suffix(".png")
        with Image.open(path) as photo:
            picture = photo.copy()
        side = int(PART * picture.width)
        x, y = (int(rng.integers(0, length - side)) for length in picture.size)
        grey = (128, 128, 128, 255)[:len(picture.getbands())]
        ImageDraw.Draw(picture).rectangle([x, y, x + side, y + side], fill=grey)
        picture.save(path)


def main():
    kinds = {"poses": disturb_poses, "box": paint_boxes}
    if len(sys.argv) != 4 or sys.argv[1] not in kinds:
        sys.exit(__doc__)
    source, folder = map(pathlib.Path, sys.argv[2:])
    if folder.resolve() == source.resolve():
        sys.exit("disturb.py: OUT is DATA, which is not changed: name another folder")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    path = folder / "transforms_train.json"
    transforms = json.loads(path.read_text())
    kinds[sys.argv[1]](folder, transforms["frames"])
    path.write_text(json.dumps(transforms))


if __name__ == "__main__":
    main()
