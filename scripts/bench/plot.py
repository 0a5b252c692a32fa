#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Plots of what growth.sh and ablation.sh measured.

usage: plot.py growth DIR      DIR/*.json of `raysplats bench --json` -> growth.csv, growth_*.png
       plot.py ablation DIR    the runs of ablation.sh in DIR -> ablation.csv, ablation.html
Needs matplotlib (Debian package python3-matplotlib).
"""

import base64
import csv
import html
import io
import json
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator  # noqa: E402

Series = dict[str, list[tuple[float, float]]]  # points by label

MIB = 1024.0 * 1024.0


@dataclass
class Sample:
    """One row of one result of `raysplats bench`."""

    row: str
    gaussians: int
    pixels: int
    ms: float
    process_mib: float
    device_mib: float


def read_samples(folder: Path) -> list[Sample]:
    samples = []
    for path in sorted(folder.glob("*.json")):
        result = json.loads(path.read_text())
        if result.get("schema") != "raysplats-bench":
            continue
        width, height = map(int, result["options"]["resolution"].split("x"))
        memory = (result["peak_process_bytes"] / MIB, result["peak_device_bytes"] / MIB)
        for row in result["rows"]:
            seconds = row.get("wall_seconds", row["seconds"]["median"])
            samples.append(Sample(row["name"], row["size"], width * height, 1e3 * seconds, *memory))
    return samples


def short(number: float) -> str:
    """1500000 as 1.5 M."""
    for unit, factor in (("M", 1e6), ("k", 1e3)):
        if number >= factor:
            return f"{number / factor:.4g} {unit}"
    return f"{number:g}"


def draw(axes: Axes, series: Series, x_label: str, y_label: str) -> None:
    """Lines with markers on logarithmic axes, ticks where something was measured."""
    markers = "osv^Dd<>ph"
    for i, (label, points) in enumerate(series.items()):
        xs, ys = zip(*sorted(set(points)))
        axes.plot(xs, ys, marker=markers[i % len(markers)], label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.minorticks_off()
    ticks = sorted({x for points in series.values() for x, _ in points})
    axes.set_xticks(ticks, [short(x) for x in ticks])
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, linewidth=0.3)
    axes.legend(fontsize=8)


def growth_figure(samples: list[Sample], by: str, title: str, path: Path) -> None:
    times: Series = {}
    memory: Series = {}
    for sample in samples:
        x = float(getattr(sample, by))
        times.setdefault(sample.row, []).append((x, sample.ms))
        memory.setdefault("process", []).append((x, sample.process_mib))
        memory.setdefault("device buffers", []).append((x, sample.device_mib))
    xs = [x for x, _ in memory["process"]]
    label = "Gaussians" if by == "gaussians" else "pixels of a square image"
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5))
    draw(left, times, label, "time [ms]")
    low, high = left.get_ylim()
    left.plot([min(xs), max(xs)], [low, low * max(xs) / min(xs)], "k--", linewidth=0.8, label="proportional")
    left.set_ylim(low, high)
    left.legend(fontsize=8)
    draw(right, memory, label, "peak memory [MiB]")
    figure.suptitle(title)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)
    print(path)


def growth(folder: Path) -> None:
    samples = read_samples(folder)
    if not samples:
        sys.exit(f"plot.py: {folder} holds no result of raysplats bench --json, run growth.sh first.")
    with (folder / "growth.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["row", "gaussians", "pixels", "ms", "process_mib", "device_mib"])
        for s in samples:
            writer.writerow([s.row, s.gaussians, s.pixels, f"{s.ms:.4g}", f"{s.process_mib:.1f}",
                             f"{s.device_mib:.1f}"])
    print(folder / "growth.csv")

    pairs = {(s.gaussians, s.pixels) for s in samples}
    pixels = Counter(pixels for _, pixels in pairs).most_common(1)[0][0]
    gaussians = Counter(count for count, _ in pairs).most_common(1)[0][0]
    at_pixels = [s for s in samples if s.pixels == pixels]
    growth_figure(at_pixels, "gaussians", f"Growth with Gaussians, {short(pixels)} pixels",
                  folder / "growth_gaussians.png")
    # Trees and single rays do not depend on the pixels.
    at_gaussians = [s for s in samples if s.gaussians == gaussians and s.row not in ("build", "refit", "rays")]
    if at_gaussians:
        growth_figure(at_gaussians, "pixels", f"Growth with pixels, {short(gaussians)} Gaussians",
                      folder / "growth_pixels.png")


def axis_values(rows: list[dict[str, str]]) -> tuple[list[float], list[str], bool]:
    """Positions and labels of an axis' values; words and zeros are spaced evenly."""
    labels = [r["value"] for r in rows]
    try:
        numbers = [float(v) for v in labels]
    except ValueError:
        return [float(i) for i in range(len(rows))], labels, False
    if min(numbers) <= 0.0:
        return [float(i) for i in range(len(rows))], labels, False
    return numbers, labels, max(numbers) > 5.0 * min(numbers)


def read_runs(folder: Path) -> list[dict[str, str]]:
    """One row per planned run of ablation.sh; runs without an evaluation count as failed."""
    rows = []
    with (folder / "plan.csv").open() as file:
        plan = list(csv.DictReader(file))
    for planned in plan:
        run = folder / planned["folder"]
        row = {"axis": planned["axis"], "value": planned["value"], "status": "failed"}
        if (run / "eval/metrics.json").exists():
            quality = json.loads((run / "eval/metrics.json").read_text())
            training = json.loads((run / "run/metrics.json").read_text())
            row |= {
                "status": "ok",
                "iterations": str(training["iterations"]),
                "psnr": f"{quality['psnr']:.4f}",
                "ssim": f"{quality['ssim']:.5f}",
                "gaussians": str(training["gaussians"]),
                "train_seconds": f"{training['training_seconds']:.2f}",
                "capped_rays": str(training["capped_rays"]),
            }
        rows.append(row)
    return rows


def axis_plot(axis: str, rows: list[dict[str, str]]) -> bytes:
    """The runs of one axis as an SVG file."""
    columns = (("psnr", "PSNR [dB]"), ("ssim", "SSIM"), ("gaussians", "Gaussians"),
               ("train_seconds", "training [s]"))
    xs, labels, logarithmic = axis_values(rows)
    figure, all_axes = plt.subplots(1, len(columns), figsize=(4 * len(columns), 3.6))
    for axes, (column, y_label) in zip(all_axes, columns):
        axes.plot(xs, [float(r[column]) for r in rows], "o-")
        if logarithmic:
            axes.set_xscale("log")
            axes.minorticks_off()
        # Between two of its dollars matplotlib would read a formula.
        axes.set_xticks(xs, [label.replace("$", r"\$") for label in labels], rotation=30)
        axes.set_xlabel(axis.replace("$", r"\$"))
        axes.set_ylabel(y_label)
        axes.grid(True, linewidth=0.3)
    figure.tight_layout()
    file = io.BytesIO()
    figure.savefig(file, format="svg")
    plt.close(figure)
    return file.getvalue()


def html_table(fields: list[str], rows: list[dict[str, str]]) -> str:
    lines = ["".join(f"<th>{html.escape(field)}</th>" for field in fields)]
    lines += ["".join(f"<td>{html.escape(row.get(field, ''))}</td>" for field in fields) for row in rows]
    return "<table>\n" + "".join(f"<tr>{line}</tr>\n" for line in lines) + "</table>\n"


def ablation_page(fields: list[str], runs: list[dict[str, str]]) -> str:
    """One file without script or anything from elsewhere: for every axis its runs and their plot."""
    body = ""
    for axis in dict.fromkeys(r["axis"] for r in runs):
        chosen = [r for r in runs if r["axis"] == axis]
        body += f"<h2>{html.escape(axis)}</h2>\n" + html_table(fields[1:], chosen)
        measured = [r for r in chosen if r["status"] == "ok"]
        if measured:
            picture = base64.b64encode(axis_plot(axis, measured)).decode()
            body += f'<img alt="{html.escape(axis)}" src="data:image/svg+xml;base64,{picture}"/>\n'
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"/><title>Ablation</title>
<meta http-equiv="Content-Security-Policy" content="default-src &#39;none&#39;; img-src data:; style-src &#39;unsafe-inline&#39;"/>
<style>:root{{color-scheme:light dark}}body{{max-width:1200px;margin:24px auto;padding:0 16px;font:15px/1.5 system-ui,sans-serif}}
table{{border-collapse:collapse;display:block;overflow-x:auto}}td,th{{padding:3px 14px 3px 0;text-align:left;border-bottom:1px solid #8886}}
img{{max-width:100%;background:#fff}}@media print{{:root{{color-scheme:light}}}}</style></head>
<body><h1>Ablation: one option at a time</h1>
{body}</body></html>
"""


def ablation(folder: Path) -> None:
    if not (folder / "plan.csv").exists():
        sys.exit(f"plot.py: {folder} holds no runs, run ablation.sh first.")
    runs = read_runs(folder)
    fields = ["axis", "value", "status", "iterations", "psnr", "ssim", "gaussians", "train_seconds", "capped_rays"]
    with (folder / "ablation.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fields, restval="")
        writer.writeheader()
        writer.writerows(runs)
    print(folder / "ablation.csv")
    (folder / "ablation.html").write_text(ablation_page(fields, runs))
    print(folder / "ablation.html")


def main() -> None:
    arguments = sys.argv[1:]
    commands = {"growth": growth, "ablation": ablation}
    if len(arguments) != 2 or arguments[0] not in commands:
        sys.exit(__doc__)
    commands[arguments[0]](Path(arguments[1]))


if __name__ == "__main__":
    main()
