#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A run on the page.
usage: browser_training_test.py PROGRAM [FOLDER]     (screenshots go to FOLDER)"""
import os
import subprocess
import sys
import tempfile
import time

from selenium.webdriver.common.by import By

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import main  # noqa: E402
from page_case import PageCase  # noqa: E402
from program import psnr  # noqa: E402


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
