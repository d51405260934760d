// YAML documents and what a server's configuration may hold.
#pragma once

#include <string>
#include <vector>

#include "yaml-cpp/yaml.h"

namespace planish::deploy {

// Kubernetes objects.
struct Objects {
  std::vector<YAML::Node> all;

  std::vector<YAML::Node> OfKind(const std::string& kind) const;
  // The one of this kind and name; generated names may go on with "-HASH". Fails the test if there is none.
  YAML::Node Get(const std::string& kind, const std::string& name) const;
};

Objects ParseObjects(const std::string& text);

// "/a/0/b" in `node`; undefined if it is not there.
YAML::Node At(YAML::Node node, const std::string& path);

// Its value as text; empty if it is not there.
std::string TextAt(const YAML::Node& node, const std::string& path);

// Bytes of "4Gi", "256Mi", "1000".
double Bytes(const std::string& quantity);

}  // namespace planish::deploy
