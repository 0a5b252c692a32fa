# SPDX-License-Identifier: Apache-2.0
"""Pictures by Pillow, the functions that raysplats starts with (set_image_functions)."""

import io

import numpy as np

_PILLOW_FORMATS = {"png": "PNG", "jpeg": "JPEG", "webp": "WEBP", "bmp": "BMP", "tiff": "TIFF"}
_JPEG_QUALITY = 95


def _pillow(pixel_format):
    if pixel_format not in _PILLOW_FORMATS:
        raise ValueError(
            f"Pillow knows no {pixel_format}: give functions that do to raysplats.set_image_functions"
        )
    try:
        from PIL import Image
    except ImportError:
        raise ImportError(
            "Pillow is not installed: pip install pillow, or give functions to "
            "raysplats.set_image_functions"
        ) from None
    return Image


def _straight(picture):
    """The pixels of a Pillow picture as float32, whatever its mode."""
    if picture.mode.startswith("I;16") or picture.mode == "I":
        return np.asarray(picture, dtype=np.float32) / 65535.0
    if picture.mode == "F":
        return np.asarray(picture, dtype=np.float32)
    if picture.mode == "P" or picture.mode not in ("L", "LA", "RGB", "RGBA"):
        transparent = "transparency" in picture.info or picture.mode.endswith(("A", "a"))
        picture = picture.convert(
            "L" if picture.mode == "1" else "RGBA" if transparent else "RGB"
        )
    return np.asarray(picture, dtype=np.float32) / 255.0


def read(source, pixel_format):
    """A picture of a path or of bytes: float32 (height, width, channels), straight alpha."""
    image = _pillow(pixel_format)
    with image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as picture:
        pixels = _straight(picture)
    return np.ascontiguousarray(pixels.reshape(*pixels.shape[:2], -1))


def encode(pixels, pixel_format, channel_names, color_space):
    """The bytes of a PNG or JPEG file; values are clamped to [0, 1] and rounded."""
    del channel_names, color_space  # of formats that Pillow does not know
    image = _pillow(pixel_format)
    if pixel_format == "jpeg":
        pixels = pixels[..., : 3 if pixels.shape[2] >= 3 else 1]
    # NaN becomes 0.
    levels = (np.where(pixels > 0, np.minimum(pixels, 1), 0) * 255 + 0.5).astype(np.uint8)
    if levels.shape[2] == 1:
        levels = levels[..., 0]
    stream = io.BytesIO()
    options = {"quality": _JPEG_QUALITY, "subsampling": 0} if pixel_format == "jpeg" else {}
    image.fromarray(levels).save(stream, _PILLOW_FORMATS[pixel_format], **options)
    return stream.getvalue()
