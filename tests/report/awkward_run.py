# SPDX-License-Identifier: Apache-2.0
"""The folder of a training run in which every text is one that could break a page."""
import csv
import json
import os
import struct
import zlib

HOSTILE = """<script>alert("1")</script> & 'so' ]]> \u00e9 &amp;"""
WIDE = 200 * "x"  # has nowhere to break a line


def png(width, height):
    """A picture that fades from black to red and green, as a file."""
    rows = b"".join(
        b"\0" + b"".join(bytes((255 * x // width, 255 * y // height, 64)) for x in range(width))
        for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_run(folder, seed=0):
    views = [{"name": f"{HOSTILE} {i}{WIDE}", "psnr": 20 + (7 * i + seed) % 10, "ssim": 0.8, "sharpness": 0.01, "coarse_sharpness": 0.02,
              "psnr_shifted": 25, "shift": [1, "0"] if i == 4 else [0.5, i], "direction": [0, 0, 1],
              "center": [i, i % 3, 1], "picture": f"{i}.png"} for i in range(9)]
    views.append({"name": HOSTILE + WIDE, "psnr": 3, "ssim": 0.1, "sharpness": 1e-7, "center": [9, 9, 9]})
    metrics = {
        "complete": False, "iteration": 20, "iterations": 90, "gaussians": 100, "most_gaussians": 100,
        "device": HOSTILE, "driver": HOSTILE, "version": HOSTILE, "data": HOSTILE, "seed": seed,
        "traced_rays": 9, "capped_rays": 9, "bad_steps": 1, "psnr_rise": 0,
        "kernels": [{"name": HOSTILE, "calls": 3, "ms": 4, "share": 0.5}],
        "evaluations": [{"iteration": 10, "training_seconds": 1, "psnr": 25, "ssim": 0.9, "views": 10},
                        {"iteration": 20, "training_seconds": 2, "psnr": 23, "ssim": 0.8, "views": 10}]}
    identity = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    eval_folder = os.path.join(folder, "eval/iteration_20")
    os.makedirs(eval_folder)
    for path, content in (
            ("metrics.json", metrics), ("eval/iteration_20/metrics.json", {"images": views}),
            ("cameras.json", [{"img_name": HOSTILE, "position": [i, 1, 2], "rotation": identity,
                               "width": 8, "height": 6} for i in range(4)]),
            ("exposures.json", {f"{HOSTILE}{i}": [[1, 0, 0, 0], [0, 1 + 0.1 * i, 0, 0], [0, 0, 1, 0]]
                                for i in range(4)})):
        with open(os.path.join(folder, path), "w", encoding="utf-8") as stream:
            json.dump(content, stream, ensure_ascii=False)
    with open(os.path.join(folder, "config.toml"), "wb") as stream:
        # No UTF-8, and characters that XML does not have.
        stream.write(f"strategy = \"adc\"\nname = \"{HOSTILE}\"\nseed = {seed}\n".encode() + b"bytes = \"\xff\x00\x1b\xed\xa0\x80\"\n")
    with open(os.path.join(folder, "metrics.csv"), "w", encoding="utf-8") as stream:
        stream.write("iteration,seconds,loss,psnr,gaussians,it_per_s\n10,1,0.5,12,50,7\n20,2,0.4,13,100,7\n")
    for view in views[:-1]:
        with open(os.path.join(eval_folder, view["picture"]), "wb") as stream:
            stream.write(png(90, 20))


def write_ablation(folder):
    """What ablation.sh leaves for plot.py: an axis with two runs and one that failed."""
    axis = f"{HOSTILE} $x^$"
    with open(os.path.join(folder, "plan.csv"), "w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, ["axis", "value", "folder"])
        writer.writeheader()
        for i in range(3):
            writer.writerow({"axis": axis, "value": f"{HOSTILE} $ {i} $", "folder": f"runs/{i}"})
    for i in range(2):
        for path, content in (("eval", {"psnr": 20 + i, "ssim": 0.5}),
                              ("run", {"iterations": 9, "gaussians": 7, "training_seconds": 1 + i, "capped_rays": 0})):
            os.makedirs(os.path.join(folder, f"runs/{i}", path))
            with open(os.path.join(folder, f"runs/{i}", path, "metrics.json"), "w", encoding="utf-8") as stream:
                json.dump(content, stream)
