# SPDX-License-Identifier: Apache-2.0
"""Threads, forks and the interpreter's lock."""

import os
import subprocess
import sys
import threading
import time

import numpy as np

import raysplats as rs
from conftest import as_gaussians, random_arrays


def test_other_threads_run_while_one_renders(context):
    model = rs.Model(context, as_gaussians(random_arrays(count=400)))
    tracer = rs.Tracer(context)
    camera = rs.Camera(700, 500, 500.0, translation=(0, 0, 2))
    tracer.render(model, camera)  # kernels
    done = threading.Event()

    def render():
        for _ in range(4):
            tracer.render(model, camera)
        done.set()

    # With the lock held they would have a turn between two pictures at most.
    thread = threading.Thread(target=render)
    thread.start()
    ticks = 0
    while not done.is_set():
        time.sleep(0.001)
        ticks += 1
    thread.join()
    assert ticks > 10


def test_threads_share_a_context(context):
    model = rs.Model(context, as_gaussians(random_arrays()))
    expected = rs.Tracer(context).render(model, rs.Camera(32, 24, 30.0, translation=(0, 0, 3))).rgba.copy()
    found = []

    def render():
        tracer = rs.Tracer(context)
        for _ in range(5):
            found.append(tracer.render(model, rs.Camera(32, 24, 30.0, translation=(0, 0, 3))).rgba)

    threads = [threading.Thread(target=render) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 15 and all(np.array_equal(each, expected) for each in found)


def test_a_thread_keeps_a_context_for_several_calls(context):
    model = rs.Model(context, as_gaussians(random_arrays()))
    tracer = rs.Tracer(context)
    camera = rs.Camera(32, 24, 30.0, translation=(0, 0, 3))
    drawn = threading.Event()

    def draw():
        tracer.render(model, camera)
        drawn.set()

    thread = threading.Thread(target=draw)
    with context.lock(), context.lock() as nothing:
        assert nothing is None
        tracer.render(model, camera, differentiable=True)
        thread.start()
        assert not drawn.wait(0.2)
        # What is kept is still that of this thread.
        assert tracer.backward(model, np.ones((24, 32, 4), np.float32)).parameters.means.any()
    thread.join()
    assert drawn.is_set()

    held = context.lock()
    with held:
        said = []

        def leave():
            try:
                held.__exit__(None, None, None)
            except rs.UsageError as error:
                said.append(str(error))

        thread = threading.Thread(target=leave)
        thread.start()
        thread.join()
    assert "does not have the lock" in said[0]


def test_counts_of_rays_wait_for_a_picture_of_another_thread():
    # In a process of its own, which ends: the two would wait for each other.
    code = """
import threading
import numpy as np
import raysplats as rs

context = rs.Context()
corners = np.array([[-9, -9, 3], [9, -9, 3], [9, 9, 3]], np.float32)
scene = rs.Scene(meshes=[rs.Mesh(corners, np.array([[0, 1, 2]], np.uint32))], materials=[rs.Material()],
                 render=rs.RenderSettings(samples=64))
tracer = rs.PathTracer(context, scene)
camera = rs.Camera(64, 48, 50.0)
thread = threading.Thread(target=tracer.render, args=(camera,))
thread.start()
while thread.is_alive():
    tracer.statistics
thread.join()
assert tracer.statistics.camera_rays == 64 * 64 * 48
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)


def test_a_fork_is_refused(context):
    model = rs.Model(context, as_gaussians(random_arrays()))
    tracer = rs.Tracer(context)
    calls = [
        lambda: tracer.render(model, rs.Camera(4, 4, 4.0, translation=(0, 0, 3))),
        model.download,
        rs.Context,
        rs.devices,
    ]
    receiver, sender = os.pipe()
    child = os.fork()
    if child == 0:
        said = []
        for call in calls:
            try:
                call()
            except rs.UsageError as error:
                said.append(str(error))
        del tracer, model  # leaves alone what is the parent's
        os.write(sender, "\n".join(said).encode())
        os._exit(0)
    os.close(sender)
    with os.fdopen(receiver) as stream:
        said = stream.read().split("\n")
    _, status = os.waitpid(child, 0)
    assert status == 0 and len(said) == 4
    assert all("OpenCL does not outlive a fork" in each for each in said)
    assert tracer.render(model, rs.Camera(4, 4, 4.0, translation=(0, 0, 3))).alpha.max() > 0
