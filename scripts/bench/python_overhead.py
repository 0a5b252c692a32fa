#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times frames from Python and from C++ in turn, in one run, and prints their ratio (docs/python.md).
Runs where the module is installed: build/python-venv/bin/python scripts/bench/python_overhead.py
usage: scripts/bench/python_overhead.py [FRAME_TIMES] [--rounds N] [--gaussians N] [--width N] [--height N]"""
import argparse
import os
import statistics
import subprocess
import tempfile
import time

import numpy as np
import raysplats as rs


def ball(count):
    """Gaussians of all colours in the unit ball, the same for a count."""
    rng = np.random.default_rng(1)
    means = rng.normal(size=(count, 3))
    means *= (rng.uniform(size=(count, 1)) ** (1 / 3)) / np.linalg.norm(means, axis=1, keepdims=True)
    size = 1.2 * count ** (-1 / 3)
    arrays = {"means": means, "quaternions": rng.normal(size=(count, 4)),
              "log_scales": np.log(rng.uniform(0.3, 1, (count, 3)) * size), "opacities": rng.uniform(-3, 2, count),
              "sh": rng.normal(scale=0.3, size=(count, 16, 3))}
    return rs.Gaussians(**{name: array.astype(np.float32) for name, array in arrays.items()})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frame_times", nargs="?", default="build/release/bin/frame_times")
    parser.add_argument("--rounds", type=int, default=101)
    parser.add_argument("--gaussians", type=int, default=20000)
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--height", type=int, default=270)
    flags = parser.parse_args()
    context = rs.Context()
    gaussians = ball(flags.gaussians)
    model, tracer = rs.Model(context, gaussians), rs.Tracer(context)
    camera = rs.Camera.look_at((0, 0, -4), (0, 0, 0), (0, -1, 0), flags.width, flags.height, 1.0 * flags.width)
    ones = np.ones((flags.height, flags.width, 4), np.float32)

    def from_python(way):
        begin = time.perf_counter()
        tracer.render(model, camera, differentiable=way == "backward")
        if way == "backward":
            tracer.backward(model, ones)
        return time.perf_counter() - begin

    with tempfile.TemporaryDirectory(prefix="raysplats_overhead_") as folder:
        path = os.path.join(folder, "model.ply")
        gaussians.save(path)
        with subprocess.Popen([flags.frame_times, path, str(flags.width), str(flags.height)], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, text=True, bufsize=1) as program:

            def from_cpp(way):
                program.stdin.write(way + "\n")
                return float(program.stdout.readline())

            print("| | Python | C++ | ratio |\n|---|---|---|---|")
            for way, name in (("forward", "forward"), ("backward", "forward and backward")):
                for _ in range(3):  # kernels, and the room of buffers
                    from_python(way)
                    from_cpp(way)
                times = []
                for number in range(flags.rounds):
                    if number % 2:  # neither always comes first
                        cpp = from_cpp(way)
                        times.append((from_python(way), cpp))
                    else:
                        times.append((from_python(way), from_cpp(way)))
                python, cpp = (statistics.median(column) for column in zip(*times))
                print(f"| {name} | {1e3 * python:.1f} ms | {1e3 * cpp:.1f} ms | {python / cpp:.3f} |")
            program.stdin.close()


if __name__ == "__main__":
    main()
