# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

import raysplats as rs


def white_ball(z):
    g = rs.Gaussians.zeros(1)
    g.means[:] = (0, 0, z)
    g.log_scales[:] = math.log(0.3)
    g.opacities[:] = math.log(0.9 / 0.1)
    g.sh[:] = 1.7724539
    return g


def square(z):
    corners = np.array([[-2, -2, z], [2, -2, z], [2, 2, z], [-2, 2, z]], np.float32)
    return rs.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


def test_a_ball_behind_the_camera_is_seen_in_a_mirror(context):
    scene = rs.Scene(
        gaussians=white_ball(-3), meshes=[square(2)],
        materials=[rs.Material(kind="mirror", color=(0.8, 0.8, 0.8))],
        environment=rs.Environment(color=(0.1, 0.2, 0.4)),
    )
    tracer = rs.PathTracer(context, scene)
    camera = rs.Camera.look_at((0, 0, 0), (0, 0, 1), (0, -1, 0), 81, 61, 60.0)
    picture = tracer.render(camera)
    assert picture.shape == (61, 81, 4)
    assert picture[30, 40, 0] == pytest.approx(0.8 * (0.9 + 0.1 * 0.1), abs=1e-4)
    assert picture[30, 75, 2] == pytest.approx(0.8 * 0.4, abs=1e-4)
    assert tracer.statistics.continued_rays > 0
    tracer.set_meshes([])
    assert tracer.render(camera)[30, 40, 2] == pytest.approx(0.4, abs=1e-4)


def test_a_scene_file(context, tmp_path):
    white_ball(0).save(tmp_path / "ball.ply")
    (tmp_path / "square.obj").write_text("v -1 -1 1\nv 1 -1 1\nv 1 1 1\nf 1 2 3\n")
    (tmp_path / "scene.toml").write_text(
        '[[model]]\nfile = "ball.ply"\n[[mesh]]\nfile = "square.obj"\n'
        "[camera]\nposition = [0, 0, -4]\ntarget = [0, 0, 0]\nwidth = 16\nheight = 12\n"
    )
    loaded = rs.LoadedScene.load(tmp_path / "scene.toml")
    assert loaded.frames == 1 and len(loaded.scene.gaussians) == 1
    assert loaded.scene.meshes[0].positions.shape == (3, 3)
    picture = rs.PathTracer(context, loaded.scene).render(loaded.cameras[0])
    assert picture[6, 8, 3] > 0.5
    with pytest.raises(rs.UsageError, match="scene.toml"):
        (tmp_path / "scene.toml").write_text("[[modle]]\n")
        rs.LoadedScene.load(tmp_path / "scene.toml")


def test_a_scene_file_traces_a_run_as_it_was_trained(tmp_path):
    saved = tmp_path / "run" / "point_cloud" / "iteration_7"
    saved.mkdir(parents=True)
    white_ball(0).save(saved / "point_cloud.ply")
    (tmp_path / "run" / "config.toml").write_text(
        'background = "0.25,0.5,1"\nhit-order = "peak"\nquantile = 9\n'
    )
    (tmp_path / "scene.toml").write_text(
        '[[model]]\nfile = "run"\n[trace]\nmax-hits = 99\n'
        "[camera]\nposition = [0, 0, -4]\ntarget = [0, 0, 0]\nwidth = 16\nheight = 12\n"
    )
    scene = rs.LoadedScene.load(tmp_path / "scene.toml").scene
    assert len(scene.gaussians) == 1
    assert (scene.trace.hit_order, scene.trace.quantile, scene.trace.max_hits) == ("peak", 9, 99)
    assert tuple(scene.environment.color) == (0.25, 0.5, 1)


def test_records_check_what_they_are_given():
    settings = rs.RenderSettings(samples=4, shadows=rs.ShadowSettings(strength=0.0))
    assert settings.samples == 4 and settings.shadows.strength == 0.0
    assert rs.Material(shadow=0.5).shadow == 0.5 and rs.Material().shadow is None
    with pytest.raises(rs.UsageError, match="kind is 'diffuse', 'mirror'"):
        rs.Material(kind="mirrror")
    with pytest.raises(rs.UsageError, match="Light has no attribute 'colour'"):
        rs.Light(colour=(1, 1, 1))
    with pytest.raises(ValueError, match=r"triangles has the shape \(2,\), but \(N, 3\) is needed"):
        rs.Mesh(np.zeros((3, 3), np.float32), np.zeros(2, np.uint32))
    sky = np.random.default_rng(0).random((4, 8, 3)).astype(np.float32)
    environment = rs.Environment(equirect=sky)
    assert np.array_equal(environment.equirect, sky) and rs.Environment().equirect is None
    assert np.array_equal(rs.Scene(textures=[sky, sky]).textures[1], sky)


def test_metrics():
    image = np.random.default_rng(0).random((32, 40, 3)).astype(np.float32)
    assert rs.psnr(image, image + np.float32(0.1)) == pytest.approx(20.0, abs=1e-3)
    assert rs.ssim(image, image) == pytest.approx(1.0)
    with pytest.raises(rs.UsageError):
        rs.psnr(image, image[:-1].copy())
