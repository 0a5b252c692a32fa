#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the page shows: what `render` draws, the newest of it, through every lens.
usage: browser_pictures_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import math
import os
import sys

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase  # noqa: E402
from program import psnr  # noqa: E402


class PicturesTest(ModelCase):
    def test_the_page_shows_what_render_draws(self):
        seen = self.rest()
        self.assertEqual(seen["last"]["samples"], 16)
        self.screenshot("first")
        self.assertIn("103 Gaussians", self.page.find_element(By.ID, "about").text)
        self.assertEqual(self.page.execute_script("return location.search"), "")
        shown = os.path.join(self.viewer.folder.name, "shown.png")
        with open(shown, "wb") as file:
            file.write(self.pixels())
        self.assertGreater(psnr(shown, self.rendered("shown", seen["last"])), 35)
        self.assertEqual(self.console(), [])

    def test_dragging_turns_and_the_last_picture_is_the_newest(self):
        first = self.rest()
        before = self.pixels()
        eye = self.page.execute_script("return window.raysplats.rig.eye")
        self.drag(120, 30)
        after = self.rest(first["id"])
        self.assertNotEqual(before, self.pixels())
        moved = self.page.execute_script("return window.raysplats.rig.eye")
        self.assertGreater(math.dist(eye, moved), 0.5)
        self.assertLess(moved[0], eye[0])  # the model turned to the right: the camera went left
        self.screenshot("dragged")
        # 100 quick movements: pictures come in order, and the last one is that of the last wish.
        self.page.execute_script(
            "const p = document.getElementById('picture');"
            "const fire = (t, x) => p.dispatchEvent(new PointerEvent(t, {pointerId: 1, clientX: x,"
            " clientY: 200, buttons: 1, bubbles: true}));"
            "p.setPointerCapture = () => {};"
            "fire('pointerdown', 200);"
            "for (let i = 0; i < 100; ++i) fire('pointermove', 200 + i);"
            "fire('pointerup', 300);")
        last = self.rest(after["id"])
        self.assertLess(last["pictures"] - after["pictures"], 40)
        self.assertEqual(self.console(), [])

    def test_a_saved_picture_is_that_of_render_and_a_movement_does_not_lose_it(self):
        first = self.rest()
        self.assertEqual(self.page.execute_script(
            "document.getElementById('png').click(); return document.getElementById('status').textContent"), "saving...")
        still = self.download("view.png")
        self.assertGreater(psnr(still, self.rendered("still", first["last"])), 35)
        self.assertNotIn("saving...", self.rest(first["id"]) and self.status())
        # A movement right behind the wish: no sample can have been drawn, and the file is that of where it ends.
        self.page.execute_script(
            "const p = document.getElementById('picture'); p.setPointerCapture = () => {};"
            "const fire = (t, x) => p.dispatchEvent(new PointerEvent(t, {pointerId: 1, clientX: x, clientY: 200,"
            " buttons: 1, bubbles: true}));"
            "document.getElementById('png').click();"
            "fire('pointerdown', 200); fire('pointermove', 320); fire('pointerup', 320);")
        moved = self.download("view.png")
        self.assertGreater(psnr(moved, self.rendered("moved", first["last"])), 35)
        self.assertLess(psnr(moved, still), 35)
        # It is kept once.
        before = self.seen()
        self.drag(30, 0)
        self.rest(before["id"])
        self.assertEqual(os.listdir(self.downloads), [])
        self.assertEqual(self.console(), [])

    def test_a_hundred_quick_moves_leave_one_stale_picture_at_most(self):
        before = self.rest()
        # What was asked for by which number, and what was shown when.
        self.page.execute_script(
            "const seen = window.raysplats; const asked = new Map(); const shown = []; let last = seen.last;"
            "const send = WebSocket.prototype.send;"
            "WebSocket.prototype.send = function (data) { const m = typeof data === 'string' ? JSON.parse(data) : {};"
            " if (m.type === 'view') asked.set(m.id, m.c2w.join()); return send.call(this, data); };"
            "Object.defineProperty(seen, 'last', {get: () => last, set: (h) => { last = h; shown.push(h.id); }});"
            "const p = document.getElementById('picture'); p.setPointerCapture = () => {};"
            "const fire = (t, x) => p.dispatchEvent(new PointerEvent(t, {pointerId: 1, clientX: x, clientY: 200,"
            " buttons: 1, bubbles: true}));"
            "fire('pointerdown', 200); let i = 0;"
            "const step = () => { fire('pointermove', 200 + ++i); if (i < 100) return setTimeout(step, 4);"
            " fire('pointerup', 300); const newest = seen.rig.pose.join(); const until = shown.length;"
            " seen.after = () => ({moving: until,"
            " stale: shown.slice(until).filter((id) => asked.get(id) !== newest)}); };"
            "step();")
        self.wait("the end of the movement", lambda: self.page.execute_script("return !!window.raysplats.after"))
        self.rest(before["id"])
        self.wait("the last view", lambda: self.page.execute_script(
            "return window.raysplats.last.last && window.raysplats.last.samples === 16"))
        told = self.page.execute_script("return window.raysplats.after()")
        self.assertGreater(told["moving"], 0)
        self.assertLessEqual(len(told["stale"]), 1, told)

    def test_other_lenses(self):
        shown = self.rest()
        lens, slider = Select(self.page.find_element(By.ID, "model")), self.page.find_element(By.ID, "fov")
        self.page.find_element(By.ID, "show-crop").click()
        self.assertTrue(self.painted("overlay"))
        for name, widest in (("fisheye", "360"), ("equirectangular", "120")):
            before = self.pixels()
            lens.select_by_value(name)
            if name == "fisheye":
                self.page.execute_script("arguments[0].value = 220; arguments[0].dispatchEvent(new Event('input'));",
                                         slider)
            shown = self.rest(shown["id"])
            self.assertNotEqual(before, self.pixels())
            self.assertEqual(slider.get_attribute("max"), widest)
            self.assertFalse(self.painted("overlay"))
            self.screenshot(name)
            # Paths keep the lens, in nerfstudio's terms.
            key = {"eye": [0, 0, -6], "turn": [1, 0, 0, 0], "fov": 90, "distance": 6}
            path = self.module("path.pathFile([given[0]], given[1])", key, {
                "seconds": 1, "fps": 1, "closed": False, "width": 32, "height": 16, "model": name})
            self.assertEqual(path["camera_type"], name)
            back = self.module("path.keyframesOf(given[0], 6)", path)
            self.assertEqual(back["model"], name)
            self.assertAlmostEqual(back["keys"][0]["fov"], 90)
        self.assertFalse(slider.is_enabled())
        self.assertEqual((shown["last"]["width"], shown["last"]["samples"]), (2 * shown["last"]["height"], 16))
        self.assertFalse(self.page.find_element(By.ID, "save-toml").is_enabled())
        # A double click picks what is there: the ball in the middle.
        ActionChains(self.page).double_click(self.page.find_element(By.ID, "picture")).perform()
        self.wait("a new centre", lambda: math.dist(
            self.page.execute_script("return window.raysplats.rig.target"), (0, 0, 0)) < 0.8)
        lens.select_by_value("pinhole")
        self.assertLessEqual(self.page.execute_script("return window.raysplats.rig.fov"), 120)
        self.assertTrue(self.painted("overlay"))
        self.assertEqual(self.seen()["errors"], [])
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
