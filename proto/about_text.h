// Words about the fields of the published API, for the pages and sources that are made from it.
#pragma once

#include <string>
#include <vector>

#include "google/protobuf/descriptor.h"
#include "planish/v1/about.pb.h"

namespace planish {

const v1::About& AboutOf(const google::protobuf::FieldDescriptor& field);

// The comment at the field, one line; empty without one.
std::string CommentOf(const google::protobuf::FieldDescriptor& field);
std::string CommentOf(const google::protobuf::EnumValueDescriptor& value);
// The lines of a comment, without the blank after "//".
std::vector<std::string> LinesOf(const std::string& comment);

// " In [16, 65536] texels; 0 means 1024." `unset` names what stands for the default; empty for fields without a
// description.
std::string RangeText(const v1::About& about, const std::string& unset);
std::string NumberText(double number);  // 0.01, 65536

// "auto" of SEAMS_AUTO.
std::string ShortName(const google::protobuf::EnumValueDescriptor& value);
// All values but UNSPECIFIED, the first one being number 1.
std::vector<std::string> Choices(const google::protobuf::EnumDescriptor& type);

}  // namespace planish
