# SPDX-License-Identifier: Apache-2.0
"""The programs of apps/python/examples, which check what they print."""

import pathlib
import subprocess
import sys

import numpy as np
import pytest

import photos
import raysplats as rs

EXAMPLES = pathlib.Path(__file__).parents[2] / "apps/python/examples"


def run(name, *arguments):
    return subprocess.run(
        [sys.executable, EXAMPLES / name, *map(str, arguments)],
        check=True, stdout=subprocess.PIPE, text=True, timeout=600,
    ).stdout


@pytest.mark.parametrize("name", ["own_loss.py", "own_camera.py", "mirror.py", "pose.py"])
def test_example(name):
    assert run(name)


def test_a_loop_in_pytorch_trains_as_the_trainer_does(context, tmp_path):
    pytest.importorskip("torch", reason="no PyTorch: apt-get install python3-torch")
    pytest.importorskip("PIL")
    data = photos.take(context, tmp_path / "photos")
    rng = np.random.default_rng(0)
    start = rs.Gaussians.zeros(300)
    start.means[:] = rng.uniform(-0.9, 0.9, (300, 3)) * (1, 1, 0.4)
    start.log_scales[:] = np.log(0.08)
    start.opacities[:] = -1.0
    start.sh[:] = rng.uniform(-1, 1, (300, 1, 3))
    start.save(tmp_path / "start.ply")
    options = rs.TrainOptions(
        iterations=400, init=tmp_path / "start.ply", sh_degree=0, densify_until=0, replace_until=0,
        resolution_schedule=[], footprint=0, background="0,0,0", eval_at=[], save_at=[],
    )
    trainer = rs.Trainer(context, rs.Dataset.load(data), tmp_path / "run", options)
    expected = trainer.run().evaluations[-1].psnr
    said = run("train.py", data, tmp_path / "start.ply", tmp_path / "trained.ply", 400)
    assert len(rs.Gaussians.load(tmp_path / "trained.ply")) == 300
    assert expected > 35
    assert float(said.split()[0]) > expected - 0.1
