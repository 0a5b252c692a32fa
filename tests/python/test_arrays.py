# SPDX-License-Identifier: Apache-2.0
"""What arrays are taken and given: views, never silent copies."""

import ctypes
import gc

import numpy as np
import pytest

import raysplats as rs
from conftest import as_gaussians, random_arrays


def test_views_write_through():
    g = rs.Gaussians.zeros(3, sh_degree=1)
    assert g.means.shape == (3, 3) and g.quaternions.shape == (3, 4)
    assert g.log_scales.shape == (3, 3) and g.opacities.shape == (3,) and g.sh.shape == (3, 4, 3)
    assert g.means.dtype == np.float32 and g.means.flags.c_contiguous and g.means.flags.writeable
    g.means[1] = [1, 2, 3]
    assert np.shares_memory(g.means, g.means)
    assert g.means[1].tolist() == [1, 2, 3]
    assert g.quaternions.tolist() == [[1, 0, 0, 0]] * 3


def test_views_are_changed_in_place_and_not_replaced():
    g = rs.Gaussians.zeros(3)
    g.means += 1
    g.sh *= 2
    assert g.means.tolist() == [[1, 1, 1]] * 3
    mesh = rs.Mesh(g.means, np.uint32([[0, 1, 2]]))
    mesh.positions -= 1
    mesh.triangles[0] = [2, 1, 0]
    assert not mesh.positions.any()
    for other in (np.ones((3, 3), np.float32), g.means[:2], g.means[::-1], 1):
        with pytest.raises(AttributeError) as caught:
            g.means = other
        assert str(caught.value) == "means cannot be replaced: write into it, as by means[:] = values"
    assert g.means.tolist() == [[1, 1, 1]] * 3


def test_results_are_changed_in_place(context, arrays):
    tracer, model = rs.Tracer(context), rs.Model(context, as_gaussians(arrays))
    picture = tracer.render(model, rs.Camera(8, 6, 8.0, translation=(0, 0, 3)), differentiable=True)
    before = picture.rgba.copy()
    picture.color *= 2
    picture.alpha /= 2
    assert np.array_equal(picture.rgba, before * np.float32([2, 2, 2, 0.5]))
    gradients = tracer.backward(model, picture.rgba.copy())
    before = gradients.camera_center.copy()
    gradients.camera_center *= 3
    assert np.array_equal(gradients.camera_center, 3 * before)
    traced = tracer.trace(model, np.zeros((2, 3), np.float32), np.ones((2, 3), np.float32))
    traced.hits += 1
    assert (traced.hits >= 1).all()


def test_what_a_scene_gives_outlives_what_it_holds():
    corners = np.arange(12, dtype=np.float32).reshape(4, 3)
    scene = rs.Scene(
        gaussians=rs.Gaussians.zeros(3), meshes=[rs.Mesh(corners, np.uint32([[0, 1, 2]]))],
        materials=[rs.Material(name="first")], lights=[rs.Light(radius=2)])
    mirrors = rs.Mirrors(meshes=scene.meshes, materials=scene.materials)
    given = scene.gaussians, scene.meshes[0], scene.materials[0], scene.lights[0], mirrors.meshes[0], mirrors.materials[0]
    means = given[0].means
    means[:] = 7
    assert not scene.gaussians.means.any()
    scene.gaussians = rs.Gaussians.zeros(100000)
    scene.meshes = scene.materials = scene.lights = mirrors.meshes = mirrors.materials = []
    ballast = [np.full((4, 3), 9, np.float32) for _ in range(1000)]
    assert means.tolist() == [[7, 7, 7]] * 3 and len(given[0]) == 3 and len(ballast) == 1000
    assert all(np.array_equal(each.positions, corners) for each in (given[1], given[4]))
    assert (given[2].name, given[3].radius, given[5].name) == ("first", 2, "first")


def test_numbers_that_are_copies_cannot_be_written_to():
    camera, options = rs.Camera(4, 3, 5.0, translation=(1, 2, 3)), rs.TraceOptions(sky=[(0.1, 0.2, 0.3)])
    with pytest.raises(TypeError, match="does not support item assignment"):
        camera.translation[2] += 1
    for numbers in (camera.rotation, camera.rotation[0], camera.center, camera.distortion, options.background,
                    options.sky, options.sky[0], rs.Material().color, rs.Environment(sky=options.sky).sky):
        with pytest.raises(TypeError, match="does not support item assignment"):
            numbers[0] = 5
    assert camera.translation == (1, 2, 3) and rs.TraceOptions().sky == ()
    camera.rotation = [list(row) for row in np.eye(3)[[1, 2, 0]]]
    assert camera.rotation == ((0, 1, 0), (0, 0, 1), (1, 0, 0))


def test_memory_that_there_is_not():
    for count in (10**15, 2**62):
        with pytest.raises(rs.ResourceError, match="The host has no memory left"):
            rs.Gaussians.zeros(count)


def test_a_view_keeps_its_owner():
    means = as_gaussians(random_arrays()).means
    expected = means.copy()
    gc.collect()
    ballast = [rs.Gaussians.zeros(1000) for _ in range(50)]
    assert np.array_equal(means, expected) and len(ballast) == 50


def test_results_are_views(context, arrays):
    model = rs.Model(context, as_gaussians(arrays))
    picture = rs.Tracer(context).render(model, rs.Camera.look_at((0, 0, -3), (0, 0, 0), (0, -1, 0), 8, 6, 8))
    assert picture.rgba.shape == (6, 8, 4)
    assert np.shares_memory(picture.rgba, picture.color) and np.shares_memory(picture.rgba, picture.alpha)
    assert np.array_equal(picture.rgba[..., :3], picture.color)
    assert picture.expected_depth is None and picture.hits is None


def test_a_model_outlives_the_name_of_its_context(arrays):
    context = rs.Context()
    model = rs.Model(context, as_gaussians(arrays))
    tracer = rs.Tracer(context)
    del context
    gc.collect()
    assert tracer.render(model, rs.Camera(4, 4, 4.0, translation=(0, 0, 3))).alpha.max() > 0


def in_records(a):
    """The same numbers in packed records, 13 bytes apart."""
    records = np.zeros(len(a), [("xyz", "f4", 3), ("label", "u1")])
    records["xyz"] = a
    return records["xyz"]


@pytest.mark.parametrize(
    ("change", "error", "sentence"),
    [
        (lambda a: a.astype(np.float64), TypeError, "means is an array of float64, but float32 is needed"),
        (lambda a: a.astype(np.float16), TypeError, "means is an array of float16"),
        (lambda a: a.astype(np.int32), TypeError, "means is an array of int32"),
        (lambda a: a.astype(">f4"), TypeError,
         "means is an array of >f4, whose bytes are in another order, but float32 is needed: convert it"),
        (lambda a: a.astype(str), TypeError, "means is an array of <U32, but float32 is needed"),
        (lambda a: in_records(a), ValueError, "means is not C-contiguous"),
        (lambda a: a.tolist(), TypeError, "means has to be an array of float32 of the shape (N, 3), as numpy's, not list"),
        (lambda a: a[:, :2].copy(), ValueError, "means has the shape (7, 2), but (N, 3) is needed"),
        (lambda a: a.ravel(), ValueError, "means has the shape (21,), but (N, 3) is needed"),
        (lambda a: np.asfortranarray(a), ValueError, "means is not C-contiguous"),
        (lambda a: np.repeat(a, 2, axis=0)[::2], ValueError, "means is not C-contiguous"),
        (lambda a: a[:-1].copy(), ValueError, "quaternions has 7 rows, but there are 6 means"),
    ],
)
def test_wrong_arrays_are_refused_in_one_sentence(arrays, change, error, sentence):
    given = {k: v.astype(np.float32) for k, v in arrays.items()}
    given["means"] = change(given["means"])
    with pytest.raises(error) as caught:
        rs.Gaussians(**given)
    assert sentence in str(caught.value) and "\n" not in str(caught.value)


class Foreign:
    """Numbers that claim by DLPack's first version to lie on an NVIDIA device."""

    class Tensor(ctypes.Structure):
        _fields_ = [
            ("data", ctypes.c_void_p), ("device", ctypes.c_int32 * 2), ("dimensions", ctypes.c_int32),
            ("code", ctypes.c_uint8), ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16),
            ("shape", ctypes.POINTER(ctypes.c_int64)), ("strides", ctypes.c_void_p), ("offset", ctypes.c_uint64),
            ("manager", ctypes.c_void_p), ("deleter", ctypes.c_void_p),
        ]

    def __init__(self, array):
        self.array = array
        self.shape = (ctypes.c_int64 * array.ndim)(*array.shape)
        self.tensor = self.Tensor(array.ctypes.data, (2, 0), array.ndim, 2, 32, 1, self.shape)

    def __dlpack_device__(self):
        return 2, 0

    def __dlpack__(self, **_):
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
        return new(ctypes.addressof(self.tensor), b"dltensor", None)


def test_arrays_of_other_devices_are_refused(arrays):
    given = {k: v.astype(np.float32) for k, v in arrays.items()}
    given["means"] = Foreign(given["means"])
    with pytest.raises(rs.UsageError) as caught:
        rs.Gaussians(**given)
    assert str(caught.value) == "means lies in the memory of a device: bring it to the CPU"


def test_read_only_arrays_are_enough(arrays):
    given = {k: v.astype(np.float32) for k, v in arrays.items()}
    for each in given.values():
        each.flags.writeable = False
    assert np.array_equal(rs.Gaussians(**given).sh, given["sh"])


def test_odd_numbers_of_coefficients(arrays):
    arrays["sh"] = arrays["sh"][:, :7]
    with pytest.raises(rs.UsageError, match="sh has 7 coefficients"):
        as_gaussians(arrays)
