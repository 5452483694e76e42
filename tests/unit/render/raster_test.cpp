#include "dupin/render/raster.h"

#include <gtest/gtest.h>

#include <vector>

#include "dupin/base/random.h"

namespace dupin {
namespace {

using detail::FixedPoint;
using detail::SampleBox;

constexpr int kSide = 64;

void count_samples(FixedPoint a, FixedPoint b, FixedPoint c, std::vector<int>& hits) {
  detail::fill_triangle(a, b, c, SampleBox{0, 0, kSide, kSide},
                        [&](int x, int y) { ++hits[static_cast<std::size_t>(y * kSide + x)]; });
}

// A fan of triangles about an inner point covers a convex polygon exactly once, whatever the
// corners; corners on sample centres and on sample rows are the cases in which a rule is needed.
TEST(Raster, TrianglesSharingEdgesCoverEachSampleOnce) {
  Rng rng(3);
  for (int round = 0; round < 200; ++round) {
    const auto coordinate = [&] {
      const auto cell = static_cast<std::int32_t>(rng.below(kSide));
      return round % 2 == 0 ? cell * 256 + 128 : static_cast<std::int32_t>(rng.below(kSide * 256));
    };
    const FixedPoint middle{coordinate(), coordinate()};
    const FixedPoint corner[4] = {{-256, -256},
                                  {kSide * 256 + 256, -256},
                                  {kSide * 256 + 256, kSide * 256 + 256},
                                  {-256, kSide * 256 + 256}};
    std::vector<int> hits(kSide * kSide, 0);
    for (int k = 0; k < 4; ++k) {
      // Windings alternate: the rule must not depend on them.
      if (k % 2 == 0) count_samples(middle, corner[k], corner[(k + 1) % 4], hits);
      if (k % 2 == 1) count_samples(corner[(k + 1) % 4], corner[k], middle, hits);
    }
    for (int i = 0; i < kSide * kSide; ++i) {
      ASSERT_EQ(hits[static_cast<std::size_t>(i)], 1) << "round " << round << " sample " << i;
    }
  }
}

// Samples at cell centres: a triangle with legs of n cells along the axes holds about n^2 / 2, and
// exactly n (n - 1) / 2 or n (n + 1) / 2 by who owns the diagonal.
TEST(Raster, CoverageIsTheArea) {
  std::vector<int> hits(kSide * kSide, 0);
  count_samples({0, 0}, {40 * 256, 0}, {0, 40 * 256}, hits);
  int sum = 0;
  for (const int h : hits) sum += h;
  EXPECT_TRUE(sum == 40 * 39 / 2 || sum == 40 * 41 / 2) << sum;
}

TEST(Raster, ATriangleWithoutAreaCoversNothing) {
  std::vector<int> hits(kSide * kSide, 0);
  count_samples({128, 128}, {128 + 2560, 128 + 2560}, {128 + 5120, 128 + 5120}, hits);
  count_samples({128, 128}, {128, 128}, {128, 128}, hits);
  for (const int h : hits) EXPECT_EQ(h, 0);
}

// A plane through three corners gives a linear function back at every sample.
TEST(Raster, PlanesReproduceLinearFunctions) {
  const auto f = [](FixedPoint p) { return 0.25 * p.x / 256.0 - 0.5 * p.y / 256.0 + 3.0; };
  const FixedPoint a{100, 900};
  const FixedPoint b{9000, 130};
  const FixedPoint c{4000, 8000};
  const detail::SamplePlane plane(a, b, c, f(a), f(b), f(c));
  for (const int x : {0, 7, 60}) {
    for (const int y : {0, 11, 50}) {
      EXPECT_NEAR(plane.at(x, y), f({x * 256 + 128, y * 256 + 128}), 1e-12);
    }
  }
}

}  // namespace
}  // namespace dupin
