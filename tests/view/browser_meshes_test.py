#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Meshes that are dropped on the page.
usage: browser_meshes_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import math
import os
import sys
import tempfile
import time

from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase, PageCase  # noqa: E402
from program import write_model  # noqa: E402


class MeshesTest(ModelCase):
    def test_a_mesh_is_dropped_and_moved(self):
        first = self.rest()
        corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
        cube = "".join("v {} {} {}\n".format(*c) for c in corners)
        cube += "".join("f {} {} {} {}\n".format(*f) for f in faces)
        drop = ("const files = new DataTransfer(); files.items.add(new File([arguments[0]], arguments[1]));"
                "document.getElementById('stage').dispatchEvent(new DragEvent('drop',"
                " {dataTransfer: files, bubbles: true, cancelable: true}));")
        before = self.pixels()
        self.page.execute_script(drop, cube, "cube.obj")
        self.wait("the mesh", lambda: self.page.execute_script("return (window.raysplats.meshes || []).length") == 1)
        second = self.rest(first["id"])
        self.assertEqual(second["last"]["samples"], 64)
        self.assertNotEqual(before, self.pixels())
        self.screenshot("mesh_mirror")
        # A double click meets the mesh, whose front is nearer than the ball in it.
        self.double_click()
        self.wait("a centre on the mesh", lambda: -1.5 < self.target()[2] < -0.8)
        second = self.rest(second["id"])
        # What meshes leave out is said beside the picture.
        self.wait("the picture's line", lambda: self.status().startswith(str(second["last"]["width"])))
        self.assertNotIn("meshes", self.status())
        self.slide("near", 0.1)
        second = self.rest(second["id"])
        self.assertTrue(self.status().endswith("beside meshes without: near limit"), self.status())
        # Its front is nearer than all of the model, and looks at the camera.
        self.slide("near", 0)
        second = self.rest(second["id"])
        for output, middle in (("depth", (255, 255, 255)), ("normals", (128, 128, 255))):
            Select(self.page.find_element(By.ID, "output")).select_by_value(output)
            second = self.rest(second["id"])
            for got, expected in zip(self.middle(), middle):
                self.assertAlmostEqual(got, expected, delta=12, msg=output)
            self.screenshot(f"mesh_{output}")
        Select(self.page.find_element(By.ID, "output")).select_by_value("color")
        second = self.rest(second["id"])
        Select(self.page.find_element(By.ID, "mesh-material")).select_by_value("diffuse")
        self.page.execute_script(
            "for (const [name, value] of [['mesh-turn-y', 30], ['mesh-at-x', 0.5], ['mesh-size', 0.1]]) {"
            "const s = document.getElementById(name); s.value = value;"
            "s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); }")
        self.wait("its place", lambda: self.page.execute_script(
            "const m = window.raysplats.meshes[0]; return m.material === 'diffuse' && m.rotate[1] === 30;"))
        third = self.rest(second["id"])
        self.screenshot("mesh_diffuse")
        self.page.find_element(By.ID, "mesh-save").click()
        text = self.wait("the scene", lambda: self.page.execute_script("return window.raysplats.scene"))
        self.assertIn('file = "cube.obj"', text)
        self.assertIn("rotate = [0, 30, 0]", text)
        # What is no mesh is a sentence, and the picture stays.
        shown = self.pixels()
        time.sleep(1.1)
        self.page.execute_script(drop, "v 0 0 0\nf 1 2 3\n", "bad.obj")
        self.wait("the sentence", lambda: any("bad.obj" in e for e in self.seen()["errors"]))
        self.page.find_element(By.ID, "mesh-remove").click()
        self.wait("no mesh", lambda: self.page.execute_script("return window.raysplats.meshes.length") == 0)
        self.rest(third["id"])
        self.assertNotEqual(shown, self.pixels())
        self.assertEqual(self.console(), [])


    def middle(self):
        return self.page.execute_script(
            "const p = document.getElementById('picture'); return Array.from(p.getContext('2d').getImageData("
            "p.width / 2, p.height / 2, 1, 1).data).slice(0, 3);")


class SceneTest(PageCase):
    """A scene file, which has surfaces of its own."""

    def arguments(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        write_model(os.path.join(folder, "model.ply"))
        scene = os.path.join(folder, "scene.toml")
        with open(scene, "w") as file:
            file.write('[[model]]\nfile = "model.ply"\n[camera]\nposition = [0, 0, -6]\ntarget = [0, 0, 0.1]\n'
                       "focal = 60\nwidth = 64\nheight = 48\n")
        return [scene]

    def test_a_scene_has_a_centre_and_says_what_it_has_not(self):
        first = self.rest()
        self.assertEqual(self.page.find_element(By.ID, "missing").text, "Not here, because of its surfaces: "
                         "near limit, order of hits, background.")
        for name in ("near", "order", "own-background", "background"):
            self.assertFalse(self.page.find_element(By.ID, name).is_enabled(), name)
        # The ball in the middle.
        self.assertGreater(math.dist(self.target(), (0, 0, 0)), 0.5)
        self.double_click()
        self.wait("a new centre", lambda: math.dist(self.target(), (0, 0, 0)) < 0.05)
        self.assertEqual(self.seen()["errors"], [])
        # Where nothing is, that is said, and stays to be read though pictures come.
        second = self.rest(first["id"])
        self.page.execute_script("window.raysplats.rig.look(Math.PI, 0);")
        target = self.target()
        self.double_click()
        self.wait("the sentence", lambda: self.status() == "Nothing is there to turn around")
        self.page.find_element(By.ID, "level").click()
        self.rest(second["id"])
        self.wait("the picture's line", lambda: "64 samples" in self.status())
        self.assertEqual(self.target(), target)
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
