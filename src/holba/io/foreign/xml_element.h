// SPDX-License-Identifier: BSD-3-Clause
// Elements, attributes and text of an XML file, as far as files of other programs need it: no
// declarations of types or entities of its own (a file that has some is refused), namespaces are
// part of the names. Each element knows its line for messages.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace holba {

struct XmlElement {
  std::string name;
  std::map<std::string, std::string, std::less<>> attributes;
  std::string text;  // directly in the element, without blanks at both ends
  std::vector<XmlElement> children;
  uint64_t line = 0;

  // The first child of a name. Null: none.
  const XmlElement* Find(std::string_view child) const;
  // Empty: there is none.
  std::optional<std::string> Attribute(std::string_view attribute) const;
};

// The root. `path` is for messages. Throws InputError with the line.
XmlElement ParseXml(std::string_view bytes, const std::filesystem::path& path);

}  // namespace holba
