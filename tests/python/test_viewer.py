# SPDX-License-Identifier: Apache-2.0
"""raysplats.Viewer: the page of `raysplats view`, asked as a browser asks."""

import gc
import io
import json
import pathlib
import signal
import subprocess
import sys
import textwrap
import threading
import webbrowser

import numpy as np
import pytest

import raysplats as rs

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "view"))
from program import Address, Channel, view  # noqa: E402

Image = pytest.importorskip("PIL.Image")


def ball(color):
    """One opaque ball of a colour at the origin."""
    sh = (np.asarray(color, np.float32) - 0.5) / 0.28209479
    return rs.Gaussians(
        means=np.zeros((1, 3), np.float32),
        quaternions=np.array([[1, 0, 0, 0]], np.float32),
        log_scales=np.full((1, 3), -0.5, np.float32),
        opacities=np.full(1, 8, np.float32),
        sh=sh.reshape(1, 1, 3),
    )


def seen(channel, number):
    """The colour in the middle of the next last picture of view `number`."""
    while True:
        kind, *rest = channel.receive()
        if kind == "picture" and rest[0]["view"] == number and rest[0]["flags"] & 1:
            picture = Image.open(io.BytesIO(rest[1])).convert("RGB")
            return np.asarray(picture)[24, 32] / 255.0


def test_a_page_sees_the_model_and_its_changes(context):
    model = rs.Model(context, ball((1, 0, 0)))
    camera = rs.Camera.look_at((0, 0, -4), (0, 0, 0), (0, -1, 0), 64, 48, 60.0)
    with rs.Viewer(
        context, model, cameras=[camera], name="ball", origin=(4e6, 0.1, 0), open=False
    ) as viewer:
        page = Address(viewer.url)
        assert page.ask("/")[0] == 403
        state = json.loads(page.ask("/api/state", Cookie=page.cookie())[2])
        assert state["name"] == "ball" and state["about"] == "1 Gaussians, SH degree 0"
        assert len(state["cameras"]) == 1
        assert state["origin"] == [4e6, 0.1, 0]
        with Channel(page) as channel:
            channel.send_json(**view(1))
            assert np.allclose(seen(channel, 1), (1, 0, 0), atol=0.05)
            # What else uses the context goes on meanwhile.
            assert rs.Tracer(context).render(model, camera).color[24, 32, 0] > 0.9
            model.assign(ball((0, 0, 1)))
            while not np.allclose(seen(channel, 1), (0, 0, 1), atol=0.05):
                pass
    viewer.close()
    with pytest.raises(OSError):
        page.connect()


def test_a_browser_is_opened_and_what_is_gone_ends(context, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    viewer = rs.Viewer(context, rs.Model(context, ball((1, 1, 1))))
    assert opened == [viewer.url] and repr(viewer) == f"<raysplats.Viewer: {viewer.url}>"
    page = Address(viewer.url)
    waiting = threading.Thread(target=viewer.wait)
    waiting.start()
    viewer.close()
    waiting.join(10)
    assert not waiting.is_alive()
    del viewer
    gc.collect()
    with pytest.raises(OSError):
        page.connect()
    for wrong in ({"host": "nowhere"}, {"max_size": 0}, {"cameras": [rs.Camera(4, 4, float("nan"))]}):
        with pytest.raises(rs.Error):
            rs.Viewer(context, rs.Model(context, ball((1, 1, 1))), open=False, **wrong)


def test_ctrl_c_and_the_end_of_the_program_end_it():
    program = textwrap.dedent("""
        import os, sys, numpy as np, raysplats as rs
        context = rs.Context()
        model = rs.Model(context, rs.Gaussians(
            np.zeros((1, 3), np.float32), np.ones((1, 4), np.float32), np.zeros((1, 3), np.float32),
            np.zeros(1, np.float32), np.zeros((1, 1, 3), np.float32)))
        viewer = rs.Viewer(context, model, open=False)
        print("ready", flush=True)
        if sys.argv[1] == "wait":
            viewer.wait()
        if sys.argv[1] == "fork":
            child = os.fork()
            if child:
                assert os.waitpid(child, 0)[1] == 0
    """)
    run = subprocess.Popen([sys.executable, "-c", program, "wait"], stdout=subprocess.PIPE,
                           stderr=subprocess.PIPE, text=True)
    assert run.stdout.readline() == "ready\n"
    run.send_signal(signal.SIGINT)
    assert "KeyboardInterrupt" in run.communicate(timeout=60)[1]
    for end in ("end", "fork"):
        run = subprocess.run([sys.executable, "-c", program, end], capture_output=True, text=True, timeout=120)
        assert (run.returncode, run.stdout, run.stderr) == (0, "ready\n", "")
