#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"

namespace dupin::test {

/// Bumps and dents of a rugged body, on a sphere of radius one before it is stretched.
struct RuggedBody {
  int bumps = 120;
  double height = 0.12;  ///< largest
  double narrowest = 0.1;
  double widest = 0.35;
  Eigen::Vector3d stretch{1.4, 1.15, 1.0};
};

/// A body with bumps and dents of many sizes and no symmetry; each `seed` another one.
inline Mesh rugged_body(std::uint64_t seed, Eigen::Index num_vertices,
                        const RuggedBody& body = {}) {
  Mesh solid = make_sphere(1.0, num_vertices).mesh;
  Rng rng(seed);
  Eigen::VectorXd radius = Eigen::VectorXd::Ones(solid.points.rows());
  for (int i = 0; i < body.bumps; ++i) {
    const Eigen::Vector3d center =
        Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()).normalized();
    const double height = rng.uniform(-body.height, body.height);
    const double width = rng.uniform(body.narrowest, body.widest);
    radius.array() += height * ((solid.points * center).array() - 1.0).unaryExpr([&](double x) {
      return std::exp(x / (width * width));
    });
  }
  solid.points = solid.points.array().colwise() * radius.array();
  solid.points *= body.stretch.asDiagonal();
  return solid;
}

}  // namespace dupin::test
