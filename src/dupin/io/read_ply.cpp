#include <bit>

#include "dupin/io/byte_loads.h"
#include "dupin/io/ply_body.h"

namespace dupin::detail {
namespace {

template <bool kSwap>
double load_scalar(PlyType type, const std::uint8_t* at) {
  switch (type) {
    case PlyType::i8:
      return load_real<std::int8_t, kSwap>(at);
    case PlyType::u8:
      return load_real<std::uint8_t, kSwap>(at);
    case PlyType::i16:
      return load_real<std::int16_t, kSwap>(at);
    case PlyType::u16:
      return load_real<std::uint16_t, kSwap>(at);
    case PlyType::i32:
      return load_real<std::int32_t, kSwap>(at);
    case PlyType::u32:
      return load_real<std::uint32_t, kSwap>(at);
    case PlyType::f32:
      return load_real<float, kSwap>(at);
    case PlyType::f64:
      break;
  }
  return load_real<double, kSwap>(at);
}

// The value of an integer type, exactly; header checks keep floating types away.
template <bool kSwap>
std::int64_t load_integer(PlyType type, const std::uint8_t* at) {
  switch (type) {
    case PlyType::i8:
      return load<std::int8_t, kSwap>(at);
    case PlyType::u8:
      return load<std::uint8_t, kSwap>(at);
    case PlyType::i16:
      return load<std::int16_t, kSwap>(at);
    case PlyType::u16:
      return load<std::uint16_t, kSwap>(at);
    case PlyType::u32:
      return load<std::uint32_t, kSwap>(at);
    default:
      return load<std::int32_t, kSwap>(at);
  }
}

bool is_index_list(const PlyProperty& property) {
  return property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index");
}

}  // namespace

void PlyBody::prepare() {
  at_ = header_.body;
  if (header_.has_bom) {
    file_.warnings.add("W_BOM", "byte 0", "a byte order mark before 'ply' was skipped");
  }
  const auto refuse = [&](const PlyElement& element, const std::string& message) {
    throw IoError(Errc::malformed, "E_HEADER", message, {name_, element.line, -1});
  };
  for (const PlyElement& element : header_.elements) {
    if (element.name == "vertex") {
      num_vertices_ = element.count;
      if (element.count > 0) check_vertex_properties(element);
    } else if (element.name == "face" && element.count > 0) {
      std::ptrdiff_t num_lists = 0;
      for (const PlyProperty& property : element.properties) {
        if (!is_index_list(property)) continue;
        ++num_lists;
        if (property.type == PlyType::f32 || property.type == PlyType::f64) {
          refuse(element, "vertex indices of a floating type");
        }
      }
      if (num_lists != 1) refuse(element, "faces need one list vertex_indices");
    } else if (element.name == "tristrips" && element.count > 0) {
      refuse(element, "triangle strips are not supported");
    }
    if (element.properties.empty() && element.count > 0) {
      refuse(element, "element '" + escaped(element.name, 40) + "' has no properties");
    }
  }
}

void PlyBody::check_vertex_properties(const PlyElement& element) const {
  for (const char* axis : {"x", "y", "z"}) {
    const std::ptrdiff_t found = element.find(axis);
    if (found < 0 || element.properties[static_cast<std::size_t>(found)].is_list) {
      throw IoError(Errc::malformed, "E_HEADER",
                    std::string("the vertices have no property ") + axis,
                    {name_, element.line, -1});
    }
  }
}

std::vector<PlyRole> PlyBody::roles_of(const PlyElement& element) const {
  std::vector<PlyRole> roles;
  std::int64_t offset = 0;
  for (const PlyProperty& property : element.properties) {
    PlyRole role{property, property.is_list, is_index_list(property), -1, offset};
    constexpr const char* kNames[kPlySlots] = {"x", "y", "z", "nx", "ny", "nz"};
    for (std::size_t slot = 0; slot < (has_normals_ ? kPlySlots : 3); ++slot) {
      if (property.name == kNames[slot]) role.slot = static_cast<int>(slot);
    }
    offset += size_of(property.type);
    roles.push_back(role);
  }
  return roles;
}

// Takes memory for what the file can hold, whatever it claims.
void PlyBody::allocate(const PlyElement& element, std::int64_t least_bytes, std::int64_t bytes_left,
                       const Location& location) {
  const bool is_vertex = element.name == "vertex";
  const bool is_face = element.name == "face";
  const std::int64_t limit = is_vertex ? options_.limits.max_vertices
                             : is_face ? options_.limits.max_faces
                                       : kMaxIndex;
  const char* what = is_vertex ? "vertices" : is_face ? "faces" : "elements";
  check_claim(what, element.count, limit, least_bytes, bytes_left, location);
  if (is_vertex) {
    const std::int64_t capacity = safe_capacity(element.count, least_bytes, bytes_left);
    has_normals_ = true;
    for (const char* axis : {"nx", "ny", "nz"}) {
      const std::ptrdiff_t found = element.find(axis);
      has_normals_ = has_normals_ && found >= 0 &&
                     !element.properties[static_cast<std::size_t>(found)].is_list;
    }
    file_.mesh.points.resize(capacity, 3);
    if (has_normals_) file_.mesh.normals.resize(capacity, 3);
  } else if (is_face) {
    for (const PlyProperty& property : element.properties) {
      if (!is_index_list(property)) continue;
      const bool is_text = header_.encoding == PlyEncoding::ascii;
      const std::int64_t index_bytes = is_text ? 2 : size_of(property.type);
      faces_.reserve_indices(
          std::min(kMaxIndex, safe_capacity(3 * element.count, index_bytes, bytes_left)));
    }
  }
}

void PlyBody::store_normal(std::int64_t vertex, const double* normal) {
  double* const out = file_.mesh.normals.data() + 3 * vertex;
  if (is_finite(normal[0], normal[1], normal[2])) {
    std::copy(normal, normal + 3, out);
  } else {
    std::fill(out, out + 3, 0.0);
    file_.warnings.add("W_ATTR_NONFINITE", "vertex " + std::to_string(vertex),
                       "normals that are not finite were set to zero");
  }
}

void PlyBody::fail_truncated(const PlyElement& element, std::int64_t index) const {
  throw IoError(Errc::malformed, "E_TRUNCATED",
                "the file ends within " + escaped(element.name, 40) + " " + std::to_string(index) +
                    " of " + std::to_string(element.count),
                {name_, 0, static_cast<std::int64_t>(bytes_.size())});
}

// ---------------------------------------------------------------- binary

template <bool kSwap>
void PlyBody::read_binary() {
  for (const PlyElement& element : header_.elements) {
    allocate(element, element.least_binary_bytes(), left(), {name_, element.line, -1});
    if (element.name == "vertex") {
      read_binary_vertices<kSwap>(element);
    } else if (element.name == "face") {
      read_binary_faces<kSwap>(element);
    } else {
      skip_binary<kSwap>(element);
    }
  }
  if (left() > 0) {
    file_.warnings.add("W_TRAILING_DATA", "byte " + std::to_string(at_),
                       std::to_string(left()) + " bytes after the last element were ignored");
  }
}

template <bool kSwap>
std::int64_t PlyBody::binary_list_count(const PlyProperty& property, const PlyElement& element,
                                        std::int64_t index) {
  need(size_of(property.count_type), element, index);
  const auto count = load_integer<kSwap>(property.count_type, bytes_.data() + at_);
  if (count < 0) {
    throw IoError(Errc::malformed, "E_LIST_COUNT", "a list of " + std::to_string(count), here());
  }
  const std::int64_t size = count * size_of(property.type);
  at_ += static_cast<std::size_t>(size_of(property.count_type));
  if (count > options_.limits.max_polygon && size > left()) {
    throw IoError(Errc::over_limit, "E_COUNT_EXCEEDS_FILE",
                  "a list claims " + std::to_string(count) + " values, and " +
                      std::to_string(left()) + " bytes follow",
                  here());
  }
  need(size, element, index);
  return count;
}

// Vertices that are nothing but x y z of one type, the layout of nearly every file.
template <bool kSwap, class T>
void PlyBody::read_packed_vertices(const PlyElement& element, const std::vector<PlyRole>& roles) {
  constexpr std::int64_t kSize = static_cast<std::int64_t>(sizeof(T));
  const std::int64_t stride = element.least_binary_bytes();
  const std::int64_t x_offset = roles[0].offset;
  const std::uint8_t* record = bytes_.data() + at_ + x_offset;
  double* out = file_.mesh.points.data();
  for (std::int64_t start = 0; start < element.count; start += kPlyRunStride) {
    check_run(run_, record - bytes_.data(), static_cast<std::int64_t>(bytes_.size()));
    const std::int64_t end = std::min(element.count, start + kPlyRunStride);
    bool all_finite = true;
    for (std::int64_t vertex = start; vertex < end; ++vertex, record += stride, out += 3) {
      for (std::int64_t axis = 0; axis < 3; ++axis) {
        const double value = load_real<T, kSwap>(record + axis * kSize);
        all_finite = all_finite && std::isfinite(value);
        out[axis] = value;
      }
    }
    if (all_finite || options_.drop_nonfinite) continue;
    const double* point = file_.mesh.points.data() + 3 * start;
    std::int64_t vertex = start;
    while (is_finite(point[0], point[1], point[2])) {
      ++vertex;
      point += 3;
    }
    fail_nonfinite(vertex, {name_, 0, static_cast<std::int64_t>(at_) + vertex * stride});
  }
  at_ += static_cast<std::size_t>(element.count * stride);
}

template <bool kSwap>
void PlyBody::read_binary_vertices(const PlyElement& element) {
  const std::vector<PlyRole> roles = roles_of(element);
  const std::int64_t stride = element.least_binary_bytes();
  if (!element.has_lists() && element.count > 0) {
    if (left() / stride < element.count) fail_truncated(element, left() / stride);
    const bool is_packed = !has_normals_ && roles.size() >= 3 && roles[0].slot == 0 &&
                           roles[1].slot == 1 && roles[2].slot == 2 &&
                           roles[0].property.type == roles[1].property.type &&
                           roles[0].property.type == roles[2].property.type;
    if (is_packed && roles[0].property.type == PlyType::f32) {
      return read_packed_vertices<kSwap, float>(element, roles);
    }
    if (is_packed && roles[0].property.type == PlyType::f64) {
      return read_packed_vertices<kSwap, double>(element, roles);
    }
  }
  for (std::int64_t vertex = 0; vertex < element.count; ++vertex) {
    if (vertex % kPlyRunStride == 0) {
      check_run(run_, static_cast<std::int64_t>(at_), static_cast<std::int64_t>(bytes_.size()));
    }
    double values[kPlySlots] = {};
    const std::int64_t start = static_cast<std::int64_t>(at_);
    for (const PlyRole& role : roles) {
      if (role.is_list) {
        const std::int64_t count = binary_list_count<kSwap>(role.property, element, vertex);
        at_ += static_cast<std::size_t>(count * size_of(role.property.type));
        continue;
      }
      need(size_of(role.property.type), element, vertex);
      if (role.slot >= 0) {
        values[role.slot] = load_scalar<kSwap>(role.property.type, bytes_.data() + at_);
      }
      at_ += static_cast<std::size_t>(size_of(role.property.type));
    }
    if (!is_finite(values[0], values[1], values[2]) && !options_.drop_nonfinite) {
      fail_nonfinite(vertex, {name_, 0, start});
    }
    store(vertex, values);
  }
}

// Faces of one list of 32-bit indices with a byte for its size: reads triangles as long as they
// come; the general loop takes over at anything else.
template <bool kSwap>
void PlyBody::read_packed_triangles(const PlyElement& element) {
  constexpr std::int64_t kBytes = 1 + 3 * 4;
  const auto num_vertices = static_cast<std::uint32_t>(num_vertices_);
  const std::uint8_t* record = bytes_.data() + at_;
  const std::int64_t most = std::min(element.count, left() / kBytes);
  while (faces_.num_faces() < most) {
    const std::int64_t start = faces_.num_faces();
    check_run(run_, record - bytes_.data(), static_cast<std::int64_t>(bytes_.size()));
    const std::int64_t count = std::min(most - start, kPlyRunStride);
    std::int32_t* const out = faces_.triangles(count);
    std::int64_t done = 0;
    for (; done < count && record[0] == 3; ++done, record += kBytes) {
      const auto a = load<std::uint32_t, kSwap>(record + 1);
      const auto b = load<std::uint32_t, kSwap>(record + 5);
      const auto c = load<std::uint32_t, kSwap>(record + 9);
      if (a >= num_vertices || b >= num_vertices || c >= num_vertices) break;
      out[3 * done] = static_cast<std::int32_t>(a);
      out[3 * done + 1] = static_cast<std::int32_t>(b);
      out[3 * done + 2] = static_cast<std::int32_t>(c);
    }
    faces_.keep_triangles(done);
    if (done < count) break;
  }
  at_ = static_cast<std::size_t>(record - bytes_.data());
}

template <bool kSwap>
void PlyBody::read_binary_faces(const PlyElement& element) {
  const PlyProperty* const only =
      element.properties.size() == 1 ? &element.properties.front() : nullptr;
  if (only != nullptr && is_index_list(*only) && size_of(only->count_type) == 1 &&
      size_of(only->type) == 4) {
    read_packed_triangles<kSwap>(element);
  }
  const std::vector<PlyRole> roles = roles_of(element);
  for (std::int64_t face = faces_.num_faces(); face < element.count; ++face) {
    if (face % kPlyRunStride == 0) {
      check_run(run_, static_cast<std::int64_t>(at_), static_cast<std::int64_t>(bytes_.size()));
    }
    for (const PlyRole& role : roles) {
      const PlyProperty& property = role.property;
      const std::int64_t size = size_of(property.type);
      if (!role.is_list) {
        need(size, element, face);
        at_ += static_cast<std::size_t>(size);
        continue;
      }
      const Location location = here();
      const std::int64_t count = binary_list_count<kSwap>(property, element, face);
      if (!role.is_index_list) {
        at_ += static_cast<std::size_t>(count * size);
        continue;
      }
      if (count > options_.limits.max_polygon) {
        fail_polygon(face, count, options_.limits, location);
      }
      for (std::int64_t corner = 0; corner < count; ++corner) {
        const auto vertex = load_integer<kSwap>(property.type, bytes_.data() + at_);
        if (vertex < 0 || vertex >= num_vertices_) {
          fail_index(face, vertex, num_vertices_, here());
        }
        faces_.add_index(static_cast<std::int32_t>(vertex));
        at_ += static_cast<std::size_t>(size);
      }
      faces_.end_face();
    }
  }
}

template <bool kSwap>
void PlyBody::skip_binary(const PlyElement& element) {
  if (!element.has_lists()) {
    const std::int64_t stride = element.least_binary_bytes();
    if (stride == 0) return;
    if (left() / stride < element.count) fail_truncated(element, left() / stride);
    at_ += static_cast<std::size_t>(stride * element.count);
    return;
  }
  for (std::int64_t index = 0; index < element.count; ++index) {
    for (const PlyProperty& property : element.properties) {
      std::int64_t count = 1;
      if (property.is_list) {
        count = binary_list_count<kSwap>(property, element, index);
      } else {
        need(size_of(property.type), element, index);
      }
      at_ += static_cast<std::size_t>(count * size_of(property.type));
    }
  }
}

SurfaceFile PlyBody::read() {
  if (header_.encoding == PlyEncoding::ascii) {
    read_ascii();
  } else if ((header_.encoding == PlyEncoding::little_endian) ==
             (std::endian::native == std::endian::little)) {
    read_binary<false>();
  } else {
    read_binary<true>();
  }
  file_.format = "ply";
  file_.is_binary = header_.encoding != PlyEncoding::ascii;
  faces_.move_to(file_.mesh);
  return std::move(file_);
}

SurfaceFile parse_ply(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return PlyBody(bytes, name, options, run, parse_ply_header(bytes, name, options.limits)).read();
}

}  // namespace dupin::detail
