# SPDX-License-Identifier: Apache-2.0
"""A camera that is no pinhole: a push-broom scanner, whose every row is taken from another place.

Its rays are made here; from the scan the colours of Gaussians are found again, and so is the
scanner's speed, through the gradients of the rays' origins.
"""

import numpy as np

import raysplats as rs

ROWS, COLUMNS = 48, 40


def scan_rays(speed):
    """Rays of all rows: the scanner moves along y while its line of pixels looks down z."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS].astype(np.float32)
    origins = np.stack([0 * x, speed * (y / (ROWS - 1) - 0.5), 0 * x - 3], axis=-1)
    directions = np.stack([(x - COLUMNS / 2) / COLUMNS * 0.8, 0 * x, 0 * x + 1], axis=-1)
    return origins.reshape(-1, 3), directions.reshape(-1, 3)


def scene():
    rng = np.random.default_rng(0)
    g = rs.Gaussians.zeros(20)
    g.means[:] = rng.uniform(-0.8, 0.8, (20, 3))
    g.log_scales[:] = np.log(rng.uniform(0.12, 0.3, (20, 3)))
    g.opacities[:] = rng.uniform(0, 2, 20)
    g.sh[:] = rng.uniform(-1.2, 1.2, (20, 1, 3))
    return g


def main():
    context = rs.Context()
    tracer = rs.Tracer(context)
    truth = scene()
    model = rs.Model(context, truth)
    scanned = tracer.trace(model, *scan_rays(2.0)).color.copy()

    # The speed: how an origin moves with it is the chain rule's business.
    speed = 1.8
    along = np.linspace(-0.5, 0.5, ROWS, dtype=np.float32).repeat(COLUMNS)
    for step in range(60):
        seen = tracer.trace(model, *scan_rays(speed), differentiable=True)
        gradients = tracer.backward_rays(model, seen.color - scanned)
        speed -= 0.02 * 0.94**step * np.sign((gradients.origins[:, 1] * along).sum())
    print(f"speed {speed:.4f} (2)")
    assert abs(speed - 2.0) < 0.005

    # The colours, by Adam.
    g = scene()
    g.sh[:] = 0
    model.assign(g)
    rays = scan_rays(2.0)
    errors = []
    first, second = np.zeros_like(g.sh), np.zeros_like(g.sh)
    for step in range(1, 121):
        seen = tracer.trace(model, *rays, differentiable=True)
        off = seen.color - scanned
        errors.append(float((off**2).mean()))
        gradient = tracer.backward_rays(model, off).parameters.sh
        first = 0.9 * first + 0.1 * gradient
        second = 0.99 * second + 0.01 * gradient**2
        g.sh[:] -= 0.1 * first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.99**step)) + 1e-12)
        model.assign(g)
    print(f"squared error {errors[0]:.5f} -> {errors[-1]:.7f}")
    assert errors[-1] < 0.01 * errors[0]


if __name__ == "__main__":
    main()
