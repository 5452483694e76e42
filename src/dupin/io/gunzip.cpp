#include <zlib.h>

#include <algorithm>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/io/formats.h"

namespace dupin::detail {
namespace {

constexpr std::int64_t kFloorBytes = std::int64_t{1} << 20;  // small files may expand freely
constexpr std::size_t kMaxChunk = std::size_t{1} << 20;

/// One zlib stream, ended with its owner.
class Inflater {
 public:
  Inflater() {
    // 15: the largest window; 16: gzip wrapping only.
    if (inflateInit2(&stream_, 15 + 16) != Z_OK) throw std::bad_alloc();
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() { inflateEnd(&stream_); }
  z_stream& stream() { return stream_; }

 private:
  z_stream stream_{};
};

[[noreturn]] void fail(Errc errc, const char* code, const std::string& message,
                       const std::string& name, std::size_t byte) {
  throw IoError(errc, code, message, Location{name, 0, static_cast<std::int64_t>(byte)});
}

std::int64_t expansion_limit(std::size_t size, const ReadLimits& limits) {
  const auto input = static_cast<std::int64_t>(size);
  const std::int64_t ratio = std::max<std::int64_t>(limits.max_expansion_ratio, 1);
  const std::int64_t by_ratio = input > std::numeric_limits<std::int64_t>::max() / ratio
                                    ? std::numeric_limits<std::int64_t>::max()
                                    : input * ratio;
  return std::min(limits.max_expanded_bytes, std::max(kFloorBytes, by_ratio));
}

}  // namespace

std::vector<std::uint8_t> gunzip(ByteSpan bytes, const std::string& name,
                                 const ReadLimits& limits) {
  const std::int64_t limit = expansion_limit(bytes.size(), limits);
  std::vector<std::uint8_t> output;
  Inflater inflater;
  z_stream& stream = inflater.stream();
  std::vector<std::uint8_t> chunk(std::min(kMaxChunk, bytes.size() * 4 + 64));
  std::size_t taken = 0;
  bool is_done = false;
  while (!is_done) {
    const std::size_t offered =
        std::min<std::size_t>(bytes.size() - taken, std::numeric_limits<uInt>::max());
    // zlib reads only, but its interface is older than const.
    stream.next_in = const_cast<Bytef*>(bytes.data() + taken);  // NOLINT
    stream.avail_in = static_cast<uInt>(offered);
    stream.next_out = chunk.data();
    stream.avail_out = static_cast<uInt>(chunk.size());
    const int result = inflate(&stream, Z_NO_FLUSH);
    taken += offered - stream.avail_in;
    const std::size_t made = chunk.size() - stream.avail_out;
    if (static_cast<std::int64_t>(output.size() + made) > limit) {
      fail(Errc::over_limit, "E_EXPANSION",
           "more than " + std::to_string(limit) + " bytes come out of " +
               std::to_string(bytes.size()) + " compressed ones",
           name, taken);
    }
    output.insert(output.end(), chunk.begin(), chunk.begin() + static_cast<std::ptrdiff_t>(made));
    if (result == Z_MEM_ERROR) throw std::bad_alloc();
    if (result == Z_STREAM_END) {
      is_done = taken == bytes.size();
      // Another member may follow: the format allows files that are simply joined.
      if (!is_done && inflateReset(&stream) != Z_OK) throw std::bad_alloc();
      continue;
    }
    if (result == Z_DATA_ERROR || result == Z_NEED_DICT) {
      const std::string reason = stream.msg == nullptr ? "damaged data" : stream.msg;
      if (reason == "incorrect header check") {
        fail(Errc::malformed, "E_MAGIC", "no gzip member starts here", name, taken);
      }
      const bool is_checksum =
          reason == "incorrect data check" || reason == "incorrect length check";
      fail(Errc::malformed, is_checksum ? "E_CRC" : "E_SYNTAX", "gzip: " + reason, name, taken);
    }
    if (made == 0 && taken == bytes.size()) {
      fail(Errc::malformed, "E_TRUNCATED", "the gzip data end inside a member", name, taken);
    }
  }
  return output;
}

}  // namespace dupin::detail
