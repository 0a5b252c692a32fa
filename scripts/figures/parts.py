# SPDX-License-Identifier: Apache-2.0
"""The measurements of scripts/figures.sh, one function each; they return what stands between the markers."""

import csv
import json
import pathlib
import re
import shutil
import statistics
import subprocess
import time
from collections import namedtuple

from fragments import count, number, table

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
Part = namedtuple("Part", "name minutes about make")


class Failure(Exception):
    """What a part lacks or which command failed, in one sentence."""


class Run:
    """What a part measures with, and where it leaves its results."""

    def __init__(self, args, name):
        self.data, self.raysplats, self.quick, self.docs = args.data, args.raysplats, args.quick, args.docs
        self.folder = args.out / name
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)

    def size(self, full, quick):
        return quick if self.quick else full

    def capture(self, path):
        folder = self.data / path
        if not folder.is_dir():
            raise Failure(f"{folder} is not there")
        return folder

    def call(self, *command):
        """Standard output of a command."""
        words = [str(word) for word in command]
        done = subprocess.run(words, capture_output=True, text=True)
        with (self.folder / "log.txt").open("a") as log:
            log.write(f"$ {' '.join(words)}\n{done.stdout}{done.stderr}")
        if done.returncode != 0:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise Failure(f"{' '.join(words)} ended with {done.returncode}: {last}")
        return done.stdout

    def bench(self, name, *options):
        """Rows of raysplats bench by (name, size), and where they were measured."""
        result = self.folder / f"{name}.json"
        self.call(self.raysplats, "-q", "bench", "--json", result, *options)
        found = json.loads(result.read_text())
        return {(row["name"], row["size"]): row for row in found["rows"]}, found


def shown(*options):
    """A command as a user types it."""
    return " ".join(f"'{word}'" if re.search(r"[|^*]", str(word)) else str(word) for word in options)


def milliseconds(row):
    """Of one run, waits included where the row counts them."""
    return 1e3 * row.get("wall_seconds", row["seconds"]["median"])


def where(found):
    limits = found["ceilings"]
    text = f"{found['device']} ({found['compute_units']} units), {found['platform']} {found['driver']}"
    return (f"{text}; measured limits: copy {limits['copy_bytes_per_second'] / 1e9:.0f} GB/s, "
            f"FMA {limits['fma_flops_per_second'] / 1e9:.0f} GFLOP/s.\n\n")


def rate(row):
    unit = row["items"][-1]
    per_second = unit["per_second"]
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1, "")):
        if per_second >= factor:
            break
    return f"{number(per_second / factor)} {prefix}{unit['unit']}/s"


def kernels(run):
    sizes = run.size("100k,1M", "1k,2k")
    rows_wanted = ("sort|bounds|order|nodes|build|refit|prepare-view|tile-lists|forward|backward|finalize|loss-value|"
                   "loss-gradient|adam|densify|iteration|rays")
    options = ["--sizes", sizes, "--repeat", run.size(3, 1), "--filter", f"^({rows_wanted})/"]
    rows, found = run.bench("kernels", *options, *run.size([], ["--resolution", "64x64", "--rays", "1024"]))
    counts = sorted({size for _, size in rows})
    header = ["row"]
    for size in counts:
        header += [f"{count(size)}, ms", "rate", "copy", "FMA"]
    lines = []
    for name in dict.fromkeys(name for name, _ in rows):
        line = [f"`{name}`"]
        for size in counts:
            row = rows.get((name, size))
            line += ["-"] * 4 if row is None else [
                number(1e3 * row["seconds"]["median"]), rate(row),
                f"{100 * row['copy_share']:.0f} %", f"{100 * row['fma_share']:.1f} %"]
        lines.append(line)
    return f"`raysplats bench {shown(*options)}` on {where(found)}" + table(header, lines)


def traversal(run):
    options = ["--sizes", run.size("10k,100k,1M", "1k,2k"), "--repeat", run.size(2, 1), "--filter",
               "^(view|view-bvh|iteration|iteration-bvh)/"]
    rows, found = run.bench("traversal", *options, *run.size([], ["--resolution", "64x64"]))
    lines = []
    for size in sorted({size for _, size in rows}):
        ms = {name: milliseconds(rows[name, size]) for name in ("view", "view-bvh", "iteration", "iteration-bvh")}
        lines.append([count(size), number(ms["view"]), number(ms["view-bvh"]), f"{ms['view-bvh'] / ms['view']:.1f}",
                      number(ms["iteration"]), number(ms["iteration-bvh"]),
                      f"{ms['iteration-bvh'] / ms['iteration']:.1f}"])
    header = ["Gaussians", "picture by tiles, ms", "by the tree, ms", "ratio", "iteration by tiles, ms", "by the tree, ms",
              "ratio"]
    return f"`raysplats bench {shown(*options)}` on {where(found)}" + table(header, lines)


def light(run):
    options = ["--sizes", run.size("100k", "1k"), "--resolution", run.size("400x400", "64x64"), "--repeat",
               run.size(2, 1), "--filter", "^(view|light|surfaces)"]
    rows, found = run.bench("light", *options, *run.size([], ["--triangles", "1000"]))
    about = {
        "view": "packets, no mesh", "view-bvh": "ray by ray, no mesh", "light": "paths, no mesh",
        "light-samples": "the same, 4 samples a pixel",
        "light-mesh-small": "diffuse body, a tenth of the triangles", "light-mesh-large": "diffuse body",
        "light-mirror": "and mirrored rays", "light-glass": "and reflected and refracted rays",
        "light-shadows": "diffuse body and a light: shadow rays too",
        "surfaces-small": "triangles alone, a tenth of them", "surfaces-large": "triangles alone",
        "surfaces-random": "triangles alone, incoherent rays",
    }
    view = next(milliseconds(row) for (name, _), row in rows.items() if name == "view")
    lines = []
    for (name, _), row in rows.items():
        ratio = "" if name.startswith("surfaces") else f"{milliseconds(row) / view:.2f}"
        lines.append([f"`{name}`: {about[name]}", number(milliseconds(row)), rate(row), ratio])
    return (f"`raysplats bench {shown(*options)}` on {where(found)}"
            + table(["row", "ms", "rate", "to `view`"], lines))


def widths(run):
    lines, found, base = [], None, None
    options = ["--sizes", run.size("100k", "1k"), "--repeat", run.size(3, 1), "--filter", "^(forward|backward)/"]
    small = run.size([], ["--resolution", "64x64"])
    for width in (16, 8, 4, 1):
        rows, found = run.bench(f"width{width}", *options, "--packet-shape", "vector", "--packet-width", width, *small)
        ms = {name: 1e3 * row["seconds"]["median"] for (name, _), row in rows.items()}
        base = base or ms
        lines.append([width, number(ms["forward"]), f"{ms['forward'] / base['forward']:.2f}", number(ms["backward"]),
                      f"{ms['backward'] / base['backward']:.2f}"])
    return (f"`raysplats bench {shown(*options)} --packet-shape vector --packet-width V` on {where(found)}"
            + table(["rays a packet", "forward, ms", "ratio to 16", "backward, ms", "ratio to 16"], lines))


def iteration(run):
    options = ["-n", run.size(100, 3), "--resolution-schedule", "[]", "--densify-until", 0, "--checkpoint-every", 0,
               "--eval-renders", 0, "--profile", *run.size([], ["--downscale", 8])]
    fox = run.capture("colmap/fox_undistorted")
    text = run.call(run.raysplats, "-q", "train", fox, "-o", run.folder / "run", *options)
    kernels_found = []
    for line in text.splitlines():
        words = line.split()
        if len(words) == 5 and words[-1].endswith("%"):
            kernels_found.append(words)
    if not kernels_found:
        raise Failure("the profile of the training has no kernels")
    metrics = json.loads((run.folder / "run/metrics.json").read_text())
    steps = metrics["iterations"]
    lines = [[f"`{name}`", calls, number(float(ms) / steps), share] for name, calls, ms, _, share in kernels_found[:16]]
    return (f"`raysplats train DATA/colmap/fox_undistorted -o RUN {shown(*options)}`: {metrics['gaussians']} Gaussians, "
            f"{1e3 * metrics['training_seconds'] / steps:.0f} ms an iteration, the sixteen largest of its kernels.\n\n"
            + table(["kernel", "launches", "ms an iteration", "share"], lines))


def captures(run):
    only = run.size([], ["--only", "fox_undistorted", "--", "-n", 20])
    options = ["--screen", *only]
    run.call(ROOT / "scripts/quality.sh", run.data, "-o", run.folder, "--raysplats", run.raysplats, *options)
    result = json.loads((run.folder / "result.json").read_text())["scenes"]
    lines = [[name, f"{row['psnr']:.2f}", f"{row['ssim']:.4f}", f"{row['gap']:.2f}", f"{row['gaussians']:.0f}",
              f"{row['hits']:.0f}"] for name, row in result.items()]
    return (f"`scripts/quality.sh DATA -o OUT {shown(*options)}`: default settings, sizes and lengths as "
            "`scripts/quality/scenes.toml` says under `screen`.\n\n"
            + table(["capture", "held-out PSNR, dB", "SSIM", "training views above it, dB", "Gaussians",
                     "hits a step"], lines))


def peers(run):
    fox = run.capture("colmap/fox_undistorted")
    options = ["--rounds", run.size(3, 1), "--repeat", 1, *run.size([], ["--quick"])]
    run.call(ROOT / "scripts/bench/peers.sh", "--out", run.folder / "results", "--fox", fox, *options)
    with (run.folder / "results/ratios.csv").open() as file:
        rows = list(csv.DictReader(file))
    if not any("Embree" in row["comparison"] for row in rows):
        raise Failure("peers.sh measured no peer: install the Debian package libembree-dev")
    lines = [[row["comparison"], number(float(row["ours_ms"])), number(float(row["peer_ms"])),
              f"**{float(row['ratio']):.2f}** ({float(row['ratio_min']):.2f} to {float(row['ratio_max']):.2f})",
              row["target"] + ("" if row["met"] == "yes" else ": missed")] for row in rows]
    return (f"`scripts/bench/peers.sh {shown(*options)} --fox DATA/colmap/fox_undistorted`.\n\n"
            + table(["comparison", "ours, ms", "peer, ms", "ratio (range)", "aim"], lines))


def growth(run):
    options = run.size(["--repeat", "1", "--rows", "build|refit|view|backward|iteration"],
                       ["--repeat", "1", "--rows", "build|view", "--sizes", "1k,2k", "--sides", "32,64",
                        "--pixels-at", "1k"])
    run.call(ROOT / "scripts/bench/growth.sh", "--out", run.folder, "--raysplats", run.raysplats, *options)
    text = f"`scripts/bench/growth.sh {shown(*options)}`.\n"
    for plot, about in (("growth_gaussians", "Time and memory from 10 k to 3 M Gaussians"),
                        ("growth_pixels", "Time and memory from 200x200 to 1600x1600 pixels")):
        if not run.quick:
            shutil.copy(run.folder / f"{plot}.png", run.docs / "images" / f"{plot}.png")
        text += f"\n![{about}](images/{plot}.png)\n"
    return text


def limits(run):
    fox = run.capture("colmap/fox_undistorted")
    train = ["--downscale", run.size("2", "8"), "--max-gaussians", "30000", "--resolution-schedule", "[]"]
    axes = run.size("max-hits,min-transmittance,quantile", "max-hits")
    options = ["--iterations", run.size("250", "5"), "--axes", axes]
    values = ["--values", "max-hits=8,16,32,64,512", "--values", "min-transmittance=0.1,0.03,0.01,0.001,0.0001",
              "--values", "quantile=2.366,4.108,6.2514,11.3449,16.266"]
    run.call(ROOT / "scripts/ablation.sh", fox, run.folder / "results", "--raysplats", run.raysplats, *options, *values,
             "--", *train)
    with (run.folder / "results/ablation.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["status"] == "ok"]
    lines = [[f"`{row['axis']}`", row["value"], f"{float(row['psnr']):.2f}", f"{float(row['ssim']):.4f}",
              number(float(row["train_seconds"]))] for row in rows]
    return (f"`scripts/ablation.sh DATA/colmap/fox_undistorted OUT {shown(*options, *values)} -- {shown(*train)}`.\n\n"
            + table(["option", "value", "held-out PSNR, dB", "SSIM", "seconds of training"], lines))


def lenses(run):
    options = ["-n", run.size(300, 5), "--downscale", run.size(2, 8), "--max-gaussians", 30000, "--eval-renders", 0]
    seconds = {"room_7scenes": [], "room_7scenes_fisheye": []}
    last = {}
    for turn in range(run.size(3, 1)):
        for name, found in seconds.items():
            folder = run.folder / f"{name}_{turn}"
            run.call(run.raysplats, "-q", "train", run.capture(f"colmap/{name}"), "-o", folder, *options)
            last[name] = json.loads((folder / "metrics.json").read_text())
            found.append(last[name]["training_seconds"] / last[name]["iterations"])
    median = {name: statistics.median(found) for name, found in seconds.items()}
    lines = [[f"`{name}`", last[name]["gaussians"], number(1e3 * median[name]),
              f"{median[name] / median['room_7scenes']:.2f}"] for name in seconds]
    return (f"`raysplats train DATA/colmap/NAME -o RUN {shown(*options)}`, in turn, medians of "
            f"{len(seconds['room_7scenes'])}.\n\n"
            + table(["capture", "Gaussians", "ms an iteration", "to the pinhole"], lines))


def start(run):
    photos, trained = run.folder / "data", run.folder / "run"
    run.call(run.raysplats, "-q", "generate", photos)
    run.call(run.raysplats, "-q", "train", photos, "-o", trained, "-n", run.size(300, 20))
    model = next(trained.glob("point_cloud/*/point_cloud.ply"))
    commands = {"`raysplats --version`": ["--version"], "`raysplats info MODEL.ply`": ["info", model],
                "`raysplats info DATASET`, 100 photos of 400x400": ["info", run.capture("nerf_synthetic/lego")]}
    lines = []
    for name, words in commands.items():
        times = []
        for _ in range(run.size(15, 2)):
            begin = time.perf_counter()
            run.call(run.raysplats, *words)
            times.append(1e3 * (time.perf_counter() - begin))
        lines.append([name, number(statistics.median(times)), number(min(times))])
    return "Processes started one after the other, with warm files.\n\n" + table(["command", "ms, median", "least"], lines)


def printed(command, text):
    """What a command printed, as it stands."""
    return f"`{command.rstrip()}`:\n\n```text\n{text.rstrip()}\n```\n"


def plain(run, script, *options):
    """A script of scripts/reliability whose output is a table."""
    text = run.call(ROOT / "scripts/reliability" / script, "--raysplats", run.raysplats, *options)
    return printed(f"scripts/reliability/{script} {shown(*options)}", text)


def spread(run):
    return plain(run, "spread.sh", run.size(10, 2), *run.size([], ["--iterations", 60]))


def kills(run):
    return plain(run, "kill_loop.sh", run.size(20, 2))


def price(run):
    return plain(run, "price.sh", "--iterations", run.size(60, 3), "--repeat", run.size(3, 1))


def forecast(run):
    options = ["--sizes", run.size("10k,100k,1M", "1k"), "--repeat", 3, *run.size([], ["--resolution", "64x64", "--rays", 1024])]
    text = run.call(run.raysplats, "-q", "bench", "--forecast", *options)
    return printed(f"raysplats bench --forecast {shown(*options)}", text)


def needles(run):
    tests = run.raysplats.parent / "test_trace"
    if not tests.exists():
        raise Failure(f"{tests} is not there: build the tests")
    case = "needles and sheets*"
    text = run.call(tests, f"--test-case={case}")
    found = re.search(r"needles and sheets: (\d+) of (\d+) pixels excused, mean (\S+), maximum (\S+)", text)
    if not found:
        raise Failure(f"{tests} tells no figures of needles")
    excused, pixels = int(found[1]), int(found[2])
    return (f"`build/release/bin/test_trace --test-case='{case}'`:\n\n"
            + table(["pixels", "excused", "share (bound)", "mean error of all (bound)", "largest of the others (bound)"],
                    [[pixels, excused, f"{100 * excused / pixels:.1f} % (5 %)", f"{float(found[3]):.1e} (1e-5)",
                      f"{float(found[4]):.1e} (1e-3)"]]))


PARTS = [
    Part("kernels", 2.0, "every stage against the machine's limits (bench)", kernels),
    Part("iteration", 0.5, "kernels of a training iteration on the fox (train --profile)", iteration),
    Part("captures", 3.0, "quality of every capture at reduced size (quality.sh --screen)", captures),
    Part("peers", 5.0, "against Embree and published figures (peers.sh)", peers),
    Part("traversal", 1.5, "camera rays by tiles and by the tree (bench)", traversal),
    Part("widths", 0.5, "packets of 16, 8, 4 and 1 rays (bench)", widths),
    Part("light", 1.0, "paths, meshes, mirrors, glass and shadows (bench)", light),
    Part("lenses", 2.0, "training through a fisheye beside a pinhole", lenses),
    Part("start", 0.5, "start of the program", start),
    Part("growth", 4.0, "time and memory by Gaussians and pixels (growth.sh)", growth),
    Part("limits", 3.0, "what limits on hits cost in quality (ablation.sh)", limits),
    Part("needles", 0.5, "pixels of needles that rounding may decide otherwise (a case of test_trace)", needles),
    Part("spread", 1.0, "spread of runs with and without exact sums (spread.sh)", spread),
    Part("kills", 1.5, "runs killed at random moments (kill_loop.sh)", kills),
    Part("price", 1.0, "gradients added in each way (price.sh)", price),
    Part("forecast", 4.0, "a model of speed, on this device and on graphics cards (bench --forecast)", forecast),
]
