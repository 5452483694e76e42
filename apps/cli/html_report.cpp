#include "html_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>

#include "svg_plot.h"

namespace dupin::cli {
namespace {

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --ink: #1d2126; --soft: #5c646e; --paper: #fbfbf9; --card: #ffffff;
  --line: #e2e3df; --accent: #0a66a3; --code: #f1f2ee; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8ea; --soft: #a0a8b0; --paper: #14171a;
  --card: #1b1f23; --line: #31373d; --accent: #6bb8ea; --code: #20252a; } }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 17px/1.6 Charter, "Bitstream Charter", "Iowan Old Style", Cambria, Georgia, serif; }
main { max-width: 1120px; margin: 0 auto; padding: 4rem 1.5rem 5rem; }
h1, h2, h3, nav, table, figcaption, footer, .note { font-family: system-ui, "Segoe UI", Roboto,
  "Helvetica Neue", sans-serif; }
h1 { font-size: 2.6rem; line-height: 1.15; letter-spacing: -0.02em; margin: 0 0 0.8rem; }
h2 { font-size: 1.65rem; letter-spacing: -0.01em; margin: 4.5rem 0 0.2rem; padding-top: 1.2rem;
  border-top: 1px solid var(--line); }
h3 { font-size: 1.08rem; margin: 2.4rem 0 0.6rem; }
p { max-width: 42rem; margin: 0.6rem 0 1rem; }
.lead { font-size: 1.22rem; line-height: 1.5; color: var(--soft); max-width: 44rem; }
.note { color: var(--soft); font-size: 0.92rem; margin: 0 0 1rem; }
nav { margin: 2rem 0 0; font-size: 0.95rem; }
nav a { color: var(--accent); text-decoration: none; margin-right: 1.4rem; white-space: nowrap; }
nav a:hover { text-decoration: underline; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(26rem, 1fr)); gap: 1.2rem;
  margin: 1.2rem 0; }
figure { margin: 0; background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  overflow: hidden; }
main > figure { margin: 1.2rem 0; }
figure img { display: block; width: 100%; height: auto; background: #ffffff; }
figure svg { display: block; width: 100%; height: auto; padding: 1rem 1rem 0; }
figcaption { padding: 0.75rem 1rem 0.85rem; font-size: 0.87rem; line-height: 1.45;
  color: var(--soft); }
.table { overflow-x: auto; margin: 1.2rem 0; background: var(--card); border: 1px solid var(--line);
  border-radius: 10px; }
table { border-collapse: collapse; width: 100%; font-size: 0.9rem;
  font-variant-numeric: tabular-nums; }
caption { caption-side: bottom; text-align: left; padding: 0.75rem 1rem; color: var(--soft);
  font-size: 0.87rem; }
th, td { padding: 0.42rem 1rem; text-align: left; white-space: nowrap; }
th.number, td.number { text-align: right; }
th { font-weight: 600; border-bottom: 1px solid var(--line); cursor: pointer; user-select: none; }
th::after { content: " \2195"; color: var(--soft); opacity: 0.45; font-size: 0.8em; }
th[aria-sort=ascending]::after { content: " \2191"; opacity: 1; }
th[aria-sort=descending]::after { content: " \2193"; opacity: 1; }
tbody tr:nth-child(even) { background: color-mix(in srgb, var(--ink) 3%, transparent); }
pre { background: var(--code); border-radius: 8px; padding: 0.9rem 1.1rem; overflow-x: auto;
  font: 0.84rem/1.55 ui-monospace, "SF Mono", Menlo, Consolas, monospace; }
.colors { list-style: none; padding: 0; margin: 0.6rem 0 1rem; display: flex; flex-wrap: wrap;
  gap: 0.3rem 1.4rem; font: 0.9rem/1.5 system-ui, "Segoe UI", Roboto, sans-serif; }
.colors i { display: inline-block; width: 0.9em; height: 0.9em; border-radius: 3px;
  margin-right: 0.5em; vertical-align: -0.08em; }
footer { margin-top: 4rem; color: var(--soft); font-size: 0.85rem; border-top: 1px solid var(--line);
  padding-top: 1rem; }
@media print { body { background: #fff; } figure, .table { break-inside: avoid; } nav { display: none; } }
)";

constexpr const char* kScript = R"(
document.querySelectorAll("th").forEach(head => head.addEventListener("click", () => {
  const body = head.closest("table").tBodies[0], column = head.cellIndex;
  const up = head.getAttribute("aria-sort") !== "ascending";
  head.parentNode.querySelectorAll("th").forEach(other => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
  const key = row => row.cells[column].textContent.replace("\u2212", "-");
  const order = (a, b) => { const x = parseFloat(key(a)), y = parseFloat(key(b));
    return isNaN(x) || isNaN(y) ? key(a).localeCompare(key(b)) : x - y; };
  [...body.rows].sort((a, b) => up ? order(a, b) : order(b, a)).forEach(row => body.append(row));
}));
)";

bool looks_like_number(const std::string& text) {
  // The true minus sign is three bytes of UTF-8.
  const std::string minus = "\u2212";
  const std::size_t at = text.compare(0, minus.size(), minus) == 0 ? minus.size() : 0;
  return at < text.size() && std::isdigit(static_cast<unsigned char>(text[at])) != 0;
}

}  // namespace

std::string data_uri(std::string_view png) {
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out = "data:image/png;base64,";
  out.reserve(out.size() + png.size() / 3 * 4 + 4);
  for (std::size_t i = 0; i < png.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, png.size() - i);
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (k < count ? static_cast<std::uint8_t>(png[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k)
      out += k <= count ? kDigits[bits >> (18 - 6 * k) & 63U] : '=';
  }
  return out;
}

HtmlReport::HtmlReport(std::string title, std::string lead)
    : title_(std::move(title)), lead_(std::move(lead)) {}

void HtmlReport::add_section(const std::string& heading, const std::string& note) {
  ++num_sections_;
  contents_ += fmt::format("<a href=\"#s{}\">{}</a>\n", num_sections_, html_escaped(heading));
  body_ += fmt::format("<h2 id=\"s{}\">{}</h2>\n", num_sections_, html_escaped(heading));
  if (!note.empty()) body_ += fmt::format("<p class=\"note\">{}</p>\n", html_escaped(note));
}

void HtmlReport::add_heading(const std::string& heading) {
  body_ += fmt::format("<h3>{}</h3>\n", html_escaped(heading));
}

void HtmlReport::add_paragraph(const std::string& text) {
  body_ += fmt::format("<p>{}</p>\n", html_escaped(text));
}

void HtmlReport::add_pictures(const std::vector<ReportPicture>& pictures) {
  body_ += "<div class=\"pictures\">\n";
  for (const ReportPicture& p : pictures) {
    // Browsers do not follow a link to an address that is the picture itself.
    const bool is_inside = p.file.compare(0, 5, "data:") == 0;
    const std::string file = html_escaped(p.file);
    body_ += fmt::format(
        "<figure>{0}<img src=\"{1}\" alt=\"{2}\" width=\"{3}\" height=\"{4}\" "
        "loading=\"lazy\">{5}<figcaption>{6}</figcaption></figure>\n",
        is_inside ? "" : "<a href=\"" + file + "\">", file, html_escaped(p.alt), p.width, p.height,
        is_inside ? "" : "</a>", html_escaped(p.caption));
  }
  body_ += "</div>\n";
}

void HtmlReport::add_colors(const std::vector<ReportColor>& colors) {
  body_ += "<ul class=\"colors\">\n";
  for (const ReportColor& c : colors) {
    const auto byte = [](double channel) {
      return static_cast<int>(std::lround(255.0 * std::clamp(channel, 0.0, 1.0)));
    };
    body_ += fmt::format("<li><i style=\"background:#{:02x}{:02x}{:02x}\"></i>{}</li>\n",
                         byte(c.red), byte(c.green), byte(c.blue), html_escaped(c.label));
  }
  body_ += "</ul>\n";
}

void HtmlReport::add_svg(const std::string& svg, const std::string& caption) {
  body_ +=
      fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", svg, html_escaped(caption));
}

void HtmlReport::add_table(const std::vector<std::string>& head,
                           const std::vector<std::vector<std::string>>& rows,
                           const std::string& caption) {
  std::vector<bool> is_number(head.size(), !rows.empty());
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < head.size(); ++c) {
      is_number[c] = is_number[c] && c < row.size() && looks_like_number(row[c]);
    }
  }
  const auto kind = [&](std::size_t c) { return is_number[c] ? " class=\"number\"" : ""; };
  body_ += fmt::format("<div class=\"table\"><table>\n<caption>{}</caption>\n<thead><tr>",
                       html_escaped(caption));
  for (std::size_t c = 0; c < head.size(); ++c) {
    body_ += fmt::format("<th scope=\"col\"{}>{}</th>", kind(c), html_escaped(head[c]));
  }
  body_ += "</tr></thead>\n<tbody>\n";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (std::size_t c = 0; c < std::min(row.size(), head.size()); ++c) {
      body_ += fmt::format("<td{}>{}</td>", kind(c), html_escaped(row[c]));
    }
    body_ += "</tr>\n";
  }
  body_ += "</tbody></table></div>\n";
}

void HtmlReport::add_commands(const std::vector<std::string>& lines) {
  body_ += "<pre>";
  for (const std::string& line : lines) body_ += html_escaped(line) + "\n";
  body_ += "</pre>\n";
}

std::string HtmlReport::page(const std::string& footer) const {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>{0}</title>\n<style>{1}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{0}</h1>\n"
      "<p class=\"lead\">{2}</p>\n<nav>\n{3}</nav>\n</header>\n{4}<footer>{5}</footer>\n</main>\n"
      "<script>{6}</script>\n</body>\n</html>\n",
      html_escaped(title_), kStyle, html_escaped(lead_), contents_, body_, html_escaped(footer),
      kScript);
}

}  // namespace dupin::cli
