#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Photos over pictures, and the world's box and directions.
usage: browser_photos_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import json
import os
import subprocess
import sys
import tempfile

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import PageCase  # noqa: E402
from program import write_model  # noqa: E402


class PhotoCase(PageCase):
    """A model beside the photos that it was to be like."""

    def arguments(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        photos = os.path.join(folder, "photos")
        subprocess.run([self.program, "generate", photos, "--size", "64", "--train-views", "3", "--test-views", "2",
                        "-q"], check=True, stdout=subprocess.DEVNULL)
        self.prepare(photos)
        model = os.path.join(folder, "model.ply")
        write_model(model)
        return [model, "--data", photos, "--split", "train"]

    def prepare(self, photos):
        """What is done to the data set before it is looked at."""


class PhotoTest(PhotoCase):
    def overlay(self, x, y):
        """A pixel of what lies over the picture, at shares of its size."""
        return self.page.execute_script(
            "const c = document.getElementById('overlay');"
            "return Array.from(c.getContext('2d').getImageData(arguments[0] * c.width,"
            " arguments[1] * c.height, 1, 1).data);", x, y)

    def test_the_photo_of_a_camera_lies_over_the_picture(self):
        first = self.rest()
        self.assertFalse(self.page.find_element(By.ID, "photo-section").is_displayed())
        Select(self.page.find_element(By.ID, "cameras")).select_by_index(1)
        self.wait("the photo", lambda: self.page.find_element(By.ID, "photo-section").is_displayed())
        shown = self.rest(first["id"])
        self.assertEqual(self.page.execute_script("return window.raysplats.photo.number"), 1)
        # The photo's own pixels: its middle, where the overlay is opaque, and nothing right of the slider.
        photo = self.page.execute_async_script(
            "const done = arguments[0]; fetch('api/photo/1').then(r => r.blob()).then(createImageBitmap).then(b => {"
            "const c = new OffscreenCanvas(b.width, b.height); const g = c.getContext('2d'); g.drawImage(b, 0, 0);"
            "const p = g.getImageData(b.width * 0.45, b.height / 2, 1, 1).data;"
            "done([b.width, b.height, Array.from(p)]); });")
        self.assertEqual(photo[:2], [64, 64])
        self.assertEqual(self.overlay(0.75, 0.5)[3], 0)
        # Height fills the picture, so 0.45 of the photo's width is right of the middle by 0.05 of the height.
        width, height = self.page.execute_script(
            "const p = document.getElementById('picture'); return [p.clientWidth, p.clientHeight];")
        pixel = self.overlay(0.5 - 0.05 * height / width, 0.5)
        self.assertEqual(pixel[3], 255)
        for a, b in zip(pixel[:3], photo[2][:3]):
            self.assertLess(abs(a - b), 40)
        self.screenshot("photo")
        self.slide("split", 100)
        self.assertEqual(self.overlay(0.55, 0.5)[3], 255)
        self.page.find_element(By.ID, "difference").click()
        self.screenshot("difference")
        # Where the photo does not reach, there is no difference.
        self.assertEqual(self.overlay(0.01, 0.5)[:3], [0, 0, 0])
        # A movement takes the photo away.
        self.drag(60, 0)
        self.rest(shown["id"])
        self.assertFalse(self.page.find_element(By.ID, "photo-section").is_displayed())
        self.assertEqual(self.overlay(0.25, 0.5)[3], 0)
        # Only photos that there are, by number.
        for path, status in (("api/photo/3", 404), ("api/photo/-1", 404), ("api/photo/1x", 404), ("api/photo/", 404),
                             ("api/photo/../state", 404)):
            self.assertEqual(self.viewer.ask("/" + path, Cookie=self.viewer.cookie())[0], status, path)
        self.assertEqual(self.viewer.ask("/api/photo/1")[0], 403)
        self.assertEqual(self.console(), [])

    def test_a_frustum_under_the_pointer_has_its_photo(self):
        first = self.rest()
        stage = self.page.find_element(By.ID, "picture")
        ActionChains(self.page).scroll_from_origin(ScrollOrigin.from_element(stage), 0, 400).perform()
        ActionChains(self.page).move_to_element_with_offset(stage, 150, 100).send_keys("c").perform()
        self.rest(first["id"])
        self.assertTrue(self.painted("overlay"))
        filled = ("const c = document.getElementById('overlay');"
                  "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
                  "let count = 0; for (let i = 3; i < d.length; i += 4) count += d[i] === 255; return count;")
        lines = self.page.execute_script(filled)
        # The camera came from this tip, which is in the middle.
        ActionChains(self.page).move_to_element(stage).perform()
        self.wait("the photo in its frustum", lambda: self.page.execute_script(filled) > 1.5 * lines)
        self.screenshot("frustum")
        ActionChains(self.page).move_to_element_with_offset(stage, 150, 100).perform()
        self.wait("the frustum alone", lambda: self.page.execute_script(filled) == lines)
        self.assertEqual(self.console(), [])

    def test_order_up_and_crop_box(self):
        first = self.rest()
        before = self.pixels()
        Select(self.page.find_element(By.ID, "order")).select_by_value("entry")
        second = self.rest(first["id"])
        entry = self.pixels()
        Select(self.page.find_element(By.ID, "order")).select_by_value("peak")
        third = self.rest(second["id"])
        self.assertNotEqual(entry, self.pixels())
        self.assertEqual(before, self.pixels())  # as a model of nobody's run is traced
        self.assertEqual(third["errors"], [])
        Select(self.page.find_element(By.ID, "up")).select_by_value("0,0,1")
        self.rest(third["id"])
        self.assertEqual(self.page.execute_script("return window.raysplats.rig.up"), [0, 0, 1])
        # Upright: the picture's right is level.
        self.assertAlmostEqual(self.page.execute_script("return window.raysplats.rig.axes[0][2]"), 0, places=9)
        self.assertEqual(self.page.find_element(By.ID, "up-text").text, "--up 0,0,1")
        self.page.find_element(By.ID, "show-crop").click()
        self.slide("crop-low-x", -0.4)
        self.slide("crop-high-y", 0.6)
        painted = self.page.execute_script(
            "const c = document.getElementById('overlay');"
            "return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(v => v > 0);")
        self.assertTrue(painted)
        self.screenshot("crop")
        # The option is one that `convert` takes, and keeps what is in the box.
        option = self.page.find_element(By.ID, "crop-text").text.split()
        self.assertEqual(option[0], "--crop-min")
        low, high = ([float(x) for x in option[i].split(",")] for i in (1, 3))
        self.assertLess(abs(low[0] + 0.4), 0.1)
        self.assertLess(abs(high[1] - 0.6), 0.1)
        out = os.path.join(self.viewer.folder.name, "part.ply")
        told = subprocess.run([self.program, "convert", self.arguments_given[0], "-o", out, *option],
                              capture_output=True, text=True, check=True).stdout
        self.assertRegex(told, r"^\d+ of 103 Gaussians")
        self.assertEqual(self.console(), [])


class MixedTest(PhotoCase):
    """Cameras with photos for the page, and one without: a fisheye bends its own."""

    def prepare(self, photos):
        path = os.path.join(photos, "transforms_train.json")
        with open(path) as file:
            cameras = json.load(file)
        cameras["frames"][2].update(camera_model="OPENCV_FISHEYE", fl_x=64, fl_y=64, cx=32, cy=32)
        with open(path, "w") as file:
            json.dump(cameras, file)

    def test_a_photo_that_comes_late_does_not_lie_over_a_camera_that_has_none(self):
        first = self.rest()
        self.assertEqual(self.page.execute_async_script(
            "const done = arguments[0]; fetch('api/state').then(r => r.json())"
            ".then(s => done(s.cameras.map((c) => c.photo)), (error) => done(String(error)));"), [True, True, False])
        # The photo's reply waits for release(), which ends when the page has the photo.
        self.page.execute_script(
            "const {fetch, createImageBitmap} = window;"
            "window.fetch = (...asked) => asked[0] !== 'api/photo/1' ? fetch(...asked) : new Promise((reply) => {"
            " window.release = () => new Promise((taken) => {"
            "  window.createImageBitmap = async (...given) => {"
            "   const bitmap = await createImageBitmap(...given); setTimeout(taken, 100); return bitmap; };"
            "  reply(fetch(...asked)); }); });")
        cameras = Select(self.page.find_element(By.ID, "cameras"))
        cameras.select_by_index(1)
        second = self.rest(first["id"])
        cameras.select_by_index(2)
        third = self.rest(second["id"])
        self.assertEqual(self.page.execute_async_script(
            "const done = arguments[0]; window.release().then(() => done(window.raysplats.photo.number));"), -1)
        # What draws over the picture goes on.
        self.drag(60, 0)
        self.rest(third["id"])
        self.assertFalse(self.page.find_element(By.ID, "photo-section").is_displayed())
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
