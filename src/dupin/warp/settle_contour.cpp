#include "dupin/warp/settle_contour.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::VectorXd;

// Chosen on the four pairs of docs/methods/warp_contours.md and on 32 made garments.
constexpr Index kFine = 4096;        // samples of the silhouette
constexpr Index kStride = 4;         // source samples a node of the displacement
constexpr int kRounds = 8;           // of looking for the nearest places, and fitting to them
constexpr double kKeyWeight = 20.0;  // of a sure key point, in nodes
constexpr double kSure = 0.005;      // deviation of a sure key point, of the height
constexpr double kReach = 0.1;       // see stiffness_of()
constexpr double kWindow = 0.05;     // of the length: how far to look along the silhouette
constexpr int kPasses = 50;          // of putting places in order

// Difference of two arcs on a loop, in (-length / 2, length / 2].
double arc_between(double from, double to, double length) {
  return std::remainder(to - from, length);
}

struct Silhouette {
  Points2 points;
  Points2 normals;
  double length = 0.0;
  double step = 0.0;
};

Silhouette sampled(const Points2& loop) {
  const ResampledLoop samples = resample_loop(loop, kFine);
  Silhouette result{samples.points, Points2(kFine, 2), samples.length, samples.spacing};
  for (Index i = 0; i < kFine; ++i) {
    const RowVector2d along =
        samples.points.row((i + 2) % kFine) - samples.points.row((i + kFine - 2) % kFine);
    const double norm = along.norm();
    result.normals.row(i) =
        norm > 0.0 ? RowVector2d(along.y() / norm, -along.x() / norm) : RowVector2d(0.0, 0.0);
  }
  return result;
}

// How much the displacement of neighbours may differ is what key points say: where they all move
// alike the contour hardly slides (a body grows), where they do not (a sleeve is raised) arc
// length between them is the better guess.
double stiffness_of(const ContourMatch& match, const Points2& ways, double height, double spacing) {
  double sum = 0.0;
  const std::size_t count = match.keys.size();
  for (std::size_t k = 0; k < count; ++k) {
    const KeyMatch& next = match.keys[(k + 1) % count];
    double apart = next.arc_from - match.keys[k].arc_from;
    if (apart <= 0.0) apart += match.length_from;
    const auto row = static_cast<Index>(k);
    sum += (ways.row((row + 1) % ways.rows()) - ways.row(row)).squaredNorm() /
           std::max(apart, 0.01 * height);
  }
  const double rate = std::max(sum / (static_cast<double>(count) * height), 1e-6);
  const double reach = std::min(kReach * std::sqrt(1e-3 / rate), 2.0 * kReach);
  return std::pow(reach * height / spacing, 2.0);
}

// The displacement of the nodes, x and y by turns, that brings them to the lines along the
// silhouette at `at`, and key points to each other.
VectorXd fit_displacement(const Points2& nodes, const Silhouette& to, const std::vector<Index>& at,
                          const ContourMatch& match, const Points2& ways, double height,
                          double spacing, double stiffness) {
  const Index count = nodes.rows();
  std::vector<Eigen::Triplet<double>> entries;
  VectorXd right = VectorXd::Zero(2 * count);
  const auto add = [&](Index row, Index column, double value) {
    entries.emplace_back(static_cast<int>(row), static_cast<int>(column), value);
  };
  for (Index i = 0; i < count; ++i) {
    const Index t = at[static_cast<std::size_t>(i)];
    const RowVector2d n = to.normals.row(t);
    const double off = n.dot(to.points.row(t) - nodes.row(i));
    const Index next = (i + 1) % count;
    for (Index a = 0; a < 2; ++a) {
      for (Index b = 0; b < 2; ++b) add(2 * i + a, 2 * i + b, n(a) * n(b));
      right(2 * i + a) += n(a) * off;
      add(2 * i + a, 2 * i + a, stiffness + 1e-6);
      add(2 * next + a, 2 * next + a, stiffness);
      add(2 * i + a, 2 * next + a, -stiffness);
      add(2 * next + a, 2 * i + a, -stiffness);
    }
  }
  for (Index k = 0; k < ways.rows(); ++k) {
    const KeyMatch& key = match.keys[static_cast<std::size_t>(k)];
    const auto node = static_cast<Index>(std::lround(key.arc_from / spacing)) % count;
    const double sure = kSure * height / (kSure * height + key.deviation);
    const double weight = kKeyWeight * key.confidence * sure * sure;
    for (Index a = 0; a < 2; ++a) {
      add(2 * node + a, 2 * node + a, weight);
      right(2 * node + a) += weight * ways(k, a);
    }
  }
  Eigen::SparseMatrix<double> system(2 * count, 2 * count);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(system);
  VectorXd shift = solver.solve(right);
  if (solver.info() != Eigen::Success || !std::isfinite(shift.sum())) {
    throw Error(Errc::numerical, "E_NOT_CONVERGED",
                "the contour could not be laid on the silhouette");
  }
  return shift;
}

// In order along the silhouette: where two have passed each other both go to their middle.
void put_in_order(const VectorXd& base, VectorXd& slide, double length) {
  const Index count = base.size();
  for (int pass = 0; pass < kPasses; ++pass) {
    bool is_sorted = true;
    for (Index i = 0; i < count; ++i) {
      const Index next = (i + 1) % count;
      const double gap = arc_between(base(i), base(next), length) + slide(next) - slide(i);
      if (gap >= 0.0) continue;
      slide(i) += 0.5 * gap;
      slide(next) -= 0.5 * gap;
      is_sorted = false;
    }
    if (is_sorted) return;
  }
}

}  // namespace

VectorXd settle_contour(const Points2& loop, const Points2& source, const VectorXd& arcs,
                        const Points2& silhouette, const ContourMatch& match, double height) {
  const Silhouette to = sampled(silhouette);
  const Index count = source.rows() / kStride;
  const double spacing = match.length_from / static_cast<double>(count);
  Points2 ways(static_cast<Index>(match.keys.size()), 2);  // of the key points
  for (Index k = 0; k < ways.rows(); ++k) {
    const KeyMatch& key = match.keys[static_cast<std::size_t>(k)];
    ways.row(k) = point_at_arc(silhouette, key.arc_to) - point_at_arc(loop, key.arc_from);
  }
  const double stiffness = stiffness_of(match, ways, height, spacing);
  Points2 nodes(count, 2);
  VectorXd base(count);  // where the match puts them; `slide` is from there, small, without a turn
  VectorXd slide = VectorXd::Zero(count);
  for (Index i = 0; i < count; ++i) {
    nodes.row(i) = source.row(i * kStride);
    base(i) = map_arc(match, arcs(i * kStride));
  }
  const auto window = static_cast<Index>(kWindow * static_cast<double>(kFine));
  std::vector<Index> at(static_cast<std::size_t>(count));
  for (int round = 0; round < kRounds; ++round) {
    for (Index i = 0; i < count; ++i) {
      const auto t = static_cast<Index>(std::lround((base(i) + slide(i)) / to.step));
      at[static_cast<std::size_t>(i)] = ((t % kFine) + kFine) % kFine;
    }
    const VectorXd shift = fit_displacement(nodes, to, at, match, ways, height, spacing, stiffness);
    for (Index i = 0; i < count; ++i) {
      const RowVector2d place = nodes.row(i) + RowVector2d(shift(2 * i), shift(2 * i + 1));
      const Index middle = at[static_cast<std::size_t>(i)];
      Index best = middle;
      for (Index k = -window; k <= window; ++k) {
        const Index t = ((middle + k) % kFine + kFine) % kFine;
        if ((to.points.row(t) - place).squaredNorm() < (to.points.row(best) - place).squaredNorm())
          best = t;
      }
      // Between samples along the tangent.
      const RowVector2d n = to.normals.row(best);
      const double along = RowVector2d(-n.y(), n.x()).dot(place - to.points.row(best));
      const double arc =
          static_cast<double>(best) * to.step + std::clamp(along, -0.5 * to.step, 0.5 * to.step);
      slide(i) = arc_between(base(i), arc, to.length);
    }
    put_in_order(base, slide, to.length);
  }
  VectorXd result(source.rows());
  for (Index s = 0; s < result.size(); ++s) {
    const Index i = s / kStride;
    const Index next = (i + 1) % count;
    const double t = static_cast<double>(s % kStride) / static_cast<double>(kStride);
    result(s) = map_arc(match, arcs(s)) + (1.0 - t) * slide(i) + t * slide(next);
  }
  return result;
}

}  // namespace dupin::detail
