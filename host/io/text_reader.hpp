// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace raysplats::io {

/// What editors of Windows begin UTF-8 with and nobody sees.
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Parses a number of any locale's program as in C ("1.5", "-2e3"); false when `token` is anything
/// else.
bool parse_number(std::string_view token, double& value);
bool parse_number(std::string_view token, std::uint64_t& value);
bool parse_number(std::string_view token, std::int32_t& value);

/// The beginning of an untrusted text for a message: whole UTF-8 characters of at most `most`
/// bytes, and "..." where more follows.
std::string excerpt(std::string_view text, std::size_t most = 80);

/// Reads untrusted text line by line and word by word; failures throw DataError with the file and
/// line.
class TextReader {
 public:
  TextReader(std::span<const std::byte> bytes, std::filesystem::path path);

  /// Moves to the next line; false at the end.
  bool next_line();
  /// Moves to the next line that is neither blank nor a comment (#).
  bool next_content_line();
  bool at_end() const { return next_ >= text_.size(); }
  /// Start of the line after the current one, in bytes of all that was given.
  std::size_t next_offset() const { return mark_ + next_; }

  /// The next word of the line; "" at its end.
  std::string_view word();
  double number(const char* what);
  std::uint64_t unsigned_integer(const char* what);
  /// What is left of the line without surrounding blanks.
  std::string_view rest();

  /// Throws DataError: "<path>: <message> in line <number>".
  [[noreturn]] void fail(const std::string& message) const;

 private:
  std::string_view text_;
  std::filesystem::path path_;
  std::string_view line_;
  std::size_t mark_ = 0;  // bytes in front of text_
  std::size_t next_ = 0;
  std::size_t line_number_ = 0;
};

}  // namespace raysplats::io
