// SPDX-License-Identifier: Apache-2.0
#include "device/program_cache.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <xxhash.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <thread>

#include "raysplats/error.hpp"
#include "util/output_directory.hpp"

namespace raysplats {
namespace {

constexpr std::array<char, 8> kMagic{'R', 'S', 'K', 'E', 'R', 'N', '0', '1'};

struct Header {
  std::array<char, 8> magic;
  std::uint64_t bytes;
  std::uint64_t checksum;
};

std::uint64_t checksum(const std::vector<unsigned char>& data) {
  return XXH3_64bits(data.data(), data.size());
}

// What other processes compile meanwhile need not be compiled again; files are stored whole, so
// that going on without the lock costs time alone.
constexpr std::chrono::milliseconds kPoll{20};
constexpr std::chrono::seconds kToldWait{5};
constexpr std::chrono::minutes kMostWait{3};

}  // namespace

std::filesystem::path default_cache_directory() {
  if (const char* xdg = std::getenv("XDG_CACHE_HOME"); xdg != nullptr && *xdg != '\0') {
    return std::filesystem::path(xdg) / "raysplats";
  }
  if (const char* home = std::getenv("HOME"); home != nullptr && *home != '\0') {
    return std::filesystem::path(home) / ".cache" / "raysplats";
  }
  return {};
}

// A byte of one file for every key: two that share one wait for each other, which costs time alone.
ProgramCache::BuildLock::BuildLock(const std::filesystem::path& directory, const std::string& key)
    : descriptor_(-1) {
  if (directory.empty()) return;
  descriptor_ = ::open((directory / ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) return;
  struct flock range {};
  range.l_type = F_WRLCK;
  range.l_whence = SEEK_SET;
  range.l_start = static_cast<off_t>(XXH3_64bits(key.data(), key.size()) >> 33);
  range.l_len = 1;
  const auto start = std::chrono::steady_clock::now();
  bool told = false;
  while (::fcntl(descriptor_, F_OFD_SETLK, &range) != 0 &&
         (errno == EAGAIN || errno == EACCES || errno == EINTR)) {
    const auto waited = std::chrono::steady_clock::now() - start;
    if (waited > kMostWait) return;  // one that was stopped holds it for good
    if (waited > kToldWait && !told) {
      told = true;
      spdlog::info("waiting for another process that compiles a kernel for {}", directory.string());
    }
    std::this_thread::sleep_for(kPoll);
  }
}

ProgramCache::BuildLock::~BuildLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

ProgramCache::ProgramCache(const std::string& directory)
    : directory_(directory.empty() ? default_cache_directory() : std::filesystem::path(directory)) {
  if (directory_.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(directory_, error);
  if (error) {
    spdlog::debug("kernel cache off: {} cannot be created ({})", directory_.string(),
                  error.message());
    directory_.clear();
  }
}

std::string ProgramCache::key(const std::string& source,
                              const std::string& options,
                              const DeviceInfo& device) {
  const std::string text =
      fmt::format("{}\n{}\n{}\n{}\n{}\n{}\n{}\n", source, options, device.platform,
                  device.platform_version, device.name, device.version, device.driver_version);
  const XXH128_hash_t hash = XXH3_128bits(text.data(), text.size());
  return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

std::optional<std::vector<unsigned char>> ProgramCache::load(const std::string& key) const {
  if (directory_.empty()) return std::nullopt;
  std::ifstream stream(file(key), std::ios::binary | std::ios::ate);
  if (!stream) return std::nullopt;
  const auto size = static_cast<std::uint64_t>(stream.tellg());
  stream.seekg(0);
  Header header{};
  if (size < sizeof(header) || !stream.read(reinterpret_cast<char*>(&header), sizeof(header)))
    return std::nullopt;
  if (header.magic != kMagic || header.bytes != size - sizeof(header)) return std::nullopt;
  std::vector<unsigned char> binary(header.bytes);
  if (!stream.read(reinterpret_cast<char*>(binary.data()),
                   static_cast<std::streamsize>(binary.size()))) {
    return std::nullopt;
  }
  if (checksum(binary) != header.checksum) return std::nullopt;
  return binary;
}

void ProgramCache::store(const std::string& key, const std::vector<unsigned char>& binary) const {
  if (directory_.empty()) return;
  const std::filesystem::path target = file(key);
  // A name of its own for every writer: other processes and threads may be storing the same key.
  std::string temporary = (directory_ / fmt::format(".{}.XXXXXX", key)).string();
  const int descriptor = ::mkstemp(temporary.data());
  if (descriptor < 0) return;
  ::close(descriptor);
  const Header header{kMagic, binary.size(), checksum(binary)};
  std::error_code error;
  {
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    stream.write(reinterpret_cast<const char*>(&header), sizeof(header));
    stream.write(reinterpret_cast<const char*>(binary.data()),
                 static_cast<std::streamsize>(binary.size()));
    stream.close();
    if (!stream) {
      std::filesystem::remove(temporary, error);
      return;
    }
  }
  std::filesystem::rename(temporary, target, error);
  if (error) std::filesystem::remove(temporary, error);
}

void ProgramCache::remove(const std::string& key) const {
  std::error_code error;
  if (!directory_.empty()) std::filesystem::remove(file(key), error);
}

namespace {

template <class Wanted>
std::vector<std::filesystem::path> files_in(const std::filesystem::path& directory, Wanted wanted) {
  std::error_code error;
  std::vector<std::filesystem::path> files;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    if (wanted(entry->path())) files.push_back(entry->path());
  }
  return files;
}

std::vector<std::filesystem::path> programs_in(const std::filesystem::path& directory) {
  return files_in(directory, [](const auto& path) { return path.extension() == ".bin"; });
}

// What mkstemp() named .NAME.XXXXXX, and a killed process has left.
std::vector<std::filesystem::path> temporaries_in(const std::filesystem::path& directory) {
  return files_in(directory, [](const auto& path) {
    return path.filename().string().starts_with('.') && path.extension().string().size() == 7;
  });
}

}  // namespace

ProgramCacheState program_cache_state(const std::filesystem::path& directory) {
  if (directory.empty()) return {0, 0, "neither XDG_CACHE_HOME nor HOME names a folder for it"};
  ProgramCacheState state;
  std::error_code error;
  if (const std::error_code trouble = writing_trouble(directory))
    state.trouble = fmt::format("it cannot be written ({})", trouble.message());
  for (const std::filesystem::path& path : programs_in(directory)) {
    const std::uintmax_t bytes = std::filesystem::file_size(path, error);
    if (error) continue;  // removed meanwhile
    ++state.programs;
    state.bytes += bytes;
  }
  return state;
}

std::size_t clear_program_cache(const std::filesystem::path& directory) {
  if (directory.empty())
    throw DataError("There is no folder of compiled programs: set HOME or XDG_CACHE_HOME");
  std::size_t removed = 0;
  std::error_code error;
  for (const std::filesystem::path& path : programs_in(directory)) {
    if (std::filesystem::remove(path, error)) ++removed;
  }
  for (const std::filesystem::path& path : temporaries_in(directory))
    std::filesystem::remove(path, error);
  return removed;
}

}  // namespace raysplats
