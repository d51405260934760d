#include "client/cli/terminal.h"

#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace planish::cli {
namespace {

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

bool LocaleIsUtf8() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const std::string locale = Environment(name);
    if (locale.empty()) continue;
    return strcasestr(locale.c_str(), "UTF-8") != nullptr || strcasestr(locale.c_str(), "UTF8") != nullptr;
  }
  return false;
}

ColorMode color_mode = ColorMode::kAuto;

}  // namespace

void SetColorMode(ColorMode mode) {
  color_mode = mode;
}

Terminal StderrTerminal() {
  Terminal terminal;
  const std::string term = Environment("TERM");
  terminal.is_tty = isatty(STDERR_FILENO) == 1;
  terminal.is_dumb = term.empty() || term == "dumb";
  terminal.utf8 = LocaleIsUtf8();
  terminal.color = color_mode == ColorMode::kAuto
                       ? terminal.is_tty && !terminal.is_dumb && Environment("NO_COLOR").empty()
                       : color_mode == ColorMode::kAlways;
  winsize size = {};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0) {
    if (size.ws_col > 0) terminal.width = size.ws_col;
    if (size.ws_row > 0) terminal.height = size.ws_row;
  }
  return terminal;
}

std::string Colored(const Terminal& terminal, const char* color, const std::string& text) {
  return terminal.color && !text.empty() ? color + text + "\x1b[0m" : text;
}

}  // namespace planish::cli
