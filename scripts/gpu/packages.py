# SPDX-License-Identifier: Apache-2.0
"""Fetches the vendors' compilers and unpacks them into a folder; nothing is installed. Versions are pinned, so that the
stored figures stay comparable. NVIDIA's package is under the CUDA EULA: fetch it, do not pass it on."""
import glob
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import zipfile

LIBRARIES = "usr/lib/x86_64-linux-gnu"

# Debian packages of each vendor; those of LLVM 14 only where the system has none.
DEBIAN = {
    "amd": ["rocm-device-libs=5.2.3-2"],
    "nvidia": ["libclc-15=1:15.0.6-4"],
    "intel": [
        "intel-opencl-icd=22.43.24595.41-1",
        "libigc1=1.0.12504.6-1+deb12u1",
        "libigdfcl1=1.0.12504.6-1+deb12u1",
        "libigdgmm12=22.3.3+ds1-1",
        "libllvmspirvlib14=14.0.0-5",
        "libopencl-clang14=14.0.0-4",
    ],
}
UNLESS_PRESENT = {
    "libllvm14=1:14.0.6-12": "/" + LIBRARIES + "/libLLVM-14.so.1",
    "libclang-cpp14=1:14.0.6-12": "/" + LIBRARIES + "/libclang-cpp.so.14",
}
PYPI = {"nvidia": ["nvidia-cuda-nvcc-cu12==12.9.86"]}
CLANG = "clang-15"


class Missing(Exception):
    """A compiler cannot be had here; says why in one sentence."""


def _run(command, folder, what):
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    except FileNotFoundError:
        raise Missing(f"{what} cannot be fetched: there is no {command[0]}") from None
    except subprocess.TimeoutExpired:
        raise Missing(f"{what} cannot be fetched: no end after 300 seconds") from None
    if done.returncode:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith(("E:", "ERROR"))] or lines or ["no message"]
        raise Missing(f"{what} cannot be fetched: {errors[0].strip()}")


def _once(cache, name, unpack):
    """Calls unpack(scratch folder) unless a former call went through."""
    done = os.path.join(cache, "done", name.replace("/", "_"))
    if os.path.exists(done):
        return
    os.makedirs(os.path.dirname(done), exist_ok=True)
    scratch = tempfile.mkdtemp(dir=cache)
    try:
        unpack(scratch)
        open(done, "w", encoding="utf-8").close()
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _debian(package, root):
    def unpack(scratch):
        _run(["apt-get", "-q", "download", package], scratch, f"Debian package {package}")
        for file in glob.glob(os.path.join(scratch, "*.deb")):
            _run(["dpkg", "-x", file, root], scratch, f"Debian package {package}")

    return unpack


def _wheel(package, root):
    def unpack(scratch):
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--no-deps", "--only-binary=:all:"]
        _run([*pip, "-q", package], scratch, f"Python package {package}")
        for file in glob.glob(os.path.join(scratch, "*.whl")):
            zipfile.ZipFile(file).extractall(root)
        ptxas = os.path.join(root, "nvidia/cuda_nvcc/bin/ptxas")
        os.chmod(ptxas, os.stat(ptxas).st_mode | stat.S_IXUSR)

    return unpack


def fetch(vendor, cache):
    """The folder that holds the vendor's compiler, unpacked; raises Missing."""
    if vendor in ("amd", "nvidia") and shutil.which(CLANG) is None:
        raise Missing(f"{CLANG} is not installed: apt-get install {CLANG}")
    root = os.path.join(cache, "root")
    os.makedirs(root, exist_ok=True)
    packages = list(DEBIAN[vendor])
    if vendor == "intel":
        packages += [package for package, path in UNLESS_PRESENT.items() if not os.path.exists(path)]
    for package in packages:
        _once(cache, package, _debian(package, root))
    for package in PYPI.get(vendor, []):
        _once(cache, package, _wheel(package, root))
    return root
