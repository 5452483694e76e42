#include "dupin/registration/pose.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

void check(const Points& from, const Points& to, const VectorXd& weights) {
  if (from.rows() != to.rows() || (weights.size() > 0 && weights.size() != from.rows())) {
    throw InvalidArgument("there are " + std::to_string(from.rows()) + " points, " +
                          std::to_string(to.rows()) + " places and " +
                          std::to_string(weights.size()) + " weights");
  }
  const auto is_finite = [](const double* values, Index count) {
    return std::all_of(values, values + count, [](double x) { return std::isfinite(x); });
  };
  if (!is_finite(from.data(), from.size()) || !is_finite(to.data(), to.size()) ||
      !is_finite(weights.data(), weights.size())) {
    throw InvalidArgument("a coordinate or weight is not finite");
  }
  if (weights.size() > 0 && weights.minCoeff() < 0.0) {
    throw InvalidArgument("a weight is negative");
  }
}

}  // namespace

Pose compose(const Pose& second, const Pose& first) {
  Pose both;
  both.scale = second.scale * first.scale;
  both.rotation = second.rotation * first.rotation;
  both.translation = second.scale * (second.rotation * first.translation) + second.translation;
  return both;
}

Pose inverse(const Pose& pose) {
  Pose back;
  back.scale = 1.0 / pose.scale;
  back.rotation = pose.rotation.transpose();
  back.translation = -back.scale * (back.rotation * pose.translation);
  return back;
}

Points transformed(const Points& points, const Pose& pose) {
  Points moved = pose.scale * (points * pose.rotation.transpose());
  moved.rowwise() += pose.translation.transpose();
  return moved;
}

Points turned(const Points& directions, const Pose& pose) {
  return directions * pose.rotation.transpose();
}

Eigen::RowVector3d moved_point(const Eigen::RowVector3d& point, const Pose& pose) {
  return (pose.scale * (pose.rotation * point.transpose()) + pose.translation).transpose();
}

Eigen::RowVector3d turned_direction(const Eigen::RowVector3d& direction, const Pose& pose) {
  return (pose.rotation * direction.transpose()).transpose();
}

double rotation_angle(const Matrix3d& a, const Matrix3d& b) {
  const Matrix3d r = a.transpose() * b;
  const Vector3d axis(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
  return std::atan2(axis.norm(), r.trace() - 1.0);
}

Matrix3d nearest_rotation(const Matrix3d& m) {
  const Eigen::JacobiSVD<Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vector3d signs = Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs[2] = -1.0;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Matrix3d rotation_of(const Vector3d& turn) {
  const double angle = turn.norm();
  if (!(angle > 0.0)) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

Matrix3d random_rotation(Rng& rng) {
  // A quaternion of normal deviates has no preferred direction.
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  while (q.norm() < 1e-3) q << rng.normal(), rng.normal(), rng.normal(), rng.normal();
  q.normalize();
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

Pose fit_pose(const Points& from, const Points& to, const VectorXd& weights, bool with_scale) {
  check(from, to, weights);
  const VectorXd w = weights.size() > 0 ? weights : VectorXd::Ones(from.rows());
  const double total = w.sum();
  const auto undetermined = [] {
    return AnalysisError("E_DEGENERATE",
                         "the points lie on one line or are fewer than three: no rotation is "
                         "determined");
  };
  if (!(total > 0.0) || (w.array() > 0.0).count() < 3) throw undetermined();
  const Vector3d from_center = from.transpose() * w / total;
  const Vector3d to_center = to.transpose() * w / total;
  const Points p = from.rowwise() - from_center.transpose();
  const Points q = to.rowwise() - to_center.transpose();
  // Scaled to one: neither the products nor their products leave the range of a double.
  const double p_size = p.size() > 0 ? p.cwiseAbs().maxCoeff() : 0.0;
  const double q_size = q.size() > 0 ? q.cwiseAbs().maxCoeff() : 0.0;
  if (!(p_size > 0.0) || !(q_size > 0.0)) throw undetermined();
  const Matrix3d cross = (q / q_size).transpose() * (w / total).asDiagonal() * (p / p_size);
  const Eigen::JacobiSVD<Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3d s = svd.singularValues();
  // Points of one line leave one singular value; rounding leaves the others at about 1e-16.
  if (!(s[1] > 64.0 * std::numeric_limits<double>::epsilon() * s[0])) throw undetermined();
  Vector3d signs = Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs[2] = -1.0;
  Pose pose;
  pose.rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  if (with_scale) {
    const double variance = (p / p_size).rowwise().squaredNorm().dot(w / total);
    pose.scale = signs.dot(s) / variance * (q_size / p_size);
    if (!(pose.scale > 0.0) || !std::isfinite(pose.scale)) throw undetermined();
  }
  pose.translation = to_center - pose.scale * (pose.rotation * from_center);
  return pose;
}

}  // namespace dupin
