# SPDX-License-Identifier: Apache-2.0
"""Runs the measurements behind the tables and plots of docs/ and puts their results between the markers there."""

import argparse
import pathlib
import sys
import time

import fragments
import parts

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def arguments():
    parser = argparse.ArgumentParser(
        prog="scripts/figures.sh",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Measures the program as it stands and writes the tables and plots of docs/: what stands between\n"
        "<!-- figures: NAME --> and <!-- end of figures --> is replaced, and plots go to docs/images. Run it on an idle machine, in one go.\n"
        "Results stay in OUT/NAME; a part that fails is named, leaves its table as it is, and the others go on\n"
        "(exit status 1). The parts, with minutes on two idle cores:\n\n"
        + "\n".join(f"  {part.name:12} {part.minutes:4.1f}  {part.about}" for part in parts.PARTS)
        + f"\n  {'':12} {sum(part.minutes for part in parts.PARTS):4.1f}  in all",
    )
    parser.add_argument("data", type=pathlib.Path, nargs="?", help="folder with the captures (colmap/fox_undistorted, ...)")
    parser.add_argument("out", type=pathlib.Path, nargs="?", help="folder for results")
    parser.add_argument("--only", default="", help="comma-separated parts")
    parser.add_argument("--quick", action="store_true", help="tiny sizes, to try a part: docs stay as they are")
    parser.add_argument("--raysplats", type=pathlib.Path, default=ROOT / "build/release/bin/raysplats")
    parser.add_argument("--docs", type=pathlib.Path, default=ROOT / "docs")
    parser.add_argument("--check", action="store_true", help="only compare the markers in docs with the parts")
    args = parser.parse_args()
    if args.check:
        return args
    if args.data is None or args.out is None:
        parser.error("DATA and OUT are needed")
    if not args.data.is_dir():
        parser.error(f"DATA {args.data} is no folder")
    if not args.raysplats.exists():
        parser.error(f"{args.raysplats} does not exist: build it with scripts/setup.sh, or name one with --raysplats")
    names = [part.name for part in parts.PARTS]
    args.only = list(filter(None, args.only.split(",")))
    for name in args.only:
        if name not in names:
            parser.error(f"no part is called {name}; there are {', '.join(names)}")
    return args


def check(docs):
    """Markers without a part, and parts without a marker."""
    markers = fragments.markers(docs)
    wanted = {part.name for part in parts.PARTS}
    faults = [f"docs: no part makes the figures '{name}'" for name in sorted(set(markers) - wanted)]
    faults += [f"docs: no marker takes the figures '{name}'" for name in sorted(wanted - set(markers))]
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


def main():
    args = arguments()
    if args.check:
        return check(args.docs)
    failed = []
    for part in parts.PARTS:
        if args.only and part.name not in args.only:
            continue
        print(f"== {part.name}: about {part.minutes:g} minutes", file=sys.stderr, flush=True)
        start = time.monotonic()
        try:
            text = part.make(parts.Run(args, part.name))
        except parts.Failure as failure:
            print(f"== {part.name} failed: {failure}", file=sys.stderr, flush=True)
            failed.append(part.name)
            continue
        (args.out / part.name / "fragment.md").write_text(text)
        if args.quick:
            print(text)
        else:
            fragments.replace(args.docs, part.name, text)
        print(f"== {part.name} took {(time.monotonic() - start) / 60:.1f} minutes", file=sys.stderr, flush=True)
    if failed:
        print(f"== failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
