# SPDX-License-Identifier: Apache-2.0
"""raysplats.torch.rasterization: gsplat's call, answered by ray tracing."""

import atexit
import collections
import copy
import math
import operator
import threading

import torch
from torch.autograd.function import once_differentiable

from . import _raysplats as rs
from ._checks import pose_matrix, require_shape, require_tensor

_SH_0 = 0.28209479177387814
# The tracer takes logits, and its gradients have opacity times 1 - opacity as a factor. Nearer to 1 single precision
# holds too little of that: here it holds all, and a device that is off by the last bit of an opacity is off by 1/256.
_LEAST_OPACITY = 2.0**-16
_MOST_OPACITY = 1 - _LEAST_OPACITY
# Below it rounding may clamp a colour at 0, where it has no gradient.
_LEAST_COLOR = 1e-6
# Has a logarithm, and is below the least size that the tracer draws (cl/trace/view.h).
_LEAST_SCALE = 1e-30
_MODES = ("RGB", "D", "ED", "RGB+D", "RGB+ED")
_CAMERA_MODELS = {"pinhole": "pinhole", "ortho": "orthographic", "fisheye": "fisheye"}
# Each holds a model and its pictures on the device: scripts have few sets of options at a time.
_MOST_RENDERERS = 4
_renderers = collections.OrderedDict()  # the one used last at the end
_renderers_lock = threading.RLock()


class _Meta(dict):
    """What is known beside the pictures; asking for what only a rasteriser has says so."""

    def __missing__(self, key):
        raise KeyError(f"'{key}' is an intermediate result of a rasteriser, which raysplats does not have")


def _refuse(name, why):
    raise NotImplementedError(f"rasterization of raysplats does not support {name}: {why}")


def _whole_number(name, given):
    try:
        return operator.index(given)
    except TypeError:
        raise TypeError(f"{name} has to be a whole number, not {type(given).__name__}") from None


def _number(name, given):
    try:
        return float(given)
    except (TypeError, ValueError):
        raise TypeError(f"{name} has to be a number, not {type(given).__name__}") from None


def _pixels(name, given):
    count = _whole_number(name, given)
    if not 1 <= count <= 2**31 - 1:
        raise rs.UsageError(f"{name} is {count} pixels, which no picture has")
    return count


def _require_numbers(named):
    """Refuses the first tensor that has a number that no Gaussian has."""
    for name, tensor in named.items():
        tensor = tensor.detach()
        good, needed = torch.isfinite(tensor), "finite"
        if name == "scales":
            good, needed = good & (tensor >= 0), "finite and at least 0"
        if not good.all():
            raise rs.DataError(f"{name} has the number {tensor[~good][0].item():g}, but all have to be {needed}")


def _renderer(options, near_plane, depth, antialiased):
    """The renderer of these options, which later calls find again while it is among the last used; all share a
    context."""
    from .torch import Renderer

    chosen = rs.TraceOptions.peak_order() if options is None else copy.copy(options)
    if antialiased:
        chosen.view_footprint = chosen.view_footprint or rs.TraceOptions.peak_order().view_footprint
    elif options is None:
        chosen.view_footprint = 0
    chosen.near_depth, chosen.depth = near_plane, depth
    chosen.background, chosen.sky = (0, 0, 0), ()  # those of the call count
    key = str(chosen.__getstate__())
    with _renderers_lock:
        if key not in _renderers:
            context = next((each.context for each in _renderers.values()), None)
            _renderers[key] = Renderer(context, chosen)
        _renderers.move_to_end(key)
        if len(_renderers) > _MOST_RENDERERS:
            _renderers.popitem(last=False)
        return _renderers[key]


@atexit.register
def _forget_renderers():
    with _renderers_lock:
        _renderers.clear()


def _camera(i, k, width, height, camera_model, radial):
    k = k.detach().cpu().double().tolist()
    if not all(math.isfinite(each) for row in k for each in row):
        raise rs.UsageError(f"Ks[{i}] has numbers that are not finite")
    (fx, skew, cx), (below, fy, cy), last = k
    if below != 0 or last != [0, 0, 1]:
        raise rs.UsageError(f"Ks[{i}] is no matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]: is it transposed?")
    if skew != 0:
        _refuse("Ks with skew", "pixels have right angles")
    if min(fx, fy) <= 0:
        raise rs.UsageError(f"Ks[{i}] has focal lengths of {fx:g} and {fy:g} pixels, but both are above 0")
    lens = [0.0] * 6
    if radial is not None:
        lens[0], lens[1], lens[2], lens[5] = radial.detach().cpu().double().tolist()
        if not all(math.isfinite(each) for each in lens):
            raise rs.UsageError(f"radial_coeffs[{i}] has numbers that are not finite")
    model = _CAMERA_MODELS[camera_model]
    return rs.Camera(width, height, fx, fy, cx, cy, model=model, distortion=lens, name=f"viewmats[{i}]")


class _Logits(torch.autograd.Function):
    """Logits of opacities for the tracer, with the gradients of opacities up to both ends of [0, 1]: those at the
    nearest opacity that the tracer knows."""

    @staticmethod
    def forward(ctx, opacities):
        logits = torch.logit(opacities.clamp(_LEAST_OPACITY, _MOST_OPACITY))
        ctx.save_for_backward(logits)
        return logits

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient):
        (logits,) = ctx.saved_tensors
        # Rounded as the device rounds it (cl/shared/activation.h): the factor that goes out is the one that it put in.
        opacities = 1 / (1 + torch.exp(-logits))
        return gradient / (opacities * (1 - opacities))


def _logits(opacities):
    return _Logits.apply(opacities.contiguous())


def _log_scales(scales):
    return torch.where(scales == 0, torch.full_like(scales, _LEAST_SCALE), scales).log().contiguous()


def _lift(colors, sh_degree):
    """What is added to colours so that none is clamped at 0: they have gradients there, and count below it too. A
    picture of lifted colours is brighter by it times alpha."""
    if sh_degree is not None or colors.numel() == 0:
        return 0.0
    least = colors.detach().min().item()
    return 0.0 if least > _LEAST_COLOR else 0.5 - least


def _harmonics(colors, sh_degree, lift):
    """Coefficients (N, K, 3) of one camera's colours, (N, K', 3) or (N, 3)."""
    if sh_degree is None:
        return ((colors + (lift - 0.5)) / _SH_0)[:, None, :]
    return colors[:, : (sh_degree + 1) ** 2, :]


def _check_colors(colors, sh_degree, count, views):
    """Whether each camera has colours of its own."""
    if sh_degree is None:
        per_view = colors.dim() == 3
        if colors.dim() > 1 and colors.shape[-1] != 3:
            _refuse("colors of other than 3 channels", f"these have {colors.shape[-1]}")
        require_shape("colors", colors, (views, count, 3) if per_view else (count, 3))
        return per_view
    if not 0 <= sh_degree <= 4:
        raise rs.UsageError(f"sh_degree is 0 to 4, not {sh_degree}")
    per_view = colors.dim() == 4
    require_shape("colors", colors, (views, count, "K", 3) if per_view else (count, "K", 3))
    bands = (sh_degree + 1) ** 2
    if colors.shape[-2] < bands:
        raise rs.UsageError(f"colors has {colors.shape[-2]} coefficients, but sh_degree {sh_degree} needs {bands}")
    return per_view


def rasterization(
    means,
    quats,
    scales,
    opacities,
    colors,
    viewmats,
    Ks,  # noqa: N803
    width,
    height,
    near_plane=0.01,
    far_plane=1e10,
    radius_clip=0.0,
    eps2d=0.0,
    sh_degree=None,
    packed=False,
    tile_size=None,
    backgrounds=None,
    render_mode="RGB",
    sparse_grad=False,
    absgrad=False,
    rasterize_mode="classic",
    channel_chunk=None,
    distributed=False,
    camera_model="pinhole",
    segmented=False,
    covars=None,
    with_ut=False,
    with_eval3d=False,
    radial_coeffs=None,
    tangential_coeffs=None,
    thin_prism_coeffs=None,
    ftheta_coeffs=None,
    rolling_shutter=None,
    viewmats_rs=None,
    *,
    options=None,
):
    """Pictures of N Gaussians by C cameras: (C, height, width, X), alphas (C, height, width, 1) and a dict.

    Names, shapes and units are gsplat's: quats wxyz, scales linear, opacities in [0, 1], colors (N, 3), (C, N, 3) or
    with sh_degree (N, K, 3), (C, N, K, 3), viewmats (C, 4, 4) from the world to the camera, Ks (C, 3, 3); gradients
    reach means, quats, scales, opacities, colors, viewmats and backgrounds. What differs from a rasteriser is listed
    in docs/python.md; what is not supported raises NotImplementedError that names it. `options`: a
    raysplats.TraceOptions, else the order of hits and the radius that raysplats trains with.
    """
    if covars is not None:
        _refuse("covars", "give quats and scales")
    gaussians = {"means": means, "quats": quats, "scales": scales, "opacities": opacities, "colors": colors}
    for name, each in gaussians.items():
        require_tensor(name, each, torch.float32)
    for name, each in {"viewmats": viewmats, "Ks": Ks}.items():
        require_tensor(name, each)
    for name, each in {"backgrounds": backgrounds, "radial_coeffs": radial_coeffs}.items():
        if each is not None:
            require_tensor(name, each)
    if means.dim() > 2:
        _refuse("batches of scenes", f"means has the shape {tuple(means.shape)}, not (N, 3)")
    require_shape("means", means, ("N", 3))
    require_shape("viewmats", viewmats, ("C", 4, 4))
    count, views = means.shape[0], viewmats.shape[0]
    if views == 0:
        raise rs.UsageError("viewmats has no camera, but at least one is needed")
    require_shape("Ks", Ks, (views, 3, 3))
    require_shape("opacities", opacities, (count,))
    require_shape("quats", quats, (count, 4))
    require_shape("scales", scales, (count, 3))
    width, height = _pixels("width", width), _pixels("height", height)
    near_plane, far_plane = _number("near_plane", near_plane), _number("far_plane", far_plane)
    if not 0 <= near_plane < math.inf:
        raise rs.UsageError(f"near_plane is a depth of at least 0, not {near_plane:g}")
    if options is not None and not isinstance(options, rs.TraceOptions):
        raise TypeError(f"options has to be a raysplats.TraceOptions, not {type(options).__name__}")
    if sh_degree is not None:
        sh_degree = _whole_number("sh_degree", sh_degree)
    if render_mode not in _MODES:
        raise rs.UsageError(f"render_mode is one of {', '.join(_MODES)}, not '{render_mode}'")
    if str(camera_model) not in _CAMERA_MODELS:
        _refuse(f"camera_model='{camera_model}'", f"known are {', '.join(_CAMERA_MODELS)}")
    if not far_plane >= 1e10:
        _refuse("far_plane", "rays have no end; remove what is farther")
    if radius_clip != 0:
        _refuse("radius_clip", "every Gaussian that a ray meets counts")
    if eps2d != 0:
        _refuse("eps2d", "nothing is projected; rasterize_mode='antialiased' shows nothing thinner than pixels")
    if packed:
        _refuse("packed=True", "there are no intermediate results to pack; leave it False")
    if tile_size is not None:
        _refuse("tile_size", "raysplats tune finds the device's; leave it out")
    if channel_chunk is not None:
        _refuse("channel_chunk", "colours have three channels; leave it out")
    if sparse_grad:
        _refuse("sparse_grad", "gradients are dense")
    if absgrad:
        _refuse("absgrad", "there are no projected means")
    if rasterize_mode not in ("classic", "antialiased"):
        raise rs.UsageError(f"rasterize_mode is classic or antialiased, not '{rasterize_mode}'")
    if distributed:
        _refuse("distributed", "all Gaussians are on one device")
    if segmented:
        _refuse("segmented", "nothing is sorted by segments")
    # Both say how a rasteriser comes near to what rays do exactly.
    if with_ut or with_eval3d:
        _refuse("with_ut and with_eval3d", "rays meet Gaussians exactly in any case; leave them out")
    if radial_coeffs is not None and camera_model != "fisheye":
        _refuse("radial_coeffs of this camera_model", "only 'fisheye' has them")
    if radial_coeffs is not None:
        require_shape("radial_coeffs", radial_coeffs, (views, 4))
    for name, given in (
        ("tangential_coeffs", tangential_coeffs),
        ("thin_prism_coeffs", thin_prism_coeffs),
        ("ftheta_coeffs", ftheta_coeffs),
        ("rolling_shutter", rolling_shutter),
        ("viewmats_rs", viewmats_rs),
    ):
        if given is not None:
            _refuse(name, "cameras have one pose and no such lens")
    if Ks.requires_grad:
        _refuse("gradients of Ks", "call detach()")
    needs_depth = render_mode != "RGB"
    inputs = (means, quats, scales, opacities, colors, viewmats)
    differentiated = torch.is_grad_enabled() and any(each.requires_grad for each in inputs)
    if needs_depth and differentiated:
        _refuse(f"gradients with render_mode='{render_mode}'", "those of depths are not computed; use torch.no_grad()")
    has_footprint = rasterize_mode == "antialiased" or (options is not None and options.view_footprint > 0)
    by_rays = camera_model == "ortho" or (options is not None and options.traversal == "bvh")
    if differentiated and has_footprint and by_rays:
        _refuse("gradients of a footprint where rays are traced one by one",
                "use rasterize_mode='classic' and options with a view_footprint of 0, or torch.no_grad()")
    per_view = _check_colors(colors, sh_degree, count, views)
    if backgrounds is not None:
        require_shape("backgrounds", backgrounds, (views, 3))
    cameras = []
    for i in range(views):
        pose_matrix(f"viewmats[{i}]", viewmats[i])
        radial = None if radial_coeffs is None else radial_coeffs[i]
        cameras.append(_camera(i, Ks[i], width, height, camera_model, radial))

    renderer = _renderer(options, near_plane, needs_depth, rasterize_mode == "antialiased")
    shared = (means.contiguous(), quats.contiguous(), _log_scales(scales), _logits(opacities))
    lift = _lift(colors, sh_degree)
    pictures, alphas = [], []
    for i, camera in enumerate(cameras):
        sh = _harmonics(colors[i] if per_view else colors, sh_degree, lift).contiguous()
        try:
            seen = renderer.render(camera, *shared, sh, viewmat=viewmats[i])
        except rs.DataError:
            _require_numbers(gaussians)  # which the tracer names by its own parameters
            raise
        alpha = seen.rgba[..., 3:]
        layers = []
        if "RGB" in render_mode:
            rgb = seen.rgba[..., :3]
            if lift != 0:
                rgb = rgb - lift * alpha
            layers.append(rgb if backgrounds is None else rgb + (1 - alpha) * backgrounds[i].to(alpha))
        if needs_depth:
            depth = seen.expected_depth[..., None]
            layers.append(depth if "ED" in render_mode else depth * alpha)
        pictures.append(torch.cat(layers, dim=-1))
        alphas.append(alpha)
    meta = _Meta(width=width, height=height, n_cameras=views)
    return torch.stack(pictures), torch.stack(alphas), meta
