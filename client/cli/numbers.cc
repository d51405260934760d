#include "client/cli/numbers.h"

#include <cmath>
#include <cstdio>

namespace planish::cli {
namespace {

template <typename... Values>
std::string Format(const char* format, Values... values) {
  char text[64];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

}  // namespace

std::string WithCommas(std::int64_t number) {
  const std::string digits = std::to_string(number);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    const std::size_t left = digits.size() - i;
    if (i > 0 && left % 3 == 0 && digits[i - 1] != '-') text += ',';
    text += digits[i];
  }
  return text;
}

std::string Scientific(double number) {
  return Format("%.1e", number);
}

std::string Fixed(double number, int digits) {
  return Format("%.*f", digits, number);
}

std::string Significant(double number, int digits) {
  return Format("%.*g", digits, number);
}

std::string Duration(double seconds) {
  if (seconds < 9.995) return Format("%.2f s", seconds);
  if (seconds < 59.95) return Format("%.1f s", seconds);
  const long whole = static_cast<long>(seconds + 0.5);
  if (whole < 3600) return Format("%ld:%02ld", whole / 60, whole % 60);
  return Format("%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string Megabytes(std::int64_t bytes) {
  const double megabytes = 1e-6 * static_cast<double>(bytes);
  return (megabytes < 10 ? Fixed(megabytes, 1) : WithCommas(std::llround(megabytes))) + " MB";
}

std::string Counted(std::int64_t count, const std::string& one, const std::string& many) {
  return WithCommas(count) + " " + (count == 1 ? one : many);
}

}  // namespace planish::cli
