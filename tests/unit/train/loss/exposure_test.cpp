// SPDX-License-Identifier: Apache-2.0
#include "train/loss/exposure.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 23;
constexpr int kHeight = 37;
constexpr std::size_t kPixels = kWidth * kHeight;
constexpr std::size_t kViews = 5;

std::vector<float> noise(std::size_t count, std::uint64_t stream, double low, double high) {
  CounterRng rng(3, stream);
  std::vector<float> out(count);
  for (float& value : out) value = static_cast<float>(low + (high - low) * rng.uniform());
  return out;
}

using Pixel = std::array<double, 4>;

// What photos' numbers become, in double precision.
struct Reference {
  std::size_t views;
  bool cut_out;
  std::vector<bool> waits;
  std::vector<double> deltas;

  explicit Reference(std::size_t count, bool transparent = false)
      : views(count), cut_out(transparent), waits(count, false), deltas(12 * count) {}

  static Pixel pixel_of(const std::vector<float>& image, std::size_t i) {
    Pixel out{};
    for (std::size_t c = 0; c < 4; ++c) out[c] = static_cast<double>(image[c * kPixels + i]);
    return out;
  }

  // What the numbers are of.
  Pixel light(const Pixel& x, const std::array<double, 3>& behind) const {
    if (!cut_out) return {x[0], x[1], x[2], 1};
    Pixel z = x;
    for (std::size_t c = 0; c < 3; ++c) z[c] -= (1 - x[3]) * behind[c];
    return z;
  }

  Pixel apply(const Pixel& x, std::size_t view, const std::array<double, 3>& behind) const {
    const Pixel z = light(x, behind);
    Pixel out = x;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 4; ++k) out[c] += deltas[12 * view + 4 * c + k] * z[k];
    }
    return out;
  }

  // dL of the pixel from dL of the result of apply(), by differences: that is linear.
  Pixel backward(const Pixel& slope,
                 const Pixel& x,
                 std::size_t view,
                 const std::array<double, 3>& behind) const {
    Pixel out{};
    for (std::size_t k = 0; k < 4; ++k) {
      Pixel more = x, less = x;
      more[k] += 0.5;
      less[k] -= 0.5;
      const Pixel up = apply(more, view, behind), down = apply(less, view, behind);
      for (std::size_t c = 0; c < 4; ++c) out[k] += slope[c] * (up[c] - down[c]);
    }
    return out;
  }

  // The minimum of mean m |d z - (z[3] y - z)|^2 + damping |d - before|^2, by Gaussian elimination.
  // `photo` is R, G, B, A, weights, of which only what is cut out has the latter.
  void step(const std::vector<float>& image,
            const std::vector<double>& photo,
            const std::array<double, 3>& behind,
            std::size_t view,
            double damping) {
    const auto weight = [&](std::size_t i) {
      return photo[3 * kPixels + i] * (cut_out ? photo[4 * kPixels + i] : 1.0);
    };
    double all = 0;
    for (std::size_t i = 0; i < kPixels; ++i) all += weight(i);
    for (std::size_t c = 0; c < 3; ++c) {
      double* d = deltas.data() + 12 * view + 4 * c;
      double rows[4][5] = {};
      for (std::size_t i = 0; i < kPixels; ++i) {
        const double m = weight(i) / all;
        const Pixel z = light(pixel_of(image, i), behind);
        for (std::size_t a = 0; a < 4; ++a) {
          for (std::size_t b = 0; b < 4; ++b) rows[a][b] += m * z[a] * z[b];
          rows[a][4] += m * z[a] * (z[3] * photo[c * kPixels + i] - z[c]);
        }
      }
      for (std::size_t a = 0; a < 4; ++a) {
        rows[a][a] += damping;
        rows[a][4] += damping * d[a];
      }
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < 4; ++b) {
          if (a == b) continue;
          const double factor = rows[b][a] / rows[a][a];
          for (std::size_t k = a; k < 5; ++k) rows[b][k] -= factor * rows[a][k];
        }
      }
      for (std::size_t a = 0; a < 4; ++a) d[a] = rows[a][4] / rows[a][a];
    }
    const auto members = static_cast<double>(std::count(waits.begin(), waits.end(), false));
    for (std::size_t k = 0; k < 12; ++k) {
      double mean = 0;
      for (std::size_t v = 0; v < views; ++v) mean += waits[v] ? 0 : deltas[12 * v + k] / members;
      for (std::size_t v = 0; v < views; ++v) deltas[12 * v + k] -= waits[v] ? 0 : mean;
    }
  }
};

// Photos of every kind of words with their numbers, R, G, B, A and weights as the kernels read
// them.
struct Photo {
  std::vector<std::uint32_t> words;
  std::vector<double> numbers = std::vector<double>(5 * kPixels, 1.0);
  int planes;
  bool weighted;

  Photo(std::uint64_t stream, int planes_in, bool weighted_in)
      : planes(planes_in), weighted(weighted_in) {
    const std::size_t count = static_cast<std::size_t>(planes) + (weighted ? 1 : 0);
    words.resize(count * kPixels);
    const std::vector<float> values = noise(5 * kPixels, stream, 0.0, 1.0);
    for (std::size_t c = 0; c < (weighted ? 5u : 4u); ++c) {
      for (std::size_t i = 0; i < kPixels; ++i) set(c, i, values[c * kPixels + i]);
    }
  }

  void set(std::size_t c, std::size_t i, float value) {
    const bool weight = c == 4;
    double& number = numbers[c * kPixels + i];
    std::uint32_t& word = words[(weight        ? static_cast<std::size_t>(planes)
                                 : planes == 4 ? c
                                 : planes == 2 ? c / 2
                                               : 0) *
                                    kPixels +
                                i];
    if (planes == 4) {
      word = std::bit_cast<std::uint32_t>(value);
      number = static_cast<double>(value);
      return;
    }
    const double most = planes == 1 || weight ? 255.0 : 65535.0;
    const auto whole = static_cast<std::uint32_t>(std::lround(most * static_cast<double>(value)));
    word |= whole << (weight ? 0 : planes == 1 ? 8 * c : 16 * (c % 2));
    number = whole / most;
  }
};

}  // namespace

TEST_CASE("exposure: pictures, gradients and fits agree with double precision [small]") {
  Buffer<float> image(shared_test_context(), 4 * kPixels, "image");
  Buffer<float> gradient(shared_test_context(), 4 * kPixels, "gradient");
  Buffer<std::uint32_t> guard(shared_test_context(), 1, "guard");
  guard.upload(std::vector<std::uint32_t>{0});
  const std::array<float, 3> behind{0.25f, 0.5f, 0.875f};
  const std::array<double, 3> exact_behind{0.25, 0.5, 0.875};
  for (const bool cut_out : {false, true}) {
    CAPTURE(cut_out);
    Exposure exposure(shared_test_context(), kViews, 2, cut_out);
    Reference reference(kViews, cut_out);
    for (std::size_t turn = 0; turn < 12; ++turn) {
      CAPTURE(turn);
      const std::size_t view = turn * 3 % kViews;
      const std::vector<float> picture = noise(4 * kPixels, 10 + turn, 0.0, 1.0);
      const std::vector<float> slope = noise(4 * kPixels, 50 + turn, -1.0, 0.6);
      image.upload(picture);
      gradient.upload(slope);
      const std::vector<float> shown =
          exposure.apply(image, view, behind, kWidth, kHeight).download();
      exposure.backward(gradient, view, behind, kWidth, kHeight);
      const std::vector<float> back = gradient.download();
      for (std::size_t i = 0; i < kPixels; ++i) {
        const Pixel x = Reference::pixel_of(picture, i);
        const Pixel expected = reference.apply(x, view, exact_behind);
        const Pixel expected_back =
            reference.backward(Reference::pixel_of(slope, i), x, view, exact_behind);
        const Pixel got = Reference::pixel_of(shown, i), got_back = Reference::pixel_of(back, i);
        for (std::size_t c = 0; c < 4; ++c) {
          REQUIRE(got[c] == doctest::Approx(expected[c]).epsilon(1e-5));
          REQUIRE(got_back[c] == doctest::Approx(expected_back[c]).epsilon(1e-4));
        }
      }

      // With and without a plane of weights.
      const int planes = turn % 3 == 0 ? 1 : turn % 3 == 1 ? 2 : 4;
      const Photo photo(90 + turn, planes, turn % 2 == 0);
      Buffer<std::uint32_t> words(shared_test_context(), photo.words.size(), "photo");
      words.upload(photo.words);
      exposure.observe(image, {words, planes, photo.weighted}, behind, kWidth, kHeight, turn % 2);
      exposure.step(view, turn % 2, 0.03, guard);
      reference.step(picture, photo.numbers, exact_behind, view, 0.03);
      const std::vector<float> deltas = exposure.deltas();
      for (std::size_t k = 0; k < 12; ++k) {
        double sum = 0;
        for (std::size_t v = 0; v < kViews; ++v) {
          const double delta = static_cast<double>(deltas[12 * v + k]);
          sum += delta;
          CHECK(std::abs(delta - reference.deltas[12 * v + k]) < 1e-4);
        }
        CHECK(std::abs(sum) < 1e-6);
      }
    }
  }
}

TEST_CASE("exposure: what colours take off an error is what is affine of it [small]") {
  const std::array<std::array<double, 4>, 3> matrix{
      {{1.2, -0.1, 0.05, 0.04}, {0.1, 0.8, 0.0, -0.02}, {0.0, 0.05, 0.9, 0.1}}};
  for (const double most : {0.0, 0.05, 0.2}) {
    CAPTURE(most);
    const std::vector<float> picture = noise(4 * kPixels, 21, 0.2, 0.7);
    const std::vector<float> beside = noise(3 * kPixels, 22, -most, most);
    Photo photo(23, 4, false);
    double error = 0, rest = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
      const Pixel x = Reference::pixel_of(picture, i);
      for (std::size_t c = 0; c < 3; ++c) {
        const std::array<double, 4>& row = matrix[c];
        const double more = static_cast<double>(beside[c * kPixels + i]);
        const double y = row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] + more;
        photo.set(c, i, static_cast<float>(y));
        error += (y - x[c]) * (y - x[c]) / (3.0 * kPixels);
        rest += more * more / (3.0 * kPixels);
      }
      photo.set(3, i, 1.0f);
    }
    Buffer<float> image(shared_test_context(), 4 * kPixels, "image");
    image.upload(picture);
    Buffer<std::uint32_t> words(shared_test_context(), photo.words.size(), "photo");
    words.upload(photo.words);
    Exposure exposure(shared_test_context(), 1, 2);
    exposure.observe(image, {words, 4, false}, {0, 0, 0}, kWidth, kHeight, 1);
    // Of twelve numbers for 851 pixels noise is fitted a little.
    const Exposure::Tale tale = exposure.tale(error, 1);
    CHECK(tale.removable == doctest::Approx(error - rest).epsilon(0.001 + 3 * rest));
    double variance = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      double mean = 0, square = 0;
      for (std::size_t i = 0; i < kPixels; ++i) {
        const double y = photo.numbers[c * kPixels + i];
        mean += y / kPixels;
        square += y * y / kPixels;
      }
      variance += (square - mean * mean) / 3;
    }
    CHECK(tale.variance == doctest::Approx(variance).epsilon(1e-4));
  }
}

TEST_CASE("exposure: photos that wait keep the identity and have no part in the mean [small]") {
  const std::vector<std::size_t> apart{1, 3};
  Exposure exposure(shared_test_context(), kViews, 1, false, apart);
  Reference reference(kViews);
  Buffer<float> image(shared_test_context(), 4 * kPixels, "image");
  Buffer<std::uint32_t> guard(shared_test_context(), 1, "guard");
  guard.upload(std::vector<std::uint32_t>{0});
  const std::vector<float> picture = noise(4 * kPixels, 41, 0.0, 1.0);
  image.upload(picture);
  const auto step = [&](std::size_t view, bool joined) {
    const Photo photo(70 + view, 4, false);
    Buffer<std::uint32_t> words(shared_test_context(), photo.words.size(), "photo");
    words.upload(photo.words);
    exposure.observe(image, {words, 4, false}, {0, 0, 0}, kWidth, kHeight);
    exposure.step(view, 0, 0.03, guard, joined);
    for (const std::size_t v : apart) reference.waits[v] = !joined;
    reference.step(picture, photo.numbers, {0, 0, 0}, view, 0.03);
    const std::vector<float> deltas = exposure.deltas();
    for (std::size_t k = 0; k < deltas.size(); ++k)
      CHECK(std::abs(static_cast<double>(deltas[k]) - reference.deltas[k]) < 1e-4);
    return deltas;
  };
  for (const std::size_t view : {0, 2, 4, 2}) {
    CAPTURE(view);
    const std::vector<float> deltas = step(view, false);
    for (const std::size_t v : apart) {
      for (std::size_t k = 0; k < 12; ++k) CHECK(deltas[12 * v + k] == 0.0f);
    }
  }
  const std::vector<float> deltas = step(3, true);
  CHECK(deltas[12] != 0.0f);
}

TEST_CASE("exposure: the mean of any number of photos is taken off [small]") {
  Buffer<float> image(shared_test_context(), 4 * kPixels, "image");
  Buffer<std::uint32_t> guard(shared_test_context(), 1, "guard");
  guard.upload(std::vector<std::uint32_t>{0});
  const std::vector<float> picture = noise(4 * kPixels, 21, 0.0, 1.0);
  image.upload(picture);
  const Photo photo(22, 4, true);
  Buffer<std::uint32_t> words(shared_test_context(), photo.words.size(), "photo");
  words.upload(photo.words);
  for (const std::size_t views : {1, 2, 63, 64, 65, 1000}) {
    CAPTURE(views);
    const std::size_t view = views / 2;
    std::vector<float> before(12 * views);
    for (std::size_t i = 0; i < before.size(); ++i)
      before[i] = static_cast<float>(1.0 + 0.5 * std::sin(12.9898 * static_cast<double>(i)));
    Exposure exposure(shared_test_context(), views, 1, true);
    exposure.restore(before);
    Reference reference(views, true);
    reference.deltas.assign(before.begin(), before.end());
    exposure.observe(image, {words, 4, true}, {0, 0, 0}, kWidth, kHeight);
    exposure.step(view, 0, 0.03, guard);
    reference.step(picture, photo.numbers, {0, 0, 0}, view, 0.03);
    const std::vector<float> deltas = exposure.deltas();
    double worst_mean = 0, worst_other = 0, worst_fit = 0;
    for (std::size_t k = 0; k < 12; ++k) {
      double mean = 0;
      for (std::size_t v = 0; v < views; ++v) {
        const double delta = static_cast<double>(deltas[12 * v + k]);
        mean += delta / static_cast<double>(views);
        double& worst = v == view ? worst_fit : worst_other;
        worst = std::max(worst, std::abs(delta - reference.deltas[12 * v + k]));
      }
      worst_mean = std::max(worst_mean, std::abs(mean));
    }
    CHECK(worst_fit < 1e-4);
    // What the fit is off by moves the mean.
    CHECK(worst_other < 1e-4 / static_cast<double>(views) + 3e-7);
    // Added one after the other it would be 1e-6 with 1000 photos.
    CHECK(worst_mean < 2.5e-7);
  }
}

TEST_CASE("exposure: sums of pictures of few and many blocks agree with double precision [small]") {
  Exposure exposure(shared_test_context(), 1);
  // 256 pixels make a block, and 64 blocks a row.
  for (const std::size_t pixels : {100, 16384, 16640, 33000}) {
    CAPTURE(pixels);
    const std::vector<float> picture = noise(4 * pixels, 31, 0.0, 1.0);
    const std::vector<float> photo = noise(4 * pixels, 32, 0.0, 1.0);
    std::vector<std::uint32_t> bits(4 * pixels);
    for (std::size_t i = 0; i < bits.size(); ++i) bits[i] = std::bit_cast<std::uint32_t>(photo[i]);
    Buffer<float> image(shared_test_context(), picture.size(), "image");
    Buffer<std::uint32_t> words(shared_test_context(), bits.size(), "photo");
    image.upload(picture);
    words.upload(bits);
    exposure.observe(image, {words, 4, false}, {0, 0, 0}, static_cast<int>(pixels), 1);
    std::vector<double> expected(Exposure::kSums);
    for (std::size_t i = 0; i < pixels; ++i) {
      const auto number = [&](const std::vector<float>& planes, std::size_t c) {
        return static_cast<double>(planes[c * pixels + i]);
      };
      const double weight = number(photo, 3);
      const double z[4] = {number(picture, 0), number(picture, 1), number(picture, 2), 1};
      std::size_t j = 0;
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = a; b < 4; ++b) expected[j++] += weight * z[a] * z[b];
      }
      for (std::size_t c = 0; c < 3; ++c) {
        for (const double factor : z) expected[j++] += weight * factor * (number(photo, c) - z[c]);
      }
      expected[j] += weight;
    }
    const std::vector<float> sums = exposure.sums().download();
    for (std::size_t j = 0; j < Exposure::kSums; ++j) {
      CAPTURE(j);
      CHECK(std::abs(static_cast<double>(sums[j]) - expected[j]) < 2e-6 * expected[9]);
    }
  }
}

TEST_CASE(
    "exposure: a photo's colours are found in a few visits, whatever the scene shows [small]") {
  Buffer<float> image(shared_test_context(), 4 * kPixels, "image");
  Buffer<std::uint32_t> guard(shared_test_context(), 1, "guard");
  guard.upload(std::vector<std::uint32_t>{0});
  const std::vector<float> colors = noise(4 * kPixels, 7, 0.1, 0.6);
  // Of a photo that is cut out nothing but its colours counts: neither what lies behind it, another
  // in every pass, nor that the Gaussians cover more or less of it.
  const std::vector<float> coverage = noise(kPixels, 8, 0.2, 1.0);
  const std::vector<float> alpha = noise(kPixels, 9, 0.0, 1.0);
  for (const bool cut_out : {false, true}) {
    CAPTURE(cut_out);
    Exposure exposure(shared_test_context(), kViews, 1, cut_out);
    for (int pass = 0; pass < 4; ++pass) {
      const float shade = static_cast<float>(pass) / 3.0f;
      const std::array<float, 3> behind{shade, 1.0f - shade, 1.0f};
      std::vector<float> picture = colors;
      for (std::size_t i = 0; cut_out && i < kPixels; ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
          float& x = picture[c * kPixels + i];
          x = coverage[i] * x + (1.0f - coverage[i]) * behind[c];
        }
        picture[3 * kPixels + i] = coverage[i];
      }
      image.upload(picture);
      for (std::size_t view = 0; view < kViews; ++view) {
        const double gain = 0.7 + 0.15 * static_cast<double>(view);  // 1 in the mean
        Photo photo(1, 4, false);
        for (std::size_t c = 0; c < 3; ++c) {
          for (std::size_t i = 0; i < kPixels; ++i)
            photo.set(c, i, static_cast<float>(gain) * colors[c * kPixels + i]);
        }
        for (std::size_t i = 0; i < kPixels; ++i) photo.set(3, i, cut_out ? alpha[i] : 1.0f);
        Buffer<std::uint32_t> words(shared_test_context(), photo.words.size(), "photo");
        words.upload(photo.words);
        exposure.observe(image, {words, 4, false}, behind, kWidth, kHeight);
        exposure.step(view, 0, 0.002, guard);
      }
    }
    const std::vector<float> deltas = exposure.deltas();
    for (std::size_t view = 0; view < kViews; ++view) {
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(static_cast<double>(deltas[12 * view + 5 * c]) ==
              doctest::Approx(-0.3 + 0.15 * static_cast<double>(view)).epsilon(0.03).scale(1));
      }
    }
  }
}

TEST_CASE("exposure: marked steps and photos of which nothing counts change nothing [small]") {
  Exposure exposure(shared_test_context(), kViews, 1, true);
  Buffer<float> image(shared_test_context(), 4 * kPixels, "image");
  Buffer<std::uint32_t> guard(shared_test_context(), 1, "guard");
  const auto step = [&](Exposure& target, std::size_t view, std::uint32_t mark, float weight) {
    guard.upload(std::vector<std::uint32_t>{mark});
    image.upload(noise(4 * kPixels, 1, 0.0, 1.0));
    Photo photo(2, 4, true);
    for (std::size_t i = 0; i < kPixels; ++i) photo.set(4, i, weight);
    Buffer<std::uint32_t> words(shared_test_context(), photo.words.size(), "photo");
    words.upload(photo.words);
    target.observe(image, {words, 4, true}, {0, 0, 0}, kWidth, kHeight);
    target.step(view, 0, 0.02, guard);
  };
  step(exposure, 1, 0, 1.0f);
  const std::vector<float> before = exposure.deltas();
  CHECK(before != std::vector<float>(12 * kViews));
  step(exposure, 2, 1, 1.0f);
  CHECK(exposure.deltas() == before);
  step(exposure, 2, 0, 0.0f);
  CHECK(exposure.deltas() == before);
  Exposure other(shared_test_context(), kViews, 1, true);
  other.restore(before);
  step(exposure, 3, 0, 0.5f);
  step(other, 3, 0, 0.5f);
  CHECK(exposure.deltas() == other.deltas());
  CHECK(exposure.deltas() != before);
  CHECK_THROWS_AS(Exposure(shared_test_context(), kViews + 1).restore(before), DataError);
}
