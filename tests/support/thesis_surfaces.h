#pragma once

// Surfaces of section 4.3 of the thesis, shared by its tests and bench/thesis_chapter4.cpp. Radii
// are not given there; docs/methods/local_scale.md says why these.

#include <Eigen/Core>
#include <cmath>

#include "dupin/mesh/mesh.h"
#include "dupin/mesh/shapes.h"

namespace dupin::thesis {

/// A point of a surface, and the mean edge by which noise is measured.
struct Site {
  Points points;
  Eigen::Index vertex = 0;
  Eigen::RowVector3d normal{0.0, 0.0, 1.0};
  double edge = 0.02;
};

inline constexpr double kTorusMajor = 0.8;
inline constexpr double kTorusMinor = 0.4;

/// Where on the torus: K < 0, K = 0, K > 0.
enum class TorusPoint { hyperbolic, parabolic, elliptic };

/// A grid in both angles, as the printed radii show: denser inside than outside.
inline Site torus(TorusPoint where, bool quarter) {
  const Eigen::Index around = quarter ? 144 : 288;
  const Eigen::Index tube = around / 2;
  Site site;
  site.points.resize(around * tube, 3);
  for (Eigen::Index i = 0; i < around; ++i) {
    const double u = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(around);
    for (Eigen::Index j = 0; j < tube; ++j) {
      const double v = 2.0 * M_PI * static_cast<double>(j) / static_cast<double>(tube);
      const double reach = kTorusMajor + kTorusMinor * std::cos(v);
      site.points.row(i * tube + j) << reach * std::cos(u), reach * std::sin(u),
          kTorusMinor * std::sin(v);
    }
  }
  if (where == TorusPoint::elliptic) {
    site.vertex = 0;
    site.normal << 1.0, 0.0, 0.0;
  } else if (where == TorusPoint::parabolic) {
    site.vertex = tube / 4;
  } else {
    site.vertex = tube / 2;
    site.normal << -1.0, 0.0, 0.0;
  }
  return site;
}

inline Site plane() {
  const AnalyticSurface surface = make_plane({.half_width = 1.0, .num_vertices = 12'800});
  Site site;
  site.points = surface.mesh.points;
  site.points.rowwise().squaredNorm().minCoeff(&site.vertex);
  return site;
}

inline Site cylinder() {
  const double height = 1.5;
  const AnalyticSurface surface =
      make_cylinder(1.0, height, static_cast<Eigen::Index>(3200.0 * 2.0 * M_PI * height));
  Site site;
  site.points = surface.mesh.points;
  site.points.col(2).cwiseAbs().minCoeff(&site.vertex);
  site.normal = surface.normals.row(site.vertex);
  return site;
}

/// An icosahedron whose edges are halved six times: 40962 vertices, mean edge .0189. The vertex is
/// one of the second subdivision.
inline Site sphere() {
  const AnalyticSurface surface = make_icosphere(1.0, 6);
  Site site;
  site.points = surface.mesh.points;
  site.vertex = 162;
  site.normal = surface.normals.row(site.vertex);
  double sum = 0.0;
  const Triangles& triangles = surface.mesh.triangles;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      sum += (site.points.row(triangles(f, c)) - site.points.row(triangles(f, (c + 1) % 3))).norm();
    }
  }
  site.edge = sum / (3.0 * static_cast<double>(triangles.rows()));
  return site;
}

}  // namespace dupin::thesis
