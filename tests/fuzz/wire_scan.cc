// The scan of a message before it is parsed. The first byte chooses the type, the second the size of the pieces in which
// the stream has the rest, a message in the wire format.
#include "server/rpc/wire_scan.h"

#include <memory>
#include <string>

#include "google/protobuf/io/zero_copy_stream_impl_lite.h"
#include "planish/v1/planish.pb.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::wire_scan {
namespace {

using google::protobuf::Message;
using google::protobuf::io::ArrayInputStream;

constexpr std::int64_t kMemory = std::int64_t{64} << 20;
constexpr std::int64_t kMaxFields = 50;

// What a message takes may be so much more than the scan says: containers of protobuf grow by doubling.
constexpr std::int64_t kFactor = 4, kMargin = 4096;

absl::StatusOr<WireCost> Scan(std::string_view bytes, int piece, const Message& type, std::int64_t max_fields) {
  ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()), piece);
  return ScanMessage(&stream, static_cast<std::int64_t>(bytes.size()), type.GetDescriptor(), max_fields);
}

void Check(std::string_view bytes, int piece, Message& message) {
  const auto scanned = Scan(bytes, piece, message, kMaxFields);
  const auto at_once = Scan(bytes, -1, message, kMaxFields);
  Require(scanned.status() == at_once.status(), "pieces change nothing");
  const bool parsed = message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  if (!scanned.ok()) {
    RequireReason(scanned.status(), {"REQUEST_INVALID"});
    const std::string text(scanned.status().message());
    Require(!parsed || text.find("malformed") == std::string::npos, "what can be parsed is not malformed");
    return;
  }
  Require(scanned->fields <= kMaxFields && scanned->bytes >= 0, "fields within the limit");
  Require(scanned->fields == at_once->fields && scanned->bytes == at_once->bytes, "the same cost in pieces");
  if (!parsed) return;  // e.g. text that is not UTF-8
  const auto taken = static_cast<std::int64_t>(message.SpaceUsedLong());
  Require(taken <= kFactor * scanned->bytes + kMargin, "no message takes much more memory than its scan says");
}

}  // namespace

FUZZ_TARGET(wire_scan, bytes) {
  const MemoryBudget budget(kMemory);
  Bytes input(bytes);
  const int kind = input.Below(5);
  const int piece = 1 + input.Byte();
  const std::string_view rest = input.Rest();
  std::unique_ptr<Message> message;
  if (kind == 0) message = std::make_unique<v1::UnwrapOptions>();
  if (kind == 1) message = std::make_unique<v1::UnwrapRequest>();
  if (kind == 2) message = std::make_unique<v1::CreateJobRequest>();
  if (kind == 3) message = std::make_unique<v1::EstimateJobRequest>();
  if (kind == 4) message = std::make_unique<v1::BatchCreateJobsRequest>();
  Check(rest, piece, *message);
}

}  // namespace planish::fuzz::wire_scan
