#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Ratios between our programs and their peers from the measurements of peers.sh.

usage: peer_table.py table PEERS.CSV RATIOS.CSV [PART]    prints the table and writes it; counts are of 1 / PART
       peer_table.py rows BENCH.JSON               rows of PEERS.CSV from `raysplats bench --json`
"""

import csv
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median

# Published figures, measured with two threads on an otherwise idle 2-core AVX-512 machine. Each is scaled to
# this machine and minute by the time that Embree takes here over what it took there.
OPENSPLAT_ITERATION_MS = 288.0  # OpenSplat (CPU), undistorted fox, 269x479 pixels, 14.7 k Gaussians
TINYBVH_REFIT_MS = 34.0  # tinybvh, 1 M boxes, one thread
# An earlier Embree program on 800x800 camera rays, 100 k Gaussians of scene `random`, K = 64: 0.63 Mrays/s for
# single rays, 574 ms for packets (983 ms for 1 M Gaussians). The targets for camera rays were set against those
# packets. embree_peer's single rays run level with that program's and calibrate; its packets are two to three times as
# fast, so that the rows against them ask more than the targets did.
EMBREE_SINGLE_MS = 640_000 / 0.63e3
EMBREE_PACKETS_MS = {100_000: 574.0, 1_000_000: 983.0}
EMBREE_MORTON_MS = 136.0  # 1 M boxes, RTC_BUILD_QUALITY_LOW

Key = tuple[str, str, int]  # work, program, Gaussians


@dataclass
class Line:
    """A row of the table: `peer` over `ours` for speed-ups, `ours` over `peer` for shares of time."""

    title: str
    ours: dict[str, float]  # per round, ms
    peer: dict[str, float]  # per round, ms
    target: float
    speedup: bool  # the ratio should be at least the target, else at most

    def ratios(self) -> list[float]:
        rounds = [r for r in self.ours if r in self.peer]
        pairs = [(self.ours[r], self.peer[r]) for r in rounds]
        return [peer / ours if self.speedup else ours / peer for ours, peer in pairs]


def read_times(path: Path) -> dict[Key, dict[str, float]]:
    times: dict[Key, dict[str, float]] = {}
    with path.open() as file:
        for row in csv.DictReader(file):
            key = (row["work"], row["program"], int(row["gaussians"]) if row["work"] != "train" else 0)
            times.setdefault(key, {})[row["round"]] = float(row["median_ms"])
    return times


def report_differences(path: Path) -> None:
    """Whether both sides drew the same pictures."""
    with path.open() as file:
        rows = [r for r in csv.DictReader(file) if r["work"] in ("camera", "rays") and r["program"] != "ours"]
    if not rows:
        return
    largest = max(float(r["max_difference"]) for r in rows)
    mean = max(float(r["mean_difference"]) for r in rows)
    print(f"colours against Embree's: largest difference of one value {largest:.3g}, "
          f"largest mean difference of a picture {mean:.3g}")


def scaled(published: float, measured: dict[str, float], reference: float) -> dict[str, float]:
    return {r: published * ms / reference for r, ms in measured.items()}


def lines_of(times: dict[Key, dict[str, float]], part: int) -> list[Line]:
    def of(work: str, program: str, gaussians: int) -> dict[str, float]:
        return times.get((work, program, gaussians // part), {})

    packets, single = "embree-packets-k64", "embree-single-k64"

    def published(ms: float) -> dict[str, float]:
        return scaled(ms, of("camera", single, 100_000), EMBREE_SINGLE_MS)

    return [
        Line("camera rays, 100 k: Embree packets K=64 / ours",
             of("camera", "ours", 100_000), of("camera", packets, 100_000), 4.0, True),
        Line("camera rays, 1 M: Embree packets K=64 / ours",
             of("camera", "ours", 1_000_000), of("camera", packets, 1_000_000), 3.0, True),
        Line("camera rays, 100 k: published packets (scaled) / ours",
             of("camera", "ours", 100_000), published(EMBREE_PACKETS_MS[100_000]), 4.0, True),
        Line("camera rays, 1 M: published packets (scaled) / ours",
             of("camera", "ours", 1_000_000), published(EMBREE_PACKETS_MS[1_000_000]), 3.0, True),
        Line("arbitrary rays, 100 k: Embree single K=64 / ours",
             of("rays", "ours", 100_000), of("rays", single, 100_000), 1.0, True),
        Line("arbitrary rays, 1 M: Embree single K=64 / ours",
             of("rays", "ours", 1_000_000), of("rays", single, 1_000_000), 1.0, True),
        Line("LBVH build, 100 k: ours / Embree Morton",
             of("build", "ours", 100_000), of("build", "embree-morton", 100_000), 0.7, False),
        Line("LBVH build, 1 M: ours / Embree Morton",
             of("build", "ours", 1_000_000), of("build", "embree-morton", 1_000_000), 0.7, False),
        Line("LBVH build, 1 M: ours / Embree SAH",
             of("build", "ours", 1_000_000), of("build", "embree-sah", 1_000_000), 0.7, False),
        Line("LBVH refit, 100 k: ours / Embree refit",
             of("refit", "ours", 100_000), of("refit", "embree-refit", 100_000), 0.7, False),
        Line("LBVH refit, 1 M: ours / Embree refit",
             of("refit", "ours", 1_000_000), of("refit", "embree-refit", 1_000_000), 0.7, False),
        Line("LBVH refit, 1 M: ours / tinybvh (scaled)",
             of("refit", "ours", 1_000_000),
             scaled(TINYBVH_REFIT_MS, of("build", "embree-morton", 1_000_000), EMBREE_MORTON_MS), 0.7, False),
        Line("growth, camera rays: 1 M / 10 k",
             of("camera", "ours", 1_000_000), of("camera", "ours", 10_000), 1.6, False),
        Line("training iteration, fox: OpenSplat (scaled) / ours",
             of("train", "ours", 0), published(OPENSPLAT_ITERATION_MS), 4.0, True),
    ]


def table(rows: Path, output: Path, part: int) -> None:
    times = read_times(rows)
    header = ["comparison", "ours_ms", "peer_ms", "ratio", "ratio_min", "ratio_max", "target", "met"]
    written = [header]
    print(f"{'comparison':54} {'ours ms':>9} {'peer ms':>9} {'ratio':>6} {'range':>12} {'target':>8}")
    for line in lines_of(times, part):
        ratios = line.ratios()
        if not ratios:
            print(f"{line.title:54} not measured")
            continue
        ours, peer, ratio = median(line.ours.values()), median(line.peer.values()), median(ratios)
        met = ratio >= line.target if line.speedup else ratio <= line.target
        target = f"{'>=' if line.speedup else '<='} {line.target:g}"
        spread = f"{min(ratios):.2f}..{max(ratios):.2f}"
        print(f"{line.title:54} {ours:9.1f} {peer:9.1f} {ratio:6.2f} {spread:>12} {target:>8}"
              f"{'' if met else '  missed'}")
        numbers = [ours, peer, ratio, min(ratios), max(ratios)]
        written.append([line.title, *(f"{x:.4g}" for x in numbers), target, "yes" if met else "no"])
    calibrations = (("camera", "embree-single-k64", 100_000, EMBREE_SINGLE_MS),
                    ("build", "embree-morton", 1_000_000, EMBREE_MORTON_MS))
    for work, program, gaussians, reference in calibrations:
        measured = times.get((work, program, gaussians // part))
        if measured:
            print(f"this machine against the published one, {work} by {program}: "
                  f"{median(measured.values()) / reference:.2f} times the time")
    report_differences(rows)
    with output.open("w", newline="") as file:
        csv.writer(file).writerows(written)


def rows_of_bench(path: Path) -> None:
    works = {"view": "camera", "build": "build", "refit": "refit", "rays": "rays"}
    for row in json.loads(path.read_text())["rows"]:
        if row["name"] not in works:
            continue
        units = row["items"][0]["count"]
        ms = 1e3 * row.get("wall_seconds", row["seconds"]["median"])
        least = 1e3 * row["seconds"]["minimum"]
        print(f"{works[row['name']]},ours,{row['scene']},{row['size']},{units:.0f},{ms:.3f},{least:.3f},"
              f"{1e-3 * units / ms:.4f},,,,,")


def main() -> None:
    arguments = sys.argv[1:]
    if len(arguments) in (3, 4) and arguments[0] == "table":
        table(Path(arguments[1]), Path(arguments[2]), int(arguments[3]) if len(arguments) == 4 else 1)
    elif len(arguments) == 2 and arguments[0] == "rows":
        rows_of_bench(Path(arguments[1]))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
