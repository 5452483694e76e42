#include "dupin/registration/assessment.h"

#include <cmath>

#include "dupin/registration/sample_pairs.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

struct Tally {
  Index all = 0;
  Index touching = 0;
  Index apart = 0;
  double squares = 0.0;  // of the touching [mu of the surface]
};

Tally tally(const SurfaceSamples& surface, const SurfaceSamples& other, const Pose& pose,
            double sign, double touching, double apart, Index every) {
  Tally tally;
  tally.all = (other.points.rows() + every - 1) / every;
  visit_near_samples(
      surface, other, pose, every,
      [&](Index at, Index, const RowVector3d& place, const RowVector3d& turned) {
        if ((surface.points.row(at) - place).norm() > apart) return;
        const RowVector3d normal = sign * turned;
        const auto foot = surface.foot(at, place);
        if (foot && std::abs(foot->distance) <= touching && normal.dot(foot->normal) > 0.7) {
          ++tally.touching;
          tally.squares += foot->distance * foot->distance;
        } else if (surface.is_border[static_cast<std::size_t>(at)] == 0 &&
                   normal.dot(surface.normals.row(at)) > 0.0) {
          ++tally.apart;
        }
      });
  return tally;
}

}  // namespace

PoseFit assess_pose(const SurfaceSamples& moving, const SurfaceSamples& fixed, const Pose& pose,
                    bool is_flipped, const AssessmentBounds& bounds, Index every) {
  const double sign = is_flipped ? -1.0 : 1.0;
  const Tally forth = tally(fixed, moving, pose, sign, bounds.touching, bounds.apart, every);
  const Tally back = tally(moving, fixed, inverse(pose), sign, bounds.touching / pose.scale,
                           bounds.apart / pose.scale, every);
  PoseFit fit;
  const auto part = [](Index some, Index all) {
    return all > 0 ? static_cast<double>(some) / static_cast<double>(all) : 0.0;
  };
  fit.overlap_moving = part(forth.touching, forth.all);
  fit.overlap_fixed = part(back.touching, back.all);
  fit.num_pairs = forth.touching + back.touching;
  fit.conflict = part(forth.apart + back.apart, forth.apart + back.apart + fit.num_pairs);
  const double squares = forth.squares + pose.scale * pose.scale * back.squares;
  fit.rmse = fit.num_pairs > 0 ? std::sqrt(squares / static_cast<double>(fit.num_pairs)) : 0.0;
  return fit;
}

double plain_confidence_of(const PoseFit& fit, int matches) {
  if (fit.num_pairs < kFewestPairs) return 0.0;
  const double overlap = std::max(fit.overlap_moving, fit.overlap_fixed);
  const double logit = 4.0 - 100.0 * fit.conflict + 20.0 * (std::min(overlap, 0.3) - 0.1) -
                       40.0 * std::max(0.0, 0.1 - overlap) + 0.1 * std::min(matches, 10);
  return 1.0 / (1.0 + std::exp(-logit));
}

double confidence_of(const PoseFit& fit, int matches) {
  if (fit.conflict >= 1.0) return 0.0;
  const double count = static_cast<double>(fit.num_pairs) / (1.0 - fit.conflict);
  if (!(count > 0.0)) return 0.0;
  const double z = 1.645;
  const double middle = fit.conflict + z * z / (2.0 * count);
  const double half =
      z * std::sqrt(fit.conflict * (1.0 - fit.conflict) / count + z * z / (4.0 * count * count));
  PoseFit doubted = fit;
  doubted.conflict = (middle + half) / (1.0 + z * z / count);
  return plain_confidence_of(doubted, matches);
}

}  // namespace dupin::detail
