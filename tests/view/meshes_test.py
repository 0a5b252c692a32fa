#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Meshes that are dropped on the page of `raysplats view`.
usage: meshes_test.py PROGRAM"""
import json
import math
import os
import subprocess
import sys
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from program import LAST, Channel, Viewer, picked, psnr, view  # noqa: E402

PROGRAM = ""


def cube(half=0.5):
    """An OBJ file that names a material file, which nobody may open."""
    corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    text = "mtllib /etc/passwd\nusemtl root\n"
    text += "".join("v {} {} {}\n".format(*c) for c in corners)
    return (text + "".join("f {} {} {} {}\n".format(*f) for f in faces)).encode()


def place(**more):
    return {"material": "mirror", "at": [0, 0, -1.5], "rotate": [0, 0, 0], "size": 0.6, **more}


class MeshesTest(unittest.TestCase):
    def drop(self, channel, data, form="obj", **more):
        """Sends a mesh; the next text that comes."""
        time.sleep(1.1)  # one a second
        channel.send_json(type="mesh", format=form, name=f"dropped.{form}", bytes=len(data), **place(**more))
        for start in range(0, len(data), 60000):
            channel.send(data[start:start + 60000], code=2)
        return self.text(channel)

    def text(self, channel):
        """The next text that is no mere note of what is going on."""
        while True:
            kind, *rest = channel.receive()
            if kind == "text" and rest[0]["type"] != "note":
                return rest[0]

    def still(self, channel, number, **more):
        channel.send_json(**view(number, (96, 64), png=True, **more))
        while True:
            kind, *rest = channel.receive()
            if kind == "picture" and rest[0]["view"] == number and rest[0]["flags"] & LAST:
                return rest[1]

    def test_a_mesh_is_drawn_moved_saved_and_removed(self):
        with Viewer(PROGRAM) as viewer, Channel(viewer) as channel, Channel(viewer) as other:
            folder = viewer.folder.name
            self.assertTrue(json.loads(viewer.ask("/api/state", Cookie=viewer.cookie())[2])["takes_meshes"])
            before = self.still(channel, 1)
            told = self.drop(channel, cube())
            self.assertEqual(told["type"], "meshes", told)
            (mesh,) = told["meshes"]
            self.assertEqual((mesh["name"], mesh["triangles"], mesh["material"]), ("dropped.obj", 12, "mirror"))
            self.assertEqual(self.text(other), told)  # all pages hear of it
            first = self.still(channel, 2)
            self.assertNotEqual(before, first)
            channel.send_json(type="place", mesh=mesh["mesh"],
                              **place(material="diffuse", at=[0.2, 0.1, -1.5], rotate=[20, 30, 40], size=0.8))
            (moved,) = self.text(channel)["meshes"]
            self.assertEqual((moved["rotate"], moved["size"]), ([20, 30, 40], 0.8))
            shown = self.still(channel, 3)
            self.assertNotEqual(first, shown)
            # A ray meets the mesh before the model, whose centre is behind it.
            self.assertLess(picked(channel, 7)[2], -1.5)
            # So does its depth, which is the nearest.
            near = self.still(channel, 4, output="depth")
            channel.send_json(**{**view(5, (96, 64)), "type": "scene"})
            scene = self.text(channel)["text"]
            # What is saved is what `render` draws, with the mesh beside it.
            with open(os.path.join(folder, "dropped.obj"), "wb") as file:
                file.write(cube().replace(b"mtllib /etc/passwd\n", b""))
            with open(os.path.join(folder, "scene.toml"), "w") as file:
                file.write(scene)
            with open(os.path.join(folder, "shown.png"), "wb") as file:
                file.write(shown)
            subprocess.run([PROGRAM, "render", os.path.join(folder, "scene.toml"), "-o",
                            os.path.join(folder, "out"), "--samples", "64", "-q"], check=True,
                           stdout=subprocess.DEVNULL)
            drawn, = os.listdir(os.path.join(folder, "out"))
            self.assertGreater(psnr(os.path.join(folder, "shown.png"), os.path.join(folder, "out", drawn)), 35)
            channel.send_json(type="remove", mesh=mesh["mesh"])
            self.assertEqual(self.text(channel)["meshes"], [])
            self.assertEqual(self.still(channel, 6), before)
            self.assertNotEqual(self.still(channel, 9, output="depth"), near)
            self.assertGreater(picked(channel, 8)[2], -1)
            channel.send_json(type="place", mesh=mesh["mesh"], **place())
            self.assertIn("no mesh", self.text(channel)["text"])

    def test_what_is_damaged_or_too_much_is_one_sentence(self):
        with Viewer(PROGRAM) as viewer, Channel(viewer) as channel:
            def refused(data, form="obj", **more):
                answer = self.drop(channel, data, form, **more)
                self.assertEqual(answer["type"], "error", answer)
                self.assertNotIn("\n", answer["text"])
                if self.text_after(channel):
                    self.fail("there is a mesh")
                return answer["text"]

            refused(b"v 0 0 0\nf 1 2 3\n")
            refused(b"\x00\x01", "ply")
            refused(b"glTF", "glb")
            self.assertIn("one GLB", refused(json.dumps({
                "asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "../../etc/passwd"}]}).encode(),
                "glb"))
            for more in ({"bytes": 1 << 40}, {"bytes": 0}, {"name": "../a.obj"}, {"name": ""}, {"format": "toml"},
                         {"size": 0}, {"at": [0, 0, 1e9]}, {"material": "gold"}, {"rotate": [0]}):
                message = {"type": "mesh", "format": "obj", "name": "a.obj", "bytes": 9, **place(), **more}
                channel.send_json(**message)
                self.assertEqual(self.text(channel)["type"], "error", more)
            # Bytes that nobody has offered, and more than were offered.
            channel.send(b"x" * 1000, code=2)
            time.sleep(1.1)
            channel.send_json(type="mesh", format="obj", name="a.obj", bytes=10, **place())
            channel.send_json(type="mesh", format="obj", name="b.obj", bytes=10, **place())
            self.assertIn("on its way", self.text(channel)["text"])
            channel.send(b"x" * 11, code=2)
            self.assertIn("more bytes", self.text(channel)["text"])
            channel.send_json(type="mesh", format="obj", name="b.obj", bytes=10, **place())
            self.assertIn("one a second", self.text(channel)["text"])
            for number in range(1, 9):
                self.assertEqual(len(self.drop(channel, cube())["meshes"]), number)
            self.assertIn("8 meshes", self.drop(channel, cube())["text"])
        self.assertEqual(viewer.process.returncode, 0)

    def text_after(self, channel):
        """The list that follows an error."""
        return self.text(channel)["meshes"]

    def test_scene_files_take_meshes_too(self):
        with Viewer(PROGRAM) as plain:
            folder = plain.folder.name
            with open(os.path.join(folder, "own.obj"), "wb") as file:
                file.write(cube().replace(b"mtllib /etc/passwd\n", b""))
            scene = os.path.join(folder, "scene.toml")
            with open(scene, "w") as file:
                file.write('[[model]]\nfile = "model.ply"\n[[mesh]]\nfile = "own.obj"\ntranslate = [0, 1, 0]\n'
                           '[camera]\norbit = { frames = 4 }\n')
            with Viewer(PROGRAM, [scene]) as viewer, Channel(viewer) as channel:
                before = self.still(channel, 1)
                # The front of the file's own cube, a unit below the eye's line, then the one that was dropped before it.
                own = picked(channel, 5, (0.5, 0.5 + 0.5 / math.tan(math.radians(25)) * 1 / 5.5))
                self.assertAlmostEqual(own[2], -0.5, places=4)
                self.assertAlmostEqual(own[1], 1, places=4)
                (mesh,) = self.drop(channel, cube(), material="glass")["meshes"]
                self.assertAlmostEqual(picked(channel, 6)[2], -1.5 - 0.6 / math.sqrt(3), places=4)
                self.assertNotEqual(self.still(channel, 2), before)
                channel.send_json(**{**view(3), "type": "scene"})
                text = self.text(channel)["text"]
                self.assertIn("page-glass", text)
                self.assertNotIn("[camera]", text)
                channel.send_json(type="remove", mesh=mesh["mesh"])
                self.text(channel)
                self.assertEqual(self.still(channel, 4), before)


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
