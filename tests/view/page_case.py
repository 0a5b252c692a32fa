# SPDX-License-Identifier: Apache-2.0
"""The viewer's page in Chromium, with what a person does to it."""
import base64
import json
import math
import os
import subprocess
import sys
import tempfile
import time

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import BrowserCase  # noqa: E402
from program import Viewer, write_model  # noqa: E402

PATIENCE = 120  # seconds; kernels may have to be compiled first


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

    def status(self):
        return self.page.find_element(By.ID, "status").text

    def download(self, name):
        """A file that the page has saved, which is then out of its way. Chromium keeps the name with an empty file, and
        puts the whole one in its place."""
        saved, taken = os.path.join(self.downloads, name), os.path.join(self.viewer.folder.name, f"{time.time()}_{name}")
        self.wait(name, lambda: os.path.exists(saved) and os.path.getsize(saved) > 0)
        os.rename(saved, taken)
        return taken

    def rendered(self, name, size, supersample=4):
        """What `render` draws of the pinhole that the page looks through."""
        width, height = size["width"], size["height"]
        pose, fov = self.page.execute_script("return [window.raysplats.rig.pose, window.raysplats.rig.fov]")
        focal = 0.5 * height / math.tan(0.5 * math.radians(fov))
        rows = [[pose[4 * i], -pose[4 * i + 1], -pose[4 * i + 2], pose[4 * i + 3]] for i in range(3)]
        out = os.path.join(self.viewer.folder.name, name)
        with open(out + ".json", "w") as file:
            json.dump({"w": width, "h": height, "fl_x": focal, "fl_y": focal, "cx": width / 2, "cy": height / 2,
                       "frames": [{"file_path": "page.png", "transform_matrix": rows + [[0, 0, 0, 1]]}]}, file)
        subprocess.run([self.program, "render", self.viewer.model, "--cameras", out + ".json", "-o", out,
                        "--supersample", str(supersample), "-q"], check=True, stdout=subprocess.DEVNULL)
        return os.path.join(out, "page.png")

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

    def listen(self):
        """Remembers what the page asks for from here on."""
        self.page.execute_script(
            "const send = WebSocket.prototype.send;"
            "WebSocket.prototype.send = function (data) {"
            " const message = typeof data === 'string' ? JSON.parse(data) : {};"
            " if (message.type === 'view') window.raysplats.sent = message;"
            " return send.call(this, data); };")

    def sent(self):
        """The last view that the page has asked for since listen()."""
        return self.page.execute_script("return window.raysplats.sent")

    def settle(self):
        """Waits for the best picture of the last of what listen() has heard."""
        return self.wait("the last picture", lambda: (
            lambda s, sent: s if sent and s["last"] and s["last"]["last"] and s["last"]["id"] == sent["id"] else None)(
                self.seen(), self.sent()))

    def target(self):
        """The centre that the camera turns around."""
        return self.page.execute_script("return window.raysplats.rig.target")

    def double_click(self):
        ActionChains(self.page).double_click(self.page.find_element(By.ID, "picture")).perform()

    def slide(self, name, value):
        self.page.execute_script(
            "const s = document.getElementById(arguments[0]); s.value = arguments[1];"
            "s.dispatchEvent(new Event('input'));", name, value)


class ModelCase(PageCase):
    """A model, and two cameras for the list."""

    def arguments(self):
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

    def module(self, expression, *arguments):
        """What an expression of a page's modules gives: path, toml or vectors."""
        return self.page.execute_async_script(
            "const [...given] = arguments; const done = given.pop();"
            "Promise.all(['path', 'toml', 'vectors'].map((name) => import(`/${name}.js`)))"
            f".then(([path, toml, vectors]) => done({expression}), (error) => done(String(error)));", *arguments)
