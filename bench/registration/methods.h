#pragma once

// What bench/registration_quality.cpp compares: each method takes a pair and answers with a pose.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/registration/pairs.h"
#include "dupin/registration/pose.h"

namespace dupin::bench {

struct Answer {
  bool is_accepted = false;
  Pose pose;             ///< from moving to fixed
  double seconds = 0.0;  ///< CPU of the process, without reading
};

struct Method {
  std::string name;
  bool knows_scale = true;  ///< takes the scale as given: left out where it is unknown
  /// Registers a pair; the fixed part is bare points with `is_cloud`.
  std::function<Answer(const test::ScanPair& pair, bool is_cloud)> run;
};

/// Our methods, blind: none starts from where the scans are.
std::vector<Method> registration_methods();

/// The product as users meet it: where the scans are is one of its starts.
Method from_given_pose();

/// A pose from point pairs most of which are wrong.
struct PoseEstimator {
  std::string name;
  std::function<Answer(const Points& from, const Points& to, double noise_bound)> run;
};
std::vector<PoseEstimator> pose_estimators();

/// CPU seconds of the process so far.
double cpu_seconds();

}  // namespace dupin::bench
