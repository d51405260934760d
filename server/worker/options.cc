#include "server/worker/options.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/message.h"
#include "planish/v1/about.pb.h"

namespace planish {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Reflection;

// OPTIONS_INVALID for a number out of the range that the proto gives at the field. The core checks conditions on
// several options.
absl::Status CheckRange(const v1::UnwrapOptions& options, const FieldDescriptor& field) {
  const Reflection& reflection = *options.GetReflection();
  if (field.enum_type() != nullptr || !reflection.HasField(options, &field)) return absl::OkStatus();
  const v1::About& about = field.options().GetExtension(v1::about);
  const double value = field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE ? reflection.GetDouble(options, &field)
                                                                           : reflection.GetInt32(options, &field);
  const bool is_above = about.above_min() ? value > about.min() : value >= about.min();
  if (is_above && value <= about.max()) return absl::OkStatus();
  return OptionError(field.name(), absl::StrCat(value, " is not in ", about.above_min() ? "(" : "[", about.min(), ", ",
                                                about.max(), "]", about.unit().empty() ? "" : " ", about.unit()));
}

absl::Status CheckRanges(const v1::UnwrapOptions& options) {
  const google::protobuf::Descriptor& message = *options.GetDescriptor();
  for (int i = 0; i < message.field_count(); ++i) {
    PLANISH_RETURN_IF_ERROR(CheckRange(options, *message.field(i)));
  }
  return absl::OkStatus();
}

// A value of an option, in the API and in the core.
template <typename Proto, typename Core>
struct Choice {
  Proto proto;
  Core core;
};

constexpr Choice<v1::Seams, SeamPolicy> kSeams[] = {
    {v1::SEAMS_NONE, SeamPolicy::kNone},
    {v1::SEAMS_KEEP, SeamPolicy::kKeep},
    {v1::SEAMS_NEEDED, SeamPolicy::kNeeded},
    {v1::SEAMS_AUTO, SeamPolicy::kAuto},
};
constexpr Choice<v1::Prefer, SeamPreference> kPreferences[] = {
    {v1::PREFER_SEAMS, SeamPreference::kSeams},
    {v1::PREFER_TEXTURE, SeamPreference::kTexture},
};
constexpr Choice<v1::Pack, bool> kPacks[] = {
    {v1::PACK_ON, true},
    {v1::PACK_OFF, false},
};
constexpr Choice<v1::Effort, PackEffort> kEfforts[] = {
    {v1::EFFORT_FAST, PackEffort::kFast},
    {v1::EFFORT_NORMAL, PackEffort::kNormal},
    {v1::EFFORT_BEST, PackEffort::kBest},
};
constexpr Choice<v1::AtlasLayout, AtlasLayout> kLayouts[] = {
    {v1::ATLAS_LAYOUT_UDIM, AtlasLayout::kUdim},
    {v1::ATLAS_LAYOUT_STACKED, AtlasLayout::kStacked},
};
constexpr Choice<v1::Solver, SolverType> kSolvers[] = {
    {v1::SOLVER_AUTO, SolverType::kAuto},
    {v1::SOLVER_UZAWA, SolverType::kUzawa},
    {v1::SOLVER_MINRES, SolverType::kMinres},
    {v1::SOLVER_DIRECT, SolverType::kDirect},
};
constexpr Choice<v1::System, SystemType> kSystems[] = {
    {v1::SYSTEM_AUTO, SystemType::kAuto},
    {v1::SYSTEM_FULL, SystemType::kFull},
    {v1::SYSTEM_REDUCED, SystemType::kReduced},
};
constexpr Choice<v1::Preconditioner, PreconditionerType> kPreconditioners[] = {
    {v1::PRECONDITIONER_AUTO, PreconditionerType::kAuto},
    {v1::PRECONDITIONER_NONE, PreconditionerType::kNone},
    {v1::PRECONDITIONER_JACOBI, PreconditionerType::kJacobi},
    {v1::PRECONDITIONER_CHOLESKY, PreconditionerType::kCholesky},
    {v1::PRECONDITIONER_AMG, PreconditionerType::kAmg},
};
constexpr Choice<v1::Hessian, HessianType> kHessians[] = {
    {v1::HESSIAN_CONVEX, HessianType::kConvex},
    {v1::HESSIAN_EXACT, HessianType::kExact},
    {v1::HESSIAN_AUTO, HessianType::kAuto},
};
constexpr Choice<v1::Boundary, BoundaryType> kBoundaries[] = {
    {v1::BOUNDARY_FREE, BoundaryType::kFree},
    {v1::BOUNDARY_CONVEX, BoundaryType::kConvex},
};
constexpr Choice<v1::Precision, Precision> kPrecisions[] = {
    {v1::PRECISION_AUTO, Precision::kAuto},
    {v1::PRECISION_FLOAT, Precision::kFloat},
    {v1::PRECISION_DOUBLE, Precision::kDouble},
};

// Sets *core to the value that corresponds to `proto`; leaves the core's default if `proto` is unspecified.
template <typename Proto, typename Core, std::size_t size>
absl::Status Choose(const std::string& field, const Choice<Proto, Core> (&choices)[size], Proto proto, Core* core) {
  if (static_cast<int>(proto) == 0) return absl::OkStatus();
  for (const auto& choice : choices) {
    if (choice.proto != proto) continue;
    *core = choice.core;
    return absl::OkStatus();
  }
  return OptionError(field, absl::StrCat("this server does not know the value ", static_cast<int>(proto)));
}

template <typename Proto, typename Core, std::size_t size>
Proto Find(const Choice<Proto, Core> (&choices)[size], Core core) {
  for (const auto& choice : choices) {
    if (choice.core == core) return choice.proto;
  }
  return Proto();
}

}  // namespace

absl::StatusOr<UnwrapOptions> ToCore(const v1::UnwrapOptions& options) {
  PLANISH_RETURN_IF_ERROR(CheckRanges(options));
  UnwrapOptions core;
  FlattenOptions& flatten = core.flatten;
  PLANISH_RETURN_IF_ERROR(Choose("seams", kSeams, options.seams(), &core.seams.policy));
  PLANISH_RETURN_IF_ERROR(Choose("prefer", kPreferences, options.prefer(), &core.seams.prefer));
  PLANISH_RETURN_IF_ERROR(Choose("pack", kPacks, options.pack(), &core.pack));
  PLANISH_RETURN_IF_ERROR(Choose("atlas_layout", kLayouts, options.atlas_layout(), &core.layout));
  PLANISH_RETURN_IF_ERROR(Choose("effort", kEfforts, options.effort(), &core.atlas.effort));
  PLANISH_RETURN_IF_ERROR(Choose("solver", kSolvers, options.solver(), &flatten.solver));
  PLANISH_RETURN_IF_ERROR(Choose("system", kSystems, options.system(), &flatten.system));
  PLANISH_RETURN_IF_ERROR(
      Choose("preconditioner", kPreconditioners, options.preconditioner(), &flatten.preconditioner));
  PLANISH_RETURN_IF_ERROR(Choose("hessian", kHessians, options.hessian(), &flatten.hessian));
  PLANISH_RETURN_IF_ERROR(Choose("boundary", kBoundaries, options.boundary(), &flatten.boundary));
  PLANISH_RETURN_IF_ERROR(Choose("precision", kPrecisions, options.precision(), &core.precision));
  if (options.tolerance() != 0) flatten.tolerance = options.tolerance();
  if (options.max_newton_iterations() != 0) flatten.max_newton_iterations = options.max_newton_iterations();
  if (options.threads() != 0) core.threads = options.threads();
  if (options.max_stretch() != 0) core.seams.max_stretch = options.max_stretch();
  core.seams.hard_edge_degrees = options.hard_edge_degrees();
  if (options.texture_size() != 0) core.atlas.texture_size = options.texture_size();
  core.texels_per_unit = options.texels_per_unit();
  core.finds_texture_size = options.texels_per_unit() > 0 && options.texture_size() == 0;
  if (options.has_padding()) core.atlas.padding = options.padding();
  if (options.tiles() != 0) core.atlas.tiles = options.tiles();
  PLANISH_RETURN_IF_ERROR(core.Validate());
  return core;
}

absl::Status ValidateOptions(const v1::UnwrapOptions& options) {
  return ToCore(options).status();
}

std::vector<v1::Seams> SeamPolicies() {
  std::vector<v1::Seams> policies;
  for (const auto& seams : kSeams) policies.push_back(seams.proto);
  return policies;
}

std::vector<v1::SolverCombination> SolverCombinations() {
  std::vector<v1::SolverCombination> combinations;
  for (const auto& solver : kSolvers) {
    for (const auto& system : kSystems) {
      for (const auto& preconditioner : kPreconditioners) {
        if (solver.core == SolverType::kAuto || system.core == SystemType::kAuto ||
            preconditioner.core == PreconditionerType::kAuto) {
          continue;
        }
        v1::UnwrapOptions options;
        options.set_solver(solver.proto);
        options.set_system(system.proto);
        options.set_preconditioner(preconditioner.proto);
        if (!ValidateOptions(options).ok()) continue;
        v1::SolverCombination& combination = combinations.emplace_back();
        combination.set_solver(solver.proto);
        combination.set_system(system.proto);
        combination.set_preconditioner(preconditioner.proto);
      }
    }
  }
  return combinations;
}

v1::Atlas AtlasInEffect(const UnwrapOptions& options, const UnwrapResult& result) {
  v1::Atlas atlas;
  atlas.set_pack(Find(kPacks, options.pack));
  atlas.set_texture_size(result.texture_size);
  atlas.set_padding(options.atlas.padding);
  atlas.set_effort(Find(kEfforts, options.atlas.effort));
  atlas.set_layout(Find(kLayouts, options.layout));
  return atlas;
}

v1::Solver ToProto(SolverType type) {
  return Find(kSolvers, type);
}
v1::System ToProto(SystemType type) {
  return Find(kSystems, type);
}
v1::Preconditioner ToProto(PreconditionerType type) {
  return Find(kPreconditioners, type);
}
v1::Hessian ToProto(HessianType type) {
  return Find(kHessians, type);
}
v1::Boundary ToProto(BoundaryType type) {
  return Find(kBoundaries, type);
}
v1::Precision ToProto(Precision precision) {
  return Find(kPrecisions, precision);
}

}  // namespace planish
