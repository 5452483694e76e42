#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "dupin/base/error.h"

namespace dupin::detail {

enum class WrlTokenKind : std::uint8_t {
  word,           ///< name, keyword or number: the grammar tells them apart by place
  string,         ///< "...": the text without its quotes, escapes left as they are
  open_brace,     ///< {
  close_brace,    ///< }
  open_bracket,   ///< [
  close_bracket,  ///< ]
  end             ///< end of the file
};

struct WrlToken {
  WrlTokenKind kind = WrlTokenKind::end;
  std::string_view text;  ///< points into the file
  std::size_t byte = 0;   ///< where it starts
};

/// Splits VRML 1.0, VRML 2.0 and VRML97 text into tokens. Commas are blanks, '#' starts a comment.
/// Lines are counted only when an error needs one.
class WrlLexer {
 public:
  /// `bytes` must outlive the lexer.
  WrlLexer(std::span<const std::uint8_t> bytes, std::string file);

  /// @throws IoError E_SYNTAX for a control character, E_TRUNCATED inside a string
  WrlToken next();
  const WrlToken& peek();

  /// `token` as a real number; NaN and infinities only if the text says so.
  /// @throws IoError E_SYNTAX, E_NUMBER_RANGE, E_TRUNCATED (the file ends here)
  double number(const WrlToken& token) const;
  /// `token` as a whole number, the nearest limit beyond 64 bits.
  /// @throws IoError E_SYNTAX, E_TRUNCATED
  std::int64_t integer(const WrlToken& token) const;

  void seek(std::size_t byte);  ///< goes on from `byte`
  std::size_t size() const { return text_.size(); }
  std::int64_t line_of(std::size_t byte) const;  ///< 1-based; LF, CRLF or CR. Cost: O(byte)

  [[noreturn]] void fail(Errc errc, const char* code, const std::string& message,
                         std::size_t byte) const;
  /// E_TRUNCATED if `token` is or touches the end of the file, else E_SYNTAX.
  [[noreturn]] void fail_expected(const char* what, const WrlToken& token) const;

 private:
  void skip_blanks();
  WrlToken scan();
  WrlToken scan_string();

  std::string_view text_;
  std::string file_;
  std::size_t at_ = 0;
  WrlToken peeked_;
  bool has_peeked_ = false;
};

}  // namespace dupin::detail
