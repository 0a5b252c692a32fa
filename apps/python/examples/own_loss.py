# SPDX-License-Identifier: Apache-2.0
"""A loss of one's own in numpy: Gaussians are fitted to silhouettes alone, by the gradient of alpha."""

import numpy as np

import raysplats as rs

STEPS, RATE = 100, 0.05


def ball(mean, scale):
    g = rs.Gaussians.zeros(1)
    g.means[:], g.log_scales[:], g.opacities[:] = mean, np.log(scale), 3.0
    return g


def cameras():
    eyes = [(3, 0, 0.5), (0, 3, 0.5), (-2, -2, 1.5)]
    return [rs.Camera.look_at(eye, (0, 0, 0), (0, 0, 1), 40, 32, 45.0) for eye in eyes]


def main():
    context = rs.Context()
    tracer = rs.Tracer(context, rs.TraceOptions(hit_order="peak"))
    truth = rs.Model(context, ball((0.2, -0.15, 0.1), (0.25, 0.35, 0.3)))
    silhouettes = [tracer.render(truth, camera).alpha.copy() for camera in cameras()]

    g = ball((0, 0, 0), 0.2)
    model = rs.Model(context, g)
    losses = []
    for step in range(STEPS):
        loss = 0.0
        sums = {"means": 0.0, "log_scales": 0.0}
        for camera, silhouette in zip(cameras(), silhouettes):
            off = tracer.render(model, camera, differentiable=True).alpha - silhouette
            # Charbonnier's: quadratic for small errors, linear for large ones.
            length = np.sqrt(off**2 + 0.01**2)
            loss += (length - 0.01).mean()
            gradient = np.zeros((*off.shape, 4), np.float32)
            gradient[..., 3] = off / length / off.size
            found = tracer.backward(model, gradient).parameters
            for name in sums:
                sums[name] = sums[name] + getattr(found, name)
        for name, total in sums.items():
            view = getattr(g, name)
            view -= RATE * (1 - step / STEPS) * total / (np.linalg.norm(total) + 1e-12)
        model.assign(g)
        losses.append(loss)
    print(f"loss {losses[0]:.4f} -> {losses[-1]:.4f}, mean {g.means[0].round(3)}, "
          f"standard deviations {np.exp(g.log_scales[0]).round(3)}")
    assert losses[-1] < 0.1 * losses[0]
    assert np.abs(g.means[0] - (0.2, -0.15, 0.1)).max() < 0.02


if __name__ == "__main__":
    main()
