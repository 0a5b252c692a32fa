# SPDX-License-Identifier: Apache-2.0
"""Writes scenes around a captured model: a mirror and a ball, the ball on its way around, glass, and a lamp
with a box and a table in front: the box throws its shadow on what was captured, the subject its own on the table.

usage: around.py RUN OUTPUT   (RUN: folder of a training run; its cameras say where the subject is and what is up)
"""

import json
import math
import pathlib
import sys


def add(a, b, scale=1.0):
    return [x + scale * y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(a):
    length = math.sqrt(dot(a, a))
    return [x / length for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def column(camera, k):
    return [row[k] for row in camera["rotation"]]


def solve(matrix, right):
    """x of a 3x3 system, by Cramer's rule."""
    def determinant(columns):
        return dot(columns[0], cross(columns[1], columns[2]))

    columns = [[row[k] for row in matrix] for k in range(3)]
    whole = determinant(columns)
    return [determinant([right if i == k else columns[i] for i in range(3)]) / whole for k in range(3)]


def subject(cameras):
    """The point nearest to all view axes in the least squares."""
    matrix, right = [[0.0] * 3 for _ in range(3)], [0.0] * 3
    for camera in cameras:
        d, c = unit(column(camera, 2)), camera["position"]
        for i in range(3):
            for j in range(3):
                weight = (1.0 if i == j else 0.0) - d[i] * d[j]
                matrix[i][j] += weight
                right[i] += weight * c[j]
    return solve(matrix, right)


def numbers(values):
    return "[" + ", ".join(f"{v:.5g}" for v in values) + "]"


def angles(columns):
    """Degrees about x, y, z, turned in this order, of the rotation with these columns."""
    x = math.atan2(columns[1][2], columns[2][2])
    y = math.asin(max(-1.0, min(1.0, -columns[0][2])))
    z = math.atan2(columns[0][1], columns[0][0])
    return [math.degrees(angle) for angle in (x, y, z)]


def mesh(file, material, scale, place, rotate=(0, 0, 0), turn=""):
    return (f'[[mesh]]\nfile = "{file}.obj"\nscale = {numbers(scale) if isinstance(scale, list) else f"{scale:.5g}"}\n'
            f'rotate = {numbers(rotate)}\ntranslate = {numbers(place)}\nmaterial = "{material}"\n{turn}\n')


def material(name, kind, rest):
    return f'[[material]]\nname = "{name}"\nkind = "{kind}"\n{rest}\n\n'


def main():
    run, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    cameras = json.loads((run / "cameras.json").read_text())
    target = subject(cameras)
    up = unit([-sum(column(c, 1)[k] for c in cameras) for k in range(3)])
    # The camera whose distance is the middle one shows the scene.
    eye = sorted(cameras, key=lambda c: math.dist(c["position"], target))[len(cameras) // 2]
    toward = [t - p for t, p in zip(target, eye["position"])]
    size = math.sqrt(dot(toward, toward))
    right = unit(cross(toward, up))
    forward = unit(cross(up, right))  # level
    fov = math.degrees(2 * math.atan(0.5 * eye["width"] / eye["fx"]))
    half = size * math.tan(math.radians(fov) / 2)
    view = (f'[camera]\nposition = {numbers(eye["position"])}\ntarget = {numbers(target)}\nup = {numbers(up)}\n'
            f'fov = {min(fov, 100):.4g}\n')
    model = '# Written by scripts/gallery.sh.\n[[model]]\nfile = "model"\n\n[environment]\ncolor = [0.55, 0.55, 0.55]\n\n'

    def place(side, ahead, above):
        return add(add(add(target, right, side * half), forward, ahead * half), up, above * half)

    def turned(side):
        """The rotation of a square that faces the camera, turned to a side."""
        across = unit(add(right, forward, side))
        return angles([across, up, cross(across, up)])

    facing = turned(0.0)
    level = angles([right, forward, up])
    around = f"turn = {{ axis = {numbers(up)}, degrees = 360, pivot = {numbers(target)} }}\n"
    silver = material("wall", "mirror", "color = [0.88, 0.92, 0.95]") + \
        material("chrome", "mirror", "color = [0.95, 0.93, 0.9]")

    def mirror(ball):
        return mesh("quad", "wall", [0.34 * half, 0.4 * half, 1.0], place(-0.62, 0.35, 0.3), turned(0.75)) + ball + silver

    scenes = {
        "mirror": mirror(mesh("ball", "chrome", 0.14 * half, place(-0.42, -0.4, -0.12))),
        "turn": mirror(mesh("ball", "chrome", 0.12 * half, place(-0.3, -0.42, 0.3), turn=around)),
        "glass": mesh("ball", "clear", 0.2 * half, place(-0.35, -0.35, 0.05)) +
        mesh("box", "green", 0.1 * half, place(0.45, -0.35, -0.05), facing) +
        material("clear", "glass", "ior = 1.5") +
        material("green", "glass", f"ior = 1.5\nabsorption = {numbers([6 / half, 1.2 / half, 4 / half])}"),
        "shadow": mesh("quad", "table", [0.5 * half, 0.3 * half, 1.0], place(0.1, -0.62, -0.28), level) +
        mesh("box", "red", 0.1 * half, place(-0.52, -0.12, 0.1), turned(0.4)) +
        material("red", "diffuse", "color = [0.85, 0.2, 0.15]") +
        material("table", "diffuse", "color = [0.55, 0.55, 0.53]") +
        f'[[light]]\nkind = "sphere"\nposition = {numbers(place(0.25, 0.9, 1.05))}\nradius = {0.08 * half:.4g}\n'
        f'color = [1.0, 0.98, 0.94]\nintensity = {7 * half * half:.4g}\n\n',
    }
    rest = {"turn": "[animation]\nframes = 24\n",
            "shadow": "light-samples = 8\n\n[render.shadows]\nstrength = 0.65\n"}
    for name, parts in scenes.items():
        width, height, samples = (320, 240, 2) if name == "turn" else (640, 480, 4)
        camera = f"{view}width = {width}\nheight = {height}\n\n[render]\nsamples = {samples}\n"
        text = model + parts + camera + ("\n" if name == "turn" else "") + rest.get(name, "")
        (output / f"captured_{name}.toml").write_text(text)


main()
