// Every option is reachable and checked, and every field of a report reaches people, as the proto says at each field
// (planish/v1/about.proto). The clients' own lists are made from the proto; this finds what was left out of it. That
// the server refuses every option out of its range is in tests/server/worker/options_test.cc.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "client/cli/batch_plan.h"
#include "client/cli/command_line.h"
#include "client/cli/results.h"
#include "client/src/convert.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "made/fields.h"
#include "planish/v1/about.pb.h"

namespace planish::cli {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Options that people cannot set: none.
const std::set<std::string> kNotForPeople = {};
// Flags with a language of their own: a value, and what must be given beside.
const std::map<std::string, std::string> kOwnValues = {{"seams", "keep"}, {"hard_edge_degrees", "auto,hard:50"}};
const std::map<std::string, std::string> kBeside = {{"atlas_layout", "--atlas-per=material"}};

std::vector<const FieldDescriptor*> Options() {
  const Descriptor& message = *v1::UnwrapOptions::descriptor();
  std::vector<const FieldDescriptor*> fields;
  for (int i = 0; i < message.field_count(); ++i) fields.push_back(message.field(i));
  return fields;
}

const v1::About& AboutOf(const FieldDescriptor& field) {
  return field.options().GetExtension(v1::about);
}

UnwrapArguments ParseUnwrap(const std::vector<std::string>& flags) {
  std::vector<const char*> words = {"planish", "unwrap", "in.obj", "-o", "out.obj"};
  for (const std::string& flag : flags) words.push_back(flag.c_str());
  setenv("PLANISH_CONFIG", "", 1);
  const ParsedArguments parsed = ParseArguments(static_cast<int>(words.size()), words.data());
  EXPECT_TRUE(parsed.arguments) << parsed.err;
  return std::get<UnwrapArguments>(parsed.arguments.value_or(UnwrapArguments()));
}

// A value of the flag other than the default.
std::string OtherValue(const FieldDescriptor& field) {
  const v1::About& about = AboutOf(field);
  if (kOwnValues.contains(field.name())) return kOwnValues.at(field.name());
  if (field.enum_type() == nullptr)
    return about.max() > 2 ? std::to_string(static_cast<int>(about.max() - 1)) : "0.001";
  std::string other;
  const UnwrapOptions options;
  EachField(options, [&](const Field& each, const auto&) {
    if (each.name != field.name()) return;
    for (const std::string& choice : each.choices) {
      if (choice != about.unset()) other = choice;
    }
  });
  return other;
}

std::string FlagOf(const FieldDescriptor& field) {
  return "--" + AboutOf(field).flag() + "=" + OtherValue(field);
}

TEST(DescribedFields, EveryOptionHasAFlagThatSetsIt) {
  for (const FieldDescriptor* field : Options()) {
    if (kNotForPeople.contains(field->name())) continue;
    ASSERT_FALSE(AboutOf(*field).flag().empty()) << field->name() << " has no flag";
    std::vector<std::string> beside;
    if (kBeside.contains(field->name())) beside.push_back(kBeside.at(field->name()));
    const UnwrapArguments without = ParseUnwrap(beside);
    beside.push_back(FlagOf(*field));
    const UnwrapArguments with = ParseUnwrap(beside);
    v1::UnwrapOptions changed = ToProto(with.map.options), plain = ToProto(without.map.options);
    EXPECT_NE(changed.SerializeAsString(), plain.SerializeAsString()) << beside.back();
    // And nothing else.
    for (v1::UnwrapOptions* options : {&changed, &plain}) options->GetReflection()->ClearField(options, field);
    EXPECT_EQ(changed.SerializeAsString(), plain.SerializeAsString()) << beside.back();
    // A batch does files again, unless their UV stay the same bytes.
    EXPECT_EQ(SettingsDigest(with) == SettingsDigest(without), AboutOf(*field).keeps_result()) << beside.back();
  }
}

TEST(DescribedFields, EnumsOfTheLibraryAreThoseOfTheProto) {
  const auto compare = [](const Field& field, const auto& member) {
    using Value = std::remove_cvref_t<decltype(member)>;
    if constexpr (std::is_enum_v<Value>) {
      const int first = std::is_same_v<Value, Stage> ? 1 : 0;
      for (int i = 0; i < static_cast<int>(field.choices.size()); ++i) {
        EXPECT_EQ(ToString(static_cast<Value>(first + i)), field.choices[i]) << field.name;
      }
    }
  };
  UnwrapOptions options;
  EachField(options, compare);
  Progress progress;
  EachField(progress, compare);
  ChartReport chart;
  EachField(chart, compare);
  BoundaryReport boundary;
  EachField(boundary, compare);
  Atlas atlas;
  EachField(atlas, compare);
}

// Fills every field with something that occurs nowhere else, and says where.
class Filler {
 public:
  void Fill(Message* message) {
    for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
      FillField(*message->GetDescriptor()->field(i), message);
    }
  }
  const std::map<std::string, std::string>& marks() const { return marks_; }  // by the names of fields

 private:
  void FillField(const FieldDescriptor& field, Message* message) {
    const google::protobuf::Reflection& reflection = *message->GetReflection();
    std::string& mark = marks_[field.full_name()];
    const int number = ++last_;
    mark = std::to_string(number);
    if (field.is_map()) {
      marks_.erase(field.full_name());  // Warning.metadata, which has tests of its own
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      marks_.erase(field.full_name());
      Message* const own =
          field.is_repeated() ? reflection.AddMessage(message, &field) : reflection.MutableMessage(message, &field);
      const std::string duration = "google.protobuf.Duration";
      if (field.message_type()->full_name() != duration) return Fill(own);
      own->GetReflection()->SetInt64(own, own->GetDescriptor()->FindFieldByName("seconds"), number);
      marks_[field.full_name()] = std::to_string(number);
    } else if (field.enum_type() != nullptr) {
      const auto& value = *field.enum_type()->value(field.enum_type()->value_count() - 1);
      reflection.SetEnum(message, &field, &value);
      const auto prefix = field.enum_type()->value(0)->name().size() - std::string("UNSPECIFIED").size();
      mark.clear();
      for (const char c : value.name().substr(prefix)) mark += static_cast<char>(std::tolower(c));
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
      reflection.SetString(message, &field, mark = "text " + mark);
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_BOOL) {
      reflection.SetBool(message, &field, true);
      mark = "true";
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_FLOAT) {
      reflection.AddFloat(message, &field, static_cast<float>(number));
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
      reflection.SetDouble(message, &field, number);
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_INT64) {
      reflection.SetInt64(message, &field, number);
    } else {
      reflection.SetInt32(message, &field, number);
    }
  }

  int last_ = 100;
  std::map<std::string, std::string> marks_;
};

// Every value in `json`, as text.
void Collect(const Json& json, std::set<std::string>* values) {
  if (json.is_structured()) {
    for (const Json& each : json) Collect(each, values);
  } else if (json.is_number()) {
    values->insert(std::to_string(json.get<std::int64_t>()));
  } else {
    values->insert(json.is_string() ? json.get<std::string>() : json.dump());
  }
}

TEST(DescribedFields, EveryFieldOfAReportReachesJson) {
  v1::Job job;
  Filler filler;
  filler.Fill(job.mutable_report());
  filler.Fill(job.mutable_progress());
  std::set<std::string> values;
  Collect(ToJson(FromProto(job)), &values);
  EXPECT_GT(filler.marks().size(), 80u);
  for (const auto& [name, mark] : filler.marks()) {
    const bool is_udim = name == "planish.v1.AtlasPart.first_tile";
    EXPECT_TRUE(values.contains(is_udim ? std::to_string(1001 + std::stoi(mark)) : mark)) << name << " = " << mark;
  }
}

}  // namespace
}  // namespace planish::cli
