// An input is a list of calls on an UploadStore in memory; each answer is compared with that of a simple model.
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "server/jobs/upload_store.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::upload_state_machine {
namespace {

constexpr std::int64_t kMemory = std::int64_t{64} << 20;
constexpr int kMaxCalls = 300;
constexpr int kNames = 8;  // the last uploads, by which calls name them
constexpr int kWriters = 4;

constexpr std::int64_t kMaxMeshBytes = 40;
constexpr int kMaxUploads = 3;
constexpr std::int64_t kMaxBytes = 70;
constexpr int kMaxComplete = 3;
constexpr std::int64_t kStoreBytes = 60;
constexpr absl::Duration kIdleLimit = absl::Seconds(60);
constexpr absl::Duration kWriterLimit = absl::Seconds(5);

// Meshes that are uploaded: of these lengths, each of one letter. The last one is too large.
constexpr std::array<std::int64_t, 6> kLengths = {1, 7, 20, 33, 40, 41};

const Caller kCaller = {kDefaultTenant, "", Rights::All(), ""};

BlobId Own(const std::string& sha256) {
  return {kDefaultTenant, sha256};
}

std::string Content(int mesh) {
  return std::string(static_cast<std::size_t>(kLengths[static_cast<std::size_t>(mesh)]), static_cast<char>('a' + mesh));
}

// As planish.v1 describes uploads.
struct ModelUpload {
  std::int64_t total = 0;
  std::string sha256;
  std::string bytes;  // that came, unless complete
  bool complete = false;
  absl::Time used;
  int writer = 0;  // number of the writer at it, 0: none

  std::int64_t Committed() const { return complete ? total : static_cast<std::int64_t>(bytes.size()); }
};

class Machine {
 public:
  Machine() : blobs_({}, kStoreBytes), store_(Options(), &blobs_) {
    Require(store_.Open().ok(), "an empty store opens");
  }

  void Call(Bytes& input) {
    // No two uploads were used at the same time.
    now_ += absl::Milliseconds(1);
    switch (input.Below(9)) {
      case 0:
        return Create(input);
      case 1:
        return Write(input);
      case 2:
      case 3:
        return Append(input);
      case 4:
        return Release(input);
      case 5:
        return Get(Name(input));
      case 6:
        return Delete(Name(input));
      case 7:
        return Use(Name(input));
      default:
        return Wait(input);
    }
  }

  void CheckAll() {
    for (const auto& [name, upload] : uploads_) Get(name);
    std::int64_t bytes = 0;
    for (const std::string& sha256 : kept_)
      bytes += (*blobs_.Find(Own(sha256)))->size();
    Require(blobs_.bytes() == bytes, "the store counts the bytes that it keeps");
  }

 private:
  struct Writer {
    UploadWriter real;
    std::string name;
    int number = 0;
  };

  UploadStoreOptions Options() {
    UploadStoreOptions options;
    options.max_mesh_bytes = kMaxMeshBytes;
    options.max_uploads = kMaxUploads;
    options.max_bytes = kMaxBytes;
    options.max_complete = kMaxComplete;
    options.idle_limit = kIdleLimit;
    options.writer_limit = kWriterLimit;
    options.clock = [this] { return now_; };
    options.new_id = [this] { return std::to_string(++last_id_); };
    return options;
  }

  std::string Name(Bytes& input) { return "uploads/" + std::to_string(last_id_ - input.Below(kNames)); }

  ModelUpload* Find(const std::string& name) {
    const auto found = uploads_.find(name);
    return found == uploads_.end() ? nullptr : &found->second;
  }

  void Create(Bytes& input) {
    const int mesh = input.Below(kLengths.size());
    const int lie = input.Below(8);  // about the length or the digest
    v1::CreateUploadRequest request;
    request.set_total_bytes(kLengths[static_cast<std::size_t>(mesh)] - (lie == 1 ? input.Byte() : 0));
    request.set_sha256(lie == 2 ? std::string(input.Take(32)) : Sha256(Content(mesh)));
    const auto upload = store_.Create(kCaller, request);
    if (request.total_bytes() <= 0 || request.sha256().size() != 32) {
      return RequireReason(upload.status(), {"REQUEST_INVALID"});
    }
    if (request.total_bytes() > kMaxMeshBytes) return RequireReason(upload.status(), {"MESH_TOO_LARGE"});
    ModelUpload model;
    model.total = request.total_bytes();
    model.sha256 = request.sha256();
    model.used = now_;
    if (!kept_.contains(model.sha256)) {
      int count = 1;
      std::int64_t bytes = model.total;
      for (const auto& [name, other] : uploads_) {
        if (other.complete) continue;
        ++count;
        bytes += other.total;
      }
      if (count > 1 && count > kMaxUploads) return RequireReason(upload.status(), {"QUEUE_FULL"});
      if (count > 1 && bytes > kMaxBytes) return RequireReason(upload.status(), {"STORAGE_FULL"});
    }
    Require(upload.ok(), "an upload that has room is created: " + upload.status().ToString());
    Require(upload->name() == "uploads/" + std::to_string(last_id_), "an upload has a new name");
    uploads_[upload->name()] = model;
    if (kept_.contains(model.sha256)) Complete(upload->name());
    Compare(upload->name(), *upload);
  }

  void Compare(const std::string& name, const v1::Upload& upload) {
    const ModelUpload& model = uploads_.at(name);
    Require(upload.name() == name, "the name asked for");
    Require(upload.total_bytes() == model.total && upload.sha256() == model.sha256, "as it was announced");
    Require(upload.committed_bytes() == model.Committed(), "the bytes that came");
    const absl::Time expires =
        absl::FromUnixSeconds(upload.expire_time().seconds()) + absl::Nanoseconds(upload.expire_time().nanos());
    Require(expires == model.used + kIdleLimit, "the time of its end");
  }

  void Get(const std::string& name) {
    const auto upload = store_.Get(kCaller, name);
    if (Find(name) == nullptr) return RequireReason(upload.status(), {"UPLOAD_NOT_FOUND"});
    Require(upload.ok(), "an upload that is there is found");
    Compare(name, *upload);
  }

  void Delete(const std::string& name) {
    const absl::Status status = store_.Delete(kCaller, name);
    if (Find(name) == nullptr) return RequireReason(status, {"UPLOAD_NOT_FOUND"});
    Require(status.ok(), "an upload that is there can be deleted");
    uploads_.erase(name);
  }

  void Use(const std::string& name) {
    const auto used = store_.Use(kCaller, name);
    ModelUpload* model = Find(name);
    if (model == nullptr) return RequireReason(used.status(), {"UPLOAD_NOT_FOUND"});
    if (!model->complete) return RequireReason(used.status(), {"UPLOAD_INCOMPLETE"});
    Require(used.ok(), "the mesh of a complete upload is there: " + used.status().ToString());
    Require(used->sha256 == model->sha256, "the mesh has the digest that was announced");
    Require(Sha256(used->mesh->bytes()) == model->sha256, "the bytes have the digest that was announced");
    model->used = now_;
  }

  void Write(Bytes& input) {
    const std::string name = Name(input);
    auto& slot = writers_[static_cast<std::size_t>(input.Below(kWriters))];
    Release(slot);
    auto writer = store_.Write(kCaller, name);
    ModelUpload* model = Find(name);
    if (model == nullptr) return RequireReason(writer.status(), {"UPLOAD_NOT_FOUND"});
    if (model->writer != 0 && now_ - model->used < kWriterLimit) {
      return RequireReason(writer.status(), {"UPLOAD_BUSY"});
    }
    Require(writer.ok(), "an upload that nobody writes to can be written to");
    Require(writer->name() == name, "a writer knows its upload");
    model->writer = ++last_writer_;
    model->used = now_;
    slot = Writer{*std::move(writer), name, last_writer_};
  }

  void Release(Bytes& input) { Release(writers_[static_cast<std::size_t>(input.Below(kWriters))]); }

  void Release(std::optional<Writer>& slot) {
    if (!slot.has_value()) return;
    ModelUpload* model = Find(slot->name);
    if (model != nullptr && model->writer == slot->number) model->writer = 0;
    slot.reset();
  }

  void Append(Bytes& input) {
    auto& slot = writers_[static_cast<std::size_t>(input.Below(kWriters))];
    if (!slot.has_value()) return;
    ModelUpload* model = Find(slot->name);
    // Most pieces go on where the upload ends, with the right letter.
    const std::int64_t shift = input.Below(4) == 0 ? input.Byte() - 128 : 0;
    const std::int64_t offset = (model == nullptr ? 0 : model->Committed()) + shift;
    const auto size = static_cast<std::size_t>(input.Below(48));
    const std::string data = input.Below(16) == 0 ? std::string(input.Take(size)) : Fitting(model, size);
    const std::int64_t stored = blobs_.bytes();
    const absl::Status status = slot->real.Append(offset, data);

    if (model == nullptr) return RequireReason(status, {"UPLOAD_NOT_FOUND"});
    if (model->writer != slot->number) return RequireReason(status, {"UPLOAD_BUSY"});
    if (offset < 0) return RequireReason(status, {"REQUEST_INVALID"});
    const std::int64_t end = offset + static_cast<std::int64_t>(data.size());
    if (offset > model->Committed() || end > model->total) return RequireReason(status, {"UPLOAD_OFFSET_MISMATCH"});
    model->used = now_;
    if (end <= model->Committed()) return Require(status.ok(), "bytes that are there may come again");
    const std::string bytes = model->bytes + data.substr(static_cast<std::size_t>(model->Committed() - offset));
    if (end < model->total) {
      Require(status.ok(), "a piece that goes on is taken: " + status.ToString());
      model->bytes = bytes;
      return;
    }
    if (Sha256(bytes) != model->sha256) {
      uploads_.erase(slot->name);
      return RequireReason(status, {"DIGEST_MISMATCH"});
    }
    if (!kept_.contains(model->sha256) && stored + model->total > kStoreBytes) {
      return RequireReason(status, {"STORAGE_FULL"});
    }
    Require(status.ok(), "the last piece makes an upload complete: " + status.ToString());
    kept_.insert(model->sha256);
    Complete(slot->name);
  }

  // What comes next in an upload, if its total is that of a mesh.
  std::string Fitting(const ModelUpload* model, std::size_t size) {
    for (int mesh = 0; model != nullptr && mesh < static_cast<int>(kLengths.size()); ++mesh) {
      if (kLengths[static_cast<std::size_t>(mesh)] == model->total) {
        return std::string(std::min(size, static_cast<std::size_t>(model->total - model->Committed())),
                           static_cast<char>('a' + mesh));
      }
    }
    return std::string(size, 'x');
  }

  void Complete(const std::string& completed) {
    uploads_.at(completed).complete = true;
    const std::string* oldest = nullptr;
    int count = 0;
    for (const auto& [name, upload] : uploads_) {
      if (!upload.complete) continue;
      ++count;
      if (name != completed && (oldest == nullptr || upload.used < uploads_.at(*oldest).used)) oldest = &name;
    }
    if (count > kMaxComplete) uploads_.erase(std::string(*oldest));
  }

  // Time goes by; then upkeep does what it does.
  void Wait(Bytes& input) {
    now_ += absl::Seconds(input.Below(70));
    store_.Tick(now_);
    std::erase_if(uploads_, [this](const auto& upload) { return now_ - upload.second.used >= kIdleLimit; });
    std::set<std::string> used;
    for (const auto& [name, upload] : uploads_) used.insert(upload.sha256);
    for (const std::string& sha256 : kept_) {
      Require(store_.Uses(Own(sha256)) == used.contains(sha256), "meshes of uploads are used, others are not");
    }
    blobs_.Collect([this](const BlobId& id) { return store_.Uses(id); });
    std::erase_if(kept_, [&](const std::string& sha256) { return !used.contains(sha256); });
    for (const std::string& sha256 : kept_) Require(blobs_.Has(Own(sha256)), "meshes that are used are kept");
  }

  absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  int last_id_ = 0;
  int last_writer_ = 0;
  std::map<std::string, ModelUpload> uploads_;
  std::set<std::string> kept_;  // digests of the meshes in blobs_
  BlobCatalog blobs_;
  UploadStore store_;
  std::array<std::optional<Writer>, kWriters> writers_;
};

}  // namespace

FUZZ_TARGET(upload_state_machine, bytes) {
  const MemoryBudget budget(kMemory);
  Machine machine;
  Bytes input(bytes);
  for (int call = 0; call < kMaxCalls && !input.empty(); ++call) machine.Call(input);
  machine.CheckAll();
}

}  // namespace planish::fuzz::upload_state_machine
