#include "dupin/io/npz.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <set>

#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/npy_format.h"

namespace dupin {
namespace detail {
namespace {

void append_le(std::string& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>((value >> (8 * i)) & 0xFF));
}

void validate(const NpyArray& array) {
  const Eigen::Index rows = array.values.rows();
  const Eigen::Index cols = array.values.cols();
  const bool fits_1d =
      array.shape.size() == 1 && array.shape[0] == rows && (cols == 1 || (rows == 0 && cols == 0));
  const bool fits_2d = array.shape.size() == 2 && array.shape[0] == rows && array.shape[1] == cols;
  if (!fits_1d && !fits_2d) {
    throw InvalidArgument("array '" + escaped(array.name) + "': its shape is not that of its " +
                          std::to_string(rows) + " x " + std::to_string(cols) + " values");
  }
}

/// One member of the archive, as its two headers describe it.
struct Member {
  std::string name;
  std::uint64_t size = 0;
  std::uint64_t offset = 0;
  std::uint32_t crc = 0;
};

constexpr std::uint64_t kMax32 = 0xFFFFFFFFULL;
constexpr std::uint64_t kDosDate = 0x0021;  // 1980-01-01, the earliest there is

void append_local_header(std::string& zip, const Member& member, std::uint64_t zip64_from) {
  const bool is_large = member.size >= zip64_from;
  append_le(zip, 0x04034b50, 4);
  append_le(zip, is_large ? 45 : 20, 2);  // version needed
  append_le(zip, 0x0800, 2);              // names are UTF-8
  append_le(zip, 0, 2);                   // stored
  append_le(zip, 0, 2);
  append_le(zip, kDosDate, 2);
  append_le(zip, member.crc, 4);
  append_le(zip, is_large ? kMax32 : member.size, 4);
  append_le(zip, is_large ? kMax32 : member.size, 4);
  append_le(zip, member.name.size(), 2);
  append_le(zip, is_large ? 20 : 0, 2);
  zip += member.name;
  if (is_large) {
    append_le(zip, 1, 2);
    append_le(zip, 16, 2);
    append_le(zip, member.size, 8);
    append_le(zip, member.size, 8);
  }
}

void append_central_header(std::string& zip, const Member& member, std::uint64_t zip64_from) {
  const bool is_large = member.size >= zip64_from;
  const bool is_far = member.offset >= zip64_from;
  std::string extra;
  if (is_large || is_far) {
    append_le(extra, 1, 2);
    append_le(extra, (is_large ? 16U : 0U) + (is_far ? 8U : 0U), 2);
    if (is_large) append_le(extra, member.size, 8);
    if (is_large) append_le(extra, member.size, 8);
    if (is_far) append_le(extra, member.offset, 8);
  }
  append_le(zip, 0x02014b50, 4);
  append_le(zip, 45, 2);  // version made by
  append_le(zip, extra.empty() ? 20 : 45, 2);
  append_le(zip, 0x0800, 2);
  append_le(zip, 0, 2);
  append_le(zip, 0, 2);
  append_le(zip, kDosDate, 2);
  append_le(zip, member.crc, 4);
  append_le(zip, is_large ? kMax32 : member.size, 4);
  append_le(zip, is_large ? kMax32 : member.size, 4);
  append_le(zip, member.name.size(), 2);
  append_le(zip, extra.size(), 2);
  append_le(zip, 0, 2);  // comment
  append_le(zip, 0, 2);  // disk
  append_le(zip, 0, 2);  // internal attributes
  append_le(zip, 0, 4);  // external attributes
  append_le(zip, is_far ? kMax32 : member.offset, 4);
  zip += member.name + extra;
}

void append_end(std::string& zip, std::uint64_t num_members, std::uint64_t start,
                std::uint64_t zip64_from) {
  const std::uint64_t size = zip.size() - start;
  const bool is_large = start >= zip64_from || size >= zip64_from || num_members >= 0xFFFF;
  if (is_large) {
    const std::uint64_t record = zip.size();
    append_le(zip, 0x06064b50, 4);
    append_le(zip, 44, 8);
    append_le(zip, 45, 2);
    append_le(zip, 45, 2);
    append_le(zip, 0, 4);
    append_le(zip, 0, 4);
    append_le(zip, num_members, 8);
    append_le(zip, num_members, 8);
    append_le(zip, size, 8);
    append_le(zip, start, 8);
    append_le(zip, 0x07064b50, 4);
    append_le(zip, 0, 4);
    append_le(zip, record, 8);
    append_le(zip, 1, 4);
  }
  append_le(zip, 0x06054b50, 4);
  append_le(zip, 0, 2);
  append_le(zip, 0, 2);
  append_le(zip, std::min<std::uint64_t>(num_members, 0xFFFF), 2);
  append_le(zip, std::min<std::uint64_t>(num_members, 0xFFFF), 2);
  append_le(zip, is_large ? kMax32 : size, 4);
  append_le(zip, is_large ? kMax32 : start, 4);
  append_le(zip, 0, 2);
}

std::string member_name(const NpyArray& array, std::set<std::string>& names) {
  const bool is_plain = std::all_of(array.name.begin(), array.name.end(), [](char c) {
    return static_cast<unsigned char>(c) >= 0x20 && c != '/' && c != '\\';
  });
  if (array.name.empty() || array.name.size() > 255 || !is_plain ||
      !names.insert(array.name).second) {
    throw InvalidArgument("'" + escaped(array.name) + "' cannot name an array of an archive");
  }
  return array.name + ".npy";
}

// Magic, version, length and text of the header. The data start at a multiple of 64 bytes; the text
// ends with a line end.
std::string npy_header(const std::vector<Eigen::Index>& sizes, bool as_float32) {
  std::string shape;
  for (const Eigen::Index size : sizes)
    shape += std::to_string(size) + (sizes.size() == 1 ? "," : ", ");
  if (sizes.size() > 1) shape.resize(shape.size() - 2);
  std::string header = std::string("{'descr': '") + (as_float32 ? "<f4" : "<f8") +
                       "', 'fortran_order': False, 'shape': (" + shape + "), }";
  header.append(63 - (10 + header.size()) % 64, ' ');
  header.push_back('\n');
  std::string bytes = "\x93NUMPY";
  bytes.push_back('\1');
  bytes.push_back('\0');
  append_le(bytes, header.size(), 2);
  return bytes + header;
}

}  // namespace

std::string format_npy(const NpyArray& array) {
  validate(array);
  const auto count = static_cast<std::size_t>(array.values.size());
  std::string bytes = npy_header(array.shape, array.as_float32);
  bytes.reserve(bytes.size() + count * (array.as_float32 ? 4 : 8));
  for (std::size_t i = 0; i < count; ++i) {
    const double value = array.values.data()[i];
    if (array.as_float32) {
      append_le(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
    } else {
      append_le(bytes, std::bit_cast<std::uint64_t>(value), 8);
    }
  }
  return bytes;
}

std::string format_npy(const std::vector<Eigen::Index>& shape, std::span<const float> values) {
  std::size_t count = 1;
  for (const Eigen::Index size : shape) count *= static_cast<std::size_t>(size);
  if (count != values.size())
    throw InvalidArgument("the shape of an array is not that of its " +
                          std::to_string(values.size()) + " values");
  std::string bytes = npy_header(shape, true);
  bytes.reserve(bytes.size() + 4 * count);
  for (const float value : values) append_le(bytes, std::bit_cast<std::uint32_t>(value), 4);
  return bytes;
}

std::string format_npz(const std::vector<NpyArray>& arrays, std::uint64_t zip64_from) {
  std::string zip;
  std::vector<Member> members;
  std::set<std::string> names;
  for (const NpyArray& array : arrays) {
    const std::string name = member_name(array, names);
    const std::string bytes = format_npy(array);
    const auto crc = crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
    members.push_back({name, bytes.size(), zip.size(), static_cast<std::uint32_t>(crc)});
    append_local_header(zip, members.back(), zip64_from);
    zip += bytes;
  }
  const std::uint64_t start = zip.size();
  for (const Member& member : members) append_central_header(zip, member, zip64_from);
  append_end(zip, members.size(), start, zip64_from);
  return zip;
}

}  // namespace detail

void write_npy(const std::string& path, const NpyArray& array) {
  write_file_atomically(path, detail::format_npy(array));
}

void write_npy(const std::string& path, const std::vector<Eigen::Index>& shape,
               std::span<const float> values) {
  write_file_atomically(path, detail::format_npy(shape, values));
}

void write_npz(const std::string& path, const std::vector<NpyArray>& arrays) {
  write_file_atomically(path, detail::format_npz(arrays));
}

NpyArray read_npy(const std::string& path, const ReadLimits& limits, const RunControl& run) {
  const FileBytes file = FileBytes::open(path, limits, run);
  return file.judge(path, [&] { return detail::parse_npy(file.bytes(), path, limits); });
}

}  // namespace dupin
