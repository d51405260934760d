// Writes the page of the published API, in Markdown, from the comments of the proto files.
//
//   planish_api_page DESCRIPTORS FILE.proto... > proto/API.md
//
// DESCRIPTORS is a FileDescriptorSet with source info (protoc --include_imports --include_source_info). Comments become
// paragraphs. An indented line with a word, at least two blanks and a text becomes an item of a list; all other
// indented lines are copied unchanged. The range and default of a field (about.proto) follow its comment.
#include <cctype>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "google/protobuf/descriptor.h"
#include "google/protobuf/descriptor.pb.h"
#include "proto/about_text.h"

namespace {

using google::protobuf::Descriptor;
using google::protobuf::DescriptorPool;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::FileDescriptor;
using google::protobuf::MethodDescriptor;
using google::protobuf::ServiceDescriptor;
using google::protobuf::SourceLocation;

template <typename Element>
std::vector<std::string> CommentLines(const Element& element) {
  SourceLocation location;
  if (!element.GetSourceLocation(&location)) return {};
  // Prefers a comment above the element to one behind it ("NAME = 0;  // meaning").
  return planish::LinesOf(location.leading_comments.empty() ? location.trailing_comments : location.leading_comments);
}

std::vector<std::string> CommentLines(const FileDescriptor& file) {
  SourceLocation location;
  const std::vector<int> syntax = {google::protobuf::FileDescriptorProto::kSyntaxFieldNumber};
  return file.GetSourceLocation(syntax, &location) ? planish::LinesOf(location.leading_comments) : std::vector<std::string>();
}

// The column at which explanations of codes begin. The code FAILED_PRECONDITION has only one blank before this column.
constexpr std::size_t kCodeText = 22;

// For an indented line with a word, at least two blanks and a text: the column of the text. 0 if the line has another
// form.
std::size_t ItemText(const std::string& line) {
  if (!line.starts_with("  ")) return 0;
  std::size_t end = 2;
  while (end < line.size() && (std::isalnum(static_cast<unsigned char>(line[end])) || line[end] == '_' ||
                               line[end] == '-' || line[end] == '/' || line[end] == '.' || line[end] == ':')) {
    ++end;
  }
  if (end == 2) return 0;
  const std::size_t text = line.find_first_not_of(' ', end);
  return text == std::string::npos || (text < end + 2 && text != kCodeText) ? 0 : text;
}

std::string Trimmed(const std::string& line) {
  const std::size_t first = line.find_first_not_of(' ');
  return first == std::string::npos ? "" : line.substr(first);
}

void PrintComment(const std::vector<std::string>& lines, std::ostream& out) {
  enum class In { kNothing, kParagraph, kItem, kVerbatim } in = In::kNothing;
  const auto begin = [&](In what) {
    if (in != In::kNothing && in != what) out << "\n";
    in = what;
  };
  for (const std::string& line : lines) {
    const std::size_t text = ItemText(line);
    const std::string trimmed = Trimmed(line);
    if (trimmed.empty()) {
      begin(In::kNothing);
      out << "\n";
      in = In::kNothing;
    } else if (text > 0) {
      begin(In::kItem);
      const std::string word = line.substr(2, line.find(' ', 2) - 2);
      out << "- `" << word << "`: " << line.substr(text) << "\n";
    } else if (in == In::kItem && line.starts_with("    ")) {
      out << "  " << trimmed << "\n";
    } else if (line.starts_with("  ")) {
      begin(In::kVerbatim);
      out << "    " << line.substr(2) << "\n";
    } else {
      begin(In::kParagraph);
      out << line << "\n";
    }
  }
  if (!lines.empty()) out << "\n";
}

// The text for a cell of a table.
std::string Cell(const std::string& text) {
  std::string cell;
  for (const char c : Trimmed(text)) cell += c == '|' ? std::string("\\|") : c == '<' ? "&lt;" : std::string(1, c);
  return cell;
}

std::string Anchor(const std::string& full_name) {
  std::string anchor;
  for (const char c : full_name)
    anchor += c == '.' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return anchor;
}

// The name of the type, with a link if it is on this page.
template <typename Type>
std::string TypeName(const Type& type, const std::string& package) {
  if (type.file()->package() != package) return "`" + type.full_name() + "`";
  return "[`" + type.name() + "`](#" + Anchor(type.full_name()) + ")";
}

std::string TypeOf(const FieldDescriptor& field) {
  const std::string& package = field.file()->package();
  if (field.is_map()) {
    return "map of `" + std::string(field.message_type()->map_key()->type_name()) + "` to `" +
           field.message_type()->map_value()->type_name() + "`";
  }
  std::string type = "`" + std::string(field.type_name()) + "`";
  if (field.message_type() != nullptr) type = TypeName(*field.message_type(), package);
  if (field.enum_type() != nullptr) type = TypeName(*field.enum_type(), package);
  if (field.is_repeated()) return "repeated " + type;
  if (field.real_containing_oneof() != nullptr)
    return type + ", one of `" + field.real_containing_oneof()->name() + "`";
  return field.has_optional_keyword() ? "optional " + type : type;
}

void PrintHeading(const std::string& level, const std::string& name, const std::string& full_name, std::ostream& out) {
  out << "<a id=\"" << Anchor(full_name) << "\"></a>\n" << level << " " << name << "\n\n";
}

void PrintMethod(const MethodDescriptor& method, std::ostream& out) {
  const std::string& package = method.file()->package();
  PrintHeading("###", method.name(), method.full_name(), out);
  out << (method.client_streaming() ? "stream of " : "") << TypeName(*method.input_type(), package) << " → "
      << (method.server_streaming() ? "stream of " : "") << TypeName(*method.output_type(), package) << "\n\n";
  PrintComment(CommentLines(method), out);
}

// " In [16, 65536] texels; 0 means 1024."; empty if the field has neither a range nor a default.
std::string Range(const FieldDescriptor& field) {
  return planish::RangeText(planish::AboutOf(field),
                            field.has_presence() || field.enum_type() != nullptr ? "unset means" : "0 means");
}

void PrintFields(const Descriptor& message, std::ostream& out) {
  if (message.field_count() == 0) {
    out << "No fields.\n\n";
    return;
  }
  out << "| field | | type | |\n|---|---|---|---|\n";
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    out << "| `" << field.name() << "` | " << field.number() << " | " << TypeOf(field) << " | "
        << Cell(planish::CommentOf(field) + Range(field)) << " |\n";
  }
  out << "\n";
}

// `name`: with the names of enclosing messages before it.
void PrintMessage(const Descriptor& message, const std::string& name, std::ostream& out) {
  PrintHeading("###", name, message.full_name(), out);
  PrintComment(CommentLines(message), out);
  PrintFields(message, out);
  for (int i = 0; i < message.nested_type_count(); ++i) {
    const Descriptor& nested = *message.nested_type(i);
    if (!nested.options().map_entry()) PrintMessage(nested, name + "." + nested.name(), out);
  }
}

void PrintEnum(const EnumDescriptor& type, std::ostream& out) {
  PrintHeading("###", type.name(), type.full_name(), out);
  PrintComment(CommentLines(type), out);
  out << "| value | | |\n|---|---|---|\n";
  for (int i = 0; i < type.value_count(); ++i) {
    out << "| `" << type.value(i)->name() << "` | " << type.value(i)->number() << " | "
        << Cell(planish::CommentOf(*type.value(i))) << " |\n";
  }
  out << "\n";
}

void PrintFile(const FileDescriptor& file, std::ostream& out) {
  out << "# " << file.name() << "\n\nPackage `" << file.package() << "`.\n\n";
  PrintComment(CommentLines(file), out);
  for (int i = 0; i < file.service_count(); ++i) {
    const ServiceDescriptor& service = *file.service(i);
    PrintHeading("##", "Service " + service.name(), service.full_name(), out);
    PrintComment(CommentLines(service), out);
    for (int m = 0; m < service.method_count(); ++m) PrintMethod(*service.method(m), out);
  }
  if (file.message_type_count() > 0) out << "## Messages of " << file.name() << "\n\n";
  for (int i = 0; i < file.message_type_count(); ++i) {
    PrintMessage(*file.message_type(i), file.message_type(i)->name(), out);
  }
  if (file.enum_type_count() > 0) out << "## Enums of " << file.name() << "\n\n";
  for (int i = 0; i < file.enum_type_count(); ++i) PrintEnum(*file.enum_type(i), out);
}

int Fail(const std::string& message) {
  std::cerr << "planish_api_page: " << message << "\n";
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return Fail("usage: planish_api_page DESCRIPTORS FILE.proto...");
  google::protobuf::FileDescriptorSet set;
  std::ifstream descriptors(argv[1], std::ios::binary);
  if (!set.ParseFromIstream(&descriptors)) return Fail(std::string("cannot read ") + argv[1]);
  DescriptorPool pool;
  for (const google::protobuf::FileDescriptorProto& file : set.file()) {
    if (pool.BuildFile(file) == nullptr) return Fail("cannot understand " + file.name());
  }
  std::ostringstream page;
  page << "<!-- Made from the proto files by `ninja api_page`. Do not edit: a test compares. -->\n\n";
  for (int i = 2; i < argc; ++i) {
    const FileDescriptor* file = pool.FindFileByName(argv[i]);
    if (file == nullptr) return Fail(std::string(argv[i]) + " is not among the descriptors");
    PrintFile(*file, page);
  }
  std::string text = page.str();
  // Ends with a single line end, and has at most one empty line in a row.
  for (std::size_t at; (at = text.find("\n\n\n")) != std::string::npos;) text.erase(at, 1);
  while (text.ends_with("\n\n")) text.pop_back();
  std::cout << text;
  return std::cout.flush() ? 0 : Fail("cannot write");
}
