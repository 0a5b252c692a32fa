#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A copy of a data set whose photos, in its folder images, have other edges, marks or another size, for docs/training.md:

bars      black, of 12 % of the height, above and below, as in a letterboxed video
window    black on all sides, of 30 % of the width and 8 % of the height, as around an upright video
bent      black and narrow on all sides, as another program leaves them that has taken out a lens
circle    black around the largest circle, as of a fisheye
marks     a yellow logo at the lower right, and a white box with black letters at the upper left
enlarged  3000 pixels wide, as photos of today's cameras
sizes     whole, a half, a quarter and an eighth as wide, in turn, as from other distances; of a data set in Blender's form,
          whose photos are in its folder train

usage: scripts/quality/photos.py bars|window|bent|circle|marks|enlarged|sizes DATA OUT    (OUT is made anew; needs numpy and Pillow)"""
import pathlib
import shutil
import sys

import numpy as np
from PIL import Image, ImageDraw

BAR, WINDOW, BEND, EDGE, WIDTH, QUALITY = 0.12, (0.3, 0.08), 0.06, 1.02, 3000, 90
SIZES = 1, 2, 4, 8


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


def marked(photo):
    """The photo with marks, whose places are shares of its sides."""
    across, down = photo.size
    draw = ImageDraw.Draw(photo)

    def box(left, top, right, bottom):
        return left * across, top * down, right * across, bottom * down

    draw.ellipse(box(0.72, 0.85, 0.95, 0.98), fill=(255, 220, 0))
    draw.rectangle(box(0.78, 0.89, 0.89, 0.91), fill=(20, 20, 160))
    draw.rectangle(box(0.04, 0.03, 0.3, 0.07), fill=(255, 255, 255))
    for letter in range(8):
        draw.rectangle(box(0.05 + 0.03 * letter, 0.037, 0.065 + 0.03 * letter, 0.062), fill=(0, 0, 0))
    return photo


def change(kind, photo):
    if kind == "marks":
        return marked(photo)
    if kind == "enlarged":
        return photo.resize((WIDTH, round(photo.height * WIDTH / photo.width)), Image.BICUBIC)
    pixels = np.array(photo)
    pixels[border(kind, photo.width, photo.height)] = 0
    return Image.fromarray(pixels)


def shrink(paths):
    """Photos in turn by the factors of SIZES; what is transparent adds nothing to the colours around it."""
    for number, path in enumerate(paths):
        with Image.open(path) as photo:
            size = [max(side // SIZES[number % len(SIZES)], 1) for side in photo.size]
            picture = photo.convert("RGBa").resize(size, Image.BOX).convert("RGBA")
        picture.save(path)


def main():
    kinds = ("bars", "window", "bent", "circle", "marks", "enlarged", "sizes")
    if len(sys.argv) != 4 or sys.argv[1] not in kinds:
        sys.exit(__doc__)
    source, folder = map(pathlib.Path, sys.argv[2:])
    if folder.resolve() == source.resolve():
        sys.exit("photos.py: OUT is DATA, which is not changed: name another folder")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    if sys.argv[1] == "sizes":
        paths = sorted(folder.glob("train/*.png"))
        if not paths:
            sys.exit(f"photos.py: {source} has no train/*.png, so it is no data set in Blender's form")
        shrink(paths)
        return
    for path in sorted(folder.glob("images/*")):
        with Image.open(path) as photo:
            picture = change(sys.argv[1], photo.convert("RGB"))
        picture.save(path, quality=QUALITY)


if __name__ == "__main__":
    main()
