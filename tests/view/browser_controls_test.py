#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Mouse, fingers, keys and the panel.
usage: browser_controls_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import math
import os
import subprocess
import sys
import tempfile

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase, PageCase  # noqa: E402
from program import write_model  # noqa: E402


class ControlsTest(ModelCase):
    def test_cameras_outputs_and_keys(self):
        first = self.rest()
        Select(self.page.find_element(By.ID, "cameras")).select_by_index(1)
        second = self.rest(first["id"])
        eye = self.page.execute_script("return window.raysplats.rig.eye")
        self.assertLess(math.dist(eye, (7, 0, 0)), 1e-6)
        self.screenshot("camera")
        Select(self.page.find_element(By.ID, "output")).select_by_value("depth")
        third = self.rest(second["id"])
        self.assertEqual(third["last"]["samples"], 1)
        for output in ("normals", "hits"):
            Select(self.page.find_element(By.ID, "output")).select_by_value(output)
            third = self.rest(third["id"])
            self.assertEqual(third["errors"], [])
            levels = self.page.execute_script(
                "const p = document.getElementById('picture');"
                "return new Set(p.getContext('2d').getImageData(0, 0, p.width, p.height).data).size;")
            self.assertGreater(levels, 20, output)
            self.screenshot(output)
        Select(self.page.find_element(By.ID, "output")).select_by_value("color")
        fourth = self.rest(third["id"])
        stage = self.page.find_element(By.ID, "picture")
        # Back to the first view; a double click in the middle puts the centre on the ball there.
        ActionChains(self.page).click(stage).send_keys("r").perform()
        self.rest(fourth["id"])
        ActionChains(self.page).double_click(stage).perform()
        target = self.wait("a new centre", lambda: (
            lambda t: t if math.dist(t, (0, 0, 0)) < 0.8 else None)(
                self.page.execute_script("return window.raysplats.rig.target")))
        self.assertEqual(len(target), 3)
        ActionChains(self.page).send_keys("?").perform()
        self.assertTrue(self.page.find_element(By.ID, "help").is_displayed())
        self.screenshot("help")
        self.page.execute_script("document.getElementById('help').close()")
        ActionChains(self.page).key_down("w").pause(0.5).key_up("w").perform()
        self.assertGreater(self.page.execute_script("return window.raysplats.rig.eye[2]"), -6)
        ActionChains(self.page).send_keys("k").perform()
        self.assertEqual(len(self.page.find_elements(By.CSS_SELECTOR, "#keyframes li")), 1)
        self.assertEqual(self.console(), [])

    def test_keys_act_wherever_they_are_of_no_use_to_a_control(self):
        self.rest()
        eye = "return [...window.raysplats.rig.eye]"

        def focus(name):
            self.page.execute_script("document.getElementById(arguments[0]).focus()", name)

        def value(name):
            return self.page.execute_script(
                "const e = document.getElementById(arguments[0]); return [e.value, e.checked]", name)

        def press(key):
            before = self.page.execute_script(eye)
            ActionChains(self.page).key_down(key).pause(0.4).key_up(key).perform()
            return math.dist(before, self.page.execute_script(eye))

        for name in ("output", "fov", "show-crop", "background", "load-path"):
            focus(name)
            before = value(name)
            for key in "wd":  # a list would go to "depth"
                self.assertGreater(press(key), 0.01, (name, key))
            self.assertEqual(value(name), before, name)
        # Arrows are a list's and a slider's own, and all keys those of a field.
        turn = "return window.raysplats.rig.axes[2]"
        for name, moves in (("output", True), ("fov", True), ("show-crop", False)):
            focus(name)
            before, ahead = value(name), self.page.execute_script(turn)
            ActionChains(self.page).key_down(Keys.ARROW_RIGHT).pause(0.2).key_up(Keys.ARROW_RIGHT).perform()
            self.assertEqual(value(name) != before, moves, name)
            self.assertEqual(math.dist(ahead, self.page.execute_script(turn)) > 1e-6, not moves, name)
        focus("path-width")
        self.assertEqual(press("w"), 0)
        ActionChains(self.page).send_keys("k").perform()
        self.assertEqual(self.page.find_elements(By.CSS_SELECTOR, "#keyframes li"), [])
        # Nothing acts behind the list of keys.
        focus("picture")
        ActionChains(self.page).send_keys("?").perform()
        self.assertTrue(self.page.find_element(By.ID, "help").is_displayed())
        self.assertEqual(press("w"), 0)
        ActionChains(self.page).send_keys("k").perform()
        self.assertEqual(self.page.find_elements(By.CSS_SELECTOR, "#keyframes li"), [])
        ActionChains(self.page).send_keys(Keys.ESCAPE).perform()
        self.assertGreater(press("w"), 0.01)
        self.assertEqual(self.console(), [])

    def test_every_control_is_reached_by_the_tab_key(self):
        self.rest()
        self.page.execute_script("document.getElementById('picture').focus()")
        reached = set()
        for _ in range(80):
            ActionChains(self.page).send_keys(Keys.TAB).perform()
            reached.add(self.page.execute_script("return document.activeElement.id"))
        for name in ("mesh-file", "load-path", "save-path", "png", "fov"):
            self.assertIn(name, reached)

    def test_a_frustum_in_the_picture_is_clicked(self):
        first = self.rest()
        stage = self.page.find_element(By.ID, "picture")
        ActionChains(self.page).scroll_from_origin(ScrollOrigin.from_element(stage), 0, 200).perform()
        ActionChains(self.page).send_keys("c").perform()
        away = self.rest(first["id"])
        self.assertTrue(self.painted("overlay"))
        eye = "return window.raysplats.rig.eye"
        self.assertLess(self.page.execute_script(eye)[2], -7)
        # Beside its tip there is nothing to go to. The tip itself is in the middle, as the camera came from there.
        ActionChains(self.page).move_to_element_with_offset(stage, 120, 90).click().perform()
        self.assertLess(self.page.execute_script(eye)[2], -7)
        ActionChains(self.page).move_to_element(stage).click().perform()
        self.assertLess(math.dist(self.page.execute_script(eye), (0, 0, -6)), 1e-6)
        self.rest(away["id"])
        self.assertEqual(self.console(), [])

    def test_what_the_panel_sets_is_asked_for_and_drawn(self):
        self.listen()
        first = self.rest()
        self.slide("near", 0.5)
        second = self.rest(first["id"])
        radius = self.page.execute_script("return fetch('api/state').then((r) => r.json()).then((s) => s.radius)")
        self.assertAlmostEqual(self.sent()["near"], 0.25 * radius)
        self.page.find_element(By.ID, "own-background").click()
        self.slide("background", "#ff0000")
        third = self.rest(second["id"])
        self.assertEqual(self.sent()["background"], [1, 0, 0])
        # The wall ends before the picture does.
        self.assertEqual(self.pixel(0.01, 0.5), [255, 0, 0])
        middle = self.pixel(0.5, 0.5)
        Select(self.page.find_element(By.ID, "output")).select_by_value("alpha")
        self.rest(third["id"])
        self.assertEqual(self.sent()["output"], "alpha")
        self.assertEqual(self.pixel(0.01, 0.5), [0, 0, 0])
        self.assertNotEqual(self.pixel(0.5, 0.5), middle)
        self.assertGreater(min(self.pixel(0.5, 0.5)), 200)
        self.screenshot("alpha")
        self.assertEqual(self.seen()["errors"], [])
        self.assertEqual(self.console(), [])

    def pixel(self, x, y):
        """A colour of the picture, at shares of its size; JPEG is off by a little where it is flat."""
        found = self.page.execute_script(
            "const p = document.getElementById('picture'); return Array.from(p.getContext('2d').getImageData("
            "arguments[0] * p.width, arguments[1] * p.height, 1, 1).data).slice(0, 3);", x, y)
        return [255 if value > 250 else 0 if value < 5 else value for value in found]

    def test_the_dark_is_dark(self):
        self.rest()
        shades = {}
        for scheme in ("light", "dark"):
            self.prefer(scheme)
            shades[scheme] = self.page.execute_script(
                "return ['body', '#panel', '#stage', '#fov', '#status', 'h1'].map((name) => {"
                " const style = getComputedStyle(document.querySelector(name));"
                " return [style.backgroundColor, style.color].map((c) => c.match(/[\\d.]+/g).slice(0, 3).map(Number)"
                ".reduce((a, b) => a + b)); });")
            self.screenshot(scheme)
        text = 1
        for light, dark in zip(shades["light"], shades["dark"]):
            self.assertLess(light[text], 300)
            self.assertGreater(dark[text], 500)
        for part in (0, 2):  # the page and its stage
            self.assertGreater(shades["light"][part][0], 600)
            self.assertLess(shades["dark"][part][0], 150)
        self.assertEqual(self.console(), [])


class FarCropTest(PageCase):
    """A model whose coordinates begin somewhere else than those of its data set."""

    def arguments(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        model = os.path.join(folder, "model.ply")
        write_model(model, (500000, 4000000, 100))
        return [model]

    def test_convert_keeps_what_is_in_the_box(self):
        self.rest()
        self.page.find_element(By.ID, "show-crop").click()
        for name, value in (("low-x", -0.8), ("high-x", 3.2), ("low-y", -2.7), ("high-y", 1.3), ("high-z", 4)):
            self.slide(f"crop-{name}", value)
        low, high = ([float(self.page.find_element(By.ID, f"crop-{end}-{axis}").get_attribute("value")) for axis in "xyz"]
                     for end in ("low", "high"))
        places = [(x, 0, 0) for x in (-1, 0, 1)] + [(i % 10 - 4.5, i // 10 - 4.5, 3) for i in range(100)]
        inside = sum(all(a <= x <= b for a, x, b in zip(low, place, high)) for place in places)
        self.assertGreater(inside, 5)
        out = os.path.join(self.viewer.folder.name, "part.ply")
        option = self.page.find_element(By.ID, "crop-text").text.split()
        told = subprocess.run([self.program, "convert", self.viewer.model, "-o", out, *option],
                              capture_output=True, text=True)
        self.assertEqual(told.returncode, 0, told.stderr)
        self.assertRegex(told.stdout, f"^{inside} of 103 Gaussians")
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
