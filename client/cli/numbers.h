// Numbers for people.
#pragma once

#include <cstdint>
#include <string>

namespace planish::cli {

std::string WithCommas(std::int64_t number);         // "23,062"
std::string Scientific(double number);               // "3.2e-05"
std::string Fixed(double number, int digits);        // "1.25"
std::string Significant(double number, int digits);  // "3.02e+07", "341", "0.0125"
std::string Duration(double seconds);                // "0.42 s", "12.3 s", "3:05", "1:02:09"
std::string Megabytes(std::int64_t bytes);           // "0.3 MB", "1,204 MB"
std::string Counted(std::int64_t count, const std::string& one, const std::string& many);  // "1 face", "2,000 faces"

}  // namespace planish::cli
