#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The viewer's page in Chromium, as a person uses it.
usage: browser_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import base64
import http.server
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import threading
import time

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import BrowserCase, main  # noqa: E402
from program import Viewer, psnr, write_model  # noqa: E402

PATIENCE = 120  # seconds; kernels may have to be compiled first


class Elsewhere(http.server.BaseHTTPRequestHandler):
    """Somebody's page, on another port of the same host."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><body>")

    def log_message(self, *_):
        pass


class PageCase(BrowserCase):
    command = "view"

    def setUp(self):
        self.arguments_given = self.arguments()
        self.viewer = Viewer(self.program, self.arguments_given, self.command)
        self.addCleanup(self.viewer.folder.cleanup)
        self.addCleanup(self.viewer.stop)
        self.open_browser()
        self.page.get(self.viewer.url)

    def seen(self):
        return self.page.execute_script(
            "const {pictures, last, lost, id, errors} = window.raysplats || {};"
            "return {pictures, last, lost, id, errors};")

    def wait(self, what, condition):
        end = time.time() + PATIENCE
        while time.time() < end:
            value = condition()
            if value:
                return value
            time.sleep(0.05)
        self.fail(f"{what}: nothing after {PATIENCE} s; {self.seen()}")

    def rest(self, after=-1):
        """Waits for the best picture of a view asked for after number `after`."""
        return self.wait("the last picture", lambda: (
            lambda s: s if s["last"] and s["last"]["last"] and s["last"]["id"] > after else None)(self.seen()))

    def pixels(self):
        """The picture on the page as a PNG file."""
        data = self.page.execute_script(
            "return document.getElementById('picture').toDataURL('image/png')")
        return base64.b64decode(data.split(",", 1)[1])

    def painted(self, canvas):
        return self.page.execute_script(
            "const c = document.getElementById(arguments[0]);"
            "return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(v => v > 0);", canvas)

    def drag(self, dx, dy, steps=20):
        stage = self.page.find_element(By.ID, "picture")
        chain = ActionChains(self.page, duration=15).move_to_element(stage).click_and_hold()
        for _ in range(steps):
            chain = chain.move_by_offset(dx / steps, dy / steps)
        chain.release().perform()


class ViewTest(PageCase):
    def arguments(self):
        """A model, and two cameras for the list."""
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        model = os.path.join(folder, "model.ply")
        write_model(model)
        cameras = {"w": 64, "h": 48, "fl_x": 50, "fl_y": 50, "cx": 32, "cy": 24, "frames": [
            {"file_path": f"{name}.png", "transform_matrix": matrix} for name, matrix in (
                ("front", [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -6], [0, 0, 0, 1]]),
                ("side", [[0, 0, 1, 7], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]]))]}
        self.cameras = os.path.join(folder, "cameras.json")
        with open(self.cameras, "w") as file:
            json.dump(cameras, file)
        return [model, "--cameras", self.cameras]

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

    def test_cameras_outputs_keys_and_paths(self):
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

    def module(self, expression, *arguments):
        """What an expression of a page's modules gives: path, toml or vectors."""
        return self.page.execute_async_script(
            "const [...given] = arguments; const done = given.pop();"
            "Promise.all(['path', 'toml', 'vectors'].map((name) => import(`/${name}.js`)))"
            f".then(([path, toml, vectors]) => done({expression}), (error) => done(String(error)));", *arguments)

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

    def test_a_page_from_elsewhere_gets_nothing(self):
        self.rest()  # the cookie is there, and goes to all ports of the host
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere) as elsewhere:
            threading.Thread(target=elsewhere.serve_forever, daemon=True).start()
            self.addCleanup(elsewhere.shutdown)
            self.page.get(f"http://127.0.0.1:{elsewhere.server_port}/")
            told = self.page.execute_async_script(
                "const [host, done] = arguments;"
                "const socket = new WebSocket(`ws://${host}/ws`);"
                "const opened = new Promise((then) => { socket.onopen = () => then('open');"
                " socket.onerror = () => then('refused'); });"
                "const read = fetch(`http://${host}/api/state`, {credentials: 'include'})"
                ".then(() => 'read', () => 'refused');"
                "const frame = document.createElement('iframe'); frame.src = `http://${host}/`;"
                "const framed = new Promise((then) => { frame.onload = then; });"
                "document.body.append(frame);"
                "Promise.all([opened, read, framed]).then(([socket, state]) => done([socket, state]));",
                self.viewer.host)
            self.assertEqual(told, ["refused"] * 2)
            logged = "\n".join(entry["message"] for entry in self.console())
            for said in ("Unexpected response code: 403", "blocked by CORS policy", "frame-ancestors"):
                self.assertIn(said, logged)

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

    def test_reload_two_pages_touch_and_the_dark(self):
        self.rest()
        self.page.refresh()  # the cookie is enough
        first = self.rest()
        self.page.switch_to.new_window("tab")
        self.page.get(f"http://{self.viewer.host}/")
        self.rest()
        self.page.close()
        self.page.switch_to.window(self.page.window_handles[0])
        self.prefer("dark")
        for kind, x in (("touchStart", 300), ("touchMove", 340), ("touchMove", 400), ("touchEnd", None)):
            points = [] if x is None else [{"x": x, "y": 250}]
            self.page.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        self.rest(first["id"])
        self.screenshot("dark")
        self.assertEqual(self.console(), [])

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

    def test_the_page_says_when_the_program_has_ended(self):
        self.rest()
        self.viewer.stop()
        self.wait("the banner", lambda: self.page.find_element(By.ID, "banner").is_displayed())
        self.assertIn("does not answer", self.page.find_element(By.ID, "banner").text)
        self.screenshot("ended")

    def banner(self):
        return self.page.find_element(By.ID, "banner").text

    def restart(self, arguments):
        self.viewer.stop()
        self.viewer = Viewer(self.program, arguments, port=self.viewer.address.port)
        self.addCleanup(self.viewer.folder.cleanup)
        self.addCleanup(self.viewer.stop)
        self.wait("the sentence", lambda: "open the address that it has printed" in self.banner())
        # A new token is the new program's alone, until a person opens its address.
        old = self.page.current_window_handle
        self.page.switch_to.new_window("tab")
        self.page.get(self.viewer.url)
        self.rest()
        self.page.close()
        self.page.switch_to.window(old)

    def test_the_page_comes_back_to_a_program_that_was_started_anew(self):
        first = self.rest()
        self.drag(60, 0)
        before = self.rest(first["id"])
        eye = self.page.execute_script("return window.raysplats.rig.eye")
        self.restart(self.arguments_given)
        # The same model again: the view stays, and pictures of it come.
        self.rest(before["id"])
        self.assertEqual(self.page.execute_script("return window.raysplats.rig.eye"), eye)
        self.assertEqual(self.banner(), "")
        # Another one: the page is that of the new program.
        self.restart([self.arguments_given[0]])
        self.wait("the other page", lambda: self.page.execute_script(
            "return document.getElementById('camera-section').hidden;") and self.seen()["lost"] == 0)
        self.rest()
        self.assertEqual(self.banner(), "")


class PhotoTest(PageCase):
    """A model beside the photos that it was to be like."""

    def arguments(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        photos = os.path.join(folder, "photos")
        subprocess.run([self.program, "generate", photos, "--size", "64", "--train-views", "3", "--test-views", "2",
                        "-q"], check=True, stdout=subprocess.DEVNULL)
        model = os.path.join(folder, "model.ply")
        write_model(model)
        return [model, "--data", photos, "--split", "train"]

    def overlay(self, x, y):
        """A pixel of what lies over the picture, at shares of its size."""
        return self.page.execute_script(
            "const c = document.getElementById('overlay');"
            "return Array.from(c.getContext('2d').getImageData(arguments[0] * c.width,"
            " arguments[1] * c.height, 1, 1).data);", x, y)

    def slide(self, name, value):
        self.page.execute_script(
            "const s = document.getElementById(arguments[0]); s.value = arguments[1];"
            "s.dispatchEvent(new Event('input'));", name, value)

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


class TrainTest(PageCase):
    """A run of generated photos, watched from its first step to its end."""
    command = "train"

    def arguments(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_browser_"))
        photos = os.path.join(folder, "photos")
        subprocess.run([self.program, "generate", photos, "--size", "96", "--train-views", "16", "--test-views", "2",
                        "-q"], check=True, stdout=subprocess.DEVNULL)
        self.run_folder = os.path.join(folder, "run")
        return [photos, "-o", self.run_folder, "--view", "-n", "1500", "--eval-at", "200,400", "--eval-renders", "0"]

    def iteration(self):
        return self.page.execute_script("const s = window.raysplats.run && window.raysplats.run.state;"
                                        "return s && s.rows.length ? s.rows[s.rows.length - 1][0] : 0;")

    def test_a_run_is_watched_paused_saved_and_resumed(self):
        self.wait("iterations", lambda: self.iteration() > 420)
        shown = self.seen()
        self.assertGreater(shown["pictures"], 1)
        self.drag(80, 10)
        self.wait("a picture of the movement", lambda: self.seen()["id"] > shown["id"])
        newer = self.seen()["last"]["iteration"]
        self.wait("pictures of newer models", lambda: self.seen()["last"]["iteration"] > newer)
        self.page.find_element(By.ID, "pause").click()
        self.wait("the pause", lambda: self.page.find_element(By.ID, "pause").text == "Resume")
        self.wait("all samples", lambda: self.seen()["last"]["samples"] == 16)
        held = self.seen()
        self.wait("the state", lambda: self.iteration() == held["last"]["iteration"] // 10 * 10)
        before = self.iteration()
        time.sleep(1.5)
        self.assertEqual(self.iteration(), before)
        for canvas in ("curve-loss", "curve-psnr", "curve-count"):
            self.assertTrue(self.painted(canvas), canvas)
        self.assertIn("test views", self.page.find_element(By.ID, "text-psnr").text)
        self.screenshot("training")
        self.page.find_element(By.ID, "save").click()
        saved = os.path.join(self.run_folder, "point_cloud", f"iteration_{held['last']['iteration']}")
        self.wait("the saved model", lambda: os.path.exists(os.path.join(saved, "point_cloud.ply")))
        self.page.find_element(By.ID, "pause").click()
        self.wait("more iterations", lambda: self.iteration() > before)
        self.wait("the end", lambda: self.page.find_element(By.ID, "banner").is_displayed())
        self.assertIn("The run has ended: raysplats view", self.page.find_element(By.ID, "banner").text)
        self.assertEqual(self.viewer.process.wait(timeout=60), 0)
        self.screenshot("trained")


if __name__ == "__main__":
    main()
