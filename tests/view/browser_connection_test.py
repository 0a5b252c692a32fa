#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The channel between page and program: who gets one, and what becomes of it.
usage: browser_connection_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import http.server
import os
import sys
import tempfile
import threading
import unittest.mock

from selenium.webdriver.common.by import By

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import ModelCase  # noqa: E402
from program import Viewer  # noqa: E402


class Elsewhere(http.server.BaseHTTPRequestHandler):
    """Somebody's page, on another port of the same host."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><body>")

    def log_message(self, *_):
        pass


class ConnectionTest(ModelCase):
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

    def test_the_first_picture_is_waited_for_in_words(self):
        # The page of the program that ends would look for it and say in the console that it is gone.
        self.page.get("about:blank")
        self.viewer.stop()
        # Kernels of nobody's: they are compiled now.
        cache = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_cache_"))
        self.enterContext(unittest.mock.patch.dict(os.environ, {"XDG_CACHE_HOME": cache}))
        fresh = Viewer(self.program, self.arguments_given)
        self.addCleanup(fresh.folder.cleanup)
        self.addCleanup(fresh.stop)
        self.page.get(fresh.url)
        self.wait("the page", lambda: self.status())
        self.assertEqual((self.status(), self.seen()["pictures"]),
                         ("Waiting for the first picture; kernels may have to be compiled", 0))
        self.screenshot("waiting")
        self.rest()
        self.assertIn("16 samples", self.status())
        self.assertEqual(self.console(), [])

    def test_reload_and_two_pages(self):
        self.rest()
        self.page.refresh()  # the cookie is enough
        self.rest()
        self.page.switch_to.new_window("tab")
        self.page.get(f"http://{self.viewer.host}/")
        self.rest()
        self.page.close()
        self.page.switch_to.window(self.page.window_handles[0])
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


if __name__ == "__main__":
    main()
