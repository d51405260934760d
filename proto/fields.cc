// Writes the parts of the clients that follow the fields of UnwrapOptions, Progress and Report one by one.
//
//   planish_fields cpp|python|typescript DESCRIPTORS
//
// cpp         EachField() for the structs of planish/types.h: a field that a struct does not have fails to compile
// python      the dataclasses
// typescript  the interface UnwrapOptions
//
// DESCRIPTORS is a FileDescriptorSet with source info, as for planish_api_page.
#include <algorithm>
#include <cctype>
#include <fstream>
#include <iostream>
#include <map>
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
using planish::AboutOf;
using planish::Choices;
using planish::CommentOf;
using planish::v1::About;

// Messages, each before those that have it as a field.
const char* const kMessages[] = {"UnwrapOptions", "Residual",    "Progress",  "BoundaryReport",
                                 "ChartReport",   "ChartTotals", "AtlasPart", "Atlas",
                                 "Quality",       "StageTimes",  "Report"};
constexpr char kOptions[] = "UnwrapOptions";

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += (c == '"' || c == '\\') ? std::string("\\") + c : std::string(1, c);
  return quoted + "\"";
}

bool IsTime(const FieldDescriptor& field) {
  return field.message_type() != nullptr && field.message_type()->full_name() == "google.protobuf.Duration";
}

std::vector<const FieldDescriptor*> FieldsOf(const Descriptor& message) {
  std::vector<const FieldDescriptor*> fields;
  for (int i = 0; i < message.field_count(); ++i) {
    if (!AboutOf(*message.field(i)).by_hand()) fields.push_back(message.field(i));
  }
  return fields;
}

// ---- C++

void WriteCppField(const FieldDescriptor& field, std::ostream& out) {
  const About& about = AboutOf(field);
  const std::string name(field.name());
  out << "  visit(Field{.name = " << Quoted(name);
  const auto text = [&](const char* key, const std::string& value) {
    if (!value.empty()) out << ", ." << key << " = " << Quoted(value);
  };
  text("flag", about.flag());
  text("help", about.help());
  text("value", about.value());
  text("group", about.group());
  text("unset", about.flag_unset().empty() ? about.unset() : about.flag_unset());
  text("zero", about.zero());
  if (about.has_max()) {
    out << ", .min = " << planish::NumberText(about.min()) << ", .max = " << planish::NumberText(about.max());
    if (about.above_min()) out << ", .above_min = true";
  }
  if (about.keeps_result()) out << ", .keeps_result = true";
  if (field.enum_type() != nullptr) {
    out << ", .choices = {";
    for (const std::string& choice : Choices(*field.enum_type())) out << Quoted(choice) << ", ";
    out << "}";
  }
  out << "}, value." << (about.member().empty() ? name : about.member()) << ");\n";
}

void WriteCpp(const std::vector<const Descriptor*>& messages, std::ostream& out) {
  out << "// Made from proto/planish/v1 by the build (proto/fields.cc).\n#pragma once\n\n"
         "#include <concepts>\n#include <type_traits>\n\n#include \"client/src/field.h\"\n"
         "#include \"planish/types.h\"\n\nnamespace planish {\n";
  for (const Descriptor* message : messages) {
    out << "\ntemplate <typename Value, typename Visit>\n  requires std::same_as<std::remove_const_t<Value>, "
        << message->name() << ">\nvoid EachField(Value& value, Visit&& visit) {\n";
    for (const FieldDescriptor* field : FieldsOf(*message)) WriteCppField(*field, out);
    out << "}\n";
  }
  out << "\n}  // namespace planish\n";
}

// ---- Python and TypeScript

const Descriptor& OptionsOf(const google::protobuf::FileDescriptor& file) {
  return *file.pool()->FindMessageTypeByName(std::string("planish.v1.") + kOptions);
}

// Replaces names of enum values in `comment` by what callers of these clients write. SEAMS_AUTO becomes "auto" between
// `quotes` if `own` is the enum Seams, and seams="auto" otherwise.
std::string WithShortNames(const std::string& comment, const Descriptor& options, const EnumDescriptor* own,
                           const std::string& quotes) {
  std::map<std::string, std::string> names;
  for (int i = 0; i < options.field_count(); ++i) {
    const EnumDescriptor* const type = options.field(i)->enum_type();
    if (type == nullptr) continue;
    const std::string option = type == own ? "" : std::string(options.field(i)->name()) + "=";
    for (int k = 1; k < type->value_count(); ++k) {
      names[type->value(k)->name()] = quotes + option + "\"" + planish::ShortName(*type->value(k)) + "\"" + quotes;
    }
  }
  std::string text, word;
  for (const char c : comment + "\n") {
    if (std::isalnum(static_cast<unsigned char>(c)) || c == '_') {
      word += c;
      continue;
    }
    const auto found = names.find(word);
    text += (found == names.end() ? word : found->second) + c;
    word.clear();
  }
  text.pop_back();
  return text;
}

// The documentation of a field: its comment, the values of its enum, and its range.
std::string Documentation(const FieldDescriptor& field, const std::string& unset, const std::string& quotes) {
  std::string text = CommentOf(field);
  const EnumDescriptor* const type = field.enum_type();
  if (type != nullptr) {
    for (int i = 1; i < type->value_count(); ++i) {
      std::string meaning = CommentOf(*type->value(i));
      if (meaning.ends_with('.')) meaning.pop_back();
      text += (text.empty() ? "" : " ") + std::string(type->value(i)->name()) + (meaning.empty() ? "" : ": ") +
              meaning + ".";
    }
  }
  if (!unset.empty() && type == nullptr) text += planish::RangeText(AboutOf(field), unset);
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  return WithShortNames(text.substr(first), OptionsOf(*field.file()), type, quotes);
}

// `text` wrapped into lines of at most 120 columns, each with `indent` before it.
std::string Wrapped(const std::string& text, const std::string& indent) {
  std::istringstream words(text);
  std::string all, line = indent;
  for (std::string word; words >> word;) {
    if (line.size() + 1 + word.size() > 120) {
      all += line + "\n";
      line = indent;
    }
    line += " " + word;
  }
  return text.empty() ? "" : all + line + "\n";
}

bool IsReal(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE || field.cpp_type() == FieldDescriptor::CPPTYPE_FLOAT;
}

std::string PythonClass(const Descriptor& message) {
  if (message.name() == "Atlas") return "AtlasReport";
  return message.name() == "Report" ? "ReportFields" : message.name();
}

// The type and default of a field of a report.
std::pair<std::string, std::string> PythonType(const FieldDescriptor& field) {
  std::string type, unset;
  if (IsTime(field)) {
    type = "float", unset = "0.0";
  } else if (field.message_type() != nullptr) {
    type = PythonClass(*field.message_type()), unset = "field(default_factory=" + type + ")";
  } else if (field.enum_type() != nullptr) {
    type = "str", unset = "\"unspecified\"";
  } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
    type = "str", unset = "\"\"";
  } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_BOOL) {
    type = "bool", unset = "False";
  } else {
    type = IsReal(field) ? "float" : "int", unset = IsReal(field) ? "0.0" : "0";
  }
  if (field.is_repeated()) return {"List[" + type + "]", "field(default_factory=list)"};
  if (field.has_optional_keyword()) return {"Optional[" + type + "]", "None"};
  return {type, unset};
}

bool IsSwitch(const FieldDescriptor& field) {
  return field.enum_type() != nullptr && Choices(*field.enum_type()) == std::vector<std::string>{"on", "off"};
}

void WritePythonOption(const FieldDescriptor& field, std::ostream& out) {
  const About& about = AboutOf(field);
  out << Wrapped(Documentation(field, "None:", "``"), "    #:") << "    " << field.name() << ": ";
  if (IsSwitch(field)) {
    out << "bool = " << (about.unset() == "on" ? "True" : "False");
  } else if (field.enum_type() != nullptr) {
    out << "str = " << Quoted(about.unset());
  } else {
    out << "Optional[" << (IsReal(field) ? "float" : "int") << "] = None";
  }
  out << "\n";
}

void WritePython(const std::vector<const Descriptor*>& messages, std::ostream& out) {
  out << "\"\"\"Options and reports, field for field those of planish.v1. Made by the build from the comments of the "
         "proto.\"\"\"\n\nfrom __future__ import annotations\n\nfrom dataclasses import dataclass, field\n"
         "from typing import List, Optional\n";
  for (const Descriptor* message : messages) {
    const bool is_options = message->name() == kOptions;
    const std::vector<const FieldDescriptor*> fields = FieldsOf(*message);
    const bool all_times = std::all_of(fields.begin(), fields.end(), [](const auto* field) { return IsTime(*field); });
    google::protobuf::SourceLocation location;
    message->GetSourceLocation(&location);
    const std::vector<std::string> lines = planish::LinesOf(location.leading_comments);
    out << "\n\n@dataclass(frozen=True)\nclass " << PythonClass(*message) << ":\n    \"\"\""
        << (is_options ? "What the caller asks for. Every field may be left out; None stands for the server's default."
            : lines.empty() ? "As in the message planish.v1." + message->name() + "."
                            : WithShortNames(lines.front(), OptionsOf(*message->file()), nullptr, "``"))
        << "\"\"\"\n\n";
    for (const FieldDescriptor* field : fields) {
      if (is_options) {
        WritePythonOption(*field, out);
        continue;
      }
      const auto [type, unset] = PythonType(*field);
      out << Wrapped(Documentation(*field, "", "``"), "    #:") << "    " << field->name()
          << (IsTime(*field) && !all_times ? "_seconds" : "") << ": " << type << " = " << unset << "\n";
    }
  }
}

std::string CamelCase(const std::string& name) {
  std::string camel;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (name[i] == '_') continue;
    const bool is_first = i > 0 && name[i - 1] == '_';
    camel += is_first ? static_cast<char>(std::toupper(static_cast<unsigned char>(name[i]))) : name[i];
  }
  return camel;
}

void WriteTypeScript(const Descriptor& options, std::ostream& out) {
  out << "// Made by the build from the comments of the proto.\n\n"
         "/** What is asked for. What is left out has the server's default. */\nexport interface UnwrapOptions {\n";
  for (const FieldDescriptor* field : FieldsOf(options)) {
    const std::string text = Documentation(*field, "left out:", "`");
    if (!text.empty()) out << "  /** " << text << " */\n";
    std::string type = "number";
    if (IsSwitch(*field)) {
      type = "boolean";
    } else if (field->enum_type() != nullptr) {
      type.clear();
      for (const std::string& choice : Choices(*field->enum_type())) {
        type += (type.empty() ? "'" : " | '") + choice + "'";
      }
    }
    out << "  " << CamelCase(field->name()) << "?: " << type << ";\n";
  }
  out << "}\n";
}

int Fail(const std::string& message) {
  std::cerr << "planish_fields: " << message << "\n";
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return Fail("usage: planish_fields cpp|python|typescript DESCRIPTORS");
  google::protobuf::FileDescriptorSet set;
  std::ifstream descriptors(argv[2], std::ios::binary);
  if (!set.ParseFromIstream(&descriptors)) return Fail(std::string("cannot read ") + argv[2]);
  DescriptorPool pool;
  for (const google::protobuf::FileDescriptorProto& file : set.file()) {
    if (pool.BuildFile(file) == nullptr) return Fail("cannot understand " + file.name());
  }
  std::vector<const Descriptor*> messages;
  for (const char* name : kMessages) {
    messages.push_back(pool.FindMessageTypeByName(std::string("planish.v1.") + name));
    if (messages.back() == nullptr) return Fail(std::string("there is no message ") + name);
  }
  const std::string language = argv[1];
  if (language == "cpp") {
    WriteCpp(messages, std::cout);
  } else if (language == "python") {
    WritePython(messages, std::cout);
  } else if (language == "typescript") {
    WriteTypeScript(*messages.front(), std::cout);
  } else {
    return Fail("unknown language " + language);
  }
  return std::cout.flush() ? 0 : Fail("cannot write");
}
