#include "server/worker/options.h"

#include <limits>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/message.h"
#include "gtest/gtest.h"
#include "planish/v1/about.pb.h"

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

using google::protobuf::FieldDescriptor;

void SetNumber(const FieldDescriptor& field, double value, v1::UnwrapOptions* options) {
  if (field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
    options->GetReflection()->SetDouble(options, &field, value);
  } else {
    options->GetReflection()->SetInt32(options, &field, static_cast<int>(value));
  }
}

TEST(Options, EveryOneIsRefusedOutOfTheRangeInTheProto) {
  for (int i = 0; i < v1::UnwrapOptions::descriptor()->field_count(); ++i) {
    const FieldDescriptor* const field = v1::UnwrapOptions::descriptor()->field(i);
    const v1::About& about = field->options().GetExtension(v1::about);
    if (field->enum_type() != nullptr) {
      v1::UnwrapOptions options;
      options.GetReflection()->SetEnumValue(&options, field, 99);
      EXPECT_EQ(BadField(options), field->name());
      // The core has every value that is not out of range.
      for (int k = 1; k < field->enum_type()->value_count(); ++k) {
        v1::UnwrapOptions known;
        known.GetReflection()->SetEnum(&known, field, field->enum_type()->value(k));
        EXPECT_TRUE(ValidateOptions(known).ok()) << field->enum_type()->value(k)->name();
      }
      continue;
    }
    ASSERT_TRUE(about.has_min() && about.has_max()) << field->name() << " has no range";
    for (const double beyond : {about.min() - 2, about.max() + 1}) {
      v1::UnwrapOptions options;
      SetNumber(*field, beyond, &options);
      EXPECT_EQ(BadField(options), field->name()) << beyond;
    }
    // The core takes what the proto allows.
    for (const double within : {about.above_min() ? about.max() / 2 : about.min(), about.max()}) {
      v1::UnwrapOptions options;
      SetNumber(*field, within, &options);
      EXPECT_TRUE(ValidateOptions(options).ok()) << field->name() << " " << ValidateOptions(options);
    }
  }
}

TEST(Options, WhatIsNoNumberIsOutOfRange) {
  for (const double number : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const char* name : {"tolerance", "max_stretch", "hard_edge_degrees", "texels_per_unit"}) {
      v1::UnwrapOptions options;
      SetNumber(*v1::UnwrapOptions::descriptor()->FindFieldByName(name), number, &options);
      EXPECT_EQ(BadField(options), name) << number;
    }
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
