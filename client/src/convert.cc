#include "client/src/convert.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/util/time_util.h>

#include <bit>
#include <chrono>
#include <cstring>
#include <optional>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/src/errors.h"
#include "core/base/sha256.h"
#include "core/base/trace_context.h"
#include "made/fields.h"

namespace planish {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using google::protobuf::util::TimeUtil;

Seconds SecondsFrom(const google::protobuf::Duration& duration) {
  return std::chrono::nanoseconds(TimeUtil::DurationToNanoseconds(duration));
}

google::protobuf::Duration ToProto(Seconds seconds) {
  return TimeUtil::MicrosecondsToDuration(std::chrono::duration_cast<std::chrono::microseconds>(seconds).count());
}

Job::Time TimeFrom(const google::protobuf::Timestamp& time) {
  return Job::Time(std::chrono::nanoseconds(TimeUtil::TimestampToNanoseconds(time)));
}

namespace {

static_assert(std::endian::native == std::endian::little, "UV travel little-endian");

// The enums of options and reports list the values of the proto in the same order. The proto begins with UNSPECIFIED =
// 0, so value n of the proto is value n - 1 here (a test compares the names). For values of newer servers, ToString
// gives "unknown". UNSPECIFIED becomes `unspecified`.
template <typename Enum>
Enum EnumFromProto(int value, Enum unspecified = Enum()) {
  return value == 0 ? unspecified : static_cast<Enum>(value - 1);
}

template <typename ProtoEnum, typename Enum>
ProtoEnum EnumToProto(Enum value) {
  return static_cast<ProtoEnum>(static_cast<int>(value) + 1);
}

static_assert(static_cast<int>(Priority::kHigh) + 1 == v1::PRIORITY_HIGH);
static_assert(static_cast<int>(JobState::kExpired) == v1::JOB_STATE_EXPIRED);
static_assert(static_cast<int>(Stage::kDownload) == v1::STAGE_DOWNLOAD);

// ---- Converts fields of messages to and from the members that stand for them (made/fields.h)

template <typename Value>
struct IsVector : std::false_type {};
template <typename Value>
struct IsVector<std::vector<Value>> : std::true_type {};
template <typename Value>
struct IsOptional : std::false_type {};
template <typename Value>
struct IsOptional<std::optional<Value>> : std::true_type {};

template <typename Struct>
Struct FieldsFrom(const Message& proto);

// Sets `value` to the field's value. Does not change `value` if the field is an unset message or an unspecified enum.
template <typename Value>
void Read(const Message& proto, const FieldDescriptor& field, Value& value) {
  const Reflection& reflection = *proto.GetReflection();
  if constexpr (IsOptional<Value>::value) {
    if (reflection.HasField(proto, &field)) Read(proto, field, value.emplace());
  } else if constexpr (std::is_same_v<Value, std::vector<float>>) {
    for (int i = 0; i < reflection.FieldSize(proto, &field); ++i) {
      value.push_back(reflection.GetRepeatedFloat(proto, &field, i));
    }
  } else if constexpr (IsVector<Value>::value) {
    for (int i = 0; i < reflection.FieldSize(proto, &field); ++i) {
      value.push_back(FieldsFrom<typename Value::value_type>(reflection.GetRepeatedMessage(proto, &field, i)));
    }
  } else if constexpr (std::is_same_v<Value, Seconds>) {
    value = SecondsFrom(static_cast<const google::protobuf::Duration&>(reflection.GetMessage(proto, &field)));
  } else if constexpr (std::is_class_v<Value> && !std::is_same_v<Value, std::string>) {
    if (reflection.HasField(proto, &field)) value = FieldsFrom<Value>(reflection.GetMessage(proto, &field));
  } else if constexpr (std::is_same_v<Value, Stage>) {
    value = static_cast<Stage>(reflection.GetEnumValue(proto, &field));
  } else if constexpr (std::is_enum_v<Value>) {
    value = EnumFromProto(reflection.GetEnumValue(proto, &field), value);
  } else if constexpr (std::is_same_v<Value, bool>) {
    const bool is_enum = field.enum_type() != nullptr;  // on = 1, off = 2
    value = is_enum ? reflection.GetEnumValue(proto, &field) != 2 : reflection.GetBool(proto, &field);
  } else if constexpr (std::is_same_v<Value, std::string>) {
    value = reflection.GetString(proto, &field);
  } else if constexpr (std::is_same_v<Value, double>) {
    value = reflection.GetDouble(proto, &field);
  } else if constexpr (std::is_same_v<Value, int>) {
    value = reflection.GetInt32(proto, &field);
  } else {
    value = reflection.GetInt64(proto, &field);
  }
}

template <typename Struct>
Struct FieldsFrom(const Message& proto) {
  Struct value;
  EachField(value, [&](const Field& field, auto& member) {
    Read(proto, *proto.GetDescriptor()->FindFieldByName(field.name), member);
  });
  return value;
}

template <typename Value>
void Write(const Value& value, const FieldDescriptor& field, Message* proto) {
  const Reflection& reflection = *proto->GetReflection();
  if constexpr (IsOptional<Value>::value) {
    if (value) Write(*value, field, proto);
  } else if constexpr (std::is_same_v<Value, bool>) {
    reflection.SetEnumValue(proto, &field, value ? 1 : 2);  // on, off
  } else if constexpr (std::is_enum_v<Value>) {
    reflection.SetEnumValue(proto, &field, static_cast<int>(value) + 1);
  } else if constexpr (std::is_same_v<Value, double>) {
    reflection.SetDouble(proto, &field, value);
  } else {
    reflection.SetInt32(proto, &field, value);
  }
}

Scheduling FromProto(const v1::Scheduling& proto) {
  return {EnumFromProto(proto.priority(), Priority::kNormal), SecondsFrom(proto.timeout()),
          SecondsFrom(proto.compute_budget()), proto.fresh()};
}

template <typename Number>
std::vector<Number> Numbers(const std::string& bytes) {
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

}  // namespace

v1::UnwrapOptions ToProto(const UnwrapOptions& options) {
  v1::UnwrapOptions proto;
  EachField(options, [&](const Field& field, const auto& member) {
    Write(member, *proto.GetDescriptor()->FindFieldByName(field.name), &proto);
  });
  return proto;
}

v1::Scheduling ToProto(const Scheduling& scheduling) {
  v1::Scheduling proto;
  proto.set_priority(EnumToProto<v1::Priority>(scheduling.priority));
  if (scheduling.timeout > Seconds(0)) *proto.mutable_timeout() = ToProto(scheduling.timeout);
  if (scheduling.compute_budget > Seconds(0)) *proto.mutable_compute_budget() = ToProto(scheduling.compute_budget);
  proto.set_fresh(scheduling.fresh);
  return proto;
}

Report FromProto(const v1::Report& proto, const ids::Renumbering& renumbering) {
  Report report = FieldsFrom<Report>(proto);
  report.triangles = proto.input().triangles();
  report.vertices = proto.input().vertices();
  report.times = FieldsFrom<StageTimes>(proto.times());
  for (const v1::Warning& warning : proto.warnings()) {
    report.warnings.push_back(
        {warning.reason(), warning.message(),
         ids::RenumberMetadata({warning.metadata().begin(), warning.metadata().end()}, renumbering)});
  }
  return report;
}

Job FromProto(const v1::Job& proto, const ids::Renumbering& renumbering) {
  Job job;
  job.name = proto.name();
  job.state = static_cast<JobState>(proto.state());
  job.labels = {proto.labels().begin(), proto.labels().end()};
  job.options = FieldsFrom<UnwrapOptions>(proto.options());
  if (proto.has_create_time()) job.create_time = TimeFrom(proto.create_time());
  if (proto.has_start_time()) job.start_time = TimeFrom(proto.start_time());
  if (proto.has_end_time()) job.end_time = TimeFrom(proto.end_time());
  job.mesh_bytes = proto.mesh_bytes();
  job.queue_position = proto.queue_position();
  if (proto.has_progress()) job.progress = FieldsFrom<Progress>(proto.progress());
  if (proto.has_error()) job.error = Renumbered(ErrorFrom(proto.error()), renumbering).set_job(proto.name());
  if (proto.has_report()) job.report = FromProto(proto.report(), renumbering);
  job.scheduling = FromProto(proto.scheduling());
  job.attempts = proto.attempts();
  job.stop_requested = proto.stop_requested();
  job.cancel_requested = proto.cancel_requested();
  job.result_of = proto.result_of();
  job.memory_bytes = proto.memory_bytes();
  if (proto.has_expire_time()) job.expire_time = TimeFrom(proto.expire_time());
  job.trace_id = std::string(TraceIdOf(proto.traceparent()));
  return job;
}

Event FromProto(const v1::JobEvent& proto, const ids::Renumbering& renumbering) {
  Event event;
  event.sequence = proto.sequence();
  event.time = TimeFrom(proto.time());
  event.skipped = proto.skipped();
  if (proto.has_job()) event.job = FromProto(proto.job(), renumbering);
  if (proto.has_progress()) event.progress = FieldsFrom<Progress>(proto.progress());
  return event;
}

JobEstimate FromProto(const v1::JobEstimate& proto) {
  JobEstimate estimate;
  estimate.triangles = proto.size().triangles();
  estimate.vertices = proto.size().vertices();
  estimate.memory_bytes = proto.memory_bytes();
  estimate.run_time = SecondsFrom(proto.run_time());
  estimate.queue_time = SecondsFrom(proto.queue_time());
  if (proto.has_refusal()) estimate.refusal = ErrorFrom(proto.refusal());
  return estimate;
}

Capabilities FromProto(const v1::Capabilities& proto) {
  Capabilities capabilities;
  capabilities.version = proto.version();
  capabilities.max_mesh_bytes = proto.max_mesh_bytes();
  capabilities.workers = proto.workers();
  capabilities.queue_capacity = proto.queue_capacity();
  capabilities.threads = proto.threads();
  capabilities.max_triangles = proto.max_triangles();
  capabilities.memory_bytes = proto.memory_bytes();
  capabilities.inline_mesh_bytes = proto.inline_mesh_bytes();
  capabilities.upload_chunk_bytes = proto.upload_chunk_bytes();
  capabilities.reattach_grace = SecondsFrom(proto.reattach_grace());
  capabilities.durable = proto.durable();
  capabilities.isolated_workers = proto.isolated_workers();
  for (const int seams : proto.seams()) capabilities.seams.push_back(EnumFromProto<Seams>(seams));
  for (const v1::SolverCombination& solver : proto.solvers()) {
    capabilities.solvers.push_back({EnumFromProto<Solver>(solver.solver()), EnumFromProto<System>(solver.system()),
                                    EnumFromProto<Preconditioner>(solver.preconditioner())});
  }
  return capabilities;
}

Uv ParseUv(const v1::UvDescription& description, const std::string& bytes, const PackedMesh& mesh) {
  if (description.mesh_sha256() != mesh.sha256) {
    throw Error(ErrorCode::kFailedPrecondition, "MESH_MISMATCH",
                "the job was made from another mesh (the SHA-256 of the mesh bytes differs): give the same file");
  }
  const bool is_double = description.precision() == v1::PRECISION_DOUBLE;
  const std::size_t expected = static_cast<std::size_t>(6 * mesh.triangles) * (is_double ? 8 : 4);
  std::string fault;
  if (description.corner_count() != 3 * mesh.triangles) {
    fault =
        std::to_string(description.corner_count()) + " corners for " + std::to_string(mesh.triangles) + " triangles";
  } else if (bytes.size() != expected) {
    fault = absl::StrCat(bytes.size(), " bytes instead of ", expected);
  } else if (Sha256(bytes) != description.uv_sha256()) {
    fault = "their SHA-256 differs";
  }
  if (!fault.empty()) {
    throw Error(ErrorCode::kDataLoss, "UV_CORRUPT", "the UV that arrived are not the ones the server made: " + fault);
  }
  return is_double ? Uv(Numbers<double>(bytes)) : Uv(Numbers<float>(bytes));
}

}  // namespace planish
