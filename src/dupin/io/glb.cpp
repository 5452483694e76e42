#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/formats.h"
#include "dupin/mesh/mesh.h"

namespace dupin::detail {
namespace {

using nlohmann::ordered_json;

// Beyond these powers of two, positions are scaled so that floats can hold them.
constexpr int kLargestExponent = 60;

void append_u32(std::string& bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<char>((value >> (8 * i)) & 0xFF));
}

void append_float(std::string& bytes, double value) {
  append_u32(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}

void append_u16(std::string& bytes, std::uint32_t value) {
  bytes.push_back(static_cast<char>(value & 0xFF));
  bytes.push_back(static_cast<char>(value >> 8));
}

const VertexProperty* find_property(const SurfaceOutput& surface, const char* name) {
  for (const VertexProperty& property : surface.properties) {
    if (property.name == name) return &property;
  }
  return nullptr;
}

/// glTF's colours are linear, ours sRGB (IEC 61966-2-1).
std::uint32_t linear_u16(double srgb) {
  const double c = std::clamp(srgb, 0.0, 255.0) / 255.0;
  const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  return static_cast<std::uint32_t>(std::lround(linear * 65535.0));
}

/// The two chunks of a file in the making: each list becomes a buffer view and an accessor.
class GlbWriter {
 public:
  explicit GlbWriter(const SurfaceOutput& surface) : surface_(surface) {}

  std::string format() {
    validate(Mesh{surface_.points, surface_.triangles});
    place();
    ordered_json primitives = ordered_json::array();
    if (surface_.points.rows() > 0) add_primitives(primitives);
    ordered_json node;
    node["translation"] = {center_[0], center_[1], center_[2]};
    if (exponent_ != 0) {
      const double unit = std::ldexp(1.0, exponent_);
      node["scale"] = {unit, unit, unit};
    }
    ordered_json document;
    document["asset"] = {{"version", "2.0"}, {"generator", "dupin"}};
    document["scene"] = 0;
    document["scenes"] = ordered_json::array({{{"nodes", {0}}}});
    if (!primitives.empty()) {
      node["mesh"] = 0;
      document["meshes"] = ordered_json::array({{{"primitives", primitives}}});
      ordered_json material;
      material["pbrMetallicRoughness"] = {{"metallicFactor", 0.0}, {"roughnessFactor", 0.8}};
      material["doubleSided"] = true;
      document["materials"] = ordered_json::array({material});
      document["accessors"] = accessors_;
      document["bufferViews"] = views_;
      document["buffers"] = ordered_json::array({{{"byteLength", bin_.size()}}});
    }
    document["nodes"] = ordered_json::array({node});
    return join(document.dump());
  }

 private:
  /// Floats hold 24 bits of a position, so positions are stored about their centre and the node
  /// brings them back.
  void place() {
    const Points& p = surface_.points;
    if (p.rows() == 0) return;
    for (int k = 0; k < 3; ++k) {
      // Halves first: the sum of two finite numbers may not be finite.
      center_[k] = 0.5 * p.col(k).minCoeff() + 0.5 * p.col(k).maxCoeff();
      extent_ = std::max(extent_, 0.5 * p.col(k).maxCoeff() - 0.5 * p.col(k).minCoeff());
    }
    if (!(extent_ > 0.0)) return;
    const int exponent = std::ilogb(extent_);
    if (std::abs(exponent) <= kLargestExponent) return;
    exponent_ = std::clamp(exponent, -1000, 1000);
  }

  double local(Eigen::Index i, int k) const {
    // Each part is scaled down first: a difference of extremes may overflow.
    return std::ldexp(surface_.points(i, k), -exponent_) - std::ldexp(center_[k], -exponent_);
  }

  void add_primitives(ordered_json& primitives) {
    ordered_json attributes;
    attributes["POSITION"] = add_positions();
    const ordered_json bare = attributes;
    if (surface_.triangles.rows() > 0) attributes["NORMAL"] = add_normals();
    const VertexProperty* red = find_property(surface_, "red");
    const VertexProperty* green = find_property(surface_, "green");
    const VertexProperty* blue = find_property(surface_, "blue");
    if (red != nullptr && green != nullptr && blue != nullptr) {
      attributes["COLOR_0"] = add_colors(*red, *green, *blue);
    }
    if (surface_.triangles.rows() > 0) {
      std::string data;
      for (Eigen::Index i = 0; i < surface_.triangles.size(); ++i) {
        append_u32(data, static_cast<std::uint32_t>(surface_.triangles.data()[i]));
      }
      primitives.push_back({{"attributes", attributes},
                            {"indices", add_list(data, 5125, "SCALAR", surface_.triangles.size())},
                            {"material", 0},
                            {"mode", 4}});
    } else {
      primitives.push_back({{"attributes", attributes}, {"material", 0}, {"mode", 0}});
    }
    if (!surface_.lines.empty()) {
      primitives.push_back(
          {{"attributes", bare}, {"indices", add_lines()}, {"material", 0}, {"mode", 1}});
    }
  }

  std::size_t add_positions() {
    std::string data;
    Eigen::Array3f low = Eigen::Array3f::Constant(std::numeric_limits<float>::max());
    Eigen::Array3f high = -low;
    for (Eigen::Index i = 0; i < surface_.points.rows(); ++i) {
      for (int k = 0; k < 3; ++k) {
        const double x = local(i, k);
        low[k] = std::min(low[k], static_cast<float>(x));
        high[k] = std::max(high[k], static_cast<float>(x));
        append_float(data, x);
      }
    }
    const std::size_t accessor = add_list(data, 5126, "VEC3", surface_.points.rows());
    accessors_[accessor]["min"] = {low[0], low[1], low[2]};
    accessors_[accessor]["max"] = {high[0], high[1], high[2]};
    return accessor;
  }

  std::size_t add_normals() {
    // Normals of the stored positions: those of the input may overflow.
    Mesh mesh{surface_.points, surface_.triangles};
    for (Eigen::Index i = 0; i < mesh.points.rows(); ++i) {
      for (int k = 0; k < 3; ++k) mesh.points(i, k) = local(i, k);
    }
    const Points normals = vertex_normals(mesh);
    std::string data;
    for (Eigen::Index i = 0; i < normals.rows(); ++i) {
      // glTF asks for a unit vector even where there is no direction.
      const bool is_zero = normals.row(i).cwiseAbs().maxCoeff() == 0.0;
      for (int k = 0; k < 3; ++k) append_float(data, is_zero && k == 2 ? 1.0 : normals(i, k));
    }
    return add_list(data, 5126, "VEC3", normals.rows());
  }

  std::size_t add_colors(const VertexProperty& red, const VertexProperty& green,
                         const VertexProperty& blue) {
    std::string data;
    for (Eigen::Index i = 0; i < surface_.points.rows(); ++i) {
      for (const VertexProperty* channel : {&red, &green, &blue}) {
        append_u16(data, linear_u16(channel->values[i]));
      }
      append_u16(data, 65535);
    }
    const std::size_t accessor = add_list(data, 5123, "VEC4", surface_.points.rows());
    accessors_[accessor]["normalized"] = true;
    return accessor;
  }

  std::size_t add_lines() {
    std::string data;
    for (const Eigen::Vector2i& line : surface_.lines) {
      for (const int end : {line[0], line[1]}) append_u32(data, static_cast<std::uint32_t>(end));
    }
    return add_list(data, 5125, "SCALAR", 2 * static_cast<Eigen::Index>(surface_.lines.size()));
  }

  std::size_t add_list(const std::string& data, int component_type, const char* type,
                       Eigen::Index count) {
    views_.push_back({{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", data.size()}});
    accessors_.push_back({{"bufferView", views_.size() - 1},
                          {"componentType", component_type},
                          {"count", count},
                          {"type", type}});
    bin_ += data;  // every element is a multiple of 4 bytes, so views stay aligned
    return accessors_.size() - 1;
  }

  std::string join(std::string json) const {
    json.append((4 - json.size() % 4) % 4, ' ');
    const std::size_t total = 12 + 8 + json.size() + (bin_.empty() ? 0 : 8 + bin_.size());
    if (total > 0xFFFFFFFFU) {
      throw InvalidArgument("a GLB file holds at most 4 GiB, this one needs " +
                            std::to_string(total) + " bytes");
    }
    std::string bytes = "glTF";
    append_u32(bytes, 2);
    append_u32(bytes, static_cast<std::uint32_t>(total));
    append_u32(bytes, static_cast<std::uint32_t>(json.size()));
    bytes += "JSON" + json;
    if (bin_.empty()) return bytes;
    append_u32(bytes, static_cast<std::uint32_t>(bin_.size()));
    bytes += "BIN";
    bytes.push_back('\0');
    return bytes + bin_;
  }

  const SurfaceOutput& surface_;
  double center_[3] = {0, 0, 0};
  double extent_ = 0.0;
  int exponent_ = 0;
  ordered_json accessors_ = ordered_json::array();
  ordered_json views_ = ordered_json::array();
  std::string bin_;
};

void validate_attributes(const SurfaceOutput& surface) {
  for (const VertexProperty& property : surface.properties) {
    if (property.values.size() != surface.points.rows()) {
      throw InvalidArgument("property '" + property.name + "' has not one value for each vertex");
    }
    for (Eigen::Index i = 0; i < property.values.size(); ++i) {
      if (!std::isfinite(property.values[i])) {
        throw InvalidArgument("property '" + property.name + "' of vertex " + std::to_string(i) +
                              " is not finite");
      }
    }
  }
  for (const Eigen::Vector2i& line : surface.lines) {
    if (line.minCoeff() < 0 || line.maxCoeff() >= surface.points.rows()) {
      throw InvalidArgument("a line uses a vertex that does not exist");
    }
  }
}

}  // namespace

std::string format_glb(const SurfaceOutput& surface) {
  validate_attributes(surface);
  return GlbWriter(surface).format();
}

}  // namespace dupin::detail
