# SPDX-License-Identifier: Apache-2.0
"""Markdown between markers of the documents, and tables."""

import re

END = "<!-- end of figures -->"
BLOCK = re.compile(r"<!-- figures: ([a-z-]+) -->\n(.*?)" + re.escape(END), re.DOTALL)


def markers(docs):
    """Names of the figures that the documents take, each once."""
    names = []
    for path in sorted(docs.glob("*.md")):
        names += [match.group(1) for match in BLOCK.finditer(path.read_text())]
    for name in names:
        if names.count(name) > 1:
            raise SystemExit(f"docs: the figures '{name}' have more than one marker")
    return names


def replace(docs, name, text):
    """Puts the text between the markers of that name."""
    for path in sorted(docs.glob("*.md")):
        before = path.read_text()
        after = BLOCK.sub(
            lambda match: f"<!-- figures: {name} -->\n{text.rstrip()}\n{END}" if match.group(1) == name else match.group(0),
            before)
        if after != before:
            path.write_text(after)


def table(header, rows):
    """A Markdown table of texts."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines) + "\n"


def number(value, digits=3):
    """Three digits, no exponents."""
    if value == 0:
        return "0"
    magnitude = abs(value)
    decimals = 0
    while decimals < digits and magnitude < 10 ** (digits - 1 - decimals):
        decimals += 1
    return f"{value:.{decimals}f}"


def count(value):
    """10000 as "10 k"."""
    for unit, name in ((1_000_000, "M"), (1000, "k")):
        if value >= unit and value % unit == 0:
            return f"{value // unit} {name}"
    return str(value)
