#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What `raysplats view` says to its page, to strangers and to damaged messages.
usage: protocol_test.py PROGRAM"""
import contextlib
import json
import math
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from program import Address, Channel, Viewer, psnr, view, write_model  # noqa: E402

PROGRAM = ""
LAST, PNG = 1, 2
ORIGIN = (4321012.125, -250000.5, 80)  # of a survey


def listening(port):
    """The addresses on which this machine listens at a port, as the kernel writes them."""
    found = set()
    for table in ("tcp", "tcp6"):
        with open(f"/proc/net/{table}") as rows:
            for row in list(rows)[1:]:
                address, _, state = row.split()[1:4]
                host, number = address.split(":")
                if int(number, 16) == port and state == "0A":
                    found.add(host)
    return sorted(found)


class ViewerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.viewer = Viewer(PROGRAM)

    @classmethod
    def tearDownClass(cls):
        code = cls.viewer.stop()
        cls.viewer.folder.cleanup()
        assert code == 0, f"Ctrl-C ended it with {code}"

    def last_picture(self, channel, number):
        """The last picture of view `number`, and how many came for it."""
        count = 0
        while True:
            kind, *rest = channel.receive()
            self.assertEqual(kind, "picture", rest)
            header, data = rest
            if header["view"] != number:
                continue
            count += 1
            if header["flags"] & LAST:
                return header, data, count

    def test_strangers_are_refused(self):
        ask, token, cookie = self.viewer.ask, self.viewer.token, self.viewer.cookie()
        self.assertEqual(ask("/")[0], 403)
        self.assertEqual(ask("/?token=" + "0" * 32)[0], 403)
        self.assertEqual(ask("/app.js", Host="evil.example:80", Cookie=cookie)[0], 403)
        self.assertEqual(ask("/app.js", Origin="http://evil.example", Cookie=cookie)[0], 403)
        self.assertEqual(ask("/app.js", Host=None, Cookie=cookie)[0], 403)
        # Two of a kind are refused, whichever is ours.
        ours = {"Host": self.viewer.host, "Origin": f"http://{self.viewer.host}"}
        for name, theirs in (("Host", "evil.example:80"), ("Origin", "http://evil.example")):
            for pair in ((ours[name], theirs), (theirs, ours[name]), (ours[name], ours[name])):
                twice = {**ours, name: f"\r\n{name}: ".join(pair), "Cookie": cookie}
                self.assertEqual(ask("/app.js", **twice)[0], 403, pair)
                self.assertEqual(Channel(self.viewer, **twice).status, 403, pair)
        self.assertEqual(ask("/app.js", **ours, Cookie=cookie)[0], 200)
        port = self.viewer.address.port
        for origin in ("null", "http://evil.example", f"http://127.0.0.1:{port}.evil.example",
                       f"http://localhost:{port}"):
            self.assertEqual(Channel(self.viewer, Origin=origin).status, 403, origin)
        self.assertEqual(Channel(self.viewer, Cookie="a=b").status, 403)
        self.assertEqual(Channel(self.viewer, Cookie=None, Origin=None).status, 403)
        # A program that knows the token needs no origin.
        with Channel(self.viewer, f"/ws?token={token}", Cookie=None, Origin=None) as channel:
            self.assertEqual(channel.status, 101)

    def test_the_token_becomes_a_cookie(self):
        status, fields, _ = self.viewer.ask(f"/?token={self.viewer.token}")
        self.assertEqual((status, fields["location"]), (303, "/"))
        self.assertIn("HttpOnly", fields["set-cookie"])
        self.assertIn("SameSite=Strict", fields["set-cookie"])
        status, fields, body = self.viewer.ask("/", Cookie=fields["set-cookie"].split(";")[0])
        self.assertEqual(status, 200)
        self.assertIn(b"<!doctype html>", body)
        self.assertIn("default-src 'none'", fields["content-security-policy"])
        for name, value in (("x-content-type-options", "nosniff"), ("x-frame-options", "DENY"),
                            ("referrer-policy", "no-referrer"), ("cache-control", "no-store")):
            self.assertEqual(fields[name], value)
        self.assertNotIn("access-control-allow-origin", fields)

    def test_only_reading_and_only_what_there_is(self):
        ask, cookie = self.viewer.ask, self.viewer.cookie()
        for method in ("POST", "PUT", "DELETE", "OPTIONS"):
            self.assertEqual(ask("/api/state", method, Cookie=cookie)[0], 405, method)
        for path in ("/../../etc/passwd", "/etc/passwd", "/%2e%2e/app.js", "/app.js/x", "/index.htm"):
            self.assertEqual(ask(path, Cookie=cookie)[0], 404, path)
        state = json.loads(ask("/api/state", Cookie=cookie)[2])
        self.assertEqual(len(state["start"]["c2w"]), 12)
        self.assertEqual(state["about"], "103 Gaussians, SH degree 0")
        self.assertEqual(ask("/", "HEAD", Cookie=cookie)[2], b"")

    def test_requests_have_limits(self):
        ask, cookie = self.viewer.ask, self.viewer.cookie()
        for size in (10000, 20000, 500000):
            self.assertEqual(ask("/", Cookie=cookie, X="x" * size)[0], 431, size)
            self.assertEqual(ask("/" + "x" * size, Cookie=cookie)[0], 431, size)
        self.assertEqual(ask("/", Cookie=cookie, X="x" * 7000)[0], 200)
        self.assertEqual(ask("/", "POST", b"x" * 100, Cookie=cookie, Content_Length=100)[0], 413)
        with self.viewer.connect() as channel:
            channel.sendall(b"\x16\x03\x01 this is no HTTP\r\n\r\n")
            self.assertIn(channel.recv(100)[:5], (b"", b"HTTP/"))
        self.assertEqual(ask("/", Cookie=cookie)[0], 200)

    def test_who_says_nothing_is_not_waited_for(self):
        with self.viewer.connect() as silent, self.viewer.connect() as slow:
            slow.sendall(b"GET / HTTP/1.1\r\nHost: ")
            for channel in (silent, slow):
                channel.settimeout(30)
                self.assertEqual(channel.recv(100), b"")

    def test_a_page_that_talks_too_fast_is_heard_at_the_pace_of_others(self):
        with Channel(self.viewer) as channel:
            start = time.monotonic()
            for _ in range(1000):
                channel.send_json(type="leave")
            channel.send_json(**view(7, moving=True))
            with Channel(self.viewer) as other:  # which does not wait
                other.send_json(**view(8, moving=True))
                self.assertEqual(other.receive()[1]["view"], 8)
            self.assertEqual(channel.receive()[1]["view"], 7)  # nothing is lost
            # 250 a second, and those of one second at once. Machines that are slow take longer.
            self.assertGreater(time.monotonic() - start, 2.9)

    def test_pictures_arrive_and_get_better(self):
        with Channel(self.viewer) as channel:
            channel.send_json(**view(1))
            header, data, count = self.last_picture(channel, 1)
            self.assertEqual((header["width"], header["height"], header["samples"]), (64, 48, 16))
            self.assertEqual(data[:2], b"\xff\xd8")
            # Of 1, 2, 4, 8 and 16 samples; one that was not taken in time gives way to the next.
            self.assertIn(count, range(1, 6))
            channel.send_json(**view(2, png=True))
            header, data, _ = self.last_picture(channel, 2)
            self.assertEqual(header["flags"], LAST | PNG)
            self.assertEqual(data[:4], b"\x89PNG")
            channel.send_json(**view(3, output="depth"))
            self.assertEqual(self.last_picture(channel, 3)[0]["samples"], 1)
            # Too large is cut to --max-size, and the shape stays.
            channel.send_json(**view(4, (8000, 4000), moving=True))
            kind, header, _ = channel.receive()
            self.assertEqual(kind, "picture")
            self.assertAlmostEqual(header["width"] / header["height"], 2, delta=0.05)
            self.assertLessEqual(header["width"], 1920)

    def test_a_point_is_found_by_its_depth(self):
        with Channel(self.viewer) as channel:
            channel.send_json(**{**view(5), "type": "pick", "px": [0.5, 0.5]})
            kind, answer = channel.receive()
            self.assertEqual((kind, answer["type"], answer["id"]), ("text", "pick", 5))
            x, y, z = answer["point"]  # the ball in the middle
            self.assertAlmostEqual(x, 0, delta=0.05)
            self.assertAlmostEqual(y, 0, delta=0.05)
            self.assertAlmostEqual(z, 0, delta=0.7)
            channel.send_json(**{**view(6, eye=(0, 0, 50)), "type": "pick", "px": [0.5, 0.5]})
            self.assertIsNone(channel.receive()[1]["point"])

    def test_other_lenses_see_what_render_draws(self):
        # x to the right, y down, z ahead, as the picture is; the file has y up and z back.
        pose = [[1, 0, 0, 0.5], [0, -1, 0, 0.2], [0, 0, -1, -2], [0, 0, 0, 1]]
        lenses = {"fisheye": ((96, 64), {"camera_model": "OPENCV_FISHEYE", "fl_x": 32 / math.radians(100),
                                         "fl_y": 32 / math.radians(100), "cx": 48, "cy": 32}),
                  "equirectangular": ((128, 64), {"camera_model": "EQUIRECTANGULAR"})}
        for number, (model, (size, lens)) in enumerate(lenses.items(), 20):
            folder = os.path.join(self.viewer.folder.name, model)
            cameras = folder + ".json"
            with open(cameras, "w") as file:
                json.dump({"w": size[0], "h": size[1], **lens,
                           "frames": [{"file_path": "drawn.png", "transform_matrix": pose}]}, file)
            subprocess.run([PROGRAM, "render", self.viewer.model, "--cameras", cameras, "-o", folder,
                            "--supersample", "4", "-q"], check=True, stdout=subprocess.DEVNULL)
            with Channel(self.viewer) as channel:
                wish = view(number, size, (0.5, 0.2, -2), model=model, fov=200)
                channel.send_json(**wish, png=True)
                with open(os.path.join(folder, "shown.png"), "wb") as file:
                    file.write(self.last_picture(channel, number)[1])
                self.assertGreater(psnr(*(os.path.join(folder, f"{name}.png") for name in ("shown", "drawn"))), 35)
                # A pixel is pointed at through the same lens: the wall, 45 degrees to the left of a panorama's middle.
                if model == "equirectangular":
                    channel.send_json(**{**wish, "type": "pick", "px": [0.375, 0.5]})
                    x, y, z = channel.receive()[1]["point"]
                    self.assertAlmostEqual((x - 0.5) / (z + 2), -1, places=5)
                    self.assertAlmostEqual(y, 0.2, places=5)
                    self.assertAlmostEqual(z, 3, delta=0.5)

    def test_the_newest_wish_wins(self):
        with Channel(self.viewer) as channel:
            for number in range(100, 200):
                channel.send_json(**view(number, moving=True, eye=(0.01 * number, 0, -6)))
            numbers = []
            while not numbers or numbers[-1] != 199:
                kind, header, _ = channel.receive()
                self.assertEqual(kind, "picture")
                numbers.append(header["view"])
            self.assertEqual(numbers, sorted(numbers))
            self.assertLess(len(numbers), 100)
            # A still picture of full size makes room for a movement.
            channel.send_json(**view(300, (1900, 1400)))
            time.sleep(0.05)
            channel.send_json(**view(301, moving=True))
            numbers = []
            while not numbers or numbers[-1] != 301:
                numbers.append(channel.receive()[1]["view"])
            self.assertLessEqual(len(numbers), 2)

    def test_damaged_messages_are_answered_and_change_nothing(self):
        with Channel(self.viewer) as channel:
            for text in ("", "{", "[]", "null", '{"type":"view"}', '{"type":"delete"}',
                         json.dumps(view(1, fov=0)), json.dumps(view(1, (0, 0))),
                         json.dumps(view(1)).replace("50", "NaN"), "[" * 9000, "x" * 20000):
                channel.send(text)
                kind, answer = channel.receive()
                self.assertEqual((kind, answer["type"]), ("text", "error"), text[:40])
            channel.send(b"\x00" * 40, code=2)  # binary: nobody asked for it
            channel.send_json(**view(8, moving=True))
            self.assertEqual(channel.receive()[1]["view"], 8)
        with Channel(self.viewer) as channel:
            channel.send("x" * 100000)
            with self.assertRaises(ConnectionError):
                while channel.receive()[0] != "close":
                    pass
                raise ConnectionError("closed")
        self.assertEqual(self.viewer.ask("/", Cookie=self.viewer.cookie())[0], 200)

    def test_connections_beyond_the_limit_are_closed(self):
        time.sleep(0.3)  # the other tests' connections have gone
        request = f"GET / HTTP/1.1\r\nHost: {self.viewer.host}\r\nCookie: {self.viewer.cookie()}\r\n\r\n".encode()

        def answered(channel):
            try:
                channel.sendall(request)
                return channel.recv(12) == b"HTTP/1.1 200"
            except ConnectionError:
                return False

        with Channel(self.viewer) as page, contextlib.ExitStack() as stack:
            silent = [stack.enter_context(self.viewer.connect()) for _ in range(64)]
            self.assertTrue(answered(silent[-1]))
            with self.viewer.connect() as beyond:
                self.assertFalse(answered(beyond))
            # Pages that are open go on, and who goes makes room.
            page.send_json(**view(9, moving=True))
            self.assertEqual(page.receive()[1]["view"], 9)
            silent[0].close()
            for _ in range(100):
                with self.viewer.connect() as next_one:
                    if answered(next_one):
                        break
                time.sleep(0.02)
            else:
                self.fail("there is no room again")

    def test_pages_beyond_the_limit_wait_outside(self):
        time.sleep(0.3)  # the other tests' pages have gone
        channels = [Channel(self.viewer) for _ in range(8)]
        self.assertEqual([each.status for each in channels], [101] * 8)
        self.assertEqual(Channel(self.viewer).status, 503)
        # A page that reads nothing costs the others nothing.
        for number in range(50):
            channels[0].send_json(**view(number, (300, 200), moving=True))
        channels[1].send_json(**view(9))
        self.last_picture(channels[1], 9)
        for each in channels:
            each.socket.close()


class HostTest(unittest.TestCase):
    def test_it_listens_where_it_is_told_and_every_printed_address_opens_the_page(self):
        hosts = {None: "0100007F", "0.0.0.0": "0" * 8}
        if socket.has_dualstack_ipv6():
            hosts["::"] = "0" * 32
        for host, bound in hosts.items():
            with Viewer(PROGRAM, more=["--host", host] if host else []) as viewer:
                self.assertEqual(listening(viewer.address.port), [bound])
                if host is None:
                    self.assertEqual(len(viewer.urls), 1)
                for url in viewer.urls:
                    each = Address(url)
                    self.assertNotIn(each.address.hostname, hosts)
                    self.assertEqual(each.ask(f"/?token={each.token}")[0], 303, url)
                    with Channel(each) as channel:
                        self.assertEqual(channel.status, 101, url)
                    for stranger in ("http://192.0.2.1:80", f"http://{each.address.hostname}"):
                        self.assertEqual(Channel(each, Origin=stranger).status, 403, url)
                    # The address is ours, the name is anybody's.
                    self.assertEqual(each.ask("/", Cookie=each.cookie(), Host="evil.example:80")[0], 403)


    def test_an_address_of_another_machine_is_told(self):
        with tempfile.TemporaryDirectory(prefix="raysplats_host_") as folder:
            model = os.path.join(folder, "model.ply")
            write_model(model)
            told = subprocess.run([PROGRAM, "view", model, "--host", "192.0.2.1", "--port", "0"], timeout=120,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.assertEqual(told.returncode, 2)
            self.assertIn("192.0.2.1 is no address of this machine", told.stderr)
            self.assertNotIn("--port", told.stderr)


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


def picked(channel, number, px=(0.5, 0.5), **more):
    """The point of the world that a page is told of a place in its picture."""
    channel.send_json(**{**view(number, **more), "type": "pick", "px": list(px)})
    while True:
        kind, answer, *_ = channel.receive()
        if kind == "text" and answer["type"] == "pick":
            return answer["point"]


class ScenesTest(unittest.TestCase):
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
