# SPDX-License-Identifier: Apache-2.0
"""A training loop in PyTorch: train.py DATA START.ply OUTPUT.ply [ITERATIONS]

Trains the Gaussians of START.ply on a data set's photos, which have no masks, with the loss, the learning rates and the optimiser of
`raysplats train`, without its density control.
"""

import sys

import numpy as np
import torch

import raysplats as rs
import raysplats.torch


def ssim(image, photo, window=11, sigma=1.5):
    """Structural similarity of (height, width, 3), zeros beyond the borders."""
    line = torch.exp(-((torch.arange(window) - window // 2) ** 2) / (2 * sigma**2))
    kernel = torch.outer(line, line).div(line.sum() ** 2).expand(3, 1, window, window).contiguous()
    x, y = (each.permute(2, 0, 1)[None] for each in (image, photo))
    products = torch.cat([x, y, x * x, y * y, x * y])
    mx, my, xx, yy, xy = torch.nn.functional.conv2d(products, kernel, padding=window // 2, groups=3)
    c1, c2 = 0.01**2, 0.03**2
    similar = (2 * mx * my + c1) * (2 * (xy - mx * my) + c2)
    return (similar / ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2))).mean()


def train(renderer, dataset, start, iterations):
    views = [dataset.views[i] for i in dataset.indices("train")]
    # Cut-out photos stand before black, as the renderer's Gaussians do.
    photos = [torch.from_numpy(rgba[..., :3] * rgba[..., 3:]) for rgba in (view.picture() for view in views)]
    centers = np.array([view.camera.center for view in views])
    extent = 1.1 * np.linalg.norm(centers - centers.mean(0), axis=1).max()
    rates = {
        "means": (5e-4 * extent, 5e-6 * extent), "quaternions": (3e-3, 1e-3), "log_scales": (4e-2, 5e-3),
        "opacities": (1e-1, 3e-2), "sh": (1e-2, 2.5e-3),
    }
    parameters = {name: torch.from_numpy(getattr(start, name).copy()).requires_grad_() for name in rates}
    optimizer = torch.optim.Adam([{"params": [each]} for each in parameters.values()], lr=0.0, eps=1e-15)
    order = []
    for iteration in range(iterations):
        for group, (first, last) in zip(optimizer.param_groups, rates.values()):
            group["lr"] = first * (last / first) ** (iteration / max(1, iterations - 1))
        order = order or torch.randperm(len(views)).tolist()
        i = order.pop()
        color = renderer.render(views[i].camera, **parameters).rgba[..., :3]
        loss = 0.8 * (color - photos[i]).abs().mean() + 0.2 * (1 - ssim(color, photos[i]))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return rs.Gaussians(**{name: each.detach().numpy() for name, each in parameters.items()})


def main(data, start, output, iterations="1000"):
    torch.manual_seed(42)
    options = rs.TraceOptions(hit_order="peak", adaptive_radius=True)
    renderer = raysplats.torch.Renderer(options=options)
    dataset = rs.Dataset.load(data)
    trained = train(renderer, dataset, rs.Gaussians.load(start), int(iterations))
    trained.save(output, options)
    model = rs.Model(renderer.context, trained)
    report = rs.evaluate(lambda camera: renderer.tracer.render(model, camera).rgba, dataset)
    print(f"{report.mean.psnr:.2f} dB on {len(report.images)} views held out")


if __name__ == "__main__":
    main(*sys.argv[1:])
