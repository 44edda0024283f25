// HTML parts shared by all report pages.
#include <fmt/format.h>

#include "base/base64.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/report.h"

namespace narpa::rehearsal {
namespace {

constexpr std::string_view kStyle = R"(
:root{--ink:#1d232b;--soft:#5b6470;--rule:#dfe3e8;--good:#00724f;--bad:#b3430a;--paper:#fff}
*{box-sizing:border-box}
body{margin:0;background:#f3f5f7;color:var(--ink);font:15px/1.5 system-ui,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:1200px;margin:0 auto;padding:28px 32px 60px;background:var(--paper);min-height:100vh}
h1{font-size:26px;line-height:1.25;margin:0 0 6px;font-weight:650}
h2{font-size:18px;margin:38px 0 10px;padding-bottom:5px;border-bottom:1px solid var(--rule);font-weight:650}
p{margin:6px 0;max-width:78ch}.lead{font-size:16px}.soft{color:var(--soft)}
table{border-collapse:collapse;width:100%;font-size:14px}
th{text-align:left;color:var(--soft);font-weight:600;border-bottom:1px solid var(--rule);padding:5px 12px 5px 0}
td{vertical-align:top;border-bottom:1px solid #eef0f3;padding:6px 12px 6px 0}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.badge{display:inline-block;padding:1px 9px;border-radius:10px;font-size:13px;font-weight:600;color:#fff;white-space:nowrap}
.good{background:var(--good)}.bad{background:var(--bad)}.none{background:#8a8f98}
.charts{display:flex;flex-wrap:wrap;gap:14px 16px}
figure{margin:0}figcaption{font-size:13px;color:var(--soft);max-width:360px}
img{max-width:360px;width:100%;border:1px solid var(--rule);border-radius:3px;display:block}
img.chart{max-width:100%;width:auto;border:0}
figure.sheet{margin-top:14px}.sheet img,.sheet figcaption{max-width:900px}
table.bars{max-width:1000px}table.bars td.bar{position:relative;width:45%}
td.bar i{position:absolute;left:0}i.asked{top:6px;height:20px;background:#009E7329;border-right:2px solid var(--ink)}
i.value{top:11px;height:10px;background:#0072B2}i.beyond{background:#D55E00}
code,pre{font:12.5px/1.5 ui-monospace,"DejaVu Sans Mono",monospace}
pre{background:#f6f8fa;padding:10px 12px;border-radius:4px;white-space:pre-wrap;overflow-wrap:anywhere;margin:6px 0}
dl{display:grid;grid-template-columns:max-content 1fr;gap:3px 16px;margin:8px 0;font-size:14px}dt{color:var(--soft)}dd{margin:0;overflow-wrap:anywhere}
@media(max-width:640px){
main{padding:16px 14px 40px}h1{font-size:21px}dl{grid-template-columns:1fr}dd{margin-bottom:6px}
table,tbody,tr,td,td.n{display:block;width:auto;text-align:left;white-space:normal}
tr:has(th){display:none}tr{border-bottom:1px solid var(--rule);padding:7px 0}td{border:0;padding:1px 0}
td[data-of]:not(:empty)::before{content:attr(data-of) ": ";color:var(--soft)}
table.bars td.bar{width:100%;height:30px}
}
)";

}  // namespace

std::string page_around(std::string_view title, std::string_view body) {
    return fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" "
        "content=\"width=device-width, initial-scale=1\"/><title>{}</title><style>{}</style></head>\n"
        "<body><main>\n{}</main></body></html>\n",
        escape(title), kStyle, body);
}

std::string badge(bool good) {
    return good ? "<span class=\"badge good\">passed</span>" : "<span class=\"badge bad\">failed</span>";
}

HtmlTable::HtmlTable(std::initializer_list<std::string_view> titles) {
    rows_ += "<tr>";
    for (std::string_view title : titles) {
        numbers_.push_back(title.starts_with('#'));
        titles_.emplace_back(title.substr(numbers_.back() ? 1 : 0));
        rows_ += numbers_.back() ? fmt::format("<th class=\"n\">{}</th>", title.substr(1))
                                 : fmt::format("<th>{}</th>", title);
    }
    rows_ += "</tr>\n";
}

void HtmlTable::row(std::initializer_list<std::string> cells) {
    rows_ += "<tr>";
    std::size_t i = 0;
    for (const std::string& cell : cells) {
        rows_ += numbers_[i] ? "<td class=\"n\"" : "<td";
        if (!titles_[i].empty()) rows_ += " data-of=\"" + escape(titles_[i]) + "\"";
        rows_ += ">" + cell + "</td>";
        ++i;
    }
    rows_ += "</tr>\n";
}

std::string charts_of(const std::string& folder, std::initializer_list<PageChart> charts) {
    std::string out;
    for (const auto& [name, title] : charts)
        if (const std::string svg = read_text(fmt::format("{}/charts/{}.svg", folder, name)); !svg.empty())
            out += fmt::format("<img class=\"chart\" alt=\"{}\" src=\"data:image/svg+xml;base64,{}\"/>\n",
                               escape(title), base64(svg));
    if (!out.empty()) return "<div class=\"charts\">\n" + out + "</div>\n";
    return "<p class=\"soft\">The charts were not drawn: that needs python3-matplotlib. "
           "<code>narpa-plot charts.json</code> in this folder draws them.</p>\n";
}

}  // namespace narpa::rehearsal
