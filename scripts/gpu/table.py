# SPDX-License-Identifier: Apache-2.0
"""The table of kernels in docs/gpu.md, from the stored figures."""
import os

DOCUMENT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "docs", "gpu.md")
INTEL = ("dg2-g10", "tgllp")

# Label; program and kernel in the baseline; where Intel's is another program, that.
ROWS = [
    ("`trace_forward_group` (training)", "group forward train: trace_forward_group"),
    ("`trace_backward_group` (atomic)", "group backward atomic: trace_backward_group"),
    ("`trace_backward_group` (swap)", "group backward swap: trace_backward_group"),
    ("`trace_forward_group` (subgroup of 32; Intel 16)", "subgroup forward train: trace_forward_group", "subgroup forward train 16: trace_forward_group"),
    ("`trace_backward_group` (atomic, the same)", "subgroup backward atomic: trace_backward_group", "subgroup backward atomic 16: trace_backward_group"),
    ("`trace_forward` (training)", "forward train: trace_forward"),
    ("`trace_backward` (atomic)", "backward atomic: trace_backward"),
    ("`trace_backward` (exact)", "backward exact: trace_backward"),
    ("`prepare_view` (SH 3)", "prepare sh3: prepare_view"),
    ("`finalize_group` (SH 3)", "finalize group sh3: finalize_group"),
    ("`count_tiles`", "lists: count_tiles"),
    ("`fill_tiles`", "lists: fill_tiles"),
    ("`scatter` (radix sort)", "sort pairs: scatter"),
    ("`trace_rays`", "rays: trace_rays"),
    ("`ray_backward` (SH 3, atomic)", "ray backward atomic: ray_backward"),
    ("`ray_backward` (SH 3, exact)", "ray backward exact: ray_backward"),
    ("`nearest_surface`", "surface rays: nearest_surface"),
    ("`light_through`", "surface rays: light_through"),
    ("`group_slopes` (loss)", "loss group: group_slopes"),
    ("`group_gradient` (loss)", "loss group: group_gradient"),
    ("`choose_steps` (Adam)", "adam sh3: choose_steps"),
    ("`adam_step` (SH 3)", "adam sh3: adam_step"),
    ("`advance` (light)", "waves: advance"),
    ("`order_group` (tree)", "tree order: order_group"),
]


def _cell(target, figures):
    if figures is None:
        return "-"
    first = f"w{figures['width']}" if target in INTEL else figures["registers"]
    marks = [f"s {figures['spills']}"] if figures["spills"] else []
    marks += [f"m {figures['moved']}"] if figures["moved"] else []
    marks += ["+"] if figures["adds"] else []
    return ", ".join([f"{first} / {figures['private']}", *marks])


def _lines(baseline, targets):
    yield "| kernel | " + " | ".join(targets) + " |"
    yield "|---|" + "---|" * len(targets)
    for label, kernel, *intel in ROWS:
        of = lambda target: intel[0] if intel and target in INTEL else kernel
        yield f"| {label} | " + " | ".join(_cell(target, baseline[target].get(of(target))) for target in targets) + " |"


def _split(targets):
    """The lines of the document before the table, its own, and those behind it."""
    with open(DOCUMENT, encoding="utf-8") as file:
        lines = file.read().split("\n")
    begin = lines.index("| kernel | " + " | ".join(targets) + " |")
    end = next(i for i in range(begin, len(lines)) if not lines[i].startswith("|"))
    return lines[:begin], lines[begin:end], lines[end:]


def is_current(baseline, targets):
    return _split(targets)[1] == list(_lines(baseline, targets))


def write(baseline, targets):
    before, _, behind = _split(targets)
    with open(DOCUMENT, "w", encoding="utf-8") as file:
        file.write("\n".join([*before, *_lines(baseline, targets), *behind]))
