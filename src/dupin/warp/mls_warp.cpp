#include "dupin/warp/mls_warp.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/planar_graph.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVector2d;
using Eigen::VectorXd;

// Vertices side by side in the table, so that the sums of a drag run over vertices, not controls:
// the compiler can use vector instructions without changing the order of any sum.
constexpr Index kBlock = 8;
constexpr double kNearest = 1e-12;  // of the box diagonal: nearer is on the control
constexpr double kNoTurn = 1e-12;   // of the largest it can be: a sum that says no direction
constexpr double kOnALine = 1e-12;  // determinant over squared trace of the moment matrix

void require(bool condition, const char* message) {
  if (!condition) throw InvalidArgument(message);
}

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// theta of every sample relative to the largest: powers of distances overflow, their ratios do not.
bool relative_theta(const MlsWarpOptions& options, const VectorXd& weights, double floor_px,
                    double scale_px, Eigen::Ref<VectorXd> theta) {
  Index nearest = 0;
  if (!std::isfinite(theta.minCoeff(&nearest))) return false;
  const double closest = std::max(theta[nearest], floor_px);
  for (Index s = 0; s < theta.size(); ++s) {
    if (!std::isfinite(theta[s])) {
      theta[s] = 0.0;
      continue;
    }
    const double d = std::max(theta[s], floor_px);
    if (options.falloff == MlsFalloff::power) {
      theta[s] = std::pow(closest / d, options.alpha);
    } else {
      const double x = d / scale_px;
      const double x0 = closest / scale_px;
      theta[s] = std::exp(x0 - x) * std::expm1(-2.0 * x0) / std::expm1(-2.0 * x);
    }
    theta[s] *= weights[s];
  }
  const double sum = theta.sum();
  if (!(sum > 0.0)) return false;
  theta /= sum;
  return true;
}

}  // namespace

MlsWarp::MlsWarp(const Points2& rest, const Points2& sources,
                 const std::vector<ControlSample>& samples, const VectorXd& weights,
                 const MatrixXd& distances, const VectorXd& radius, const MlsWarpOptions& options,
                 const RunControl& run)
    : options_(options),
      num_vertices_(rest.rows()),
      num_controls_(sources.rows()),
      rest_(rest),
      sources_(sources),
      radius_(radius) {
  const auto num_samples = static_cast<Index>(samples.size());
  require(distances.rows() == num_vertices_ && distances.cols() == num_samples,
          "distances need a row a vertex and a column a sample");
  require(weights.size() == num_samples, "there must be one weight a sample");
  require(radius.size() == num_controls_, "there must be one radius a control");
  require(options.alpha > 0.0 && options.alpha <= 20.0, "alpha must be in (0, 20]");
  require(options.scale_px >= 0.0 && std::isfinite(options.scale_px), "scale_px must be >= 0");
  for (Index s = 0; s < num_samples; ++s) {
    require(weights[s] > 0.0 && std::isfinite(weights[s]), "weights must be positive");
    const ControlSample& sample = samples[at(s)];
    require(sample.first >= 0 && sample.first < num_controls_ && sample.second >= 0 &&
                sample.second < num_controls_,
            "a sample names a control that is not there");
    for (Index v = 0; v < num_vertices_; ++v)
      require(!std::isnan(distances(v, s)) && distances(v, s) >= 0.0, "distances must be >= 0");
  }
  const double diagonal = std::max(box_diagonal(rest), box_diagonal(sources));
  double scale_px = options.scale_px > 0.0 ? options.scale_px : 0.1 * box_diagonal(sources);
  if (scale_px == 0.0) scale_px = std::max(diagonal, 1.0);
  if (num_controls_ > 0) origin_ = sources.colwise().mean();
  rest_.rowwise() -= origin_;

  Points2 places(num_samples, 2);
  for (Index s = 0; s < num_samples; ++s) {
    const ControlSample& sample = samples[at(s)];
    places.row(s) = (1.0 - sample.t) * (sources.row(sample.first) - origin_) +
                    sample.t * (sources.row(sample.second) - origin_);
  }
  arm_ = Points2::Zero(num_vertices_, 2);
  inverse_ = VectorXd::Zero(num_vertices_);
  is_turning_ = VectorXd::Zero(num_vertices_);
  size_ = VectorXd::Zero(num_vertices_);
  const Index num_blocks = (num_vertices_ + kBlock - 1) / kBlock;
  table_.assign(at(num_blocks * num_controls_ * 3 * kBlock), 0.0);
  const double floor_px = std::max(kNearest * diagonal, 1e-300);
  parallel_for(0, num_vertices_, 256, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      if (v % 256 == 0 && run.cancelled()) return;
      precompute_vertex(v, rest_, places, samples, weights, distances, floor_px, scale_px);
    }
  });
  run.throw_if_cancelled();
}

void MlsWarp::precompute_vertex(Index v, const Points2& rest, const Points2& places,
                                const std::vector<ControlSample>& samples, const VectorXd& weights,
                                const MatrixXd& distances, double floor_px, double scale_px) {
  VectorXd theta = distances.row(v).transpose();
  if (theta.size() == 0 || !relative_theta(options_, weights, floor_px, scale_px, theta)) return;
  // Differences from the heaviest sample: beside it all others weigh next to nothing, and a mean of
  // absolute positions would lose their share to rounding.
  Index heaviest = 0;
  theta.maxCoeff(&heaviest);
  const RowVector2d base = places.row(heaviest);
  RowVector2d mean = RowVector2d::Zero();
  for (Index s = 0; s < theta.size(); ++s) mean += theta[s] * (places.row(s) - base);
  const RowVector2d arm = (rest.row(v) - base) - mean;
  double moment = 0.0;
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  for (Index s = 0; s < theta.size(); ++s) {
    const RowVector2d hat = (places.row(s) - base) - mean;
    moment += theta[s] * hat.squaredNorm();
    moments += theta[s] * hat.transpose() * hat;
  }
  arm_.row(v) = arm;
  const bool is_turning = moment > 0.0 && std::isfinite(1.0 / moment);
  is_turning_[v] = is_turning ? 1.0 : 0.0;
  inverse_[v] = is_turning ? 1.0 / moment : 1.0;
  const bool is_affine =
      options_.kind == MlsKind::affine && moments.determinant() > kOnALine * moment * moment;
  const RowVector2d solved =
      is_affine ? RowVector2d(arm * moments.inverse().eval()) : RowVector2d(inverse_[v] * arm);
  double* block = table_.data() + (v / kBlock) * num_controls_ * 3 * kBlock + v % kBlock;
  for (Index s = 0; s < theta.size(); ++s) {
    if (theta[s] == 0.0) continue;
    const RowVector2d hat = (places.row(s) - base) - mean;
    // A b-hat = (c + i (-s)) b-hat as complex numbers: M(u) M(a) of Eq. 7.11 is u conj(a).
    const double c = theta[s] * solved.dot(hat);
    const double turn = is_affine ? 0.0 : theta[s] * (solved.x() * hat.y() - solved.y() * hat.x());
    size_[v] += std::hypot(c, turn);
    const ControlSample& sample = samples[at(s)];
    const auto add = [&](std::int32_t control, double share) {
      double* entry = block + control * 3 * kBlock;
      entry[0] += share * theta[s];
      entry[kBlock] += share * c;
      entry[2 * kBlock] += share * turn;
    };
    add(sample.first, 1.0 - sample.t);
    if (sample.t != 0.0) add(sample.second, sample.t);
  }
}

Points2 MlsWarp::deform(const Points2& targets, const VectorXd& rotations) const {
  require(targets.rows() == num_controls_, "there must be one target a control");
  require(rotations.size() == 0 || rotations.size() == num_controls_,
          "there must be one rotation a control, or none");
  // Sums of displacements: where nothing moves they are zero to the bit, however unevenly the
  // weights are spread.
  const Points2 moved = targets - sources_;
  const double extent = num_controls_ == 0 ? 0.0 : moved.rowwise().norm().maxCoeff();
  Points2 turns = Points2::Zero(num_controls_, 2);  // r^2 (cos, sin), 0 where none is said
  VectorXd squares = VectorXd::Zero(num_controls_);
  bool has_turns = false;
  for (Index m = 0; m < rotations.size(); ++m) {
    if (std::isnan(rotations[m])) continue;
    const double square = radius_[m] * radius_[m];
    squares[m] = square;
    turns.row(m) << square * std::cos(rotations[m]), square * std::sin(rotations[m]);
    has_turns = true;
  }
  const bool is_rigid = options_.kind == MlsKind::rigid;
  Points2 result(num_vertices_, 2);
  const Index num_blocks = (num_vertices_ + kBlock - 1) / kBlock;
  parallel_for(0, num_blocks, 64, [&](Index first_block, Index last_block) {
    for (Index block = first_block; block < last_block; ++block) {
      std::array<double, kBlock> mean_x{}, mean_y{}, x{}, y{}, total{}, turn{}, turn_x{}, turn_y{};
      const double* entry = table_.data() + block * num_controls_ * 3 * kBlock;
      for (Index m = 0; m < num_controls_; ++m, entry += 3 * kBlock) {
        const double bx = moved(m, 0);
        const double by = moved(m, 1);
        for (std::size_t i = 0; i < kBlock; ++i) {
          const double w = entry[i];
          const double c = entry[kBlock + i];
          const double s = entry[2 * kBlock + i];
          mean_x[i] += w * bx;
          mean_y[i] += w * by;
          total[i] += w;
          x[i] += c * bx + s * by;
          y[i] += c * by - s * bx;
        }
        if (!has_turns) continue;
        for (std::size_t i = 0; i < kBlock; ++i) {
          turn[i] += entry[i] * squares[m];
          turn_x[i] += entry[i] * turns(m, 0);
          turn_y[i] += entry[i] * turns(m, 1);
        }
      }
      const Index first = block * kBlock;
      const Index count = std::min(kBlock, num_vertices_ - first);
      for (Index k = 0; k < count; ++k) {
        const auto i = at(k);
        const Index v = first + k;
        if (total[i] == 0.0) {
          result.row(v) = rest_.row(v) + origin_;
          continue;
        }
        RowVector2d turned(is_turning_[v] * arm_(v, 0) + x[i], is_turning_[v] * arm_(v, 1) + y[i]);
        const RowVector2d arm = arm_.row(v);
        const double tx = inverse_[v] * turn_x[i];
        const double ty = inverse_[v] * turn_y[i];
        turned += RowVector2d(arm.x() * tx - arm.y() * ty, arm.x() * ty + arm.y() * tx);
        const double share = is_turning_[v] + inverse_[v] * turn[i];
        const double reach = size_[v] * extent + arm.norm() * share;  // the longest that it can be
        const double length = turned.norm();
        if (length <= kNoTurn * reach || length == 0.0)
          turned = arm;
        else
          turned *= is_rigid ? arm.norm() / length : 1.0 / share;
        result(v, 0) = origin_.x() + rest_(v, 0) - arm.x() + mean_x[i] + turned.x();
        result(v, 1) = origin_.y() + rest_(v, 1) - arm.y() + mean_y[i] + turned.y();
      }
    }
  });
  return result;
}

MatrixXd MlsWarp::weights() const {
  MatrixXd result(num_vertices_, num_controls_);
  for (Index v = 0; v < num_vertices_; ++v) {
    const double* block = table_.data() + (v / kBlock) * num_controls_ * 3 * kBlock + v % kBlock;
    for (Index m = 0; m < num_controls_; ++m) result(v, m) = block[m * 3 * kBlock];
  }
  return result;
}

}  // namespace dupin
