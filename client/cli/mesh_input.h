// The mesh file a command works on, and the way from what the server says to its lines.
#pragma once

#include <string>

#include "client/src/element_ids.h"
#include "core/io/mesh_file.h"
#include "planish/client.h"

namespace planish::cli {

class MeshInput {
 public:
  // Throws planish::Error: FILE_UNREADABLE, FILE_FORMAT_UNKNOWN, FILE_UNSUPPORTED, FILE_MALFORMED.
  explicit MeshInput(const std::string& path, const ReadOptions& options = {});

  const std::string& path() const { return file_.path; }
  const MeshFile& file() const { return file_; }
  const Triangulation& triangulation() const { return triangulation_; }
  // As sent; lives as long as this object.
  MeshView view() const;

  // The error in the file's own ids, 0-based: faces and vertices as the file counts them.
  Error InFileIds(const Error& error) const;
  Warning InFileIds(const Warning& warning) const;
  // "face 12 (in.obj:345), vertex 7 (in.obj:8)" for the elements that `metadata` (in file ids) names; empty if it
  // names none or the file has no lines.
  std::string Places(const std::map<std::string, std::string>& metadata) const;

  // The file with UV; `uv` in the order of view().
  std::string WithUv(const Uv& uv) const;
  // A PNG file that shows the map (core/io/map_picture.h); angles in degrees.
  std::string Picture(const Uv& uv, double azimuth, double elevation) const;

 private:
  ids::Renumbering ToFile() const;

  MeshFile file_;
  Triangulation triangulation_;
};

// Throws planish::Error (FILE_UNWRITABLE).
void WriteOutput(const std::string& path, const std::string& bytes);
// Whether WriteOutput has a chance; throws FILE_UNWRITABLE if not, before minutes are spent on a solve.
void CheckOutput(const std::string& path);

}  // namespace planish::cli
