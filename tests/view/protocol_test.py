#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What `raysplats view` says to its page, to strangers and to damaged messages.
usage: protocol_test.py PROGRAM"""
import contextlib
import json
import math
import os
import socket
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from program import LAST, PNG, Address, Channel, Viewer, psnr, view, write_model  # noqa: E402

PROGRAM = ""


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
        self.assertIn("SameSite=Lax", fields["set-cookie"])  # a link on another page opens it
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


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
