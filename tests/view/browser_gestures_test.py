#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How mouse, keys and fingers move the camera.
usage: browser_gestures_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import math
import os
import sys

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.mouse_button import MouseButton
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase  # noqa: E402


class Rig:
    """The page's camera at one moment."""

    def __init__(self, page):
        (self.eye, self.target, self.axes, self.up, self.distance, self.unit) = page.execute_script(
            "const r = window.raysplats.rig; return [r.eye, r.target, r.axes, r.up, r.distance,"
            " r.pixel(document.getElementById('picture').clientHeight)];")

    def seen_from(self, other):
        """Where its eye has gone along the axes of another moment: right, down, forward."""
        step = [a - b for a, b in zip(self.eye, other.eye)]
        return [sum(a * b for a, b in zip(step, axis)) for axis in other.axes]

    def turned(self, other):
        """Where it looks along the axes of another moment."""
        return [sum(a * b for a, b in zip(self.axes[2], axis)) for axis in other.axes]


class GesturesTest(ModelCase):
    def rig(self):
        return Rig(self.page)

    def close(self, found, expected, places=6):
        for a, b in zip(found, expected, strict=True):
            self.assertAlmostEqual(a, b, places=places)

    def mouse(self, dx, dy, button=MouseButton.LEFT):
        actions = ActionBuilder(self.page, duration=15)
        pointer = actions.pointer_action
        pointer.move_to(self.page.find_element(By.ID, "picture")).pointer_down(button)
        pointer.move_by(dx, dy).pointer_up(button)
        actions.perform()

    def test_drags_turn_or_move(self):
        self.rest()
        self.listen()
        before = self.rig()
        self.mouse(60, 20, MouseButton.RIGHT)
        moved = self.rig()
        # What is under the pointer at the centre's distance goes along.
        self.close(moved.seen_from(before), (-60 * before.unit, -20 * before.unit, 0))
        self.close(sum(moved.axes, []), sum(before.axes, []))
        self.assertAlmostEqual(moved.distance, before.distance)
        ActionChains(self.page).key_down(Keys.SHIFT).perform()
        self.mouse(-60, -20)
        ActionChains(self.page).key_up(Keys.SHIFT).perform()
        self.close(self.rig().eye, before.eye)
        self.close(self.rig().target, before.target)
        # Around the centre, which stays, ...
        self.mouse(60, 0)
        around = self.rig()
        self.assertLess(around.seen_from(before)[0], -0.5)
        self.close(around.target, before.target)
        # ... or the eye stays, and the view goes along.
        ActionChains(self.page).send_keys("f").perform()
        self.assertEqual(self.page.find_element(By.ID, "mode").get_attribute("value"), "fly")
        self.mouse(60, 0)
        looked = self.rig()
        self.close(looked.eye, around.eye)
        self.assertLess(looked.turned(around)[0], -0.1)
        ActionChains(self.page).send_keys("f").perform()
        self.assertEqual(self.page.find_element(By.ID, "mode").get_attribute("value"), "orbit")
        # The program is told of the last of it.
        self.settle()
        self.close([self.sent()["c2w"][i] for i in (3, 7, 11)], looked.eye)
        self.assertEqual(self.console(), [])

    def test_keys_fly_turn_and_level(self):
        first = self.rest()
        ActionChains(self.page).click(self.page.find_element(By.ID, "picture")).perform()
        for key, axis, sign in (("d", 0, 1), ("a", 0, -1), ("q", 1, 1), ("e", 1, -1), ("w", 2, 1), ("s", 2, -1)):
            before = self.rig()
            ActionChains(self.page).key_down(key).pause(0.2).key_up(key).perform()
            moved = self.rig()
            step = moved.seen_from(before)
            self.assertGreater(sign * step.pop(axis), 0.05, key)
            self.close(step, (0, 0))
            self.close(sum(moved.axes, []), sum(before.axes, []))
        for key, axis, sign in ((Keys.ARROW_LEFT, 0, -1), (Keys.ARROW_RIGHT, 0, 1), (Keys.ARROW_UP, 1, -1),
                                (Keys.ARROW_DOWN, 1, 1)):
            before = self.rig()
            ActionChains(self.page).key_down(key).pause(0.2).key_up(key).perform()
            turned = self.rig()
            self.close(turned.eye, before.eye)
            self.assertGreater(sign * turned.turned(before)[axis], 0.05, key)
        # Upright again, looking where it looked.
        self.page.execute_script(
            "const r = window.raysplats.rig; const [x, y, z] = r.axes;"
            "r.axes = [x.map((a, i) => 0.8 * a + 0.6 * y[i]), y.map((a, i) => 0.8 * a - 0.6 * x[i]), z];")
        tilted = self.rig()
        self.assertGreater(abs(sum(a * b for a, b in zip(tilted.axes[0], tilted.up))), 0.5)
        ActionChains(self.page).send_keys("u").perform()
        level = self.rig()
        self.assertAlmostEqual(sum(a * b for a, b in zip(level.axes[0], level.up)), 0)
        self.close(level.axes[2], tilted.axes[2])
        self.rest(first["id"])
        self.assertEqual(self.console(), [])

    def touch(self, *moments):
        """Fingers at one moment after another, each a list of places, and away in the end."""
        kinds = ["touchStart"] + ["touchMove"] * (len(moments) - 1) + ["touchEnd"]
        for kind, places in zip(kinds, (*moments, [])):
            self.page.execute_cdp_cmd("Input.dispatchTouchEvent", {
                "type": kind, "touchPoints": [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(places)]})

    def test_fingers(self):
        first = self.rest()
        before = self.rig()
        self.touch([(300, 250)], [(340, 250)], [(400, 250)])
        turned = self.rig()
        self.assertLess(turned.seen_from(before)[0], -0.5)
        self.close(turned.target, before.target)
        self.rest(first["id"])
        # Two fingers half as far apart again: as much nearer.
        self.touch([(300, 250), (400, 250)], [(290, 250), (410, 250)], [(275, 250), (425, 250)])
        near = self.rig()
        self.assertAlmostEqual(near.distance, turned.distance / 1.5, places=6)
        # Where they go together, the view goes along; each is heard by itself, so that their distance wavers a little.
        self.touch(*([(300 + 5 * i, 250 + 1.5 * i), (400 + 5 * i, 250 + 1.5 * i)] for i in range(21)))
        away = self.rig()
        self.assertAlmostEqual(away.distance, near.distance, places=6)
        self.close(sum(away.axes, []), sum(near.axes, []))
        self.close(away.seen_from(near), (-100 * near.unit, -30 * near.unit, 0), places=1)
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
