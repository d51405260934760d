// Small meshes and the same mesh in every file format, for the tests of this folder.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "client/files/mesh_file.h"
#include "client/files/polygon_mesh.h"
#include "core/mesh/mesh.h"
#include "tests/testing/files.h"

namespace planish {

// Five vertices (exact in float), three triangles; no vertex without a face.
PolygonMesh SamplePolygons();

// SamplePolygons() as a file. Vertices come in the order in which faces name them, so that STL has the same order.
std::string SampleObj();
std::string SamplePlyAscii();
std::string SamplePlyBinary(bool big_endian);
std::string SampleOff();
std::string SampleStlAscii();
std::string SampleStlBinary();

// Little-endian bytes of a value.
std::string Bytes(float value);
std::string Bytes(std::int32_t value);

// "reason" of planish::ErrorInfo.
std::string Reason(const absl::Status& status);

// The file `name` in the test's own temporary folder.
std::string TemporaryPath(const std::string& name);

// `text` as an OBJ that was read under the name "in.obj"; fails the test if it cannot be read.
MeshFile ReadObjText(const std::string& text);

}  // namespace planish
