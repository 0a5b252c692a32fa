#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compiles every kernel program as the host builds it on a GPU, with the compilers of AMD, NVIDIA and Intel. No GPU is
needed, nothing is installed: packages are fetched (150 to 185 MB in all, once) and unpacked into a folder.

Prints registers/spills/moved/private bytes/local bytes/width/adds/swaps/barriers per kernel and target (moved: scalar registers kept in
vector ones; adds: native additions to floats in global memory; swaps: compare-and-swaps there) and compares them with
scripts/gpu/baseline.json. Ends with 1 when a kernel does not compile or has unresolved symbols, spills where the baseline
does not, or takes more than the baseline allows: registers 10 % and 8, private and local memory 10 % and 64 bytes, spills
and moved registers 25 %, moved ones 8 on top, swaps and barriers 25 %; or where a width is narrower or native additions
are gone. What the baseline does not know is allowed no spills, and so is what --installed compiles; and the tables in docs/gpu_compilers.md and those of
the library's model of speed have to be the baseline's: --write-baseline writes them too. Ends with 3 when a compiler cannot be had."""
import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "gpu"))
sys.dont_write_bytecode = True
import compilers  # noqa: E402
import packages  # noqa: E402
import programs  # noqa: E402
import table  # noqa: E402

BASELINE = os.path.join(HERE, "gpu", "baseline.json")
TARGETS = ["gfx906", "gfx90a", "gfx942", "gfx1030", "gfx1100", "gfx1201", "sm_70", "sm_86", "sm_90", "sm_120", "dg2-g10", "tgllp"]
FIGURES = ["registers", "spills", "moved", "private", "local", "width", "adds", "swaps", "barriers"]


def arguments():
    cache = os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "raysplats-gpu-compilers")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--targets", default="", help=f"comma-separated (default: {','.join(TARGETS)}; with --installed those of Intel's)")
    parser.add_argument("--only", default="", metavar="TEXT", help="programs whose name contains TEXT")
    parser.add_argument("--list", action="store_true", help="list targets and programs, compile nothing")
    parser.add_argument("--installed", action="store_true",
                        help="Intel's compiler of this system (Debian: intel-ocloc and libigdfcl2) for its --targets, of which `ocloc compile --help` has more")
    parser.add_argument("--write-baseline", action="store_true", help="store the figures instead of comparing them")
    parser.add_argument("--skip-missing", action="store_true", help="leave out compilers that cannot be had")
    parser.add_argument("--quiet", action="store_true", help="no table")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time (default: %(default)s)")
    parser.add_argument("--cache", default=cache, help="folder of the unpacked compilers (default: %(default)s)")
    return parser.parse_args()


def faults(key, now, before):
    """Why the figures of one kernel are refused."""
    if before is None:
        return [f"{key} spills {now['spills']}, the baseline does not know it"] if now["spills"] else []
    out = []
    margins = dict(registers=(1.1, 8), private=(1.1, 64), local=(1.1, 64), spills=(1.25, 0), moved=(1.25, 8), swaps=(1.25, 0), barriers=(1.25, 0))
    for figure, (factor, more) in margins.items():
        if now[figure] > before.get(figure, now[figure]) * factor + more:
            out.append(f"{key}: {figure} {now[figure]}, the baseline has {before[figure]}")
    if now["width"] < before["width"]:
        out.append(f"{key}: width {now['width']}, the baseline has {before['width']}")
    if before.get("adds", 0) > 0 and now["adds"] == 0:
        out.append(f"{key}: no native additions, the baseline has {before['adds']}")
    return out


def print_table(results, targets):
    print("| program | kernel | " + " | ".join(targets) + " |")
    print("|---|---|" + "---|" * len(targets))
    for program, kernel in dict.fromkeys((program, kernel) for _, program, kernel in results):
        cells = []
        for target in targets:
            figures = results.get((target, program, kernel))
            cells.append("/".join(str(figures[name]) for name in FIGURES) if figures else "-")
        print(f"| {program} | {kernel} | " + " | ".join(cells) + " |")


def compile_all(targets, roots, chosen, jobs):
    """Figures by (target, program, kernel), and the messages of what does not compile."""
    results, failures = {}, []
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(max(1, jobs)) as pool:

        def compile_one(job):
            target, (name, path, definitions) = job
            vendor = compilers.vendor(target)
            stem = os.path.join(work, f"{name.replace(' ', '_')}.{target}")
            with open(stem + ".cl", "w", encoding="utf-8") as file:
                file.write(programs.resolve(path))
            try:
                kernels = compilers.COMPILE[vendor](roots[vendor], target, programs.flags(definitions, vendor), stem + ".cl", stem)
            except compilers.CompileError as error:
                return job, None, str(error)
            return job, kernels, "" if kernels else "no kernel in what the compiler wrote"

        for (target, (name, _, _)), kernels, error in pool.map(compile_one, [(t, p) for t in targets for p in chosen if programs.offered(p[2], compilers.vendor(t))]):
            if error:
                failures.append(f"{target} {name} does not compile: {error[:800]}")
            for kernel, figures in (kernels or {}).items():
                results[target, name, kernel] = figures
    return results, failures


def compare(results, stored, targets, chosen):
    out = []
    for (target, program, kernel), figures in results.items():
        out += faults(f"{target} {program}: {kernel}", figures, stored.get(target, {}).get(f"{program}: {kernel}"))
    # A kernel that is gone would otherwise leave its budget to the next of its name.
    for target in targets:
        for key in stored.get(target, {}):
            program, kernel = key.split(": ")
            if any(program == name for name, _, _ in chosen) and (target, program, kernel) not in results:
                out.append(f"{target} {key} is in the baseline and was not compiled: --write-baseline when it is gone")
    return out


def main():
    options = arguments()
    every = [target for target in TARGETS if not options.installed or compilers.vendor(target) == "intel"]
    targets = [target for target in options.targets.split(",") if target] or every
    chosen = [program for program in programs.PROGRAMS if options.only in program[0]]
    if options.list:
        print("Targets: " + " ".join(TARGETS))
        for name, path, definitions in chosen:
            print(f"{name}: {path} {' '.join(f'-D{key}={value}' for key, value in sorted(definitions.items()))}")
        return 0
    for target in targets:
        if options.installed and compilers.vendor(target) != "intel":
            sys.exit(f"--targets {target}: --installed is for Intel's alone")
        if target not in TARGETS and not options.installed:
            sys.exit(f"--targets {target}: choose from {', '.join(TARGETS)}")
    if options.installed and options.write_baseline:
        sys.exit("--write-baseline is for the pinned compilers, not for --installed")
    if not chosen:
        sys.exit(f"--only {options.only}: no program has that in its name (--list)")
    failures = [f"{path} is in no program of scripts/gpu/programs.py" for path in programs.unlisted()]

    roots, missing = {}, {}
    os.makedirs(options.cache, exist_ok=True)
    cache = os.path.abspath(options.cache)
    for vendor in dict.fromkeys(compilers.vendor(target) for target in targets):
        try:
            roots[vendor] = packages.installed(vendor) if options.installed else packages.fetch(vendor, cache)
        except packages.Missing as error:
            missing[vendor] = str(error)
            print(f"{'SKIPPED' if options.skip_missing else 'MISSING'} {vendor}: {error}")
    if missing and not options.skip_missing:
        return 3
    targets = [target for target in targets if compilers.vendor(target) in roots]
    for target in targets:
        if compilers.vendor(target) == "amd":
            try:
                compilers.prepare_amd(roots["amd"], target)
            except compilers.CompileError as error:
                sys.exit(f"clang makes no device library for {target}: {error}")

    start = time.monotonic()
    results, broken = compile_all(targets, roots, chosen, options.jobs)
    failures += broken
    if not options.quiet:
        print_table(results, targets)
    stored = {}
    if os.path.exists(BASELINE) and not options.installed:
        with open(BASELINE, encoding="utf-8") as file:
            stored = json.load(file)
    if options.write_baseline and not failures:
        names = {name for name, _, _ in chosen}
        for target in targets:
            kept = {key: value for key, value in stored.get(target, {}).items() if key.split(": ")[0] not in names}
            kept.update({f"{program}: {kernel}": figures for (t, program, kernel), figures in results.items() if t == target})
            stored[target] = dict(sorted(kept.items()))
        lines = [f"{json.dumps(target)}: {{\n" + ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in stored[target].items()) + "}"
                 for target in sorted(stored)]
        with open(BASELINE, "w", encoding="utf-8") as file:
            file.write("{\n" + ",\n".join(lines) + "\n}\n")
        table.write(stored, TARGETS)
        print(f"Wrote {BASELINE}, the tables in docs/gpu_compilers.md and host/bench/compiled_kernels.cpp")
    elif not options.write_baseline:
        failures += compare(results, stored, targets, chosen)
        if not options.installed:
            failures += [f"{path} does not hold the baseline's figures: --write-baseline writes both" for path in table.stale(stored, TARGETS)]
    for failure in failures:
        print("FAILED " + failure)
    if targets:
        print(f"{len(chosen)} programs for {', '.join(targets)}: {len(results)} kernels in {time.monotonic() - start:.0f} s, {len(failures)} faults")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
