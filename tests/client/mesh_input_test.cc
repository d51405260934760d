// Several files as one mesh, and their results.
#include "client/cli/mesh_input.h"

#include <filesystem>
#include <functional>

#include "client/src/errors.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kSquare[] =
    "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl a\nf 2/1 3/2 4/3\nf 2 4 5\n";
constexpr char kQuad[] = "v 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvt 0.5 0.5\nusemtl a\nf 1/1 2/1 3/1 4/1\n";

class MeshInputs : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(directory_ / "out"); }
  std::string File(const std::string& name, const std::string& bytes) const {
    fs::create_directories((directory_ / name).parent_path());
    PutFile(directory_ / name, bytes);
    return (directory_ / name).string();
  }
  static std::string Reason(const std::function<void()>& action) {
    try {
      action();
    } catch (const Error& error) {
      return error.reason();
    }
    return "";
  }

  const TempDir temporary_;
  const fs::path directory_ = temporary_.Path();
};

TEST_F(MeshInputs, TravelAsOneMesh) {
  const MeshInput input({File("a.obj", kSquare), File("b.obj", kQuad)});
  EXPECT_EQ(input.view().vertex_count(), 8);
  EXPECT_EQ(input.view().triangle_count(), 4);
  EXPECT_EQ(input.CornerTexcoords(), (std::vector<std::int32_t>{0, 1, 2, -1, -1, -1, 3, 3, 3, 3, 3, 3}));
  EXPECT_EQ(input.CornerUv()[4], 1);
  EXPECT_EQ(input.CornerUv()[13], 0.5);
  EXPECT_EQ(input.FaceMaterials(), (std::vector<std::int32_t>{0, 0, 1, 1}));
}

TEST_F(MeshInputs, NameTheFileAtFault) {
  const MeshInput input({File("a.obj", kSquare), File("b.obj", kQuad)});
  const Error sent(ErrorCode::kInvalidArgument, "X", "2 faults", {{"faces", "3"}, {"vertices", "4"}});
  const Error told = input.InFileIds(sent);
  EXPECT_STREQ(told.what(), "2 faults");
  EXPECT_EQ(Places(told.metadata(), &input), "face 2 (face 0 of b.obj, line 7), vertex 5 (vertex 0 of b.obj, line 1)");
  const MeshInput one(File("a.obj", kSquare));
  const Error of_one = one.InFileIds(Error(ErrorCode::kInvalidArgument, "X", "fault", {{"vertices", "0"}}));
  EXPECT_EQ(Places(of_one.metadata(), &one), "vertex 1 (a.obj:2)");
  EXPECT_EQ(ErrorLine(of_one, &one), "fault [X], at vertex 1 (a.obj:2)");
}

TEST_F(MeshInputs, NameElementsOfFilesWithoutLines) {
  const MeshInput stl(File("a.stl",
                           "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                           "endloop\nendfacet\nendsolid\n"));
  const Error::Metadata metadata = {{"count", "9"}, {"edges", "0-1"}, {"faces", "0"}};
  EXPECT_EQ(Places({{"count", "9"}}), "");
  EXPECT_EQ(Places({{"edges", "3-4"}, {"count", "1"}}), "vertex 3, vertex 4");
  EXPECT_EQ(Places({{"faces", "3,5,6,7,8"}}), "face 3, face 5, face 6, face 7, ...") << "of a file that is not at hand";
  EXPECT_THAT(Places(metadata, &stl), ::testing::StartsWith("face 0"));
  EXPECT_EQ(ErrorLine(Error(ErrorCode::kInvalidArgument, "X", "fault")), "fault [X]");
}

TEST_F(MeshInputs, GetTheirOwnPartOfTheUv) {
  const MeshInput input({File("a.obj", kSquare), File("b.obj", kQuad)});
  std::vector<float> numbers;
  for (int c = 0; c < 12; ++c) {
    numbers.push_back(static_cast<float>(c) / 16);
    numbers.push_back(c >= 9 ? 0.75f : 0.25f);
  }
  const std::string out = (directory_ / "out").string();
  const WrittenMesh written = input.WithUv(Uv(std::move(numbers)), input.Outputs(out, 0, 0, {}));
  ASSERT_EQ(written.files.size(), 2u);
  EXPECT_EQ(written.files[0].path, out + "/a.obj");
  EXPECT_NE(written.files[0].bytes.find("vt 0.3125 0.25\n"), std::string::npos) << written.files[0].bytes;
  EXPECT_EQ(written.files[0].bytes.find("vt 0.375"), std::string::npos);
  EXPECT_NE(written.files[1].bytes.find("vt 0.6875 0.75\n"), std::string::npos) << written.files[1].bytes;
}

TEST_F(MeshInputs, OutputsAreCheckedBeforehand) {
  const MeshInput one(File("a.obj", kSquare));
  const MeshInput two({File("a.obj", kSquare), File("sub/a.obj", kQuad)});
  const std::string out = (directory_ / "out").string();
  EXPECT_EQ(one.Outputs(out + "/x.GLB", 0, 0, {})[0].format, MeshFormat::kGlb);
  EXPECT_EQ(one.Outputs("-", 0, 0, {})[0].format, MeshFormat::kObj);
  EXPECT_EQ(one.Outputs(out, 0, 0, {})[0].path, out + "/a.obj");
  EXPECT_EQ(Reason([&] { one.Outputs(out + "/x.stl", 0, 0, {}); }), "OUTPUT_UNSUPPORTED");
  EXPECT_EQ(Reason([&] { one.Outputs(out + "/x.txt", 0, 0, {}); }), "OUTPUT_UNSUPPORTED");
  EXPECT_EQ(Reason([&] { one.Outputs(out + "/x.obj", 0, 1, {}); }), "OUTPUT_UNSUPPORTED");
  EXPECT_EQ(one.Outputs(out + "/new/", 0, 0, {})[0].path, out + "/new/a.obj");
  EXPECT_TRUE(std::filesystem::is_directory(out + "/new"));
  EXPECT_EQ(Reason([&] { one.Outputs(out + "/none/x.obj", 0, 0, {}); }), "FILE_UNWRITABLE");
  EXPECT_EQ(Reason([&] { one.Outputs((directory_ / "a.obj/new/").string(), 0, 0, {}); }), "FILE_UNWRITABLE");
  EXPECT_EQ(Reason([&] { two.Outputs(out + "/x.obj", 0, 0, {}); }), "OUTPUT_UNSUPPORTED");
  EXPECT_EQ(Reason([&] { two.Outputs(out, 0, 0, {}); }), "OUTPUT_UNSUPPORTED") << "both are a.obj";
}

TEST(ElementIdsTest, MetadataKeepsWhatIsNoId) {
  ids::Renumbering plus;
  plus.vertex = [](std::int64_t v) { return v == 9 ? -1 : v + 100; };
  plus.face = [](std::int64_t f) { return f + 1000; };
  const Error::Metadata metadata = {{"count", "82"},      {"face", "3"},   {"faces", "1,2"},    {"edge", "1-2"},
                                    {"edges", "3-4,5-6"}, {"vertex", "7"}, {"vertices", "5,9"}, {"genus", "1"}};
  const Error::Metadata moved = {{"count", "82"},
                                 {"face", "1003"},
                                 {"faces", "1001,1002"},
                                 {"edge", "101-102"},
                                 {"edges", "103-104,105-106"},
                                 {"vertex", "107"},
                                 {"vertices", "105,9"},
                                 {"genus", "1"}};
  EXPECT_EQ(ids::RenumberMetadata(metadata, plus), moved);
  ids::Renumbering halves;
  halves.face = [](std::int64_t f) { return f / 2; };
  EXPECT_EQ(ids::RenumberMetadata({{"faces", "6,7,12,1,13"}}, halves).at("faces"), "3,6,0") << "each once";
  const Error error = Renumbered(Error(ErrorCode::kInvalidArgument, "X", "82 faces meet at 2 edges", metadata), plus);
  EXPECT_EQ(error.metadata(), moved);
  EXPECT_STREQ(error.what(), "82 faces meet at 2 edges") << "messages have counts, no ids";
}

}  // namespace
}  // namespace planish::cli
