// What belongs to the elements of a mesh, and travels beside it.
#include <functional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/link/mesh_elements.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

std::string Bytes(const std::vector<std::int32_t>& numbers) {
  return PackNumbers<std::int32_t>(numbers);
}

std::string Floats(const std::vector<float>& numbers) {
  return PackNumbers<float>(numbers);
}

TEST_F(JobManagerTest, ElementsTravelBesideTheMeshAndCountAsPartOfIt) {
  options_.max_mesh_bytes = 32;
  Restart();
  JobRequest request = Request();
  request.bytes = "mesh";
  request.elements.set_seam_corners(Bytes({5}));
  request.elements.set_uncut_corners(Bytes({2}));
  request.elements.set_face_polygon(Bytes({0, 0}));
  request.elements.set_face_atlas(Bytes({3, 0}));
  request.elements.set_face_weights(Floats({1}));
  const auto accepted = manager_->Create(caller_, request);
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  EXPECT_EQ(accepted->job.mesh_bytes(), 32);
  const auto assignment = TakeNext();
  ASSERT_THAT(assignment->blobs, SizeIs(2));
  v1::MeshElements sent;
  ASSERT_TRUE(sent.ParseFromString(std::string(assignment->blobs[1]->bytes())));
  EXPECT_EQ(sent.seam_corners(), std::string("\5\0\0\0", 4));
  EXPECT_EQ(sent.face_weights(), std::string("\0\0\x80\x3f", 4));
  EXPECT_THAT(DecodeMeshElements(sent, {}, std::nullopt)->face_atlas, ElementsAre(3, 0));

  request.elements.mutable_seam_corners()->append(4, '\0');
  EXPECT_EQ(Reason(manager_->Create(caller_, request).status()), "MESH_TOO_LARGE");
}

TEST_F(JobManagerTest, ElementsOutOfRangeAreRefusedAtOnce) {
  const auto refused = [&](const std::function<void(JobRequest*)>& change) {
    JobRequest bad = Request();
    bad.bytes = "mesh";
    bad.elements.set_face_atlas(Bytes({0, 1}));
    bad.elements.set_face_weights(Floats({1, 2}));
    change(&bad);
    const ErrorInfo info = ErrorInfoOf(manager_->Create(caller_, bad).status());
    EXPECT_EQ(info.reason, "OPTIONS_INVALID");
    std::string where = info.metadata.at("field");
    for (const char* key : {"face", "corner"}) {
      if (const auto id = info.metadata.find(key); id != info.metadata.end()) where += " " + id->second;
    }
    return where;
  };
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_seam_corners(Bytes({5, -3})); }),
            "elements.seam_corners 4294967293");
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_uncut_corners(Bytes({-4})); }),
            "elements.uncut_corners 4294967292");
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_seam_corners("abc"); }), "elements.seam_corners");
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_face_polygon(Bytes({1, 2})); }), "elements.face_polygon 1");
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_face_atlas(Bytes({0, -1})); }), "elements.face_atlas 1");
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_face_atlas(Bytes({0, 100})); }), "elements.face_atlas 1");
  EXPECT_EQ(refused([](JobRequest* r) {
              r->elements.set_face_atlas(Bytes({0, 25}));
              r->options.set_tiles(4);
            }),
            "elements.face_atlas 1");
  EXPECT_EQ(refused([](JobRequest* r) { r->options.set_pack(v1::PACK_OFF); }), "elements.face_atlas");
  EXPECT_EQ(refused([](JobRequest* r) { r->options.set_seams(v1::SEAMS_NONE); }), "elements.face_atlas");
  EXPECT_EQ(refused([](JobRequest* r) { r->elements.set_face_weights(Floats({0.001F, 1})); }), "elements.face_weights 0");
  EXPECT_EQ(refused([](JobRequest* r) { r->array_vertices = 0, r->bytes = std::string(12, '\0'); }),
            "elements.face_atlas")
      << "of one triangle";
}

}  // namespace
}  // namespace planish
