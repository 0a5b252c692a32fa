# SPDX-License-Identifier: Apache-2.0
"""Counts, per kernel, what other work-items can be waited for by: native additions to floats in global memory, compare-and-swaps
there, and barriers. In the machine code itself; where code is repeated by unrolling, so are they."""
import os
import re
import struct

COUNTS = ["adds", "swaps", "barriers"]


def _count(text, patterns):
    return {name: len(re.findall(pattern, text)) for name, pattern in zip(COUNTS, patterns)}


def amd(assembly):
    """Of clang's assembly."""
    patterns = (r"\b(?:global|flat)_atomic_(?:pk_)?add_f\d+", r"\b(?:global|flat)_atomic_cmpswap", r"\bs_barrier(?:_wait)?\b")
    return {name: _count(body, patterns) for name, body in re.findall(r"^(\w+):[^\n]*\n(.*?)^\.Lfunc_end", assembly, re.M | re.S)}


def intel(folder):
    """Of the listings that ocloc's disassembler leaves in a folder, a file per kernel."""
    patterns = (r"atomic_fadd\.ugm|atomic float add", r"atomic_icas\.ugm|atomic int32 integer compare and swap|atomic_fcas\.ugm",
                r"\bsync\.bar\b")
    out = {}
    for name in os.listdir(folder):
        if name.startswith(".text.") and name.endswith(".asm"):
            with open(os.path.join(folder, name), encoding="utf-8", errors="replace") as file:
                out[name[len(".text."):-len(".asm")]] = _count(file.read(), patterns)
    return out


# The lowest nine bits of an instruction of sm_70 to sm_120, as ptxas writes them for programs of one such instruction each.
RED, ATOMG, ATOM, ATOMG_CAS, ATOM_CAS, REDG_FLOAT, ATOMG_FLOAT, BARRIER = 0x18e, 0x1a8, 0x18a, 0x1a9, 0x18b, 0x1a6, 0x1a3, 0x11d
FLOAT = 3  # type of an operand of RED, ATOMG and ATOM


def nvidia(sections):
    """Of the sections of a cubin, {name: bytes}."""
    out = {}
    for section, code in sections.items():
        if not section.startswith(".text."):
            continue
        counts = dict.fromkeys(COUNTS, 0)
        for low, high in struct.iter_unpack("<QQ", code):
            operation, operand = low & 0x1ff, high >> 9 & 7
            if operation in (REDG_FLOAT, ATOMG_FLOAT) or operation in (RED, ATOMG, ATOM) and operand == FLOAT:
                counts["adds"] += 1
            elif operation in (ATOMG_CAS, ATOM_CAS):
                counts["swaps"] += 1
            elif operation == BARRIER:
                counts["barriers"] += 1
        out[section[len(".text."):]] = counts
    return out
