# SPDX-License-Identifier: Apache-2.0
"""Trains and renders 3D Gaussians by ray tracing on any OpenCL device."""

from . import _images
from ._raysplats import *  # noqa: F403
from ._raysplats import __version__, set_image_functions
from ._viewer import Viewer

__all__ = [name for name in dir() if not name.startswith("_")]

set_image_functions(_images.read, _images.encode)
