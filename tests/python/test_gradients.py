# SPDX-License-Identifier: Apache-2.0
"""Pictures, rays and their gradients against the reference: central differences in double precision."""

import numpy as np
import pytest

import raysplats as rs
import reference
from conftest import as_gaussians, random_arrays

QUANTILE = 11.3449
STEP = 1e-6
# Of the largest number of a class of parameters.
TOLERANCE = 1e-4


def rays(count, seed):
    """Rays towards the Gaussians, with directions that have no unit length."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3))
    origins *= 2.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = (rng.uniform(-0.3, 0.3, (count, 3)) - origins) * rng.uniform(0.5, 2, (count, 1))
    # What the module is given, exactly.
    return origins.astype(np.float32).astype(float), directions.astype(np.float32).astype(float)


def rounded(arrays):
    return {k: v.astype(np.float32).astype(float) for k, v in arrays.items()}


def differences(loss, values):
    """Central differences of loss() for an array that it reads."""
    out = np.zeros_like(values)
    for i in np.ndindex(values.shape):
        kept = values[i]
        values[i] = kept + STEP
        above = loss()
        values[i] = kept - STEP
        out[i] = (above - loss()) / (2 * STEP)
        values[i] = kept
    return out


def assert_close(name, found, expected):
    scale = np.abs(expected).max()
    assert scale > 1e-3, f"{name}: the test sees nothing"
    assert np.abs(found - expected).max() <= TOLERANCE * scale, name


def test_ends_of_rays(context, arrays):
    tracer, model = rs.Tracer(context), rs.Model(context, as_gaussians(arrays))
    origins, directions = (each.astype(np.float32) for each in rays(9, seed=5))

    def seen(**ends):
        return tracer.trace(model, origins, directions, **ends).color

    begin, end = (np.full(9, each, np.float32) for each in (1, 2))
    expected = seen(t_min=begin, t_max=end)
    assert not np.array_equal(expected, seen())
    for kind in (int, float, np.float32, np.float64, np.int64, np.array):
        assert np.array_equal(seen(t_min=kind(1), t_max=kind(2)), expected), kind
    for wrong in ([2] * 9, "2", None, end.astype(float)):
        with pytest.raises(TypeError, match="t_max"):
            seen(t_max=wrong)


@pytest.mark.parametrize("hit_order", ["entry", "peak"])
@pytest.mark.parametrize("color_direction", ["ray", "from-origin"])
def test_rays(context, hit_order, color_direction):
    p = rounded(random_arrays())
    origins, directions = rays(9, seed=5)
    rng = np.random.default_rng(1)
    d_color, d_alpha = rng.normal(size=(9, 3)), rng.normal(size=9)
    mode = {"quantile": QUANTILE, "peak": hit_order == "peak", "from_origin": color_direction == "from-origin"}

    def seen():
        return [reference.trace(np, p, o, d, **mode) for o, d in zip(origins, directions)]

    def loss():
        return sum((c * w).sum() + a * v for (c, a), w, v in zip(seen(), d_color, d_alpha))

    model = rs.Model(context, as_gaussians(p))
    tracer = rs.Tracer(context, rs.TraceOptions(hit_order=hit_order, quantile=QUANTILE))
    traced = tracer.trace(
        model, origins.astype(np.float32), directions.astype(np.float32),
        color_direction=color_direction, differentiable=True,
    )
    assert np.abs(traced.color - [c for c, _ in seen()]).max() < 2e-5
    assert np.abs(traced.alpha - [a for _, a in seen()]).max() < 2e-5
    assert traced.hits.max() >= 3
    found = tracer.backward_rays(model, d_color.astype(np.float32), d_alpha.astype(np.float32))
    for name in reference.NAMES:
        assert_close(name, getattr(found.parameters, name), differences(loss, p[name]))
    assert_close("origins", found.origins, differences(loss, origins))
    assert_close("directions", found.directions, differences(loss, directions))


def test_views(context):
    p = rounded(random_arrays(count=5, seed=8, sh_degree=1))
    camera = rs.Camera.look_at((0.4, -0.5, -2.5), (0, 0, 0), (0, -1, 0), 6, 5, 7.0)
    rng = np.random.default_rng(2)
    weights = rng.normal(size=(5, 6, 4)).astype(np.float32)
    base = np.array(camera.rotation)
    turn, center = np.zeros(3), np.array(camera.center)

    def turned():
        w = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
        return (np.eye(3) + w + w @ w / 2) @ base

    def seen():
        directions = reference.camera_rays(np, camera, turned(), center)
        rows = [reference.trace(np, p, center, d, QUANTILE, from_origin=True) for d in directions]
        return np.array([[*c, a] for c, a in rows]).reshape(5, 6, 4)

    def loss():
        return (seen() * weights).sum()

    model = rs.Model(context, as_gaussians(p))
    tracer = rs.Tracer(context, rs.TraceOptions(quantile=QUANTILE, depth=True))
    picture = tracer.render(model, camera, differentiable=True)
    assert np.abs(picture.rgba - seen()).max() < 2e-5
    normals = tracer.normals(model, camera)
    assert normals.shape == (*picture.alpha.shape, 3) and np.abs(normals).max() > 0.1
    assert (np.linalg.norm(normals, axis=2) <= picture.alpha + 1e-5).all()
    assert picture.hits.max() >= 2 and 1.5 < picture.expected_depth.max() < 4
    found = tracer.backward(model, weights)
    for name in reference.NAMES:
        assert_close(name, getattr(found.parameters, name), differences(loss, p[name]))
    assert_close("center", found.camera_center, differences(loss, center))
    assert_close("rotation", found.camera_rotation, differences(loss, turn))


def test_contributions_make_up_alpha(context, arrays):
    gaussians = as_gaussians(arrays)
    camera = rs.Camera.look_at([0, -3, 0.5], [0, 0, 0], [0, 0, 1], 40, 30, 40.0)
    found = rs.contributions(context, gaussians, [camera])
    assert found.shape == (len(gaussians),) and found.dtype == np.float32 and found.min() >= 0
    alpha = rs.Tracer(context).render(rs.Model(context, gaussians), camera).alpha
    assert found.sum() == pytest.approx(alpha.mean(), rel=1e-4)


def test_poses_and_backgrounds_that_mean_nothing_are_refused(context, arrays):
    model = rs.Model(context, as_gaussians(arrays))
    tracer = rs.Tracer(context)
    scaled = rs.Camera(4, 3, 4.0, rotation=[[2, 0, 0], [0, 1, 0], [0, 0, 1]], translation=(0, 0, 3), name="a")
    with pytest.raises(rs.UsageError, match="'a' has a rotation that scales, shears or mirrors"):
        tracer.render(model, scaled)
    for background in ((np.nan, 0, 0), (0, 0, np.inf)):
        with pytest.raises(rs.UsageError, match="background .* is not finite"):
            tracer.set_background(background)
        with pytest.raises(rs.UsageError, match="background .* is not finite"):
            rs.Tracer(context, rs.TraceOptions(background=background))
    for factor in (0, -1, np.nan):
        with pytest.raises(rs.UsageError, match="cannot be downscaled"):
            scaled.downscaled(factor)


def test_backward_is_refused_where_it_means_nothing(context, arrays):
    model = rs.Model(context, as_gaussians(arrays))
    tracer = rs.Tracer(context)
    camera = rs.Camera(4, 3, 4.0, translation=(0, 0, 3))
    with pytest.raises(rs.UsageError):
        tracer.backward(model, np.zeros((3, 4, 4), np.float32))
    tracer.render(model, camera, differentiable=True)
    with pytest.raises(rs.UsageError):
        tracer.backward(model, np.zeros((4, 4, 4), np.float32))
    with pytest.raises(ValueError, match="gradient has the shape"):
        tracer.backward(model, np.zeros((3, 4, 3), np.float32))
    model.assign(as_gaussians(random_arrays(seed=9)))
    with pytest.raises(rs.UsageError, match="changed"):
        tracer.backward(model, np.zeros((3, 4, 4), np.float32))
