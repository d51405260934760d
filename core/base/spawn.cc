#include "core/base/spawn.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstring>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/base/descriptor.h"

namespace planish {
namespace {

std::vector<char*> Pointers(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

int Spawn(const NewProcess& process, pid_t* pid) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  const absl::Cleanup free_both = [&] {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  };
  const int count = static_cast<int>(process.descriptors.size());
  std::vector<Descriptor> sources;
  for (int i = 0; i < count; ++i) {
    const int ours = process.descriptors[static_cast<std::size_t>(i)];
    int error = 0;
    if (ours < 0) {
      error = posix_spawn_file_actions_addopen(&files, i, "/dev/null", O_RDWR, 0);
    } else {
      // Duplicate above `count`, since our descriptors may have numbers that the new process will use.
      const Descriptor& source = sources.emplace_back(fcntl(ours, F_DUPFD_CLOEXEC, count));
      if (source.get() < 0) return errno;
      error = posix_spawn_file_actions_adddup2(&files, source.get(), i);
    }
    if (error != 0) return error;
  }
  if (const int error = posix_spawn_file_actions_addclosefrom_np(&files, count); error != 0) return error;
  sigset_t blocked, all;
  sigemptyset(&blocked);
  for (const int signal : process.blocked_signals) sigaddset(&blocked, signal);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &blocked);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  const int group = process.own_group ? POSIX_SPAWN_SETPGROUP : 0;
  posix_spawnattr_setflags(&attributes, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | group));
  return posix_spawn(pid, process.program.c_str(), &files, &attributes, Pointers(process.arguments).data(),
                     Pointers(process.variables).data());
}

std::string HowItEnded(int wait_status) {
  if (!WIFSIGNALED(wait_status)) return absl::StrCat("exited with code ", WEXITSTATUS(wait_status));
  return absl::StrCat("was killed by signal ", WTERMSIG(wait_status), " (", SignalName(WTERMSIG(wait_status)), ")");
}

std::string SignalName(int number) {
  const char* const name = sigabbrev_np(number);
  return name == nullptr ? absl::StrCat("signal ", number) : absl::StrCat("SIG", name);
}

}  // namespace planish
