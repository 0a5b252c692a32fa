// SPDX-License-Identifier: Apache-2.0
#include "util/output_directory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <system_error>
#include <vector>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

[[noreturn]] void refuse(const std::filesystem::path& path,
                         const char* what,
                         const std::string& reason) {
  throw DataError(fmt::format("The output folder {} cannot be {} ({}): choose another",
                              path.string(), what, reason));
}

constexpr std::size_t kTrialBytes = std::size_t{256} << 10;  // a large compiled kernel

std::error_code last_error() { return {errno, std::generic_category()}; }

std::string message_of(std::errc code) { return std::make_error_code(code).message(); }

}  // namespace

void make_output_directory(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error || !std::filesystem::is_directory(path, error))
    refuse(path, "created", error ? error.message() : "a file is in the way");
  if (::access(path.c_str(), W_OK | X_OK) != 0) refuse(path, "written to", std::strerror(errno));
}

void check_output_directory(const std::filesystem::path& path) {
  if (path.empty()) refuse(path, "created", message_of(std::errc::invalid_argument));
  std::error_code error;
  std::filesystem::path place = path;  // the part of it that is there
  while (!place.empty() && !std::filesystem::exists(place, error)) place = place.parent_path();
  const bool whole = place == path;
  if (place.empty()) place = ".";
  const long longest = ::pathconf(place.c_str(), _PC_NAME_MAX);
  for (const std::filesystem::path& name : path) {
    if (longest > 0 && name.native().size() > static_cast<std::size_t>(longest))
      refuse(path, "created", message_of(std::errc::filename_too_long));
  }
  if (!std::filesystem::is_directory(place, error))
    refuse(path, "created", message_of(std::errc::not_a_directory));
  if (::access(place.c_str(), W_OK | X_OK) != 0)
    refuse(path, whole ? "written to" : "created", std::strerror(errno));
}

std::error_code writing_trouble(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return error;
  std::string name = (folder / ".trial.XXXXXX").string();
  const int descriptor = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) return last_error();
  const std::vector<char> bytes(kTrialBytes);
  for (std::size_t done = 0; !error && done < bytes.size();) {
    const ssize_t written = ::write(descriptor, bytes.data() + done, bytes.size() - done);
    if (written >= 0) {
      done += static_cast<std::size_t>(written);
    } else if (errno != EINTR) {
      error = last_error();
    }
  }
  if (::close(descriptor) != 0 && !error) error = last_error();
  ::unlink(name.c_str());
  return error;
}

}  // namespace raysplats
