#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A run that is watched while it trains. usage: training_test.py PROGRAM"""
import glob
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from program import Channel, Viewer, view  # noqa: E402

PROGRAM = ""
FOLDER = ""  # with the photos and the run that nobody watched
ITERATIONS = 600


def arguments(run, photos="photos"):
    return [os.path.join(FOLDER, photos), "-o", os.path.join(FOLDER, run), "-n", str(ITERATIONS),
            "--init-count", "300", "--max-gaussians", "900", "--sh-degree", "1", "--deterministic",
            "--checkpoint-every", "0", "--log-every", "1"]


def result(run):
    """The bytes of the last model and checkpoint."""
    folder = os.path.join(FOLDER, run)
    model = os.path.join(folder, "point_cloud", f"iteration_{ITERATIONS}", "point_cloud.ply")
    checkpoint = os.path.join(folder, "checkpoints", f"step_{ITERATIONS:09}.rsck")
    return [pathlib.Path(path).read_bytes() for path in (model, checkpoint)]


class TrainingTest(unittest.TestCase):
    def state(self, run):
        status, _, body = run.ask("/api/run", Cookie=run.cookie())
        self.assertEqual(status, 200)
        return json.loads(body)

    def iteration(self, run):
        rows = self.state(run)["rows"]
        return rows[-1][0] if rows else 0

    def picture(self, channel):
        """The next picture's header; what is told meanwhile is not looked at."""
        while True:
            message = channel.receive()
            if message[0] == "picture":
                return message[1]
            self.assertEqual((message[0], message[1].get("type")), ("text", "run"))

    def picture_of(self, channel, view):
        """The header of that view's first picture; one that rested before may have got a newer one meanwhile."""
        header = self.picture(channel)
        while header["view"] == view - 1:
            header = self.picture(channel)
        self.assertEqual(header["view"], view)
        return header

    def end(self, run):
        run.process.stdout.read()
        self.assertEqual(run.process.wait(timeout=120), 0)

    def test_watching_pausing_and_saving_change_nothing(self):
        with Viewer(PROGRAM, [*arguments("watched/", "photos/"), "--view"], "train") as run, Channel(run) as channel:
            state = json.loads(run.ask("/api/state", Cookie=run.cookie())[2])
            self.assertTrue(state["trains"])
            self.assertEqual((state["name"], state["about"]), ("watched", "in training on 6 photos of photos"))
            self.assertEqual(len(state["cameras"]), 6)
            channel.send_json(type="share", share=0.9)
            seen = []
            for number in range(1, 9):
                channel.send_json(**view(number, eye=(0.1 * number, 0, -4), moving=number % 2 == 1))
                seen.append(self.picture_of(channel, number))
            # A page that rests gets pictures of newer models without asking.
            newer = self.picture(channel)
            self.assertEqual(newer["view"], 8)
            self.assertGreater(newer["iteration"], seen[-1]["iteration"])

            channel.send_json(type="pause")
            end = time.time() + 60
            while not self.state(run)["paused"]:
                self.assertLess(time.time(), end)
            held = self.iteration(run)
            self.assertLess(held, ITERATIONS)
            # All samples of full size, and the model stands still.
            channel.send_json(**view(20))
            while (header := self.picture(channel))["view"] < 20 or not header["flags"] & 1:
                pass
            self.assertEqual((header["samples"], header["width"]), (16, 64))
            time.sleep(0.5)
            self.assertEqual(self.iteration(run), held)
            channel.send_json(type="save")
            saved = os.path.join(FOLDER, "watched/point_cloud", f"iteration_{held}", "point_cloud.ply")
            end = time.time() + 60
            while not os.path.exists(saved) or not glob.glob(
                    os.path.join(FOLDER, f"watched/checkpoints/step_{held:09}.rsck")):
                self.assertLess(time.time(), end)
                time.sleep(0.02)
            channel.send_json(type="resume")
            self.end(run)
        self.assertEqual(result("watched"), result("alone"))

    def test_the_page_decides_how_much_time_pictures_take(self):
        with Viewer(PROGRAM, [*arguments("quiet"), "--view"], "train") as run, Channel(run) as channel:
            channel.send_json(type="share", share=0)
            channel.send_json(**view(1))
            told = [channel.receive()]
            while told[-1][0] == "picture" or "ended" not in told[-1][1]:
                told.append(channel.receive())
            self.assertIn("raysplats view", told[-1][1]["ended"])
            self.end(run)
        pictures = [message for message in told if message[0] == "picture"]
        # The command itself is heard within a look, which may draw what waits.
        self.assertLessEqual(len(pictures), 1)
        self.assertEqual(result("quiet"), result("alone"))

    def test_the_page_hears_that_the_run_was_interrupted(self):
        with Viewer(PROGRAM, [*arguments("interrupted"), "-n", "100000000", "--view"], "train") as run, \
                Channel(run) as channel:
            while self.iteration(run) == 0:
                time.sleep(0.02)
            run.process.send_signal(signal.SIGINT)
            told = channel.receive()
            while told[0] == "picture" or "ended" not in told[1]:
                told = channel.receive()
            self.assertIn("--resume", told[1]["ended"])
            run.process.stdout.read()
            self.assertEqual(run.process.wait(timeout=120), 130)

    def test_damaged_commands_are_refused(self):
        with Viewer(PROGRAM, [*arguments("refused"), "--view"], "train") as run, Channel(run) as channel:
            for share in (-1, 2, "x", None, 1e9):
                channel.send(json.dumps({"type": "share", "share": share}))
                while (message := channel.receive())[1].get("type") != "error":
                    pass
                self.assertIn("share", message[1]["text"])
            self.assertEqual(self.state(run)["share"], 0.1)
            run.stop()


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    with tempfile.TemporaryDirectory(prefix="raysplats_training_") as FOLDER:
        subprocess.run([PROGRAM, "generate", os.path.join(FOLDER, "photos"), "--size", "32", "--train-views",
                        "6", "--test-views", "1", "-q"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([PROGRAM, "train", *arguments("alone"), "-q"], check=True, stdout=subprocess.DEVNULL)
        unittest.main(verbosity=2)
