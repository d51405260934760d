// Turns the stderr output of other processes into lines of the log. If they wrote to the log themselves, programs could
// not parse it.
#pragma once

#include <functional>
#include <string>
#include <thread>

namespace planish {

class OutputLines {
 public:
  // `on_line` gets each line without its line end, on a thread of this object. Lines of more than 4 KiB are split.
  explicit OutputLines(std::function<void(const std::string&)> on_line);
  // Waits until all processes that hold the descriptor have ended.
  ~OutputLines();
  OutputLines(const OutputLines&) = delete;
  OutputLines& operator=(const OutputLines&) = delete;

  // The descriptor that the processes write to. Belongs to this object and is closed on exec. -1 if the process had no
  // descriptors left.
  int write_fd() const { return write_fd_; }

 private:
  void Read();

  const std::function<void(const std::string&)> on_line_;
  int read_fd_ = -1;
  int write_fd_ = -1;
  std::thread reader_;
};

}  // namespace planish
