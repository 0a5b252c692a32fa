// SPDX-License-Identifier: Apache-2.0
#include "io/ply_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kMaxHeaderBytes = 1u << 20;
constexpr std::size_t kMaxProperties = 1024;

std::optional<PlyType> type_named(std::string_view name) {
  if (name == "char" || name == "int8") return PlyType::kInt8;
  if (name == "uchar" || name == "uint8") return PlyType::kUint8;
  if (name == "short" || name == "int16") return PlyType::kInt16;
  if (name == "ushort" || name == "uint16") return PlyType::kUint16;
  if (name == "int" || name == "int32") return PlyType::kInt32;
  if (name == "uint" || name == "uint32") return PlyType::kUint32;
  if (name == "float" || name == "float32") return PlyType::kFloat;
  if (name == "double" || name == "float64") return PlyType::kDouble;
  return std::nullopt;
}

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat:
      return 4;
    case PlyType::kDouble:
      break;
  }
  return 8;
}

double read_number(ByteReader& reader, PlyType type, std::endian order, const char* name) {
  switch (type) {
    case PlyType::kInt8:
      return reader.read<std::int8_t>(name);
    case PlyType::kUint8:
      return reader.read<std::uint8_t>(name);
    case PlyType::kInt16:
      return reader.read<std::int16_t>(name, order);
    case PlyType::kUint16:
      return reader.read<std::uint16_t>(name, order);
    case PlyType::kInt32:
      return reader.read<std::int32_t>(name, order);
    case PlyType::kUint32:
      return reader.read<std::uint32_t>(name, order);
    case PlyType::kFloat:
      return static_cast<double>(reader.read<float>(name, order));
    case PlyType::kDouble:
      break;
  }
  return reader.read<double>(name, order);
}

}  // namespace

PlyFile::PlyFile(const std::filesystem::path& path, std::string_view element)
    : PlyFile(path, read_file(path), element) {}

PlyFile::PlyFile(const std::filesystem::path& path,
                 std::vector<std::byte> bytes,
                 std::string_view element)
    : path_(path), element_(element), bytes_(std::move(bytes)) {
  parse_header();
  locate_rows();
}

bool PlyFile::has_later(std::string_view element) const {
  return std::any_of(later_.begin(), later_.end(),
                     [&](const LaterElement& each) { return each.name == element; });
}

std::uint64_t PlyFile::later_rows(std::string_view element) const {
  const auto found = std::find_if(later_.begin(), later_.end(),
                                  [&](const LaterElement& each) { return each.name == element; });
  return found == later_.end() ? 0 : found->rows;
}

bool PlyFile::has_later(std::string_view element, std::string_view property) const {
  return std::any_of(later_.begin(), later_.end(), [&](const LaterElement& each) {
    return each.name == element &&
           std::any_of(each.properties.begin(), each.properties.end(),
                       [&](const LaterProperty& p) { return p.name == property; });
  });
}

std::string PlyFile::comment(std::string_view word) const {
  TextReader reader(std::span<const std::byte>(bytes_).first(data_offset_), path_);
  while (reader.next_line()) {
    if (reader.word() == "comment" && reader.word() == word) return std::string(reader.rest());
  }
  return {};
}

std::optional<std::size_t> PlyFile::column(std::string_view name) const {
  const auto found = std::find_if(properties_.begin(), properties_.end(),
                                  [&](const PlyProperty& p) { return p.name == name; });
  if (found == properties_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - properties_.begin());
}

void PlyFile::read_format(TextReader& reader) {
  const std::string_view format = reader.word();
  if (format == "ascii") {
    ascii_ = true;
  } else if (format == "binary_big_endian") {
    order_ = std::endian::big;
  } else if (format != "binary_little_endian") {
    reader.fail(fmt::format("the PLY format '{}' is unknown", format));
  }
}

// Of the table, or of an element before it; its bytes.
std::size_t PlyFile::read_property(TextReader& reader, bool of_table) {
  const std::string_view type_name = reader.word();
  if (type_name == "list") {
    reader.fail(fmt::format("{} has a list property, which is not supported",
                            of_table ? fmt::format("the {} element", element_)
                                     : fmt::format("an element before the {} element", element_)));
  }
  const std::optional<PlyType> type = type_named(type_name);
  if (!type) reader.fail(fmt::format("the property type '{}' is unknown", type_name));
  if (!of_table) return size_of(*type);
  const std::string name(reader.word());
  if (name.empty()) reader.fail("a property has no name");
  if (column(name)) reader.fail(fmt::format("the property '{}' appears twice", name));
  if (properties_.size() == kMaxProperties) {
    reader.fail(fmt::format("there are more than {} properties", kMaxProperties));
  }
  properties_.push_back({name, *type});
  row_bytes_ += size_of(*type);
  return size_of(*type);
}

// Of an element behind the table.
void PlyFile::add_later_property(TextReader& reader) {
  LaterProperty property;
  std::string_view type = reader.word();
  property.list = type == "list";
  if (property.list) {
    property.count_type = type_named(reader.word());
    type = reader.word();
  }
  property.type = type_named(type);
  property.name = reader.word();
  later_.back().properties.push_back(std::move(property));
}

void PlyFile::parse_header() {
  const auto header =
      std::span<const std::byte>(bytes_).first(std::min(bytes_.size(), kMaxHeaderBytes));
  TextReader reader(header, path_);
  if (!reader.next_line() || reader.rest() != "ply") {
    throw DataError(
        fmt::format("{} is not a PLY file: its first line is not 'ply'", path_.string()));
  }
  enum class At { kBefore, kTable, kAfter } at = At::kBefore;
  bool has_format = false;
  bool ended = false;
  std::uint64_t element_rows = 0;
  std::uint64_t element_bytes = 0;
  const auto close_element = [&] {
    if (at == At::kBefore) {
      rows_before_ += std::min(element_rows, UINT64_MAX - rows_before_);
      const std::uint64_t bytes = saturating_product(element_rows, element_bytes);
      bytes_before_ += std::min(bytes, UINT64_MAX - bytes_before_);
    }
    element_bytes = 0;
  };
  while (!ended && reader.next_line()) {
    const std::string_view key = reader.word();
    if (key == "end_header") {
      ended = true;
    } else if (key == "format") {
      read_format(reader);
      has_format = true;
    } else if (key == "element") {
      close_element();
      if (at == At::kTable) at = At::kAfter;
      const std::string name(reader.word());
      const bool table = name == element_;
      element_rows = reader.unsigned_integer("the element count");
      if (table) {
        if (at == At::kAfter) reader.fail(fmt::format("there is a second {} element", element_));
        at = At::kTable;
        rows_ = static_cast<std::size_t>(element_rows);
      } else if (at == At::kAfter) {
        later_.push_back({name, element_rows, {}});
      }
    } else if (key == "property") {
      if (at == At::kAfter) {
        add_later_property(reader);
      } else {
        element_bytes += read_property(reader, at == At::kTable);
      }
    } else if (key != "comment" && key != "obj_info" && !key.empty()) {
      reader.fail(fmt::format("the PLY header has the unknown keyword '{}'", key.substr(0, 40)));
    }
  }
  if (!ended) reader.fail("the PLY header has no end_header");
  if (!has_format) reader.fail("the PLY header has no format line");
  if (at == At::kBefore) reader.fail(fmt::format("the PLY header has no {} element", element_));
  if (properties_.empty()) reader.fail(fmt::format("the {} element has no properties", element_));
  data_offset_ = std::min(reader.next_offset(), bytes_.size());
}

void PlyFile::locate_rows() {
  const std::uint64_t left = bytes_.size() - data_offset_;
  // A number of an ASCII file takes at least a digit and a separator, which the last one may lack.
  const std::uint64_t least_row = ascii_ ? 2 * properties_.size() : row_bytes_;
  const std::uint64_t before = ascii_ ? rows_before_ : bytes_before_;
  const std::uint64_t room = left + (ascii_ ? 1 : 0);
  if (before > room || saturating_product(rows_, least_row) > room - before) {
    throw DataError(fmt::format(
        "{} is truncated or its header is wrong: it declares {} rows of {} bytes in its {} "
        "element, "
        "but only {} bytes "
        "follow the header, which ends at byte {}",
        path_.string(), rows_, least_row, element_, left - std::min(left, before), data_offset_));
  }
}

ByteReader PlyFile::binary_rows() const {
  ByteReader reader(bytes_, path_);
  reader.skip(data_offset_ + bytes_before_, element_.c_str());
  return reader;
}

TextReader PlyFile::text_rows() const {
  // Line numbers of errors count from the top of the file.
  TextReader reader(bytes_, path_);
  while (reader.next_offset() < data_offset_ && reader.next_line()) {
  }
  for (std::uint64_t i = 0; i < rows_before_; ++i) {
    if (!reader.next_line()) reader.fail("the file ends before its table");
  }
  return reader;
}

void PlyFile::read_text_row(TextReader& reader, std::span<double> values) const {
  if (!reader.next_line()) reader.fail("the file is truncated, rows are missing");
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = reader.number(properties_[i].name.c_str());
  }
}

void PlyFile::read_binary_row(ByteReader& reader, std::span<double> values) const {
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = read_number(reader, properties_[i].type, order_, properties_[i].name.c_str());
  }
}

void PlyFile::check_types(const LaterElement& element) const {
  for (const LaterProperty& property : element.properties) {
    const bool counted = !property.list || property.count_type;
    if (property.type && counted && !property.name.empty()) continue;
    throw DataError(fmt::format("{}: the property '{}' of the element '{}' has an unknown type",
                                path_.string(), property.name, element.name));
  }
}

bool PlyFile::for_each_list(
    std::string_view element,
    std::span<const std::string_view> names,
    const std::function<void(std::size_t row, std::span<const double> values)>& visit) const {
  const auto target = std::find_if(later_.begin(), later_.end(),
                                   [&](const LaterElement& e) { return e.name == element; });
  if (target == later_.end()) return false;
  const auto chosen = std::find_if(
      target->properties.begin(), target->properties.end(), [&](const LaterProperty& p) {
        return p.list && std::find(names.begin(), names.end(), p.name) != names.end();
      });
  if (chosen == target->properties.end()) return false;
  // Every row of the elements up to the target takes bytes, so that wrong counts end with the file.
  std::vector<double> values;
  const auto read_rows = [&](const auto& start_row, const auto& number, const auto& fail) {
    for (auto current = later_.begin(); current <= target; ++current) {
      check_types(*current);
      if (current->properties.empty()) continue;
      for (std::uint64_t row = 0; row < current->rows; ++row) {
        start_row();
        for (auto property = current->properties.begin(); property != current->properties.end();
             ++property) {
          double count = 1.0;
          if (property->list) {
            count = number(*property->count_type, "the length of a list");
            if (!(count >= 0.0) || count != std::floor(count)) {
              fail(fmt::format("the length of a list is {}", count));
            }
          }
          values.clear();
          for (double i = 0; i < count; ++i) {
            values.push_back(number(*property->type, property->name.c_str()));
          }
          if (property == chosen) visit(static_cast<std::size_t>(row), values);
        }
      }
    }
  };
  if (ascii_) {
    TextReader reader = text_rows();
    const auto start_row = [&] {
      if (!reader.next_line()) reader.fail("the file is truncated, rows are missing");
    };
    for (std::size_t row = 0; row < rows_; ++row) start_row();
    read_rows(
        start_row, [&](PlyType, const char* what) { return reader.number(what); },
        [&](const std::string& message) { reader.fail(message); });
  } else {
    ByteReader reader = binary_rows();
    reader.skip(saturating_product(rows_, row_bytes_), element_.c_str());
    read_rows(
        [] {},
        [&](PlyType type, const char* what) { return read_number(reader, type, order_, what); },
        [&](const std::string& message) { reader.fail(message); });
  }
  return true;
}

}  // namespace raysplats::io
