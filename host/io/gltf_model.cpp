// SPDX-License-Identifier: Apache-2.0
#include "io/gltf_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <limits>
#include <string>
#include <string_view>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::uint32_t kGlbMagic = 0x46546c67;  // "glTF"
/// tinygltf counts bytes in 32 bits.
constexpr std::uint64_t kMaxBytes = 0xffffffff;
constexpr int kMaxDepth = 64;

/// The folder of the file, and what has been read from it; many buffers may name one large file.
struct Folder {
  std::filesystem::path path;
  bool closed = false;  ///< nothing of it may be read
  std::uint64_t bytes = 0;
};

tinygltf::FsCallbacks file_access(Folder& folder) {
  tinygltf::FsCallbacks calls{};
  calls.FileExists = [](const std::string& name, void* data) {
    if (static_cast<Folder*>(data)->closed) {
      throw DataError(
          "The glTF file names other files, which are not read here: export it as one GLB");
    }
    std::error_code error;
    return std::filesystem::is_regular_file(static_cast<Folder*>(data)->path / name, error);
  };
  calls.ExpandFilePath = [](const std::string& name, void*) { return name; };
  calls.ReadWholeFile = [](std::vector<unsigned char>* out, std::string*, const std::string& name,
                           void* data) {
    auto& from = *static_cast<Folder*>(data);
    if (from.closed) return false;
    const auto bytes = read_file(from.path / name, kMaxBytes - from.bytes);
    from.bytes += bytes.size();
    const auto* begin = reinterpret_cast<const unsigned char*>(bytes.data());
    out->assign(begin, begin + bytes.size());
    return true;
  };
  calls.user_data = &folder;
  return calls;
}

/// Keeps the encoded content: only the images that are used get decoded. That of a buffer view is
/// where it is; tinygltf has not checked its range, so it must not be touched here.
bool keep_image(tinygltf::Image* image,
                int,
                std::string*,
                std::string*,
                int,
                int,
                const unsigned char* bytes,
                int size,
                void*) {
  if (image->bufferView < 0 && size > 0) image->image.assign(bytes, bytes + size);
  return true;
}

/// The JSON chunk of a GLB whose chunks lie within the file (glTF 2.0, section 4.4).
std::string_view glb_json(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  ByteReader reader(bytes, path);
  reader.skip(4, "the magic number");
  const auto version = reader.read<std::uint32_t>("the version");
  if (version != 2) {
    throw DataError(
        fmt::format("{} is glTF of version {}, but only 2 is known", path.string(), version));
  }
  const auto length = reader.read<std::uint32_t>("the length");
  if (length > bytes.size()) {
    throw DataError(
        fmt::format("{} is truncated: it has {} bytes of {}", path.string(), bytes.size(), length));
  }
  std::string_view json;
  while (reader.offset() < length) {
    const auto size = reader.read<std::uint32_t>("the length of a chunk");
    const auto type = reader.read<std::uint32_t>("the type of a chunk");
    if (json.empty()) {
      if (type != 0x4e4f534a) reader.fail("the first chunk holds no JSON");
      const std::size_t begin = reader.offset();
      reader.skip(size, "the JSON");
      json = {reinterpret_cast<const char*>(bytes.data()) + begin, size};
    } else {
      reader.skip(size, "a chunk");
    }
  }
  if (json.empty()) reader.fail("there is no JSON");
  return json;
}

/// Parsers of nested values call themselves, so that the depth is limited before they start.
void check_depth(std::string_view json, const std::filesystem::path& path) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '}' || c == ']') --depth;
    if ((c == '{' || c == '[') && ++depth > kMaxDepth) {
      throw DataError(
          fmt::format("{} is nested more than {} levels deep", path.string(), kMaxDepth));
    }
  }
}

/// The first of tinygltf's messages without its line end and full stop.
std::string first_sentence(const std::string& messages) {
  std::string line = messages.substr(0, messages.find('\n'));
  while (!line.empty() && (line.back() == '.' || line.back() == ' ')) line.pop_back();
  return line.empty() ? "its content is damaged" : line;
}

void check_extensions(const tinygltf::Model& model, const std::filesystem::path& path) {
  for (const std::string& name : model.extensionsRequired) {
    if (name.starts_with("KHR_materials_") || name == "KHR_texture_transform" ||
        name == "KHR_mesh_quantization" || name == "KHR_lights_punctual" ||
        name == "KHR_gaussian_splatting") {
      continue;
    }
    throw DataError(
        fmt::format("{} needs the extension {}, which is not supported: export it without",
                    path.string(), name));
  }
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

}  // namespace

tinygltf::Model parse_gltf(const std::filesystem::path& path) {
  return parse_gltf(path, read_file(path, kMaxBytes), false);
}

tinygltf::Model parse_gltf(const std::filesystem::path& path,
                           std::span<const std::byte> bytes,
                           bool alone) {
  if (bytes.size() > kMaxBytes) {
    throw DataError(
        fmt::format("{} has more than {} bytes: make it smaller", path.string(), kMaxBytes));
  }
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  const bool binary = bytes.size() >= 4 && load<std::uint32_t>(bytes.data()) == kGlbMagic;
  check_depth(binary ? glb_json(bytes, path) : std::string_view(text, bytes.size()), path);
  Folder folder{path.parent_path(), alone};
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(file_access(folder));
  loader.SetImageLoader(keep_image, nullptr);
  tinygltf::Model model;
  std::string errors;
  std::string warnings;
  bool parsed = false;
  const auto size = static_cast<unsigned>(bytes.size());
  try {
    parsed = binary
                 ? loader.LoadBinaryFromMemory(&model, &errors, &warnings,
                                               reinterpret_cast<const unsigned char*>(text), size)
                 : loader.LoadASCIIFromString(&model, &errors, &warnings, text, size, "");
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    errors = error.what();
  }
  // tinygltf leaves out primitives that it cannot parse, and only the message tells.
  if (!parsed || !errors.empty()) {
    throw DataError(
        fmt::format("{} is no valid glTF file: {}", path.string(), first_sentence(errors)));
  }
  check_extensions(model, path);
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
    throw DataError(
        fmt::format("The image {} of {} does not exist or is empty", from.uri, path_.string()));
  }
  return std::as_bytes(std::span(from.image));
}

}  // namespace raysplats::io
