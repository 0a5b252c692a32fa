# SPDX-License-Identifier: Apache-2.0
"""raysplats.torch against autograd through the reference in double precision."""

import concurrent.futures
import gc
import inspect
import subprocess
import sys
import weakref

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="no PyTorch: apt-get install python3-torch")

import photos  # noqa: E402
import raysplats as rs  # noqa: E402
import raysplats.torch as rt  # noqa: E402
import reference  # noqa: E402
from raysplats import _rasterization  # noqa: E402
from conftest import random_arrays  # noqa: E402

QUANTILE = 11.3449
# Of the largest number of a class of parameters.
TOLERANCE = 1e-4


@pytest.fixture(scope="module")
def renderer(context):
    return rt.Renderer(context, rs.TraceOptions(quantile=QUANTILE, hit_order="peak"))


def leaves(arrays):
    """float32 leaves, and the same numbers in double precision."""
    single = {k: torch.tensor(v, dtype=torch.float32, requires_grad=True) for k, v in arrays.items()}
    double = {k: v.detach().double().requires_grad_() for k, v in single.items()}
    return single, double


def assert_close(found, expected, table, column):
    """The gradients of leaves; what they are off by goes into a column of the table."""
    for name, leaf in found.items():
        single, double = leaf.grad, expected[name].grad
        assert single.dtype == torch.float32 and single.shape == double.shape, name
        scale = double.abs().max()
        assert scale > 1e-3, f"{name}: the test sees nothing"
        error = ((single - double).abs().max() / scale).item()
        table.setdefault(name, {})[column] = error
        assert error <= TOLERANCE, name


@pytest.fixture(scope="module")
def errors(pytestconfig):
    """Greatest errors of gradients over the largest number of their class: the table of docs/python.md."""
    table = {}
    yield table
    columns = sorted({column for row in table.values() for column in row})
    with pytestconfig.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        print("\n| gradient |", " | ".join(columns), "|")
        print("|---|" + "---|" * len(columns))
        for name, row in table.items():
            print(f"| {name} |", " | ".join(f"{row[c]:.1e}" if c in row else "" for c in columns), "|")


def test_the_reference_has_the_gradients_of_differences():
    arrays = random_arrays(count=3, sh_degree=1)
    arrays["origins"], arrays["directions"] = np.array([0.1, -0.2, -2.5]), np.array([0.02, 0.05, 1.1])
    inputs = [torch.tensor(v, requires_grad=True) for v in arrays.values()]

    def ray(*values):
        given = dict(zip(arrays, values))
        return reference.trace(torch, given, given["origins"], given["directions"], QUANTILE, peak=True)

    assert ray(*inputs)[1] > 0.3
    assert torch.autograd.gradcheck(ray, inputs)


def test_rays_have_the_gradients_of_the_reference(renderer, errors):
    rng = np.random.default_rng(4)
    origins = rng.normal(size=(40, 3))
    origins *= 2.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-0.3, 0.3, (40, 3)) - origins
    single, double = leaves({**random_arrays(), "origins": origins, "directions": directions})
    target = torch.tensor(rng.random((40, 3)))

    def loss(color, alpha):
        return ((color - target.to(color)) ** 2).sum() + (alpha ** 3).sum()

    seen = renderer.trace(**single)
    loss(seen.color, seen.alpha).backward()
    rows = [
        reference.trace(torch, double, o, d, QUANTILE, peak=True)
        for o, d in zip(double["origins"], double["directions"])
    ]
    loss(torch.stack([c for c, _ in rows]), torch.stack([torch.as_tensor(a) for _, a in rows])).backward()
    assert_close(single, double, errors, "rays")
    assert not seen.hits.requires_grad and seen.hits.max() >= 3


def pose(parameters):
    """A (4, 4) pose of a turn about y, one about x and a translation: a parametrisation of one's own."""
    a, b, tx, ty, tz = parameters
    zero, one = 0 * a, 0 * a + 1
    about_y = torch.stack([torch.stack([a.cos(), zero, a.sin()]), torch.stack([zero, one, zero]),
                           torch.stack([-a.sin(), zero, a.cos()])])
    about_x = torch.stack([torch.stack([one, zero, zero]), torch.stack([zero, b.cos(), -b.sin()]),
                           torch.stack([zero, b.sin(), b.cos()])])
    top = torch.cat([about_y @ about_x, torch.stack([tx, ty, tz])[:, None]], dim=1)
    return torch.cat([top, torch.stack([zero, zero, zero, one])[None]])


def test_views_and_poses_have_the_gradients_of_the_reference(renderer, errors):
    camera = rs.Camera(6, 5, 7.0)
    single, double = leaves({**random_arrays(sh_degree=1), "pose": np.array([0.2, -0.3, 0.1, 0.05, 2.4])})
    weights = torch.tensor(np.random.default_rng(5).normal(size=(5, 6, 4)), dtype=torch.float32)
    gaussians = {k: v for k, v in single.items() if k != "pose"}
    rgba = renderer.render(camera, **gaussians, viewmat=pose(single["pose"])).rgba
    (rgba * weights).sum().backward()

    viewmat = pose(double["pose"])
    turn = viewmat[:3, :3]
    center = -turn.T @ viewmat[:3, 3]
    rows = [
        reference.trace(torch, double, center, d, QUANTILE, peak=True, from_origin=True)
        for d in reference.camera_rays(torch, camera, turn, center)
    ]
    expected = torch.stack([torch.cat([c, torch.as_tensor(a).reshape(1)]) for c, a in rows]).reshape(5, 6, 4)
    (expected * weights).sum().backward()
    assert (rgba - expected).abs().max() < 2e-5
    assert_close(single, double, errors, "views")


def test_earlier_passes_are_run_again(renderer):
    single, _ = leaves(random_arrays())
    views = [rs.Camera.look_at((3 * np.cos(a), 3 * np.sin(a), 1), (0, 0, 0), (0, 0, 1), 12, 10, 14) for a in (0, 2)]
    apart = []
    for camera in views:
        (g,) = torch.autograd.grad(renderer.render(camera, **single).rgba.sum(), [single["means"]])
        apart.append(g)
    total = sum(renderer.render(camera, **single).rgba.sum() for camera in views)
    (together,) = torch.autograd.grad(total, [single["means"]])
    assert torch.allclose(together, apart[0] + apart[1], rtol=1e-5, atol=1e-4 * together.abs().max())


def test_a_camera_may_be_moved_on_before_the_backward_pass(renderer):
    single, _ = leaves(random_arrays())
    views = [rs.Camera.look_at((3 * np.cos(a), 3 * np.sin(a), 1), (0, 0, 0), (0, 0, 1), 12, 10, 14) for a in (0, 2)]
    total = sum(renderer.render(camera, **single).rgba.sum() for camera in views)
    (expected,) = torch.autograd.grad(total, [single["means"]])
    one = views[0].downscaled(1)
    total = renderer.render(one, **single).rgba.sum()
    one.rotation, one.translation = views[1].rotation, views[1].translation
    total = total + renderer.render(one, **single).rgba.sum()
    (found,) = torch.autograd.grad(total, [single["means"]])
    assert torch.allclose(found, expected, rtol=1e-5, atol=1e-4 * expected.abs().max())


def test_a_pass_that_failed_meanwhile_does_not_matter(renderer):
    single, _ = leaves(random_arrays())
    camera = rs.Camera.look_at((3, 0, 1), (0, 0, 0), (0, 0, 1), 12, 10, 14)
    (expected,) = torch.autograd.grad(renderer.render(camera, **single).rgba.sum(), [single["means"]])
    seen = renderer.render(camera, **single).rgba.sum()
    with pytest.raises(rs.UsageError):
        renderer.render(rs.Camera(0, 10, 14.0), **single)
    (found,) = torch.autograd.grad(seen, [single["means"]])
    assert torch.allclose(found, expected, rtol=1e-5, atol=1e-4 * expected.abs().max())


@pytest.fixture
def hasty_threads():
    """The interpreter changes threads as often as it can."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


def assert_threads_find(calls, expected, rounds=25):
    """Functions that are called again and again, each in a thread of its own, find what they find alone."""

    def again(call):
        return [call() for _ in range(rounds)]

    with concurrent.futures.ThreadPoolExecutor(len(calls)) as threads:
        found = [each.result() for each in [threads.submit(again, call) for call in calls]]
    for several, one in zip(found, expected):
        for each in several:
            assert torch.allclose(each, one, rtol=1e-4, atol=1e-4 * one.abs().max())


def test_threads_share_a_renderer(renderer, hasty_threads):
    def view(angle, seed):
        camera = rs.Camera.look_at((3 * np.cos(angle), 3 * np.sin(angle), 1), (0, 0, 0), (0, 0, 1), 12, 10, 14)
        single, _ = leaves(random_arrays(seed=seed))
        return lambda: torch.autograd.grad(renderer.render(camera, **single).rgba.sum(), [single["means"]])[0]

    def rays(seed):
        single, _ = leaves(random_arrays(seed=seed))
        origins = torch.tensor([[0.0, 0.0, -3.0], [0.1, 0.1, -3.0]])
        directions = torch.tensor([[0.0, 0.0, 1.0]]).repeat(2, 1)
        return lambda: torch.autograd.grad(
            renderer.trace(origins, directions, **single).color.sum(), [single["means"]])[0]

    calls = [view(0, 3), view(2, 4), view(4, 5), rays(3)]
    assert_threads_find(calls, [call() for call in calls])


def test_pictures_without_gradients_are_the_same(renderer):
    single, _ = leaves(random_arrays())
    camera = rs.Camera.look_at((3, 0, 1), (0, 0, 0), (0, 0, 1), 12, 10, 14)
    graded = renderer.render(camera, **single).rgba
    with torch.no_grad():
        plain = renderer.render(camera, **single).rgba
    assert graded.requires_grad and not plain.requires_grad
    assert torch.equal(graded.detach(), plain)


def test_gradients_that_raise_clamped_colors_pass_if_asked_for(context):
    arrays = random_arrays(sh_degree=0)
    arrays["sh"][:] = -2  # below black
    single, _ = leaves(arrays)
    camera = rs.Camera(16, 12, 16.0, translation=(0, 0, 3))
    for raised in (False, True):
        renderer = rt.Renderer(context, rs.TraceOptions(raise_clamped=raised))
        color = renderer.render(camera, **single).rgba[..., :3].sum()
        for wish in (1, -1):  # of a loss that falls with the colour, and rises with it
            (gradient,) = torch.autograd.grad(-wish * color, [single["sh"]], retain_graph=True)
            assert gradient.any() == (raised and wish > 0)


def test_gradients_of_gradients_are_refused(renderer):
    single, _ = leaves(random_arrays())
    camera = rs.Camera(4, 4, 4.0, translation=(0, 0, 3))
    origins, directions = torch.tensor([[0.0, 0.0, -3.0]]), torch.tensor([[0.0, 0.0, 1.0]])
    for seen in (renderer.render(camera, **single).rgba, renderer.trace(origins, directions, **single).color):
        (slope,) = torch.autograd.grad(seen.square().sum(), [single["means"]], create_graph=True)
        with pytest.raises(RuntimeError, match="once_differentiable"):
            slope.square().sum().backward()


def test_a_viewmat_that_is_no_rigid_motion_is_refused(renderer):
    single, _ = leaves(random_arrays())
    camera = rs.Camera(4, 4, 4.0)
    rigid = pose(torch.tensor([0.2, -0.3, 0.1, 0.05, 2.4]))
    renderer.render(camera, **single, viewmat=rigid)
    for factors in ((2.0, 2, 2, 1), (-1, 1, 1, 1)):
        wrong = rigid * torch.tensor(factors)[:, None]
        with pytest.raises(rs.UsageError, match="a rotation that scales, shears or mirrors"):
            renderer.render(camera, **single, viewmat=wrong)
    with pytest.raises(rs.UsageError, match=r"viewmat has the last row .* in place of 0 0 0 1: is it transposed\?"):
        renderer.render(camera, **single, viewmat=rigid.T)
    with pytest.raises(rs.UsageError, match="viewmat has numbers that are not finite"):
        renderer.render(camera, **single, viewmat=rigid / 0)
    with pytest.raises(rs.UsageError, match=r"viewmat has the shape \(1, 4, 4\), but \(4, 4\) is needed"):
        renderer.render(camera, **single, viewmat=rigid[None])


def test_wrong_tensors_are_refused_in_one_sentence(renderer):
    single, double = leaves(random_arrays())
    camera = rs.Camera(4, 4, 4.0, translation=(0, 0, 3))
    with pytest.raises(TypeError, match="means is a tensor of torch.float64"):
        renderer.render(camera, **{**single, "means": double["means"]})
    with pytest.raises(ValueError, match="means is not contiguous"):
        renderer.render(camera, **{**single, "means": torch.rand(3, 7).T})
    with pytest.raises(TypeError, match="means has to be a tensor of float32, not NoneType"):
        renderer.render(camera, **{**single, "means": None})
    with pytest.raises(TypeError, match=r"means has to be .*, not ndarray: torch.from_numpy\(\) makes one"):
        renderer.render(camera, **{**single, "means": np.zeros((7, 3), np.float32)})
    with pytest.raises(TypeError, match="camera has to be Camera, not NoneType"):
        renderer.render(None, **single)
    with pytest.raises(ValueError, match="quaternions has 7 rows, but there are 6 means"):
        renderer.render(camera, **{**single, "means": single["means"][:6]})


def test_a_renderer_refuses_in_one_sentence():
    for wrong, sentence in (
        ({"context": 2.5}, "context has to be a Context or a device, not float"),
        ({"options": "peak"}, "options has to be TraceOptions or None, not str"),
        ({"mirrors": 3}, "mirrors has to be Mirrors or None, not int"),
    ):
        with pytest.raises(TypeError) as caught:
            rt.Renderer(**wrong)
        assert str(caught.value) == sentence


def test_a_renderer_takes_the_first_device_by_its_number(monkeypatch):
    class Asked:
        def __init__(self, device):
            self.device = device

    monkeypatch.setattr(rt.rs, "Context", Asked)
    monkeypatch.setattr(rt.rs, "Tracer", lambda *_, **__: None)
    assert [rt.Renderer(device).context.device for device in (0, None, "name")] == [0, "", "name"]


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


# What is not supported: every argument of gsplat's is used, or refused by its name.
REFUSED = {
    "far_plane": 10.0, "radius_clip": 1.0, "eps2d": 0.3, "packed": True, "tile_size": 16, "sparse_grad": True,
    "absgrad": True, "rasterize_mode": "antialiased", "channel_chunk": 32, "distributed": True,
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
            "sh_degree", "backgrounds", "render_mode", "options"}
    assert set(inspect.signature(rt.rasterization).parameters) == used | set(REFUSED)


def test_programs_end_cleanly_whatever_is_left():
    # Graphs that are alive at the end are never freed by PyTorch.
    code = """
import threading
import torch
import raysplats as rs
import raysplats.torch as rt

def scene():
    viewmat = torch.eye(4)
    viewmat[2, 3] = 3
    return {"means": torch.zeros(1, 3, requires_grad=True), "quats": torch.tensor([[1.0, 0, 0, 0]]),
            "scales": torch.full((1, 3), 0.2), "opacities": torch.ones(1), "colors": torch.rand(1, 3),
            "viewmats": viewmat[None], "Ks": torch.tensor([[[8.0, 0, 4], [0, 8, 3], [0, 0, 1]]]), "width": 8, "height": 6}

left = [rt.rasterization(**scene())[0].sum()]
left[0].backward()
threads = [threading.Thread(target=lambda: left.append(rt.rasterization(**scene())[0].sum())) for _ in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
renderer = rt.Renderer()
one = torch.zeros(1, 3, requires_grad=True)
parameters = one, torch.ones(1, 4), one, torch.zeros(1), torch.zeros(1, 1, 3)
left.append(renderer.trace(one - 3, one + 1, *parameters).color.sum())
left.append(renderer.render(rs.Camera(8, 6, 8.0, translation=(0, 0, 3)), *parameters).rgba.sum())
assert len(left) == 6
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0 and ended.stderr == ""


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


class Photos(torch.utils.data.Dataset):
    def __init__(self, dataset):
        self.dataset = dataset

    def __len__(self):
        return len(self.dataset)

    def __getitem__(self, i):
        view = self.dataset.views[i]
        return view.camera, torch.from_numpy(view.picture())


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_of_a_data_loader_read_photos(context, tmp_path, method):
    pytest.importorskip("PIL")
    dataset = rs.Dataset.load(photos.take(context, tmp_path / "photos"))
    expected = [view.picture() for view in dataset.views]
    loader = torch.utils.data.DataLoader(Photos(dataset), batch_size=None, num_workers=2, multiprocessing_context=method)
    found = list(loader)
    assert len(found) == len(expected) == 16
    for (camera, picture), photo, view in zip(found, expected, dataset.views):
        assert np.array_equal(picture.numpy(), photo) and camera.name == view.camera.name
