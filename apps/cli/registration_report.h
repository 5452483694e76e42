#pragma once

#include <string>
#include <vector>

#include "context.h"
#include "dupin/registration/residuals.h"
#include "html_report.h"
#include "registration_answer.h"
#include "registration_pictures.h"
#include "svg_plot.h"

namespace dupin::cli {

/// Pictures of one registration, each in two views or one.
struct RegistrationPictures {
  std::vector<RegistrationPicture> before;   ///< the scans as their files give them
  std::vector<RegistrationPicture> after;    ///< in the frame of the fixed scan
  std::vector<RegistrationPicture> matches;  ///< side by side, with lines between features
};

/// `after` and `matches` are empty where there is no pose.
RegistrationPictures pictures_of(const RegistrationAnswer& answer);

/// Distances of the points of both scans that lie over the other one.
Plot distance_plot(const RegistrationAnswer& answer, const ScanResiduals& residuals);

/// What the histogram shows, in one sentence with the shares of points.
std::string distance_caption(const RegistrationAnswer& answer, const ScanResiduals& residuals);

/// The page of `dupin register --report`: the same bytes for the same inputs and options.
std::string registration_page(const RegistrationAnswer& answer, const std::string& moving,
                              const std::string& fixed, const std::string& command,
                              const RunControl& run);

}  // namespace dupin::cli
