#include "core/io/mesh_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <new>
#include <optional>
#include <stdexcept>

#include "absl/strings/ascii.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/io/file_error.h"
#include "core/io/readers.h"

namespace planish {
namespace {

std::optional<MeshFormat> FormatOf(const std::string& path) {
  const std::string extension = absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  if (extension == ".obj") return MeshFormat::kObj;
  if (extension == ".ply") return MeshFormat::kPly;
  if (extension == ".off") return MeshFormat::kOff;
  if (extension == ".stl") return MeshFormat::kStl;
  return std::nullopt;
}

class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  int value() const { return value_; }

 private:
  int value_;
};

// Reads up to the end of the file, however long its size says it is: pipes have none.
absl::Status ReadAll(const std::string& path, int descriptor, std::size_t expected_size, std::string* bytes) {
  std::size_t size = 0;
  while (true) {
    if (size == bytes->size()) bytes->resize(size == 0 ? expected_size + 1 : 2 * size);
    const ssize_t count = ::read(descriptor, bytes->data() + size, bytes->size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return FileUnreadable(path, "cannot read", errno);
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
  }
  bytes->resize(size);
  return absl::OkStatus();
}

absl::StatusOr<PolygonMesh> Parse(MeshFormat format, const std::string& path, const std::string& bytes) {
  switch (format) {
    case MeshFormat::kObj:
      return ReadObj(path, bytes);
    case MeshFormat::kPly:
      return ReadPly(path, bytes);
    case MeshFormat::kOff:
      return ReadOff(path, bytes);
    case MeshFormat::kStl:
      return ReadStl(path, bytes);
  }
  return InternalError("unknown mesh format");
}

// What readers.h promises; a violation is a bug there, which must not become a wild access here.
absl::Status CheckPolygons(const PolygonMesh& mesh) {
  const std::int64_t vertices = static_cast<std::int64_t>(mesh.positions.size());
  bool sound = mesh.polygon_begin.front() == 0 &&
               mesh.polygon_begin.back() == static_cast<std::int64_t>(mesh.corner_vertex.size());
  for (std::int64_t polygon = 0; polygon < mesh.num_polygons(); ++polygon) {
    sound &= mesh.polygon_begin[polygon + 1] - mesh.polygon_begin[polygon] >= 3;
  }
  for (const std::int32_t vertex : mesh.corner_vertex) sound &= vertex >= 0 && vertex < vertices;
  return sound ? absl::OkStatus() : InternalError("a mesh file was read into polygons that are not valid");
}

absl::StatusOr<MeshFile> ReadMeshFileOrThrow(const std::string& path) {
  const Descriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.value() < 0) return FileUnreadable(path, "cannot open", errno);
  struct stat status;
  if (::fstat(descriptor.value(), &status) != 0) return FileUnreadable(path, "cannot open", errno);
  if (S_ISDIR(status.st_mode)) return FileUnreadable(path, "cannot read", EISDIR);

  const std::optional<MeshFormat> format = FormatOf(path);
  if (!format) {
    return MakeError(absl::StatusCode::kInvalidArgument, "FILE_FORMAT_UNKNOWN",
                     path + ": unknown file format: the name must end in .obj, .ply, .off or .stl", {{"path", path}});
  }
  MeshFile file;
  file.path = path;
  file.format = *format;
  PLANISH_RETURN_IF_ERROR(ReadAll(path, descriptor.value(), static_cast<std::size_t>(status.st_size), &file.bytes));
  PLANISH_ASSIGN_OR_RETURN(file.mesh, Parse(file.format, path, file.bytes));
  PLANISH_RETURN_IF_ERROR(CheckPolygons(file.mesh));
  return file;
}

absl::Status OutOfMemory(const std::string& path) {
  return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", path + ": not enough memory to read the file",
                   {{"path", path}});
}

}  // namespace

absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path) {
  try {
    return ReadMeshFileOrThrow(path);
  } catch (const std::bad_alloc&) {
    return OutOfMemory(path);
  } catch (const std::length_error&) {
    return OutOfMemory(path);
  }
}

}  // namespace planish
