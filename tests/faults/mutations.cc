#include "tests/faults/mutations.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "core/draco/codec.h"
#include "draco/compression/expert_encode.h"
#include "draco/core/encoder_buffer.h"
#include "draco/mesh/mesh.h"
#include "google/protobuf/message.h"
#include "google/rpc/error_details.pb.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "planish/v1/planish.pb.h"
#include "tests/faults/raw_call.h"
#include "tests/fuzz/mutations.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using google::protobuf::Message;

// Edgebreaker, rounded to 11 bits: what most Draco files in the world are.
std::string Edgebreaker(const Mesh& mesh) {
  draco::Mesh source;
  source.set_num_points(static_cast<std::uint32_t>(mesh.positions.size()));
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 3 * sizeof(float), 0);
  const int id = source.AddAttribute(position, true, static_cast<std::uint32_t>(mesh.positions.size()));
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const Eigen::Vector3f value = mesh.positions[v].cast<float>();
    source.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(v), value.data());
  }
  source.SetNumFaces(mesh.faces.size());
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
    draco::Mesh::Face face;
    for (std::size_t k = 0; k < 3; ++k) face[static_cast<int>(k)] = static_cast<std::uint32_t>(mesh.faces[f][k]);
    source.SetFace(draco::FaceIndex(f), face);
  }
  draco::ExpertEncoder encoder(source);
  encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
  encoder.SetAttributeQuantization(id, 11);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeToBuffer(&buffer).ok()) return "";
  return {buffer.data(), buffer.size()};
}

std::vector<std::string> DracoCorpus() {
  std::vector<std::string> corpus;
  for (const int n : {1, 2, 4, 8}) {
    const Mesh mesh = Bump(n);
    corpus.push_back(EncodeDraco(mesh).value());
    corpus.push_back(Edgebreaker(mesh));
  }
  return corpus;
}

// Options in range, most of them the defaults.
v1::UnwrapOptions RandomOptions(std::mt19937& random) {
  v1::UnwrapOptions options;
  const auto sometimes = [&] { return random() % 4 == 0; };
  if (sometimes()) options.set_seams(static_cast<v1::Seams>(random() % 5));
  if (sometimes()) options.set_boundary(static_cast<v1::Boundary>(random() % 3));
  if (sometimes()) options.set_hessian(static_cast<v1::Hessian>(random() % 4));
  if (sometimes()) options.set_precision(static_cast<v1::Precision>(random() % 4));
  if (sometimes()) options.set_pack(static_cast<v1::Pack>(random() % 3));
  if (sometimes()) options.set_effort(static_cast<v1::Effort>(random() % 3));
  if (sometimes()) options.set_tolerance(1e-6);
  if (sometimes()) options.set_texture_size(256);
  if (sometimes()) options.set_threads(2);
  return options;
}

// A mesh as arrays; half of them damaged.
v1::MeshArrays RandomArrays(std::mt19937& random) {
  const Mesh mesh = Bump(1 + static_cast<int>(random() % 4));
  v1::MeshArrays arrays;
  for (const Vec3& position : mesh.positions) {
    for (const double coordinate : position) {
      const auto number = static_cast<float>(coordinate);
      arrays.mutable_positions()->append(reinterpret_cast<const char*>(&number), sizeof number);
    }
  }
  for (const Face& face : mesh.faces) {
    arrays.mutable_triangles()->append(reinterpret_cast<const char*>(face.data()), sizeof face);
  }
  const std::uint32_t damage = random() % 6;
  if (damage == 0) arrays.set_positions(fuzz::Mutated({arrays.positions()}, random));
  if (damage <= 1) arrays.set_triangles(fuzz::Mutated({arrays.triangles()}, random));
  if (damage == 2) arrays.mutable_positions()->resize(random() % arrays.positions().size());
  return arrays;
}

v1::JobSpec RandomSpec(const std::string& draco, std::mt19937& random) {
  v1::JobSpec spec;
  spec.set_draco(draco);
  if (random() % 4 == 0) *spec.mutable_arrays() = RandomArrays(random);
  if (random() % 16 == 0) spec.set_mesh_sha256(std::string(random() % 2 == 0 ? 32 : 31, 'x'));
  *spec.mutable_options() = RandomOptions(random);
  if (random() % 4 == 0) (*spec.mutable_labels())["test"] = "mutation";
  if (random() % 16 == 0) (*spec.mutable_labels())[random() % 2 == 0 ? "" : "No key"] = "mutation";
  if (random() % 8 == 0) spec.mutable_scheduling()->mutable_timeout()->set_seconds(60);
  if (random() % 8 == 0) spec.mutable_scheduling()->set_priority(v1::PRIORITY_LOW);
  if (random() % 8 == 0) spec.mutable_elements()->set_seam_corners(std::string(1, static_cast<char>(random() % 6)) + std::string(random() % 4, '\0'));
  return spec;
}

template <class Request>
std::unique_ptr<Message> NewJobRequest(const std::string& draco, std::mt19937& random) {
  auto request = std::make_unique<Request>();
  *request->mutable_spec() = RandomSpec(draco, random);
  if (random() % 4 == 0) request->set_request_id(std::to_string(random()));
  return request;
}

std::string RandomText(std::mt19937& random) {
  constexpr std::size_t kLengths[] = {0, 1, 20, 128, 129, 257, 70'000};
  return std::string(kLengths[random() % std::size(kLengths)], static_cast<char>('a' + random() % 26));
}

// A number that somebody did not think of.
template <class Number>
Number RandomNumber(std::mt19937& random) {
  using Limits = std::numeric_limits<Number>;
  const Number numbers[] = {0,
                            1,
                            Limits::max(),
                            Limits::lowest(),
                            Limits::infinity(),
                            Limits::quiet_NaN(),
                            static_cast<Number>(random() % 1000),
                            static_cast<Number>(random())};
  return numbers[random() % std::size(numbers)];
}

// Gives one field, at any depth, another value: of its type, but not of its range.
void Scramble(Message* message, std::mt19937& random) {
  using google::protobuf::FieldDescriptor;
  const google::protobuf::Descriptor* type = message->GetDescriptor();
  if (type->field_count() == 0) return;
  const FieldDescriptor* field = type->field(static_cast<int>(random() % static_cast<unsigned>(type->field_count())));
  const google::protobuf::Reflection* fields = message->GetReflection();
  if (field->is_repeated()) {
    // Corners, and the requests of a batch.
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_INT32) {
      fields->AddInt32(message, field, RandomNumber<std::int32_t>(random));
    } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE && !field->is_map()) {
      const int count = fields->FieldSize(*message, field);
      if (count > 0) {
        const auto which = static_cast<int>(random() % static_cast<unsigned>(count));
        Scramble(fields->MutableRepeatedMessage(message, field, which), random);
      }
    }
    return;
  }
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return Scramble(fields->MutableMessage(message, field), random);
    case FieldDescriptor::CPPTYPE_INT32:
      return fields->SetInt32(message, field, RandomNumber<std::int32_t>(random));
    case FieldDescriptor::CPPTYPE_INT64:
      return fields->SetInt64(message, field, RandomNumber<std::int64_t>(random));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return fields->SetDouble(message, field, RandomNumber<double>(random));
    case FieldDescriptor::CPPTYPE_BOOL:
      return fields->SetBool(message, field, random() % 2 == 0);
    case FieldDescriptor::CPPTYPE_ENUM:
      return fields->SetEnumValue(message, field, static_cast<int>(random() % 12) - 1);
    case FieldDescriptor::CPPTYPE_STRING:
      // The mesh is damaged elsewhere.
      if (field->name() != "draco") fields->SetString(message, field, RandomText(random));
      return;
    default:
      return;
  }
}

struct Input {
  std::string method;
  std::string bytes;
  bool is_message = true;  // as far as protobuf is concerned
};

class Mutations {
 public:
  Mutations(const MutationOptions& options, DurableServer& server)
      : options_(options),
        server_(server),
        channel_(grpc::CreateChannel(server.target(), grpc::InsecureChannelCredentials())) {}

  MutationReport Run() {
    const double start = Now();
    Ask({"GetCapabilities", ""});  // connects
    report_.descriptors_before = server_.Descriptors();
    std::vector<std::thread> callers;
    for (int i = 0; i < options_.callers; ++i) callers.emplace_back([this] { Call(); });
    for (std::thread& caller : callers) caller.join();
    if (!server_.IsRunning()) Wrong("the server died");
    CheckTheEnds();
    report_.seconds = Now() - start;
    return std::move(report_);
  }

 private:
  struct Asked {
    std::vector<std::string> messages;
    CallEnd end;
  };

  void Wrong(const std::string& what) {
    const std::lock_guard lock(mutex_);
    if (report_.wrong.size() < 20) report_.wrong.push_back(what);
  }

  Asked Ask(const Input& input) {
    RawCall call(channel_, input.method, input.bytes, options_.call_seconds);
    Asked asked;
    while (std::optional<std::string> message = call.Read()) asked.messages.push_back(*std::move(message));
    asked.end = call.Finish();
    return asked;
  }

  void Call() {
    std::string last_job = "jobs/none";
    for (int i = next_++; i < options_.inputs && alive_; i = next_++) {
      std::mt19937 random(options_.seed + static_cast<std::uint32_t>(i));
      const Input input = MakeInput(random, last_job);
      const Asked asked = Ask(input);
      const std::vector<std::string> jobs = JobsOf(input, asked);
      Note(input, asked, static_cast<int>(jobs.size()));
      for (const std::string& job : jobs) {
        last_job = job;
        Follow(job);
      }
    }
  }

  Input MakeInput(std::mt19937& random, const std::string& last_job) {
    Input input;
    const std::uint32_t damage = random() % 4;  // half of the time of the mesh, beside that of fields or of bytes
    std::string draco = draco_[random() % draco_.size()];
    if (damage < 2) draco = fuzz::Mutated({draco}, random);
    const std::unique_ptr<Message> request = MakeRequest(draco, last_job, random, &input.method);
    if (damage > 0) {
      for (std::uint32_t fields = 1 + random() % 4; fields > 0; --fields) Scramble(request.get(), random);
    }
    input.bytes = request->SerializeAsString();
    if (damage == 3 && random() % 2 == 0) {
      input.bytes = fuzz::Mutated({input.bytes}, random);
      input.is_message = false;  // or it may be
    }
    return input;
  }

  static std::unique_ptr<Message> MakeRequest(const std::string& draco, const std::string& last_job,
                                              std::mt19937& random, std::string* method) {
    switch (random() % 15) {
      case 0: {
        *method = "EstimateJob";
        auto request = std::make_unique<v1::EstimateJobRequest>();
        *request->mutable_spec() = RandomSpec(draco, random);
        return request;
      }
      case 1: {
        *method = "ListJobs";
        auto request = std::make_unique<v1::ListJobsRequest>();
        request->set_page_size(static_cast<std::int32_t>(1 + random() % 5));
        request->set_view(static_cast<v1::JobView>(random() % 3));
        const std::string filter =
            R"(state != RUNNING AND labels.test = "mut*" AND create_time > 2026-01-01T00:00:00Z)";
        if (random() % 2 == 0) request->set_filter(random() % 2 == 0 ? filter : fuzz::Mutated({filter}, random));
        return request;
      }
      case 2: {
        *method = "CreateUpload";
        auto request = std::make_unique<v1::CreateUploadRequest>();
        request->set_total_bytes(1 + static_cast<std::int64_t>(random() % 100));
        request->set_sha256(std::string(32, static_cast<char>(random())));
        if (random() % 2 == 0) request->set_request_id(std::to_string(random() % 10));
        return request;
      }
      case 12: {
        *method = "BatchCreateJobs";
        auto request = std::make_unique<v1::BatchCreateJobsRequest>();
        for (std::uint32_t jobs = random() % 4; jobs > 0; --jobs) {
          *request->add_requests()->mutable_spec() = RandomSpec(draco, random);
        }
        return request;
      }
      case 13: {
        *method = "FindMissingMeshes";
        auto request = std::make_unique<v1::FindMissingMeshesRequest>();
        for (std::uint32_t meshes = random() % 4; meshes > 0; --meshes) {
          request->add_sha256(std::string(random() % 8 == 0 ? 5 : 32, static_cast<char>(random())));
        }
        return request;
      }
      case 14: {
        if (random() % 2 == 0) {
          *method = "WaitJob";
          auto request = std::make_unique<v1::WaitJobRequest>();
          request->set_name(last_job);
          request->mutable_timeout()->set_nanos(static_cast<std::int32_t>(random() % 100'000'000));
          return request;
        }
        *method = "ReadResult";
        auto request = std::make_unique<v1::ReadResultRequest>();
        request->set_name(last_job);
        request->set_offset(static_cast<std::int64_t>(random() % 1000));
        request->set_limit(static_cast<std::int64_t>(random() % 1000));
        return request;
      }
      case 3: {
        *method = "WriteUpload";
        auto request = std::make_unique<v1::WriteUploadRequest>();
        request->set_name("uploads/none");
        request->set_data(draco);
        return request;
      }
      case 4: {
        // The requests of all of them have the name in the same place.
        constexpr const char* kMethods[] = {"GetJob",    "WatchJob",  "StopJob",     "CancelJob",
                                            "DeleteJob", "GetUpload", "DeleteUpload"};
        *method = kMethods[random() % std::size(kMethods)];
        auto request = std::make_unique<v1::WatchJobRequest>();
        request->set_name(last_job);
        return request;
      }
      case 5:
      case 6:
      case 7:
        *method = "Unwrap";
        return NewJobRequest<v1::UnwrapRequest>(draco, random);
      default:
        *method = "CreateJob";
        return NewJobRequest<v1::CreateJobRequest>(draco, random);
    }
  }

  // The jobs that a call created.
  static std::vector<std::string> JobsOf(const Input& input, const Asked& asked) {
    if (asked.messages.empty()) return {};
    const std::string& first = asked.messages.front();
    v1::Job job;
    if (input.method == "CreateJob" && job.ParseFromString(first)) return {job.name()};
    v1::UnwrapResponse response;
    if (input.method == "Unwrap" && response.ParseFromString(first)) return {response.event().job().name()};
    std::vector<std::string> jobs;
    v1::BatchCreateJobsResponse batch;
    if (input.method == "BatchCreateJobs" && batch.ParseFromString(first)) {
      for (const auto& result : batch.results()) {
        if (result.has_job()) jobs.push_back(result.job().name());
      }
    }
    return jobs;
  }

  void Note(const Input& input, const Asked& asked, int accepted) {
    const CallEnd& end = asked.end;
    const std::string what =
        input.method + " " + std::to_string(end.code) + (end.reason.empty() ? "" : " " + end.reason);
    const bool is_bad = end.code == grpc::StatusCode::UNAVAILABLE || end.code == grpc::StatusCode::DEADLINE_EXCEEDED ||
                        end.code == grpc::StatusCode::UNKNOWN || end.code == grpc::StatusCode::DATA_LOSS;
    const bool is_internal = end.code == grpc::StatusCode::INTERNAL;
    // gRPC says INTERNAL for bytes that are no message; ours has a reason. How the call on a job ends, the job says.
    if (accepted == 0 && (is_bad || (is_internal && (input.is_message || !end.reason.empty())))) {
      Wrong("answer " + what + ": " + end.message);
    }
    if (end.code == grpc::StatusCode::UNAVAILABLE) alive_ = false;
    const std::lock_guard lock(mutex_);
    ++report_.sent;
    report_.accepted += accepted;
    if (accepted == 0) {
      ++report_.refused[what];
    }
  }

  // To its end.
  void Follow(const std::string& name) {
    v1::WatchJobRequest request;
    request.set_name(name);
    const Asked asked = Ask({"WatchJob", request.SerializeAsString()});
    std::optional<v1::Job> last;
    int ends = 0;
    for (const std::string& message : asked.messages) {
      v1::WatchJobResponse response;
      if (!response.ParseFromString(message)) Wrong("an event of " + name + " is none");
      if (!response.event().has_job()) continue;
      last = response.event().job();
      ends += IsTerminal(*last) ? 1 : 0;
    }
    if (!last.has_value() || ends != 1) {
      Wrong(name + " ended " + std::to_string(ends) + " times: " + asked.end.message);
      if (asked.end.code == grpc::StatusCode::UNAVAILABLE) alive_ = false;
      return;
    }
    const std::lock_guard lock(mutex_);
    ++report_.ends[EndOf(*last)];
  }

  static bool IsTerminal(const v1::Job& job) {
    return job.state() == v1::JOB_STATE_SUCCEEDED || job.state() == v1::JOB_STATE_FAILED ||
           job.state() == v1::JOB_STATE_CANCELLED || job.state() == v1::JOB_STATE_EXPIRED;
  }

  static std::string EndOf(const v1::Job& job) {
    std::string end = v1::JobState_Name(job.state()).substr(std::string("JOB_STATE_").size());
    google::rpc::ErrorInfo info;
    for (const auto& detail : job.error().details()) {
      if (detail.UnpackTo(&info)) return end + " " + info.reason();
    }
    return end;
  }

  void CheckTheEnds() {
    v1::ListJobsRequest request;
    request.set_page_size(1000);
    do {
      const Asked asked = Ask({"ListJobs", request.SerializeAsString()});
      v1::ListJobsResponse page;
      if (asked.messages.empty() || !page.ParseFromString(asked.messages.front())) {
        return Wrong("the jobs cannot be listed: " + asked.end.message);
      }
      for (const v1::Job& job : page.jobs()) {
        if (!IsTerminal(job)) Wrong(job.name() + " has not ended");
      }
      request.set_page_token(page.next_page_token());
    } while (!request.page_token().empty());
    report_.descriptors_after = server_.Descriptors();
    report_.resident_bytes = server_.ResidentBytes();
    if (server_.Zombies() > 0) Wrong(std::to_string(server_.Zombies()) + " zombies");
    // An upload that waits for its bytes, and a blob that is held, have one each; workers come and go.
    if (report_.descriptors_after > report_.descriptors_before + 100) {
      Wrong("descriptors: " + std::to_string(report_.descriptors_before) + " before, " +
            std::to_string(report_.descriptors_after) + " after");
    }
  }

  const MutationOptions options_;
  DurableServer& server_;
  const std::shared_ptr<grpc::Channel> channel_;
  const std::vector<std::string> draco_ = DracoCorpus();
  std::atomic<int> next_ = 0;
  std::atomic<bool> alive_ = true;

  std::mutex mutex_;
  MutationReport report_;  // counts guarded by mutex_
};

}  // namespace

MutationReport RunMutations(const MutationOptions& options, DurableServer& server) {
  return Mutations(options, server).Run();
}

}  // namespace planish
