// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <limits>
#include <string>
#include <utility>

#include "io/byte_reader.hpp"
#include "io/gltf/gltf_document.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

/// A GLB counts its bytes in 32 bits, and so does tinygltf.
constexpr std::uint64_t kMaxBytes = 0xffffffff;

/// The first of tinygltf's messages without its line end and full stop.
std::string first_sentence(const std::string& messages) {
  std::string line = messages.substr(0, messages.find('\n'));
  while (!line.empty() && (line.back() == '.' || line.back() == ' ')) line.pop_back();
  return line.empty() ? "its content is damaged" : excerpt(line, 200);
}

void check_size(std::uint64_t bytes, const std::filesystem::path& path) {
  if (bytes <= kMaxBytes) return;
  throw DataError(
      fmt::format("{} has more than {} bytes: make it smaller", path.string(), kMaxBytes));
}

std::size_t component_size(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

template <class T>
T load(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// Normalized integers stand for value / largest, at least -1 (glTF 2.0, section 3.6.2.2).
template <class T>
float load_integer(const std::byte* bytes, bool normalized) {
  const auto value = static_cast<float>(load<T>(bytes));
  if (!normalized) return value;
  return std::max(value / static_cast<float>(std::numeric_limits<T>::max()), -1.0f);
}

/// How textures go on beyond their borders; what is no number repeats them.
std::vector<tinygltf::Sampler> take_samplers(GltfDocument& document) {
  std::vector<tinygltf::Sampler> samplers;
  const auto list = document.json.find("samplers");
  if (list == document.json.end()) return samplers;
  for (const nlohmann::json& from : *list) {
    tinygltf::Sampler& sampler = samplers.emplace_back();
    for (const auto& [key, wrap] :
         {std::pair{"wrapS", &sampler.wrapS}, std::pair{"wrapT", &sampler.wrapT}}) {
      if (from.is_object() && from.contains(key) && from[key].is_number_integer())
        *wrap = from[key].get<int>();
    }
  }
  document.json.erase(list);
  return samplers;
}

}  // namespace

tinygltf::Model parse_gltf(const std::filesystem::path& path) {
  return parse_gltf(path, read_file(path, kMaxBytes), false);
}

tinygltf::Model parse_gltf(const std::filesystem::path& path,
                           std::span<const std::byte> bytes,
                           bool alone) {
  check_size(bytes.size(), path);
  GltfDocument document = read_gltf_document(bytes, path);
  // tinygltf would take data: URIs of unknown media types for names of files, and with what is not
  // read here it finds faults that are none.
  GltfContent content = take_content(document, path, alone, kMaxBytes);
  std::vector<tinygltf::Sampler> samplers = take_samplers(document);
  for (const char* unread : {"animations", "cameras", "extensions", "skins"}) {
    document.json.erase(unread);
  }
  const std::string text = document.json.dump();
  check_size(text.size(), path);
  tinygltf::TinyGLTF loader;
  tinygltf::Model model;
  std::string errors;
  std::string warnings;
  bool parsed = false;
  try {
    parsed = loader.LoadASCIIFromString(&model, &errors, &warnings, text.data(),
                                        static_cast<unsigned>(text.size()), "");
  } catch (const std::exception& error) {
    errors = error.what();
  }
  // tinygltf leaves out primitives that it cannot parse, and only the message tells.
  if (!parsed || !errors.empty()) {
    throw DataError(
        fmt::format("{} is no valid glTF file: {}", path.string(), first_sentence(errors)));
  }
  model.buffers = std::move(content.buffers);
  model.images = std::move(content.images);
  model.samplers = std::move(samplers);
  return model;
}

void GltfReader::fail(const std::string& message) const {
  throw DataError(fmt::format("{} is no valid glTF file: {}", path_.string(), message));
}

std::span<const std::byte> GltfReader::view(int buffer_view) const {
  if (buffer_view < 0 || static_cast<std::size_t>(buffer_view) >= model_.bufferViews.size()) {
    fail(fmt::format("there is no buffer view {}", buffer_view));
  }
  const tinygltf::BufferView& view = model_.bufferViews[static_cast<std::size_t>(buffer_view)];
  if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= model_.buffers.size()) {
    fail(fmt::format("the buffer view {} has no buffer", buffer_view));
  }
  const auto& data = model_.buffers[static_cast<std::size_t>(view.buffer)].data;
  if (data.empty()) fail(fmt::format("the buffer {} has no bytes", view.buffer));
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset) {
    fail(fmt::format("the buffer view {} ends beyond its buffer of {} bytes", buffer_view,
                     data.size()));
  }
  return std::as_bytes(std::span(data)).subspan(view.byteOffset, view.byteLength);
}

GltfReader::Elements GltfReader::elements(int accessor, std::size_t components) const {
  if (accessor < 0 || static_cast<std::size_t>(accessor) >= model_.accessors.size()) {
    fail(fmt::format("there is no accessor {}", accessor));
  }
  const tinygltf::Accessor& from = model_.accessors[static_cast<std::size_t>(accessor)];
  if (from.sparse.isSparse) {
    throw DataError(fmt::format(
        "{} has the sparse accessor {}, which is not supported: export it as a full one",
        path_.string(), accessor));
  }
  const int has = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(from.type));
  const std::size_t number = component_size(from.componentType);
  if (has != static_cast<int>(components) || number == 0) {
    fail(fmt::format("the accessor {} has {} components of type {} where {} are needed", accessor,
                     has, from.componentType, components));
  }
  const std::span<const std::byte> bytes = view(from.bufferView);
  const std::size_t element = number * components;
  const std::size_t given =
      model_.bufferViews[static_cast<std::size_t>(from.bufferView)].byteStride;
  const std::size_t stride = given == 0 ? element : given;
  const std::size_t room = bytes.size() - std::min(from.byteOffset, bytes.size());
  if (stride < element ||
      (from.count > 0 && (room < element || from.count - 1 > (room - element) / stride))) {
    fail(
        fmt::format("the {} elements of the accessor {} do not lie within its buffer view of {} "
                    "bytes",
                    from.count, accessor, bytes.size()));
  }
  return {bytes.subspan(std::min(from.byteOffset, bytes.size())), stride, from.count,
          from.componentType, from.normalized};
}

std::vector<float> GltfReader::floats(int accessor, std::size_t components) const {
  const Elements from = elements(accessor, components);
  const std::size_t number = component_size(from.component_type);
  std::vector<float> values;
  values.reserve(from.count * components);
  for (std::size_t i = 0; i < from.count; ++i) {
    for (std::size_t c = 0; c < components; ++c) {
      const std::byte* at = from.bytes.data() + i * from.stride + c * number;
      switch (from.component_type) {
        case TINYGLTF_COMPONENT_TYPE_FLOAT:
          values.push_back(load<float>(at));
          break;
        case TINYGLTF_COMPONENT_TYPE_BYTE:
          values.push_back(load_integer<std::int8_t>(at, from.normalized));
          break;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
          values.push_back(load_integer<std::uint8_t>(at, from.normalized));
          break;
        case TINYGLTF_COMPONENT_TYPE_SHORT:
          values.push_back(load_integer<std::int16_t>(at, from.normalized));
          break;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
          values.push_back(load_integer<std::uint16_t>(at, from.normalized));
          break;
        default:
          fail(fmt::format("the accessor {} has integers where real numbers are needed", accessor));
      }
    }
  }
  return values;
}

std::vector<std::uint32_t> GltfReader::indices(int accessor) const {
  const Elements from = elements(accessor, 1);
  std::vector<std::uint32_t> values;
  values.reserve(from.count);
  for (std::size_t i = 0; i < from.count; ++i) {
    const std::byte* at = from.bytes.data() + i * from.stride;
    switch (from.component_type) {
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        values.push_back(load<std::uint8_t>(at));
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        values.push_back(load<std::uint16_t>(at));
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        values.push_back(load<std::uint32_t>(at));
        break;
      default:
        fail(fmt::format("the accessor {} of indices has no unsigned integers", accessor));
    }
  }
  return values;
}

std::span<const std::byte> GltfReader::image(int image) const {
  if (image < 0 || static_cast<std::size_t>(image) >= model_.images.size()) {
    fail(fmt::format("there is no image {}", image));
  }
  const tinygltf::Image& from = model_.images[static_cast<std::size_t>(image)];
  if (from.bufferView >= 0) return view(from.bufferView);
  if (from.image.empty()) {
    throw DataError(fmt::format("The image {} of {} does not exist or is empty",
                                from.uri.empty() ? std::to_string(image) : excerpt(from.uri),
                                path_.string()));
  }
  return std::as_bytes(std::span(from.image));
}

}  // namespace raysplats::io
