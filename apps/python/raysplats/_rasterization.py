# SPDX-License-Identifier: Apache-2.0
"""raysplats.torch.rasterization: gsplat's call, answered by ray tracing."""

import collections
import threading

import torch

from . import _raysplats as rs

_SH_0 = 0.28209479177387814
# Beyond this opacity the logit leaves float32's useful range.
_MOST_OPACITY = 1 - 1e-6
_LEAST_OPACITY = 1e-6
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


def _require_shape(name, tensor, shape):
    if tuple(tensor.shape) != shape:
        raise rs.UsageError(f"{name} has the shape {tuple(tensor.shape)}, but {shape} is needed")


def _option_names():
    return [name for name in dir(rs.TraceOptions) if isinstance(getattr(rs.TraceOptions, name), property)]


def _renderer(options, near_plane, depth):
    """The renderer of these options, which later calls find again while it is among the last used; all share a
    context."""
    from .torch import Renderer

    chosen = rs.TraceOptions(hit_order="peak", adaptive_radius=True)
    if options is not None:
        for name in _option_names():
            setattr(chosen, name, getattr(options, name))
    chosen.near_depth, chosen.depth, chosen.background = near_plane, depth, (0, 0, 0)
    key = str([(name, getattr(chosen, name)) for name in _option_names()])
    with _renderers_lock:
        if key not in _renderers:
            context = next((each.context for each in _renderers.values()), None)
            _renderers[key] = Renderer(context, chosen)
        _renderers.move_to_end(key)
        if len(_renderers) > _MOST_RENDERERS:
            _renderers.popitem(last=False)
        return _renderers[key]


def _camera(k, width, height, camera_model, radial):
    k = k.detach().cpu().double()
    if k[0, 1] != 0:
        _refuse("Ks with skew", "pixels have right angles")
    lens = [0.0] * 6
    if radial is not None:
        lens[0], lens[1], lens[2], lens[5] = (float(each) for each in radial)
    return rs.Camera(
        width,
        height,
        float(k[0, 0]),
        float(k[1, 1]),
        float(k[0, 2]),
        float(k[1, 2]),
        model=_CAMERA_MODELS[camera_model],
        distortion=lens,
    )


def _harmonics(colors, sh_degree):
    """Coefficients (N, K, 3) of one camera's colours, (N, K', 3) or (N, 3)."""
    if sh_degree is None:
        return ((colors - 0.5) / _SH_0)[:, None, :]
    return colors[:, : (sh_degree + 1) ** 2, :]


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
    if means.dim() != 2:
        _refuse("batches of scenes", f"means has the shape {tuple(means.shape)}, not (N, 3)")
    count, views = means.shape[0], viewmats.shape[0]
    _require_shape("means", means, (count, 3))
    _require_shape("viewmats", viewmats, (views, 4, 4))
    _require_shape("Ks", Ks, (views, 3, 3))
    _require_shape("opacities", opacities, (count,))
    if covars is not None:
        _refuse("covars", "give quats and scales")
    _require_shape("quats", quats, (count, 4))
    _require_shape("scales", scales, (count, 3))
    if render_mode not in _MODES:
        raise rs.UsageError(f"render_mode is one of {', '.join(_MODES)}, not '{render_mode}'")
    if camera_model not in _CAMERA_MODELS:
        _refuse(f"camera_model='{camera_model}'", f"known are {', '.join(_CAMERA_MODELS)}")
    if far_plane < 1e10:
        _refuse("far_plane", "rays have no end; remove what is farther")
    if radius_clip != 0:
        _refuse("radius_clip", "every Gaussian that a ray meets counts")
    if eps2d != 0:
        _refuse("eps2d", "nothing is projected, so nothing is widened; give scales a least value")
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
    if rasterize_mode != "classic":
        _refuse(f"rasterize_mode='{rasterize_mode}'", "opacities are not compensated")
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
        _require_shape("radial_coeffs", radial_coeffs, (views, 4))
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
    if needs_depth and torch.is_grad_enabled() and any(each.requires_grad for each in inputs):
        _refuse(f"gradients with render_mode='{render_mode}'", "those of depths are not computed; use torch.no_grad()")
    per_view = colors.dim() == (3 if sh_degree is None else 4)
    if sh_degree is None:
        if colors.shape[-1] != 3:
            _refuse("colors of other than 3 channels", f"these have {colors.shape[-1]}")
        _require_shape("colors", colors, (views, count, 3) if per_view else (count, 3))
    else:
        bands = (sh_degree + 1) ** 2
        if not 0 <= sh_degree <= 4 or colors.shape[-2] < bands:
            raise rs.UsageError(f"sh_degree {sh_degree} needs {bands} coefficients, of degree 0 to 4")
        shape = (count, colors.shape[-2], 3)
        _require_shape("colors", colors, (views, *shape) if per_view else shape)
    if backgrounds is not None:
        _require_shape("backgrounds", backgrounds, (views, 3))

    renderer = _renderer(options, float(near_plane), needs_depth)
    logits = torch.logit(opacities.clamp(_LEAST_OPACITY, _MOST_OPACITY)).contiguous()
    shared = (means.contiguous(), quats.contiguous(), scales.log().contiguous(), logits)
    pictures, alphas = [], []
    for i in range(views):
        sh = _harmonics(colors[i] if per_view else colors, sh_degree).contiguous()
        radial = None if radial_coeffs is None else radial_coeffs[i]
        camera = _camera(Ks[i], width, height, camera_model, radial)
        seen = renderer.render(camera, *shared, sh, viewmat=viewmats[i])
        alpha = seen.rgba[..., 3:]
        layers = []
        if "RGB" in render_mode:
            rgb = seen.rgba[..., :3]
            layers.append(rgb if backgrounds is None else rgb + (1 - alpha) * backgrounds[i])
        if needs_depth:
            depth = seen.expected_depth[..., None]
            layers.append(depth if "ED" in render_mode else depth * alpha)
        pictures.append(torch.cat(layers, dim=-1))
        alphas.append(alpha)
    meta = _Meta(width=width, height=height, n_cameras=views)
    return torch.stack(pictures), torch.stack(alphas), meta
