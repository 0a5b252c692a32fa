# SPDX-License-Identifier: Apache-2.0
"""What else is made of the stored figures: the tables of kernels in docs/gpu_compilers.md (what each takes, and how many waves of it are
resident), and what the library's model of speed knows of its cards' kernels."""
import os

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
DOCUMENT = os.path.join(ROOT, "docs", "gpu_compilers.md")
SOURCE = os.path.join(ROOT, "host", "bench", "compiled_kernels.cpp")
INTEL = ("dg2-g10", "tgllp")

# Label; work-items of a group; whether rows of its own lie in local memory, which halves its budget of waves; program and
# kernel in the baseline; where Intel's is another program, that.
ROWS = [
    ("`trace_forward_group` (training)", 32, True, "group forward train: trace_forward_group"),
    ("`trace_backward_group` (atomic)", 32, True, "group backward atomic: trace_backward_group"),
    ("`trace_backward_group` (swap)", 32, True, "group backward swap: trace_backward_group"),
    ("`trace_forward_group` (subgroup of 32; Intel 16)", 32, True, "subgroup forward train: trace_forward_group",
     "subgroup forward train 16: trace_forward_group"),
    ("`trace_backward_group` (atomic, the same)", 32, True, "subgroup backward atomic: trace_backward_group",
     "subgroup backward atomic 16: trace_backward_group"),
    ("`sum_segments`", 32, False, "segments: sum_segments"),
    ("`trace_forward` (training)", 64, False, "forward train: trace_forward"),
    ("`trace_backward` (atomic)", 64, False, "backward atomic: trace_backward"),
    ("`trace_backward` (exact)", 64, False, "backward exact: trace_backward"),
    ("`prepare_view` (SH 3)", 64, False, "prepare sh3: prepare_view"),
    ("`finalize_group` (SH 3)", 64, False, "finalize group sh3: finalize_group"),
    ("`count_tiles`", 64, False, "lists: count_tiles"),
    ("`fill_tiles`", 64, False, "lists: fill_tiles"),
    ("`scatter` (radix sort)", 256, False, "sort pairs: scatter"),
    ("`trace_rays`", 64, True, "rays: trace_rays"),
    ("`trace_rays`, cones", 64, True, "cones: trace_rays"),
    ("`ray_backward` (SH 3, atomic)", 64, True, "ray backward atomic: ray_backward"),
    ("`ray_backward` (SH 3, exact)", 64, True, "ray backward exact: ray_backward"),
    ("`nearest_surface`", 64, False, "surface rays: nearest_surface"),
    ("`light_through`", 64, False, "surface rays: light_through"),
    ("`group_ssim_derivatives` (loss)", 256, False, "loss group: group_ssim_derivatives"),
    ("`group_gradient` (loss)", 256, False, "loss group: group_gradient"),
    ("`choose_steps` (Adam)", 64, False, "adam sh3: choose_steps"),
    ("`adam_step` (SH 3)", 64, False, "adam sh3: adam_step"),
    ("`advance` (light)", 64, False, "waves: advance"),
    ("`order_leaves_group` (tree)", 64, False, "tree order: order_leaves_group"),
]

# Of a SIMD of AMD's: registers of a work-item and how many are given out together, most waves, local bytes.
AMD = {"gfx906": (256, 4, 10, 16384), "gfx90a": (512, 8, 8, 16384), "gfx942": (512, 8, 8, 16384), "gfx1030": (1024, 16, 16, 32768), "gfx1100": (1536, 24, 16, 32768),
       "gfx1201": (1536, 24, 16, 32768)}
# Of a multiprocessor of NVIDIA's: most warps, most groups, local bytes, and of them those that each group takes beside its own.
NVIDIA = {"sm_70": (64, 32, 98304, 0), "sm_86": (48, 16, 102400, 1024), "sm_90": (64, 32, 233472, 1024),
          "sm_120": (48, 24, 102400, 1024)}
BUDGETS = {"gfx906": 4, "gfx90a": 4, "gfx942": 4, "gfx1030": 8, "gfx1100": 8, "gfx1201": 8, "sm_70": 16, "sm_86": 16, "sm_90": 16, "sm_120": 16}

# The model of speed: targets of its cards; kernels of its rows (speed_model.cpp) and work-items of a group.
MODEL_TARGETS = ["gfx1100", "dg2-g10", "sm_86", "sm_90"]
MODEL_KERNELS = [
    ("sort pairs: scatter", 256),
    ("prepare sh0: prepare_view", 64),
    ("lists: fill_tiles", 64),
    ("group forward render: trace_forward_group", 32),
    ("group forward train: trace_forward_group", 32),
    ("group backward atomic: trace_backward_group", 32),
    ("finalize group sh3: finalize_group", 64),
    ("loss group: group_ssim_derivatives", 256),
    ("loss group: group_gradient", 256),
    ("adam sh3: adam_step", 64),
    ("rays: trace_rays", 64),
]


def _cell(target, figures):
    first = f"w{figures['width']}" if target in INTEL else figures["registers"]
    marks = [f"s {figures['spills']}"] if figures["spills"] else []
    marks += [f"m {figures['moved']}"] if figures["moved"] else []
    marks += ["+"] if figures["adds"] else []
    return ", ".join([f"{first} / {figures['private']}", *marks])


def _up(value, granule):
    return -(-value // granule) * granule


def resident(target, figures, group):
    """Waves of a SIMD (AMD) or multiprocessor (NVIDIA), and what there is no more of: r(egisters), l(ocal memory) or, of
    waves and groups, m(ore)."""
    waves = -(-group // figures["width"])
    if target in AMD:
        registers, granule, most, local = AMD[target]
        limits = [(registers // _up(figures["registers"], granule), "r"), (most, "m")]
        if figures["local"]:
            # Groups are spread over the four SIMDs that share local memory.
            limits.append((4 * local // _up(figures["local"], 512) * waves / 4, "l"))
        return min(limits)
    most, groups, local, own = NVIDIA[target]
    limits = [(2048 // _up(figures["registers"], 8) // 4 * 4, "r"), (min(most, groups * waves), "m")]
    if figures["local"]:
        limits.append((local // (_up(figures["local"], 128) + own) * waves, "l"))
    return min(limits)


def _waves_cell(target, figures, group, half):
    if target in INTEL:
        met, text = figures["width"] >= 16 and not figures["spills"], f"w{figures['width']}"
    else:
        waves, limit = resident(target, figures, group)
        met, text = waves >= BUDGETS[target] / (2 if half else 1), f"{waves:g} {limit}"
    return text if met else f"**{text}**"


def _rows(baseline, targets, cell):
    for row in ROWS:
        label, group, half, kernel, *intel = row
        cells = []
        for target in targets:
            figures = baseline[target].get(intel[0] if intel and target in INTEL else kernel)
            cells.append("-" if figures is None else cell(target, figures, group, half))
        yield f"| {label} | " + " | ".join(cells) + " |"


def _tables(baseline, targets):
    """The lines of every table by their first one."""
    rule = "|---|" + "---|" * len(targets)
    for title, cell in (("kernel", lambda target, figures, *_: _cell(target, figures)), ("waves", _waves_cell)):
        head = f"| {title} | " + " | ".join(targets) + " |"
        yield head, [head, rule, *_rows(baseline, targets, cell)]


def _updated(lines, baseline, targets):
    for head, table in _tables(baseline, targets):
        begin = lines.index(head)
        end = next(i for i in range(begin, len(lines)) if not lines[i].startswith("|"))
        lines = [*lines[:begin], *table, *lines[end:]]
    return lines


def _source(baseline):
    rows = []
    for target in MODEL_TARGETS:
        for kernel, group in MODEL_KERNELS:
            figures = baseline[target][kernel]
            rows.append(f'{{"{target}", "{kernel}", {figures["registers"]}, {figures["local"]}, {group}, {figures["width"]}}}')
    joined = ",\n      ".join(rows)
    return f"""// SPDX-License-Identifier: Apache-2.0
// Written by scripts/gpu_compile.py --write-baseline, from scripts/gpu/baseline.json.
#include "bench/speed_model.hpp"

namespace raysplats {{

const std::vector<CompiledKernel>& compiled_kernels() {{
  static const std::vector<CompiledKernel> all{{
      {joined}}};
  return all;
}}

}}  // namespace raysplats
"""


def _read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def _written(baseline, targets):
    """What every file has to hold, by its path."""
    lines = _read(DOCUMENT).split("\n")
    return {DOCUMENT: "\n".join(_updated(lines, baseline, targets)), SOURCE: _source(baseline)}


def stale(baseline, targets):
    """The files that hold other figures, from the project's root."""
    return [os.path.relpath(path, ROOT) for path, text in _written(baseline, targets).items() if _read(path) != text]


def write(baseline, targets):
    for path, text in _written(baseline, targets).items():
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
