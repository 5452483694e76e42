#include "dupin/io/text_scanner.h"

#include <gtest/gtest.h>

#include <bit>
#include <charconv>
#include <clocale>
#include <cmath>
#include <limits>

#include "dupin/base/random.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin::detail {
namespace {

// The number at the start of `text`, which a line end follows.
DecimalStatus parse(const std::string& text, double& value, std::size_t& length) {
  const std::string line = text + "\n";
  const char* cursor = line.data();
  const DecimalStatus status = parse_decimal(cursor, line.data() + line.size(), value);
  length = static_cast<std::size_t>(cursor - line.data());
  return status;
}

void expect_as_from_chars(const std::string& text) {
  double expected = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), expected);
  double value = 0.0;
  std::size_t length = 0;
  const DecimalStatus status = parse(text, value, length);
  if (error == std::errc::invalid_argument) {
    ASSERT_EQ(status, DecimalStatus::syntax) << text;
  } else if (error == std::errc()) {
    ASSERT_EQ(status, DecimalStatus::ok) << text;
    ASSERT_EQ(length, static_cast<std::size_t>(end - text.data())) << text;
    ASSERT_EQ(std::bit_cast<std::uint64_t>(value), std::bit_cast<std::uint64_t>(expected)) << text;
  } else {
    ASSERT_TRUE(status == DecimalStatus::range || value == 0.0) << text;
  }
}

std::string random_decimal(Rng& random) {
  std::string text = random.below(2) == 0 ? "-" : "";
  const std::uint64_t kind = random.below(8);
  if (kind == 0) {  // any bits, shortest or with 17 digits: subnormals come with the exponent 0
    std::uint64_t bits = random.next();
    if (random.below(4) == 0) bits &= ~(std::uint64_t{0x7FF} << 52U);
    const auto value = std::bit_cast<double>(bits & ~(std::uint64_t{1} << 63U));
    if ((bits >> 52U & 0x7FFU) == 0x7FFU) return text + "1";  // not finite
    char digits[64];
    const auto end = random.below(2) == 0
                         ? std::to_chars(digits, digits + 64, value).ptr
                         : std::to_chars(digits, digits + 64, value, std::chars_format::scientific,
                                         16 + static_cast<int>(random.below(8)))
                               .ptr;
    return text.append(digits, end);
  }
  const std::uint64_t num_integer = random.below(kind < 5 ? 4 : 22);
  const std::uint64_t num_decimal = random.below(kind < 5 ? 18 : 25);
  for (std::uint64_t i = 0; i < num_integer; ++i) text += static_cast<char>('0' + random.below(10));
  if (num_decimal > 0) text += '.';
  for (std::uint64_t i = 0; i < num_decimal; ++i) text += static_cast<char>('0' + random.below(10));
  if (random.below(3) == 0) {
    text += random.below(2) == 0 ? 'e' : 'E';
    if (random.below(2) == 0) text += random.below(2) == 0 ? '-' : '+';
    text += std::to_string(random.below(kind == 7 ? 400 : 40));
  }
  return text;
}

// The value is std::from_chars's to the last bit, on both sides of the fast path's border.
TEST(ParseDecimal, EqualsFromCharsOnAMillionStrings) {
  Rng random(1);
  for (int i = 0; i < 1'000'000; ++i) {
    expect_as_from_chars(random_decimal(random));
    if (HasFatalFailure()) return;
  }
}

TEST(ParseDecimal, EqualsFromCharsOnTheHardCases) {
  for (const char* text : {"0",
                           "-0",
                           "0.0",
                           "-0.0e5",
                           "9007199254740992",
                           "9007199254740993",
                           "9007199254740993e22",
                           "1e22",
                           "1e23",
                           "1e-22",
                           "1e-23",
                           "4.9e-324",
                           "2.4703282292062327e-324",
                           "2.2250738585072011e-308",
                           "1.7976931348623157e308",
                           "123456789012345678901234567890",
                           "0.000000000000000000000000000000000000000001",
                           "1.",
                           ".5",
                           ".",
                           "-",
                           "e5",
                           "1e",
                           "1e+",
                           "1e-",
                           "--1",
                           "1.2.3",
                           "nan",
                           "-nan",
                           "inf",
                           "-inf",
                           "infinity",
                           "nan(ind)",
                           "0x10",
                           "",
                           "00000000000000000000001",
                           "1e0000000000000000022"}) {
    expect_as_from_chars(text);
  }
}

TEST(ParseDecimal, TakesAPlusAndTellsTooLargeFromTooSmall) {
  double value = 1.0;
  std::size_t length = 0;
  EXPECT_EQ(parse("+2.5", value, length), DecimalStatus::ok);
  EXPECT_EQ(value, 2.5);
  EXPECT_EQ(parse("+12345678901234567890.5", value, length), DecimalStatus::ok);
  EXPECT_EQ(value, 12345678901234567890.5);
  EXPECT_EQ(parse("+-1", value, length), DecimalStatus::syntax);
  for (const char* large : {"1e309", "-1e400", "1e99999999999999999999", "0.001e312"}) {
    EXPECT_EQ(parse(large, value, length), DecimalStatus::range) << large;
  }
  EXPECT_EQ(parse(std::string(400, '9'), value, length), DecimalStatus::range);
  for (const char* small : {"1e-400", "1e-99999999999999999999", "1000e-400"}) {
    EXPECT_EQ(parse(small, value, length), DecimalStatus::ok) << small;
    EXPECT_EQ(value, 0.0) << small;
  }
  EXPECT_EQ(parse("-1e-400", value, length), DecimalStatus::ok);
  EXPECT_TRUE(std::signbit(value));
  EXPECT_EQ(parse("0." + std::string(400, '0') + "1", value, length), DecimalStatus::ok);
  EXPECT_EQ(value, 0.0);
  EXPECT_EQ(parse(std::string(300, '0') + "1e5", value, length), DecimalStatus::ok);
  EXPECT_EQ(value, 1e5);
}

// A locale with a decimal comma changes nothing.
TEST(ParseDecimal, DoesNotDependOnTheLocale) {
  const char* const german = std::setlocale(LC_ALL, "de_DE.UTF-8");
  if (german == nullptr) GTEST_SKIP() << "the locale de_DE.UTF-8 is not on this machine";
  const SurfaceOutput surface = test::icosahedron();
  const std::string in_german = format_surface(surface, SurfaceFormat::obj);
  const SurfaceFile file = parse_surface(test::bytes_of(in_german), "a.obj");
  std::setlocale(LC_ALL, "C");
  EXPECT_EQ(in_german, format_surface(surface, SurfaceFormat::obj));
  EXPECT_TRUE(file.mesh.points == surface.points);
}

TEST(TextScanner, KnowsAllLineEndsAndSkipsBlankLinesAndComments) {
  const std::string text = "\xEF\xBB\xBF one 1\r\n\n  # nothing\rtwo\t2 # rest\n\n\rthree 3";
  TextScanner scanner(test::bytes_of(text), "a.txt", {}, {.comment = '#'});
  EXPECT_TRUE(scanner.has_bom());
  EXPECT_TRUE(scanner.is_unterminated());
  const std::vector<std::pair<std::string, std::int64_t>> expected = {
      {"one", 1}, {"two", 4}, {"three", 7}};
  std::int64_t value = 0;
  for (const auto& [word, line] : expected) {
    ASSERT_TRUE(scanner.next_line());
    EXPECT_EQ(scanner.word("a word"), word);
    EXPECT_EQ(scanner.integer("a number"), ++value);
    scanner.expect_line_end();
    EXPECT_EQ(scanner.line(), line);
  }
  EXPECT_FALSE(scanner.next_line());
  EXPECT_FALSE(scanner.next_line());
  EXPECT_TRUE(scanner.at_line_end());
}

TEST(TextScanner, JoinsLinesAtABackslash) {
  const std::string text = "f 1 \\\n 2 \\\r\n 3\nf 4\n";
  TextScanner scanner(test::bytes_of(text), "a.obj", {}, {.has_continuation = true});
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.word("f"), "f");
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(scanner.index("an index"), i);
  EXPECT_TRUE(scanner.at_line_end());
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.line(), 4);
}

// Code and line of the error that `read` ends in on the second line of a text.
template <class Read>
std::string error_of(const std::string& second_line, Read read) {
  const std::string text = "first\n" + second_line;
  TextScanner scanner(test::bytes_of(text), "a.txt", {.max_line_bytes = 100});
  try {
    scanner.next_line();
    scanner.next_line();
    read(scanner);
    scanner.next_line();
  } catch (const IoError& error) {
    EXPECT_EQ(error.location().line, 2);
    return error.code();
  }
  return "no error";
}

TEST(TextScanner, NamesWhatIsWrong) {
  const auto number = [](TextScanner& s) { s.number("x"); };
  const auto integer = [](TextScanner& s) { s.integer("n"); };
  const auto count = [](TextScanner& s) { s.count("n"); };
  EXPECT_EQ(error_of("1.5\n", number), "no error");
  EXPECT_EQ(error_of("1,5\n", number), "E_DECIMAL_COMMA");
  EXPECT_EQ(error_of("1,5\n", integer), "E_DECIMAL_COMMA");
  EXPECT_EQ(error_of("hello\n", number), "E_SYNTAX");
  EXPECT_EQ(error_of("1.5x\n", number), "E_SYNTAX");
  EXPECT_EQ(error_of("-1.#IND\n", number), "E_SYNTAX");
  EXPECT_EQ(error_of(std::string("1\0\n", 3), number), "E_SYNTAX");
  EXPECT_EQ(error_of(std::string("#\0\n", 3), [](TextScanner& s) { s.rest_of_line(); }),
            "E_SYNTAX");
  EXPECT_EQ(error_of("1e999\n", number), "E_NUMBER_RANGE");
  EXPECT_EQ(error_of("9223372036854775808\n", integer), "E_NUMBER_RANGE");
  EXPECT_EQ(error_of("18446744073709551617\n", count), "E_NUMBER_RANGE");
  EXPECT_EQ(error_of("-1\n", count), "E_NUMBER_RANGE");
  EXPECT_EQ(error_of("3.7\n", count), "E_NUMBER_RANGE");
  EXPECT_EQ(error_of("3.7\n", integer), "E_SYNTAX");
  EXPECT_EQ(error_of("1 2\n", [](TextScanner& s) { s.number("x"), s.expect_line_end(); }),
            "E_SYNTAX");
  EXPECT_EQ(error_of("1\n", [](TextScanner& s) { s.number("x"), s.number("y"); }), "E_TRUNCATED");
  EXPECT_EQ(error_of("1\n2\n", [](TextScanner& s) { s.number("x"), s.number("y"); }), "E_SYNTAX");
  EXPECT_EQ(error_of("1.5e", number), "E_TRUNCATED");
  EXPECT_EQ(error_of("-", number), "E_TRUNCATED");
  EXPECT_EQ(error_of("1 " + std::string(200, ' ') + "\nnext\n", number), "E_LINE_TOO_LONG");
}

TEST(TextScanner, ReadsWholeNumbersToTheEdgesOf64Bits) {
  const std::string text =
      "9223372036854775807 -9223372036854775808 123456789 1234567890 +7 007\n"
      "99999999999999999999 -99999999999999999999 7/8\n";
  TextScanner scanner(test::bytes_of(text), "a.txt", {});
  using Limits = std::numeric_limits<std::int64_t>;
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.integer("n"), Limits::max());
  EXPECT_EQ(scanner.integer("n"), Limits::min());
  EXPECT_EQ(scanner.index("n"), 123456789);
  EXPECT_EQ(scanner.index("n"), 1234567890);
  EXPECT_EQ(scanner.index("n"), 7);
  EXPECT_EQ(scanner.index("n"), 7);
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.index("n"), Limits::max());
  EXPECT_EQ(scanner.index("n"), Limits::min());
  EXPECT_EQ(scanner.index("n", '/'), 7);
  EXPECT_TRUE(scanner.take('/'));
  EXPECT_EQ(scanner.index("n"), 8);
}

}  // namespace
}  // namespace dupin::detail
