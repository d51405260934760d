// The table of all methods of this server and their limits.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "google/protobuf/descriptor.h"
#include "server/access/caller.h"

namespace planish {

// The class of a method's longest message. MethodLimits has the bytes.
enum class MessageSize {
  kSmall,  // names, filters, digests
  kJob,    // the largest mesh, and a job's other fields
  kPiece,  // one piece of an upload
};

// What a handler does. This decides which threads run it, so that quick calls do not wait for slow ones.
enum class Work {
  kNone,    // never blocks
  kReads,   // reads from the store
  kWrites,  // writes to the store
  kMoves,   // receives bytes of uploads
};

struct Method {
  std::string_view service;  // "planish.v1.Planish"
  std::string_view name;     // "CreateJob"
  Need need;                 // the right that its caller needs; Need::kNobody: anybody may call
  MessageSize size;
  // Most fields in a message, counted at every depth. A field of two bytes may cost a hundred bytes of memory.
  std::int64_t max_fields;
  Work work = Work::kReads;
  bool streams = false;  // lasts as long as the job or the caller does
  bool submits = false;  // makes a job or an upload, or adds to an upload

  // "/planish.v1.Planish/CreateJob"
  std::string path() const;
  // The type of the method's request; null for a service without a descriptor.
  const google::protobuf::Descriptor* request() const;
};

// The entry of `path`, which must be in the table.
const Method& MethodAt(std::string_view path);

// The limits of message sizes on one server.
struct MethodLimits {
  std::int64_t job_bytes = 0;
  std::int64_t piece_bytes = 0;

  std::int64_t MaxBytes(const Method& method) const;
};

}  // namespace planish
