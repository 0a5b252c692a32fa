// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/text_reader.hpp"

namespace raysplats::io {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct PlyProperty {
  std::string name;
  PlyType type;
};

/// An element of a PLY file (Turk 1994), as a rule the vertices, as a table of numbers: ASCII or
/// binary of both byte orders, scalar properties of every type. Elements with lists may follow it,
/// but not precede it; their lists can be read too. Throws DataError for anything malformed or
/// truncated, and for a count that the file cannot hold.
class PlyFile {
 public:
  explicit PlyFile(const std::filesystem::path& path, std::string_view element = "vertex");
  /// The same of a file that has been read; `path` is named in errors.
  PlyFile(const std::filesystem::path& path,
          std::vector<std::byte> bytes,
          std::string_view element = "vertex");

  std::size_t rows() const { return rows_; }
  const std::vector<PlyProperty>& properties() const { return properties_; }
  /// Column of a property, nothing when there is none.
  std::optional<std::size_t> column(std::string_view name) const;
  /// The elements behind the table.
  bool has_later(std::string_view element) const;
  bool has_later(std::string_view element, std::string_view property) const;
  /// Rows of an element behind the table; 0 without it.
  std::uint64_t later_rows(std::string_view element) const;
  /// What follows a word in the first comment that begins with it; "" without one.
  std::string comment(std::string_view word) const;

  /// Calls visit(row, values) for every row in order; values has one double per property.
  template <class Visit>
  void for_each_row(Visit visit) const {
    std::vector<double> values(properties_.size());
    if (ascii_) {
      TextReader reader = text_rows();
      for (std::size_t row = 0; row < rows_; ++row) {
        read_text_row(reader, values);
        visit(row, std::span<const double>(values));
      }
    } else {
      ByteReader reader = binary_rows();
      for (std::size_t row = 0; row < rows_; ++row) {
        read_binary_row(reader, values);
        visit(row, std::span<const double>(values));
      }
    }
  }

  /// Calls visit(row, values) with a list of every row of an element behind the table, the
  /// property being the first one among `names`. False when there is no such element or property.
  bool for_each_list(
      std::string_view element,
      std::span<const std::string_view> names,
      const std::function<void(std::size_t row, std::span<const double> values)>& visit) const;

 private:
  /// A property of an element behind the table. Types that are unknown matter once it is read.
  struct LaterProperty {
    std::string name;
    std::optional<PlyType> type;
    bool list = false;
    std::optional<PlyType> count_type;
  };
  struct LaterElement {
    std::string name;
    std::uint64_t rows = 0;
    std::vector<LaterProperty> properties;
  };
  void parse_header();
  void read_format(TextReader& reader);
  std::size_t read_property(TextReader& reader, bool of_table);
  void add_later_property(TextReader& reader);
  void locate_rows();
  void check_types(const LaterElement& element) const;
  TextReader text_rows() const;
  ByteReader binary_rows() const;
  void read_text_row(TextReader& reader, std::span<double> values) const;
  void read_binary_row(ByteReader& reader, std::span<double> values) const;

  std::filesystem::path path_;
  std::string element_;
  std::vector<std::byte> bytes_;
  bool ascii_ = false;
  std::endian order_ = std::endian::little;
  std::vector<PlyProperty> properties_;
  std::size_t rows_ = 0;
  std::size_t row_bytes_ = 0;
  std::size_t data_offset_ = 0;     ///< end of the header
  std::uint64_t rows_before_ = 0;   ///< rows of the elements before the table
  std::uint64_t bytes_before_ = 0;  ///< their size in a binary file
  std::vector<LaterElement> later_;
};

}  // namespace raysplats::io
