/// rehearsal/report/template.h - fills the templates of pages and test reports: the .html and .xml files in this
/// folder, which the build puts into the program.
///
/// The language is a part of Mustache (mustache(5)). {{name}}: a value, escaped for HTML and XML. {{name:.2f}}: a
/// number in that format of {fmt}. {{#name}}...{{/name}}: the text between once for each element of a list, once
/// for any other value; not at all if the value is missing, null, false or empty. {{^name}}...{{/name}}: only then.
/// {{>file}}: another template. A name is searched from the innermost section outwards; "a.b" is b in a; "." is the
/// value of the innermost section.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace narpa::rehearsal {

/// The content of a template file, e.g. "run.html". Defined in a source that the build generates.
[[nodiscard]] std::string_view template_text(std::string_view file);

/// A missing value becomes an empty text.
[[nodiscard]] std::string filled(std::string_view text, const nlohmann::json& data);

/// For attributes and text of XML and HTML; what XML forbids becomes U+FFFD.
[[nodiscard]] std::string escape(std::string_view text);

}  // namespace narpa::rehearsal
