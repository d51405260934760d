#include "client/files/text_cursor.h"

#include "client/files/file_io.h"
#include "core/base/number.h"

namespace planish {
void TextCursor::SkipLine() {
  position_ = text_.find_first_of("\r\n", position_);
  if (position_ == std::string_view::npos) position_ = text_.size();
}

std::vector<std::string_view> TextCursor::RestOfLine() {
  std::string_view line = text_.substr(position_);
  line = line.substr(0, line.find_first_of(hash_comments_ ? "\r\n#" : "\r\n"));
  std::vector<std::string_view> tokens;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= line.size(); ++i) {
    if (i < line.size() && !IsBlank(line[i])) continue;
    if (i > begin) tokens.push_back(line.substr(begin, i - begin));
    begin = i + 1;
  }
  position_ += line.size();
  return tokens;
}

void TextCursor::SkipBlanks() {
  while (position_ < text_.size()) {
    const char c = text_[position_];
    if (hash_comments_ && c == '#') {
      SkipLine();
      continue;
    }
    if (!IsBlank(c)) return;
    ++position_;
    const bool is_first_of_two = c == '\r' && position_ < text_.size() && text_[position_] == '\n';
    if ((c == '\n' || c == '\r') && !is_first_of_two) ++line_;
  }
}

std::string_view TextCursor::Peek() {
  SkipBlanks();
  token_line_ = line_;
  std::size_t end = position_;
  while (end < text_.size() && !IsBlank(text_[end]) && !(hash_comments_ && text_[end] == '#')) ++end;
  return text_.substr(position_, end - position_);
}

std::string_view TextCursor::Token() {
  const std::string_view token = Peek();
  position_ += token.size();
  return token;
}

absl::Status TextCursor::ReadDouble(const ElementName& element, double* value) {
  const std::string_view token = Token();
  if (ParseDouble(token, value)) return absl::OkStatus();
  return NotANumber(element, token, "a number");
}

absl::Status TextCursor::ReadInt(const ElementName& element, std::int64_t* value) {
  const std::string_view token = Token();
  if (ParseInt(token, value)) return absl::OkStatus();
  return NotANumber(element, token, "a whole number");
}

absl::Status TextCursor::NotANumber(const ElementName& element, std::string_view token, const char* wanted) const {
  const std::string name = std::string(element.kind) + " " + std::to_string(element.index);
  if (token.empty()) return Fault("the file ends before " + name + " is complete; it seems to be cut off");
  return Fault(name + ": " + Quoted(token) + " is not " + wanted);
}

absl::Status TextCursor::Fault(const std::string& message) const {
  return FileMalformed(path_, token_line_, message);
}

}  // namespace planish
