#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What `raysplats view` shows: the cameras of data sets and runs, models far from the origin, scene files.
usage: sources_test.py PROGRAM"""
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from program import LAST, PNG, Channel, Viewer, picked, psnr, view, write_model  # noqa: E402

PROGRAM = ""
ORIGIN = (4321012.125, -250000.5, 80)  # of a survey


class CamerasTest(unittest.TestCase):
    def test_the_list_has_the_views_that_are_asked_for(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_views_") as folder:
            model, photos = os.path.join(folder, "model.ply"), os.path.join(folder, "photos")
            write_model(model)
            subprocess.run([PROGRAM, "generate", photos, "--size", "16", "--train-views", "3", "--test-views", "2"],
                           check=True, stdout=subprocess.DEVNULL)
            for more, count in (([], 5), (["--split", "test"], 2), (["--split", "train"], 3)):
                with Viewer(PROGRAM, [model, "--data", photos, *more]) as viewer:
                    state = json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])
                    self.assertEqual(len(state["cameras"]), count, more)

    def test_a_run_brings_the_cameras_that_it_was_trained_from(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_run_") as folder:
            saved = os.path.join(folder, "run", "point_cloud", "iteration_5")
            os.makedirs(saved)
            write_model(os.path.join(saved, "point_cloud.ply"), ORIGIN)
            # z is up: the second axis of a camera points down.
            poses = {"front": ([0, -6, 0], [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
                     "side": ([6, 0, 1], [[0, 0, -1], [1, 0, 0], [0, -1, 0]])}
            with open(os.path.join(folder, "run", "cameras.json"), "w") as file:
                json.dump([{"id": 0, "img_name": name, "width": 64, "height": 48, "position": eye, "rotation": axes,
                            "fx": 50, "fy": 50} for name, (eye, axes) in poses.items()], file)
            run = os.path.join(folder, "run")
            for model in (run, os.path.join(saved, "point_cloud.ply")):
                with Viewer(PROGRAM, [model]) as viewer:
                    state = json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])
                    self.assertEqual([each["name"] for each in state["cameras"]], list(poses))
                    self.assertEqual([state["start"]["c2w"][i] for i in (3, 7, 11)], [0, -6, 0])
                    self.assertLess(math.dist(state["up"], (0, 0, 1)), 1e-9)
                    self.assertEqual(state["origin"], list(ORIGIN))
                    # Photos are the data set's.
                    self.assertFalse(any(each["photo"] for each in state["cameras"]))
                    self.assertIn("--data", state["about"])
                    self.assertEqual(viewer.ask("/api/photo/0", Cookie=viewer.cookie())[0], 404)
            # What is damaged keeps nobody from looking.
            with open(os.path.join(run, "cameras.json"), "w") as file:
                file.write('[{"position": [0]}]')
            with Viewer(PROGRAM, [run]) as viewer:
                self.assertEqual(json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])["cameras"], [])


class ForeignTest(unittest.TestCase):
    def test_how_a_foreign_model_is_traced_is_said_once(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_foreign_") as folder:
            model = os.path.join(folder, "model.ply")
            write_model(model)
            with subprocess.Popen([PROGRAM, "view", model, "--port", "0"], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True) as process:
                process.stdout.readline()
                process.send_signal(signal.SIGINT)
                told = "".join(process.communicate(timeout=30))
            self.assertEqual(told.count("does not say how it is traced"), 1, told)


class OriginTest(unittest.TestCase):
    @unittest.skipUnless(shutil.which("node"), "the page's scripts are run by node")
    def test_paths_are_in_the_coordinates_of_the_data_set(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_origin_") as folder:
            model = os.path.join(folder, "model.ply")
            write_model(model, ORIGIN)
            shown = os.path.join(folder, "shown.png")
            eye = (0.5, 0.2, -6)
            with Viewer(PROGRAM, [model]) as viewer, Channel(viewer) as channel:
                channel.send_json(**view(1, eye=eye, png=True))
                while True:
                    kind, header, data = channel.receive()
                    self.assertEqual(kind, "picture")
                    if header["flags"] & PNG:
                        break
                with open(shown, "wb") as file:
                    file.write(data)
                origin = json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])["origin"]
                for name in ("path", "toml", "vectors"):
                    with open(os.path.join(folder, f"{name}.js"), "wb") as file:
                        file.write(viewer.ask(f"/{name}.js", Cookie=viewer.cookie())[2])
            with open(os.path.join(folder, "package.json"), "w") as file:
                file.write('{"type": "module"}')
            given = {"origin": origin, "keys": [{"eye": eye, "turn": [1, 0, 0, 0], "fov": 50, "distance": 6}],
                     "settings": {"seconds": 1, "fps": 1, "closed": False, "constant": False, "width": 64,
                                  "height": 48, "model": "pinhole"}}
            with open(os.path.join(folder, "page.js"), "w") as file:
                file.write("import { writeFileSync } from 'node:fs';\n"
                           "import { keyframesOf, pathFile } from './path.js';\n"
                           "import { keyframesIn, tomlOf } from './toml.js';\n"
                           f"const {{ keys, settings, origin }} = {json.dumps(given)};\n"
                           "const path = JSON.stringify(pathFile(keys, settings, origin));\n"
                           "const toml = tomlOf(keys, settings, origin);\n"
                           "writeFileSync('path.json', path);\n"
                           "writeFileSync('path.toml', toml);\n"
                           "console.log(JSON.stringify([keyframesOf(JSON.parse(path), 6, origin),"
                           " keyframesIn(toml, origin)]));\n")
            told = subprocess.run(["node", "page.js"], cwd=folder, check=True, stdout=subprocess.PIPE).stdout
            for back in json.loads(told):  # as the page reads them
                self.assertLess(math.dist(back["keys"][0]["eye"], eye), 1e-8)
            with open(os.path.join(folder, "path.json")) as file:
                matrix = json.load(file)["camera_path"][0]["camera_to_world"]
            self.assertLess(math.dist([matrix[i] for i in (3, 7, 11)], [a + b for a, b in zip(eye, ORIGIN)]), 1e-8)
            for name in ("path.json", "path.toml"):
                out = os.path.join(folder, "of_" + name)
                subprocess.run([PROGRAM, "render", model, "--path", os.path.join(folder, name), "-o", out, "--format",
                                "png", "--supersample", "4", "-q"], check=True, stdout=subprocess.DEVNULL)
                drawn, = os.listdir(out)
                self.assertGreater(psnr(shown, os.path.join(out, drawn)), 35)


class ScenesTest(unittest.TestCase):
    def state(self, path):
        with Viewer(PROGRAM, [path]) as viewer:
            return json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])

    def test_meshes_alone_and_no_camera_are_looked_at(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_meshes_") as folder:
            with open(os.path.join(folder, "quad.obj"), "w") as file:
                file.write("v 40 -3 0\nv 46 -3 0\nv 46 5 0\nv 40 5 0\nf 1 2 3 4\n")
            path = os.path.join(folder, "scene.toml")
            with open(path, "w") as file:
                file.write('[[mesh]]\nfile = "quad.obj"\n[animation]\nframes = 4\n')
            state = self.state(path)
            self.assertEqual(state["center"], [43, 1, 0])
            self.assertAlmostEqual(state["radius"], 5)
            self.assertEqual(state["up"], [0, -1, 0])
            self.assertEqual(len(state["cameras"]), 1)
            eye = [state["start"]["c2w"][i] for i in (3, 7, 11)]
            self.assertLess(eye[1], 0)  # above
            self.assertLess(math.dist(eye, (43, 1, 0)), 20)

    def test_a_model_far_from_the_origin_is_met_by_the_cameras_of_files(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_survey_") as folder:
            write_model(os.path.join(folder, "model.ply"), ORIGIN)
            pose = [[1, 0, 0, ORIGIN[0]], [0, -1, 0, ORIGIN[1]], [0, 0, -1, ORIGIN[2] - 6], [0, 0, 0, 1]]
            with open(os.path.join(folder, "cameras.json"), "w") as file:
                json.dump({"w": 64, "h": 48, "fl_x": 50, "fl_y": 50,
                           "frames": [{"file_path": "a.png", "transform_matrix": pose}]}, file)
            path = os.path.join(folder, "scene.toml")
            with open(path, "w") as file:
                file.write('[[model]]\nfile = "model.ply"\n[camera]\nfile = "cameras.json"\n')
            state = self.state(path)
            self.assertEqual(state["origin"], list(ORIGIN))
            eye = [state["cameras"][0]["c2w"][i] for i in (3, 7, 11)]
            self.assertLess(math.dist(eye, (0, 0, -6)), 1e-6)

    def test_rough_mirrors_and_lenses_become_what_render_draws(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_rough_") as folder:
            write_model(os.path.join(folder, "model.ply"))
            with open(os.path.join(folder, "quad.obj"), "w") as file:
                file.write("v -3 -3 0\nv 3 -3 0\nv 3 3 0\nv -3 3 0\nf 1 2 3 4\n")

            def scene(name, roughness, aperture):
                path = os.path.join(folder, name + ".toml")
                with open(path, "w") as file:
                    file.write('[[model]]\nfile = "model.ply"\n[[mesh]]\nfile = "quad.obj"\nrotate = [0, 40, 0]\n'
                               'translate = [0, 1.2, 1.5]\nmaterial = "m"\n[[material]]\nname = "m"\n'
                               f'kind = "mirror"\nroughness = {roughness}\n[camera]\nposition = [0, 0, -6]\n'
                               'target = [0, 0, 0]\nup = [0, -1, 0]\nwidth = 64\nheight = 48\n'
                               f'focal = {24 / math.tan(math.radians(25))}\n[render]\nsamples = 64\n'
                               f'aperture = {aperture}\nfocus-distance = 3\n')
                return path

            def drawn(path):
                subprocess.run([PROGRAM, "render", path, "-o", path + ".out", "--format", "png", "-q"], check=True,
                               stdout=subprocess.DEVNULL)
                name, = os.listdir(path + ".out")
                return os.path.join(path + ".out", name)

            sharp = drawn(scene("sharp", 0, 0))
            for name, roughness, aperture in (("rough", 0.4, 0), ("lens", 0, 0.4)):
                path = scene(name, roughness, aperture)
                with Viewer(PROGRAM, [path]) as viewer, Channel(viewer) as channel:
                    channel.send_json(**view(1, png=True))
                    while True:
                        kind, header, data = channel.receive()
                        self.assertEqual(kind, "picture")
                        if header["flags"] & PNG:
                            break
                    shown = os.path.join(folder, name + ".png")
                    with open(shown, "wb") as file:
                        file.write(data)
                likeness = psnr(shown, drawn(path))
                self.assertGreater(likeness, 33, name)
                self.assertGreater(likeness, psnr(shown, sharp) + 3, name)

    def test_scene_files_are_drawn_with_more_samples(self):
        with Viewer(PROGRAM) as plain:
            scene = os.path.join(plain.folder.name, "scene.toml")
            with open(scene, "w") as file:
                file.write('[[model]]\nfile = "model.ply"\n[camera]\norbit = { frames = 4 }\n')
            with Viewer(PROGRAM, [scene]) as viewer, Channel(viewer) as channel:
                channel.send_json(**view(1, (32, 24)))
                seen = []
                while not seen or not seen[-1]["flags"] & LAST:
                    seen.append(channel.receive()[1])
                samples = [each["samples"] for each in seen]
                self.assertEqual(samples, sorted(set(samples)))
                self.assertLessEqual(set(samples), {1, 2, 4, 8, 16, 32, 64})
                self.assertEqual(samples[-1], 64)
                for number, (output, count) in enumerate((("depth", 1), ("normals", 64), ("hits", 64)), 10):
                    channel.send_json(**view(number, (32, 24), output=output))
                    while True:
                        kind, header, data = channel.receive()
                        self.assertEqual(kind, "picture")
                        if header["view"] == number and header["flags"] & LAST:
                            break
                    self.assertEqual((header["samples"], data[:2]), (count, b"\xff\xd8"))
                state = json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])
                self.assertEqual([state[f"has_{name}"] for name in ("depth", "near", "order", "background")],
                                 [True, False, False, False])
                # The ball in the middle, and nothing behind the camera.
                self.assertLess(math.dist(picked(channel, 3), (0, 0, 0)), 0.7)
                self.assertIsNone(picked(channel, 4, eye=(0, 0, 50)))


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
