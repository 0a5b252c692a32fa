# SPDX-License-Identifier: Apache-2.0
"""Photos of a few known Gaussians, as a data set on disk."""

import math

import numpy as np

import raysplats as rs


def ring():
    """Twelve balls on a ring, in colours around the wheel."""
    g = rs.Gaussians.zeros(12)
    angle = np.arange(12) * (2 * math.pi / 12)
    g.means[:] = np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), 0 * angle], axis=1)
    g.log_scales[:] = math.log(0.12)
    g.sh[:] = 1.5 * np.cos(angle[:, None, None] + 2.0944 * np.arange(3))
    g.opacities[:] = 3.0
    return g


def cameras(count=16, width=48, height=40, focal=56.0):
    out = []
    for i in range(count):
        angle = 2 * math.pi * i / count
        eye = (3 * math.cos(angle), 3 * math.sin(angle), 1.2)
        out.append(rs.Camera.look_at(eye, (0, 0, 0), (0, 0, 1), width, height, focal))
        out[-1].name = f"images/view_{i:02}.png"
    return out


def take(context, folder):
    """images/view_NN.png and transforms.json."""
    (folder / "images").mkdir(parents=True)
    model, tracer = rs.Model(context, ring()), rs.Tracer(context)
    views = cameras()
    for camera in views:
        picture = tracer.render(model, camera)
        rs.write_image(folder / camera.name, np.ascontiguousarray(picture.color))
    rs.write_cameras(folder / "transforms.json", views)
    return folder
