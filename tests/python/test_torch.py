# SPDX-License-Identifier: Apache-2.0
"""raysplats.torch against autograd through the reference in double precision."""

import subprocess
import sys

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="no PyTorch: apt-get install python3-torch")

import photos  # noqa: E402
import raysplats as rs  # noqa: E402
import raysplats.torch as rt  # noqa: E402
import reference  # noqa: E402
from conftest import QUANTILE, TOLERANCE, assert_threads_find, random_arrays  # noqa: E402


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


def test_poses_beside_a_sky_or_mirrors_have_no_gradients(context):
    corners = torch.tensor([[-9.0, -9, 3], [9, -9, 3], [9, 9, 3]]).numpy()
    square = rs.Mesh(corners, np.uint32([[0, 1, 2]]))
    mirrors = rs.Mirrors(meshes=[square], materials=[rs.Material(kind="mirror")])
    single, _ = leaves(random_arrays())
    camera, viewmat = rs.Camera(4, 4, 4.0), torch.eye(4)
    viewmat[2, 3] = 3
    for made, what in (({"options": rs.TraceOptions(sky=[(0.1, 0.2, 0.3)])}, "a sky"), ({"mirrors": mirrors}, "mirrors")):
        renderer = rt.Renderer(context, **made)
        renderer.render(camera, **single, viewmat=viewmat).rgba.sum().backward()
        assert torch.isfinite(single["means"].grad).all()
        moved = viewmat.clone().requires_grad_()
        with torch.no_grad():
            assert renderer.render(camera, **single, viewmat=moved).rgba.any()
        with pytest.raises(rs.UsageError, match=f"those of a pose are not known beside {what}: call detach"):
            renderer.render(camera, **single, viewmat=moved)


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
