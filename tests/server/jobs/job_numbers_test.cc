// What belongs to corners and faces of a mesh, and travels beside it.
#include <functional>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

using ::testing::SizeIs;

TEST_F(JobManagerTest, AtlasesAndWeightsTravelBehindTheSeams) {
  options_.max_mesh_bytes = 28;
  Restart();
  JobRequest request = Request();
  request.bytes = "mesh";
  request.seam_corners = {5};
  request.face_atlas = {3, 0};
  request.face_weights = {1};
  const auto accepted = manager_->Create(caller_, request);
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  EXPECT_EQ(accepted->job.mesh_bytes(), 20);
  const auto assignment = TakeNext();
  EXPECT_EQ(assignment->request.face_atlases(), 2);
  EXPECT_EQ(assignment->request.face_weights(), 1);
  ASSERT_THAT(assignment->blobs, SizeIs(2));
  EXPECT_EQ(assignment->blobs[1]->bytes(), std::string("\5\0\0\0\3\0\0\0\0\0\0\0\0\0\x80\x3f", 16));

  const auto refused = [&](const std::function<void(JobRequest*)>& change) {
    JobRequest bad = Request();
    bad.bytes = "mesh";
    bad.face_atlas = {0, 1};
    bad.face_weights = {1, 2};
    change(&bad);
    const ErrorInfo info = ErrorInfoOf(manager_->Create(caller_, bad).status());
    EXPECT_EQ(info.reason, "OPTIONS_INVALID");
    const auto face = info.metadata.find("face");
    return info.metadata.at("field") + (face == info.metadata.end() ? "" : " " + face->second);
  };
  EXPECT_EQ(refused([](JobRequest* r) { r->face_atlas[1] = -1; }), "face_atlas 1");
  EXPECT_EQ(refused([](JobRequest* r) { r->face_atlas[1] = 100; }), "face_atlas 1");
  EXPECT_EQ(refused([](JobRequest* r) { r->face_atlas[1] = 25, r->options.set_tiles(4); }), "face_atlas 1");
  EXPECT_EQ(refused([](JobRequest* r) { r->options.set_pack(v1::PACK_OFF); }), "face_atlas");
  EXPECT_EQ(refused([](JobRequest* r) { r->options.set_seams(v1::SEAMS_NONE); }), "face_atlas");
  EXPECT_EQ(refused([](JobRequest* r) { r->face_weights[0] = 0.001F; }), "face_weights 0");
  EXPECT_EQ(refused([](JobRequest* r) { r->array_vertices = 0, r->bytes = std::string(12, '\0'); }), "face_atlas")
      << "of one triangle";
}

}  // namespace
}  // namespace planish
