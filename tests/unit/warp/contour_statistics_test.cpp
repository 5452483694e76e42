#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "dupin/base/random.h"
#include "dupin/warp/exterior_points.h"
#include "dupin/warp/pin_transfer.h"
#include "tests/support/garments.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using test::Garment;

// Exterior points of a garment, and of the same garment turned, scaled and with independent noise
// of 1 % of the diagonal of its box at each of its 900 corners. A point is found again when one of
// the other set lies within 3 % of the diagonal, one to one. Of all points of both sets 90 % are
// asked for.
TEST(ExteriorPointStatistics, SetsAreFoundAgainUnderNoise) {
  int num_points = 0;
  int num_found = 0;
  int num_same = 0;
  constexpr int kPerKind = 20;
  for (int k = 0; k < 3 * kPerKind; ++k) {
    test::GarmentOptions made;
    made.noise_px = 0.0;
    const auto seed = static_cast<std::uint64_t>(1000 + k);
    const Points2 loop = test::make_garment(static_cast<Garment>(k % 3), seed, made).outline;
    const double size = (loop.colwise().maxCoeff() - loop.colwise().minCoeff()).norm();
    Rng rng(seed);
    const double angle = rng.uniform(0.0, 6.3);
    Eigen::Matrix2d turn;
    turn << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    const double scale = std::exp(rng.uniform(-1.0, 1.0));
    Points2 noisy = loop;
    for (Index i = 0; i < noisy.size(); ++i) noisy.data()[i] += 0.01 * size * rng.normal();
    const ExteriorPoints first = find_exterior_points(loop);
    const ExteriorPoints second = find_exterior_points(scale * noisy * turn);
    std::vector<bool> used(second.points.size(), false);
    int found = 0;
    for (const ExteriorPoint& point : first.points) {
      for (std::size_t i = 0; i < used.size(); ++i) {
        const RowVector2d back = second.points[i].position * turn.transpose() / scale;
        if (used[i] || (back - point.position).norm() > 0.03 * size) continue;
        used[i] = true;
        ++found;
        break;
      }
    }
    num_points += static_cast<int>(first.points.size() + second.points.size());
    num_found += 2 * found;
    if (2 * found == static_cast<int>(first.points.size() + second.points.size())) ++num_same;
  }
  const double share = static_cast<double>(num_found) / num_points;
  RecordProperty("found_again", std::to_string(share));
  RecordProperty("equal_sets", num_same);
  std::printf("found again %.3f of %d, equal sets %d of %d\n", share, num_points, num_same,
              3 * kPerKind);
  EXPECT_GE(share, 0.95);
  EXPECT_GE(num_same, 42);
}

// The mean garment of each kind is the template, with its named points as pins; 51 others of random
// proportions, pose, folds and noise have to get them. Wrong is more than 3 % of the height.
TEST(PinTransferStatistics, TemplatesFitAWholeCollection) {
  std::vector<double> errors;
  int num_wrong = 0;
  int num_wrong_flagged = 0;
  int num_flagged = 0;
  for (int k = 0; k < 51; ++k) {
    const auto kind = static_cast<Garment>(k % 3);
    test::GarmentOptions mean;
    mean.variation = 0.0;
    const test::SyntheticGarment from = test::make_garment(kind, 1, mean);
    const test::SyntheticGarment to =
        test::make_garment(kind, static_cast<std::uint64_t>(40000 + k));
    const ContourMatch match = match_contours(from.outline, to.outline);
    const TransferredPlaces carried = transfer_places(from.outline, from.marks, to.outline, match);
    for (Index i = 0; i < from.marks.rows(); ++i) {
      const double error = (carried.places.row(i) - to.marks.row(i)).norm() / to.height;
      const bool is_flagged = carried.confidence(i) < kSureConfidence;
      errors.push_back(error);
      num_flagged += is_flagged;
      num_wrong += error > 0.03;
      num_wrong_flagged += is_flagged && error > 0.03;
    }
  }
  std::sort(errors.begin(), errors.end());
  const double median = errors[errors.size() / 2];
  const double recall = static_cast<double>(num_wrong_flagged) / std::max(1, num_wrong);
  std::printf(
      "%zu pins: median error %.4f, 90 %% within %.4f of the height; wrong %d, flagged %d "
      "(of all %d)\n",
      errors.size(), median, errors[errors.size() * 9 / 10], num_wrong, num_wrong_flagged,
      num_flagged);
  EXPECT_LT(median, 0.01);
  EXPECT_GE(recall, 0.9);
  EXPECT_LT(num_flagged, static_cast<int>(errors.size()) / 2);
}

}  // namespace
}  // namespace dupin
