# SPDX-License-Identifier: Apache-2.0
"""An inverse problem through a mirror: where is a ball that the camera sees in the mirror alone?"""

import numpy as np

import raysplats as rs


def ball(mean):
    g = rs.Gaussians.zeros(1)
    g.means[:], g.log_scales[:], g.opacities[:] = mean, np.log(0.5), 2.0
    g.sh[:] = (1.5, 0.2, -1.0)
    return g


def main():
    context = rs.Context()
    corners = np.array([[-3, -3, 2], [3, -3, 2], [3, 3, 2], [-3, 3, 2]], np.float32)
    mirrors = rs.Mirrors(
        meshes=[rs.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))],
        materials=[rs.Material(kind="mirror", color=(0.9, 0.9, 0.9))],
    )
    options = rs.TraceOptions(hit_order="peak", background=(0.1, 0.1, 0.1))
    tracer = rs.Tracer(context, options, mirrors=mirrors)
    # The camera looks at the mirror; the ball is behind its back.
    camera = rs.Camera.look_at((0, 0, 0), (0, 0, 1), (0, -1, 0), 60, 48, 50.0)
    place = np.array([0.4, -0.3, -2.5], np.float32)
    photo = tracer.render(rs.Model(context, ball(place)), camera).rgba.copy()
    assert photo[..., 0].max() > 0.5, "the mirror shows the ball"

    g = ball((0, 0, -2))
    model = rs.Model(context, g)
    first = np.zeros(3)
    second = np.zeros(3)
    for step in range(1, 251):
        off = tracer.render(model, camera, differentiable=True).rgba - photo
        gradient = tracer.backward(model, (2 * off / off.size).astype(np.float32)).parameters.means[0]
        # Adam.
        first = 0.9 * first + 0.1 * gradient
        second = 0.99 * second + 0.01 * gradient**2
        move = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.99**step)) + 1e-12)
        g.means[0] -= 0.03 * 0.98**step * move
        model.assign(g)
    print(f"the ball is at {g.means[0].round(3)}, in truth at {place}")
    assert np.abs(g.means[0] - place).max() < 0.02


if __name__ == "__main__":
    main()
