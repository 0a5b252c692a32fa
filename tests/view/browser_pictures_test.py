#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the page shows: what `render` draws, the newest of it, through every lens.
usage: browser_pictures_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import json
import math
import os
import re
import subprocess
import sys

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase  # noqa: E402


class PicturesTest(ModelCase):
    def test_the_page_shows_what_render_draws(self):
        seen = self.rest()
        self.assertEqual(seen["last"]["samples"], 16)
        self.screenshot("first")
        self.assertIn("103 Gaussians", self.page.find_element(By.ID, "about").text)
        self.assertEqual(self.page.execute_script("return location.search"), "")
        # The same camera by `render`, supersampled, against the page's 16 samples.
        width, height = seen["last"]["width"], seen["last"]["height"]
        pose, fov = self.page.execute_script(
            "return [window.raysplats.rig.pose, window.raysplats.rig.fov]")
        focal = 0.5 * height / math.tan(0.5 * math.radians(fov))
        rows = [[pose[4 * i], -pose[4 * i + 1], -pose[4 * i + 2], pose[4 * i + 3]] for i in range(3)]
        folder = self.viewer.folder.name
        with open(os.path.join(folder, "one.json"), "w") as file:
            json.dump({"w": width, "h": height, "fl_x": focal, "fl_y": focal, "cx": width / 2,
                       "cy": height / 2, "frames": [{"file_path": "page.png",
                                                     "transform_matrix": rows + [[0, 0, 0, 1]]}]}, file)
        subprocess.run([self.program, "render", self.viewer.model, "--cameras",
                        os.path.join(folder, "one.json"), "-o", os.path.join(folder, "out"),
                        "--supersample", "4", "-q"], check=True, stdout=subprocess.DEVNULL)
        shown = os.path.join(folder, "shown.png")
        with open(shown, "wb") as file:
            file.write(self.pixels())
        # Without alpha, as frames are; idiff says what it finds in the same line everywhere.
        told = subprocess.run(["oiiotool", shown, "--ch", "R,G,B", os.path.join(folder, "out/page.png"),
                               "--diff"], capture_output=True, text=True).stdout
        found = re.search(r"Peak SNR = (\S+)", told)
        self.assertTrue(found, told)
        self.assertGreater(float(found.group(1)), 35, told)
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
