# SPDX-License-Identifier: Apache-2.0
"""Chromium without a screen, for the tests of pages."""
import os
import shutil
import sys
import tempfile
import unittest

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service


def browser():
    options = Options()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu",
                     "--window-size=1000,640"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)


class BrowserCase(unittest.TestCase):
    program = ""
    folder_of_screenshots = None

    def open_browser(self):
        self.page = browser()
        self.addCleanup(self.page.quit)
        self.downloads = self.enterContext(tempfile.TemporaryDirectory(prefix="raysplats_downloads_"))
        self.page.execute_cdp_cmd("Browser.setDownloadBehavior", {
            "behavior": "allow", "downloadPath": self.downloads})

    def screenshot(self, name):
        if self.folder_of_screenshots:
            os.makedirs(self.folder_of_screenshots, exist_ok=True)
            self.page.save_screenshot(os.path.join(self.folder_of_screenshots, f"{name}.png"))

    def console(self):
        return [entry for entry in self.page.get_log("browser") if entry["level"] == "SEVERE"]

    def prefer(self, scheme, media=""):
        self.page.execute_cdp_cmd("Emulation.setEmulatedMedia", {
            "media": media, "features": [{"name": "prefers-color-scheme", "value": scheme}]})


def main():
    """Runs the tests of a file that was started as FILE PROGRAM [FOLDER]; screenshots go to FOLDER."""
    BrowserCase.program = os.path.abspath(sys.argv.pop(1))
    BrowserCase.folder_of_screenshots = sys.argv.pop(1) if len(sys.argv) > 1 else None
    unittest.main(module="__main__", verbosity=2)
