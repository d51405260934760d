#include "server/store/store_news.h"

#include "absl/strings/match.h"
#include "absl/strings/str_split.h"

namespace planish {

std::string EncodeNews(const StoreNews& news) {
  std::string text;
  if (news.work) text += "w\n";
  if (news.everything) text += "*\n";
  for (const std::string& job : news.jobs) text += job + "\n";
  for (const std::string& work : news.works) text += "=" + work + "\n";
  return text;
}

StoreNews DecodeNews(std::string_view message) {
  StoreNews news;
  for (const absl::string_view line : absl::StrSplit(absl::string_view(message.data(), message.size()), '\n')) {
    if (line == "w") {
      news.work = true;
    } else if (line == "*") {
      news.everything = news.work = true;
    } else if (absl::StartsWith(line, "=")) {
      news.works.emplace_back(line.substr(1));
    } else if (!line.empty()) {
      news.jobs.emplace_back(line);
    }
  }
  return news;
}

}  // namespace planish
