// SPDX-License-Identifier: Apache-2.0
#include "run/checkpoint.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "util/atomic_file.hpp"
#include "util/file_kind.hpp"
#include "util/json_text.hpp"

namespace raysplats {
namespace {

static_assert(std::endian::native == std::endian::little,
              "checkpoints are written in memory order");

// The line end shows transfers in text mode, as in PNG.
constexpr std::array<char, 8> kMagic{'R', 'S', 'C', 'K', 'P', 'T', '\r', '\n'};
// Version 1 had the seconds of training in its header and no data set.
constexpr std::uint32_t kVersion = 2;
constexpr std::uint32_t kOldestVersion = 1;
constexpr std::uint32_t kMaxSections = 64;
constexpr std::uint64_t kMaxHeader = 1 << 20;
constexpr std::size_t kNameBytes = 32;
constexpr char kFolder[] = "checkpoints";  // of a run
// Far above what any device holds, and small enough that sizes made of it cannot overflow.
constexpr std::uint64_t kMaxGaussians = std::uint64_t{1} << 40;
constexpr std::int64_t kMaxIterations = std::int64_t{1} << 60;

struct Preamble {
  std::array<char, 8> magic;
  std::uint32_t version;
  std::uint32_t sections;
  std::uint64_t header_bytes;
  std::uint64_t header_hash;
};
static_assert(sizeof(Preamble) == 32);

struct SectionEntry {
  std::array<char, kNameBytes> name;
  std::uint64_t offset;
  std::uint64_t bytes;
  std::uint64_t hash;
};
static_assert(sizeof(SectionEntry) == 56);

std::uint64_t hash(const void* data, std::size_t bytes) { return XXH64(data, bytes, 0); }

// A file read front to back; every read is checked against the bytes that are left.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& path)
      : path_(path), stream_(path, std::ios::binary) {
    std::error_code error;
    size_ = std::filesystem::file_size(path, error);
    if (error || !stream_.good()) fail("cannot be read");
  }
  void read(void* target, std::uint64_t bytes) {
    if (bytes > size_ - position_) fail("is truncated");
    stream_.read(static_cast<char*>(target), static_cast<std::streamsize>(bytes));
    if (!stream_.good()) fail("cannot be read to its end");
    position_ += bytes;
  }
  std::uint64_t position() const { return position_; }
  std::uint64_t left() const { return size_ - position_; }
  [[noreturn]] void fail(const std::string& what) const {
    throw DataError(
        fmt::format("The checkpoint {} {}: resume from another one", path_.string(), what));
  }

 private:
  std::filesystem::path path_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t position_ = 0;
};

nlohmann::json header_of(const Checkpoint& c) {
  return {{"iteration", c.iteration},
          {"count", c.count},
          {"seed", c.seed},
          {"optimiser_steps", c.optimiser_steps},
          {"sh_degree", c.sh_degree},
          {"active_sh_degree", c.active_sh_degree},
          {"scale_activation", c.scale_activation},
          {"scene_extent", c.scene_extent},
          {"dataset", c.dataset},
          {"split", c.split},
          {"bad_steps", c.bad_steps},
          {"bad_steps_in_a_row", c.bad_steps_in_a_row},
          {"traced_rays", c.traced_rays},
          {"capped_rays", c.capped_rays},
          {"skipped_updates", c.skipped_updates},
          {"mean_since", c.mean_since},
          {"views_joined", c.views_joined},
          {"left_out_from", c.left_out_from},
          {"pass_due", c.pass_due},
          {"config", c.config}};
}

// A whole number of the header within its range: conversions of others would wrap or be undefined.
template <class T>
void get_whole(const nlohmann::json& json, const char* key, T low, T high, T& target) {
  const nlohmann::json& value = json.at(key);
  const bool fits = value.is_number_unsigned()
                        ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(high)
                        : value.is_number_integer() &&
                              value.get<std::int64_t>() >= static_cast<std::int64_t>(low);
  if (!fits) throw DataError(fmt::format("'{}' is out of range", key));
  value.get_to(target);
}

Checkpoint parse_header(const std::string& text, std::uint32_t version) {
  const nlohmann::json json = nlohmann::json::parse(text);
  Checkpoint c;
  get_whole<std::int64_t>(json, "iteration", 0, kMaxIterations, c.iteration);
  get_whole<std::uint64_t>(json, "count", 0, kMaxGaussians, c.count);
  get_whole<std::uint64_t>(json, "seed", 0, UINT64_MAX, c.seed);
  get_whole<std::int64_t>(json, "optimiser_steps", 0, kMaxIterations, c.optimiser_steps);
  get_whole<int>(json, "sh_degree", 0, kMaxShDegree, c.sh_degree);
  get_whole<int>(json, "active_sh_degree", 0, c.sh_degree, c.active_sh_degree);
  json.at("scale_activation").get_to(c.scale_activation);
  json.at("scene_extent").get_to(c.scene_extent);
  if (version > 1) {
    json.at("dataset").get_to(c.dataset);
    get_whole<std::uint32_t>(json, "bad_steps", 0, UINT32_MAX, c.bad_steps);
    get_whole<std::uint32_t>(json, "bad_steps_in_a_row", 0, UINT32_MAX, c.bad_steps_in_a_row);
  }
  if (json.contains("capped_rays")) {
    get_whole<std::uint64_t>(json, "traced_rays", 0, UINT64_MAX, c.traced_rays);
    get_whole<std::uint64_t>(json, "capped_rays", 0, UINT64_MAX, c.capped_rays);
  }
  if (json.contains("skipped_updates"))
    get_whole<std::uint64_t>(json, "skipped_updates", 0, UINT64_MAX, c.skipped_updates);
  if (json.contains("mean_since"))
    get_whole<std::int64_t>(json, "mean_since", 0, kMaxIterations, c.mean_since);
  if (json.contains("views_joined"))
    get_whole<std::int64_t>(json, "views_joined", 0, kMaxIterations, c.views_joined);
  if (json.contains("left_out_from"))
    get_whole<std::int64_t>(json, "left_out_from", 0, kMaxIterations, c.left_out_from);
  if (json.contains("split")) json.at("split").get_to(c.split);
  if (json.contains("pass_due")) json.at("pass_due").get_to(c.pass_due);
  json.at("config").get_to(c.config);
  return c;
}

// The beginning of a file, and the checkpoint without its sections; the table of them is next.
Checkpoint read_start(Reader& reader, const std::filesystem::path& path, Preamble& preamble) {
  constexpr std::size_t kMagicBytes = sizeof(preamble.magic);
  // First, because of a short file that is something else nothing is missing.
  reader.read(&preamble, std::min<std::uint64_t>(kMagicBytes, reader.left()));
  if (preamble.magic != kMagic) {
    throw DataError(
        fmt::format("{} is not a raysplats checkpoint: resume from another one", path.string()));
  }
  reader.read(reinterpret_cast<char*>(&preamble) + kMagicBytes, sizeof(preamble) - kMagicBytes);
  if (preamble.version < kOldestVersion || preamble.version > kVersion) {
    reader.fail(fmt::format("has version {}, and this program reads {} to {}", preamble.version,
                            kOldestVersion, kVersion));
  }
  if (preamble.header_bytes > std::min(kMaxHeader, reader.left()))
    reader.fail("has a damaged header");
  if (preamble.sections > kMaxSections) reader.fail("has a damaged section table");
  std::string header(preamble.header_bytes, '\0');
  reader.read(header.data(), header.size());
  if (hash(header.data(), header.size()) != preamble.header_hash)
    reader.fail("has a damaged header");
  try {
    return parse_header(header, preamble.version);
  } catch (const std::exception& error) {
    reader.fail(fmt::format("has a header that cannot be understood ({})", error.what()));
  }
}

}  // namespace

void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint) {
  CheckpointSections sections;
  for (const auto& [name, values] : checkpoint.sections)
    sections[name] = [&values = values] { return values; };
  write_checkpoint(path, checkpoint, sections);
}

// The table stands before the sections and is known behind them.
void write_checkpoint(const std::filesystem::path& path,
                      const Checkpoint& checkpoint,
                      const CheckpointSections& sections) {
  const std::string header = json_text(header_of(checkpoint));
  const Preamble preamble{kMagic, kVersion, static_cast<std::uint32_t>(sections.size()),
                          header.size(), hash(header.data(), header.size())};
  std::vector<SectionEntry> table(sections.size());
  const std::size_t table_bytes = table.size() * sizeof(SectionEntry);
  const std::uint64_t table_offset = sizeof(Preamble) + header.size();
  std::uint64_t table_hash = 0;
  AtomicFile file(path);
  file.write(&preamble, sizeof(preamble));
  file.write(header);
  file.write(table.data(), table_bytes);
  file.write(&table_hash, sizeof(table_hash));
  std::uint64_t offset = table_offset + table_bytes + sizeof(table_hash);
  auto entry = table.begin();
  for (const auto& [name, numbers] : sections) {
    const std::vector<float> values = numbers();
    name.copy(entry->name.data(), kNameBytes - 1);
    entry->offset = offset;
    entry->bytes = values.size() * sizeof(float);
    entry->hash = hash(values.data(), entry->bytes);
    file.write(values.data(), entry->bytes);
    offset += entry->bytes;
    ++entry;
  }
  table_hash = hash(table.data(), table_bytes);
  file.write_at(table_offset, table.data(), table_bytes);
  file.write_at(table_offset + table_bytes, &table_hash, sizeof(table_hash));
  file.commit();
}

Checkpoint read_checkpoint(const std::filesystem::path& path) {
  Reader reader(path);
  Preamble preamble{};
  Checkpoint checkpoint = read_start(reader, path, preamble);
  std::vector<SectionEntry> table(preamble.sections);
  reader.read(table.data(), table.size() * sizeof(SectionEntry));
  std::uint64_t table_hash = 0;
  reader.read(&table_hash, sizeof(table_hash));
  if (hash(table.data(), table.size() * sizeof(SectionEntry)) != table_hash) {
    reader.fail("has a damaged section table");
  }
  for (const SectionEntry& entry : table) {
    const std::string name(entry.name.data(), strnlen(entry.name.data(), kNameBytes));
    // Checked before the memory is asked for: a length must not exceed what the file holds.
    if (entry.bytes > reader.left()) reader.fail("is truncated");
    if (entry.offset != reader.position() || entry.bytes % sizeof(float) != 0) {
      reader.fail("has a damaged section table");
    }
    std::vector<float> values(entry.bytes / sizeof(float));
    reader.read(values.data(), entry.bytes);
    if (hash(values.data(), entry.bytes) != entry.hash)
      reader.fail(fmt::format("is damaged in '{}'", name));
    checkpoint.sections[name] = std::move(values);
  }
  if (reader.left() != 0) reader.fail("has bytes after its end");
  return checkpoint;
}

std::string checkpoint_config(const std::filesystem::path& path) {
  const auto config_of = [](const std::filesystem::path& file) {
    Reader reader(file);
    Preamble preamble{};
    return read_start(reader, file, preamble).config;
  };
  if (is_file(path)) return config_of(path);
  const std::vector<std::filesystem::path> files = list_checkpoints(path);
  for (auto file = files.rbegin(); file != files.rend(); ++file) {
    try {
      return config_of(*file);
    } catch (const DataError&) {
      // load_latest_checkpoint() passes over it too, and says so.
    }
  }
  return "";
}

std::optional<std::filesystem::path> run_folder_of(const std::filesystem::path& path) {
  if (!is_file(path)) return path;
  const std::filesystem::path folder =
      std::filesystem::absolute(path).lexically_normal().parent_path();
  if (folder.filename() != kFolder) return std::nullopt;
  return folder.parent_path();
}

std::filesystem::path checkpoint_path(const std::filesystem::path& run_folder,
                                      std::int64_t iteration) {
  return run_folder / kFolder / fmt::format("step_{:09}.rsck", iteration);
}

std::vector<std::filesystem::path> list_checkpoints(const std::filesystem::path& run_folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(run_folder / kFolder, error)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".rsck" && name.rfind("step_", 0) == 0)
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

Checkpoint load_latest_checkpoint(const std::filesystem::path& path) {
  if (is_file(path) || (path.extension() == ".rsck" && !is_folder(path)))
    return read_checkpoint(path);
  std::vector<std::filesystem::path> files = list_checkpoints(path);
  for (auto file = files.rbegin(); file != files.rend(); ++file) {
    try {
      return read_checkpoint(*file);
    } catch (const DataError& error) {
      spdlog::warn("{}", error.what());
    }
  }
  throw DataError(fmt::format("The run folder {} holds no valid checkpoint: start the run anew",
                              path.string()));
}

void remove_old_checkpoints(const std::filesystem::path& run_folder,
                            int keep,
                            std::int64_t iteration) {
  std::vector<std::filesystem::path> files = list_checkpoints(run_folder);
  const std::filesystem::path newest = checkpoint_path(run_folder, iteration);
  std::erase_if(files, [&](const std::filesystem::path& file) { return file > newest; });
  for (std::size_t i = 0; i + static_cast<std::size_t>(std::max(keep, 1)) < files.size(); ++i) {
    std::error_code error;
    std::filesystem::remove(files[i], error);
  }
}

}  // namespace raysplats
