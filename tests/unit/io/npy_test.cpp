// SPDX-License-Identifier: Apache-2.0
#include "io/npy_file.hpp"

#include <doctest/doctest.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <string>

#include "io/byte_reader.hpp"
#include "io/scene/ray_file.hpp"
#include "raysplats/error.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

template <class T>
std::string raw(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// A .npy file of version 1 with this header, as NumPy writes it but for the padding.
std::string npy(const std::string& header, const std::string& data) {
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(header.size() & 0xff);
  out += static_cast<char>(header.size() >> 8);
  return out + header + data;
}

std::string header(const std::string& type, const std::string& order, const std::string& shape) {
  return "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }\n";
}

std::string why_refused(const fs::path& path, const std::string& bytes, bool rays = false) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  try {
    if (rays) {
      io::read_rays(path);
    } else {
      io::read_npy(path);
    }
  } catch (const DataError& error) {
    const std::string text = error.what();
    CHECK(text.find(path.string()) == 0);
    CHECK(text.find('\n') == std::string::npos);
    return text;
  }
  return "";
}

std::size_t number(const std::string& bytes, std::size_t at, int size) {
  std::size_t out = 0;
  for (int i = 0; i < size; ++i) {
    out |= static_cast<std::size_t>(
               static_cast<unsigned char>(bytes[at + static_cast<std::size_t>(i)]))
           << (8 * i);
  }
  return out;
}

// The stored files of a zip archive by its directory, checksums verified.
std::map<std::string, std::string> unzip(const std::string& zip) {
  std::map<std::string, std::string> out;
  const std::size_t end = zip.size() - 22;
  REQUIRE(zip.substr(end, 4) == std::string("PK\x05\x06"));
  std::size_t at = number(zip, end + 16, 4);
  CHECK(at + number(zip, end + 12, 4) == end);
  for (std::size_t left = number(zip, end + 10, 2); left > 0; --left) {
    REQUIRE(zip.substr(at, 4) == std::string("PK\x01\x02"));
    CHECK(number(zip, at + 10, 2) == 0);
    const std::size_t size = number(zip, at + 24, 4), name_size = number(zip, at + 28, 2);
    const std::size_t local = number(zip, at + 42, 4);
    const std::string name = zip.substr(at + 46, name_size);
    REQUIRE(zip.substr(local, 4) == std::string("PK\x03\x04"));
    CHECK(zip.substr(local + 30, name_size) == name);
    CHECK(number(zip, local + 14, 4) == number(zip, at + 16, 4));
    const std::string content =
        zip.substr(local + 30 + name_size + number(zip, local + 28, 2), size);
    CHECK(number(zip, at + 16, 4) ==
          crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(size)));
    out[name] = content;
    at += 46 + name_size;
  }
  return out;
}

}  // namespace

TEST_CASE("arrays of both widths, every version and any rank are read") {
  const TemporaryDirectory scratch;
  const fs::path path = scratch.path() / "a.npy";
  const auto read = [&](const std::string& bytes) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    return io::read_npy(path);
  };
  const std::vector<float> six{1, 2, 3, 4, 5, -6.5f};
  io::NpyArray array = read(npy(header("<f4", "False", "(2, 3)"), raw(six)));
  CHECK(array.shape == std::vector<std::size_t>{2, 3});
  CHECK(array.data == six);
  array =
      read(npy(header("<f8", "False", "(6,)"), raw(std::vector<double>(six.begin(), six.end()))));
  CHECK(array.shape == std::vector<std::size_t>{6});
  CHECK(array.data == six);
  array = read(npy(header("<f4", "False", "()"), raw(std::vector<float>{7})));
  CHECK(array.shape.empty());
  CHECK(array.data == std::vector<float>{7});
  CHECK(read(npy(header("<f4", "False", "(0, 6)"), "")).data.empty());
  // Version 2 has four bytes of length.
  const std::string text = header("<f4", "False", "(1,)");
  std::string second("\x93NUMPY\x02\x00", 8);
  second += static_cast<char>(text.size());
  second += std::string(3, '\0') + text + raw(std::vector<float>{8});
  CHECK(read(second).data == std::vector<float>{8});
}

TEST_CASE("arrays of every type of numbers, either byte order and either order are read") {
  const TemporaryDirectory scratch;
  const fs::path path = scratch.path() / "a.npy";
  const auto read = [&](const std::string& type, const std::string& bytes,
                        const std::string& order = "False", const std::string& shape = "(3,)") {
    std::ofstream(path, std::ios::binary | std::ios::trunc)
        << npy(header(type, order, shape), bytes);
    return io::read_npy(path).data;
  };
  const auto swapped = [](std::string bytes, std::size_t size) {
    for (std::size_t i = 0; i < bytes.size(); i += size)
      std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                   bytes.begin() + static_cast<std::ptrdiff_t>(i + size));
    return bytes;
  };
  const auto check = [&](const std::string& type, const std::string& bytes,
                         const std::vector<float>& expected) {
    CAPTURE(type);
    CHECK(read("<" + type, bytes) == expected);
    CHECK(read(">" + type, swapped(bytes, bytes.size() / 3)) == expected);
  };
  const std::vector<float> three{1, -2, 300};
  check("f4", raw(three), three);
  check("f8", raw(std::vector<double>{1, -2, 300}), three);
  // Sign, five bits of exponent and ten of mantissa (IEEE 754): 300 = 1.171875 x 2^8.
  check("f2", raw(std::vector<std::uint16_t>{0x3c00, 0xc000, 0x5cb0}), three);
  check("i2", raw(std::vector<std::int16_t>{1, -2, 300}), three);
  check("i4", raw(std::vector<std::int32_t>{1, -2, 300}), three);
  check("i8", raw(std::vector<std::int64_t>{1, -2, 300}), three);
  check("u2", raw(std::vector<std::uint16_t>{1, 65535, 300}), {1, 65535, 300});
  check("u4", raw(std::vector<std::uint32_t>{1, 1u << 31, 300}), {1, 2147483648.0f, 300});
  check("u8", raw(std::vector<std::uint64_t>{1, 1ull << 63, 300}),
        {1, 9223372036854775808.0f, 300});
  CHECK(read("|i1", raw(std::vector<std::int8_t>{1, -2, 3})) == std::vector<float>{1, -2, 3});
  CHECK(read("|u1", raw(std::vector<std::uint8_t>{1, 254, 3})) == std::vector<float>{1, 254, 3});
  const float infinity = std::numeric_limits<float>::infinity();
  const std::vector<float> odd =
      read("<f2", raw(std::vector<std::uint16_t>{0x7c00, 0xfc00, 0x7e00}));
  CHECK(odd[0] == infinity);
  CHECK(odd[1] == -infinity);
  CHECK(std::isnan(odd[2]));
  // Fortran's order: element (i, j, k) of shape (2, 3, 2) is number i + 2 j + 6 k of the file.
  std::vector<float> numbers, expected;
  for (int n = 0; n < 12; ++n) numbers.push_back(static_cast<float>(n));
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 2; ++k) expected.push_back(static_cast<float>(i + 2 * j + 6 * k));
    }
  }
  CHECK(read("<f4", raw(numbers), "True", "(2, 3, 2)") == expected);
  CHECK(read("<f4", raw(numbers), "True", "(12,)") == numbers);
  CHECK(read("<f4", "", "True", "(0, 3)").empty());
  CHECK(read("<f4", raw(std::vector<float>{7}), "True", "()") == std::vector<float>{7});
}

TEST_CASE("arrays that are not what they should be are refused in one sentence") {
  const TemporaryDirectory scratch;
  const fs::path path = scratch.path() / "a.npy";
  const std::string data = raw(std::vector<float>(12));
  const auto refused = [&](const std::string& bytes) { return why_refused(path, bytes); };
  CHECK(refused(npy(header("<f4", "False", "(2, 6)"), data)).empty());
  CHECK(refused("hello").find("no .npy file") != std::string::npos);
  for (const std::string type : {"<c8", "|b1", "<U4", "<f16", "f4", "=f4", "<M8", "", "<", "<f3"}) {
    CHECK(refused(npy(header(type, "False", "(2, 6)"), data)).find("'" + type + "'") !=
          std::string::npos);
  }
  CHECK(refused(npy(header("|O", "False", "(2, 6)"), data)).find("'|O'") != std::string::npos);
  CHECK(refused(npy(header("<f4", "False", "(3, 6)"), data)).find("48 bytes") != std::string::npos);
  CHECK(refused(npy(header("<f4", "False", "(1, 6)"), data)).find("48 bytes") != std::string::npos);
  CHECK(refused(npy(header("<f4", "False", "(4294967296, 4294967296)"), data)).find("48 bytes") !=
        std::string::npos);
  CHECK(refused(npy("{'descr': '<f4', 'shape': (2, 6)}", data)).find("damaged") !=
        std::string::npos);
  CHECK(refused(npy("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (2, 6)}", data))
            .find("damaged") != std::string::npos);
  CHECK(refused(npy("", data)).find("damaged") != std::string::npos);
  std::string ones = "(12, ";
  for (int i = 0; i < 64; ++i) ones += "1, ";
  CHECK(refused(npy(header("<f4", "True", ones + ")"), data)).find("65 dimensions") !=
        std::string::npos);
  std::string cut = npy(header("<f4", "False", "(2, 6)"), data);
  CHECK(refused(cut.substr(0, 20)).find("damaged") != std::string::npos);
  CHECK(!refused(cut.substr(0, 9)).empty());
  cut[6] = '\x09';
  CHECK(refused(cut).find("version 9") != std::string::npos);
  CHECK(why_refused(path, npy(header("<f4", "False", "(3, 4)"), data), true).find("(3, 4)") !=
        std::string::npos);
  CHECK(why_refused(path, npy(header("<f4", "False", "(12,)"), data), true).find("(12)") !=
        std::string::npos);
  CHECK_THROWS_AS(io::read_npy(scratch.path() / "none.npy"), DataError);
}

TEST_CASE("rays are read with and without ends, and results keep their shape") {
  const TemporaryDirectory scratch;
  const fs::path path = scratch.path() / "rays.npy";
  std::vector<float> numbers;
  for (int i = 0; i < 16; ++i) numbers.push_back(static_cast<float>(i));
  std::ofstream(path, std::ios::binary) << npy(header("<f4", "False", "(2, 1, 8)"), raw(numbers));
  const io::RayList list = io::read_rays(path);
  CHECK(list.shape == std::vector<std::size_t>{2, 1});
  REQUIRE(list.rays.size() == 2);
  CHECK(list.rays[1].origin[2] == 10);
  CHECK(list.rays[1].direction[0] == 11);
  CHECK(list.rays[1].t_min == 14);
  CHECK(list.rays[1].t_max == 15);
  numbers.resize(6);
  std::ofstream(path, std::ios::binary) << npy(header("<f4", "False", "(6,)"), raw(numbers));
  const io::RayList one = io::read_rays(path);
  CHECK(one.shape.empty());
  CHECK(one.rays.at(0).direction[2] == 5);
  CHECK(one.rays[0].t_min == 0);
  CHECK(one.rays[0].t_max == std::numeric_limits<float>::infinity());

  // From an origin that single precision would round by 0.25.
  const std::vector<double> far{400000.5, 5000000.25, 3, 0, 0.1, 1};
  std::ofstream(path, std::ios::binary) << npy(header("<f8", "False", "(6,)"), raw(far));
  const Ray moved = io::read_rays(path, {400000, 5000000, 5}).rays.at(0);
  CHECK(std::vector(moved.origin, moved.origin + 3) == std::vector<float>{0.5f, 0.25f, -2.0f});
  CHECK(std::vector(moved.direction, moved.direction + 3) == std::vector<float>{0, 0.1f, 1});

  std::vector<RayResult> results(2);
  results[0] = {{0.1f, 0.2f, 0.3f}, 0.4f, 5, 6, 7, 0};
  results[1] = {{1.1f, 1.2f, 1.3f}, 1.4f, 15, 16, 17, 1};
  const fs::path written = scratch.path() / "results.npz";
  io::write_ray_results(written, list.shape, results);
  const std::vector<std::byte> bytes = io::read_file(written);
  const auto files = unzip({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  CHECK(files.size() == 5);
  const auto array = [&](const std::string& name) {
    const fs::path member = scratch.path() / "member.npy";
    std::ofstream(member, std::ios::binary | std::ios::trunc) << files.at(name + ".npy");
    return io::read_npy(member);
  };
  CHECK(array("color").shape == std::vector<std::size_t>{2, 1, 3});
  CHECK(array("color").data == std::vector<float>{0.1f, 0.2f, 0.3f, 1.1f, 1.2f, 1.3f});
  CHECK(array("alpha").shape == list.shape);
  CHECK(array("alpha").data == std::vector<float>{0.4f, 1.4f});
  CHECK(array("depth").data == std::vector<float>{5, 15});
  CHECK(array("median_depth").data == std::vector<float>{6, 16});
  const std::string& hits = files.at("hits.npy");
  CHECK(hits.find("'<u4'") != std::string::npos);
  CHECK((hits.size() - 8) % 64 == 0);
  CHECK(number(hits, hits.size() - 8, 4) == 7);
  CHECK(number(hits, hits.size() - 4, 4) == 17);
}

TEST_CASE("the results of no rays are a whole archive") {
  const TemporaryDirectory scratch;
  const fs::path written = scratch.path() / "none.npz";
  io::write_ray_results(written, {0}, {});
  const std::vector<std::byte> bytes = io::read_file(written);
  const auto files = unzip({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  CHECK(files.size() == 5);
  CHECK(files.at("color.npy").find("(0, 3)") != std::string::npos);
}
