# SPDX-License-Identifier: Apache-2.0
import shutil

import numpy as np
import pytest

import raysplats as rs
from conftest import as_gaussians


def test_a_ply_comes_back_as_it_was(tmp_path, arrays):
    g = as_gaussians(arrays)
    options = rs.TraceOptions(hit_order="peak", quantile=9.0, background=(0.25, 0.5, 1.0))
    g.save(tmp_path / "model.ply", options)
    back = rs.Gaussians.load(tmp_path / "model.ply")
    for name in ("means", "log_scales", "opacities", "sh"):
        assert np.array_equal(getattr(back, name), getattr(g, name)), name
    lengths = np.linalg.norm(g.quaternions, axis=1, keepdims=True)
    assert np.allclose(back.quaternions, g.quaternions / lengths, atol=1e-6)
    read = rs.TraceOptions.load(tmp_path / "model.ply")
    assert (read.hit_order, read.quantile, tuple(read.background)) == ("peak", 9.0, (0.25, 0.5, 1.0))
    g.save(tmp_path / "plain.ply", origin=(1e6, 0, -2.5))
    assert rs.Gaussians.load_origin(tmp_path / "plain.ply") == (1e6, 0, -2.5)
    assert rs.Gaussians.load_origin(tmp_path / "model.ply") == (0, 0, 0)
    assert rs.TraceOptions.load(tmp_path / "plain.ply") is None


@pytest.mark.parametrize("name", ["a.compressed.ply", "a.spz", "a.splat", "a.sog", "a.glb"])
def test_other_formats(tmp_path, arrays, name):
    arrays["sh"] = arrays["sh"][:, :1]
    g = as_gaussians(arrays)
    g.save(tmp_path / name)
    back = rs.Gaussians.load(tmp_path / name)
    assert len(back) == len(g)
    # Formats may sort Gaussians and round numbers.
    found, expected = (np.sort(each.means, axis=0) for each in (back, g))
    assert np.abs(found - expected).max() < 0.01
    with pytest.raises(rs.UsageError):
        g.save(tmp_path / "a.obj")


def test_a_sog_is_read_from_its_folder(tmp_path, arrays):
    as_gaussians(arrays).save(tmp_path / "a.sog")
    shutil.unpack_archive(tmp_path / "a.sog", tmp_path / "unpacked", "zip")
    packed, unpacked = (rs.Gaussians.load(tmp_path / name) for name in ("a.sog", "unpacked"))
    assert np.array_equal(unpacked.means, packed.means)
    assert np.array_equal(unpacked.sh, packed.sh)


def test_errors_say_what_and_where(tmp_path):
    with pytest.raises(rs.DataError, match="nowhere.ply does not exist"):
        rs.Gaussians.load(tmp_path / "nowhere.ply")
    with pytest.raises(ValueError):  # what Python programs expect
        rs.Gaussians.load(tmp_path / "nowhere.ply")
    with pytest.raises(rs.DataError):
        rs.Dataset.load(tmp_path)
    assert issubclass(rs.UsageError, rs.Error) and issubclass(rs.ResourceError, MemoryError)


def test_errors_keep_their_text_where_it_is_no_utf8(tmp_path):
    (tmp_path / "a.ply").write_bytes(
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty fl\xffat x\nend_header\n0\n"
    )
    with pytest.raises(rs.DataError, match=r"the property type 'fl\\xffat' is unknown"):
        rs.Gaussians.load(tmp_path / "a.ply")


def test_cameras_come_back_as_they_were(tmp_path):
    camera = rs.Camera.look_at((1, 2, 3), (0, 0, 0), (0, 0, 1), 40, 30, 35.0)
    camera.name = "a.png"
    rs.write_cameras(tmp_path / "transforms.json", [camera])
    (back,) = rs.read_cameras(tmp_path / "transforms.json")
    assert np.allclose(back.rotation, camera.rotation) and np.allclose(back.center, (1, 2, 3))
    assert (back.width, back.height, back.fx, back.model) == (40, 30, 35.0, "pinhole")
    assert camera.downscaled(2).width == 20
    with pytest.raises(rs.UsageError, match="model is 'pinhole', 'opencv'"):
        camera.model = "fish"


@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_pictures_by_pillow(tmp_path, name, channels):
    pytest.importorskip("PIL")
    y, x = np.mgrid[0:24, 0:32].astype(np.float32)
    image = np.stack([x / 31, y / 23, (x + y) / 54, 0 * x + 1][:channels], axis=-1)
    rs.write_image(tmp_path / name, image)
    back = rs.read_image(tmp_path / name)
    kept = min(channels, 3) if name.endswith("jpg") else channels
    assert back.shape == (24, 32, kept) and back.dtype == np.float32
    assert np.abs(back - image[..., :kept]).max() < (0.03 if name.endswith("jpg") else 0.002)


def test_formats_that_pillow_lacks_are_named(tmp_path):
    pytest.importorskip("PIL")
    with pytest.raises(rs.DataError, match="Pillow knows no openexr"):
        rs.write_image(tmp_path / "a.exr", np.zeros((2, 2, 3), np.float32))
    assert not (tmp_path / "a.exr").exists()


def test_pictures_by_own_functions(tmp_path):
    from raysplats import _images

    asked = []

    def read(source, pixel_format):
        asked.append((source, pixel_format))
        return np.full((2, 3, 1), 0.5, np.float32)

    def encode(pixels, pixel_format, channel_names, color_space):
        asked.append((pixels.shape, pixel_format, channel_names, color_space))
        return b"\x76\x2f\x31\x01 and so on"

    rs.set_image_functions(read, encode)
    try:
        rs.write_image(tmp_path / "a.exr", np.zeros((2, 3, 4), np.float32))
        assert rs.read_image(tmp_path / "a.exr").shape == (2, 3, 1)
        assert asked == [((2, 3, 4), "openexr", list("RGBA"), ""), (str(tmp_path / "a.exr"), "openexr")]
        rs.set_image_functions(lambda *_: 7, lambda *_: "text")
        with pytest.raises(rs.DataError, match="the picture has to be an array"):
            rs.read_image(tmp_path / "a.exr")
        with pytest.raises(rs.DataError, match="gave no bytes"):
            rs.write_image(tmp_path / "b.png", np.zeros((2, 3, 4), np.float32))
    finally:
        rs.set_image_functions(_images.read, _images.encode)


def test_changes_are_those_of_convert(arrays):
    arrays["means"][0] = (1, 0, 0)
    g = as_gaussians(arrays)
    turned = g.changed(scale=2, rotate=(0, 0, 90), translate=(0, 0, 3), sh_degree=1)
    expected = 2 * g.means @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + (0, 0, 3)
    assert np.abs(turned.means - expected).max() < 1e-5 and turned.sh_degree == 1
    assert np.abs(turned.log_scales - g.log_scales - np.log(2)).max() < 1e-5
    # Degree 1 is -y, z, -x of the direction: x goes to y, y to -x.
    assert np.abs(turned.sh[:, 1] - g.sh[:, 3]).max() < 1e-5 and np.abs(turned.sh[:, 3] + g.sh[:, 1]).max() < 1e-5
    assert np.abs(g.changed(up=(1, 0, 0)).means[0] - (0, -1, 0)).max() < 1e-6
    assert np.array_equal(g.changed(crop_min=(0.9, -1, -1)).means, g.means[:1])
    assert len(g.changed(crop_min=(-1, -1, -1), crop_max=(0.9, 1, 1))) == len(g) - 1
    bright = 1 / (1 + np.exp(-g.opacities)) >= 0.5
    assert np.array_equal(g.changed(min_opacity=0.5).means, g.means[bright])
    seen = np.arange(len(g), dtype=np.float32)
    assert np.array_equal(g.changed(max_gaussians=2, contributions=seen).means, g.means[-2:])
    with pytest.raises(rs.UsageError, match="contributions"):
        g.changed(max_gaussians=2, contributions=seen[1:])
    assert len(g.changed(max_gaussians=3)) == 3 and np.array_equal(g.changed().sh, g.sh)
    with pytest.raises(rs.UsageError, match="scale is above 0"):
        g.changed(scale=0)
    with pytest.raises(rs.UsageError, match="no direction"):
        g.changed(up=(0, 0, 0))
