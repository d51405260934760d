// Material files of OBJ (MTL) and the images that they use. Used only in client/files.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "client/texture/texture_baker.h"

namespace planish {

// A statement that names an image, as in "map_Kd -s 2 2 1 wood.png".
struct MtlMap {
  std::size_t line = 0;                                   // in MtlFile::lines
  std::string keyword;                                    // as spelled in the file
  std::string options;                                    // without -s, -o and -clamp: "-bm 0.5 "
  std::string file;                                       // relative to the folder of the material file
  std::array<double, 2> scale = {1, 1}, offset = {0, 0};  // -s and -o: u' = scale u + offset, v upwards
  bool clamp = false;
  TextureMeaning meaning = TextureMeaning::kData;
  bool may_be_normals = false;  // bump maps are heights, but many programs use them for normal maps
  bool has_alpha = false;       // the material has an opacity map: colours are weighted with alpha
};

struct MtlMaterial {
  std::string name;
  std::size_t first_line = 0, end_line = 0;
  std::vector<MtlMap> maps;
};

struct MtlFile {
  std::vector<std::string> lines;  // without line ends
  std::vector<MtlMaterial> materials;
};

MtlFile ParseMtl(std::string_view text);

// The statement `map` with another image, such as "map_Kd -bm 1 out_wood.png".
std::string MtlLine(const MtlMap& map, const std::string& file);

// The names in the mtllib statements of an OBJ, one per statement even if it has blanks, without repetitions.
std::vector<std::string> MaterialLibraries(std::string_view obj);

}  // namespace planish
