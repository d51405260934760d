// From the UV bytes of a job to numbers, after checking that they are what they should be.
#pragma once

#include <string>

#include "client/src/mesh_packer.h"
#include "planish/v1/job.pb.h"

namespace planish {
inline namespace abi0 {

// Throws MESH_MISMATCH if the UV belong to another mesh than `mesh`, UV_CORRUPT if size or SHA-256 are wrong.
Uv ParseUv(const v1::UvDescription& description, const std::string& bytes, const PackedMesh& mesh);

}  // namespace abi0
}  // namespace planish
