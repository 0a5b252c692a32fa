# SPDX-License-Identifier: Apache-2.0
"""What describes work, and what results say of it, is copied and pickled whole: workers of data loaders need it."""

import copy
import json
import pickle
import shutil

import numpy as np
import pytest

import photos
import raysplats as rs
from conftest import as_gaussians, random_arrays


def told(thing):
    """All that Python sees of an object, as what can be compared."""
    if isinstance(thing, np.ndarray):
        return thing.dtype, thing.shape, thing.tobytes()
    if isinstance(thing, (list, tuple)):
        return [told(each) for each in thing]
    if not type(thing).__module__.startswith("raysplats"):
        return thing
    names = [name for name in dir(type(thing)) if isinstance(getattr(type(thing), name), property)]
    return type(thing), {name: told(getattr(thing, name)) for name in names}


def pickled(thing, protocol):
    return pickle.loads(pickle.dumps(thing, protocol))


def assert_copies(thing):
    """They say and hold the same."""
    copies = [copy.copy(thing), copy.deepcopy(thing)]
    copies += [pickled(thing, protocol) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)]
    for each in copies:
        assert each is not thing and told(each) == told(thing)
        assert pickle.dumps(each) == pickle.dumps(thing)
    return copies


def square():
    corners = np.float32([[-2, -2, 1], [2, -2, 1], [2, 2, 1], [-2, 2, 1]])
    triangles = np.uint32([[0, 1, 2], [0, 2, 3]])
    uvs = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    return rs.Mesh(corners, triangles, np.uint32([1, 0]), np.tile(np.float32([0, 0, 1]), (4, 1)), uvs)


def trace_options():
    options = rs.TraceOptions.peak_order()
    options.sky, options.background, options.raise_clamped = [(0.1, 0.2, 0.3)], (0.1, 0.7, 1 / 3), True
    options.memory_budget, options.gradient_sum, options.launch_budget_ms = 2**40, "exact", 0.1
    return options


def scene():
    return rs.Scene(
        gaussians=as_gaussians(random_arrays()), meshes=[square()],
        materials=[rs.Material(name="glass", kind="glass", shadow=0.25), rs.Material()],
        textures=[np.random.default_rng(1).random((2, 3, 3), np.float32)],
        lights=[rs.Light(kind="sphere", radius=0.5)],
        environment=rs.Environment(equirect=np.ones((2, 4, 3), np.float32), rotation=30.0),
        render=rs.RenderSettings(samples=4, shadows=rs.ShadowSettings(strength=0.1)), trace=trace_options(),
    )


def camera():
    return rs.Camera(
        640, 480, 500.125, 510.0, 1 / 3, 2 / 3, rotation=[[0, 1, 0], [-1, 0, 0], [0, 0, 1]], translation=(0.1, 2, 3),
        model="fisheye", distortion=(0.1, 0.2, 0.3, 0, 0, 0.4), name="images/één.png")


PLAIN = [
    camera, scene, square, trace_options, lambda: as_gaussians(random_arrays()), lambda: rs.Gaussians.zeros(0, sh_degree=2),
    lambda: rs.Mirrors(meshes=[square()], materials=[rs.Material(kind="mirror")], max_bounces=2),
    lambda: rs.Environment(), lambda: rs.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)),
]


@pytest.mark.parametrize("make", PLAIN)
def test_plain_data(make):
    assert_copies(make())


def test_training_options():
    options = rs.TrainOptions(iterations=77, background="0.1,0.2,0.3", seed=2**63, densify_until=0.3)
    for each in assert_copies(options):
        assert each.to_toml() == options.to_toml()


def test_copies_are_apart():
    first = as_gaussians(random_arrays())
    for second in (copy.copy(first), copy.deepcopy(first)):
        second.means[:] = 0
        assert first.means.any()
    one = trace_options()
    other = copy.copy(one)
    other.quantile = 1.0
    assert one.quantile != 1.0


def test_meshes_keep_what_python_does_not_see():
    positions, triangles, materials, normals, uvs = pickled(square(), 5).__getstate__()
    assert np.array_equal(normals, np.tile([0, 0, 1], (4, 1))) and np.array_equal(uvs[2], [1, 1])
    assert np.array_equal(materials, [1, 0]) and positions.shape == (4, 3) and triangles.shape == (2, 3)


def test_a_copied_model_is_drawn_alike(context):
    camera = rs.Camera(8, 6, 8.0, translation=(0, 0, 3))
    made = as_gaussians(random_arrays()), camera, trace_options()
    pictures = []
    for gaussians, view, options in (made, pickled(made, 5)):
        pictures.append(rs.Tracer(context, options).render(rs.Model(context, gaussians), view).rgba)
    assert pictures[0].any() and np.array_equal(*pictures)


@pytest.fixture(scope="module")
def folder(context, tmp_path_factory):
    pytest.importorskip("PIL")
    return photos.take(context, tmp_path_factory.mktemp("ring") / "photos")


def test_data_sets(context, folder, tmp_path):
    dataset = rs.Dataset.load(folder)
    for each in assert_copies(dataset):
        assert np.array_equal(each.views[3].picture(), dataset.views[3].picture())
        assert each.test_every == dataset.test_every == 8
    assert_copies(dataset.views[0])
    assert dataset.views[0].mask_path is None
    report = rs.evaluate(lambda camera: np.zeros((camera.height, camera.width, 3), np.float32), dataset, max_views=2)
    for each in assert_copies(report):
        assert each.json() == report.json() and len(each.images) == 2


def test_photos_of_other_lenses(folder):
    # The lens is the library's own, and what makes the picture of the photo.
    transforms = json.loads((folder / "transforms.json").read_text())
    twelve = [0.3, -0.2, 0.1, 0.05, -0.03, 0.002, 0.001, -0.002, 0.003, 0.001, -0.001, 0.002]
    for each in (transforms, *transforms["frames"]):
        each.update(camera_model="FISHEYE624", distortion_params=twelve)
    (folder / "transforms_fisheye.json").write_text(json.dumps(transforms))
    view = rs.Dataset.load(folder / "transforms_fisheye.json").views[0]
    assert view.source_camera.model == "photo-lens"
    for each in assert_copies(view):
        assert np.array_equal(each.picture(), view.picture())


def test_photos_with_bars(folder, tmp_path):
    image = pytest.importorskip("PIL.Image")
    shutil.copytree(folder, tmp_path / "video")
    random = np.random.default_rng(1)
    for view in rs.Dataset.load(tmp_path / "video").views:
        photo = random.integers(60, 256, (view.camera.height, view.camera.width, 3), np.uint8)
        photo[:4] = 0
        image.fromarray(photo).save(view.image_path)
    view = rs.Dataset.load(tmp_path / "video").views[0]
    for each in assert_copies(view):
        assert not each.picture()[:4, :, 3].any() and each.picture()[6:, :, 3].all()
    assert rs.Dataset.load(tmp_path / "video", borders="keep").views[0].picture()[..., 3].all()


def test_areas_to_ignore(folder):
    dataset = rs.Dataset.load(folder, ignore_areas=[(0, 0, 0.5, 0.25)])
    height = dataset.views[0].camera.height
    assert dataset.views[0].camera.height % 4 == 0 and dataset.views[0].camera.width % 2 == 0
    for each in assert_copies(dataset.views[0]):
        alpha = each.picture()[..., 3]
        assert not alpha[: height // 4, : alpha.shape[1] // 2].any()
        assert alpha[height // 4 :].all() and alpha[:, alpha.shape[1] // 2 :].all()
    for each in pickle.loads(pickle.dumps(dataset)).views:
        assert not each.picture()[0, 0, 3]
    with pytest.raises(rs.UsageError, match="is no box"):
        rs.Dataset.load(folder, ignore_areas=[(0.5, 0, 0.5, 1)])


def test_states_of_other_versions_are_refused():
    new = rs.TraceOptions.__new__(rs.TraceOptions)
    with pytest.raises(rs.UsageError, match="TraceOptions has no attribute 'quantil'"):
        new.__setstate__({"quantil": 1.0})
