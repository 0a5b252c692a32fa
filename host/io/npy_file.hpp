// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace raysplats::io {

/// Numbers of a .npy file, rounded to T, in C order: the last index of `shape` runs fastest.
template <class T>
struct NpyNumbers {
  std::vector<std::size_t> shape;
  std::vector<T> data;
};
using NpyArray = NpyNumbers<float>;

/// Reads a .npy file (NumPy Enhancement Proposal 1, versions 1 to 3) of floats of 16, 32 or 64 bits
/// or whole numbers, of either byte order, in C or Fortran order. Throws DataError that names the
/// file and what is wrong: another type, a damaged header, a file that is shorter or longer than
/// its shape says.
NpyArray read_npy(const std::filesystem::path& path);

/// The same in double precision, as for positions that lie far from 0.
NpyNumbers<double> read_npy_doubles(const std::filesystem::path& path);

/// An array of a .npz file.
struct NpzMember {
  std::string name;                ///< without .npy
  std::string type;                ///< NumPy's, for example "<f4" or "<u4"
  std::vector<std::size_t> shape;  ///< C order
  std::span<const std::byte> data;
};

/// Writes the arrays as numpy.savez() does: a zip archive of .npy files, not compressed.
/// Atomically. Throws DataError when the file cannot be written or would be larger than such an
/// archive can be (4 GiB).
void write_npz(const std::filesystem::path& path, std::span<const NpzMember> members);

}  // namespace raysplats::io
