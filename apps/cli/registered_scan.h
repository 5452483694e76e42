#pragma once

#include "dupin/io/surface_io.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/scan_features.h"
#include "surface_input.h"

namespace dupin::cli {

/// x_input = unit x_local + shift.
Pose local_to_input(const LoadedSurface& surface);

/// describe_scan() of a surface whose local coordinates are multiplied by `scale`.
ScanFeatures describe_loaded(const LoadedSurface& surface, double scale, const RunControl& run);

/// 4 by 4, rows.
nlohmann::ordered_json matrix_of(const Pose& pose);

/// The warnings of one of several files: each says which.
nlohmann::ordered_json warnings_of(const std::string& file, const LoadedSurface& surface);

/// The scan with the vertices of its file.
SurfaceOutput as_given(const LoadedSurface& surface);

/// Adds `scan`, moved by `pose`, to `all`.
void append_scan(SurfaceOutput& all, const SurfaceOutput& scan, const Pose& pose);

}  // namespace dupin::cli
