# SPDX-License-Identifier: Apache-2.0
"""`raysplats view` and `raysplats train --view` as children, and a WebSocket client of the standard library alone."""
import base64
import json
import os
import re
import signal
import socket
import struct
import subprocess
import tempfile
import urllib.parse

LAST, PNG = 1, 2  # flags of a picture


class Address:
    """What a viewer listens on."""

    def __init__(self, url):
        self.url = url
        self.address = urllib.parse.urlsplit(self.url)
        self.token = self.address.query.removeprefix("token=")
        self.host = self.address.netloc

    def connect(self):
        return socket.create_connection((self.address.hostname, self.address.port), timeout=60)

    def ask(self, path, method="GET", body=b"", **headers):
        """The raw answer to one request: status, headers by lower name, body."""
        lines = {"Host": self.host, "Connection": "close", **headers}
        text = f"{method} {path} HTTP/1.1\r\n"
        text += "".join(f"{k.replace('_', '-')}: {v}\r\n" for k, v in lines.items() if v is not None)
        with self.connect() as channel:
            channel.sendall(text.encode() + b"\r\n" + body)
            answer = b""
            try:
                while part := channel.recv(65536):
                    answer += part
            except ConnectionResetError:
                pass
        head, _, content = answer.partition(b"\r\n\r\n")
        status, *rest = head.decode("latin-1").split("\r\n")
        fields = {k.lower(): v for k, v in (line.split(": ", 1) for line in rest if ": " in line)}
        return int(status.split()[1]) if status else 0, fields, content

    def cookie(self):
        return f"raysplats-{self.address.port}={self.token}"


class Viewer(Address):
    """Runs `raysplats view` on a small model until the end of a with block, or `command` with
    `arguments`, and `more` in either case."""

    def __init__(self, program, arguments=(), command="view", port=0, more=()):
        self.folder = tempfile.TemporaryDirectory(prefix="raysplats_view_")
        model = os.path.join(self.folder.name, "model.ply")
        write_model(model)
        self.process = subprocess.Popen(
            [program, command, *(arguments or [model]), *more, "--port", str(port), "-q"],
            stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        self.urls = re.findall(r"http://\S+", line)
        if not self.urls:
            raise RuntimeError(f"no address in {line!r}")
        super().__init__(self.urls[0])
        self.model = arguments[0] if arguments else model

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        self.folder.cleanup()

    def stop(self):
        """Ends it as Ctrl-C does; its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        code = self.process.wait(timeout=30)
        self.process.stdout.close()
        return code


class Channel:
    """A WebSocket; `status` is 101 when the server has taken it."""

    def __init__(self, viewer, path="/ws", **headers):
        self.socket = viewer.connect()
        self.buffer = b""
        key = base64.b64encode(os.urandom(16)).decode()
        lines = {"Host": viewer.host, "Upgrade": "websocket", "Connection": "Upgrade",
                 "Sec-WebSocket-Key": key, "Sec-WebSocket-Version": "13",
                 "Cookie": viewer.cookie(), "Origin": f"http://{viewer.host}", **headers}
        text = f"GET {path} HTTP/1.1\r\n"
        text += "".join(f"{k}: {v}\r\n" for k, v in lines.items() if v is not None)
        self.socket.sendall(text.encode() + b"\r\n")
        while b"\r\n\r\n" not in self.buffer:
            part = self.socket.recv(4096)
            if not part:
                break
            self.buffer += part
        head, _, self.buffer = self.buffer.partition(b"\r\n\r\n")
        self.status = int(head.split()[1]) if head else 0
        if self.status != 101:
            self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, data, code=1):
        """A frame: text by default. Masked, as those of clients are."""
        data = data.encode() if isinstance(data, str) else data
        size = len(data)
        if size < 126:
            head = struct.pack("!BB", 0x80 | code, 0x80 | size)
        elif size < 65536:
            head = struct.pack("!BBH", 0x80 | code, 0x80 | 126, size)
        else:
            head = struct.pack("!BBQ", 0x80 | code, 0x80 | 127, size)
        self.socket.sendall(head + b"\0\0\0\0" + data)

    def send_json(self, **message):
        self.send(json.dumps(message))

    def _take(self, count):
        while len(self.buffer) < count:
            part = self.socket.recv(65536)
            if not part:
                raise ConnectionError("closed")
            self.buffer += part
        taken, self.buffer = self.buffer[:count], self.buffer[count:]
        return taken

    def receive(self):
        """The next message: ("text", object), ("picture", header, bytes) or ("close",)."""
        kind, parts = 0, b""
        while True:
            first, second = self._take(2)
            size = second & 127
            if size == 126:
                size, = struct.unpack("!H", self._take(2))
            elif size == 127:
                size, = struct.unpack("!Q", self._take(8))
            data = self._take(size)
            code = first & 15
            if code < 8:  # the first frame of a message says what it is, the last one that it ends
                kind, parts = code or kind, parts + data
                if not first & 0x80:
                    continue
                code, data, parts = kind, parts, b""
            if code == 1:
                return "text", json.loads(data)
            if code == 2:
                names = ("magic", "view", "width", "height", "samples", "flags", "iteration",
                         "milliseconds")
                return "picture", dict(zip(names, struct.unpack("<7If", data[:32]))), data[32:]
            if code == 8:
                return ("close",)
            if code == 9:  # a ping: whoever stays silent for a minute is shut out
                self.send(data, code=10)


def write_model(path, origin=None):
    """Three balls before a dark wall of many; `origin` is where its coordinates begin in those of a data set."""
    names = ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
             "rot_0", "rot_1", "rot_2", "rot_3")
    rows = []
    for i, color in enumerate(((2, -1, -1), (-1, 2, -1), (-1, -1, 2))):
        rows.append((i - 1, 0, 0, *color, 4, -1.2, -1.2, -1.2, 1, 0, 0, 0))
    for i in range(100):
        rows.append((i % 10 - 4.5, i // 10 - 4.5, 3, -1, -1, -0.5, 3, -0.6, -0.6, -2, 1, 0, 0, 0))
    with open(path, "wb") as file:
        file.write(b"ply\nformat binary_little_endian 1.0\n")
        if origin:
            file.write("comment raysplats origin {},{},{}\n".format(*origin).encode())
        file.write(f"element vertex {len(rows)}\n".encode())
        file.write("".join(f"property float {name}\n" for name in names).encode())
        file.write(b"end_header\n")
        for row in rows:
            file.write(struct.pack(f"<{len(row)}f", *row))


def psnr(first, second):
    """Of the colours of two pictures, in dB; infinite where they are the same."""
    told = subprocess.run(["oiiotool", first, "--ch", "R,G,B", second, "--ch", "R,G,B", "--diff"],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True).stdout
    found = re.search(r"Peak SNR = (\S+)", told)
    if told.endswith("PASS\n"):
        return float("inf")
    if not found:
        raise RuntimeError(f"no PSNR in {told!r}")
    return float(found.group(1))


def view(number, size=(64, 48), eye=(0, 0, -6), **more):
    """A view message that looks along z."""
    x, y, z = eye
    return {"type": "view", "id": number, "fov": 50, "size": list(size),
            "c2w": [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z], **more}


def picked(channel, number, px=(0.5, 0.5), **more):
    """The point of the world that a page is told of a place in its picture."""
    channel.send_json(**{**view(number, **more), "type": "pick", "px": list(px)})
    while True:
        kind, answer, *_ = channel.receive()
        if kind == "text" and answer["type"] == "pick":
            return answer["point"]
