// What other processes write to stderr, as lines of the log: bytes of theirs in between would break logs that programs
// read.
#pragma once

#include <functional>
#include <string>
#include <thread>

namespace planish {

class OutputLines {
 public:
  // `on_line` gets each line without its end, on a thread of this object. Lines of more than 4 KiB come in pieces.
  explicit OutputLines(std::function<void(const std::string&)> on_line);
  // Waits until all processes that hold the descriptor are gone.
  ~OutputLines();
  OutputLines(const OutputLines&) = delete;
  OutputLines& operator=(const OutputLines&) = delete;

  // What they write to: stays this object's and is closed on exec. -1 if there is none: no descriptors left.
  int write_fd() const { return write_fd_; }

 private:
  void Read();

  const std::function<void(const std::string&)> on_line_;
  int read_fd_ = -1;
  int write_fd_ = -1;
  std::thread reader_;
};

}  // namespace planish
