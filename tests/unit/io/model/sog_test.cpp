// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "deflated_zip.hpp"
#include "io/image/webp_texture.hpp"
#include "io/zip_archive.hpp"
#include "scene/morton_order.hpp"
#include "unit/io/model_bytes.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

using Json = nlohmann::json;
using Files = std::vector<std::pair<std::string, std::vector<std::byte>>>;

std::vector<std::byte> bytes_of_text(const std::string& text) {
  const auto span = as_span(text);
  return {span.begin(), span.end()};
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

/// A texture of 4x4 that begins with these texels.
std::vector<std::byte> picture(const std::vector<int>& texels,
                               std::size_t width = 4,
                               std::size_t height = 4) {
  io::Texture texture{width, height, std::vector<std::uint8_t>(4 * width * height, 255)};
  for (std::size_t i = 0; i < texels.size(); ++i)
    texture.rgba[i] = static_cast<std::uint8_t>(texels[i]);
  return io::encode_texture(texture);
}

/// Level i of the codebook is first + i * step.
Json levels(double first, double step) {
  Json out = Json::array();
  for (int i = 0; i < 256; ++i) out.push_back(first + step * i);
  return out;
}

/// Two Gaussians of degree 1 whose numbers follow from the layout by hand.
struct Sog {
  Json meta{
      {"version", 2},
      {"count", 2},
      {"means",
       {{"mins", {-1.0, 0.0, 0.0}}, {"maxs", {1.0, 0.5, 65535.0 / 4096}}, {"files", {"l", "u"}}}},
      {"scales", {{"codebook", levels(-10, 0.0625)}, {"files", {"s"}}}},
      {"quats", {{"files", {"q"}}}},
      {"sh0", {{"codebook", levels(-2, 0.015625)}, {"files", {"c"}}}},
      {"shN",
       {{"count", 66}, {"bands", 1}, {"codebook", levels(-1, 0.0078125)}, {"files", {"n", "i"}}}}};
  Files files;

  Sog() {
    // The first at the least x, no y, and z of 0x0140 steps of 1/4096; the second at the most.
    files.emplace_back("l", picture({0, 0, 0x40, 255, 255, 255, 0, 255}));
    files.emplace_back("u", picture({0, 0, 0x01, 255, 255, 255, 0, 255}));
    files.emplace_back("s", picture({0, 16, 160, 255, 255, 1, 2, 255}));
    // w is the largest, then y: x, y, z and w, x, z.
    files.emplace_back("q", picture({255, 0, 128, 252, 128, 128, 204, 254}));
    files.emplace_back("c", picture({0, 128, 192, 51, 129, 127, 255, 0}));
    // Entry 65 is the second of the second row of three texels each.
    std::vector<int> centroids(static_cast<std::size_t>(4 * 192 * 2), 128);
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t c = 0; c < 3; ++c)
        centroids[4 * (192 + 3 + k) + c] = static_cast<int>(136 + 8 * (3 * k + c));
    }
    files.emplace_back("n", picture(centroids, 192, 2));
    files.emplace_back("i", picture({65, 0, 0, 255, 0, 0, 0, 255}));
  }
  /// As PlayCanvas's sogs wrote it before versions were counted.
  void make_first() {
    meta.erase("version");
    meta.erase("count");
    meta["means"]["shape"] = {2, 3};
    meta["scales"] = {{"mins", {-10, -8, -6}}, {"maxs", {0, 0, 4}}, {"files", {"s"}}};
    meta["quats"]["encoding"] = "quaternion_packed";
    meta["sh0"] = {{"mins", {-2, -1, 0, -4}}, {"maxs", {0, 1, 3, 6}}, {"files", {"c"}}};
    meta["shN"] = {{"mins", -0.5}, {"maxs", 0.5}, {"quantization", 8}, {"files", {"n", "i"}}};
  }
  std::string archive() const {
    Files all = files;
    all.emplace_back("meta.json", bytes_of_text(meta.dump()));
    return text_of(io::zip_of(all, "test"));
  }
};

Gaussians read(const std::string& bytes) {
  const Scratch scratch;
  write_bytes(scratch / "a.sog", bytes);
  return read_model(scratch / "a.sog");
}

std::string error_of(const Sog& sog) {
  return data_error([&] { read(sog.archive()); });
}

void check_known(const Gaussians& model) {
  REQUIRE(model.size() == 2);
  REQUIRE(model.sh_degree == 1);
  const double e = std::exp(1.0);
  CHECK(farthest(model.means,
                 {static_cast<float>(1 - e), 0.0f, static_cast<float>(std::expm1(0x140 / 4096.0)),
                  static_cast<float>(e - 1), static_cast<float>(std::expm1(0.5)), 0.0f}) < 1e-5);
  CHECK(model.log_scales == std::vector<float>{-10, -9, 0, 5.9375, -9.9375, -9.875});
  const double half = std::sqrt(0.5), bit = (128 / 255.0 - 0.5) * std::sqrt(2.0);
  CHECK(model.quaternions[1] == doctest::Approx(half));
  CHECK(model.quaternions[2] == doctest::Approx(-half));
  CHECK(model.quaternions[3] == doctest::Approx(bit));
  CHECK(model.quaternions[0] == doctest::Approx(0.0).epsilon(0.01));
  CHECK(model.quaternions[4] == doctest::Approx(bit));
  CHECK(model.quaternions[7] == doctest::Approx((204 / 255.0 - 0.5) * std::sqrt(2.0)));
  CHECK(model.quaternions[6] > 0.9f);
  CHECK(model.opacities[0] == doctest::Approx(std::log(0.2 / 0.8)));
  CHECK(model.opacities[1] < -6.0f);
  CHECK(std::vector<float>(model.sh.begin(), model.sh.begin() + 3) == std::vector<float>{-2, 0, 1});
  for (int k = 0; k < 9; ++k) {
    CHECK(model.sh[static_cast<std::size_t>(3 + k)] == static_cast<float>((8 + 8 * k) / 128.0));
    CHECK(model.sh[static_cast<std::size_t>(15 + k)] == 0.0f);
  }
}

}  // namespace

TEST_CASE("SOG: known textures are read, from a zip archive and unpacked") {
  const Sog sog;
  check_known(read(sog.archive()));
  const Scratch scratch;
  for (const auto& [name, bytes] : sog.files) write_bytes(scratch / name, text_of(bytes));
  write_bytes(scratch / "meta.json", sog.meta.dump());
  check_known(read_model(scratch / "meta.json"));
  check_known(read_model(scratch.path()));
}

TEST_CASE("SOG: archives of other writers leave sizes out of local headers, or deflate") {
  std::string archive = Sog().archive();
  // Bit 3 of the flags, no checksum and no sizes in front of the first file.
  archive[6] = 8;
  for (std::size_t i = 14; i < 26; ++i) archive[i] = 0;
  check_known(read(archive));

  const Sog sog;
  Files all = sog.files;
  all.emplace_back("meta.json", bytes_of_text(sog.meta.dump()));
  check_known(read(text_of(deflated_zip(all))));
}

TEST_CASE("SOG: an archive may hold its folder, and one of PyTorch's is named as such") {
  const Sog sog;
  const auto packed = [&](const std::string& folder, Files all) {
    for (const auto& [name, bytes] : sog.files) all.emplace_back(folder + name, bytes);
    all.emplace_back(folder + "meta.json", bytes_of_text(sog.meta.dump()));
    return text_of(io::zip_of(all, "test"));
  };
  check_known(read(packed("scan/", {})));
  check_known(read(packed("./", {})));
  check_known(read(packed("scan/", {{"__MACOSX/meta.json", {}}, {"notes.txt", {}}})));
  CHECK(contains(data_error([&] {
                   read(packed("scan/", {{"other/meta.json", {}}}));
                 }),
                 "'meta.json' in it is missing"));
  const std::string checkpoint = text_of(
      io::zip_of({{"archive/data.pkl", bytes_of_text("x")}, {"archive/data/0", {}}}, "test"));
  CHECK(contains(data_error([&] { read(checkpoint); }), "is a checkpoint of PyTorch"));
}

TEST_CASE("SOG: what its archive claims to inflate to is compared with the archive") {
  const std::string text(5000, 'x');
  std::vector<std::byte> zip = deflated_zip({{"a", bytes_of_text(text)}});
  CHECK(text_of(io::ZipArchive(zip, "test").read("a")) == text);
  CHECK(contains(data_error([&] { io::ZipArchive(zip, "test").read("b"); }), "is missing"));
  const auto claim = [&](std::uint32_t bytes) {
    std::memcpy(zip.data() + zip.size() - kZipEnd - kZipRecord - 1 + kZipSize, &bytes, 4);
    return data_error([&] { io::ZipArchive(zip, "test").read("a"); });
  };
  CHECK(contains(claim(4999), "is damaged"));
  CHECK(contains(claim(0xfffffffe), "more than its"));
  // Honest, but each a thousandth of what it holds.
  const std::vector<std::byte> zeros(std::size_t{1} << 20);
  CHECK(contains(data_error([&] {
                   io::ZipArchive(deflated_zip({{"a", zeros}, {"b", zeros}}), "test");
                 }),
                 "more than its"));
}

TEST_CASE("SOG: an archive of Zip64 is refused as such") {
  const std::string archive = Sog().archive();
  // The number of files, and the place of the directory.
  for (const auto& [at, bytes] : {std::pair(12, 2), std::pair(6, 4)}) {
    std::string large = archive;
    large.replace(large.size() - static_cast<std::size_t>(at), static_cast<std::size_t>(bytes),
                  std::string(static_cast<std::size_t>(bytes), '\xff'));
    CHECK(contains(data_error([&] { read(large); }), "is a Zip64"));
  }
}

TEST_CASE("SOG: a count has to be borne out by the disk, not by what inflates from it") {
  const Scratch scratch;
  Sog sog;
  // Pictures that deflate to nothing, and that are none.
  for (auto& [name, bytes] : sog.files) bytes.assign(100000, std::byte{0});
  sog.meta["count"] = 400000;
  Files all = sog.files;
  all.emplace_back("meta.json", bytes_of_text(sog.meta.dump()));
  CHECK(contains(data_error([&] { read(text_of(deflated_zip(all))); }), "bytes can hold"));
  // An unpacked one, whose pictures are of a few bytes.
  for (const auto& [name, bytes] : Sog().files) write_bytes(scratch / name, text_of(bytes));
  write_bytes(scratch / "meta.json", sog.meta.dump());
  CHECK(contains(data_error([&] { read_model(scratch / "meta.json"); }), "bytes can hold"));
  // One file for all pictures would be as many times its size.
  sog = Sog();
  sog.meta["means"]["files"][1] = "l";
  CHECK(contains(error_of(sog), "twice"));
  sog = Sog();
  sog.meta["comment"] = std::string(1100000, 'x');
  CHECK(contains(error_of(sog), "meta.json has"));
}

TEST_CASE("SOG: equal Gaussians, which pack best, are read again") {
  const Scratch scratch;
  for (const std::size_t count : {200000u, 300000u}) {
    Gaussians model;
    model.resize(count);
    write_model(scratch / "a.sog", model);
    CHECK(read_model(scratch / "a.sog").size() == count);
  }
}

TEST_CASE("SOG: round trips stay within the steps of the format at every degree and size") {
  const Scratch scratch;
  for (const std::size_t count : {0u, 1u, 4u, 255u, 256u, 257u, 3000u}) {
    const int degree = static_cast<int>(count % 4);
    const Gaussians model = in_morton_order(trained_like(count, degree));
    write_model(scratch / "a.sog", model);
    const Gaussians again = read_model(scratch / "a.sog");
    REQUIRE(again.size() == count);
    CAPTURE(count);
    if (count > 0) CHECK(again.sh_degree == degree);
    for (std::size_t i = 0; i < model.means.size(); ++i) {
      // Of at most six units of the logarithm.
      const double step = 6.0 / 65535 * (1 + std::abs(static_cast<double>(model.means[i])));
      CHECK(std::abs(again.means[i] - model.means[i]) < step);
    }
    // At most 256 numbers are kept as they are.
    CHECK(farthest(again.log_scales, model.log_scales) < (count <= 85 ? 1e-12 : 0.1));
    CHECK(farthest_rotation(again.quaternions, model.quaternions) < 3e-5);
    if (count <= 4) CHECK(farthest(again.sh, model.sh) == 0.0);
  }
  Gaussians model = trained_like(3, 4);
  write_model(scratch / "a.sog", model);
  CHECK(read_model(scratch / "a.sog").sh_degree == 3);
}

TEST_CASE("SOG: harmonics of many Gaussians are near the entries that stand for them") {
  const Scratch scratch;
  const Gaussians model = in_morton_order(trained_like(5000, 1));
  write_model(scratch / "a.sog", model);
  const Gaussians again = read_model(scratch / "a.sog");
  double error = 0, norm = 0;
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 3; k < 12; ++k) {
      const double a = again.sh[12 * i + k], b = model.sh[12 * i + k];
      error += (a - b) * (a - b);
      norm += b * b;
    }
  }
  // 4096 entries for 5000 vectors without any structure.
  CHECK(error < 0.1 * norm);
  CHECK(error > 0.0);
}

TEST_CASE("SOG: what does not fit together is refused by name") {
  const auto refused = [](const auto& change) {
    Sog sog;
    change(sog);
    return error_of(sog);
  };
  CHECK(contains(refused([](Sog& s) { s.meta["version"] = 1; }), "version is 1"));
  CHECK(contains(refused([](Sog& s) { s.meta.erase("version"); }), "'version' is missing"));
  CHECK(contains(refused([](Sog& s) { s.meta["count"] = 4000000000; }), "more than"));
  CHECK(contains(refused([](Sog& s) { s.meta["count"] = -1; }), "count is -1"));
  CHECK(contains(refused([](Sog& s) { s.meta["count"] = 17; }), "texels"));
  CHECK(contains(refused([](Sog& s) { s.meta["scales"]["codebook"].erase(0); }), "256 numbers"));
  CHECK(contains(refused([](Sog& s) { s.meta["sh0"]["codebook"][3] = 1e300; }), "finite"));
  CHECK(contains(refused([](Sog& s) { s.meta["means"]["maxs"][0] = 1e3; }), "not finite"));
  CHECK(contains(refused([](Sog& s) { s.meta["shN"]["bands"] = 4; }), "4 bands"));
  CHECK(contains(refused([](Sog& s) { s.meta["shN"]["count"] = 65; }), "no entry"));
  CHECK(contains(refused([](Sog& s) { s.meta["shN"]["count"] = 65537; }), "65537 palette"));
  for (const char* name : {"../q", "/etc/passwd", ".hidden", ""}) {
    CHECK(contains(refused([&](Sog& s) { s.meta["quats"]["files"][0] = name; }),
                   "something else than a file"));
  }
  CHECK(contains(refused([](Sog& s) { s.files.pop_back(); }), "is missing"));
  // Sixteen thousand texels a side out of some bytes.
  CHECK(contains(refused([](Sog& s) { s.files[2].second = picture({}, 16000, 1); }), "texels"));
  CHECK(contains(refused([](Sog& s) {
                   s.files[3].second = picture({0, 0, 0, 251});
                 }),
                 "no largest part"));
  CHECK(contains(refused([](Sog& s) { s.files[3].second = bytes_of_text("RIFF"); }), "WebP"));
}

TEST_CASE("SOG: the first version has ranges in place of codebooks, and no number") {
  Sog sog;
  const double e = std::exp(1.0), root = std::sqrt(2.0);
  sog.make_first();
  const auto check = [&](const Gaussians& model) {
    REQUIRE(model.size() == 2);
    REQUIRE(model.sh_degree == 1);
    CHECK(farthest(model.means,
                   {static_cast<float>(1 - e), 0.0f, static_cast<float>(std::expm1(0x140 / 4096.0)),
                    static_cast<float>(e - 1), static_cast<float>(std::expm1(0.5)), 0.0f}) < 1e-5);
    // From -10 to 0, -8 to 0 and -6 to 4, each axis by itself.
    CHECK(farthest(model.log_scales, {-10.0f, static_cast<float>(-8 + 8 * 16 / 255.0),
                                      static_cast<float>(-6 + 10 * 160 / 255.0), 0.0f,
                                      static_cast<float>(-8 + 8 * 1 / 255.0),
                                      static_cast<float>(-6 + 10 * 2 / 255.0)}) < 1e-6);
    CHECK(model.quaternions[1] == doctest::Approx(0.5 * root));
    CHECK(model.quaternions[7] == doctest::Approx((204 / 255.0 - 0.5) * root));
    // Logits from -4 to 6.
    CHECK(model.opacities[0] == doctest::Approx(-4 + 10 * 51 / 255.0));
    CHECK(model.opacities[1] == doctest::Approx(-4.0));
    CHECK(model.sh[0] == -2.0f);
    CHECK(model.sh[1] == doctest::Approx(-1 + 2 * 128 / 255.0));
    CHECK(model.sh[2] == doctest::Approx(3 * 192 / 255.0));
    for (int k = 0; k < 9; ++k) {
      const auto at = static_cast<std::size_t>(3 + k);
      CHECK(model.sh[at] == doctest::Approx(-0.5 + (136 + 8 * k) / 255.0));
      CHECK(model.sh[at + 12] == doctest::Approx(-0.5 + 128 / 255.0));
    }
  };
  check(read(sog.archive()));
  const Scratch scratch;
  for (const auto& [name, bytes] : sog.files) write_bytes(scratch / name, text_of(bytes));
  write_bytes(scratch / "meta.json", sog.meta.dump());
  check(read_model(scratch / "meta.json"));
  sog.meta.erase("shN");
  CHECK(read(sog.archive()).sh_degree == 0);
}

TEST_CASE("SOG: the first version is held to what its pictures bear out") {
  const auto refused = [](const auto& change) {
    Sog sog;
    sog.make_first();
    change(sog);
    return error_of(sog);
  };
  // As gsplat compresses.
  CHECK(contains(refused([](Sog& s) { s.meta["quats"].erase("encoding"); }), "quaternion_packed"));
  CHECK(contains(refused([](Sog& s) { s.meta["sh0"]["mins"].erase(0); }), "no list of 4 numbers"));
  CHECK(contains(refused([](Sog& s) { s.meta["means"]["shape"] = 2; }), "'shape' is no list"));
  CHECK(contains(refused([](Sog& s) { s.meta["means"]["shape"][0] = 2.5; }), "no whole number"));
  CHECK(contains(refused([](Sog& s) { s.meta["means"]["shape"][0] = -2; }), "count is -2"));
  CHECK(contains(refused([](Sog& s) { s.meta["means"]["shape"][0] = 17; }), "texels"));
  CHECK(contains(refused([](Sog& s) { s.meta["means"]["shape"][0] = 4000000000; }), "more than"));
  CHECK(contains(refused([](Sog& s) { s.meta["scales"]["maxs"][1] = nullptr; }), "finite"));
  CHECK(contains(refused([](Sog& s) { s.meta["shN"]["mins"] = "0"; }), "finite"));
  CHECK(contains(refused([](Sog& s) { s.meta["shN"].erase("maxs"); }), "'maxs' is missing"));
  CHECK(contains(refused([](Sog& s) { s.files[5].second = picture({}, 256, 2); }),
                 "palette is 256 wide"));
  CHECK(contains(refused([](Sog& s) { s.files[5].second = picture({}, 192, 1); }), "no entry"));
}

TEST_CASE("SOG: a codebook whose least level is missing goes one mean step below the next") {
  Sog sog;
  sog.meta["scales"]["codebook"][0] = nullptr;
  const Gaussians model = read(sog.archive());
  // Levels -9.9375 to 5.9375.
  CHECK(model.log_scales[0] == doctest::Approx(-9.9375 - 15.875 / 255));
  CHECK(model.log_scales[1] == -9.0f);
  sog.meta["scales"]["codebook"][1] = nullptr;
  CHECK(contains(error_of(sog), "finite"));
}

TEST_CASE("SOG: damage ends in one sentence") {
  // The end of a picture, the pictures' heads, meta.json and the directory: all but the codebooks.
  Sog sog;
  sog.meta.erase("shN");
  sog.files.resize(5);
  Files files = sog.files;
  const std::string whole = sog.archive();
  REQUIRE(read(whole).sh_degree == 0);
  std::string archive = whole;
  std::size_t refused = 0;
  for (std::size_t at = 0; at<archive.size(); at += archive.size()> 4000 ? 7 : 1) {
    std::string damaged = archive;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << at % 8));
    const std::string message = data_error([&] { read(damaged); });
    if (message.empty()) continue;
    ++refused;
    CHECK(contains(message, "a.sog"));
    CHECK(!contains(message, "\n"));
  }
  CHECK(refused > 100);
  for (std::size_t length = 0; length < archive.size(); length += 13)
    CHECK(!data_error([&] { read(archive.substr(0, length)); }).empty());
}
