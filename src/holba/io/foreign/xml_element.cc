// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/xml_element.h"

#include <fmt/format.h>

#include <algorithm>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace {

// Deeper than any file of a program, shallow enough for the stack.
constexpr int kMaxDepth = 100;

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
bool EndsName(char c) { return IsBlank(c) || c == '=' || c == '>' || c == '/' || c == '<'; }

class XmlParser {
 public:
  XmlParser(std::string_view bytes, const std::filesystem::path& path)
      : rest_(bytes), path_(path) {}

  XmlElement ParseDocument() {
    if (rest_.starts_with("\xEF\xBB\xBF")) Skip(3);
    SkipBetweenElements();
    if (!rest_.starts_with('<')) Fail("expected an element of XML, found none");
    XmlElement root = ParseElement(0);
    SkipBetweenElements();
    if (!rest_.empty()) Fail("expected the end of the file after its root, found more");
    return root;
  }

 private:
  [[noreturn]] void Fail(const std::string& message) const {
    throw InputError::AtLine(path_, line_, message);
  }
  [[noreturn]] void FailEnd(std::string_view what) const {
    Fail(fmt::format("expected {}, found that the file is truncated here", what));
  }

  void Skip(size_t count) {
    line_ += static_cast<uint64_t>(std::count(rest_.begin(), rest_.begin() + count, '\n'));
    rest_.remove_prefix(count);
  }
  void SkipBlanks() {
    size_t count = 0;
    while (count < rest_.size() && IsBlank(rest_[count])) ++count;
    Skip(count);
  }
  // Up to and with `end`; what is before it.
  std::string_view Until(std::string_view end, std::string_view what) {
    const size_t at = rest_.find(end);
    if (at == std::string_view::npos) FailEnd(what);
    const std::string_view before = rest_.substr(0, at);
    Skip(at + end.size());
    return before;
  }
  // A comment or an instruction that begins here. False: none does.
  bool SkipAside() {
    if (rest_.starts_with("<!--")) {
      Skip(4);
      Until("-->", "the end of a comment");
    } else if (rest_.starts_with("<?")) {
      Until("?>", "the end of an instruction");
    } else {
      return false;
    }
    return true;
  }
  void SkipBetweenElements() {
    do {
      SkipBlanks();
    } while (SkipAside());
    if (rest_.starts_with("<!"))
      Fail("expected an element, found a declaration, which is not read; remove it");
  }

  std::string Name(std::string_view what) {
    size_t size = 0;
    while (size < rest_.size() && !EndsName(rest_[size])) ++size;
    if (size == 0) Fail(fmt::format("expected the name of {}, found none", what));
    const std::string name(rest_.substr(0, size));
    Skip(size);
    return name;
  }

  // Text with its entities replaced.
  std::string Decoded(std::string_view text) const {
    std::string decoded;
    for (size_t at = 0; at < text.size();) {
      if (text[at] != '&') {
        decoded += text[at++];
        continue;
      }
      const size_t end = text.find(';', at);
      const std::string_view entity =
          end == std::string_view::npos ? text.substr(at) : text.substr(at, end - at + 1);
      if (entity == "&amp;") {
        decoded += '&';
      } else if (entity == "&lt;") {
        decoded += '<';
      } else if (entity == "&gt;") {
        decoded += '>';
      } else if (entity == "&quot;") {
        decoded += '"';
      } else if (entity == "&apos;") {
        decoded += '\'';
      } else {
        // Numbers of characters are in labels at most, which stay as they are.
        decoded += entity;
      }
      at += entity.size();
    }
    return decoded;
  }

  void ParseAttributes(XmlElement* element) {
    while (true) {
      SkipBlanks();
      if (rest_.empty()) FailEnd("the end of a tag");
      if (rest_[0] == '>' || rest_[0] == '/') return;
      std::string name = Name("an attribute");
      SkipBlanks();
      if (!rest_.starts_with('=')) Fail(fmt::format("expected '=' after '{}', found none", name));
      Skip(1);
      SkipBlanks();
      if (!rest_.starts_with('"') && !rest_.starts_with('\''))
        Fail(fmt::format("expected the value of '{}' in quotes, found none", name));
      const std::string quote(1, rest_[0]);
      Skip(1);
      element->attributes[std::move(name)] = Decoded(Until(quote, "the end of a value"));
    }
  }

  XmlElement ParseElement(int depth) {
    if (depth > kMaxDepth)
      Fail(fmt::format("expected at most {} elements in each other, found more", kMaxDepth));
    XmlElement element;
    element.line = line_;
    Skip(1);
    element.name = Name("an element");
    ParseAttributes(&element);
    if (rest_.starts_with('/')) {
      Skip(1);
      if (!rest_.starts_with('>')) Fail("expected '>' after '/', found none");
      Skip(1);
      return element;
    }
    Skip(1);
    while (true) {
      const size_t size = std::min(rest_.find('<'), rest_.size());
      element.text += Decoded(rest_.substr(0, size));
      Skip(size);
      if (rest_.empty()) FailEnd(fmt::format("</{}>", element.name));
      if (SkipAside()) continue;
      if (rest_.starts_with("<![CDATA[")) {
        Skip(9);
        element.text += Until("]]>", "the end of a CDATA section");
      } else if (rest_.starts_with("</")) {
        Skip(2);
        const std::string name = Name("an element");
        SkipBlanks();
        if (name != element.name || !rest_.starts_with('>'))
          Fail(fmt::format("expected </{}>, found </{}", element.name, name));
        Skip(1);
        break;
      } else {
        element.children.push_back(ParseElement(depth + 1));
      }
    }
    const size_t begin = element.text.find_first_not_of(" \t\r\n");
    element.text =
        begin == std::string::npos
            ? ""
            : element.text.substr(begin, element.text.find_last_not_of(" \t\r\n") - begin + 1);
    return element;
  }

  std::string_view rest_;
  const std::filesystem::path path_;
  uint64_t line_ = 1;
};

}  // namespace

const XmlElement* XmlElement::Find(std::string_view child) const {
  const auto found = std::find_if(children.begin(), children.end(),
                                  [&](const XmlElement& element) { return element.name == child; });
  return found == children.end() ? nullptr : &*found;
}

std::optional<std::string> XmlElement::Attribute(std::string_view attribute) const {
  const auto found = attributes.find(attribute);
  if (found == attributes.end()) return std::nullopt;
  return found->second;
}

XmlElement ParseXml(std::string_view bytes, const std::filesystem::path& path) {
  RefuseUtf16(bytes, path);
  return XmlParser(bytes, path).ParseDocument();
}

}  // namespace holba
