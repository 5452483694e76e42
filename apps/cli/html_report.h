#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace dupin::cli {

/// A picture of a report: a file beside the page, or inside it.
struct ReportPicture {
  std::string file;     ///< relative to the page, or as of data_uri()
  std::string alt;      ///< for those who do not see it
  std::string caption;  ///< one sentence
  int width = 0;        ///< [px]
  int height = 0;       ///< [px]
};

/// A colour and what it stands for. Channels in [0, 1].
struct ReportColor {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
  std::string label;
};

/// The bytes of a PNG as the address of a picture.
std::string data_uri(std::string_view png);

/// A self-contained page: inline style for light and dark, no request to anywhere but the pictures
/// beside it. Everything given as text is escaped; only add_svg() takes markup.
class HtmlReport {
 public:
  HtmlReport(std::string title, std::string lead);

  /// A section with an entry in the contents at the top.
  void add_section(const std::string& heading, const std::string& note = "");
  void add_heading(const std::string& heading);
  void add_paragraph(const std::string& text);
  /// Pictures side by side, as many in a row as the window holds.
  void add_pictures(const std::vector<ReportPicture>& pictures);
  /// What the colours of the pictures around stand for.
  void add_colors(const std::vector<ReportColor>& colors);
  /// `svg` as made by format_svg().
  void add_svg(const std::string& svg, const std::string& caption);
  /// A table whose rows a click on a column's head sorts; columns of numbers are set right.
  void add_table(const std::vector<std::string>& head,
                 const std::vector<std::vector<std::string>>& rows, const std::string& caption);
  /// Lines for a terminal.
  void add_commands(const std::vector<std::string>& lines);

  /// The whole page.
  std::string page(const std::string& footer) const;

 private:
  std::string title_;
  std::string lead_;
  std::string contents_;
  std::string body_;
  int num_sections_ = 0;
};

}  // namespace dupin::cli
