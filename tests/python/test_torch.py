# SPDX-License-Identifier: Apache-2.0
"""raysplats.torch against autograd through the reference in double precision."""

import concurrent.futures
import gc
import inspect
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
    for wrong in (2 * rigid, rigid * torch.tensor([[-1.0], [1], [1], [1]])):
        with pytest.raises(rs.UsageError, match="a rotation that scales, shears or mirrors"):
            renderer.render(camera, **single, viewmat=wrong)


def test_wrong_tensors_are_refused_in_one_sentence(renderer):
    single, double = leaves(random_arrays())
    camera = rs.Camera(4, 4, 4.0, translation=(0, 0, 3))
    with pytest.raises(TypeError, match="means is a tensor of torch.float64"):
        renderer.render(camera, **{**single, "means": double["means"]})
    with pytest.raises(ValueError, match="means is not contiguous"):
        renderer.render(camera, **{**single, "means": torch.rand(3, 7).T})
    with pytest.raises(TypeError, match="means has to be a tensor"):
        renderer.render(camera, **{**single, "means": None})
    with pytest.raises(ValueError, match="quaternions has 7 rows, but there are 6 means"):
        renderer.render(camera, **{**single, "means": single["means"][:6]})


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


def test_rasterization_knows_every_argument():
    used = {"means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "width", "height", "near_plane",
            "sh_degree", "backgrounds", "render_mode", "options"}
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
