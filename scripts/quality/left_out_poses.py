#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How well photos tell their poses, for docs/training.md (poses): a data set (transforms_train.json, as of `raysplats
generate`) in three parts; each part's photos are moved to where the picture of a model that is trained on the other two
fits them best (least squares, as `eval --align`). Prints how far the poses are from those of the data set, before and
after, less the turn, shift and scale that all have in common: medians, in degrees and percent of the extent.

usage: scripts/quality/left_out_poses.py DATA START OUT        (OUT is made anew; needs the Python module and Pillow)
START is where the poses begin: DATA/transforms_train.json, which are exact, or RUN/cameras_refined.json."""
import copy
import json
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import raysplats as rs

from disturb import rotation, without_common_part

PROGRAM = pathlib.Path(__file__).parents[2] / "build/release/bin/raysplats"
PARTS, ITERATIONS, STEP = 3, 1000, 1e-3
MOST_STEPS, LEAST_GAIN = 12, 1e-4


def name_of(path):
    """The frame that a file_path means, with ./ and extension or without."""
    return pathlib.PurePosixPath(path).with_suffix("").as_posix()


def poses_of(file):
    return {name_of(f["file_path"]): np.array(f["transform_matrix"], float) for f in json.loads(file.read_text())["frames"]}


def turn_between(found, true):
    r = found[:3, :3] @ true[:3, :3].T
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    length = np.linalg.norm(axis)
    return axis / length * np.arccos(np.clip((np.trace(r) - 1) / 2, -1, 1)) if length > 0 else axis


def report(what, found, true):
    centers = np.array([true[n][:3, 3] for n in true])
    middle = centers.mean(0)
    extent = 1.1 * np.linalg.norm(centers - middle, axis=1).max()
    turns = np.array([turn_between(found[n], true[n]) for n in true])
    shifts = np.array([(found[n] - true[n])[:3, 3] / extent for n in true])
    turns, shifts = without_common_part(turns, shifts, (centers - middle) / extent)
    print(f"{what}: {np.median(np.degrees(np.linalg.norm(turns, axis=1))):.3f} degrees, "
          f"{100 * np.median(np.linalg.norm(shifts, axis=1)):.3f} %")


def moved(pose, by):
    """Turned by by[:3] about the world's axes, shifted by by[3:]."""
    out = pose.copy()
    if np.any(by[:3]):
        out[:3, :3] = rotation(by[:3]) @ pose[:3, :3]
    out[:3, 3] += by[3:]
    return out


def aligned(render, photo, pose):
    """Levenberg and Marquardt's steps by central differences."""
    steps = np.diag(STEP * np.array([1] * 3 + [np.linalg.norm(pose[:3, 3])] * 3))

    def lacking(at):
        return (photo - render(at)).ravel()

    error, damping = lacking(pose), 1e-3
    for _ in range(MOST_STEPS):
        slopes = np.stack([(lacking(moved(pose, s)) - lacking(moved(pose, -s))) / (2 * s.sum()) for s in steps], 1)
        square, right, now = slopes.T @ slopes, -slopes.T @ error, error @ error
        while damping < 1e3:
            next_pose = moved(pose, np.linalg.solve(square + damping * np.diag(np.diag(square)), right))
            next_error = lacking(next_pose)
            if next_error @ next_error < now:
                break
            damping *= 10
        else:
            break
        pose, error, damping = next_pose, next_error, 0.1 * damping
        if now - error @ error < LEAST_GAIN * now:
            break
    return pose


def train(data, folder, poses, left_out):
    """A run on all photos but those, which are its held-out views. Returns the data set and the model's file."""
    (folder / "data").mkdir(parents=True)
    (folder / "data/train").symlink_to((data / "train").resolve())
    whole = json.loads((data / "transforms_train.json").read_text())
    for part in ("train", "test"):
        frames = [dict(f, transform_matrix=poses[name_of(f["file_path"])].tolist()) for f in whole["frames"]
                  if (name_of(f["file_path"]) in left_out) == (part == "test")]
        (folder / f"data/transforms_{part}.json").write_text(json.dumps(dict(whole, frames=frames)))
    run = folder / "run"
    subprocess.run([PROGRAM, "train", folder / "data", "-o", run, "-n", str(ITERATIONS), "-q"], check=True,
                   stdout=subprocess.DEVNULL)
    return rs.Dataset.load(str(folder / "data")), str(run / f"point_cloud/iteration_{ITERATIONS}/point_cloud.ply")


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    data, start, out = map(pathlib.Path, sys.argv[1:])
    if out.resolve() == data.resolve():
        sys.exit("left_out_poses.py: OUT is DATA, which is not changed: name another folder")
    shutil.rmtree(out, ignore_errors=True)
    true, poses = poses_of(data / "transforms_train.json"), poses_of(start)
    report("before", poses, true)
    context, found = rs.Context(), {}
    for part in range(PARTS):
        left_out = list(true)[part::PARTS]
        dataset, file = train(data, out / str(part), poses, left_out)
        options = rs.TraceOptions.load(file)
        options.background = (0, 0, 0)
        model, tracer = rs.Model(context, rs.Gaussians.load(file)), rs.Tracer(context, options)
        for view in (v for v in dataset.views if v.test):

            def render(pose, camera=copy.deepcopy(view.camera)):
                turn = (pose[:3, :3] @ np.diag([1, -1, -1])).T
                camera.rotation, camera.translation = turn, -turn @ pose[:3, 3]
                return np.asarray(tracer.render(model, camera).rgba, np.float64)

            name = next(n for n in left_out if pathlib.Path(view.image_path).with_suffix("").as_posix().endswith(n))
            photo = np.asarray(rs.read_image(view.image_path), np.float64)
            photo[..., :3] *= photo[..., 3:]
            found[name] = aligned(render, photo, poses[name])
    report("after", found, true)


if __name__ == "__main__":
    main()
