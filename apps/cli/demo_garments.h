#pragma once

#include <string>
#include <vector>

#include "dupin/image/raster.h"
#include "dupin/warp/project.h"

namespace dupin::cli {

/// A garment drawn here, cut out of its background, and a pose for it.
struct DemoGarment {
  std::string name;   ///< of its files
  std::string title;  ///< what it shows
  std::string note;   ///< what the pins do
  Raster picture;
  std::vector<WarpPin> pins;
};

/// A striped shirt whose sleeves go down, trousers that take a step, a dress whose hem swings.
std::vector<DemoGarment> demo_garments();

}  // namespace dupin::cli
