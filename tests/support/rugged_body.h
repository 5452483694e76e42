#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"

namespace dupin::test {

/// A body with bumps and dents of many sizes and no symmetry; each `seed` another one.
inline Mesh rugged_body(std::uint64_t seed, Eigen::Index num_vertices) {
  Mesh solid = make_sphere(1.0, num_vertices).mesh;
  Rng rng(seed);
  Eigen::VectorXd radius = Eigen::VectorXd::Ones(solid.points.rows());
  for (int i = 0; i < 120; ++i) {
    const Eigen::Vector3d center =
        Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()).normalized();
    const double height = rng.uniform(-0.12, 0.12);
    const double width = rng.uniform(0.1, 0.35);
    radius.array() += height * ((solid.points * center).array() - 1.0).unaryExpr([&](double x) {
      return std::exp(x / (width * width));
    });
  }
  solid.points = solid.points.array().colwise() * radius.array();
  solid.points.col(0) *= 1.4;
  solid.points.col(1) *= 1.15;
  return solid;
}

}  // namespace dupin::test
