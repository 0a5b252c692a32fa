#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A COLMAP data set (sparse/0/*.bin) with a share of its sparse points, for docs/experiments.md: those next to their
middle (the median of each coordinate), or with `scattered` a random choice. All else is that of DATA. OUT must not
exist; its other files are links."""
import argparse
import math
import pathlib
import random
import statistics
import struct
import sys

from few_photos import Reader


def read_points(file):
    """(position, the point's bytes) of each."""
    reader, points = Reader(file), []
    for _ in range(reader.numbers("Q")[0]):
        point = reader.skip(8 + 3 * 8 + 3 + 8)
        count = reader.numbers("Q")[0]
        points.append((struct.unpack_from("<3d", point, 8), point + struct.pack("<Q", count) + reader.skip(8 * count)))
    return points


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", type=pathlib.Path)
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    parser.add_argument("share", metavar="SHARE", type=float)
    parser.add_argument("choice", nargs="?", choices=["nearest", "scattered"], default="nearest")
    arguments = parser.parse_args()
    data, out, share = arguments.data.resolve(), arguments.out, arguments.share
    if not 0 < share <= 1:
        sys.exit(f"a share is above 0 and at most 1, not {share}")
    points = read_points(data / "sparse/0/points3D.bin")
    if arguments.choice == "scattered":
        random.Random(1).shuffle(points)
    else:
        middle = [statistics.median(axis) for axis in zip(*(position for position, _ in points))]
        points.sort(key=lambda point: math.dist(point[0], middle))
    kept = [point for _, point in points[:int(share * len(points))]]
    (out / "sparse/0").mkdir(parents=True)
    for folder, others in ((".", "sparse"), ("sparse/0", "points3D.bin")):
        for file in (data / folder).iterdir():
            if file.name != others:
                (out / folder / file.name).symlink_to(file)
    (out / "sparse/0/points3D.bin").write_bytes(struct.pack("<Q", len(kept)) + b"".join(kept))
    print(f"{out}: {len(kept)} of {len(points)} points")


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(str(error))
