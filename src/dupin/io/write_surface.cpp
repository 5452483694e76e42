#include <Eigen/Geometry>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "dupin/base/error.h"
#include "dupin/io/byte_loads.h"
#include "dupin/io/formats.h"
#include "dupin/io/sniff.h"
#include "dupin/io/surface_io.h"

namespace dupin {
namespace {

class TextOut {
 public:
  TextOut& operator<<(std::string_view text) {
    text_ += text;
    return *this;
  }
  TextOut& operator<<(char c) {
    text_ += c;
    return *this;
  }
  // The shortest text that reads back to the same bits.
  template <class T>
  requires std::is_arithmetic_v<T> TextOut& operator<<(T value) {
    char digits[32];
    const auto [end, error] = std::to_chars(digits, digits + sizeof(digits), value);
    static_cast<void>(error);  // 32 characters hold every double and int64
    text_.append(digits, end);
    return *this;
  }
  void reserve(Eigen::Index bytes) { text_.reserve(static_cast<std::size_t>(bytes)); }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

class BinaryOut {
 public:
  explicit BinaryOut(std::string header) : bytes_(std::move(header)) {}
  void reserve(Eigen::Index more) {
    bytes_.reserve(bytes_.size() + static_cast<std::size_t>(more));
  }
  template <class T>
  void put(T value) {
    auto bits = std::bit_cast<detail::Bits<T>>(value);
    if constexpr (std::endian::native == std::endian::big) bits = detail::swapped(bits);
    char data[sizeof(T)];
    std::memcpy(data, &bits, sizeof(T));
    bytes_.append(data, sizeof(T));
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

std::string at(const char* what, Eigen::Index index) {
  return std::string(what) + " " + std::to_string(index);
}

void check_properties(const SurfaceOutput& surface) {
  constexpr std::string_view kNameCharacters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-";
  for (std::size_t i = 0; i < surface.properties.size(); ++i) {
    const VertexProperty& property = surface.properties[i];
    const std::string name = "property '" + escaped(property.name, 40) + "'";
    const bool is_taken = property.name == "x" || property.name == "y" || property.name == "z";
    if (property.name.empty() || is_taken ||
        property.name.find_first_not_of(kNameCharacters) != std::string::npos) {
      throw InvalidArgument(name + " cannot have this name");
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (surface.properties[k].name == property.name) throw InvalidArgument(name + " twice");
    }
    if (property.values.size() != surface.points.rows()) {
      throw InvalidArgument(name + " has " + std::to_string(property.values.size()) +
                            " values for " + std::to_string(surface.points.rows()) + " vertices");
    }
    for (Eigen::Index v = 0; v < property.values.size(); ++v) {
      const double value = property.values[v];
      if (!std::isfinite(value))
        throw InvalidArgument(name + " is not finite at " + at("vertex", v));
      if (property.as_uchar && (value < 0.0 || value > 255.0)) {
        throw InvalidArgument(name + " is outside 0..255 at " + at("vertex", v));
      }
    }
  }
}

void check_surface(const SurfaceOutput& surface) {
  const Eigen::Index num_points = surface.points.rows();
  if (num_points > std::numeric_limits<std::int32_t>::max()) {
    throw InvalidArgument("more vertices than 32-bit indices can name");
  }
  for (Eigen::Index i = 0; i < surface.points.size(); ++i) {
    if (!std::isfinite(surface.points.data()[i])) {
      throw InvalidArgument("a coordinate of " + at("vertex", i / 3) + " is not finite");
    }
  }
  const auto is_vertex = [&](std::int32_t index) { return index >= 0 && index < num_points; };
  for (Eigen::Index i = 0; i < surface.triangles.size(); ++i) {
    if (!is_vertex(surface.triangles.data()[i])) {
      throw InvalidArgument(at("face", i / 3) + " uses " +
                            at("vertex", surface.triangles.data()[i]) + " of " +
                            std::to_string(num_points));
    }
  }
  for (std::size_t i = 0; i < surface.lines.size(); ++i) {
    if (!is_vertex(surface.lines[i][0]) || !is_vertex(surface.lines[i][1])) {
      throw InvalidArgument("line " + std::to_string(i) + " uses a vertex that is not there");
    }
  }
  check_properties(surface);
}

void refuse(bool is_needed, const char* format, const char* what) {
  if (is_needed) throw InvalidArgument(std::string(format) + " cannot hold " + what, "write PLY");
}

std::uint8_t as_uchar(double value) { return static_cast<std::uint8_t>(std::lround(value)); }

std::string ply_header(const SurfaceOutput& surface, const char* encoding) {
  TextOut out;
  out << "ply\nformat " << std::string_view(encoding) << " 1.0\n";
  out << "element vertex " << surface.points.rows() << '\n';
  for (const char* axis : {"x", "y", "z"})
    out << "property double " << std::string_view(axis) << '\n';
  for (const VertexProperty& property : surface.properties) {
    out << (property.as_uchar ? std::string_view("property uchar ") : "property double ")
        << property.name << '\n';
  }
  if (surface.triangles.rows() > 0) {
    out << "element face " << surface.triangles.rows()
        << "\nproperty list uchar int vertex_indices\n";
  }
  if (!surface.lines.empty()) {
    out << "element edge " << surface.lines.size()
        << "\nproperty int vertex1\nproperty int vertex2\n";
  }
  out << "end_header\n";
  return out.take();
}

std::string format_ply_binary(const SurfaceOutput& surface) {
  BinaryOut out(ply_header(surface, "binary_little_endian"));
  const auto num_properties = static_cast<Eigen::Index>(surface.properties.size());
  const auto num_lines = static_cast<Eigen::Index>(surface.lines.size());
  out.reserve(surface.points.rows() * 8 * (3 + num_properties) + surface.triangles.rows() * 13 +
              num_lines * 8);
  for (Eigen::Index v = 0; v < surface.points.rows(); ++v) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) out.put(surface.points(v, axis));
    for (const VertexProperty& property : surface.properties) {
      if (property.as_uchar) {
        out.put(as_uchar(property.values[v]));
      } else {
        out.put(property.values[v]);
      }
    }
  }
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    out.put(std::uint8_t{3});
    for (Eigen::Index corner = 0; corner < 3; ++corner) out.put(surface.triangles(f, corner));
  }
  for (const Eigen::Vector2i& line : surface.lines) {
    out.put(line[0]);
    out.put(line[1]);
  }
  return out.take();
}

void put_point(TextOut& out, const SurfaceOutput& surface, Eigen::Index v) {
  out << surface.points(v, 0) << ' ' << surface.points(v, 1) << ' ' << surface.points(v, 2);
}

void put_triangle(TextOut& out, const SurfaceOutput& surface, Eigen::Index f, int base) {
  out << surface.triangles(f, 0) + base << ' ' << surface.triangles(f, 1) + base << ' '
      << surface.triangles(f, 2) + base << '\n';
}

void reserve_text(TextOut& out, const SurfaceOutput& surface) {
  out.reserve(256 + surface.points.rows() * 40 + surface.triangles.rows() * 26);
}

std::string format_ply_ascii(const SurfaceOutput& surface) {
  TextOut out;
  reserve_text(out, surface);
  out << ply_header(surface, "ascii");
  for (Eigen::Index v = 0; v < surface.points.rows(); ++v) {
    put_point(out, surface, v);
    for (const VertexProperty& property : surface.properties) {
      out << ' ';
      if (property.as_uchar) {
        out << static_cast<int>(as_uchar(property.values[v]));
      } else {
        out << property.values[v];
      }
    }
    out << '\n';
  }
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    out << "3 ";
    put_triangle(out, surface, f, 0);
  }
  for (const Eigen::Vector2i& line : surface.lines) out << line[0] << ' ' << line[1] << '\n';
  return out.take();
}

std::string format_obj(const SurfaceOutput& surface) {
  refuse(!surface.properties.empty(), "OBJ", "vertex properties");
  TextOut out;
  reserve_text(out, surface);
  for (Eigen::Index v = 0; v < surface.points.rows(); ++v) {
    out << "v ";
    put_point(out, surface, v);
    out << '\n';
  }
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    out << "f ";
    put_triangle(out, surface, f, 1);
  }
  for (const Eigen::Vector2i& line : surface.lines) {
    out << "l " << line[0] + 1 << ' ' << line[1] + 1 << '\n';
  }
  return out.take();
}

std::string format_off(const SurfaceOutput& surface) {
  refuse(!surface.properties.empty(), "OFF", "vertex properties");
  refuse(!surface.lines.empty(), "OFF", "lines");
  TextOut out;
  reserve_text(out, surface);
  out << "OFF\n" << surface.points.rows() << ' ' << surface.triangles.rows() << " 0\n";
  for (Eigen::Index v = 0; v < surface.points.rows(); ++v) {
    put_point(out, surface, v);
    out << '\n';
  }
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    out << "3 ";
    put_triangle(out, surface, f, 0);
  }
  return out.take();
}

// Unit normal, or zero for a triangle without area. Scaled first, so that nothing overflows.
Eigen::RowVector3d unit_normal(const SurfaceOutput& surface, Eigen::Index f) {
  const auto point = [&](int corner) -> Eigen::RowVector3d {
    return 0.25 * surface.points.row(surface.triangles(f, corner));
  };
  Eigen::RowVector3d u = point(1) - point(0);
  Eigen::RowVector3d v = point(2) - point(0);
  const double u_scale = u.cwiseAbs().maxCoeff();
  const double v_scale = v.cwiseAbs().maxCoeff();
  if (u_scale == 0.0 || v_scale == 0.0) return Eigen::RowVector3d::Zero();
  const Eigen::RowVector3d normal = (u / u_scale).cross(v / v_scale);
  const double norm = normal.norm();
  return norm > 0.0 ? Eigen::RowVector3d(normal / norm) : Eigen::RowVector3d::Zero();
}

void check_stl(const SurfaceOutput& surface) {
  refuse(!surface.properties.empty(), "STL", "vertex properties");
  refuse(!surface.lines.empty(), "STL", "lines");
  refuse(surface.triangles.rows() == 0 && surface.points.rows() > 0, "STL", "points without faces");
}

std::string format_stl_binary(const SurfaceOutput& surface) {
  check_stl(surface);
  std::string header = "dupin: binary STL";
  header.resize(80, '\0');
  BinaryOut out(std::move(header));
  out.reserve(4 + surface.triangles.rows() * 50);
  out.put(static_cast<std::uint32_t>(surface.triangles.rows()));
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    const Eigen::RowVector3d normal = unit_normal(surface, f);
    for (Eigen::Index axis = 0; axis < 3; ++axis) out.put(static_cast<float>(normal[axis]));
    for (Eigen::Index corner = 0; corner < 3; ++corner) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const double value = surface.points(surface.triangles(f, corner), axis);
        if (std::abs(value) > static_cast<double>(std::numeric_limits<float>::max())) {
          throw InvalidArgument("a coordinate of " + at("face", f) + " does not fit a float",
                                "binary STL holds single precision; write PLY");
        }
        out.put(static_cast<float>(value));
      }
    }
    out.put(std::uint16_t{0});
  }
  return out.take();
}

std::string format_stl_ascii(const SurfaceOutput& surface) {
  check_stl(surface);
  TextOut out;
  out.reserve(64 + surface.triangles.rows() * 280);
  out << "solid dupin\n";
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    const Eigen::RowVector3d normal = unit_normal(surface, f);
    out << "facet normal " << normal[0] << ' ' << normal[1] << ' ' << normal[2] << "\nouter loop\n";
    for (Eigen::Index corner = 0; corner < 3; ++corner) {
      out << "vertex ";
      put_point(out, surface, surface.triangles(f, corner));
      out << '\n';
    }
    out << "endloop\nendfacet\n";
  }
  out << "endsolid dupin\n";
  return out.take();
}

}  // namespace

SurfaceFormat surface_format_of(const std::string& path) {
  const std::string extension =
      detail::ends_with_gz(path) ? std::string("gz") : detail::surface_extension(path);
  if (extension == "ply") return SurfaceFormat::ply_binary;
  if (extension == "obj") return SurfaceFormat::obj;
  if (extension == "off") return SurfaceFormat::off;
  if (extension == "stl") return SurfaceFormat::stl_binary;
  if (extension == "glb") return SurfaceFormat::glb;
  throw InvalidArgument("no surface format is known for '" + escaped(path) + "'",
                        "surfaces are written as .ply, .obj, .off, .stl or .glb");
}

std::string format_surface(const SurfaceOutput& surface, SurfaceFormat format) {
  check_surface(surface);
  switch (format) {
    case SurfaceFormat::ply_binary:
      return format_ply_binary(surface);
    case SurfaceFormat::ply_ascii:
      return format_ply_ascii(surface);
    case SurfaceFormat::obj:
      return format_obj(surface);
    case SurfaceFormat::off:
      return format_off(surface);
    case SurfaceFormat::stl_binary:
      return format_stl_binary(surface);
    case SurfaceFormat::stl_ascii:
      return format_stl_ascii(surface);
    case SurfaceFormat::glb:
      return detail::format_glb(surface);
  }
  throw InvalidArgument("unknown surface format");
}

}  // namespace dupin
