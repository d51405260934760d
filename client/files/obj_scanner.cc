#include "client/files/obj_scanner.h"

#include "core/base/number.h"

namespace planish {
ObjScanner::ObjScanner(std::string_view text)
    : text_(text),
      line_feed_(text.find('\n') == std::string_view::npos && text.find('\r') != std::string_view::npos ? '\r' : '\n'),
      position_(text.substr(0, 3) == "\xEF\xBB\xBF" ? 3 : 0) {}

std::size_t ObjScanner::LineEnd(std::size_t from) const {
  const std::size_t found = text_.find(line_feed_, from);
  return found == std::string_view::npos ? text_.size() : found;
}

bool ObjScanner::Next(ObjStatement* statement) {
  if (position_ >= text_.size()) return false;
  statement->begin = position_;
  statement->line = line_;
  std::size_t line_begin = position_;
  while (true) {
    std::size_t end = LineEnd(line_begin);
    statement->next = end < text_.size() ? end + 1 : end;
    ++line_;
    if (line_feed_ == '\n' && end > line_begin && end < text_.size() && text_[end - 1] == '\r') --end;
    statement->end = end;
    const bool joint = end > line_begin && text_[end - 1] == '\\' && statement->next < text_.size() &&
                       text_.substr(line_begin, end - line_begin).find('#') == std::string_view::npos;
    if (!joint) break;
    line_begin = statement->next;
  }
  position_ = statement->next;
  return true;
}

bool ObjTokens::IsJoint(std::size_t position) const {
  if (position + 1 >= end_) return false;
  const char next = text_[position + 1];
  return next == '\n' || next == '\r';
}

bool ObjTokens::Next(std::string_view* token) {
  while (position_ < end_ && (IsBlank(text_[position_]) || (text_[position_] == '\\' && IsJoint(position_)))) {
    ++position_;
  }
  const std::size_t begin = position_;
  while (position_ < end_) {
    const char c = text_[position_];
    if (IsBlank(c) || c == '#' || (c == '\\' && IsJoint(position_))) break;
    ++position_;
  }
  if (position_ == begin) return false;
  *token = text_.substr(begin, position_ - begin);
  return true;
}

ObjCorner SplitObjCorner(std::string_view token) {
  ObjCorner corner;
  const std::size_t first = token.find('/');
  corner.vertex = token.substr(0, first);
  if (first == std::string_view::npos) return corner;
  const std::size_t second = token.find('/', first + 1);
  if (second == std::string_view::npos) {
    corner.texture = token.substr(first + 1);
  } else {
    corner.texture = token.substr(first + 1, second - first - 1);
    corner.after = token.substr(second);
  }
  return corner;
}

}  // namespace planish
