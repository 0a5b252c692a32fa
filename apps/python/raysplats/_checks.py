# SPDX-License-Identifier: Apache-2.0
"""Checks of what callers give for tensors: every refusal is one sentence that names the argument."""

import torch

from . import _raysplats as rs

# What rounding, of half precision too, does to a pose.
_POSE_TOLERANCE = 1e-3


def require_tensor(name, given, dtype=None):
    """Refuses what is no tensor of real numbers that lie in memory one by one, or of another type."""
    wanted = "" if dtype is None else " of float32"
    if not isinstance(given, torch.Tensor):
        remedy = ": torch.from_numpy() makes one" if type(given).__name__ == "ndarray" else ""
        raise TypeError(f"{name} has to be a tensor{wanted}, not {type(given).__name__}{remedy}")
    if given.layout != torch.strided or given.device.type == "meta":
        kind = "meta" if given.device.type == "meta" else str(given.layout)
        raise TypeError(f"{name} has to be a dense tensor{wanted} with numbers in memory, not one of {kind}")
    if dtype is not None and given.dtype != dtype:
        raise TypeError(f"{name} is a tensor of {given.dtype}, but {dtype} is needed: call float()")
    if given.dtype.is_complex:
        raise TypeError(f"{name} is a tensor of {given.dtype}, but real numbers are needed")


def require_shape(name, given, shape):
    """A letter in `shape` stands for any length."""
    fits = given.dim() == len(shape) and all(isinstance(b, str) or a == b for a, b in zip(given.shape, shape))
    if not fits:
        needed = f"({', '.join(str(each) for each in shape)}{',' if len(shape) == 1 else ''})"
        raise rs.UsageError(f"{name} has the shape {tuple(given.shape)}, but {needed} is needed")


def pose_matrix(name, viewmat):
    """The numbers (4, 4) of a pose from the world to the camera, in double precision. Whether its rotation is one is
    for the tracer to say."""
    require_tensor(name, viewmat)
    require_shape(name, viewmat, (4, 4))
    matrix = viewmat.detach().cpu().double()
    if not torch.isfinite(matrix).all():
        raise rs.UsageError(f"{name} has numbers that are not finite")
    if (matrix[3] - torch.tensor([0.0, 0, 0, 1]).double()).abs().max() > _POSE_TOLERANCE:
        last = " ".join(f"{each:.6g}" for each in matrix[3])
        raise rs.UsageError(f"{name} has the last row {last} in place of 0 0 0 1: is it transposed?")
    return matrix.numpy()
