#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>

namespace dupin::detail {

// Lights of the view frame: a key from the upper left, a weak fill from the right, and a sky that
// is brighter above. Their sum on a surface that faces the viewer is close to 1, so that colours
// on the surface match those of the colour bar.
inline const Eigen::Vector3f kKeyLight = Eigen::Vector3f(-0.40F, 0.55F, 0.73F).normalized();
inline const Eigen::Vector3f kFillLight = Eigen::Vector3f(0.80F, -0.05F, 0.60F).normalized();

/// x^32 and x^64 for x in [0, 1]: std::pow would be the dearest step of a sample.
inline float power_32(float x) {
  const float x4 = (x * x) * (x * x);
  const float x16 = (x4 * x4) * (x4 * x4);
  return x16 * x16;
}
inline float power_64(float x) { return power_32(x) * power_32(x); }

/// Light on a surface with unit `normal` that sees `sky` (in [0, 1]) of the hemisphere.
inline float diffuse_light(const Eigen::Vector3f& normal, float sky) {
  const float key = std::max(0.0F, normal.dot(kKeyLight));
  const float fill = std::max(0.0F, normal.dot(kFillLight));
  const float ambient = 0.30F + 0.12F * normal.y();
  // Nothing casts a sharp shadow; a closed-in place still gets less of the lights.
  return ambient * sky + (0.78F * key + 0.14F * fill) * (0.40F + 0.60F * sky);
}

/// Energy towards `view` (unit) of a surface of colour `albedo`: the light above, a weak wide
/// highlight of the key light, and a darker rim that draws the shape on white paper.
inline Eigen::Vector3f shaded(const Eigen::Vector3f& normal, const Eigen::Vector3f& view,
                              const Eigen::Vector3f& albedo, float sky) {
  const Eigen::Vector3f half = (kKeyLight + view).normalized();
  const float shine = power_32(std::max(0.0F, normal.dot(half)));
  const float facing = std::clamp(normal.dot(view), 0.0F, 1.0F);
  const float away = 1.0F - facing;
  const float rim = 1.0F - 0.35F * away * away * away;
  return (albedo * (diffuse_light(normal, sky) * rim)).array() + 0.05F * shine * sky;
}

/// Ball of a keypoint: flatter than a surface, so that its colour tells its kind at any place.
inline Eigen::Vector3f shaded_bubble(const Eigen::Vector3f& normal, const Eigen::Vector3f& view,
                                     const Eigen::Vector3f& albedo) {
  const Eigen::Vector3f half = (kKeyLight + view).normalized();
  const float shine = power_64(std::max(0.0F, normal.dot(half)));
  return (albedo * (0.62F + 0.38F * std::max(0.0F, normal.dot(kKeyLight)))).array() + 0.25F * shine;
}

/// Share of the light from behind that a bubble keeps back where its surface makes the cosine
/// `facing` with the view: little in the middle, more at the rim, all for opacity 1.
inline float bubble_alpha(float opacity, float facing) {
  const float away = 1.0F - std::clamp(facing, 0.0F, 1.0F);
  const float film = std::min(0.92F, opacity * (0.45F + 2.2F * away * away * away));
  const float solid = opacity * opacity * opacity * opacity;
  return film + (1.0F - film) * solid * solid;
}

}  // namespace dupin::detail
