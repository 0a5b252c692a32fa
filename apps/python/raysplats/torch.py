# SPDX-License-Identifier: Apache-2.0
"""Pictures and rays as functions of PyTorch tensors, with gradients.

    renderer = raysplats.torch.Renderer()
    rgba = renderer.render(camera, means, quaternions, log_scales, opacities, sh)
    rgba[..., :3].sub(photo).abs().mean().backward()

Tensors are float32. Those on the CPU are read where they are; others are copied to the host and the results back.
Gradients of depths and of gradients are not computed, and the set and the order of hits count as constant
(docs/model.md).
"""

import atexit
import threading
import typing
import weakref

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from . import _raysplats as rs
from ._checks import pose_matrix, require_tensor
from ._rasterization import rasterization

__all__ = ["Renderer", "Rendering", "TracedRays", "rasterization"]

_NAMES = ("means", "quaternions", "log_scales", "opacities", "sh")


class Rendering(typing.NamedTuple):
    """What a camera sees; depths and hits, of TraceOptions.depth, have no gradients."""

    rgba: torch.Tensor  # (height, width, 4): colour with the background blended in, 1 - transmittance
    expected_depth: typing.Optional[torch.Tensor]  # (height, width)
    median_depth: typing.Optional[torch.Tensor]
    hits: typing.Optional[torch.Tensor]


class TracedRays(typing.NamedTuple):
    """What N rays met; depths and hits have no gradients."""

    color: torch.Tensor  # (N, 3), background blended in
    alpha: torch.Tensor  # (N,), 1 - transmittance
    expected_depth: torch.Tensor  # (N,), in lengths of the direction
    hits: torch.Tensor  # (N,)


def _array(tensor, name):
    """The numbers of a tensor, where they are if they are on the CPU."""
    require_tensor(name, tensor, torch.float32)
    if not tensor.is_contiguous():
        raise rs.UsageError(f"{name} is not contiguous: call contiguous()")
    return tensor.detach().cpu().numpy()


def _require_kind(name, given, *kinds):
    if not isinstance(given, kinds):
        known = " or ".join("None" if each is type(None) else each.__name__ for each in kinds)
        raise TypeError(f"{name} has to be {known}, not {type(given).__name__}")


def _context(given):
    if isinstance(given, rs.Context):
        return given
    try:
        return rs.Context("" if given is None else given)
    except TypeError:
        raise TypeError(f"context has to be a Context or a device, not {type(given).__name__}") from None


def _tensor(array, like):
    return torch.from_numpy(np.array(array, dtype=np.float32)).to(like.device)


def _parameter_gradients(parameters, tensors):
    """In the shapes of the tensors."""
    return [
        _tensor(getattr(parameters, name), tensor).reshape(tensor.shape)
        for name, tensor in zip(_NAMES, tensors)
    ]


def pose_gradient(viewmat, center, rotation):
    """dL/d(viewmat), (4, 4), from gradients for moving the camera's centre and for turning it.

    Of a loss that is known for rigid motions alone there are many; this is the one that is tangent to them, so any
    parametrisation of the pose gets its own gradient by the chain rule.
    """
    turn, move = viewmat[:3, :3], viewmat[:3, 3]
    d_move = -(turn @ center)
    about = rotation - np.cross(move, d_move)
    cross = np.array(
        [[0, -about[2], about[1]], [about[2], 0, -about[0]], [-about[1], about[0], 0]]
    )
    out = np.zeros((4, 4))
    out[:3, :3] = 0.5 * cross @ turn
    out[:3, 3] = d_move
    return out


class _Pass:
    """What a backward pass needs beside tensors. PyTorch frees no graph that is alive when the interpreter ends, so
    that by then it has to have let go of what it keeps of the device."""

    _living = weakref.WeakSet()
    _living_lock = threading.Lock()

    def __init__(self, renderer, source, ticket):
        self.renderer, self.source, self.ticket = renderer, source, ticket
        with self._living_lock:
            self._living.add(self)

    @classmethod
    def end_all(cls):
        with cls._living_lock:
            living = list(cls._living)
        for each in living:
            each.renderer = each.source = None


atexit.register(_Pass.end_all)


class _View(torch.autograd.Function):
    @staticmethod
    def forward(ctx, renderer, camera, graded, viewmat, *parameters):
        needed = graded and any(ctx.needs_input_grad)
        picture, ticket = renderer._see(camera, viewmat, parameters, needed)
        # A copy: the camera may be moved on before the backward pass.
        ctx.kept = _Pass(renderer, camera.downscaled(1), ticket)
        ctx.save_for_backward(viewmat, *parameters)
        like = parameters[0]
        if picture.expected_depth is None:
            return _tensor(picture.rgba, like)
        others = [_tensor(a, like) for a in (picture.expected_depth, picture.median_depth, picture.hits)]
        ctx.mark_non_differentiable(*others)
        return (_tensor(picture.rgba, like), *others)

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient, *_):
        viewmat, *parameters = ctx.saved_tensors
        kept = ctx.kept
        found = kept.renderer._view_gradients(kept.source, viewmat, parameters, kept.ticket, gradient)
        pose = None
        if viewmat is not None and ctx.needs_input_grad[3]:
            matrix = pose_matrix("viewmat", viewmat)
            pose = torch.from_numpy(pose_gradient(matrix, found.camera_center, found.camera_rotation))
            pose = pose.to(viewmat)
        return (None, None, None, pose, *_parameter_gradients(found.parameters, parameters))


class _Rays(torch.autograd.Function):
    @staticmethod
    def forward(ctx, renderer, color_direction, graded, origins, directions, *parameters):
        needed = graded and any(ctx.needs_input_grad)
        traced, ticket = renderer._meet(color_direction, origins, directions, parameters, needed)
        ctx.kept = _Pass(renderer, color_direction, ticket)
        ctx.save_for_backward(origins, directions, *parameters)
        depth, hits = _tensor(traced.expected_depth, origins), _tensor(traced.hits, origins)
        ctx.mark_non_differentiable(depth, hits)
        return _tensor(traced.color, origins), _tensor(traced.alpha, origins), depth, hits

    @staticmethod
    @once_differentiable
    def backward(ctx, d_color, d_alpha, *_):
        origins, directions, *parameters = ctx.saved_tensors
        kept = ctx.kept
        found = kept.renderer._ray_gradients(
            kept.source, origins, directions, parameters, kept.ticket, d_color, d_alpha
        )
        return (
            None,
            None,
            None,
            _tensor(found.origins, origins),
            _tensor(found.directions, directions),
            *_parameter_gradients(found.parameters, parameters),
        )


class Renderer:
    """Gaussians in tensors, drawn on an OpenCL device.

    Parameters are those of raysplats.Gaussians, before activation: means (N, 3), quaternions (N, 4), log_scales
    (N, 3), opacities (N,) as logits, sh (N, K, 3). The device keeps the last forward pass alone: the backward pass of
    an earlier one runs its forward pass again. Threads may share a renderer, and take turns.
    """

    def __init__(self, context=None, options=None, *, mirrors=None):
        """context: a raysplats.Context, or what it takes for a device; options: raysplats.TraceOptions."""
        _require_kind("options", options, rs.TraceOptions, type(None))
        _require_kind("mirrors", mirrors, rs.Mirrors, type(None))
        self.context = _context(context)
        self.tracer = rs.Tracer(self.context, options, mirrors=mirrors)
        self._mirrors = mirrors is not None and len(mirrors.meshes) > 0
        # What the device keeps, and the number of the pass that it is of, are used together by the thread that has
        # the lock of the context, as every call of the tracer does: a lock of our own beside it could be waited for
        # by a thread that has that one, such as a callback of a Trainer.
        self._model = None
        self._ticket = 0

    def render(self, camera, means, quaternions, log_scales, opacities, sh, *, viewmat=None):
        """A Rendering of what a raysplats.Camera sees; `viewmat`, a tensor (4, 4) from the world to the camera, takes
        the place of the camera's pose and gets gradients (tangent to rigid motions), but not beside a sky or mirrors,
        where they are not known."""
        _require_kind("camera", camera, rs.Camera)
        graded = torch.is_grad_enabled()  # within apply() it never is
        if graded and isinstance(viewmat, torch.Tensor) and viewmat.requires_grad:
            self._require_known_pose_gradients()
        seen = _View.apply(self, camera, graded, viewmat, means, quaternions, log_scales, opacities, sh)
        return Rendering(seen, None, None, None) if isinstance(seen, torch.Tensor) else Rendering(*seen)

    def trace(
        self, origins, directions, means, quaternions, log_scales, opacities, sh, *, color_direction="ray"
    ):
        """TracedRays of rays from origins (N, 3) along directions (N, 3) of any length."""
        parameters = (means, quaternions, log_scales, opacities, sh)
        graded = torch.is_grad_enabled()
        return TracedRays(*_Rays.apply(self, color_direction, graded, origins, directions, *parameters))

    def _require_known_pose_gradients(self):
        what = "mirrors" if self._mirrors else "a sky" if self.tracer.options.sky else None
        if what is not None:
            raise rs.UsageError(
                f"viewmat requires gradients, but those of a pose are not known beside {what}: call detach(), or leave "
                f"out {what}"
            )

    def _upload(self, parameters):
        self._ticket += 1  # at once: what the device had is gone, whether or not this pass succeeds
        arrays = {name: _array(each, name) for name, each in zip(_NAMES, parameters)}
        if self._model is None:
            self._model = rs.Model(self.context, rs.Gaussians(**arrays))
        else:
            self._model.assign_arrays(**arrays)

    def _posed(self, camera, viewmat):
        if viewmat is None:
            return camera
        matrix = pose_matrix("viewmat", viewmat)
        posed = camera.downscaled(1)
        posed.rotation, posed.translation = matrix[:3, :3].tolist(), matrix[:3, 3].tolist()
        return posed

    def _see(self, camera, viewmat, parameters, differentiable):
        with self.context.lock():
            self._upload(parameters)
            posed = self._posed(camera, viewmat)
            return self.tracer.render(self._model, posed, differentiable), self._ticket

    def _view_gradients(self, camera, viewmat, parameters, ticket, gradient):
        with self.context.lock():
            if ticket != self._ticket:
                self._see(camera, viewmat, parameters, True)
            return self.tracer.backward(self._model, _array(gradient.contiguous(), "the gradient"))

    def _meet(self, color_direction, origins, directions, parameters, differentiable):
        with self.context.lock():
            self._upload(parameters)
            traced = self.tracer.trace(
                self._model,
                _array(origins, "origins"),
                _array(directions, "directions"),
                color_direction=color_direction,
                differentiable=differentiable,
            )
            return traced, self._ticket

    def _ray_gradients(self, color_direction, origins, directions, parameters, ticket, d_color, d_alpha):
        with self.context.lock():
            if ticket != self._ticket:
                self._meet(color_direction, origins, directions, parameters, True)
            return self.tracer.backward_rays(
                self._model,
                _array(d_color.contiguous(), "the gradient"),
                _array(d_alpha.contiguous(), "the gradient"),
            )
