#include "server/worker/options.h"

#include <limits>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

// The field that ValidateOptions() complains about.
std::string BadField(const v1::UnwrapOptions& options) {
  const ErrorInfo info = ErrorInfoOf(ValidateOptions(options));
  return info.reason == "OPTIONS_INVALID" ? info.metadata.at("field") : info.reason;
}

TEST(Options, NothingSetMeansTheCoresDefaults) {
  const auto core = ToCore(v1::UnwrapOptions());
  ASSERT_TRUE(core.ok());
  EXPECT_EQ(core->flatten.solver, SolverType::kAuto);
  EXPECT_EQ(core->flatten.hessian, HessianType::kAuto);
  EXPECT_EQ(core->flatten.boundary, BoundaryType::kFree);
  EXPECT_EQ(core->precision, Precision::kAuto);
  EXPECT_EQ(core->flatten.tolerance, 1e-9);
  EXPECT_EQ(core->flatten.max_newton_iterations, 100);
  EXPECT_EQ(core->threads, 1);
  EXPECT_EQ(core->seams.policy, SeamPolicy::kAuto);
  EXPECT_EQ(core->seams.prefer, SeamPreference::kSeams);
  EXPECT_EQ(core->MaxStretch(), 1.25);
  EXPECT_EQ(core->seams.hard_edge_degrees, 0);
  EXPECT_TRUE(core->pack);
  EXPECT_EQ(core->atlas.texture_size, 1024);
  EXPECT_EQ(core->atlas.padding, 2);
  EXPECT_EQ(core->atlas.tiles, 1);
  EXPECT_EQ(core->atlas.effort, PackEffort::kNormal);
}

TEST(Options, SeamsAndAtlasArrive) {
  v1::UnwrapOptions options;
  options.set_seams(v1::SEAMS_NEEDED);
  options.set_max_stretch(1.2);
  options.set_hard_edge_degrees(66);
  options.set_texture_size(4096);
  options.set_padding(0);
  options.set_tiles(12);
  options.set_effort(v1::EFFORT_BEST);
  options.set_pack(v1::PACK_OFF);
  options.set_prefer(v1::PREFER_TEXTURE);
  const auto core = ToCore(options);
  ASSERT_TRUE(core.ok()) << core.status();
  EXPECT_EQ(core->seams.policy, SeamPolicy::kNeeded);
  EXPECT_EQ(core->seams.prefer, SeamPreference::kTexture);
  EXPECT_EQ(core->seams.max_stretch, 1.2);
  EXPECT_EQ(core->seams.hard_edge_degrees, 66);
  EXPECT_EQ(core->atlas.texture_size, 4096);
  EXPECT_EQ(core->atlas.padding, 0) << "0 is a padding, not a default";
  EXPECT_EQ(core->atlas.tiles, 12);
  EXPECT_EQ(core->atlas.effort, PackEffort::kBest);
  EXPECT_FALSE(core->pack);
}

TEST(Options, EveryPolicyThatIsAnnouncedIsTaken) {
  EXPECT_THAT(SeamPolicies(), ::testing::ElementsAre(v1::SEAMS_NONE, v1::SEAMS_KEEP, v1::SEAMS_NEEDED, v1::SEAMS_AUTO));
  for (const v1::Seams seams : SeamPolicies()) {
    v1::UnwrapOptions options;
    options.set_seams(seams);
    EXPECT_TRUE(ValidateOptions(options).ok()) << v1::Seams_Name(seams);
  }
}

TEST(Options, EverythingSetArrives) {
  v1::UnwrapOptions options;
  options.set_seams(v1::SEAMS_NONE);
  options.set_solver(v1::SOLVER_MINRES);
  options.set_system(v1::SYSTEM_FULL);
  options.set_preconditioner(v1::PRECONDITIONER_JACOBI);
  options.set_hessian(v1::HESSIAN_EXACT);
  options.set_boundary(v1::BOUNDARY_CONVEX);
  options.set_precision(v1::PRECISION_DOUBLE);
  options.set_tolerance(1e-5);
  options.set_max_newton_iterations(7);
  options.set_threads(3);
  const auto core = ToCore(options);
  ASSERT_TRUE(core.ok()) << core.status();
  EXPECT_EQ(core->flatten.solver, SolverType::kMinres);
  EXPECT_EQ(core->flatten.system, SystemType::kFull);
  EXPECT_EQ(core->flatten.preconditioner, PreconditionerType::kJacobi);
  EXPECT_EQ(core->flatten.hessian, HessianType::kExact);
  EXPECT_EQ(core->flatten.boundary, BoundaryType::kConvex);
  EXPECT_EQ(core->precision, Precision::kDouble);
  EXPECT_EQ(core->flatten.tolerance, 1e-5);
  EXPECT_EQ(core->flatten.max_newton_iterations, 7);
  EXPECT_EQ(core->threads, 3);
}

TEST(Options, UnknownEnumeratorsNameTheirField) {
  v1::UnwrapOptions options;
  options.set_seams(static_cast<v1::Seams>(99));
  EXPECT_EQ(BadField(options), "seams");
  options.clear_seams();
  options.set_pack(static_cast<v1::Pack>(99));
  EXPECT_EQ(BadField(options), "pack");
  options.clear_pack();
  options.set_effort(static_cast<v1::Effort>(99));
  EXPECT_EQ(BadField(options), "effort");
  options.clear_effort();
  options.set_solver(static_cast<v1::Solver>(99));
  EXPECT_EQ(BadField(options), "solver");
  options.clear_solver();
  options.set_system(static_cast<v1::System>(99));
  EXPECT_EQ(BadField(options), "system");
  options.clear_system();
  options.set_preconditioner(static_cast<v1::Preconditioner>(-1));
  EXPECT_EQ(BadField(options), "preconditioner");
  options.clear_preconditioner();
  options.set_hessian(static_cast<v1::Hessian>(99));
  EXPECT_EQ(BadField(options), "hessian");
  options.clear_hessian();
  options.set_boundary(static_cast<v1::Boundary>(99));
  EXPECT_EQ(BadField(options), "boundary");
  options.clear_boundary();
  options.set_precision(static_cast<v1::Precision>(99));
  EXPECT_EQ(BadField(options), "precision");
}

TEST(Options, NumbersOutOfRangeNameTheirField) {
  for (const double tolerance :
       {-1.0, 0.011, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    v1::UnwrapOptions options;
    options.set_tolerance(tolerance);
    EXPECT_EQ(BadField(options), "tolerance") << tolerance;
  }
  for (const int iterations : {-1, 1001}) {
    v1::UnwrapOptions options;
    options.set_max_newton_iterations(iterations);
    EXPECT_EQ(BadField(options), "max_newton_iterations") << iterations;
  }
  for (const int threads : {-1, 257}) {
    v1::UnwrapOptions options;
    options.set_threads(threads);
    EXPECT_EQ(BadField(options), "threads") << threads;
  }
}

TEST(Options, SeamAndAtlasNumbersOutOfRangeNameTheirField) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto with = [](const auto& set) {
    v1::UnwrapOptions options;
    set(options);
    return BadField(options);
  };
  for (const double stretch : {-1.0, 1.0, 100.5, nan}) {
    EXPECT_EQ(with([&](auto& o) { o.set_max_stretch(stretch); }), "max_stretch") << stretch;
  }
  for (const double degrees : {-1.0, 180.5, nan}) {
    EXPECT_EQ(with([&](auto& o) { o.set_hard_edge_degrees(degrees); }), "hard_edge_degrees") << degrees;
  }
  for (const int size : {-1, 15, 65537}) {
    EXPECT_EQ(with([&](auto& o) { o.set_texture_size(size); }), "texture_size") << size;
  }
  for (const int padding : {-1, 65}) {
    EXPECT_EQ(with([&](auto& o) { o.set_padding(padding); }), "padding") << padding;
  }
  for (const int tiles : {-1, 101}) {
    EXPECT_EQ(with([&](auto& o) { o.set_tiles(tiles); }), "tiles") << tiles;
  }
}

TEST(Options, ChoicesThatContradictEachOtherAreRefused) {
  v1::UnwrapOptions options;
  options.set_texture_size(16);
  options.set_padding(15);
  EXPECT_EQ(BadField(options), "padding") << "two rims of 8 fill 16 texels";
  options.set_padding(14);
  EXPECT_TRUE(ValidateOptions(options).ok());
  options.set_seams(v1::SEAMS_NONE);
  options.set_hard_edge_degrees(60);
  EXPECT_EQ(BadField(options), "seams") << "none and hard edges";
}

TEST(Options, CombinationsAreThoseThatPass) {
  bool paper = false;
  bool direct = false;
  for (const v1::SolverCombination& c : SolverCombinations()) {
    EXPECT_FALSE(c.solver() == v1::SOLVER_DIRECT && c.system() == v1::SYSTEM_FULL);
    EXPECT_FALSE(c.preconditioner() == v1::PRECONDITIONER_CHOLESKY && c.system() == v1::SYSTEM_FULL);
    paper |= c.solver() == v1::SOLVER_UZAWA && c.system() == v1::SYSTEM_FULL &&
             c.preconditioner() == v1::PRECONDITIONER_NONE;
    direct |= c.solver() == v1::SOLVER_DIRECT;
  }
  EXPECT_TRUE(paper);
  EXPECT_TRUE(direct);
}

TEST(Options, ReportsNeverSayUnspecified) {
  EXPECT_EQ(ToProto(SolverType::kDirect), v1::SOLVER_DIRECT);
  EXPECT_EQ(ToProto(SystemType::kReduced), v1::SYSTEM_REDUCED);
  EXPECT_EQ(ToProto(PreconditionerType::kCholesky), v1::PRECONDITIONER_CHOLESKY);
  EXPECT_EQ(ToProto(HessianType::kConvex), v1::HESSIAN_CONVEX);
  EXPECT_EQ(ToProto(BoundaryType::kFree), v1::BOUNDARY_FREE);
  EXPECT_EQ(ToProto(Precision::kFloat), v1::PRECISION_FLOAT);
}

}  // namespace
}  // namespace planish
