// What a job says of the elements of its mesh (planish.v1.MeshElements), in a worker.
#include <cstdint>
#include <string>
#include <vector>

#include "core/draco/codec.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/link/mesh_elements.h"
#include "server/link/rpc_status.h"
#include "server/worker/work.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {



struct ElementsJob {
  worker::v1::WorkRequest request;
  std::vector<BlobPtr> blobs;
};

ElementsJob OfBump() {  // 32 faces
  ElementsJob job;
  job.request.set_job("jobs/1");
  job.blobs = {*Blob::Copy(*EncodeDraco(Bump(4)))};
  return job;
}

void SetElements(const v1::MeshElements& elements, ElementsJob* job) {
  job->blobs.resize(1);
  job->blobs.push_back(*Blob::Copy(elements.SerializeAsString()));
}

void SetCorners(const std::vector<std::int32_t>& seams, const std::vector<std::int32_t>& uncut, ElementsJob* job) {
  v1::MeshElements elements;
  elements.set_seam_corners(PackNumbers<std::int32_t>(seams));
  elements.set_uncut_corners(PackNumbers<std::int32_t>(uncut));
  SetElements(elements, job);
}

worker::v1::WorkResult ResultOf(const ElementsJob& job) {
  return DoWork(job.request, job.blobs, {}).result;
}

std::string ReasonOf(const ElementsJob& job) {
  return planish::ReasonOf(ResultOf(job).status());
}

TEST(WorkElements, SeamCornersBeyondTheMeshAreRefusedByNumber) {
  ElementsJob job = OfBump();
  SetCorners({95}, {}, &job);
  EXPECT_EQ(ResultOf(job).status().code(), 0);
  for (const int corner : {96, -1}) {
    SetCorners({95, corner}, {}, &job);
    const worker::v1::WorkResult result = ResultOf(job);
    EXPECT_EQ(result.status().code(), static_cast<int>(absl::StatusCode::kInvalidArgument));
    google::rpc::ErrorInfo info;
    ASSERT_TRUE(result.status().details(0).UnpackTo(&info));
    EXPECT_EQ(info.reason(), "OPTIONS_INVALID");
    EXPECT_EQ(info.metadata().at("field"), "elements.seam_corners");
    EXPECT_EQ(info.metadata().at("corner"), std::to_string(static_cast<std::uint32_t>(corner)));
    ElementsJob uncut = OfBump();
    SetCorners({}, {corner}, &uncut);
    EXPECT_EQ(ReasonOf(uncut), "OPTIONS_INVALID") << corner;
  }
}

TEST(WorkElements, AtlasesAndWeightsAreThoseOfTheElements) {
  ElementsJob job = OfBump();
  std::vector<std::int32_t> atlases;
  std::vector<float> weights;
  for (int f = 0; f < 32; ++f) {
    atlases.push_back(f < 16 ? 0 : 4);
    weights.push_back(f < 16 ? 1.0F : 2.0F);
  }
  v1::MeshElements elements;
  elements.set_seam_corners(PackNumbers<std::int32_t>(std::vector{95}));
  elements.set_face_atlas(PackNumbers<std::int32_t>(atlases));
  elements.set_face_weights(PackNumbers<float>(weights));
  SetElements(elements, &job);
  const worker::v1::WorkResult result = ResultOf(job);
  ASSERT_EQ(result.status().code(), 0) << result.status().message();
  const v1::Atlas& atlas = result.report().atlas();
  EXPECT_EQ(atlas.layout(), v1::ATLAS_LAYOUT_UDIM);
  ASSERT_EQ(atlas.atlases_size(), 2);
  EXPECT_EQ(atlas.atlases(1).atlas(), 4);
  EXPECT_EQ(atlas.atlases(1).first_tile(), 4);
  EXPECT_EQ(atlas.atlases(1).triangles(), 16);
  EXPECT_GE(atlas.atlases(1).charts(), 1);
  EXPECT_GT(atlas.atlases(1).packing_efficiency(), 2 * atlas.atlases(0).packing_efficiency()) << "of twice the weight";
  EXPECT_EQ(atlas.tiles(), 5);

  elements.mutable_face_atlas()->append(4, '\0');
  SetElements(elements, &job);
  EXPECT_EQ(ReasonOf(job), "OPTIONS_INVALID") << "one too many";
}

TEST(WorkElements, PolygonsStayWholeAndShareAnAtlas) {
  ElementsJob job = OfBump();  // 16 quads of two
  std::vector<std::int32_t> polygon, atlas(32, 0);
  for (int f = 0; f < 32; ++f) polygon.push_back(f / 2);
  v1::MeshElements elements;
  elements.set_face_polygon(PackNumbers<std::int32_t>(polygon));
  SetElements(elements, &job);
  EXPECT_EQ(ResultOf(job).status().code(), 0);
  // Corner 1 of face 0 may face the diagonal or an edge; one of three does.
  int refused = 0;
  for (const std::int32_t corner : {0, 1, 2}) {
    elements.set_seam_corners(PackNumbers<std::int32_t>(std::vector{corner}));
    SetElements(elements, &job);
    refused += ReasonOf(job) == "OPTIONS_INVALID";
  }
  EXPECT_EQ(refused, 1);
  elements.clear_seam_corners();
  atlas[1] = 1;
  elements.set_face_atlas(PackNumbers<std::int32_t>(atlas));
  SetElements(elements, &job);
  EXPECT_EQ(ReasonOf(job), "OPTIONS_INVALID") << "a polygon in two atlases";
}

}  // namespace
}  // namespace planish
