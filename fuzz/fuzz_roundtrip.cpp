#include "fuzz/fuzz_surface.h"

// The input is a surface: a byte for the format, one for the number of vertices, coordinates as
// doubles of any bits, then a byte an index. Writing and reading it gives it back: bit for bit, or
// for STL, which has no numbering, from the second time on.
namespace dupin::fuzz {
namespace {

SurfaceOutput surface_of(const std::uint8_t* data, std::size_t size) {
  SurfaceOutput surface;
  const std::size_t num_points =
      std::min<std::size_t>(1 + data[0], (size - 1) / (3 * sizeof(double)));
  surface.points.resize(static_cast<Eigen::Index>(num_points), 3);
  const std::size_t point_bytes = num_points * 3 * sizeof(double);
  if (num_points > 0) std::memcpy(surface.points.data(), data + 1, point_bytes);
  const std::size_t num_faces = num_points == 0 ? 0 : (size - 1 - point_bytes) / 3;
  surface.triangles.resize(static_cast<Eigen::Index>(num_faces), 3);
  for (std::size_t i = 0; i < 3 * num_faces; ++i) {
    surface.triangles.data()[i] = static_cast<std::int32_t>(data[1 + point_bytes + i] % num_points);
  }
  return surface;
}

SurfaceFile read_back(const SurfaceOutput& surface, SurfaceFormat format) {
  const std::string text = format_surface(surface, format);
  constexpr Parse kParsers[] = {detail::parse_ply, detail::parse_ply, detail::parse_obj,
                                detail::parse_off, detail::parse_stl, detail::parse_stl};
  const Parse parse = kParsers[static_cast<std::size_t>(format)];
  const auto file =
      try_parse(parse, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  require(file.has_value());
  require(file->warnings.empty());
  require_sound(file->mesh);
  return *file;
}

SurfaceOutput output_of(const PolygonMesh& mesh) {
  SurfaceOutput surface;
  surface.points = mesh.points;
  surface.triangles = Eigen::Map<const Triangles>(mesh.face_index.data(), mesh.num_faces(), 3);
  return surface;
}

void check_roundtrip(const SurfaceOutput& surface, SurfaceFormat format) {
  const PolygonMesh mesh = read_back(surface, format).mesh;
  require(mesh.num_faces() == surface.triangles.rows());
  const SurfaceOutput again = output_of(mesh);
  if (format == SurfaceFormat::stl_ascii || format == SurfaceFormat::stl_binary) {
    require(is_same(read_back(again, format).mesh, mesh));
  } else {
    require(is_same(again.points, surface.points) && is_same(again.triangles, surface.triangles));
  }
}

}  // namespace
}  // namespace dupin::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 3) return 0;
  const auto format = static_cast<dupin::SurfaceFormat>(data[0] % 6);
  const dupin::SurfaceOutput surface = dupin::fuzz::surface_of(data + 1, size - 1);
  try {
    dupin::format_surface(surface, format);
  } catch (const dupin::InvalidArgument&) {
    return 0;
  }
  dupin::fuzz::check_roundtrip(surface, format);
  return 0;
}
