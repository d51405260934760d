#include "proto/about_text.h"

#include <cctype>
#include <sstream>

namespace planish {
namespace {

using google::protobuf::EnumDescriptor;
using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;

template <typename Element>
std::string Comment(const Element& element) {
  google::protobuf::SourceLocation location;
  if (!element.GetSourceLocation(&location)) return "";
  // Prefers a comment above the element to one behind it ("NAME = 0;  // meaning").
  std::string text;
  for (const std::string& line :
       LinesOf(location.leading_comments.empty() ? location.trailing_comments : location.leading_comments)) {
    const std::size_t first = line.find_first_not_of(' ');
    if (!text.empty()) text += ' ';
    if (first != std::string::npos) text += line.substr(first);
  }
  return text;
}

}  // namespace

const v1::About& AboutOf(const FieldDescriptor& field) {
  return field.options().GetExtension(v1::about);
}

std::string CommentOf(const FieldDescriptor& field) {
  return Comment(field);
}

std::string CommentOf(const EnumValueDescriptor& value) {
  return Comment(value);
}

std::vector<std::string> LinesOf(const std::string& comment) {
  std::vector<std::string> lines;
  std::istringstream text(comment);
  for (std::string line; std::getline(text, line);) lines.push_back(line.starts_with(' ') ? line.substr(1) : line);
  return lines;
}

std::string RangeText(const v1::About& about, const std::string& unset) {
  std::string text;
  if (about.has_max()) {
    text = std::string("In ") + (about.above_min() ? "(" : "[") + NumberText(about.min()) + ", " +
           NumberText(about.max()) + "]" + (about.unit().empty() ? "" : " " + about.unit());
  }
  if (!about.unset().empty()) text += (text.empty() ? "" : "; ") + unset + " " + about.unset();
  if (text.empty()) return "";
  text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return " " + text + ".";
}

std::string NumberText(double number) {
  std::ostringstream out;
  out << number;
  std::string text = out.str();  // 1e9, not 1e+09
  for (const char* surplus : {"+", "e0", "e-0"}) {
    const std::size_t at = text.find(surplus);
    if (at != std::string::npos) text.erase(at + (surplus[0] == '+' ? 0 : std::string(surplus).size() - 1), 1);
  }
  return text;
}

std::string ShortName(const EnumValueDescriptor& value) {
  static const std::string unspecified = "UNSPECIFIED";
  std::string name = value.name().substr(value.type()->value(0)->name().size() - unspecified.size());
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

std::vector<std::string> Choices(const EnumDescriptor& type) {
  std::vector<std::string> names;
  for (int i = 1; i < type.value_count(); ++i) names.push_back(ShortName(*type.value(i)));
  return names;
}

}  // namespace planish
