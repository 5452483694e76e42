#include "dupin/warp/project.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/warp/json_text.h"
#include "dupin/warp/sha256.h"

namespace dupin {
namespace {

using Eigen::Index;

WarpProject sample_project() {
  WarpProject project;
  project.program = "0.1.0";
  project.image = {"pictures/t-shirt é.png", sha256_hex("picture"), 800, 600};
  WarpPin cuff;
  cuff.name = "l_cuff";
  cuff.source << 120.5, 88.25;
  cuff.target << 0.1, -1.0 / 3.0;
  cuff.rotation_deg = 30.0;
  cuff.depth = -2.0;
  cuff.radius = 12.5;
  cuff.weight = 1e-6;
  WarpPin hem;
  hem.kind = PinKind::exterior;
  hem.source << 400, 590;
  hem.target << 1e6, 2e-17;
  project.stages = {{StageMode::coarse, {cuff, hem}}, {StageMode::fine, {}}};
  return project;
}

// A random project with every field away from its default.
WarpProject random_project(std::uint64_t seed) {
  Rng rng(seed);
  WarpProject project = sample_project();
  project.contour.source = ContourSource::polyline;
  project.contour.alpha_threshold = rng.uniform(0.0, 0.999);
  project.contour.expansion = rng.uniform(0.0, 256.0);
  project.contour.minimum_area = rng.uniform(1.0, 1e4);
  project.contour.keep_holes = rng.below(2) == 0;
  project.contour.detail = rng.uniform(7.0, 100.0);
  Points2 loop(3 + static_cast<Index>(rng.below(5)), 2);
  for (Index i = 0; i < loop.size(); ++i) loop.data()[i] = 1e3 * rng.normal();
  project.contour.loops = {loop};
  project.mesh.spacing = std::exp(rng.uniform(0.0, 5.0));
  project.mesh.triangles = 16 + static_cast<int>(rng.below(1000));
  project.mesh.smoothing = static_cast<int>(rng.below(1000));
  project.deformation.method = static_cast<WarpMethod>(rng.below(3));
  project.deformation.alpha = rng.uniform(0.1, 20.0);
  for (WarpStage& stage : project.stages) {
    WarpPin pin;
    pin.name = "pin " + std::to_string(rng.below(1000)) + " \" \\ ü";
    pin.source << rng.normal(), 1e5 * rng.normal();
    pin.target << 1e-9 * rng.normal(), rng.uniform();
    pin.loop = static_cast<int>(rng.below(1000));
    stage.pins.push_back(pin);
  }
  return project;
}

std::string code_of(const std::string& text) {
  try {
    parse_project(text);
  } catch (const Error& error) {
    return error.code();
  }
  return "";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at != std::string::npos) text.replace(at, from.size(), to);
  return text;
}

std::string without_checksum(const std::string& text) {
  return text.substr(0, text.find(",\n  \"checksum\"")) + "\n}\n";
}

// FIPS 180-4, and lengths on both sides of where the padding needs another block.
TEST(Sha256, GivesThePublishedDigests) {
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_hex(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  EXPECT_EQ(sha256_hex(std::string(55, 'a')),
            "9f4390f8d30c2dd92ec9f095b65e2b9ae9b0a925a5258e241c9f1e910f734318");
  EXPECT_EQ(sha256_hex(std::string(56, 'a')),
            "b35439a4ac6f0948b6d6f9e3c6af0f5f590ce20f1bde7090ef7970686ec6738a");
  EXPECT_EQ(sha256_hex(std::string(64, 'a')),
            "ffe054fe7ae0cb6dc65c3af9b61d5209f439851db43d0ba5997337df154668eb");
}

// Closed form, then the definition: reading back gives the value, and no shorter text does.
TEST(ShortestDecimal, ReadsBackAndIsShortest) {
  EXPECT_EQ(detail::shortest_decimal(0.1), "0.1");
  EXPECT_EQ(detail::shortest_decimal(-0.0), "0");
  EXPECT_EQ(detail::shortest_decimal(120.5), "120.5");
  EXPECT_EQ(detail::shortest_decimal(-1200.0), "-1200");
  EXPECT_EQ(detail::shortest_decimal(1e15), "1e15");
  EXPECT_EQ(detail::shortest_decimal(0.00001), "0.00001");
  EXPECT_EQ(detail::shortest_decimal(1.25e-6), "1.25e-6");
  EXPECT_EQ(detail::shortest_decimal(5e-324), "5e-324");
  Rng rng(3);
  for (int k = 0; k < 2000; ++k) {
    const double value = rng.normal() * std::pow(10.0, rng.uniform(-30.0, 30.0));
    ASSERT_EQ(std::stod(detail::shortest_decimal(value)), value);
  }
}

TEST(WarpProject, ReadsBackEqual) {
  EXPECT_EQ(parse_project(format_project(sample_project())), sample_project());
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const WarpProject project = random_project(seed);
    const std::string text = format_project(project);
    ASSERT_EQ(parse_project(text), project) << seed;
    ASSERT_EQ(format_project(parse_project(text)), text) << seed;
  }
}

// Equal is not merely "both parsed": a change of any kind of field is seen.
TEST(WarpProject, DifferencesAreSeen) {
  const WarpProject project = random_project(1);
  const auto differs = [&](auto change) {
    WarpProject other = project;
    change(other);
    return !(other == project) && format_project(other) != format_project(project);
  };
  EXPECT_TRUE(differs([](WarpProject& p) { p.program += "1"; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.image.width += 1; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.contour.keep_holes = !p.contour.keep_holes; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.contour.loops[0](1, 1) += 1e-9; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.contour.expansion *= 1.0 + 1e-15; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.stages[0].pins[0].loop += 1; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.mesh.smoothing += 1; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.deformation.alpha *= 1.0 + 1e-15; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.stages[0].pins[0].target.y() += 1e-15; }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.stages[0].pins[0].rotation_deg.reset(); }));
  EXPECT_TRUE(differs([](WarpProject& p) { p.stages[1].mode = StageMode::coarse; }));
}

// A file that lost its end, or one bit, is refused with a code or means what it meant.
TEST(WarpProject, NoPrefixAndNoFlippedBitIsTakenForAnotherProject) {
  const WarpProject project = sample_project();
  const std::string text = format_project(project);
  const auto equal_or_refused = [&](const std::string& damaged) {
    try {
      return parse_project(damaged) == project;
    } catch (const IoError& error) {
      return error.code().starts_with("E_") &&
             (error.errc() == Errc::malformed || error.errc() == Errc::over_limit);
    }
  };
  for (std::size_t length = 0; length < text.size(); ++length)
    ASSERT_TRUE(equal_or_refused(text.substr(0, length))) << length;
  for (std::size_t bit = 0; bit < 8 * text.size(); ++bit) {
    std::string damaged = text;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    ASSERT_TRUE(equal_or_refused(damaged)) << "byte " << bit / 8 << ": " << damaged;
  }
}

TEST(WarpProject, HandWrittenTextNeedsOnlyThePicture) {
  const std::string text = R"({"format": "dwarp", "version": 1, "image": {"path": "a.png",
    "sha256": ")" + sha256_hex("") +
                           R"(", "width": 8, "height": 9},
    "stages": [{"mode": "coarse", "pins": [{"source": [1, 2.5], "target": [3e0, 4]}]}]})";
  WarpProject expected;
  expected.image = {"a.png", sha256_hex(""), 8, 9};
  WarpPin pin;
  pin.source << 1, 2.5;
  pin.target << 3, 4;
  expected.stages = {{StageMode::coarse, {pin}}};
  EXPECT_EQ(parse_project(text), expected);
}

TEST(WarpProject, ErrorsHaveCodesAndLines) {
  const std::string text = without_checksum(format_project(sample_project()));
  EXPECT_EQ(code_of(text), "");
  EXPECT_EQ(code_of(""), "E_EMPTY");
  EXPECT_EQ(code_of("[]"), "E_MAGIC");
  EXPECT_EQ(code_of(replaced(text, "\"dwarp\"", "\"twarp\"")), "E_MAGIC");
  EXPECT_EQ(code_of(replaced(text, "\"version\": 1", "\"version\": 2")), "E_VERSION");
  EXPECT_EQ(code_of(replaced(text, "\"version\": 1", "\"version\": 1.5")), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of(replaced(text, "120.5", "1e7")), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of(replaced(text, "120.5", "1e999")), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of(replaced(text, "120.5", "NaN")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "120.5", "0120.5")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "\"smoothing\": 3", "\"smoothing\": 3.5")), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of(replaced(text, "\"spacing\": 0", "\"spacing\": 0.1")), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of(replaced(text, "\"coarse\"", "\"rough\"")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "\"depth\"", "\"depht\"")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "\"program\": ", "\"program\": \"\", \"program\": ")),
            "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "pictures/", "/pictures/")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "pictures/", "C:\\\\pictures\\\\")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "\"l_cuff\"", "\"\\u0007\"")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "\"l_cuff\"", "\"\\ud800\"")), "E_SYNTAX");
  EXPECT_EQ(code_of(replaced(text, "l_cuff", "\xff")), "E_SYNTAX");
  EXPECT_EQ(code_of(std::string(100000, '[')), "E_NESTING");
  try {
    parse_project(replaced(text, "\"interior\"", "\"inside\""));
    FAIL();
  } catch (const IoError& error) {
    EXPECT_EQ(error.code(), "E_SYNTAX");
    // Nine lines of settings and one of the stage come before the first pin.
    EXPECT_EQ(error.location().line, 11);
  }
}

TEST(WarpProject, LimitsHold) {
  std::string pins = "[";
  for (int i = 0; i <= 10000; ++i)
    pins += std::string(i > 0 ? "," : "") + R"({"source":[0,0],"target":[0,0]})";
  try {
    parse_pins(pins + "]");
    FAIL();
  } catch (const IoError& error) {
    EXPECT_EQ(error.code(), "E_TOO_LARGE");
    EXPECT_EQ(error.errc(), Errc::over_limit);
  }
  std::string zeros = "[0";
  for (int i = 0; i < 300000; ++i) zeros += ",0";
  EXPECT_EQ(code_of(zeros + "]"), "E_TOO_LARGE");
  EXPECT_EQ(code_of(std::string((16U << 20U) + 1, ' ')), "E_TOO_LARGE");
}

// Edited by hand, the project says so; without the checksum it is taken as it is. White space
// between tokens does not count, so that other line ends or indents do no harm.
TEST(WarpProject, ChangesAfterWritingAreFound) {
  const std::string text = format_project(sample_project());
  EXPECT_EQ(code_of(replaced(text, "120.5", "121.5")), "E_CRC");
  EXPECT_EQ(code_of(replaced(text, "120.5", "120.50")), "E_CRC");
  EXPECT_EQ(code_of(replaced(text, "t-shirt", "t- shirt")), "E_CRC");
  std::string reflowed;
  for (const char c : text) reflowed += c == '\n' ? std::string("\r\n\t") : std::string(1, c);
  EXPECT_EQ(code_of(reflowed), "");
  const std::string checksum = text.substr(text.find("  \"checksum\""), 80);
  EXPECT_EQ(code_of(replaced(without_checksum(text), "  \"program\"",
                             checksum.substr(0, checksum.rfind('"') + 1) + ",\n  \"program\"")),
            "E_SYNTAX");
  EXPECT_EQ(code_of(without_checksum(replaced(text, "120.5", "121.5"))), "");
}

// The checksum is of the text: a program that writes fewer fields, or others in another order, made
// projects that are whole. Here one of before contour.expansion, by the documented recipe.
TEST(WarpProject, ProjectsOfProgramsWithFewerFieldsAreWhole) {
  const std::string body = R"({"format":"dwarp","version":1,"image":{"width":8,"height":9,"path":)"
                           R"("a \" b.png","sha256":")" +
                           sha256_hex("") + "\"}";
  EXPECT_EQ(code_of(body + ",\"checksum\":\"" + sha256_hex(body) + "\"}"), "");
  EXPECT_EQ(code_of(body + " ,\n \"checksum\" : \"" + sha256_hex(body) + "\" }\n"), "");
  EXPECT_EQ(code_of(body + ",\"checksum\":\"" + sha256_hex(body + " ") + "\"}"), "E_CRC");
}

// Each corner is three values of the 300,000 that are read.
TEST(WarpProject, WhatIsTooLargeToBeReadIsNotWritten) {
  WarpProject project = sample_project();
  project.contour.source = ContourSource::polyline;
  const auto code_with = [&](Index corners) {
    project.contour.loops = {Points2::Zero(corners, 2)};
    try {
      format_project(project);
    } catch (const Error& error) {
      EXPECT_EQ(error.errc(), Errc::over_limit);
      return error.code();
    }
    return std::string();
  };
  EXPECT_EQ(code_with(99900), "");
  EXPECT_EQ(parse_project(format_project(project)), project);
  EXPECT_EQ(code_with(100000), "E_TOO_LARGE");
}

TEST(WarpProject, AnotherPictureIsRefused) {
  const std::string bytes = "picture";
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  EXPECT_NO_THROW(require_image(sample_project(), {data, bytes.size()}));
  try {
    require_image(sample_project(), {data, bytes.size() - 1});
    FAIL();
  } catch (const AnalysisError& error) {
    EXPECT_EQ(error.code(), "E_IMAGE_CHANGED");
  }
}

TEST(WarpProject, WhatCannotBeReadIsNotWritten) {
  const auto refused = [](auto change) {
    WarpProject project = sample_project();
    change(project);
    try {
      format_project(project);
    } catch (const InvalidArgument&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused([](WarpProject&) {}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refused([&](WarpProject& p) { p.stages[0].pins[0].source.x() = nan; }));
  EXPECT_TRUE(refused([&](WarpProject& p) { p.stages[0].pins[0].rotation_deg = nan; }));
  EXPECT_TRUE(refused([&](WarpProject& p) { p.deformation.alpha = nan; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.stages[0].pins[1] = p.stages[0].pins[0]; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.image.path = ""; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.image.sha256 = "abc"; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.image.width = 0; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.contour.source = ContourSource::polyline; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.contour.detail = 6.0; }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.stages.resize(1001); }));
  EXPECT_TRUE(refused([](WarpProject& p) { p.program = "\xc3"; }));
}

TEST(Loops, AreReadAsAListOrAlone) {
  EXPECT_EQ(parse_loops("[[[0, 0], [1, 0], [0, 1.5]], [[5, 5], [6, 5], [5, 6]]]").size(), 2U);
  const auto one = parse_loops("[[0, 0], [1, 0], [0, 1.5]]");
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0](2, 1), 1.5);
  for (const char* text : {"[]", "[[]]", "[[0, 0], [1, 0]]", "[[[0, 0], [1, 0], 3]]", "{}", "[3]"})
    EXPECT_THROW(parse_loops(text), IoError) << text;
}

// The example of the command line: names, depth and rotation may be left out.
TEST(Pins, AreReadFromAListAlone) {
  const auto pins = parse_pins(
      R"([{"source": [1, 2], "target": [3, 4], "name": "hem", "depth": 2, "rotation": null},
          {"source": [5, 6], "target": [7, 8], "kind": "exterior"}])");
  ASSERT_EQ(pins.size(), 2U);
  EXPECT_EQ(pins[0].name, "hem");
  EXPECT_EQ(pins[0].depth, 2.0);
  EXPECT_FALSE(pins[0].rotation_deg);
  EXPECT_EQ(pins[1].kind, PinKind::exterior);
  EXPECT_EQ(pins[1].target, Eigen::RowVector2d(7, 8));
  EXPECT_THROW(parse_pins(R"([{"source": [1, 2]}])"), IoError);
  EXPECT_THROW(parse_pins(R"({})"), IoError);
  EXPECT_THROW(parse_pins(R"([{"source": [1, 2, 3], "target": [0, 0]}])"), IoError);
}

}  // namespace
}  // namespace dupin
