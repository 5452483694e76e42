#pragma once

#include <Eigen/Core>
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/features/keypoints.h"
#include "dupin/mesh/polygon_mesh.h"
#include "dupin/scalespace/scale_space.h"
#include "html_report.h"
#include "surface_picture.h"

namespace dupin::cli {

/// Pictures of the demo. [px]
constexpr int kDemoWidth = 1000;
constexpr int kDemoHeight = 800;

/// A surface of the demo: from a file, or made here and written beside the page.
struct DemoSubject {
  std::string name;  ///< of its files
  std::string title;
  std::string note;
  std::string view = "iso";
  std::string file;  ///< as the command lines name it
  PolygonMesh mesh;
};

/// What a subject took. [s]
struct DemoTiming {
  std::string name;
  Eigen::Index vertices = 0;
  Eigen::Index faces = 0;
  double signal = 0.0;
  double stack = 0.0;
  double keypoints = 0.0;
  double pictures = 0.0;
  WarningList warnings;
};

/// What the chain computed of one subject. Local units, until to_input_unit() was called.
struct DemoAnalysis {
  LoadedSurface surface;
  Eigen::VectorXd signal;
  LevelSchedule schedule;
  Eigen::VectorXd tau;
  LevelMatrix loc;
  double mean_edge = 0.0;  ///< input unit
  std::vector<Keypoint> keypoints;
};

class Watch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> seconds = now - last_;
    last_ = now;
    return seconds.count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Signal, scale space and keypoints of a subject, all with the defaults of the program.
DemoAnalysis analyse(const DemoSubject& subject, DemoTiming& timing, Context& context);
void to_input_unit(DemoAnalysis& analysis);

/// The surface of `analysis` and a scale bar.
Scene plain_scene(const DemoAnalysis& analysis, const std::string& title);

/// Draws `scene` into NAME-SUFFIX.png of `directory`.
ReportPicture draw(const std::filesystem::path& directory, const DemoSubject& subject,
                   const std::string& suffix, const Scene& scene, const std::string& caption,
                   Context& context);

/// Writes the mesh of `subject` as a PLY.
void write_subject(const DemoSubject& subject);

/// A noisy scan and how sure its keypoints are, beside `clean`, the analysis of `subject`. Returns
/// its figures.
nlohmann::ordered_json add_noisy_scan(HtmlReport& report, const std::filesystem::path& directory,
                                      const DemoSubject& subject, const DemoAnalysis& clean,
                                      Context& context);

/// How many neighbours curvature needs, all over a torus.
void add_local_scale(HtmlReport& report, const std::filesystem::path& directory, Context& context);

}  // namespace dupin::cli
