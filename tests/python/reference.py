# SPDX-License-Identifier: Apache-2.0
"""docs/model.md in double precision, ray by ray: what the module's results are compared with.

`xp` is numpy, or torch for gradients by autograd; only what both have is used.
"""

SH_0 = 0.28209479177387814
SH_1 = 0.4886025119029199
SH_2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005)
SH_2_LAST = 0.5462742152960396
NAMES = ("means", "quaternions", "log_scales", "opacities", "sh")


def rotation(xp, q):
    """(3, 3) of a quaternion of any length, real part first."""
    q = q / xp.sqrt((q * q).sum())
    w, x, y, z = q[0], q[1], q[2], q[3]
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return xp.stack([xp.stack(row, 0) for row in rows], 0)


def color(xp, sh, direction):
    """RGB of coefficients (K, 3), K up to 9, towards a direction."""
    d = direction / xp.sqrt((direction * direction).sum())
    x, y, z = d[0], d[1], d[2]
    out = 0.5 + SH_0 * sh[0]
    if len(sh) > 1:
        out = out + SH_1 * (-y * sh[1] + z * sh[2] - x * sh[3])
    if len(sh) > 4:
        out = out + SH_2[0] * x * y * sh[4] + SH_2[1] * y * z * sh[5]
        out = out + SH_2[2] * (2 * z * z - x * x - y * y) * sh[6] + SH_2[1] * x * z * sh[7]
        out = out + SH_2_LAST * (x * x - y * y) * sh[8]
    return out * (out > 0)


def whitened(xp, p):
    """M = S^-1 R^T of every Gaussian."""
    out = []
    for q, s in zip(p["quaternions"], p["log_scales"]):
        out.append(xp.exp(-s)[:, None] * rotation(xp, q).T)
    return out


def trace(xp, p, origin, direction, quantile, peak=False, from_origin=False):
    """Colour over black and alpha of one ray; `p` has the arrays of Gaussians by NAMES."""
    hits = []
    for i, m in enumerate(whitened(xp, p)):
        o = m @ (origin - p["means"][i])
        d = m @ direction
        dd = (d * d).sum()
        depth = -(o * d).sum() / dd
        v = o + depth * d
        delta = (v * v).sum()
        if delta > quantile:
            continue
        key = depth if peak else depth - xp.sqrt((quantile - delta) / dd)
        if key < 0:
            continue
        alpha = xp.exp(-0.5 * delta) / (1 + xp.exp(-p["opacities"][i]))
        seen = p["means"][i] - origin if from_origin else direction
        hits.append((float(key), i, alpha, color(xp, p["sh"][i], seen)))
    light, total = 1.0, 0.0 * direction
    for _, _, alpha, rgb in sorted(hits, key=lambda hit: hit[:2]):
        total = total + light * alpha * rgb
        light = light * (1 - alpha)
        if light < 1e-4:
            break
    return total, 1 - light


def camera_rays(xp, camera, rotation_matrix, center):
    """World directions of the pixels of a pinhole camera in reading order, from `center`."""
    out = []
    for j in range(camera.height):
        for i in range(camera.width):
            x = (i + 0.5 - camera.cx) / camera.fx
            y = (j + 0.5 - camera.cy) / camera.fy
            out.append(rotation_matrix.T @ (xp.stack([x + 0 * center[0], y + 0 * center[0], 1 + 0 * center[0]], 0)))
    return out
