// SPDX-License-Identifier: Apache-2.0
#include "report/html.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "util/utf8.hpp"

namespace raysplats::report {
namespace {

constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--text:#1d1d1b;--line:#d5d5d0;--warn:#9c3a1a;--c0:#1d5fa8;--c1:#c2561b;--c2:#2c7d3c;--c3:#8a3fa0;--c4:#8a6d14;--c5:#b02358}
@media screen and (prefers-color-scheme:dark){:root{--text:#e6e6e3;--line:#3c3e42;--warn:#f0906a;--c0:#7db4ee;--c1:#f0a15e;--c2:#7fd08f;--c3:#cf93e6;--c4:#d9bd5c;--c5:#f288ab}body{background:#1c1d1f}}
body{max-width:1000px;margin:24px auto;padding:0 16px;color:var(--text);font:15px/1.5 system-ui,sans-serif}
h1,p,figcaption{overflow-wrap:anywhere}h1{font-size:22px}h2{font-size:17px;margin-top:28px;border-top:1px solid var(--line);padding-top:10px}
.warn{color:var(--warn)}.charts{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(380px,100%),1fr));gap:12px}
svg{width:100%;height:auto;overflow:visible}svg text{fill:currentColor;font-size:11px}svg .title{font-size:13px;font-weight:600}
svg line{stroke:var(--line)}polyline{fill:none;stroke-width:1.6}
polyline.c0{stroke:var(--c0)}circle.c0,svg text.c0{fill:var(--c0)}th.c0{color:var(--c0)}polyline.c1{stroke:var(--c1)}circle.c1,svg text.c1{fill:var(--c1)}th.c1{color:var(--c1)}
polyline.c2{stroke:var(--c2)}circle.c2,svg text.c2{fill:var(--c2)}th.c2{color:var(--c2)}polyline.c3{stroke:var(--c3)}circle.c3,svg text.c3{fill:var(--c3)}th.c3{color:var(--c3)}
polyline.c4{stroke:var(--c4)}circle.c4,svg text.c4{fill:var(--c4)}th.c4{color:var(--c4)}polyline.c5{stroke:var(--c5)}circle.c5,svg text.c5{fill:var(--c5)}th.c5{color:var(--c5)}
table{border-collapse:collapse;display:block;overflow-x:auto}td,th{padding:3px 14px 3px 0;text-align:left;border-bottom:1px solid var(--line)}
svg.bar{width:90px}svg.bar rect,rect.c0{fill:var(--c0)}circle.plain{fill:currentColor;opacity:.55}svg line.look{stroke:currentColor;opacity:.4}
figure{margin:14px 0}img{max-width:100%;min-width:min(100%,640px);height:auto}pre{white-space:pre-wrap;overflow-wrap:anywhere}
@media print{:root{color-scheme:light}body{max-width:none;margin:0;padding:0;font-size:10pt}.charts{grid-template-columns:1fr 1fr}
h2{break-after:avoid}figure,svg,tr{break-inside:avoid}img{min-width:0;max-height:9cm}details{display:none}table{display:table}td,th{overflow-wrap:anywhere}svg,.warn{print-color-adjust:exact}}
)";

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t size = utf8_character(text);
    const char c = text.front();
    const bool control = static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t';
    if (size == 0 || control) {
      out += "\xef\xbf\xbd";
    } else if (size > 1) {
      out += text.substr(0, size);
    } else if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else if (c == '\'') {
      out += "&#39;";
    } else {
      out += c;
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return out;
}

std::string data_url(std::string_view type, std::span<const unsigned char> bytes) {
  static constexpr char kLetters[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out = fmt::format("data:{};base64,", type);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto at = [&](std::size_t k) {
      return i + k < bytes.size() ? static_cast<unsigned>(bytes[i + k]) : 0u;
    };
    const unsigned word = at(0) << 16 | at(1) << 8 | at(2);
    out += kLetters[word >> 18];
    out += kLetters[word >> 12 & 63];
    out += i + 1 < bytes.size() ? kLetters[word >> 6 & 63] : '=';
    out += i + 2 < bytes.size() ? kLetters[word & 63] : '=';
  }
  return out;
}

std::string share_cell(double share) {
  if (!(share > 0)) return "<td></td>";
  return fmt::format(
      "<td><svg class=\"bar\" viewBox=\"0 0 100 8\" role=\"img\" aria-label=\"{0:.0f} %\"><rect "
      "width=\"{1:.1f}\" height=\"8\"/></svg> {0:.1f} %</td>",
      100 * share, std::min(100.0, 100 * share));
}

std::string page(std::string_view title, std::string_view body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n<meta "
      "http-equiv=\"Content-Security-Policy\" content=\"default-src &#39;none&#39;; img-src data:; "
      "style-src &#39;unsafe-inline&#39;\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width\"/><title>{0}</title>\n<style>{1}</style></head>\n<body><h1>{0}"
      "</h1>\n{2}<p>RaySplats-CL {3}</p>\n</body></html>\n",
      escaped(title), kStyle, body, RAYSPLATS_VERSION);
}

}  // namespace raysplats::report
