#include "check_image.h"

#include <fmt/format.h>

#include "dupin/io/png.h"
#include "dupin/warp/shape_from_image.h"

namespace dupin::cli {

using nlohmann::ordered_json;

ImageJudgement judge_image(const Context& context, const FileBytes& file, const std::string& name) {
  ImageJudgement judgement;
  PngFile picture = file.judge(name, [&] {
    return parse_png(file, name, context.read.limits, context.run.stage(0.0, 0.7));
  });
  judgement.width = picture.raster.width;
  judgement.height = picture.raster.height;
  judgement.bit_depth = picture.raster.bit_depth;
  judgement.has_profile = !picture.raster.colour.icc.empty();
  judgement.warnings = std::move(picture.warnings);
  ShapeOptions options;
  options.parts = ShapeParts::all;
  options.keep_outline = false;
  const ImageShape shape = shape_from_image(picture.raster, options, context.run.stage(0.7, 1.0));
  context.run.throw_if_cancelled();
  judgement.num_parts = shape.num_parts;
  judgement.num_holes = shape.num_holes;
  judgement.area = shape.area;
  judgement.warnings.append(shape.warnings);
  return judgement;
}

ordered_json to_json(const ImageJudgement& judgement, const std::string& file) {
  ordered_json document;
  document["file"] = file;
  document["format"] = "png";
  document["width"] = judgement.width;
  document["height"] = judgement.height;
  document["bit_depth"] = judgement.bit_depth;
  document["colour_profile"] = judgement.has_profile;
  document["components"] = judgement.num_parts;
  document["holes"] = judgement.num_holes;
  document["area"] = judgement.area;
  document["warnings"] = to_json(judgement.warnings);
  return document;
}

void tell(const Context& context, const ImageJudgement& judgement, const std::string& file) {
  const auto line = [&](const char* name, const std::string& value) {
    context.say(fmt::format("  {:<17} {}", name, value));
  };
  context.say(fmt::format("{}: png", escaped(file, 4096)));
  line("pixels",
       fmt::format("{} x {}, {} bits a channel{}", judgement.width, judgement.height,
                   judgement.bit_depth, judgement.has_profile ? ", with a colour profile" : ""));
  line("components", fmt::format("{}", judgement.num_parts));
  line("holes", fmt::format("{}", judgement.num_holes));
  line("area", fmt::format("{:.8g} px^2", judgement.area));
  line("warnings", judgement.warnings.empty() ? "none" : "");
  for (const Warning& w : judgement.warnings.all()) {
    context.say(
        fmt::format("    {:<22} {:>8}  {}; first: {}", w.code, w.count, w.message, w.first));
  }
}

}  // namespace dupin::cli
