#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What it costs a training run to be watched: iterations a second while a page looks, over those while none does. Both
take turns within one run, and each turn is compared with those beside it, so that neither the growth of the model nor
other work on the machine counts for one side.
usage: scripts/bench/watched.py DATA [PROGRAM] [--pairs N] [--seconds S] [--moving]"""
import argparse
import json
import os
import pathlib
import select
import statistics
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/view"))
from program import Channel, Viewer, view  # noqa: E402

SIZE = (640, 480)
MOVES = 20  # a second


def iterations(run):
    """How far the run is."""
    rows = json.loads(run.ask("/api/run", Cookie=run.cookie())[2])["rows"]
    return rows[-1][0] if rows else 0


def speed(run, seconds, meanwhile):
    """Iterations a second, while something is done again and again."""
    before, start = iterations(run), time.monotonic()
    while time.monotonic() - start < seconds:
        meanwhile()
    return (iterations(run) - before) / (time.monotonic() - start)


def watched_speed(run, seconds, moving):
    """The same before a page at the run's first camera, and the seconds that its pictures took."""
    start = json.loads(run.ask("/api/state", Cookie=run.cookie())[2])["start"]
    wish = {**view(1, SIZE), "c2w": start["c2w"], "fov": start["fov"], "moving": moving}
    pictures = []
    with Channel(run) as page:
        def look():
            if select.select([page.socket], [], [], 1 / MOVES)[0]:
                kind, message, *_ = page.receive()
                if kind == "picture":
                    pictures.append(1e-3 * message["milliseconds"])
            if moving:
                page.send_json(**wish)

        page.send_json(**wish)
        return speed(run, seconds, look), pictures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("program", nargs="?", default=str(ROOT / "build/release/bin/raysplats"))
    parser.add_argument("--pairs", type=int, default=2, help="turns of being watched")
    parser.add_argument("--seconds", type=float, default=60, help="of a turn")
    parser.add_argument("--moving", action="store_true", help="the page moves all the time")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="raysplats_watched_") as folder:
        arguments = [given.data, "-o", os.path.join(folder, "run"), "--view", "-n", "1000000", "--log-every", "1",
                     "--eval-every", "0"]
        with Viewer(given.program, arguments, "train") as run:
            while iterations(run) < 200:  # kernels are compiled, the first steps done
                time.sleep(0.5)
            speeds, ratios, pictures = [], [], []
            speeds.append(speed(run, given.seconds, lambda: time.sleep(1 / MOVES)))
            for _ in range(given.pairs):
                watched, came = watched_speed(run, given.seconds, given.moving)
                pictures += came
                speeds.append(speed(run, given.seconds, lambda: time.sleep(1 / MOVES)))
                ratios.append(watched / statistics.mean(speeds[-2:]))
    watched = given.pairs * given.seconds
    print(f"{watched:g} s watched: training at {statistics.median(ratios):.3f} of its speed (from {min(ratios):.3f} to "
          f"{max(ratios):.3f}; {statistics.median(speeds):.1f} iterations a second alone), {len(pictures) / watched:.1f} "
          f"pictures a second, which took {sum(pictures) / watched:.3f} of the time")



if __name__ == "__main__":
    main()
