#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A copy of a data set whose photos, in its folder images, have other edges or another size, for docs/training.md:

bars      black, of 12 % of the height, above and below, as in a letterboxed video
window    black on all sides, of 30 % of the width and 8 % of the height, as around an upright video
bent      black and narrow on all sides, as another program leaves them that has taken out a lens
circle    black around the largest circle, as of a fisheye
enlarged  3000 pixels wide, as photos of today's cameras

usage: scripts/quality/photos.py bars|window|bent|circle|enlarged DATA OUT        (OUT is made anew; needs numpy and Pillow)"""
import pathlib
import shutil
import sys

import numpy as np
from PIL import Image

BAR, WINDOW, BEND, EDGE, WIDTH, QUALITY = 0.12, (0.3, 0.08), 0.06, 1.02, 3000, 90


def border(kind, width, height):
    """Where it is, (height, width)."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    u, v = 2 * x / width - 1, 2 * y / height - 1
    if kind == "bars":
        return abs(v) > 1 - 2 * BAR
    if kind == "window":
        return (abs(u) > 1 - 2 * WINDOW[0]) | (abs(v) > 1 - 2 * WINDOW[1])
    if kind == "bent":
        stretch = 1 + BEND * (u * u + v * v)
        return np.maximum(abs(u), abs(v)) * stretch > EDGE
    return np.hypot(x - width / 2, y - height / 2) > min(width, height) / 2


def change(kind, photo):
    if kind == "enlarged":
        return photo.resize((WIDTH, round(photo.height * WIDTH / photo.width)), Image.BICUBIC)
    pixels = np.array(photo)
    pixels[border(kind, photo.width, photo.height)] = 0
    return Image.fromarray(pixels)


def main():
    if len(sys.argv) != 4 or sys.argv[1] not in ("bars", "window", "bent", "circle", "enlarged"):
        sys.exit(__doc__)
    source, folder = map(pathlib.Path, sys.argv[2:])
    if folder.resolve() == source.resolve():
        sys.exit("photos.py: OUT is DATA, which is not changed: name another folder")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    for path in sorted(folder.glob("images/*")):
        with Image.open(path) as photo:
            picture = change(sys.argv[1], photo.convert("RGB"))
        picture.save(path, quality=QUALITY)


if __name__ == "__main__":
    main()
