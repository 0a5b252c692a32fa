# SPDX-License-Identifier: Apache-2.0
"""gsplat's call, raysplats.torch.rasterization, against the tracer and the reference in double precision."""

import gc
import inspect
import weakref

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="no PyTorch: apt-get install python3-torch")

import raysplats as rs  # noqa: E402
import raysplats.torch as rt  # noqa: E402
import reference  # noqa: E402
from raysplats import _rasterization  # noqa: E402
from conftest import QUANTILE, TOLERANCE, assert_threads_find, random_arrays  # noqa: E402


def gsplat_scene(views=2):
    arrays = random_arrays(sh_degree=0)
    rng = np.random.default_rng(6)
    values = {
        "means": arrays["means"], "quats": arrays["quaternions"], "scales": np.exp(arrays["log_scales"]),
        "opacities": rng.uniform(0.2, 0.9, 7), "colors": rng.random((7, 3)),
        "viewmats": np.stack([np.eye(4)] * views), "Ks": np.stack([[[16, 0, 8], [0, 16, 6], [0, 0, 1]]] * views),
    }
    values["viewmats"][:, 2, 3] = 3
    values["viewmats"][:, 0, 3] = np.linspace(0, 0.5, views)
    return {k: torch.tensor(v, dtype=torch.float32) for k, v in values.items()} | {"width": 16, "height": 12}


def test_rasterization_gives_what_the_tracer_gives(context):
    scene = gsplat_scene()
    backgrounds = torch.tensor([[0.1, 0.2, 0.3], [1.0, 0.5, 0.0]])
    for name in ("means", "quats", "scales", "opacities", "colors", "viewmats"):
        scene[name].requires_grad_()
    colors, alphas, meta = rt.rasterization(**scene, backgrounds=backgrounds)
    assert colors.shape == (2, 12, 16, 3) and alphas.shape == (2, 12, 16, 1) and meta["n_cameras"] == 2
    with torch.no_grad():
        g = rs.Gaussians(
            scene["means"].numpy(), scene["quats"].numpy(), scene["scales"].log().numpy(),
            torch.logit(scene["opacities"]).numpy(), ((scene["colors"] - 0.5) / reference.SH_0)[:, None].numpy(),
        )
    model = rs.Model(context, g)
    for i in range(2):
        options = rs.TraceOptions(
            hit_order="peak", adaptive_radius=True, near_depth=0.01, background=backgrounds[i].tolist())
        camera = rs.Camera(16, 12, 16.0, 16.0, 8, 6, translation=scene["viewmats"][i, :3, 3].tolist())
        picture = rs.Tracer(context, options).render(model, camera)
        assert np.abs(colors[i].detach().numpy() - picture.color).max() < 1e-5
        assert np.abs(alphas[i, ..., 0].detach().numpy() - picture.alpha).max() < 1e-5
    sky = rs.TraceOptions(hit_order="peak", adaptive_radius=True, sky=[(0.5, 0.5, 0.5)], background=(0, 1, 0))
    assert torch.equal(rt.rasterization(**scene, backgrounds=backgrounds, options=sky)[0], colors)
    colors.square().sum().backward()
    for name in ("means", "quats", "scales", "opacities", "colors", "viewmats"):
        assert scene[name].grad.abs().max() > 0, name
    with pytest.raises(KeyError, match="means2d"):
        meta["means2d"]


def pixels_of_the_reference(scene, opacities, colors):
    """(12, 16, 4) of the first camera of gsplat_scene() in double precision."""
    scene = {k: v.double().numpy() if isinstance(v, torch.Tensor) else v for k, v in scene.items()}
    with np.errstate(divide="ignore", over="ignore"):
        p = {
            "means": scene["means"], "quaternions": scene["quats"], "log_scales": np.log(scene["scales"]),
            "opacities": np.log(opacities / (1 - opacities)), "sh": ((colors - 0.5) / reference.SH_0)[:, None],
        }
        turn, move = scene["viewmats"][0, :3, :3], scene["viewmats"][0, :3, 3]
        center = -turn.T @ move
        rows = [
            reference.trace(np, p, center, d, QUANTILE, peak=True, from_origin=True)
            for d in reference.camera_rays(np, rs.Camera(16, 12, 16.0), turn, center)
        ]
    return np.stack([np.append(color, alpha) for color, alpha in rows]).reshape(12, 16, 4)


def test_rasterization_has_gradients_at_both_ends_of_opacities():
    scene = gsplat_scene(views=1)
    given = torch.tensor([0, 1, 0.5, 1, 0, 0.3, 0.9999])
    weights = np.random.default_rng(5).normal(size=(12, 16, 4))
    scene["opacities"] = given.clone().requires_grad_()
    # Without the adaptive radius, by which nothing fainter than 1/255 is met.
    options = rs.TraceOptions(hit_order="peak", quantile=QUANTILE)
    color, alpha, _ = rt.rasterization(**scene, options=options)
    seen = torch.cat([color, alpha], dim=-1)[0]
    (found,) = torch.autograd.grad((seen * torch.tensor(weights)).sum(), [scene["opacities"]])
    scene["opacities"] = given
    exact, colors = given.double().numpy(), scene["colors"].double().numpy()

    def loss(opacities):
        return (pixels_of_the_reference(scene, opacities, colors) * weights).sum()

    assert np.abs(pixels_of_the_reference(scene, exact, colors) - seen.detach().numpy()).max() < 5e-5
    # Pictures are of first degree in every opacity: one-sided differences are exact.
    step = np.where(exact > 0.5, -1e-4, 1e-4)
    moved = [loss(exact + step * (np.arange(7) == i)) for i in range(7)]
    expected = (np.array(moved) - loss(exact)) / step
    # Devices may be off by the last bit of an opacity, and so of what is left to 1.
    last_bit = 2.0**-24 / np.maximum(1 - exact, 2.0**-16)
    assert (np.abs(found.numpy() - expected) <= TOLERANCE * np.abs(expected).max() + last_bit * np.abs(expected)).all()


def test_rasterization_draws_opacities_beyond_the_ends_as_the_nearest():
    scene = gsplat_scene(views=1)

    def drawn(first, second):
        scene["opacities"] = torch.tensor([first, second, 0.5, 0.4, 0.3, 0.2, 0.6], requires_grad=True)
        color = rt.rasterization(**scene)[0]
        return color.detach(), torch.autograd.grad(color.sum(), [scene["opacities"]])[0]

    for within, beyond in zip(drawn(1, 0), drawn(1.5, -0.5)):
        assert torch.equal(within, beyond)
    # What the adaptive radius leaves out has no gradient.
    assert drawn(1, 0)[1][0] != 0 and drawn(1, 0)[1][1] == 0


def test_rasterization_is_linear_in_colors():
    scene = gsplat_scene(views=1)
    weights = torch.tensor(np.random.default_rng(5).normal(size=(1, 12, 16, 3)), dtype=torch.float32)

    def drawn(colors):
        scene["colors"] = colors.clone().requires_grad_()
        color = rt.rasterization(**scene)[0]
        (gradient,) = torch.autograd.grad((color * weights).sum(), [scene["colors"]])
        return color.detach(), gradient

    grey, expected = drawn(torch.full((7, 3), 0.5))
    black, at_0 = drawn(torch.zeros(7, 3))
    assert black.abs().max() < 1e-6
    some = torch.tensor([[0.0, 0, 0], [1, 1, 1], [0, 0.5, 1], [-0.3, 0, 2], [0.5, 0.5, 0], [0, 1e-9, 0.1], [1, 0, 0]])
    mixed, at_some = drawn(some)
    negative, at_negative = drawn(some - 0.5)
    assert torch.allclose(mixed - grey, negative, atol=2e-6) and negative.min() < -0.1
    for gradient in (at_0, at_some, at_negative):
        assert (gradient - expected).abs().max() <= 1e-5 * expected.abs().max()
    assert expected.abs().min() > 1e-3
    each, gradient = drawn(some[None])
    assert torch.equal(each, mixed) and torch.equal(gradient[0], at_some)


def test_rasterization_draws_flat_gaussians():
    scene = gsplat_scene(views=1)
    scene["scales"][:, 2] = 1e-6
    thin, _, _ = rt.rasterization(**scene)
    scene["scales"][:, 2] = 0
    scene["scales"].requires_grad_()
    flat, alphas, _ = rt.rasterization(**scene)
    flat.sum().backward()
    assert alphas.max() > 0.5 and torch.allclose(thin, flat, atol=1e-4)
    gradient = scene["scales"].grad
    assert torch.isfinite(gradient).all() and (gradient[:, 2] == 0).all() and gradient[:, 0].abs().max() > 0


def test_rasterization_draws_for_a_viewer_while_a_thread_trains(hasty_threads):
    scene, other = gsplat_scene(views=1), gsplat_scene(views=1)
    scene["means"].requires_grad_()
    other["viewmats"][0, 2, 3] = 4

    def trained():
        return torch.autograd.grad(rt.rasterization(**scene)[0].sum(), [scene["means"]])[0]

    def viewed():
        with torch.no_grad():
            return rt.rasterization(**other)[0]

    calls = [trained, viewed]
    assert_threads_find(calls, [call() for call in calls])


def test_rasterization_keeps_few_renderers():
    scene = gsplat_scene(views=1)
    rt.rasterization(**scene, near_plane=0.5)
    kept = weakref.ref(next(reversed(_rasterization._renderers.values())))
    for near_plane in (0.51, 0.52, 0.53):
        rt.rasterization(**scene, near_plane=near_plane)
    rt.rasterization(**scene, near_plane=0.5)
    assert kept() is next(reversed(_rasterization._renderers.values()))
    for near_plane in (0.54, 0.55, 0.56, 0.57):
        rt.rasterization(**scene, near_plane=near_plane)
    gc.collect()
    assert kept() is None and len(_rasterization._renderers) == _rasterization._MOST_RENDERERS


def test_rasterization_has_depths_and_harmonics():
    scene = gsplat_scene(views=1)
    with torch.no_grad():
        both, alphas, _ = rt.rasterization(**scene, render_mode="RGB+ED")
        summed, _, _ = rt.rasterization(**scene, render_mode="D")
        assert both.shape == (1, 12, 16, 4) and 2 < both[..., 3].max() < 4
        assert torch.allclose(summed, both[..., 3:] * alphas)
        flat = scene.pop("colors")
        sh = torch.zeros(7, 4, 3)
        sh[:, 0] = (flat - 0.5) / reference.SH_0
        colors, _, _ = rt.rasterization(**scene, colors=sh, sh_degree=1)
        assert torch.allclose(colors, both[..., :3], atol=1e-5)
        per_view, _, _ = rt.rasterization(**scene, colors=flat[None])
        assert torch.allclose(per_view, both[..., :3], atol=1e-5)


def test_rasterization_antialiased_shows_nothing_thinner_than_pixels(context):
    scene = gsplat_scene(views=1)
    scene["scales"] = torch.full_like(scene["scales"], 0.02)  # a tenth of a pixel
    classic = rt.rasterization(**scene)[1]
    scene["scales"].requires_grad_()
    alphas = rt.rasterization(**scene, rasterize_mode="antialiased")[1]
    assert torch.count_nonzero(alphas > 1 / 255) > torch.count_nonzero(classic > 1 / 255)
    options = rs.TraceOptions.peak_order()
    assert options.view_footprint > 0
    assert torch.equal(rt.rasterization(**scene, options=options)[1], alphas)
    alphas.sum().backward()
    assert scene["scales"].grad.abs().max() > 0


def test_rasterization_has_no_gradient_through_the_footprint_of_rays(context):
    scene = gsplat_scene(views=1)
    scene["scales"].requires_grad_()
    options = rs.TraceOptions.peak_order()
    options.traversal = "bvh"
    for more in ({"camera_model": "ortho", "rasterize_mode": "antialiased"}, {"options": options}):
        with pytest.raises(NotImplementedError, match="footprint"):
            rt.rasterization(**scene, **more)
        with torch.no_grad():
            assert torch.isfinite(rt.rasterization(**scene, **more)[1]).all()
    rt.rasterization(**scene, camera_model="ortho")[1].sum().backward()
    assert scene["scales"].grad.abs().max() > 0


# What is not supported: every argument of gsplat's is used, or refused by its name.
REFUSED = {
    "far_plane": 10.0, "radius_clip": 1.0, "eps2d": 0.3, "packed": True, "tile_size": 16, "sparse_grad": True,
    "absgrad": True, "channel_chunk": 32, "distributed": True,
    "camera_model": "ftheta", "segmented": True, "covars": torch.zeros(7, 3, 3), "with_ut": True,
    "with_eval3d": True, "radial_coeffs": torch.zeros(1, 4), "tangential_coeffs": torch.zeros(1, 2),
    "thin_prism_coeffs": torch.zeros(1, 4), "ftheta_coeffs": 1, "rolling_shutter": 1,
    "viewmats_rs": torch.zeros(1, 4, 4),
}


@pytest.mark.parametrize("name", REFUSED)
def test_rasterization_refuses_by_name(name):
    with pytest.raises(NotImplementedError, match=name):
        rt.rasterization(**gsplat_scene(views=1), **{name: REFUSED[name]})


def with_number(scene, name, number):
    changed = scene[name].clone()
    changed.view(-1)[0] = number
    return changed


def wrong_arguments():
    """Names of arguments, what is given for them, and the beginning of the sentence that says so."""
    scene = gsplat_scene(views=1)
    nan, inf = float("nan"), float("inf")
    gaussians = ("means", "quats", "scales", "opacities", "colors")
    for name in (*gaussians, "viewmats", "Ks"):
        of = " of float32" if name in gaussians else ""
        yield {name: scene[name].numpy()}, f"{name} has to be a tensor{of}, not ndarray: torch.from_numpy() makes one"
        yield {name: None}, f"{name} has to be a tensor{of}, not NoneType"
        yield {name: scene[name].to_sparse()}, f"{name} has to be a dense tensor{of} with numbers in memory, not one of torch.sparse_coo"
        yield {name: scene[name].to("meta")}, f"{name} has to be a dense tensor{of} with numbers in memory, not one of meta"
    for name in gaussians:
        yield {name: scene[name].half()}, f"{name} is a tensor of torch.float16, but torch.float32 is needed: call float()"
        yield {name: scene[name].double()}, f"{name} is a tensor of torch.float64, but torch.float32 is needed: call float()"
        needed = "finite and at least 0" if name == "scales" else "finite"
        yield {name: with_number(scene, name, nan)}, f"{name} has the number nan, but all have to be {needed}"
    yield {"scales": with_number(scene, "scales", -1)}, "scales has the number -1, but all have to be finite and at least 0"
    yield {"scales": with_number(scene, "scales", inf)}, "scales has the number inf, but all have to be finite and at least 0"
    for name, shape in (("quats", "(7, 4)"), ("scales", "(7, 3)"), ("opacities", "(7,)"), ("colors", "(7, 3)")):
        few = scene[name][1:]
        yield {name: few}, f"{name} has the shape {tuple(few.shape)}, but {shape} is needed"
    yield {"means": scene["means"][0]}, "means has the shape (3,), but (N, 3) is needed"
    yield {"colors": torch.tensor(1.0)}, "colors has the shape (), but (7, 3) is needed"
    yield {"viewmats": scene["viewmats"][:0], "Ks": scene["Ks"][:0]}, "viewmats has no camera, but at least one is needed"
    yield {"viewmats": scene["viewmats"][0]}, "viewmats has the shape (4, 4), but (C, 4, 4) is needed"
    yield {"viewmats": scene["viewmats"].mT}, "viewmats[0] has the last row 0 0 3 1 in place of 0 0 0 1: is it transposed?"
    yield {"viewmats": scene["viewmats"] / 0}, "viewmats[0] has numbers that are not finite"
    yield {"viewmats": scene["viewmats"].to(torch.complex64)}, "viewmats is a tensor of torch.complex64, but real numbers are needed"
    yield {"viewmats": scene["viewmats"] * torch.tensor([2.0, 2, 2, 1])}, "Camera 'viewmats[0]' has a rotation that scales"
    yield {"Ks": scene["Ks"].repeat(2, 1, 1)}, "Ks has the shape (2, 3, 3), but (1, 3, 3) is needed"
    yield {"Ks": scene["Ks"].mT}, "Ks[0] is no matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]: is it transposed?"
    yield {"Ks": scene["Ks"] * torch.tensor([0.0, 1, 1])}, "Ks[0] has focal lengths of 0 and 16 pixels, but both are above 0"
    yield {"Ks": scene["Ks"] + nan}, "Ks[0] has numbers that are not finite"
    for name in ("width", "height"):
        yield {name: 0}, f"{name} is 0 pixels, which no picture has"
        yield {name: 2**40}, f"{name} is 1099511627776 pixels, which no picture has"
        yield {name: 8.0}, f"{name} has to be a whole number, not float"
        yield {name: "8"}, f"{name} has to be a whole number, not str"
    yield {"near_plane": nan}, "near_plane is a depth of at least 0, not nan"
    yield {"near_plane": None}, "near_plane has to be a number, not NoneType"
    yield {"far_plane": None}, "far_plane has to be a number, not NoneType"
    yield {"backgrounds": [0, 0, 0]}, "backgrounds has to be a tensor, not list"
    yield {"backgrounds": torch.zeros(3)}, "backgrounds has the shape (3,), but (1, 3) is needed"
    yield {"options": {}}, "options has to be a raysplats.TraceOptions, not dict"
    yield {"sh_degree": 1.5}, "sh_degree has to be a whole number, not float"
    yield {"sh_degree": 5}, "sh_degree is 0 to 4, not 5"
    yield {"sh_degree": 1}, "colors has the shape (7, 3), but (7, K, 3) is needed"
    yield {"sh_degree": 2, "colors": torch.zeros(7, 4, 3)}, "colors has 4 coefficients, but sh_degree 2 needs 9"
    yield {"rasterize_mode": "sharp"}, "rasterize_mode is classic or antialiased, not 'sharp'"
    fisheye = {"camera_model": "fisheye"}
    yield {**fisheye, "radial_coeffs": np.zeros((1, 4))}, "radial_coeffs has to be a tensor, not ndarray"
    yield {**fisheye, "radial_coeffs": torch.full((1, 4), nan)}, "radial_coeffs[0] has numbers that are not finite"


@pytest.mark.parametrize(("changes", "sentence"), list(wrong_arguments()))
def test_rasterization_refuses_wrong_arguments_in_one_sentence(changes, sentence):
    with pytest.raises((ValueError, TypeError)) as caught:
        rt.rasterization(**{**gsplat_scene(views=1), **changes})
    assert str(caught.value).startswith(sentence) and "\n" not in str(caught.value)


def test_rasterization_takes_tensors_as_they_come():
    scene = gsplat_scene(views=2)
    expected, _, _ = rt.rasterization(**scene, backgrounds=torch.full((2, 3), 0.25))
    loose = {k: v.repeat_interleave(2, 0)[::2] if isinstance(v, torch.Tensor) else np.int64(v) for k, v in scene.items()}
    assert not loose["means"].is_contiguous()
    for kind in (torch.float64, torch.float16):
        others = {name: scene[name].to(kind) for name in ("viewmats", "Ks")}
        found, _, _ = rt.rasterization(**{**loose, **others}, backgrounds=torch.full((2, 3), 0.25, dtype=kind))
        assert found.dtype == torch.float32 and torch.equal(found, expected)
    nothing = {name: scene[name][:0] for name in ("means", "quats", "scales", "opacities", "colors")}
    color, alphas, _ = rt.rasterization(**{**scene, **nothing})
    assert not color.any() and not alphas.any()


def test_rasterization_knows_every_argument():
    used = {"means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "width", "height", "near_plane",
            "sh_degree", "backgrounds", "render_mode", "rasterize_mode", "options"}
    assert set(inspect.signature(rt.rasterization).parameters) == used | set(REFUSED)


def test_rasterization_refuses_what_has_no_gradient():
    scene = gsplat_scene(views=1)
    scene["means"].requires_grad_()
    with pytest.raises(NotImplementedError, match="those of depths are not computed"):
        rt.rasterization(**scene, render_mode="ED")
    scene["Ks"].requires_grad_()
    with pytest.raises(NotImplementedError, match="gradients of Ks"):
        rt.rasterization(**scene)
    with pytest.raises(NotImplementedError, match="colors of other than 3 channels"):
        rt.rasterization(**{**gsplat_scene(), "colors": torch.rand(7, 8)})
