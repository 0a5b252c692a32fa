# SPDX-License-Identifier: Apache-2.0
"""The blocks of Python in the documents, one after the other in a document, run as they stand."""

import pathlib
import re
import webbrowser

import numpy as np
import pytest

import raysplats as rs
from conftest import as_gaussians, random_arrays

ROOT = pathlib.Path(__file__).parents[2]
DOCUMENTS = [path for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))) if "```python" in path.read_text()]


def given():
    """What the blocks take for granted."""
    return {
        "camera": rs.Camera(8, 6, 8.0, translation=(0, 0, 3)),
        "origins": np.tile(np.float32([0, 0, -4]), (5, 1)),
        "directions": np.float32([[x, 0, 1] for x in (-0.1, -0.05, 0, 0.05, 0.1)]),
    }


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_blocks(document, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # Nobody looks, and nobody ends it.
    monkeypatch.setattr(webbrowser, "open", lambda url: True)
    monkeypatch.setattr(rs.Viewer, "wait", lambda viewer: None)
    as_gaussians(random_arrays()).save("model.ply", rs.TraceOptions(hit_order="peak"))
    names = given()
    for block in re.findall(r"```python\n(.*?)```", document.read_text(), re.DOTALL):
        if "torch" in block:
            torch = pytest.importorskip("torch", reason="no PyTorch: apt-get install python3-torch")
            names.update((k, torch.tensor(v, dtype=torch.float32)) for k, v in random_arrays().items())
            names.update((k, torch.tensor(given()[k])) for k in ("origins", "directions"))
            names["pose"] = torch.eye(4)
        exec(block, names)  # noqa: S102 - the document is ours
    assert "picture" in names


def test_there_are_documents():
    assert {"README.md", "python.md"} <= {path.name for path in DOCUMENTS}
