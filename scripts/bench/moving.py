#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How fluent `raysplats view` is while its camera moves: pictures a second, their size, and the time from sending a
movement to having its picture. A page turns the camera to and fro, as fast as a mouse does, and counts after a second
in which the viewer finds its resolution.
usage: scripts/bench/moving.py MODEL... [--program PROGRAM] [--seconds S] [--size WIDTHxHEIGHT] [--copies N]
(with `chrt -r 1` before it, other work on the machine counts less)"""
import argparse
import array
import json
import math
import pathlib
import select
import statistics
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/view"))
from program import Channel, Viewer, view  # noqa: E402

MOVES = 60  # a second
TURN = math.radians(6)
SETTLING = 1.0  # seconds
SPACING = 2.6  # units between copies


def turned(c2w, angle):
    """The camera turned about its own upright axis."""
    c, s = math.cos(angle), math.sin(angle)
    out = list(c2w)
    for row in range(0, 12, 4):
        out[row], out[row + 2] = c * c2w[row] - s * c2w[row + 2], s * c2w[row] + c * c2w[row + 2]
    return out


def write_copies(model, number, path):
    """A model of many Gaussians: a PLY of floats alone, as training writes them, side by side in rows of four."""
    head, mark, body = pathlib.Path(model).read_bytes().partition(b"end_header\n")
    words = head.decode().split()
    count = int(words[words.index("vertex") + 1])
    rows = array.array("f", body)
    columns = len(rows) // count
    with open(path, "wb") as file:
        file.write(head.replace(b"vertex %d\n" % count, b"vertex %d\n" % (count * number)) + mark)
        for copy in range(number):
            moved = rows[:]
            for row in range(0, len(rows), columns):
                moved[row] += SPACING * (copy % 4 - 1.5)
                moved[row + 2] += SPACING * (copy // 4 - 1.5)
            moved.tofile(file)


def watch(program, model, size, seconds):
    """Seconds from each movement to its picture, the pictures' sizes, and how long was counted."""
    with Viewer(program, [model]) as viewer:
        start = json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])["start"]
        with Channel(viewer) as page:
            wish = {**view(1, size), "fov": start["fov"], "c2w": start["c2w"]}
            page.send_json(**wish)
            while page.receive()[0] != "picture":  # kernels are compiled
                pass
            sent, delays, sizes = {}, [], []
            number, begin = 1, time.monotonic()
            following = begin
            while (now := time.monotonic()) < begin + SETTLING + seconds:
                if now >= following:
                    number += 1
                    following = max(following + 1 / MOVES, now)
                    sent[number] = now
                    page.send_json(**{**wish, "id": number, "moving": True,
                                      "c2w": turned(start["c2w"], TURN * math.sin(now - begin))})
                if not page.buffer and not select.select([page.socket], [], [], max(0, following - now))[0]:
                    continue
                kind, *rest = page.receive()
                now = time.monotonic()
                if kind == "picture" and rest[0]["view"] in sent and now > begin + SETTLING:
                    delays.append(now - sent[rest[0]["view"]])
                    sizes.append((rest[0]["width"], rest[0]["height"]))
            return delays, sizes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--program", default=str(ROOT / "build/release/bin/raysplats"))
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--size", default="640x480", help="of the page's picture")
    parser.add_argument("--copies", type=int, default=1, help="of the model side by side")
    given = parser.parse_args()
    size = tuple(int(side) for side in given.size.split("x"))
    for model in given.models:
        with tempfile.TemporaryDirectory(prefix="raysplats_moving_") as folder:
            shown = model
            if given.copies > 1:
                shown = f"{folder}/copies.ply"
                write_copies(model, given.copies, shown)
            delays, sizes = watch(given.program, shown, size, given.seconds)
        if len(delays) < 2:
            sys.exit(f"{model}: no pictures")
        median = sorted(sizes)[len(sizes) // 2]
        print(f"{model}: {len(delays) / given.seconds:.1f} pictures a second of {median[0]}x{median[1]} (from "
              f"{min(sizes)[0]}x{min(sizes)[1]} to {max(sizes)[0]}x{max(sizes)[1]}), movement to picture "
              f"{1000 * statistics.median(delays):.0f} ms (median; {1000 * sorted(delays)[int(0.95 * len(delays))]:.0f} ms "
              f"for 95 % of them)")


if __name__ == "__main__":
    main()
