#include "client/files/gltf_merge_plan.h"

#include <algorithm>
#include <set>
#include <utility>

namespace planish {
namespace {

using Pointer = Json::json_pointer;
using Factor = std::array<float, 4>;

constexpr Factor kAllOne = {1, 1, 1, 1}, kBlack = {0, 0, 0, 1};

const Pointer kBase("/pbrMetallicRoughness/baseColorTexture");
const Pointer kMetallicRoughness("/pbrMetallicRoughness/metallicRoughnessTexture");
const Pointer kOcclusion("/occlusionTexture");
const Pointer kEmissive("/emissiveTexture");

float FloatAt(const Json& json, const Pointer& at, float otherwise) {
  return static_cast<float>(GltfNumberAt(json, at, otherwise));
}

// The first four numbers of an array, filled up from `otherwise`.
Factor FactorAt(const Json& json, const Pointer& at, Factor otherwise) {
  for (std::size_t i = 0; i < 4; ++i) otherwise[i] = FloatAt(json, at / i, otherwise[i]);
  return otherwise;
}

bool IsOpaque(const Json& material) {
  return !material.contains("alphaMode") || material["alphaMode"] == "OPAQUE";
}

}  // namespace

const GltfTextureUse* MergedMember::UseAt(const Pointer& at) const {
  const auto found = std::find_if(uses.begin(), uses.end(), [&at](const GltfTextureUse& use) { return use.at == at; });
  return found == uses.end() ? nullptr : &*found;
}

// The names of the members, such as "wood+steel+2 more".
std::string NamesOf(const MergedGroup& group, std::size_t most) {
  std::string names;
  for (std::size_t m = 0; m < std::min(most, group.members.size()); ++m) {
    const MergedMember& member = group.members[m];
    names += (m == 0 ? "" : "+") +
             (member.material < 0 ? std::string("default") : GltfName(member.json, "material", member.material));
  }
  if (group.members.size() > most) names += "+" + std::to_string(group.members.size() - most) + " more";
  return names;
}

namespace {

// Builds a plan, slot by slot.
class MergePlanner {
 public:
  MergePlanner(const MergedGroup& group, MergePlan* plan) : group_(group), plan_(*plan) {
    plan_.material = group.members[0].json;
    for (const GltfTextureUse& use : group.members[0].uses) {
      plan_.material[use.at.parent_pointer()].erase(use.at.back());
    }
    if (std::any_of(group.members.begin(), group.members.end(), [&](const MergedMember& member) {
          return member.json.value("extras", Json()) != plan_.material.value("extras", Json());
        })) {
      plan_.material.erase("extras");
    }
  }

  void PlanAll() {
    PlanBase();
    PlanSurface();
    PlanEmission();
    std::vector<Pointer> others;
    for (const MergedMember& member : group_.members) {
      for (const GltfTextureUse& use : member.uses) {
        const bool is_done =
            use.at == kBase || use.at == kMetallicRoughness || use.at == kOcclusion || use.at == kEmissive;
        if (!is_done && std::find(others.begin(), others.end(), use.at) == others.end()) others.push_back(use.at);
      }
    }
    for (const Pointer& at : others) PlanOther(at);
    if (plan_.material.contains("pbrMetallicRoughness") && plan_.material["pbrMetallicRoughness"].empty()) {
      plan_.material.erase("pbrMetallicRoughness");
    }
  }

 private:
  // The value of each member. Sets *are_equal to whether all are equal.
  template <typename Value>
  std::vector<Value> OfMembers(const auto& value, bool* are_equal) const {
    std::vector<Value> values;
    for (const MergedMember& member : group_.members) values.push_back(value(member));
    *are_equal = std::all_of(values.begin(), values.end(), [&](const Value& each) { return each == values[0]; });
    return values;
  }
  bool HasImage(const Pointer& at) const {
    return std::any_of(group_.members.begin(), group_.members.end(),
                       [&at](const MergedMember& member) { return member.UseAt(at) != nullptr; });
  }
  // Adds slot `at` to the image. The new material gets the textureInfo of the first member that has one there.
  void AddSlot(const Pointer& at, PlannedImage* image) {
    image->slots.push_back(at);
    for (const MergedMember& member : group_.members) {
      if (member.UseAt(at) == nullptr) continue;
      plan_.material[at] = member.json[at];
      return;
    }
    plan_.material[at] = Json::object();
  }
  // Materials that read one image in the same way share a part.
  static void AddPart(std::size_t member, const GltfTextureUse* use, const BakeOptions& options, PlannedImage* image) {
    for (PlannedPart& part : image->parts) {
      const bool is_same_image =
          use == nullptr ? part.use == nullptr : part.use != nullptr && SameReading(*use, *part.use);
      if (!is_same_image || part.options.factor != options.factor || part.options.offset != options.offset ||
          part.options.normal_scale != options.normal_scale) {
        continue;
      }
      part.members.push_back(member);
      return;
    }
    image->parts.push_back({{member}, use, options});
  }
  static bool SameReading(const GltfTextureUse& a, const GltfTextureUse& b) {
    return a.texture == b.texture && a.texcoord == b.texcoord && a.transform == b.transform;
  }

  void PlanBase() {
    const Pointer at("/pbrMetallicRoughness/baseColorFactor");
    bool are_equal = false;
    const std::vector<Factor> factors =
        OfMembers<Factor>([&at](const MergedMember& member) { return FactorAt(member.json, at, kAllOne); }, &are_equal);
    if (are_equal && !HasImage(kBase) && !group_.has_colors) return;
    PlannedImage image;
    image.name = "baseColor";
    image.may_have_alpha = !IsOpaque(plan_.material);
    image.has_colors = group_.has_colors;
    AddSlot(kBase, &image);
    if (!are_equal) plan_.material["pbrMetallicRoughness"].erase("baseColorFactor");
    for (std::size_t m = 0; m < group_.members.size(); ++m) {
      BakeOptions options = {TextureMeaning::kColor, image.may_have_alpha, 1};
      if (!are_equal) options.factor = factors[m];
      AddPart(m, group_.members[m].UseAt(kBase), options, &image);
    }
    plan_.images.push_back(std::move(image));
  }

  // Occlusion is red, roughness green, metalness blue. They share one image, unless a material has them in two.
  void PlanSurface() {
    bool equal_metal = false, equal_rough = false, equal_strength = false;
    const std::vector<float> metal = OfMembers<float>(
        [](const MergedMember& member) {
          return FloatAt(member.json, Pointer("/pbrMetallicRoughness/metallicFactor"), 1);
        },
        &equal_metal);
    const std::vector<float> rough = OfMembers<float>(
        [](const MergedMember& member) {
          return FloatAt(member.json, Pointer("/pbrMetallicRoughness/roughnessFactor"), 1);
        },
        &equal_rough);
    // Members without occlusion do not count, since any strength suits them.
    std::set<float> strengths;
    for (const MergedMember& member : group_.members) {
      if (member.UseAt(kOcclusion) != nullptr) strengths.insert(FloatAt(member.json, kOcclusion / "strength", 1));
    }
    equal_strength = strengths.size() <= 1;
    const bool has_occlusion = HasImage(kOcclusion);
    const bool has_surface = HasImage(kMetallicRoughness) || !equal_metal || !equal_rough;
    if (!has_occlusion && !has_surface) return;
    const auto add = [&](bool with_surface, bool with_occlusion, const char* name) {
      PlannedImage image;
      image.name = name;
      if (with_surface) {
        AddSlot(kMetallicRoughness, &image);
        if (!equal_metal) plan_.material["pbrMetallicRoughness"].erase("metallicFactor");
        if (!equal_rough) plan_.material["pbrMetallicRoughness"].erase("roughnessFactor");
      }
      if (with_occlusion) {
        AddSlot(kOcclusion, &image);
        if (!equal_strength) plan_.material[kOcclusion].erase("strength");
      }
      for (std::size_t m = 0; m < group_.members.size(); ++m) {
        const MergedMember& member = group_.members[m];
        const GltfTextureUse* const surface = with_surface ? member.UseAt(kMetallicRoughness) : nullptr;
        const GltfTextureUse* const occlusion = with_occlusion ? member.UseAt(kOcclusion) : nullptr;
        const GltfTextureUse* const use = surface != nullptr ? surface : occlusion;
        BakeOptions options = {TextureMeaning::kData, false, 1};
        if (occlusion != nullptr && !equal_strength) {
          options.factor[0] = FloatAt(member.json, kOcclusion / "strength", 1);
          options.offset[0] = 1 - options.factor[0];
        } else if (occlusion == nullptr) {
          options.factor[0] = 0;
          options.offset[0] = 1;
        }
        const float painted[2] = {equal_rough ? 1 : rough[m], equal_metal ? 1 : metal[m]};
        for (std::size_t c = 1; c <= 2; ++c) {
          (surface != nullptr ? options.factor : options.offset)[c] = painted[c - 1];
          if (surface == nullptr) options.factor[c] = 0;
        }
        AddPart(m, use, options, &image);
      }
      plan_.images.push_back(std::move(image));
    };
    const bool are_apart = std::any_of(group_.members.begin(), group_.members.end(), [](const MergedMember& member) {
      const GltfTextureUse* const surface = member.UseAt(kMetallicRoughness);
      const GltfTextureUse* const occlusion = member.UseAt(kOcclusion);
      return surface != nullptr && occlusion != nullptr && !SameReading(*surface, *occlusion);
    });
    if (has_surface && has_occlusion && !are_apart) {
      add(true, true, "occlusionRoughnessMetallic");
      return;
    }
    if (has_surface) add(true, false, "metallicRoughness");
    if (has_occlusion) add(false, true, "occlusion");
  }

  void PlanEmission() {
    bool are_equal = false;
    const std::vector<Factor> factors = OfMembers<Factor>(
        [](const MergedMember& member) {
          Factor factor = FactorAt(member.json, Pointer("/emissiveFactor"), kBlack);
          factor[3] = 1;
          return factor;
        },
        &are_equal);
    if (are_equal && !HasImage(kEmissive)) return;
    PlannedImage image;
    image.name = "emissive";
    AddSlot(kEmissive, &image);
    if (!are_equal) plan_.material["emissiveFactor"] = {1, 1, 1};
    for (std::size_t m = 0; m < group_.members.size(); ++m) {
      BakeOptions options = {TextureMeaning::kColor, false, 1};
      if (!are_equal) options.factor = factors[m];
      AddPart(m, group_.members[m].UseAt(kEmissive), options, &image);
    }
    plan_.images.push_back(std::move(image));
  }

  // Plans normals, or a texture of an extension. The factors of extensions are equal in all members.
  void PlanOther(const Pointer& at) {
    PlannedImage image;
    image.name = at.back().substr(0, at.back().rfind("Texture"));
    image.may_have_alpha = true;
    std::set<double> scales;
    TextureMeaning meaning = TextureMeaning::kData;
    bool is_weighted = false;
    for (const MergedMember& member : group_.members) {
      const GltfTextureUse* const use = member.UseAt(at);
      if (use == nullptr) continue;
      meaning = use->meaning;
      is_weighted = use->has_alpha;
      if (use->is_normal) scales.insert(use->normal_scale);
    }
    AddSlot(at, &image);
    if (scales.size() > 1) plan_.material[at].erase("scale");
    for (std::size_t m = 0; m < group_.members.size(); ++m) {
      const GltfTextureUse* const use = group_.members[m].UseAt(at);
      BakeOptions options = {meaning, is_weighted, use == nullptr ? 1 : use->normal_scale};
      options.keeps_normal_scale = scales.size() <= 1;
      if (use == nullptr && meaning == TextureMeaning::kNormal) options.factor = {0.5F, 0.5F, 1, 1};
      AddPart(m, use, options, &image);
    }
    // Extensions may keep data in different channels of one image: shares an image that is drawn from the same parts.
    for (PlannedImage& other : plan_.images) {
      const bool is_same =
          meaning == TextureMeaning::kData && other.name != "baseColor" &&
          std::equal(other.parts.begin(), other.parts.end(), image.parts.begin(), image.parts.end(),
                     [](const PlannedPart& a, const PlannedPart& b) {
                       return a.members == b.members && a.options.meaning == b.options.meaning &&
                              a.options.factor == b.options.factor && a.options.offset == b.options.offset &&
                              (a.use == nullptr ? b.use == nullptr : b.use != nullptr && SameReading(*a.use, *b.use));
                     });
      if (!is_same) continue;
      other.slots.push_back(at);
      other.may_have_alpha = true;
      return;
    }
    plan_.images.push_back(std::move(image));
  }

  const MergedGroup& group_;
  MergePlan& plan_;
};

}  // namespace

MergePlan PlanMerge(const MergedGroup& group) {
  MergePlan plan;
  MergePlanner(group, &plan).PlanAll();
  if (group.members.size() > 1) plan.material["name"] = NamesOf(group, 3);
  return plan;
}

}  // namespace planish
