#include "server/blobs/directory_blobs.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "openssl/rand.h"
#include "server/access/caller.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

constexpr char kTemporary[] = "new-";
constexpr char kLockFile[] = "lock";
// Prefix of the folder of a tenant's blobs. Blobs of the default tenant, once the only tenant, have no such folder.
constexpr char kTenantFolder[] = "tenant-";

// A temporary file of a shared directory is garbage after this time without a write.
constexpr absl::Duration kLeftOver = absl::Hours(24);

// The tenant of the blob with this path, relative to the store's directory.
std::string TenantOf(const fs::path& path) {
  const std::string top = path.begin()->string();
  return top.starts_with(kTenantFolder) ? top.substr(sizeof(kTenantFolder) - 1) : kDefaultTenant;
}

std::string VersionOf(const struct stat& file) {
  return absl::StrCat(file.st_ino, ":", file.st_size);
}

absl::Time ModifiedAt(const struct stat& file) {
  return absl::TimeFromTimespec(file.st_mtim);
}

// The stat(2) of a file; nullopt if there is no such file.
absl::StatusOr<std::optional<struct stat>> StatOf(const std::string& path) {
  struct stat file = {};
  if (stat(path.c_str(), &file) == 0) return file;
  if (errno == ENOENT || errno == ENOTDIR) return std::nullopt;
  return FileError("examine", path, errno);
}

absl::StatusOr<std::string> NewTemporaryName() {
  std::string random(8, '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(random.data()), static_cast<int>(random.size())) != 1) {
    return InternalError("the crypto library has no random bytes");
  }
  return kTemporary + absl::BytesToHexString(random);
}

}  // namespace

class DirectoryBlobStore::ShardLock {
 public:
  static absl::StatusOr<ShardLock> Take(DirectoryBlobStore* store, const BlobId& id) {
    const auto shard = static_cast<unsigned char>(id.sha256.empty() ? 0 : id.sha256[0]);
    ShardLock taken(std::unique_lock(store->shards_[shard]));
    if (store->lock_file_.get() < 0) return taken;
    if (const int error = Lock(store->lock_file_.get(), shard, F_WRLCK); error != 0) {
      return FileError("lock", absl::StrCat(store->options_.directory, "/", kLockFile), error);
    }
    taken.file_ = store->lock_file_.get();
    taken.shard_ = shard;
    return taken;
  }

  ShardLock(ShardLock&& other) noexcept
      : mutex_(std::move(other.mutex_)), file_(std::exchange(other.file_, -1)), shard_(other.shard_) {}
  ~ShardLock() {
    if (file_ >= 0) Lock(file_, shard_, F_UNLCK);
  }

 private:
  explicit ShardLock(std::unique_lock<std::mutex> mutex) : mutex_(std::move(mutex)) {}

  // Returns 0 or an errno. The lock belongs to the open file, so two stores of one process exclude each other too.
  static int Lock(int fd, int shard, short type) {
    struct flock range = {};
    range.l_type = type;
    range.l_whence = SEEK_SET;
    range.l_start = shard;
    range.l_len = 1;
    while (fcntl(fd, F_OFD_SETLKW, &range) != 0) {
      if (errno != EINTR) return errno;
    }
    return 0;
  }

  std::unique_lock<std::mutex> mutex_;
  int file_ = -1;
  int shard_ = 0;
};

// ---- setting up

absl::StatusOr<std::unique_ptr<DirectoryBlobStore>> DirectoryBlobStore::Make(DirectoryBlobsOptions options) {
  std::unique_ptr<DirectoryBlobStore> store(new DirectoryBlobStore(std::move(options)));
  PLANISH_RETURN_IF_ERROR(store->SetUp());
  return store;
}

absl::Status DirectoryBlobStore::SetUp() {
  const std::string& directory = options_.directory;
  if (options_.shared) {
    const std::string path = absl::StrCat(directory, "/", kLockFile);
    if (const int error = options_.files->Open(path, O_RDWR | O_CREAT, &lock_file_); error != 0) {
      return FileError("open", path, -error);
    }
  }
  PLANISH_ASSIGN_OR_RETURN(const absl::Time now, Now());
  std::error_code error;
  std::vector<std::string> folders = {directory};
  std::vector<std::string> left_over;
  for (fs::recursive_directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;  // another process may remove its own files
    if (entry->is_directory(gone)) folders.push_back(entry->path());
    if (!entry->path().filename().string().starts_with(kTemporary)) continue;
    PLANISH_ASSIGN_OR_RETURN(const auto file, StatOf(entry->path()));
    if (!file.has_value() || (options_.shared && now - ModifiedAt(*file) < kLeftOver)) continue;
    left_over.push_back(entry->path());
  }
  if (error) return FileError("read", directory, error.value());
  for (const std::string& path : left_over) options_.files->Remove(path);
  for (const std::string& folder : folders) PLANISH_RETURN_IF_ERROR(SyncFolder(options_.files, folder));
  return absl::OkStatus();
}

std::string DirectoryBlobStore::FolderOf(const BlobId& id) const {
  const std::string tenant = id.tenant == kDefaultTenant ? "" : absl::StrCat("/", kTenantFolder, id.tenant);
  return absl::StrCat(options_.directory, tenant, "/", absl::BytesToHexString(id.sha256.substr(0, 1)));
}

std::string DirectoryBlobStore::PathOf(const BlobId& id) const {
  return absl::StrCat(FolderOf(id), "/", absl::BytesToHexString(id.sha256));
}

absl::StatusOr<absl::Time> DirectoryBlobStore::Now() const {
  if (lock_file_.get() < 0) return absl::Now();
  struct stat file = {};
  if (futimens(lock_file_.get(), nullptr) != 0 || fstat(lock_file_.get(), &file) != 0) {
    return FileError("touch", absl::StrCat(options_.directory, "/", kLockFile), errno);
  }
  return ModifiedAt(file);
}

// ---- writing

absl::Status DirectoryBlobStore::WriteFile(const std::string& path, std::string_view bytes) {
  FileLayer* const files = options_.files;
  Descriptor file;
  int error = files->Open(path, O_WRONLY | O_CREAT | O_EXCL, &file);
  if (error != 0) return FileError("create", path, -error);
  const char* what = "write";
  for (std::int64_t offset = 0; error == 0 && !bytes.empty();) {
    const ssize_t count = files->Write(file.get(), bytes.data(), bytes.size(), offset);
    if (count < 0) {
      error = static_cast<int>(count);
    } else {
      bytes.remove_prefix(static_cast<std::size_t>(count));
      offset += count;
    }
  }
  if (error == 0) {
    what = "sync";
    error = files->Sync(file.get());
  }
  if (error == 0) return absl::OkStatus();
  files->Remove(path);  // an incomplete file is removed
  return FileError(what, path, -error);
}

absl::StatusOr<std::string> DirectoryBlobStore::PutNew(const BlobId& id, std::string_view bytes) {
  PLANISH_ASSIGN_OR_RETURN(const std::string name, NewTemporaryName());
  const std::string temporary = absl::StrCat(options_.directory, "/", name);
  PLANISH_RETURN_IF_ERROR(WriteFile(temporary, bytes));
  absl::StatusOr<std::string> version = Install(id, temporary);
  if (!version.ok()) options_.files->Remove(temporary);
  return version;
}

absl::StatusOr<std::string> DirectoryBlobStore::PutNewFile(const BlobId& id, const std::string& path) {
  Descriptor file;
  if (const int error = options_.files->Open(path, O_RDONLY, &file); error != 0) {
    return FileError("open", path, -error);
  }
  if (const int error = options_.files->Sync(file.get()); error != 0) return FileError("sync", path, -error);
  return Install(id, path);
}

absl::StatusOr<std::string> DirectoryBlobStore::Install(const BlobId& id, const std::string& path) {
  FileLayer* const files = options_.files;
  const std::string folder = FolderOf(id);
  if (id.tenant != kDefaultTenant) {
    PLANISH_RETURN_IF_ERROR(MakeDurableFolder(files, folder.substr(0, folder.rfind('/'))));
  }
  PLANISH_RETURN_IF_ERROR(MakeDurableFolder(files, folder));
  Descriptor opened;  // opened first, so that a lack of descriptors cannot interrupt the steps below
  if (const int error = files->Open(folder, O_RDONLY | O_DIRECTORY, &opened); error != 0) {
    return FileError("open", folder, -error);
  }
  PLANISH_ASSIGN_OR_RETURN(const ShardLock lock, ShardLock::Take(this, id));
  if (const int error = files->Rename(path, PathOf(id)); error != 0) return FileError("create", PathOf(id), -error);
  absl::Status status;
  if (const int error = files->Sync(opened.get()); error != 0) {
    status = FileError("sync", folder, -error);
  } else if (const int touched = options_.shared ? files->Touch(PathOf(id)) : 0; touched != 0) {
    status = FileError("touch", PathOf(id), -touched);
  }
  struct stat file = {};
  if (status.ok() && stat(PathOf(id).c_str(), &file) != 0) status = FileError("examine", PathOf(id), errno);
  if (status.ok()) return VersionOf(file);
  files->Rename(PathOf(id), path);
  return status;
}

// ---- reading

absl::StatusOr<BlobStore::Found> DirectoryBlobStore::OpenUnverified(const BlobId& id) {
  const std::string path = PathOf(id);
  Descriptor file;
  if (const int error = options_.files->Open(path, O_RDONLY, &file); error == -ENOENT || error == -ENOTDIR) {
    return BlobNotFound(id);
  } else if (error != 0) {
    return FileError("open", path, -error);
  }
  struct stat status = {};
  if (fstat(file.get(), &status) != 0) return FileError("examine", path, errno);
  return Found{StoredBlob::InFile(options_.files, std::move(file), status.st_size), VersionOf(status)};
}

absl::StatusOr<bool> DirectoryBlobStore::Has(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const auto file, StatOf(PathOf(id)));
  return file.has_value();
}

absl::StatusOr<bool> DirectoryBlobStore::Renew(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const bool is_there, Has(id));
  if (!is_there) return false;
  PLANISH_ASSIGN_OR_RETURN(const ShardLock lock, ShardLock::Take(this, id));
  if (const int error = options_.files->Touch(PathOf(id)); error == -ENOENT || error == -ENOTDIR) {
    return false;
  } else if (error != 0) {
    return FileError("touch", PathOf(id), -error);
  }
  // In a shared directory, the process that put the blob may have ended before it synced the folder. In an unshared
  // one, SetUp() has synced the folders of earlier processes.
  if (options_.shared) PLANISH_RETURN_IF_ERROR(SyncFolder(options_.files, FolderOf(id)));
  return true;
}

absl::Status DirectoryBlobStore::List(const std::function<void(const BlobEntry&)>& visit) {
  PLANISH_ASSIGN_OR_RETURN(const absl::Time now, Now());
  std::error_code error;
  fs::recursive_directory_iterator entry(options_.directory, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename();
    if (name.size() != 2 * kSha256Bytes) continue;
    PLANISH_ASSIGN_OR_RETURN(const auto file, StatOf(entry->path()));
    if (!file.has_value() || !S_ISREG(file->st_mode)) continue;
    const std::string tenant = TenantOf(entry->path().lexically_relative(options_.directory));
    visit({{tenant, absl::HexStringToBytes(name)}, file->st_size, now - ModifiedAt(*file)});
  }
  if (error) return FileError("read", options_.directory, error.value());
  return absl::OkStatus();
}

// ---- removing

absl::StatusOr<bool> DirectoryBlobStore::Remove(const BlobId& id, absl::Duration min_age) {
  const std::string path = PathOf(id);
  PLANISH_ASSIGN_OR_RETURN(const ShardLock lock, ShardLock::Take(this, id));
  if (min_age > absl::ZeroDuration()) {
    PLANISH_ASSIGN_OR_RETURN(const auto file, StatOf(path));
    if (!file.has_value()) return true;
    PLANISH_ASSIGN_OR_RETURN(const absl::Time now, Now());
    if (now - ModifiedAt(*file) < min_age) return false;
  }
  const int error = options_.files->Remove(path);
  if (error != 0 && error != -ENOENT && error != -ENOTDIR) return FileError("remove", path, -error);
  return true;
}

absl::Status DirectoryBlobStore::Drop(const BlobId& id, const std::string& version) {
  const std::string path = PathOf(id);
  PLANISH_ASSIGN_OR_RETURN(const ShardLock lock, ShardLock::Take(this, id));
  PLANISH_ASSIGN_OR_RETURN(const auto file, StatOf(path));
  // If there is no such version, another process has dropped it, and may have put good bytes in its place.
  if (!file.has_value() || VersionOf(*file) != version) return absl::OkStatus();
  const int error = options_.files->Remove(path);
  return error == 0 || error == -ENOENT ? absl::OkStatus() : FileError("remove", path, -error);
}

}  // namespace planish
