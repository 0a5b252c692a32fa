# SPDX-License-Identifier: Apache-2.0
"""Pose refinement: a camera that is a few degrees and a tenth of a unit off finds its photo again."""

import numpy as np

import raysplats as rs


def scene():
    rng = np.random.default_rng(1)
    g = rs.Gaussians.zeros(60)
    g.means[:] = rng.uniform(-0.9, 0.9, (60, 3))
    g.log_scales[:] = np.log(rng.uniform(0.08, 0.25, (60, 3)))
    g.opacities[:] = rng.uniform(0, 3, 60)
    g.sh[:] = rng.uniform(-1.5, 1.5, (60, 1, 3))
    return g


def turned(vector):
    """The rotation about a vector by its length (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def moved(camera, center, rotation):
    camera.rotation = rotation
    camera.translation = -rotation @ center


def main():
    context = rs.Context()
    tracer = rs.Tracer(context, rs.TraceOptions(hit_order="peak"))
    model = rs.Model(context, scene())
    camera = rs.Camera.look_at((1.4, -1.0, 0.6), (0, 0, 0), (0, 0, 1), 64, 48, 36.0)
    true_center, true_rotation = np.array(camera.center), np.array(camera.rotation)
    photo = tracer.render(model, camera).rgba.copy()

    center = true_center + (0.06, -0.05, 0.06)
    rotation = turned(np.array([0.03, -0.04, 0.02])) @ true_rotation
    first, second = np.zeros(6), np.zeros(6)
    for step in range(1, 401):
        moved(camera, center, rotation)
        off = tracer.render(model, camera, differentiable=True).rgba - photo
        gradients = tracer.backward(model, (2 * off / off.size).astype(np.float32))
        gradient = np.concatenate([gradients.camera_center, gradients.camera_rotation])
        # Adam on the centre and on a small turn about it, in the camera's axes.
        first = 0.9 * first + 0.1 * gradient
        second = 0.99 * second + 0.01 * gradient**2
        move = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.99**step)) + 1e-12)
        move *= 0.01 * 0.985**step
        center = center - move[:3]
        rotation = turned(-move[3:]) @ rotation
    off_center = np.linalg.norm(center - true_center)
    off_angle = np.degrees(np.linalg.norm(rotation @ true_rotation.T - np.eye(3)) / np.sqrt(2))
    print(f"the centre is {off_center:.5f} off (0.098 before), the axes {off_angle:.4f} degrees (3.1 before)")
    assert off_center < 0.003 and off_angle < 0.1


if __name__ == "__main__":
    main()
