# SPDX-License-Identifier: Apache-2.0
"""What the wheel needs of the system."""

import pathlib
import re
import shutil
import subprocess

import pytest

import raysplats as rs

# The OpenCL loader, and what every C++ program has.
ALLOWED = {"libOpenCL", "libstdc++", "libgcc_s", "libm", "libc", "ld-linux-x86-64", "ld-linux-aarch64"}


@pytest.mark.skipif(shutil.which("readelf") is None, reason="no readelf: apt-get install binutils")
def test_the_module_links_the_loader_alone():
    (module,) = pathlib.Path(rs.__file__).parent.glob("_raysplats*.so")
    listing = subprocess.run(["readelf", "-d", module], check=True, stdout=subprocess.PIPE, text=True).stdout
    needed = set(re.findall(r"NEEDED.*\[(.+?)\.so", listing))
    assert "libOpenCL" in needed and needed <= ALLOWED
