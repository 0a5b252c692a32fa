#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bytes that ranks would send each other if each held a part of the model (docs/scaling.md, "A model larger than one
device"). The Gaussians of a model are split into as many as asked for, drawn from their parents, put along a Morton
curve and cut into one run a rank; the picture of a view is cut into bands of rows, one a rank, and a Gaussian goes to
every band that the disc around its mean meets, of three times its longest axis.
usage: PYTHON scripts/bench/shards.py MODEL CAMERAS [--count 3000000]     with numpy and the raysplats module"""
import argparse

import numpy as np
import raysplats as rs

LINE, BOUNDS, GRADIENT = 64, 32, 64  # bytes: RsLine, RsViewBounds, a gradient line
PARAMETERS = 4 * (14 + 3 * 16)  # of a Gaussian of degree 3, as data-parallel ranks add them


def split(model, count, rng):
    """Means and longest axes of `count` Gaussians that look like those of `model` from afar."""
    parts = -(-count // len(model))
    scales = np.exp(model.log_scales)
    q = model.quaternions / np.linalg.norm(model.quaternions, axis=1, keepdims=True)
    w, v = q[:, :1], q[:, 1:]
    means, longest = [], []
    for _ in range(parts):
        offset = rng.normal(size=scales.shape).astype(np.float32) * scales
        turned = 2 * np.cross(v, offset)
        means.append(model.means + offset + w * turned + np.cross(v, turned))
        longest.append(scales.max(axis=1) / parts ** (1 / 3))
    return np.concatenate(means)[:count], np.concatenate(longest)[:count]


def morton(means):
    """The order of means along a Morton curve over the box of nearly all of them."""
    low, high = np.quantile(means, (0.005, 0.995), axis=0)
    cells = (np.clip((means - low) / (high - low), 0, 1) * 1023).astype(np.uint64)
    code = np.zeros(len(means), np.uint64)
    for bit in range(10):
        for axis in range(3):
            code |= (cells[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def bands_met(camera, means, longest, ranks):
    """First and last band of every Gaussian that the picture meets, and which ones those are."""
    point = means @ np.asarray(camera.rotation, np.float32).T + np.asarray(camera.translation, np.float32)
    depth = point[:, 2]
    radius = 3 * longest
    front = depth > radius
    z = np.where(front, depth, 1)
    x, y = camera.fx * point[:, 0] / z + camera.cx, camera.fy * point[:, 1] / z + camera.cy
    reach = max(camera.fx, camera.fy) * radius / z
    seen = front & (x + reach > 0) & (x - reach < camera.width) & (y + reach > 0) & (y - reach < camera.height)
    band = camera.height / ranks
    first = np.clip((y[seen] - reach[seen]) // band, 0, ranks - 1)
    last = np.clip((y[seen] + reach[seen]) // band, 0, ranks - 1)
    return seen, first.astype(int), last.astype(int)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("cameras")
    parser.add_argument("--count", type=int, default=3_000_000)
    flags = parser.parse_args()
    means, longest = split(rs.Gaussians.load(flags.model), flags.count, np.random.default_rng(1))
    order = morton(means)
    means, longest = means[order], longest[order]
    cameras = rs.read_cameras(flags.cameras)
    print(f"{len(means)} Gaussians, {len(cameras)} views; data parallel: "
          f"{PARAMETERS * len(means) / 1e6:.0f} MB to add a step")
    print("| ranks | seen by a view | foreign to their band | most for one band | MB forward | MB back |")
    print("|---|---|---|---|---|---|")
    for ranks in (2, 4, 8, 64):
        owner = np.arange(len(means)) * ranks // len(means)
        share, foreign, most = [], [], []
        for camera in cameras:
            seen, first, last = bands_met(camera, means, longest, ranks)
            own = owner[seen]
            wanted = np.zeros(ranks)
            for band in range(ranks):
                wanted[band] = np.count_nonzero((first <= band) & (band <= last) & (own != band))
            share.append(seen.mean())
            foreign.append(wanted.sum())
            most.append(wanted.max())
        mean = np.mean(foreign)
        print(f"| {ranks} | {100 * np.mean(share):.0f} % | {mean / 1e6:.2f} M | {np.mean(most) / 1e6:.2f} M | "
              f"{(LINE + BOUNDS) * mean / 1e6:.0f} | {GRADIENT * mean / 1e6:.0f} |")


if __name__ == "__main__":
    main()
