#include "dupin/io/reader_tools.h"

#include <utility>

namespace dupin::detail {

void check_run(const RunControl& run, std::int64_t done, std::int64_t total) {
  run.throw_if_cancelled();
  if (total > 0) run.report(static_cast<double>(done) / static_cast<double>(total));
}

void check_claim(const char* what, std::int64_t claimed, std::int64_t limit,
                 std::int64_t least_bytes, std::int64_t bytes_left, const Location& location) {
  const std::int64_t most = std::min(limit, kMaxIndex);
  if (claimed <= most) return;
  const std::string claim = "the file claims " + std::to_string(claimed) + " " + what;
  if (claimed > bytes_left / std::max<std::int64_t>(least_bytes, 1)) {
    throw IoError(Errc::over_limit, "E_COUNT_EXCEEDS_FILE",
                  claim + " of at least " + std::to_string(least_bytes) + " bytes, and " +
                      std::to_string(bytes_left) + " bytes follow",
                  location);
  }
  throw IoError(Errc::over_limit, "E_TOO_LARGE", claim + ", the limit is " + std::to_string(most),
                location, std::string("raise it with --max-") + what);
}

void fail_index(std::int64_t face, std::int64_t vertex, std::int64_t num_vertices,
                const Location& location) {
  throw IoError(Errc::malformed, "E_INDEX_RANGE",
                "face " + std::to_string(face) + " uses vertex " + std::to_string(vertex) +
                    ", but the file has " + std::to_string(num_vertices) + " (0.." +
                    std::to_string(num_vertices - 1) + ")",
                location);
}

void fail_polygon(std::int64_t face, std::int64_t size, const ReadLimits& limits,
                  const Location& location) {
  throw IoError(Errc::over_limit, "E_TOO_LARGE",
                "face " + std::to_string(face) + " has " + std::to_string(size) +
                    " vertices, the limit is " + std::to_string(limits.max_polygon),
                location, "raise it with --max-polygon");
}

void fail_nonfinite(std::int64_t vertex, const Location& location) {
  throw IoError(Errc::impossible, "E_NONFINITE",
                "vertex " + std::to_string(vertex) + " has a coordinate that is not finite",
                location, "--drop-nonfinite removes such vertices and their faces");
}

void fail_limit(const char* what, std::int64_t limit, const Location& location) {
  throw IoError(
      Errc::over_limit, "E_TOO_LARGE",
      "more than " + std::to_string(std::min(limit, kMaxIndex)) + " " + what + ", the limit",
      location, std::string("raise it with --max-") + what);
}

void FaceList::grow_capacity(std::int64_t count) {
  // The offsets are 32 bits wide too.
  if (size_ + count > kMaxIndex) fail_limit("faces", kMaxIndex, {});
  reserve_indices(std::min(kMaxIndex, std::max<std::int64_t>(4096, size_ + size_ / 2 + count)));
}

void FaceList::make_offsets() {
  has_offsets_ = true;
  offset_.resize(num_faces_ + num_faces_ / 2 + 1024);
  for (std::int64_t face = 0; face <= num_faces_; ++face) {
    offset_.data()[face] = static_cast<std::int32_t>(3 * face);
  }
}

void FaceList::move_to(PolygonMesh& mesh) {
  index_.conservativeResize(size_);
  if (has_offsets_) offset_.conservativeResize(num_faces_ + 1);
  mesh.face_index = std::move(index_);
  mesh.face_offset = std::move(offset_);
}

}  // namespace dupin::detail
