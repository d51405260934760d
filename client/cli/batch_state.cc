#include "client/cli/batch_state.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>

#include "client/cli/batch_digest.h"
#include "client/cli/json.h"
#include "planish/error.h"

namespace planish::cli {
namespace {

Error FileError(const char* reason, const std::string& path, const char* what) {
  return Error(ErrorCode::kPermissionDenied, reason,
               path + ": " + what + ": " + std::generic_category().message(errno));
}

const char* StateOf(const BatchRecord& record) {
  if (!record.request_id.empty()) return "asked for";
  if (record.queued) return "queued";
  return record.files.empty() ? "failed" : "done";
}

}  // namespace

std::string ToLine(const BatchRecord& record) {
  Json json = {{"output", record.key},        {"state", StateOf(record)},  {"input", record.input},
               {"settings", record.settings}, {"version", record.version}, {"job", record.job}};
  if (!record.request_id.empty()) {
    json["request_id"] = record.request_id;
    json["server"] = record.server;
  } else if (record.queued) {
    json["server"] = record.server;
  } else {
    json["usable"] = record.usable;
    if (!record.why.empty()) json["why"] = record.why;
    json["triangles"] = record.triangles;
    json["charts"] = record.charts;
    json["seconds"] = record.seconds;
    json["files"] = record.files;
  }
  return ToLine(json);
}

std::optional<BatchRecord> ParseRecord(const std::string& line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  BatchRecord record;
  try {
    record.key = json.at("output");
    record.queued = json.at("state") == "queued";
    record.input = json.at("input");
    record.settings = json.at("settings");
    record.version = json.at("version");
    record.job = json.at("job");
    record.request_id = json.value("request_id", "");
    if (record.queued || !record.request_id.empty()) {
      record.server = json.at("server");
      return record;
    }
    record.usable = json.at("usable");
    record.why = json.value("why", "");
    record.triangles = json.at("triangles");
    record.charts = json.at("charts");
    record.seconds = json.at("seconds");
    record.files = json.at("files").get<std::map<std::string, std::string>>();
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return record;
}

BatchState::BatchState(const std::string& directory)
    : directory_(directory), path_(directory + (directory.ends_with("/") ? "" : "/") + kBatchStateFile) {
  file_ = OwnedFd(open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
  if (file_.get() < 0) throw FileError("FILE_UNWRITABLE", path_, "cannot be opened");
  // File systems without locks have none to lose.
  if (flock(file_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    throw Error(ErrorCode::kFailedPrecondition, "BATCH_RUNNING",
                "another planish is writing into " + directory_ + "; wait for it, or give -o another directory");
  }
  std::ifstream in(path_, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  torn_ = !text.empty() && text.back() != '\n';
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (const std::optional<BatchRecord> record = ParseRecord(line)) records_[record->key] = *record;
  }
}

std::optional<BatchRecord> BatchState::Find(const std::string& key) const {
  const std::lock_guard lock(mutex_);
  const auto found = records_.find(key);
  return found == records_.end() ? std::nullopt : std::optional(found->second);
}

void BatchState::Append(const BatchRecord& record) {
  const std::lock_guard lock(mutex_);
  const std::string line = (torn_ ? "\n" : "") + ToLine(record) + "\n";
  // In one piece, so that a kill leaves a whole line or the beginning of one.
  ssize_t written;
  do {
    written = write(file_.get(), line.data(), line.size());
  } while (written < 0 && errno == EINTR);
  if (written != static_cast<ssize_t>(line.size())) {
    torn_ = torn_ || written > 0;
    if (written >= 0) errno = ENOSPC;
    throw FileError("FILE_UNWRITABLE", path_, "cannot write");
  }
  torn_ = false;
  records_[record.key] = record;
}

bool BatchState::IsIntact(const BatchRecord& record) const {
  if (record.queued || record.files.empty()) return false;
  for (const auto& [file, digest] : record.files) {
    if (FileDigest(directory_ + "/" + file) != digest) return false;
  }
  return true;
}

}  // namespace planish::cli
