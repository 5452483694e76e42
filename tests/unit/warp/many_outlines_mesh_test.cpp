#include <gtest/gtest.h>

#include <cstdio>

#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/triangulate_outline.h"
#include "tests/support/mesh_promises.h"
#include "tests/support/outline_families.h"

namespace dupin {
namespace {

using Eigen::Index;

constexpr std::uint64_t kOutlinesPerFamily = 1112;  // nine families: 10,008 outlines

class ManyOutlines : public testing::TestWithParam<int> {};

// All promises on 10,008 random outlines: none refused, none broken, and every angle under 25
// degrees has its cause in the input.
TEST_P(ManyOutlines, KeepAllPromises) {
  std::int64_t num_triangles = 0, num_below = 0;
  for (std::uint64_t seed = 0; seed < kOutlinesPerFamily; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(100000 * (1 + static_cast<std::uint64_t>(GetParam())) + seed);
    const Outline raw = test::random_outline(GetParam(), rng);
    const double spacing = rng.uniform(8.0, 40.0);
    const PreparedOutline prepared = prepare_outline(
        raw, {.spacing_px = spacing, .tolerance_px = 0.5, .corner_angle_deg = 30.0});
    Points2 pins(static_cast<Index>(rng.below(4)), 2);
    for (Index i = 0; i < pins.rows(); ++i)
      pins.row(i) << rng.uniform(0.0, 300.0), rng.uniform(0.0, 300.0);
    MeshingOptions options;
    options.spacing_px = spacing;
    const TriangulatedOutline made = triangulate_outline(prepared.outline, pins, options);
    ASSERT_EQ(made.status, Status::ok);
    ASSERT_EQ(test::broken_promise(prepared.outline, made), "");
    num_triangles += made.mesh.triangles.rows();
    num_below += made.report.num_below;
  }
  std::printf("family %d: %llu outlines, %lld triangles, %lld under 25 degrees\n", GetParam(),
              static_cast<unsigned long long>(kOutlinesPerFamily),
              static_cast<long long>(num_triangles), static_cast<long long>(num_below));
}

INSTANTIATE_TEST_SUITE_P(All, ManyOutlines, testing::Range(0, test::kNumFamilies));

}  // namespace
}  // namespace dupin
