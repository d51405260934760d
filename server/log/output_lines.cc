#include "server/log/output_lines.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

namespace planish {
namespace {

constexpr std::size_t kLongestLine = 4096;

}  // namespace

OutputLines::OutputLines(std::function<void(const std::string&)> on_line) : on_line_(std::move(on_line)) {
  std::array<int, 2> ends = {-1, -1};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return;
  read_fd_ = ends[0];
  write_fd_ = ends[1];
  reader_ = std::thread([this] { Read(); });
}

OutputLines::~OutputLines() {
  if (write_fd_ < 0) return;
  close(write_fd_);
  reader_.join();
  close(read_fd_);
}

void OutputLines::Read() {
  std::string pending;
  const auto flush = [&](std::size_t length) {
    if (length > 0) on_line_(pending.substr(0, length));
  };
  std::array<char, kLongestLine> buffer;
  for (;;) {
    const ssize_t count = read(read_fd_, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    pending.append(buffer.data(), static_cast<std::size_t>(count));
    for (std::size_t end; (end = pending.find('\n')) != std::string::npos; pending.erase(0, end + 1)) flush(end);
    if (pending.size() >= kLongestLine) {
      flush(pending.size());
      pending.clear();
    }
  }
  flush(pending.size());
}

}  // namespace planish
