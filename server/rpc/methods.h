// The one table of what this server's methods take.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "google/protobuf/descriptor.h"
#include "server/access/caller.h"

namespace planish {

// How long a message of a caller may be. MethodLimits has the bytes.
enum class MessageSize {
  kSmall,  // names, filters, digests
  kJob,    // the largest mesh, and what a job says beside it
  kPiece,  // one piece of an upload
};

// What answering takes, and so on which threads it happens: what is quick does not wait for what is slow.
enum class Work {
  kNone,    // nothing that waits
  kReads,   // reads from the store
  kWrites,  // writes to the store
  kMoves,   // moves bytes of uploads
};

struct Method {
  std::string_view service;  // "planish.v1.Planish"
  std::string_view name;     // "CreateJob"
  Need need;                 // the right that its caller needs; Need::kNobody: anybody may call
  MessageSize size;
  // Fields that a message may have, at every depth: each may cost a hundred bytes of memory and two of the message.
  std::int64_t max_fields;
  Work work = Work::kReads;
  bool streams = false;  // lasts as long as a job or a caller wants
  bool submits = false;  // makes a job or an upload, or makes one grow

  // "/planish.v1.Planish/CreateJob"
  std::string path() const;
  // The type of the message that it takes; null for a service without descriptor.
  const google::protobuf::Descriptor* request() const;
};

// The entry of `path`, which must be in the table.
const Method& MethodAt(std::string_view path);

// What the sizes mean on one server.
struct MethodLimits {
  std::int64_t job_bytes = 0;
  std::int64_t piece_bytes = 0;

  std::int64_t MaxBytes(const Method& method) const;
};

}  // namespace planish
