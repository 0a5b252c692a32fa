#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A data set (transforms_train.json, as of `raysplats generate`, or transforms.json) with training photos made worse, for
docs/training.md (all others) and docs/experiments.md (box):

poses  every camera turned by 0.5 degrees and moved by 1 % of the extent (1.1 times the largest distance of a camera from
       their mean) in directions drawn at random, less the motion and the scale that all have in common
box    a grey box of a quarter of the width, at another place in each, painted into every third photo
opencv, inverse, inverse-opencv
       poses as other programs write them: with OpenCV's camera axes, from the world to the camera, or both
darker all photos times 0.7, those held out too
gains  the same, and each of those to train with times 0.7 to 1.4 as well
holes  a transparent ellipse, of 28 x 40 % of the photo, at another place in each

usage: scripts/quality/disturb.py KIND DATA OUT        (OUT is made anew; what changes photos needs Pillow)"""
import json
import pathlib
import shutil
import sys

import numpy as np

ANGLE, SHIFT = np.radians(0.5), 0.01
EVERY, PART = 3, 0.25
DARKER, GAINS = 0.7, (0.7, 1.4)
HOLE = (0.14, 0.2)
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


def write_otherwise(opencv, inverse):
    def change(folder, frames):
        for frame in frames:
            matrix = np.array(frame["transform_matrix"], float)
            if opencv:
                matrix = matrix @ np.diag([1, -1, -1, 1])
            frame["transform_matrix"] = (np.linalg.inv(matrix) if inverse else matrix).tolist()
    return change


def photo_of(folder, frame):
    path = folder / frame["file_path"]
    return path if path.suffix else path.with_suffix(".png")


def expose(path, gain):
    from PIL import Image

    with Image.open(path) as photo:
        pixels = np.array(photo).astype(float)
    pixels[..., :3] = np.clip(gain * pixels[..., :3], 0, 255)
    Image.fromarray(np.round(pixels).astype(np.uint8)).save(path)


def darken(gains):
    def change(folder, frames):
        rng = np.random.default_rng(SEED)
        for frame in frames:
            expose(photo_of(folder, frame), DARKER * rng.uniform(*gains))
        held_out = folder / "transforms_test.json"
        for frame in json.loads(held_out.read_text())["frames"] if held_out.exists() else []:
            expose(photo_of(folder, frame), DARKER)
    return change


def cut_holes(folder, frames):
    from PIL import Image

    rng = np.random.default_rng(SEED)
    for frame in frames:
        path = photo_of(folder, frame)
        with Image.open(path) as photo:
            pixels = np.array(photo.convert("RGBA"))
        height, width = pixels.shape[:2]
        y, x = np.mgrid[0:height, 0:width]
        u, v = (x / width - rng.uniform(0.2, 0.8)) / HOLE[0], (y / height - rng.uniform(0.3, 0.8)) / HOLE[1]
        pixels[u * u + v * v < 1, 3] = 0
        path.unlink()
        frame["file_path"] = str(pathlib.Path(frame["file_path"]).with_suffix(".png"))
        Image.fromarray(pixels).save(path.with_suffix(".png"))


def paint_boxes(folder, frames):
    from PIL import Image, ImageDraw

    rng = np.random.default_rng(SEED)
    for frame in frames[::EVERY]:
        path = photo_of(folder, frame)
        with Image.open(path) as photo:
            picture = photo.copy()
        side = int(PART * picture.width)
        x, y = (int(rng.integers(0, length - side)) for length in picture.size)
        grey = (128, 128, 128, 255)[:len(picture.getbands())]
        ImageDraw.Draw(picture).rectangle([x, y, x + side, y + side], fill=grey)
        picture.save(path)


def main():
    kinds = {"poses": disturb_poses, "box": paint_boxes, "opencv": write_otherwise(True, False),
             "inverse": write_otherwise(False, True), "inverse-opencv": write_otherwise(True, True),
             "darker": darken((1, 1)), "gains": darken(GAINS),
             "holes": cut_holes}
    if len(sys.argv) != 4 or sys.argv[1] not in kinds:
        sys.exit(__doc__)
    source, folder = map(pathlib.Path, sys.argv[2:])
    if folder.resolve() == source.resolve():
        sys.exit("disturb.py: OUT is DATA, which is not changed: name another folder")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    path = folder / "transforms_train.json"
    path = path if path.exists() else folder / "transforms.json"
    transforms = json.loads(path.read_text())
    kinds[sys.argv[1]](folder, transforms["frames"])
    path.write_text(json.dumps(transforms))


if __name__ == "__main__":
    main()
