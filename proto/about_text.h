// Texts about the fields of the published API, for the pages and sources that are made from the proto files.
#pragma once

#include <string>
#include <vector>

#include "google/protobuf/descriptor.h"
#include "planish/v1/about.pb.h"

namespace planish {

const v1::About& AboutOf(const google::protobuf::FieldDescriptor& field);

// The comment at the field or enum value, joined into one line; empty if there is no comment.
std::string CommentOf(const google::protobuf::FieldDescriptor& field);
std::string CommentOf(const google::protobuf::EnumValueDescriptor& value);
// The lines of a comment, without the blank after "//".
std::vector<std::string> LinesOf(const std::string& comment);

// " In [16, 65536] texels; 0 means 1024." `unset` is the text before the default, here "0 means". Returns an empty text
// if `about` has neither a range nor a default.
std::string RangeText(const v1::About& about, const std::string& unset);
std::string NumberText(double number);  // 0.01, 65536

// The name without the enum's prefix, in lower case: "auto" for SEAMS_AUTO.
std::string ShortName(const google::protobuf::EnumValueDescriptor& value);
// The short names of all values but UNSPECIFIED, from number 1 on.
std::vector<std::string> Choices(const google::protobuf::EnumDescriptor& type);

}  // namespace planish
