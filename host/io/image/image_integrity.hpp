// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <istream>
#include <span>
#include <string_view>

namespace raysplats::io {

/// Whether a JPEG file goes up to its end-of-image marker. The decoder fills the rest of a
/// truncated one with grey instead of failing, so the segments are walked here (ITU-T T.81, annex
/// B).
bool is_whole_jpeg(std::span<const std::byte> bytes);

/// Of a PNG: signature and header chunk.
constexpr std::size_t kPngHeaderBytes = 33;

/// Whether the chunks of a PNG are whole, with their checksums (PNG specification, section 5), up
/// to the end chunk or, with `header_only`, the header chunk. `bytes` begin with the signature.
/// libpng would print a line of its own for what this finds.
bool has_whole_png_chunks(std::string_view bytes, bool header_only);

/// Whether the strips or tiles of a TIFF's first picture lie within the file, where they are JPEG
/// (TIFF 6.0, section 2, and BigTIFF): of those that miss libtiff says nothing when it makes
/// colours of them. True for other TIFF files.
bool has_whole_jpeg_strips(std::istream& file);

}  // namespace raysplats::io
