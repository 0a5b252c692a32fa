#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures what the model of a training step among ranks is made of, and how far it is off (docs/scaling.md):
t(R) = own + views B / R + latency + bytes / bandwidth.
`own` (what every rank does) and `views` (for each view) are fitted to one rank, linear in the number of Gaussians.
Latency and bandwidth come from apps/timing/rank_times, two ranks that add rows of numbers and do
nothing else. So no number of the model has seen a step of two ranks, one core each, which it is then compared with. Times
are those of a clock, a low quantile over the steps of a run; on a machine with other work they mean something where
nothing takes a core away: chrt -f 1 PYTHON ... (a minute or two, in which the other work stands still).
Every step takes the same two photos, once or twice.
usage: PYTHON scripts/bench/scaling.py [PROGRAM] [--rank-times PROGRAM] [--steps N] [--size PIXELS]"""
import argparse
import csv
import os
import pathlib
import statistics
import subprocess
import tempfile

import numpy as np

COUNTS = (500, 1500, 4000, 12000)  # Gaussians: steps short enough to be undisturbed
VIEWS = (2, 4)
QUANTILE = 0.1


def one_core_each(ranks, words):
    """What a program prints that so many ranks run."""
    # The launcher tells each rank its place.
    pin = ["sh", "-c", 'exec taskset -c "${OMPI_COMM_WORLD_LOCAL_RANK:-0}" "$@"', "sh"]
    launch = ["mpirun", "-n", str(ranks), "--oversubscribe", "--bind-to", "none", "--quiet"] if ranks > 1 else []
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
                   "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_btl_vader_single_copy_mechanism": "none"}
    return subprocess.run(launch + pin + words, env=environment, check=True, capture_output=True, text=True).stdout


def messages(program):
    """Of two ranks: pairs of bytes out and seconds, of plain messages and of sums."""
    rows = list(csv.DictReader(one_core_each(2, [program]).splitlines()))
    return ([(float(row["bytes"]), float(row["seconds"])) for row in rows],
            [(float(row["sum_bytes"]), float(row["sum_seconds"])) for row in rows])


def train(program, data, run, ranks, views, count, steps):
    """Trains so many steps of one core a rank; seconds of the quicker steps, and bytes that rank 0 has sent in one."""
    words = [program, "train", data, "-o", run, "-n", str(steps), "--views-per-step", str(views), "--init", "random",
             "--init-count", str(count), "--max-gaussians", str(count), "--densify-until", "0",
             "--resolution-schedule", "",
             "--sh-degree", "3", "--sh-degree-interval", "0", "--log-every", "1", "--eval-at", "", "--save-at", "",
             "--eval-renders", "0", "--checkpoint-every", "0", "--overwrite",
             "--profile", "-q"]
    # The work of a step stays what it is.
    for rate in ("position", "rotation", "scale", "opacity", "sh", "sh-rest"):
        words += [f"--{rate}-lr", "0", f"--{rate}-lr-final", "0"]
    out = one_core_each(ranks, words)
    with open(os.path.join(run, "metrics.csv"), encoding="utf-8") as rows:
        times = sorted(1 / float(row["it_per_s"]) for row in csv.DictReader(rows) if int(row["iteration"]) > 5)
    lines = [line for line in out.splitlines() if "for each step" in line]
    return times[int(QUANTILE * len(times))], float(lines[0].split(": ")[1].split()[0]) if lines else 0.0


def fit(columns, measured):
    """The factors of the columns whose sum has the least relative errors."""
    matrix, times = np.array(columns, float).T, np.array(measured)
    return np.linalg.lstsq(matrix / times[:, None], np.ones(len(times)), rcond=None)[0]


def of_messages(name, pairs):
    """Seconds a byte and latency, by least relative errors; prints them."""
    sizes, times = zip(*pairs)
    latency, per_byte = fit([[1] * len(pairs), sizes], times)
    errors = [abs((latency + per_byte * size) / seconds - 1) for size, seconds in pairs]
    print(f"{name}: latency {1e6 * latency:.1f} µs, {1e-9 / per_byte:.2f} GB/s out and as much in; mean error "
          f"{100 * statistics.fmean(errors):.0f} %")
    return per_byte, latency


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?", default="build/release/bin/raysplats")
    parser.add_argument("--rank-times", default="build/release/bin/rank_times")
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--size", type=int, default=32)
    flags = parser.parse_args()
    program, rank_times = (str(pathlib.Path(path).resolve()) for path in (flags.program, flags.rank_times))
    plain, sums = messages(rank_times)
    for size, seconds in plain:
        print(f"{size:10.0f} bytes: {1e6 * seconds:9.1f} µs, {1e-9 * size / seconds:5.2f} GB/s")
    of_messages("messages", plain)
    per_byte, latency = of_messages("sums", sums)
    one, two, sent = {}, {}, {}
    with tempfile.TemporaryDirectory(prefix="raysplats_scaling_") as folder:
        data, run = os.path.join(folder, "data"), os.path.join(folder, "run")
        photos = ["--size", str(flags.size), "--train-views", "2", "--test-views", "1"]
        subprocess.run([program, "generate", data, *photos, "-q"], check=True)
        train(program, data, run, 1, 2, COUNTS[0], 10)  # compiles kernels
        for count in COUNTS:
            for views in VIEWS:
                one[count, views] = min(
                    train(program, data, run, 1, views, count, flags.steps)[0] for _ in range(flags.repeats))
                two[count, views], sent[count, views] = min(
                    train(program, data, run, 2, views, count, flags.steps) for _ in range(flags.repeats))
    cases = list(one)
    parts = fit([[1] * len(cases), [n for n, _ in cases], [v for _, v in cases], [n * v for n, v in cases]],
                [one[case] for case in cases])
    own = {n: parts[0] + parts[1] * n for n in COUNTS}
    view = {n: parts[2] + parts[3] * n for n in COUNTS}
    fitted = {(n, v): own[n] + view[n] * v for n, v in cases}
    print(f"one rank: mean error {100 * statistics.fmean(abs(fitted[c] / one[c] - 1) for c in cases):.0f} %")
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
