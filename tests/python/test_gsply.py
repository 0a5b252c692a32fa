# SPDX-License-Identifier: Apache-2.0
"""Files of ours in gsply, a reader of Gaussians that shares no code with raysplats."""

import numpy as np
import pytest

import raysplats as rs
from conftest import as_gaussians, random_arrays

gsply = pytest.importorskip("gsply", reason="no gsply: scripts/test_python.sh could not download it")

READERS = {
    "a.ply": (gsply.plyread, {}),
    "a.compressed.ply": (gsply.plyread, {}),
    "3.spz": (gsply.read_spz, {"spz_version": 3}),
    "4.spz": (gsply.read_spz, {"spz_version": 4}),
    "a.sog": (gsply.sogread, {}),
}


def signed(quaternions):
    """Of the two unit quaternions of a rotation the one whose largest part is positive."""
    q = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    largest = np.take_along_axis(q, np.abs(q).argmax(axis=1)[:, None], axis=1)
    return q * np.sign(largest)


@pytest.mark.parametrize("degree", [0, 1, 3])
@pytest.mark.parametrize("name", READERS)
def test_gsply_reads_what_we_read(tmp_path, name, degree):
    read, encoding = READERS[name]
    arrays = random_arrays(count=300, sh_degree=degree)
    as_gaussians(arrays).save(tmp_path / name, **encoding)
    ours, theirs = rs.Gaussians.load(tmp_path / name), read(tmp_path / name)
    higher = np.zeros((len(ours), 0, 3)) if theirs.shN is None else theirs.shN
    for found, expected in (
        (theirs.means, ours.means),
        (theirs.scales, ours.log_scales),
        (signed(theirs.quats), signed(ours.quaternions)),
        (theirs.opacities.reshape(-1), ours.opacities),
        (theirs.sh0, ours.sh[:, 0]),
        (higher.reshape(len(ours), -1, 3), ours.sh[:, 1:]),
    ):
        assert np.abs(found - expected).max(initial=0) < 2e-5
