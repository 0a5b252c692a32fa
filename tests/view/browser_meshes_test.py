#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Meshes that are dropped on the page.
usage: browser_meshes_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import os
import sys
import time

from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase  # noqa: E402


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


if __name__ == "__main__":
    main()
