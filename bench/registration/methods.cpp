#include "bench/registration/methods.h"

#include <ctime>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/registration/register.h"
#include "dupin/registration/robust_pose.h"
#include "dupin/registration/thesis_registration.h"
#include "dupin/surface/surface_graph.h"

namespace dupin::bench {
namespace {

SurfaceGraph graph_of(const Mesh& part, bool is_cloud) {
  return is_cloud ? surface_graph(PointCloud{part.points, {}}) : surface_graph(part);
}

// Real scans have no faces on either side.
bool is_bare(const Mesh& part) { return part.triangles.rows() == 0; }

ScanFeatures features_of(const Mesh& part, bool is_cloud) {
  return is_cloud ? describe_scan(PointCloud{part.points, {}}) : describe_scan(part);
}

// Runs `work` and counts its CPU seconds; data on which a method cannot work are a refusal.
Answer timed(const std::function<void(Answer&)>& work) {
  Answer answer;
  const double start = cpu_seconds();
  try {
    work(answer);
  } catch (const AnalysisError&) {
    answer.is_accepted = false;
  }
  answer.seconds = cpu_seconds() - start;
  return answer;
}

Answer by_product(const test::ScanPair& pair, bool is_cloud, const RegistrationOptions& options) {
  return timed([&](Answer& answer) {
    const RegistrationResult found = register_scans(features_of(pair.moving, is_bare(pair.moving)),
                                                    features_of(pair.fixed, is_cloud), options);
    answer.is_accepted = found.accepted;
    answer.pose = found.pose;
  });
}

Answer by_thesis(const test::ScanPair& pair, bool is_cloud, Signal signal) {
  return timed([&](Answer& answer) {
    ThesisRegistrationOptions options;
    options.features.signal = signal;
    const ThesisRegistration found = register_by_thesis(graph_of(pair.moving, is_bare(pair.moving)),
                                                        graph_of(pair.fixed, is_cloud), options);
    answer.is_accepted = found.is_found;
    answer.pose = found.pose;
  });
}

}  // namespace

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::vector<Method> registration_methods() {
  std::vector<Method> methods;
  for (const bool estimates_scale : {false, true}) {
    methods.push_back({estimates_scale ? "dupin, unknown scale" : "dupin", !estimates_scale,
                       [estimates_scale](const test::ScanPair& pair, bool is_cloud) {
                         RegistrationOptions options;
                         options.estimate_scale = estimates_scale;
                         options.try_given_pose = false;
                         return by_product(pair, is_cloud, options);
                       }});
  }
  methods.push_back({"thesis 5.5, height", true, [](const test::ScanPair& pair, bool is_cloud) {
                       return by_thesis(pair, is_cloud, Signal::height);
                     }});
  methods.push_back({"thesis 5.5, Taubin's H", true, [](const test::ScanPair& pair, bool is_cloud) {
                       return by_thesis(pair, is_cloud, Signal::mean);
                     }});
  return methods;
}

Method from_given_pose() {
  return {"dupin, from the given pose", true, [](const test::ScanPair& pair, bool is_cloud) {
            RegistrationOptions options;
            options.estimate_scale = false;
            return by_product(pair, is_cloud, options);
          }};
}

std::vector<PoseEstimator> pose_estimators() {
  std::vector<PoseEstimator> estimators;
  estimators.push_back({"least squares", [](const Points& from, const Points& to, double) {
                          return timed([&](Answer& answer) {
                            answer.pose = fit_pose(from, to);
                            answer.is_accepted = true;
                          });
                        }});
  for (const bool with_scale : {false, true}) {
    estimators.push_back({with_scale ? "dupin, unknown scale" : "dupin",
                          [with_scale](const Points& from, const Points& to, double noise_bound) {
                            return timed([&](Answer& answer) {
                              RobustPoseOptions options;
                              options.noise_bound = noise_bound;
                              options.with_scale = with_scale;
                              const RobustPose found = robust_pose(from, to, options);
                              answer.pose = found.pose;
                              answer.is_accepted = found.is_found;
                            });
                          }});
  }
  return estimators;
}

}  // namespace dupin::bench
