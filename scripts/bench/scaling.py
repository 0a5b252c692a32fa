#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits how the time of a training step follows the number of ranks, one core each (docs/scaling.md):
t(R) = own + views B / R + latency + bytes / bandwidth.
`own` (what every rank does) and `views` (for each view) are processor time of one rank, which other work on the machine
does not change; latency and bandwidth are fitted to what two ranks take more. Their time is that of a clock, a low
quantile over the steps of a run: they have to have their cores for so long, by `nice -n -19` on a machine with other work. Every
step takes the same two photos, once or twice.
usage: scripts/bench/scaling.py [PROGRAM] [--steps N] [--size PIXELS]"""
import argparse
import csv
import os
import pathlib
import resource
import statistics
import subprocess
import tempfile

COUNTS = (500, 1500, 4000)  # Gaussians: steps short enough to be undisturbed
VIEWS = (2, 4)
QUANTILE = 0.02


def train(program, data, run, ranks, views, count, steps):
    """Trains so many steps of one core a rank; processor seconds, and what the program has printed."""
    words = [program, "train", data, "-o", run, "-n", str(steps), "--views-per-step", str(views), "--init", "random",
             "--init-count", str(count), "--max-gaussians", str(count), "--densify-until", "0",
             "--resolution-schedule", "",
             "--sh-degree", "3", "--sh-degree-interval", "0", "--log-every", "1", "--eval-at", "", "--save-at", "",
             "--eval-renders", "0", "--checkpoint-every", "0", "--overwrite",
             "--profile", "-q"]
    # The work of a step stays what it is.
    for rate in ("position", "rotation", "scale", "opacity", "sh", "sh-rest"):
        words += [f"--{rate}-lr", "0", f"--{rate}-lr-final", "0"]
    # The launcher tells each rank its place.
    pin = ["sh", "-c", 'exec taskset -c "${OMPI_COMM_WORLD_LOCAL_RANK:-0}" "$@"', "sh"]
    launch = ["mpirun", "-n", str(ranks), "--oversubscribe", "--bind-to", "none", "--quiet"] if ranks > 1 else []
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
                   "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_btl_vader_single_copy_mechanism": "none"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run(launch + pin + words, env=environment, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, out


def of_one(program, data, run, views, count, steps):
    """Processor seconds of a step of one rank: what a long run takes more than a short one."""
    short, _ = train(program, data, run, 1, views, count, steps // 4)
    long, _ = train(program, data, run, 1, views, count, steps + steps // 4)
    return (long - short) / steps


def of_two(program, data, run, views, count, steps):
    """Seconds of the quicker steps of two ranks, and bytes that rank 0 has sent in one."""
    _, out = train(program, data, run, 2, views, count, steps)
    with open(os.path.join(run, "metrics.csv"), encoding="utf-8") as rows:
        times = sorted(1 / float(row["it_per_s"]) for row in csv.DictReader(rows) if int(row["iteration"]) > 5)
    line = next(line for line in out.splitlines() if "for each step" in line)
    return times[int(QUANTILE * len(times))], float(line.split(": ")[1].split()[0])


def solve(pairs):
    """Slope and offset of the line through (x, y) with the least sum of squares."""
    mean_x, mean_y = (statistics.fmean(column) for column in zip(*pairs))
    slope = sum((x - mean_x) * (y - mean_y) for x, y in pairs) / sum((x - mean_x) ** 2 for x, _ in pairs)
    return slope, mean_y - slope * mean_x


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?", default="build/release/bin/raysplats")
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--size", type=int, default=32)
    flags = parser.parse_args()
    program = str(pathlib.Path(flags.program).resolve())
    one, two, sent = {}, {}, {}
    with tempfile.TemporaryDirectory(prefix="raysplats_scaling_") as folder:
        data, run = os.path.join(folder, "data"), os.path.join(folder, "run")
        photos = ["--size", str(flags.size), "--train-views", "2", "--test-views", "1"]
        subprocess.run([program, "generate", data, *photos, "-q"], check=True)
        train(program, data, run, 1, 2, COUNTS[0], 3)  # compiles kernels
        for count in COUNTS:
            for views in VIEWS:
                one[count, views] = of_one(program, data, run, views, count, flags.steps)
                two[count, views], sent[count, views] = of_two(program, data, run, views, count, flags.steps)
    own, view, more = {}, {}, []
    for count in COUNTS:
        view[count], own[count] = solve([(views, one[count, views]) for views in VIEWS])
        for views in VIEWS:
            more.append((sent[count, views], two[count, views] - own[count] - view[count] * views / 2))
    per_byte, latency = solve(more)
    print(f"latency {1e3 * latency:.2f} ms a step, {1e-9 / per_byte:.2f} GB/s out and as much in")
    print("| Gaussians | every rank | a view | views a step | one rank | two ranks | predicted | bytes out |")
    print("|---|---|---|---|---|---|---|---|")
    errors = []
    for (count, views), measured in two.items():
        predicted = own[count] + view[count] * views / 2 + latency + per_byte * sent[count, views]
        errors.append(predicted / measured - 1)
        times = (own[count], view[count], one[count, views], measured, predicted)
        cells = [f"{1e3 * seconds:.1f} ms" for seconds in times]
        cells.insert(2, str(views))
        print(f"| {count} | {' | '.join(cells)} | {sent[count, views] / 1e6:.2f} MB |")
    print(f"largest error {100 * max(map(abs, errors)):.0f} %, mean {100 * statistics.fmean(map(abs, errors)):.0f} %")


if __name__ == "__main__":
    main()
