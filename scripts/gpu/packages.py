# SPDX-License-Identifier: Apache-2.0
"""Fetches the vendors' compilers, and OpenCL implementations for CPUs, and unpacks them into a folder; nothing is installed.
Versions are pinned, so that figures and test results stay comparable. NVIDIA's compiler is under the CUDA EULA, Intel's CPU
runtime under Intel's EULA for developer tools: fetch them, do not pass them on.

    packages.py NAME CACHE      # fetches one and prints the folder that holds it; 77 and a sentence where it cannot be had
"""
import glob
import os
import platform
import shutil
import stat
import subprocess
import sys
import tempfile
import zipfile

LIBRARIES = f"usr/lib/{platform.machine()}-linux-gnu"
KEYS = "/usr/share/keyrings/debian-archive-keyring.gpg"


def _llvm(major, version):
    """Debian's packages of one clang, unpacked without what it takes to compile for this machine."""
    return [f"{name}={version}" for name in (f"clang-{major}", f"libclang-cpp{major}", f"libllvm{major}", f"libclang-common-{major}-dev")]


# Debian packages of each vendor's compiler (those of LLVM 14 only where the system has none) and of each implementation.
DEBIAN = {
    "amd": [*_llvm(22, "1:22.1.8-1~deb12u1"), "rocm-device-libs=5.2.3-2"],
    "nvidia": [*_llvm(19, "1:19.1.7-3~deb12u1"), "libclc-19=1:19.1.7-3~deb12u1"],
    "intel": [
        "intel-opencl-icd=22.43.24595.41-1",
        "libigc1=1.0.12504.6-1+deb12u1",
        "libigdfcl1=1.0.12504.6-1+deb12u1",
        "libigdgmm12=22.3.3+ds1-1",
        "libllvmspirvlib14=14.0.0-5",
        "libopencl-clang14=14.0.0-4",
    ],
    # Of a newer release, with that one's C library; its other libraries are those of Mesa's drivers for pictures, and of PoCL.
    "rusticl": [
        "libc6",
        "mesa-opencl-icd=25.0.7-2+deb13u1",
        *_llvm(19, "1:19.1.7-3+b1")[1:],
        "libclc-19=1:19.1.7-3",
        "libllvmspirvlib19.1=19.1.6-1",
        "libdrm2=2.4.124-2",
        "libdrm-amdgpu1=2.4.124-2",
        "libelf1t64=0.192-4",
    ],
}
UNLESS_PRESENT = {
    "libllvm14=1:14.0.6-12": "/" + LIBRARIES + "/libLLVM-14.so.1",
    "libclang-cpp14=1:14.0.6-12": "/" + LIBRARIES + "/libclang-cpp.so.14",
}
PYPI = {
    "nvidia": ["nvidia-cuda-nvcc-cu12==12.9.86"],
    # The second is not among the declared dependencies of the first, which does not load without it.
    "intel-cpu": ["intel-opencl-rt==2026.2.0", "intel-cmplr-lib-rt==2026.2.0", "tbb==2023.2.0"],
}
# Debian's release where it is not that of this system.
RELEASES = {"rusticl": "trixie"}
# A folder of their own: they are taken whole, not file by file.
APART = {"rusticl": "rusticl-25.0", "intel-cpu": "intel-cpu"}
CLANG = {"amd": "usr/lib/llvm-22/bin/clang", "nvidia": "usr/lib/llvm-19/bin/clang"}


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


def _done(cache, name):
    return os.path.join(cache, "done", name.replace("/", "_"))


def _once(cache, name, unpack):
    """Calls unpack(scratch folder) unless a former call went through."""
    done = _done(cache, name)
    if os.path.exists(done):
        return
    os.makedirs(os.path.dirname(done), exist_ok=True)
    scratch = tempfile.mkdtemp(dir=cache)
    try:
        unpack(scratch)
        open(done, "w", encoding="utf-8").close()
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def installed(vendor):
    """The root of a compiler that this system has, of Intel's alone."""
    if not os.path.exists("/usr/bin/ocloc"):
        raise Missing(f"{vendor}: there is no /usr/bin/ocloc (Debian: intel-ocloc and libigdfcl2)")
    return ""


def _of_release(release, cache):
    """What tells apt-get to take packages from a release that this system's sources do not name, by its own lists of them."""
    sites = subprocess.run(["apt-get", "indextargets", "--format", "$(SITE)"], capture_output=True, text=True, check=False).stdout.split()
    mirror = next((site for site in sites if site.rstrip("/").endswith("/debian")), None)
    if not mirror:
        raise Missing(f"Debian's release {release} cannot be fetched: the sources of apt-get name no mirror of Debian")
    folder = os.path.join(cache, release)
    os.makedirs(os.path.join(folder, "lists", "partial"), exist_ok=True)
    sources = os.path.join(folder, "sources.list")
    with open(sources, "w", encoding="utf-8") as file:
        file.write(f"deb [signed-by={KEYS}] {mirror} {release} main\n")
    settings = (f"Dir::Etc::SourceList={sources}", "Dir::Etc::SourceParts=/dev/null", f"Dir::State::Lists={folder}/lists", f"Dir::Cache={folder}")
    options = [word for setting in settings for word in ("-o", setting)]
    _run(["apt-get", "-q", *options, "update"], folder, f"Debian's release {release}")
    return options


def _debian(package, root, options):
    def unpack(scratch):
        _run(["apt-get", "-q", *options, "download", package], scratch, f"Debian package {package}")
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
        if os.path.exists(ptxas):
            os.chmod(ptxas, os.stat(ptxas).st_mode | stat.S_IXUSR)

    return unpack


def fetch(vendor, cache):
    """The folder that holds the vendor's compiler or the implementation, unpacked; raises Missing."""
    if vendor in APART:
        cache = os.path.join(cache, APART[vendor])
    root = os.path.join(cache, "root")
    os.makedirs(root, exist_ok=True)
    packages = list(DEBIAN.get(vendor, []))
    if vendor == "intel":
        packages += [package for package, path in UNLESS_PRESENT.items() if not os.path.exists(path)]
    options = []
    if vendor in RELEASES and not all(os.path.exists(_done(cache, package)) for package in packages):
        options = _of_release(RELEASES[vendor], cache)
    for package in packages:
        _once(cache, package, _debian(package, root, options))
    for package in PYPI.get(vendor, []):
        _once(cache, package, _wheel(package, root))
    disassembler = f"{root}/{LIBRARIES}/libiga64.so"
    if vendor == "intel" and not os.path.lexists(disassembler):
        os.symlink("libiga64.so.1", disassembler)  # the name by which ocloc opens it
    return root


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in {*DEBIAN, *PYPI}:
        sys.exit(f"usage: packages.py {'|'.join(sorted({*DEBIAN, *PYPI}))} CACHE")
    try:
        print(fetch(sys.argv[1], os.path.abspath(sys.argv[2])))
    except Missing as reason:
        print(reason, file=sys.stderr)
        sys.exit(77)


if __name__ == "__main__":
    main()
