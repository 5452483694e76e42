#include "dupin/registration/height_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "dupin/base/parallel.h"
#include "dupin/math/symmetric3.h"
#include "dupin/spatial/neighborhoods.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using std::size_t;

constexpr int kAngles = HeightMaps::kAngles;
constexpr float kSlopeLimit = 0.5F;   // squared differences are cut off at its square
constexpr double kModelSlope = 0.08;  // slopes of one place differ by so much without noise
constexpr float kUsualAtFirst = 0.04F;
constexpr float kPriorWeight =
    8.0F;  // cells' worth of a usual mismatch: little in common says little

// Adds the points of one neighbourhood to the cells of one anchor.
struct Splatter {
  const ScanFeatures* scan;
  HeightMaps* maps;

  void operator()(Index anchor_index, std::span<const std::int32_t> index,
                  std::vector<float>& count) const {
    const Anchor& anchor = scan->anchors[static_cast<size_t>(anchor_index)];
    float* slope = maps->slope.data() + anchor_index * maps->cells();
    float* weight = maps->weight.data() + anchor_index * maps->cells();
    const auto frame = maps->frame.row(anchor_index);
    const RowVector3d u = frame.segment<3>(0);
    const RowVector3d w = frame.segment<3>(3);
    const RowVector3d n = frame.segment<3>(6);
    std::fill(count.begin(), count.end(), 0.0F);
    const double log_ratio = std::log(HeightMaps::kRatio);
    for (const std::int32_t i : index) {
      if (scan->coarse_normals.row(i).dot(n) < 0.1) continue;
      const RowVector3d d = scan->coarse.row(i) - anchor.position;
      const double x = d.dot(u);
      const double y = d.dot(w);
      const double rho = std::hypot(x, y);
      if (!(rho > 0.0)) continue;
      const double ring = std::log(rho / maps->base) / log_ratio;
      if (ring <= -1.0 || ring >= maps->rings) continue;
      const double value = std::clamp(d.dot(n) / rho, -2.0, 2.0);
      const double angle =
          (std::atan2(y, x) / (2.0 * std::numbers::pi) + 1.0) * static_cast<double>(kAngles);
      const double ring_floor = std::floor(ring);
      const double angle_floor = std::floor(angle);
      const double ring_part = ring - ring_floor;
      const double angle_part = angle - angle_floor;
      for (int a = 0; a < 2; ++a) {
        const int row = static_cast<int>(ring_floor) + a;
        if (row < 0 || row >= maps->rings) continue;
        for (int b = 0; b < 2; ++b) {
          const int column = (static_cast<int>(angle_floor) + b) % kAngles;
          const auto share = static_cast<float>((a == 0 ? 1.0 - ring_part : ring_part) *
                                                (b == 0 ? 1.0 - angle_part : angle_part));
          const int cell = row * kAngles + column;
          count[static_cast<size_t>(cell)] += share;
          slope[cell] += share * static_cast<float>(value);
        }
      }
    }
    for (int cell = 0; cell < maps->cells(); ++cell) {
      const float here = count[static_cast<size_t>(cell)];
      if (here < 0.25F) {
        slope[cell] = 0.0F;
        continue;
      }
      slope[cell] /= here;
      const double radius = maps->base * std::pow(HeightMaps::kRatio, cell / kAngles);
      const double noise = scan->coarse_sigma / (radius * kModelSlope);
      const auto samples = static_cast<double>(here);
      weight[cell] = static_cast<float>(samples / (samples + noise * noise));
    }
  }
};

struct Comparison {
  float mismatch = 1.0F;
  int turn = 0;
  int shift = 0;
  float turn_part = 0.0F;  // of a step, from the parabola through the neighbours
};

// Maps laid out for comparison: the angles of the fixed maps twice, so that a turn is an offset.
std::vector<float> doubled(const std::vector<float>& rows) {
  std::vector<float> out(rows.size() * 2);
  for (size_t row = 0; row < rows.size() / kAngles; ++row) {
    for (size_t copy = 0; copy < 2; ++copy) {
      std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(row * kAngles), kAngles,
                  out.begin() + static_cast<std::ptrdiff_t>((2 * row + copy) * kAngles));
    }
  }
  return out;
}

// Mean square difference of the slopes where both maps have any, for one turn and shift of rings.
float compare(const float* slope_a, const float* weight_a, const float* slope_b,
              const float* weight_b, int rings, int turn, int shift, float usual) {
  std::array<float, kAngles> sum{};
  std::array<float, kAngles> mass{};
  const int first = std::max(0, -shift);
  const int last = std::min(rings, rings - shift);
  for (int ring = first; ring < last; ++ring) {
    const float* a = slope_a + ring * kAngles;
    const float* wa = weight_a + ring * kAngles;
    const float* b = slope_b + (ring + shift) * 2 * kAngles + turn;
    const float* wb = weight_b + (ring + shift) * 2 * kAngles + turn;
    for (size_t k = 0; k < kAngles; ++k) {
      const float d = a[k] - b[k];
      const float w = wa[k] * wb[k];
      sum[k] += w * std::min(d * d, kSlopeLimit * kSlopeLimit);
      mass[k] += w;
    }
  }
  float total = 0.0F;
  float weight = 0.0F;
  for (size_t k = 0; k < kAngles; ++k) {
    total += sum[k];
    weight += mass[k];
  }
  // Less than an eighth of the map in common says nothing.
  if (weight < static_cast<float>(rings) * kAngles / 8.0F) return 1.0F;
  return (total + kPriorWeight * usual) / (weight + kPriorWeight);
}

Comparison best_of(const float* slope_a, const float* weight_a, const float* slope_b,
                   const float* weight_b, int rings, int low_shift, int high_shift, float usual) {
  Comparison best;
  for (int shift = low_shift; shift <= high_shift; ++shift) {
    std::array<float, kAngles> at{};
    for (int turn = 0; turn < kAngles; ++turn) {
      at[static_cast<size_t>(turn)] =
          compare(slope_a, weight_a, slope_b, weight_b, rings, turn, shift, usual);
    }
    const auto least = std::min_element(at.begin(), at.end());
    if (*least >= best.mismatch) continue;
    const auto turn = static_cast<int>(least - at.begin());
    const float before = at[static_cast<size_t>((turn + kAngles - 1) % kAngles)];
    const float after = at[static_cast<size_t>((turn + 1) % kAngles)];
    const float bend = before - 2.0F * *least + after;
    best.turn_part = bend > 0.0F ? std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F) : 0.0F;
    best.mismatch = *least;
    best.turn = turn;
    best.shift = shift;
  }
  return best;
}

Eigen::Matrix3d frame_of(const HeightMaps& maps, Index anchor) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
      maps.frame.row(anchor).data());
}

// All maps of one scan against all of another.
class Matcher {
 public:
  Matcher(const ScanFeatures& moving, const HeightMaps& of_moving, const ScanFeatures& fixed,
          const HeightMaps& of_fixed, bool is_flipped, const MapMatchOptions& options)
      : moving_(moving),
        of_moving_(of_moving),
        fixed_(fixed),
        of_fixed_(of_fixed),
        is_flipped_(is_flipped),
        options_(options),
        rows_(static_cast<Index>(moving.anchors.size())),
        columns_(static_cast<Index>(fixed.anchors.size())),
        slope_(doubled(of_fixed.slope)),
        weight_(doubled(of_fixed.weight)) {}

  std::vector<FeatureMatch> solve(const RunControl& run) {
    // What is usual for these surfaces, from a part of the pairs, stands in for what a pair of
    // maps has too little of in common.
    compare_rows(7, kUsualAtFirst, run);
    std::vector<float> all;
    collect(table_, all);
    const float usual = median(all, kUsualAtFirst);
    table_.clear();
    compare_rows(1, usual, run);
    if (run.cancelled()) return {};
    find_usual();
    return best_matches();
  }

 private:
  static void collect(const std::vector<Comparison>& table, std::vector<float>& all) {
    for (const Comparison& one : table) {
      if (one.mismatch < 1.0F) all.push_back(one.mismatch);
    }
  }

  static float median(std::vector<float>& all, float otherwise) {
    if (all.empty()) return otherwise;
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    return std::max(*middle, 1e-9F);
  }

  // Shifts of rings to try; the radii of keypoints tell the scale but for a factor of two or so.
  std::pair<int, int> window(const Anchor& a, const Anchor& b) const {
    if (options_.max_shift == 0) return {0, 0};
    const int rings = of_moving_.rings;
    if (!(a.radius > 0.0) || !(b.radius > 0.0)) return {4 - rings, rings - 4};
    const double ratio = b.radius * of_moving_.base / (a.radius * of_fixed_.base);
    const auto middle = static_cast<int>(
        std::clamp(std::round(std::log(ratio) / std::log(HeightMaps::kRatio)), -99.0, 99.0));
    return {std::max(middle - options_.max_shift, 4 - rings),
            std::min(middle + options_.max_shift, rings - 4)};
  }

  void compare_rows(Index every, float usual, const RunControl& run) {
    table_.assign(static_cast<size_t>(rows_ * columns_), Comparison());
    const Index cells = of_moving_.cells();
    parallel_for(0, (rows_ + every - 1) / every, 1, [&](Index first, Index last) {
      for (Index k = first; k < last && !run.cancelled(); ++k) {
        const Index i = k * every;
        const Anchor& a = moving_.anchors[static_cast<size_t>(i)];
        const int kind = is_flipped_ ? -a.kind : a.kind;
        for (Index j = 0; j < columns_; ++j) {
          const Anchor& b = fixed_.anchors[static_cast<size_t>(j)];
          if (kind * b.kind < 0) continue;
          const auto [low, high] = window(a, b);
          table_[static_cast<size_t>(i * columns_ + j)] =
              best_of(of_moving_.slope.data() + i * cells, of_moving_.weight.data() + i * cells,
                      slope_.data() + 2 * j * cells, weight_.data() + 2 * j * cells,
                      of_moving_.rings, low, high, usual);
        }
      }
    });
  }

  const Comparison& at(Index i, Index j) const {
    return table_[static_cast<size_t>(i * columns_ + j)];
  }

  // What is usual for each anchor: a match counts by how far it is below that.
  void find_usual() {
    row_usual_.assign(static_cast<size_t>(rows_), 1.0F);
    column_usual_.assign(static_cast<size_t>(columns_), 1.0F);
    std::vector<float> all;
    const auto add = [&](Index i, Index j) {
      if (at(i, j).mismatch < 1.0F) all.push_back(at(i, j).mismatch);
    };
    for (Index i = 0; i < rows_; ++i) {
      all.clear();
      for (Index j = 0; j < columns_; ++j) add(i, j);
      row_usual_[static_cast<size_t>(i)] = median(all, 1.0F);
    }
    for (Index j = 0; j < columns_; ++j) {
      all.clear();
      for (Index i = 0; i < rows_; ++i) add(i, j);
      column_usual_[static_cast<size_t>(j)] = median(all, 1.0F);
    }
  }

  float ratio(Index i, Index j) const {
    return at(i, j).mismatch /
           std::sqrt(row_usual_[static_cast<size_t>(i)] * column_usual_[static_cast<size_t>(j)]);
  }

  void keep_best(std::vector<std::pair<float, Index>>& line,
                 std::vector<std::uint8_t>& kept) const {
    const auto count = std::min<size_t>(line.size(), static_cast<size_t>(options_.candidates));
    std::partial_sort(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(count), line.end());
    for (size_t k = 0; k < count; ++k) kept[static_cast<size_t>(line[k].second)] = 1;
    line.clear();
  }

  std::vector<FeatureMatch> best_matches() const {
    std::vector<std::uint8_t> kept(table_.size(), 0);
    std::vector<std::pair<float, Index>> line;
    const auto add = [&](Index i, Index j) {
      if (at(i, j).mismatch < 1.0F) line.emplace_back(ratio(i, j), i * columns_ + j);
    };
    for (Index i = 0; i < rows_; ++i) {
      for (Index j = 0; j < columns_; ++j) add(i, j);
      keep_best(line, kept);
    }
    for (Index j = 0; j < columns_; ++j) {
      for (Index i = 0; i < rows_; ++i) add(i, j);
      keep_best(line, kept);
    }
    std::vector<FeatureMatch> matches;
    for (Index k = 0; k < rows_ * columns_; ++k) {
      if (kept[static_cast<size_t>(k)] != 0)
        matches.push_back(match_of(k / columns_, k % columns_));
    }
    std::stable_sort(
        matches.begin(), matches.end(),
        [](const FeatureMatch& a, const FeatureMatch& b) { return a.weight > b.weight; });
    return matches;
  }

  FeatureMatch match_of(Index i, Index j) const {
    const Comparison& found = at(i, j);
    FeatureMatch match;
    match.moving = static_cast<int>(i);
    match.fixed = static_cast<int>(j);
    match.is_flipped = is_flipped_;
    match.mismatch = static_cast<double>(found.mismatch);
    const auto r = static_cast<double>(ratio(i, j));
    match.weight = std::exp(-4.0 * r * r);
    // Angle of b = angle of a + turn: a's frame, turned about the normal, lies on b's.
    const double turn =
        (found.turn + static_cast<double>(found.turn_part)) * 2.0 * std::numbers::pi / kAngles;
    Eigen::Matrix3d about = Eigen::Matrix3d::Identity();
    about.topLeftCorner<2, 2>() << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
    match.rotation = frame_of(of_fixed_, j).transpose() * about * frame_of(of_moving_, i);
    match.scale = of_fixed_.base / of_moving_.base * std::pow(HeightMaps::kRatio, found.shift);
    return match;
  }

  const ScanFeatures& moving_;
  const HeightMaps& of_moving_;
  const ScanFeatures& fixed_;
  const HeightMaps& of_fixed_;
  bool is_flipped_;
  MapMatchOptions options_;
  Index rows_;
  Index columns_;
  std::vector<float> slope_;  // of the fixed maps, doubled
  std::vector<float> weight_;
  std::vector<Comparison> table_;
  std::vector<float> row_usual_;
  std::vector<float> column_usual_;
};

}  // namespace

HeightMaps build_height_maps(const ScanFeatures& scan, double base, int rings,
                             const RunControl& run) {
  HeightMaps maps;
  maps.rings = rings;
  maps.base = base;
  const auto count = static_cast<Index>(scan.anchors.size());
  maps.slope.assign(static_cast<size_t>(count * maps.cells()), 0.0F);
  maps.weight.assign(static_cast<size_t>(count * maps.cells()), 0.0F);
  maps.frame.resize(count, 9);
  Points places(count, 3);
  for (Index i = 0; i < count; ++i) {
    const Anchor& anchor = scan.anchors[static_cast<size_t>(i)];
    const RowVector3d n = anchor.normal;
    RowVector3d u;
    RowVector3d w;
    tangent_basis(n, u, w);
    maps.frame.row(i) << u, w, n;
    places.row(i) = anchor.position;
  }
  if (count == 0 || run.cancelled()) return maps;
  const double reach = base * std::pow(HeightMaps::kRatio, rings);
  const NeighborSearch search(scan.coarse);
  const Splatter splat{&scan, &maps};
  search.visit_within(
      places, reach,
      [&]() -> NeighborVisitor {
        auto counts = std::make_shared<std::vector<float>>(static_cast<size_t>(maps.cells()));
        auto sorted = std::make_shared<std::vector<std::int32_t>>();
        return [&splat, counts, sorted](Index query, std::span<const std::int32_t> index,
                                        std::span<const double>) {
          // One order of addition, whatever order the search has.
          sorted->assign(index.begin(), index.end());
          std::sort(sorted->begin(), sorted->end());
          splat(query, *sorted, *counts);
        };
      },
      run);
  return maps;
}

HeightMaps flipped(const HeightMaps& maps) {
  HeightMaps out = maps;
  out.frame.rightCols<6>() *= -1.0;
  for (size_t row = 0; row < maps.slope.size() / kAngles; ++row) {
    for (size_t k = 0; k < kAngles; ++k) {
      const size_t from = row * kAngles + (kAngles - k) % kAngles;
      out.slope[row * kAngles + k] = -maps.slope[from];
      out.weight[row * kAngles + k] = maps.weight[from];
    }
  }
  return out;
}

std::vector<FeatureMatch> match_height_maps(const ScanFeatures& moving, const HeightMaps& of_moving,
                                            const ScanFeatures& fixed, const HeightMaps& of_fixed,
                                            bool is_flipped, const MapMatchOptions& options,
                                            const RunControl& run) {
  return Matcher(moving, of_moving, fixed, of_fixed, is_flipped, options).solve(run);
}

}  // namespace dupin::detail
