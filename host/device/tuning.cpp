// SPDX-License-Identifier: Apache-2.0
#include "device/tuning.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "device/program_cache.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/json_text.hpp"

namespace raysplats {
namespace {

constexpr const char* kSchema = "raysplats-tuning";
constexpr int kSchemaVersion = 1;
constexpr std::uintmax_t kMaxBytes = std::uintmax_t{1} << 20;
constexpr std::array<int, 5> kWidths{1, 2, 4, 8, 16};
constexpr std::array<int, 4> kGroupWidths{8, 16, 32, 64};
constexpr std::array<int, 4> kTiles{8, 16, 32, 64};
constexpr int kMaxPending = 1024;
constexpr std::uint64_t kMaxNumber = 1 << 20;

using Entry = TuningStore::Entry;

// What a driver says, as the file can hold it: what is no UTF-8 in it becomes U+FFFD.
std::string storable(const std::string& said) {
  using Json = nlohmann::json;
  return Json::parse(json_text(Json(said))).get<std::string>();
}

Entry entry_of(const DeviceInfo& device, const DeviceTuning& tuning) {
  return {storable(device.name), storable(device.platform), storable(device.driver_version),
          RAYSPLATS_VERSION, tuning};
}

bool is_device(const Entry& entry, const DeviceInfo& device) {
  return entry.device == storable(device.name) && entry.platform == storable(device.platform);
}

bool is_current(const Entry& entry, const DeviceInfo& device) {
  return is_device(entry, device) && entry.driver == storable(device.driver_version) &&
         entry.version == RAYSPLATS_VERSION;
}

// Conversions of numbers out of range would wrap or be undefined.
int whole_number(const nlohmann::json& json, const char* key) {
  const nlohmann::json& value = json.at(key);
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > kMaxNumber) {
    throw DataError(std::string("'") + key + "' is no whole number in its range");
  }
  return value.get<int>();
}

Entry entry_from(const nlohmann::json& json) {
  Entry entry;
  entry.device = json.at("device").get<std::string>();
  entry.platform = json.at("platform").get<std::string>();
  entry.driver = json.at("driver").get<std::string>();
  entry.version = json.at("raysplats").get<std::string>();
  // Files of older versions know vectors alone.
  const std::string shape = json.value("packet_shape", std::string("vector"));
  entry.tuning.grouped = shape != "vector";
  entry.tuning.subgroups = shape == "subgroup";
  if (shape != packet_shape_of(entry.tuning)) throw DataError("'packet_shape' is none");
  entry.tuning.packet_width = whole_number(json, "packet_width");
  entry.tuning.tile = whole_number(json, "tile");
  entry.tuning.pending = whole_number(json, "pending");
  entry.tuning.group = whole_number(json, "group");
  entry.tuning.bvh = json.value("bvh", false);  // files of older versions have none
  if (!is_valid(entry.tuning)) throw DataError("a value is out of range");
  return entry;
}

// Empty when there is no file. Throws std::exception.
std::vector<Entry> parse_entries(const std::filesystem::path& path) {
  std::error_code error;
  if (path.empty() || !std::filesystem::exists(path, error)) return {};
  if (std::filesystem::file_size(path) > kMaxBytes) throw DataError("it is too large");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw DataError("it cannot be read");
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  const nlohmann::json json = nlohmann::json::parse(text);
  if (json.at("schema") != kSchema || json.at("schema_version") != kSchemaVersion) {
    throw DataError("it has another format");
  }
  std::vector<Entry> entries;
  for (const nlohmann::json& entry : json.at("devices")) entries.push_back(entry_from(entry));
  return entries;
}

std::vector<Entry> read_entries(const std::filesystem::path& path) {
  try {
    return parse_entries(path);
  } catch (const std::exception& error) {
    spdlog::warn("The tuning in {} is ignored ({}): 'raysplats tune' makes a new one",
                 path.string(), error.what());
    return {};
  }
}

void write_entries(const std::filesystem::path& path, const std::vector<Entry>& entries) {
  nlohmann::ordered_json devices = nlohmann::ordered_json::array();
  for (const Entry& entry : entries) {
    devices.push_back({{"device", entry.device},
                       {"platform", entry.platform},
                       {"driver", entry.driver},
                       {"raysplats", entry.version},
                       {"packet_shape", packet_shape_of(entry.tuning)},
                       {"packet_width", entry.tuning.packet_width},
                       {"tile", entry.tuning.tile},
                       {"pending", entry.tuning.pending},
                       {"group", entry.tuning.group},
                       {"bvh", entry.tuning.bvh}});
  }
  const nlohmann::ordered_json json{
      {"schema", kSchema}, {"schema_version", kSchemaVersion}, {"devices", devices}};
  write_text_file(path, json.dump(2) + "\n");
}

}  // namespace

const char* packet_shape_of(const DeviceTuning& tuning) {
  if (!tuning.grouped) return "vector";
  return tuning.subgroups ? "subgroup" : "group";
}

bool is_valid(const DeviceTuning& tuning) {
  const auto is_one_of = [&](const auto& widths) {
    return std::find(widths.begin(), widths.end(), tuning.packet_width) != widths.end();
  };
  return (tuning.grouped || !tuning.subgroups) &&
         (tuning.grouped ? is_one_of(kGroupWidths) : is_one_of(kWidths)) &&
         std::find(kTiles.begin(), kTiles.end(), tuning.tile) != kTiles.end() &&
         tuning.pending >= 1 && tuning.pending <= kMaxPending && tuning.group >= 0;
}

TuningStore::TuningStore(const std::string& directory) {
  const std::filesystem::path folder =
      directory.empty() ? default_cache_directory() : std::filesystem::path(directory);
  if (!folder.empty()) path_ = folder / "tuning.json";
  entries_ = read_entries(path_);
}

std::optional<DeviceTuning> TuningStore::find(const DeviceInfo& device) const {
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return is_current(entry, device); });
  return found == entries_.end() ? std::nullopt : std::optional(found->tuning);
}

void TuningStore::store(const DeviceInfo& device, const DeviceTuning& tuning) {
  if (path_.empty()) {
    throw DataError("There is no directory for the tuning: set HOME or XDG_CACHE_HOME");
  }
  // Another process may have measured meanwhile.
  entries_ = read_entries(path_);
  std::erase_if(entries_, [&](const Entry& entry) { return is_current(entry, device); });
  entries_.push_back(entry_of(device, tuning));
  std::error_code error;
  std::filesystem::create_directories(path_.parent_path(), error);
  write_entries(path_, entries_);
}

std::size_t TuningStore::remove(const DeviceInfo& device) {
  try {
    parse_entries(path_);
  } catch (const std::exception&) {
    // Nobody can tell whose tunings a damaged file has, and it is ignored with a warning each time.
    std::error_code error;
    return std::filesystem::remove(path_, error) ? 1 : 0;
  }
  const std::size_t removed =
      std::erase_if(entries_, [&](const Entry& entry) { return is_device(entry, device); });
  if (removed > 0) write_entries(path_, entries_);
  return removed;
}

}  // namespace raysplats
