# SPDX-License-Identifier: Apache-2.0
"""The type stubs that the wheel brings."""

import ast
import pathlib

import raysplats as rs
from conftest import as_gaussians, random_arrays

FOLDER = pathlib.Path(rs.__file__).parent


def test_stubs_know_every_name_and_no_type_of_cpp():
    text = (FOLDER / "_raysplats.pyi").read_text()
    assert (FOLDER / "py.typed").exists()
    assert "::" not in text
    known = {node.name for node in ast.parse(text).body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    # Exceptions are attributes.
    known |= {name for name in rs.__all__ if isinstance(getattr(rs, name), type) and issubclass(getattr(rs, name), Exception)}
    # And Viewer is of Python.
    assert set(rs.__all__) - {"Viewer"} <= known


def test_everything_says_what_it_is(context):
    g = as_gaussians(random_arrays())
    assert repr(g) == "<raysplats.Gaussians: 7 of SH degree 2>"
    assert repr(rs.Model(context, g)) == "<raysplats.Model: 7 Gaussians of SH degree 2>"
    assert repr(rs.Camera(4, 3, 5.0)) == "<raysplats.Camera pinhole: 4x3, fx 5>"
    assert context.device.name in repr(context.device)
