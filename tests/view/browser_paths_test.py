#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keyframes and their files.
usage: browser_paths_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import base64
import json
import math
import os
import subprocess
import sys
import tempfile

from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase, PageCase  # noqa: E402
from program import psnr, write_model  # noqa: E402


class PathsTest(ModelCase):
    def test_a_path_is_what_render_draws_and_the_page_reads(self):
        self.rest()
        # The path of two views is what `render --path` reads, and the page again.
        text = self.page.execute_script(
            "return import('/path.js').then(m => JSON.stringify(m.pathFile("
            "[{eye: [0, 0, -6], turn: [1, 0, 0, 0], fov: 50, distance: 6},"
            " {eye: [1, 0, -6], turn: [1, 0, 0, 0], fov: 50, distance: 6}],"
            "{seconds: 1, fps: 3, closed: false, width: 32, height: 24, model: 'pinhole'})))")
        folder = self.viewer.folder.name
        with open(os.path.join(folder, "path.json"), "w") as file:
            file.write(text)
        subprocess.run([self.program, "render", self.viewer.model, "--path", os.path.join(folder, "path.json"),
                        "-o", os.path.join(folder, "frames"), "--video", os.path.join(folder, "path.apng"), "-q"],
                       check=True, stdout=subprocess.DEVNULL)
        self.assertEqual(len(os.listdir(os.path.join(folder, "frames"))), 3)
        path = json.loads(text)
        for frame, x in zip(path["camera_path"], (0, 0.5, 1)):
            self.assertAlmostEqual(frame["camera_to_world"][3], x, places=6)
        # nerfstudio's add-ons write matrices as text, by columns.
        matrix = path["keyframes"][1]["matrix"]
        path["keyframes"][1]["matrix"] = json.dumps([matrix[4 * (i % 4) + i // 4] for i in range(16)])
        back = self.page.execute_async_script(
            "const done = arguments[1];"
            "import('/path.js').then(m => done(m.keyframesOf(arguments[0], 6)))", path)
        self.assertEqual((back["fps"], back["seconds"], back["closed"]), (3, 1, False))
        for key, x in zip(back["keys"], (0, 1)):
            self.assertLess(math.dist(key["eye"], (x, 0, -6)), 1e-6)
            self.assertLess(math.dist(key["turn"], (1, 0, 0, 0)), 1e-6)
            self.assertEqual((key["fov"], key["distance"]), (50, 6))
        # Chromium plays the file without losses.
        with open(os.path.join(folder, "path.apng"), "rb") as file:
            video = base64.b64encode(file.read()).decode()
        played = self.page.execute_async_script(
            "const done = arguments[1]; const image = new Image();"
            "image.onload = () => done([image.naturalWidth, image.naturalHeight]);"
            "image.onerror = () => done(null);"
            "image.src = 'data:image/apng;base64,' + arguments[0];", video)
        self.assertEqual(played, [32, 24])
        self.assertEqual(self.console(), [])

    def test_a_path_is_played_and_saved_by_its_buttons(self):
        self.listen()
        self.rest()
        self.page.find_element(By.ID, "add-key").click()
        eye = self.page.execute_script("return window.raysplats.rig.eye")
        Select(self.page.find_element(By.ID, "cameras")).select_by_index(1)
        self.page.find_element(By.ID, "add-key").click()
        for name, value in (("seconds", 2), ("fps", 2)):
            field = self.page.find_element(By.ID, name)
            field.clear()
            field.send_keys(str(value))
        self.settle()
        # From the first view to the last, through places between them, and the last one rests.
        self.page.execute_script(
            "const rig = window.raysplats.rig; const way = window.raysplats.way = [[...rig.eye]];"
            "document.getElementById('play').click();"
            "const step = () => { way.push([...rig.eye]); if (way.length < 1000) requestAnimationFrame(step); };"
            "requestAnimationFrame(step);")
        way = "window.raysplats.way"
        self.wait("the path's middle", lambda: math.dist(
            self.page.execute_script(f"return {way}[{way}.length - 1]"), (7, 0, 0)) > 2)
        self.wait("its end", lambda: math.dist(
            self.page.execute_script("return window.raysplats.rig.eye"), (7, 0, 0)) < 1e-6)
        self.settle()
        self.assertLess(math.dist([self.sent()["c2w"][i] for i in (3, 7, 11)], (7, 0, 0)), 1e-6)
        between = [p for p in self.page.execute_script(f"return {way}")
                   if min(math.dist(p, eye), math.dist(p, (7, 0, 0))) > 0.5]
        self.assertGreater(len(between), 5)
        # Files of either kind are what `render` draws: the first and the last view among four.
        folder = self.viewer.folder.name
        for button, name in (("save-path", "path.json"), ("save-toml", "path.toml")):
            self.page.find_element(By.ID, button).click()
            saved = self.download(name)
            out = os.path.join(folder, button)
            subprocess.run([self.program, "render", self.viewer.model, "--path", saved, "-o", out, "-q"], check=True,
                           stdout=subprocess.DEVNULL)
            names = sorted(os.listdir(out))
            self.assertEqual(len(names), 4)
            for frame, place in ((names[0], 0), (names[-1], 1)):
                self.page.find_elements(By.CSS_SELECTOR, "#keyframes li")[place].find_element(
                    By.TAG_NAME, "button").click()
                shown = self.settle()
                self.assertGreater(psnr(os.path.join(out, frame), self.rendered(f"{button}{place}", shown["last"], 1)), 50)
        self.assertEqual(self.console(), [])

    def frames(self, path):
        """The files of what `render` draws of a camera path, in their order."""
        out = path + "_frames"
        subprocess.run([self.program, "render", self.viewer.model, "--path", path, "-o", out, "-q"], check=True,
                       stdout=subprocess.DEVNULL)
        return [os.path.join(out, name) for name in sorted(os.listdir(out))]

    def same_frames(self, first, second, least=50):
        first, second = self.frames(first), self.frames(second)
        self.assertEqual(len(first), len(second))
        for a, b in zip(first, second):
            self.assertGreater(psnr(a, b), least, (a, b))

    def test_keyframes_keep_their_seconds(self):
        self.rest()
        keys = [{"eye": [x, 0, -6], "turn": [1, 0, 0, 0], "fov": 50, "distance": 6, "seconds": seconds}
                for x, seconds in ((0, 1), (1, 4), (2, 2))]
        for closed in (False, True):
            settings = {"seconds": 3, "fps": 3, "closed": closed, "constant": False, "width": 40, "height": 30,
                        "model": "pinhole"}
            file = self.module("path.pathFile(given[0], given[1])", keys, settings)
            again = self.module("path.pathFile((given[1] = path.keyframesOf(given[0], 6)).keys, given[1])", file, None)
            self.assertEqual([k["override_transition_sec"] for k in file["keyframes"]],
                             [k["override_transition_sec"] for k in again["keyframes"]])
            self.assertEqual({k: v for k, v in file.items() if not isinstance(v, list)},
                             {k: v for k, v in again.items() if not isinstance(v, list)})
            for a, b in zip(file["camera_path"], again["camera_path"], strict=True):
                self.assertLess(math.dist(a["camera_to_world"], b["camera_to_world"]), 1e-9)
            # In nerfstudio's terms: `render` takes the same way from the keyframes alone.
            stem = os.path.join(self.viewer.folder.name, f"seconds_{closed}")
            for name, content in (("frames", file), ("keys", {**file, "camera_path": []})):
                with open(f"{stem}_{name}.json", "w") as out:
                    json.dump(content, out)
            self.same_frames(f"{stem}_frames.json", f"{stem}_keys.json")

    def test_what_is_loaded_and_saved_plays_the_same(self):
        self.rest()
        folder = self.viewer.folder.name
        written = os.path.join(folder, "written.toml")
        with open(written, "w") as file:
            file.write('speed = "constant"\nwidth = 60\nheight = 40\nfps = 4\nseconds = 2\nclosed = false\n'
                       "[[key]]\neye = [0, 0, -6]\ntarget = [0, 0, 0]\nseconds = 5\n"
                       "[[key]]\neye = [0.5, 0, -6]\ntarget = [0, 0, 0]\nfov = 40\n"
                       "[[key]]\neye = [4, 1, -5]\ntarget = [0, 0, 0]\n")

        def load(path):
            self.page.execute_script("document.getElementById('clear-keys').click();"
                                     "for (const e of document.querySelectorAll('#constant, #path-width')) {"
                                     " e.checked = false; e.value = ''; }")
            self.page.find_element(By.ID, "load-path").send_keys(path)
            self.wait("the keyframes", lambda: len(self.page.find_elements(By.CSS_SELECTOR, "#keyframes li")) == 3)
            self.wait("the settings", lambda: self.page.find_element(By.ID, "constant").is_selected())

        def save(button, name):
            self.page.find_element(By.ID, button).click()
            return self.download(name)

        load(written)
        toml = save("save-toml", "path.toml")
        path = save("save-path", "path.json")
        for saved in (toml, path):
            self.same_frames(written, saved)
        load(path)
        self.same_frames(written, save("save-toml", "path.toml"))
        load(toml)
        with open(save("save-path", "path.json")) as again, open(path) as before:
            again, before = json.load(again), json.load(before)
            for a, b in zip(again["camera_path"], before["camera_path"], strict=True):
                self.assertLess(math.dist(a["camera_to_world"], b["camera_to_world"]), 1e-9)
        self.assertEqual(self.console(), [])

    def test_keyframes_in_toml_are_those_of_render(self):
        first = self.rest()
        turns = [(1, 0, 0, 0), (0.8, 0.36, 0.48, 0), (0.5, 0.5, -0.5, 0.5)]
        keys = [{"eye": [i, 1e-7 * i, -6], "turn": turn, "fov": 50 + 10 * i, "distance": 2.5, "seconds": [1, 3, 1][i]}
                for i, turn in enumerate(turns)]
        settings = {"seconds": 2, "fps": 4, "closed": False, "width": 32, "height": 24, "model": "pinhole"}
        text = self.module("toml.tomlOf(given[0], given[1])", keys, settings)
        back = self.module("toml.keyframesIn(given[0])", text)
        self.assertEqual((back["seconds"], back["fps"], back["closed"], len(back["keys"])), (2, 4, False, 3))
        for key, own in zip(back["keys"], keys):
            for name in ("eye", "turn"):
                self.assertLess(math.dist(key[name], own[name]), 1e-9, name)
            self.assertAlmostEqual(key["distance"], 2.5)
            self.assertEqual((key["fov"], key["seconds"]), (own["fov"], own["seconds"]))
        # `render` draws the same frames of it as of the page's frames one by one.
        folder = self.viewer.folder.name
        files = {"a.toml": text, "b.json": json.dumps(self.module("path.pathFile(given[0], given[1])", keys, settings))}
        for name, content in files.items():
            with open(os.path.join(folder, name), "w") as file:
                file.write(content)
            subprocess.run([self.program, "render", self.viewer.model, "--path", os.path.join(folder, name), "-o",
                            os.path.join(folder, name[0]), "-q"], check=True, stdout=subprocess.DEVNULL)
        names = sorted(os.listdir(os.path.join(folder, "a")))
        self.assertEqual(len(names), 8)
        for name in names:
            self.assertGreater(psnr(os.path.join(folder, "a", name), os.path.join(folder, "b", name)), 50, name)
        # As people write it, through the page's own button; what is none is a sentence.
        written = os.path.join(folder, "hand.toml")
        with open(written, "w") as file:
            file.write('# by hand\nfps = 25\nclosed = true\nspeed = "by-seconds"\n\n[[key]]  # one\n'
                       "eye = [0, 0,\n -6]\ntarget = [0, 0, 0,]\n[[key]]\neye = [1_0, 0, 0]\ntarget = [0, 0, 0]\nseconds = 2.5\n")
        self.page.find_element(By.ID, "load-path").send_keys(written)
        self.wait("the keyframes", lambda: len(self.page.find_elements(By.CSS_SELECTOR, "#keyframes li")) == 2)
        self.assertEqual([self.page.find_element(By.ID, name).get_attribute("value") for name in ("seconds", "fps")],
                         ["3.5", "25"])
        self.assertTrue(self.page.find_element(By.ID, "closed").is_selected())
        self.page.find_elements(By.CSS_SELECTOR, "#keyframes li")[1].find_element(By.TAG_NAME, "button").click()
        self.rest(first["id"])
        self.assertLess(math.dist(self.page.execute_script("return window.raysplats.rig.eye"), (10, 0, 0)), 1e-9)
        for damaged in ("", "[[key]]", "[[key]]\neye = [0, 0, 0]\ntarget = [0, 1, 0]", "[camera]\nx = 1",
                        "[[key]]\neye = [0, 0]\ntarget = [0, 0, 1]", "[[key]]\neye = 1\ntarget = 2", "key = [[1]]"):
            self.assertIsNone(self.module("toml.keyframesIn(given[0])", damaged), damaged)
        self.assertEqual(self.console(), [])


class FarPathsTest(PageCase):
    """A model whose coordinates begin somewhere else than those of its data set."""
    origin = (4321012.125, -250000.5, 80)

    def arguments(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        model = os.path.join(folder, "model.ply")
        write_model(model, self.origin)
        return [model]

    def test_a_path_is_in_the_coordinates_of_the_data_set(self):
        self.listen()
        self.page.execute_script("window.raysplats.rig.pose = [1, 0, 0, 0.5, 0, 1, 0, 0.2, 0, 0, 1, -6]")
        self.page.find_element(By.ID, "add-key").click()
        self.page.find_element(By.ID, "level").click()
        shown = self.settle()
        picture = os.path.join(self.viewer.folder.name, "shown.png")
        with open(picture, "wb") as file:
            file.write(self.pixels())
        for name, value in (("seconds", 1), ("fps", 1)):
            field = self.page.find_element(By.ID, name)
            field.clear()
            field.send_keys(str(value))
        for button, name in (("save-path", "path.json"), ("save-toml", "path.toml")):
            self.page.find_element(By.ID, button).click()
            saved = self.download(name)
            out = saved + "_frames"
            subprocess.run([self.program, "render", self.viewer.model, "--path", saved, "-o", out, "--format", "png",
                            "--supersample", "4", "--width", str(shown["last"]["width"]), "--height",
                            str(shown["last"]["height"]), "-q"], check=True, stdout=subprocess.DEVNULL)
            frame, = os.listdir(out)
            self.assertGreater(psnr(picture, os.path.join(out, frame)), 30)
            # And the page goes back there.
            self.page.find_element(By.ID, "clear-keys").click()
            self.page.find_element(By.ID, "load-path").send_keys(saved)
            self.wait("the keyframe", lambda: len(self.page.find_elements(By.CSS_SELECTOR, "#keyframes li")) == 1)
            self.page.find_element(By.ID, "home").click()
            self.page.find_element(By.CSS_SELECTOR, "#keyframes li button").click()
            self.assertLess(math.dist(self.page.execute_script("return window.raysplats.rig.eye"), (0.5, 0.2, -6)), 1e-6)
        self.assertEqual(self.console(), [])


if __name__ == "__main__":
    main()
