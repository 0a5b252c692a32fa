#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reports in Chromium.
usage: browser_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

from selenium.webdriver.common.by import By

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "../view")]
from awkward_run import HOSTILE, WIDE, write_ablation, write_run  # noqa: E402
from browser import BrowserCase, main  # noqa: E402


class ReportTest(BrowserCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="raysplats_report_")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.open_browser()

    def path(self, name):
        return os.path.join(self.folder, name)

    def make(self, *arguments):
        subprocess.run([self.program, *arguments, "-q"], check=True, stdout=subprocess.DEVNULL)

    def look(self, file, name):
        """Opens a page in all its dresses: nothing is asked for but the page, nothing sticks out."""
        url = pathlib.Path(file).as_uri()
        for dress, scheme, media, width in (("light", "light", "", 1000), ("dark", "dark", "", 1000),
                                            ("narrow", "light", "", 420), ("print", "dark", "print", 718)):
            self.prefer(scheme, media)
            self.page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
                "width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False})
            self.page.get(url)
            size = self.page.execute_script(
                "const e = document.documentElement; return [e.scrollWidth, e.scrollHeight]")
            self.assertLessEqual(size[0], width, dress)
            self.page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
                "width": width, "height": size[1], "deviceScaleFactor": 1, "mobile": False})
            for image in self.page.find_elements(By.TAG_NAME, "img"):
                self.assertGreater(image.get_property("naturalWidth"), 0)
            ground, ink = self.page.execute_script(
                "const style = getComputedStyle(document.body);"
                "return [style.backgroundColor, style.color].map(c => Number(c.match(/\\d+/)));")
            if dress == "dark":
                self.assertLess(ground, 60)
                self.assertGreater(ink, 200)
            else:
                self.assertLess(ink, 60)
            self.screenshot(f"report_{name}_{dress}")
        asked = [json.loads(entry["message"])["message"] for entry in self.page.get_log("performance")]
        urls = {event["params"]["request"]["url"] for event in asked if event["method"] == "Network.requestWillBeSent"}
        self.assertEqual({each for each in urls if not each.startswith("data:")}, {url})
        self.assertEqual(self.console(), [])

    def test_a_run(self):
        self.make("generate", self.path("data"), "--size", "96", "--train-views", "12", "--test-views", "6")
        run = self.path("run")
        self.make("train", self.path("data"), "-o", run, "-n", "120", "--exposure", "--profile")
        self.look(os.path.join(run, "report.html"), "run")
        headings = [each.text for each in self.page.find_elements(By.TAG_NAME, "h2")]
        for heading in ("Curves", "Held-out views", "Cameras", "Model", "Exposure", "Kernels"):
            self.assertIn(heading, headings)
        self.assertEqual(len(self.page.find_elements(By.TAG_NAME, "figure")), 3)

    def test_awkward_runs(self):
        runs = [self.path(f"run_{i}_<b>&'{WIDE}") for i in range(2)]
        for i, run in enumerate(runs):
            write_run(run, i)
        for name, given in (("awkward", runs[:1]), ("several", runs)):
            file = self.path(f"{name}.html")
            self.make("report", *given, "-o", file)
            self.look(file, name)
            self.assertIn(HOSTILE, self.page.find_element(By.TAG_NAME, "body").text)

    def test_a_benchmark(self):
        file = self.path("bench.html")
        self.make("bench", "--sizes", "1k", "--resolution", "64x64", "--repeat", "1", "--filter", "^(forward|adam)",
                  "--html", file)
        self.look(file, "bench")
        self.assertIn("forward", self.page.find_element(By.TAG_NAME, "body").text)

    def test_an_ablation(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("no matplotlib: apt-get install python3-matplotlib")
        write_ablation(self.folder)
        subprocess.run([sys.executable, os.path.join(HERE, "../../scripts/bench/plot.py"), "ablation", self.folder],
                       check=True, stdout=subprocess.DEVNULL)
        self.look(self.path("ablation.html"), "ablation")
        self.assertIn(HOSTILE, self.page.find_element(By.TAG_NAME, "body").text)


if __name__ == "__main__":
    main()
