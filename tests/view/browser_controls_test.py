#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Mouse, fingers, keys and the panel.
usage: browser_controls_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import math
import os
import sys

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase  # noqa: E402


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

    def test_touch_and_the_dark(self):
        first = self.rest()
        self.prefer("dark")
        for kind, x in (("touchStart", 300), ("touchMove", 340), ("touchMove", 400), ("touchEnd", None)):
            points = [] if x is None else [{"x": x, "y": 250}]
            self.page.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        self.rest(first["id"])
        self.screenshot("dark")
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
