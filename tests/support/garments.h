#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dupin/warp/planar_mesh.h"

namespace dupin::test {

enum class Garment { t_shirt, trousers, dress };

/// A made-up garment seen from the front, in pixels, with the true places of named points.
struct SyntheticGarment {
  Points2 outline;                 ///< closed, positive area
  std::vector<std::string> names;  ///< the same, in the same order, for every garment of a kind
  Points2 marks;                   ///< one row a name; some on the outline, some inside
  Eigen::Index num_outline = 0;    ///< so many of them, the first, lie on the outline
  double height = 0.0;             ///< of its box
};

struct GarmentOptions {
  double variation = 1.0;  ///< of proportions and pose, 0: the mean garment of the kind
  double noise_px = 0.5;   ///< of every corner, independent
  double wrinkles = 1.0;   ///< folds of the outline, 1: 0.25 % of the height, rms
  double height_px = 600.0;
  Eigen::Index num_corners = 900;
};

/// The outline starts at a random corner.
SyntheticGarment make_garment(Garment kind, std::uint64_t seed, const GarmentOptions& options = {});

}  // namespace dupin::test
