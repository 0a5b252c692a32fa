#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How far the poses of one COLMAP model (cameras of the same photos, by name) are from those of another, after the
similarity that brings the centres closest (Umeyama 1991). Centres in percent of the extent, which is the largest
distance of a centre from their mean.
usage: scripts/quality/poses.py FOUND STORED        (folders with images.bin, as DATA/sparse/0)"""
import pathlib
import struct
import sys

import numpy as np


def rotation(w, x, y, z):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def poses(folder):
    """Rotation (world to camera) and centre of every photo."""
    data = (pathlib.Path(folder) / "images.bin").read_bytes()
    count, = struct.unpack_from("<Q", data)
    at, out = 8, {}
    for _ in range(count):
        numbers = struct.unpack_from("<I7dI", data, at)
        end = data.index(b"\0", at + 64)
        name = data[at + 64:end].decode()
        points, = struct.unpack_from("<Q", data, end + 1)
        at = end + 9 + 24 * points
        turn = rotation(*numbers[1:5])
        out[name] = turn, -turn.T @ np.array(numbers[5:8])
    return out


def similarity(source, target):
    """Scale, rotation and shift that bring `source` to `target`."""
    a, b = source - source.mean(0), target - target.mean(0)
    u, s, v = np.linalg.svd(b.T @ a / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(v))])
    turn = u @ sign @ v
    scale = np.trace(np.diag(s) @ sign) / (a ** 2).sum(1).mean()
    return scale, turn, target.mean(0) - scale * turn @ source.mean(0)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    found, stored = (poses(folder) for folder in sys.argv[1:])
    names = sorted(found.keys() & stored.keys())
    ours, theirs = (np.array([model[name][1] for name in names]) for model in (found, stored))
    scale, turn, shift = similarity(ours, theirs)
    extent = np.linalg.norm(theirs - theirs.mean(0), axis=1).max()
    away = 100 * np.linalg.norm(scale * ours @ turn.T + shift - theirs, axis=1) / extent
    cosines = [(np.trace(stored[name][0] @ turn @ found[name][0].T) - 1) / 2 for name in names]
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    print(f"{len(names)} of {len(stored)} photos: rotations {np.median(angles):.3f} degrees apart (median; mean "
          f"{angles.mean():.3f}, at most {angles.max():.3f}), centres {np.median(away):.3f} % of the extent (mean "
          f"{away.mean():.3f}, at most {away.max():.3f})")


if __name__ == "__main__":
    main()
