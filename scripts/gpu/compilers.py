# SPDX-License-Identifier: Apache-2.0
"""Compiles one kernel program for one target. Each function takes the unpacked tools, the target, the flags, the source
file and a stem for output files, and gives {kernel: figures} or raises CompileError. Figures: registers of a work-item
(AMD: vector registers, Intel: of a thread), spills (AMD: registers, NVIDIA: bytes, Intel: as its compiler counts), private
and local bytes (of a work-item, of a group), width of a wave."""
import os
import re
import struct
import subprocess

import machine_code
from packages import CLANG, LIBRARIES

AMD_LIBRARIES = "/amdgcn/bitcode"
# Of the device libraries, which are older than clang's own.
AMD_CODE_OBJECT = "-mcode-object-version=5"


class CompileError(Exception):
    pass


def _run(command, env=None):
    done = subprocess.run(command, capture_output=True, text=True, env=env, check=False)
    if done.returncode:
        raise CompileError((done.stdout + done.stderr).strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout + done.stderr


def _clang(name, root, command):
    """Runs the unpacked clang of a vendor, whose libraries are not where the loader looks."""
    libraries = f"{root}/{LIBRARIES}"
    return _run([f"{root}/{CLANG[name]}", "-x", "cl", *command], dict(os.environ, LD_LIBRARY_PATH=libraries))


def _number(pattern, text):
    found = re.search(pattern, text)
    return int(found[1]) if found else 0


def prepare_amd(root, target):
    """Debian 12's device libraries end before RDNA 3; the one file that a processor needs holds its number alone."""
    library = f"{root}/{LIBRARIES}{AMD_LIBRARIES}/oclc_isa_version_{target[3:]}.bc"
    if os.path.exists(library) and not os.path.exists(f"{library}.cl"):
        return
    number = int(target[3:-2]) * 1000 + int(target[-2], 16) * 100 + int(target[-1], 16)
    source = f"{library}.cl"
    with open(source, "w", encoding="utf-8") as file:
        file.write(f'__attribute__((visibility("protected"))) const __constant int __oclc_ISA_version = {number};\n')
    _clang("amd", root, ["-cl-std=CL2.0", "--target=amdgcn-amd-amdhsa", AMD_CODE_OBJECT, "-nogpulib", "-emit-llvm", "-c", "-o", library, source])


def amd(root, target, flags, source, stem):
    assembly = stem + ".s"
    libraries = f"{root}/{LIBRARIES}{AMD_LIBRARIES}"
    # Clang 22 no longer links the switch for denormals.
    older = [AMD_CODE_OBJECT, "-Xclang", "-mlink-builtin-bitcode", "-Xclang", f"{libraries}/oclc_daz_opt_off.bc"]
    _clang("amd", root, [*flags, "--target=amdgcn-amd-amdhsa", f"-mcpu={target}", f"--rocm-device-lib-path={libraries}", *older,
                         "-O3", "-S", "-w", "-o", assembly, source])
    with open(assembly, encoding="utf-8") as file:
        text = file.read()
    # No linker runs: what is called by name and defined nowhere would be missing at load.
    called = set(re.findall(r"\b([A-Za-z_]\w*)@(?:gotpcrel32|rel32|abs32)@", text))
    missing = called - set(re.findall(r"^([A-Za-z_]\w*):", text, re.M))
    if missing:
        raise CompileError("Unresolved symbols: " + ", ".join(sorted(missing)))
    metadata = text[text.index(".amdgpu_metadata"):]
    counts = machine_code.amd(text)
    kernels = {}
    for block in re.split(r"\n  - (?=\.)", metadata)[1:]:
        figure = lambda key: _number(rf"\n    \.{key}:\s+(\d+)", block)
        name = re.search(r"\n    \.name:\s+(\w+)", block)[1]
        kernels[name] = dict(registers=figure("vgpr_count"), spills=figure("vgpr_spill_count"), moved=figure("sgpr_spill_count"),
                             private=figure("private_segment_fixed_size"), local=figure("group_segment_fixed_size"),
                             width=figure("wavefront_size"), **counts[name])
    return kernels


def _elf_sections(path):
    """{name: bytes} of a 64-bit little-endian ELF file; of sections of one name the last."""
    with open(path, "rb") as file:
        data = file.read()
    table, = struct.unpack_from("<Q", data, 40)
    size, count, strings = struct.unpack_from("<HHH", data, 58)
    sections = [struct.unpack_from("<IIQQQQ", data, table + i * size) for i in range(count)]
    text = lambda at: data[at:data.index(b"\0", at)].decode()
    return {text(sections[strings][4] + name): data[begin:begin + length] for name, _, _, _, begin, length in sections}


# What clang 19 does not know yet; ptxas takes the code of an older one, as the driver does.
NVIDIA_AS = {"sm_120": "sm_90"}


def nvidia(root, target, flags, source, stem):
    # libclc calls NVIDIA's own library of device functions.
    built_in = [f"{root}/usr/lib/clc/nvptx64--nvidiacl.bc", f"{root}/nvidia/cuda_nvcc/nvvm/libdevice/libdevice.10.bc"]
    clang = [word for library in built_in for word in ("-mlink-builtin-bitcode", library)] + ["-target-cpu", NVIDIA_AS.get(target, target), "-target-feature", "+ptx78"]
    # What its front end defines, and its default precision of division and square root in OpenCL C.
    driver = ["-D__NV_CL_C_VERSION=120", "-mllvm", "-nvptx-prec-divf32=1", "-mllvm", "-nvptx-prec-sqrtf32=0"]
    _clang("nvidia", root, [*flags, "--target=nvptx64--nvidiacl", *(word for option in clang for word in ("-Xclang", option)), *driver,
                            "-O3", "-S", "-w", "-o", stem + ".ptx", source])
    text = _run([f"{root}/nvidia/cuda_nvcc/bin/ptxas", "-v", f"-arch={target}", stem + ".ptx", "-o", stem + ".cubin"])
    counts = machine_code.nvidia(_elf_sections(stem + ".cubin"))
    kernels = {}
    for block in text.split("Compiling entry function '")[1:]:
        name = block.split("'")[0]
        stack = _number(r"(\d+) bytes stack frame", block)
        kernels[name] = dict(registers=_number(r"Used (\d+) registers", block), spills=_number(r"(\d+) bytes spill stores", block), moved=0,
                             private=max(stack, _number(r"(\d+) bytes cumulative stack", block)),
                             local=_number(r"(\d+) bytes smem", block), width=32, **counts[name])
    return kernels


def _undefined_symbols(sections):
    symbols, names = sections.get(".symtab", b""), sections.get(".strtab", b"")
    out = set()
    for name, _, _, section, _, _ in struct.iter_unpack("<IBBHQQ", symbols):
        if section == 0 and name:
            out.add(names[name:names.index(b"\0", name)].decode())
    # What the driver fills in at load.
    return {name for name in out if not name.startswith(("__INTEL", "_INTEL", "INTEL", "__SubDeviceID"))}


def intel(root, target, flags, source, stem):
    folder = stem + ".igc"
    os.makedirs(folder, exist_ok=True)
    binary = folder + "/out.bin"
    for old in os.listdir(folder):
        os.remove(os.path.join(folder, old))
    env = dict(os.environ, LD_LIBRARY_PATH=f"{root}/{LIBRARIES}")
    text = _run([f"{root}/usr/bin/ocloc", "compile", "-file", source, "-device", target, "-out_dir", folder, "-output", "out",
                 "-output_no_suffix", "-options", " ".join(flags), "-internal_options", "-cl-intel-allow-zebin"], env)
    binary = binary if os.path.exists(binary) else folder + "/out"
    _run([f"{root}/usr/bin/ocloc", "disasm", "-file", binary, "-device", target, "-dump", folder], env)
    counts = machine_code.intel(folder)
    sections = _elf_sections(binary)
    missing = _undefined_symbols(sections)
    if missing:
        raise CompileError("Unresolved symbols: " + ", ".join(sorted(missing)))
    if ".ze_info" not in sections:
        raise CompileError("The compiler wrote no section .ze_info")
    info = sections[".ze_info"].decode().rstrip("\0")
    spilled = dict(re.findall(r"kernel (\w+)\s+compiled SIMD\d+ allocated \d+ regs and spilled around (\d+)", text))
    kernels = {}
    for block in re.split(r"\n  - name:\s+", info.split("kernels_misc_info")[0])[1:]:
        name = block.split("\n")[0].strip()
        if name.startswith("Intel_Symbol"):
            continue
        width = _number(r"\bsimd_size:\s+(\d+)", block)
        buffers = re.findall(r"usage:\s+(\w+)\n\s+size:\s+(\d+)", block)
        private = sum(int(size) for usage, size in buffers if usage == "private_space")
        private = private or sum(int(size) // max(width, 1) for usage, size in buffers if usage == "single_space")
        if name not in counts:
            raise CompileError(f"The disassembler left no listing of {name}")
        kernels[name] = dict(registers=_number(r"\bgrf_count:\s+(\d+)", block), spills=int(spilled.get(name, 0)), moved=0, private=private,
                             local=_number(r"\bslm_size:\s+(\d+)", block), width=width, **counts[name])
    return kernels


def vendor(target):
    if target.startswith("gfx"):
        return "amd"
    return "nvidia" if target.startswith("sm_") else "intel"


COMPILE = dict(amd=amd, nvidia=nvidia, intel=intel)
