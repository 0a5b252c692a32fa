#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The pages of `raysplats report`, `raysplats bench --html` and scripts/ablation.sh, read by an XML parser.
usage: pages_test.py PROGRAM"""
import json
import os
import subprocess
import sys
import tempfile
import unittest
import xml.dom.minidom

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "../view")]
from awkward_run import HOSTILE, write_ablation, write_run  # noqa: E402
from program import write_model  # noqa: E402

PROGRAM = ""
MOST_BYTES = 3_000_000


def texts(node):
    """All that a reader may see, attributes included."""
    if node.nodeType == node.TEXT_NODE:
        return node.data
    own = " ".join(value for _, value in node.attributes.items()) if node.attributes else ""
    return own + "\n" + "".join(texts(child) for child in node.childNodes)


class PagesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="raysplats_pages_")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def page(self, *arguments):
        """The page that a command writes, parsed."""
        file = self.path("page.html")
        subprocess.run([PROGRAM, *(file if a is None else a for a in arguments), "-q"], check=True,
                       stdout=subprocess.DEVNULL)
        return self.parsed(file)

    def parsed(self, file):
        self.assertLess(os.path.getsize(file), MOST_BYTES)
        page = xml.dom.minidom.parse(file)
        for element in page.getElementsByTagName("*"):
            self.assertNotIn(element.tagName, ("script", "link", "iframe", "object", "base"))
            for name, value in element.attributes.items():
                self.assertFalse(name.startswith("on"), name)
                if name in ("src", "href"):
                    self.assertTrue(value.startswith("data:image/"), value[:40])
        self.assertIn("@media print", page.getElementsByTagName("style")[0].firstChild.data)
        return page

    def runs(self):
        runs = [self.path(f"run_{i}_<b>&'\"") for i in range(2)]
        for i, run in enumerate(runs):
            write_run(run, i)
        return runs

    def test_a_run_of_awkward_texts(self):
        page = self.page("report", self.runs()[0], "-o", None)
        seen = texts(page)
        # Device, driver, version, fingerprint, kernel, all views, the setting twice.
        self.assertGreaterEqual(seen.count(HOSTILE), 5 + 10 + 2)
        self.assertIn("run_0_<b>&'\"", seen)
        self.assertEqual(len(page.getElementsByTagName("figure")), 2)  # the worst has no picture
        headings = [node.firstChild.data for node in page.getElementsByTagName("h2")]
        for heading in ("Curves", "Held-out views", "Cameras", "Exposure", "Kernels"):
            self.assertIn(heading, headings)

    def test_runs_side_by_side(self):
        seen = texts(self.page("report", *self.runs(), "-o", None))
        self.assertGreaterEqual(seen.count(HOSTILE), 12)
        self.assertIn("run_1_<b>&'\"", seen)

    def test_a_benchmark(self):
        model = self.path("a<b>&'.ply")
        write_model(model)
        cameras = self.path("cameras.json")
        pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 6], [0, 0, 0, 1]]
        with open(cameras, "w", encoding="utf-8") as stream:
            json.dump({"w": 40, "h": 30, "fl_x": 40, "frames": [{"file_path": "a.png", "transform_matrix": pose}]},
                      stream)
        seen = texts(self.page("bench", "--model", model, "--cameras", cameras, "--repeat", "1", "--filter",
                               "^forward", "--html", None))
        self.assertIn("a<b>&'", seen)

    def test_an_ablation(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("no matplotlib")
        write_ablation(self.folder)
        subprocess.run([sys.executable, os.path.join(HERE, "../../scripts/bench/plot.py"), "ablation", self.folder],
                       check=True, stdout=subprocess.DEVNULL)
        page = self.parsed(self.path("ablation.html"))
        # The heading, three values, and the text of the picture.
        self.assertGreaterEqual(texts(page).count(HOSTILE), 5)
        self.assertEqual(len(page.getElementsByTagName("img")), 1)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main(verbosity=2)
