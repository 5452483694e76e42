#include "dupin/warp/pixel_runs.h"

#include <algorithm>

namespace dupin::detail {
namespace {

// After so many rows it is known how many runs there will be.
constexpr std::size_t kRowsToJudgeBy = 64;

std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

std::int32_t root_of(std::vector<std::int32_t>& parent, std::int32_t run) {
  while (parent[at(run)] != run) {
    parent[at(run)] = parent[at(parent[at(run)])];
    run = parent[at(run)];
  }
  return run;
}

}  // namespace

PartJoiner::PartJoiner(std::int32_t height) {
  result_.row_begin.reserve(at(height) + 1);
  result_.row_begin.push_back(0);
}

void PartJoiner::add_row(const std::vector<PixelRun>& row) {
  std::vector<std::int32_t>& parent = result_.of_run;
  const auto first_below = static_cast<std::int32_t>(parent.size());
  const auto first_above = first_below - static_cast<std::int32_t>(above_.size());
  for (std::size_t i = 0; i < row.size(); ++i) {
    parent.push_back(first_below + static_cast<std::int32_t>(i));
    is_thick_.push_back(false);
  }
  std::size_t above = 0;
  std::size_t below = 0;
  while (above < above_.size() && below < row.size()) {
    const PixelRun& a = above_[above];
    const PixelRun& b = row[below];
    const std::int32_t shared = std::min(a.end, b.end) - std::max(a.begin, b.begin);
    if (shared > 0) {
      // The smaller number is the root, so a root is the first run of its part.
      const std::int32_t one = root_of(parent, first_above + static_cast<std::int32_t>(above));
      const std::int32_t other = root_of(parent, first_below + static_cast<std::int32_t>(below));
      parent[at(std::max(one, other))] = std::min(one, other);
      if (shared > 1) is_thick_[at(first_below) + below] = true;
    }
    // The run that ends first has met all its neighbours.
    if (a.end <= b.end) ++above;
    if (b.end <= a.end) ++below;
  }
  above_ = row;
  result_.row_begin.push_back(static_cast<std::int32_t>(parent.size()));
  const std::size_t num_rows = result_.row_begin.size() - 1;
  if (num_rows == kRowsToJudgeBy)
    parent.reserve(parent.size() / kRowsToJudgeBy * result_.row_begin.capacity() * 17 / 16);
}

PixelParts PartJoiner::finish() {
  std::vector<std::int32_t>& label = result_.of_run;
  std::size_t num_parts = 0;
  for (std::size_t i = 0; i < label.size(); ++i)
    if (at(label[i]) == i) ++num_parts;
  result_.parts.reserve(num_parts);
  // In place: runs before i hold -1 - part already, and a run that is no root names one of them.
  for (std::size_t i = 0; i < label.size(); ++i) {
    if (at(label[i]) == i) {
      label[i] = -1 - static_cast<std::int32_t>(result_.parts.size());
      result_.parts.push_back({});
    } else {
      label[i] = label[at(label[i])];
    }
    if (is_thick_[i]) result_.parts[at(-1 - label[i])].is_thin = false;
  }
  for (std::int32_t& part : label) part = -1 - part;
  return std::move(result_);
}

}  // namespace dupin::detail
