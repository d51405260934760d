// deploy/kubernetes as kubectl renders it, the compose files and the image.
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/deploy/text_files.h"
#include "tests/deploy/yaml_files.h"

namespace planish::deploy {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kMiB = 1048576.0;

// What server.grace is followed by until the process has ended (server/README.md, "Shutdown"), with preStop before it.
constexpr int kSecondsAroundGrace = 20;

class Kubernetes : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (RunShell("kubectl version --client 2>/dev/null").exit_code != 0) GTEST_SKIP() << "kubectl is not installed";
    const Outcome rendered =
        RunShell(absl::StrCat("kubectl kustomize ", PLANISH_SOURCE_TREE, "/deploy/kubernetes/overlays/", GetParam()));
    ASSERT_EQ(rendered.exit_code, 0);
    objects_ = ParseObjects(rendered.out);
    ASSERT_FALSE(objects_.all.empty());
  }

  bool IsFarm() const { return GetParam() == "farm"; }

  // Of Deployments and StatefulSets.
  std::vector<YAML::Node> Workloads() const {
    std::vector<YAML::Node> all = objects_.OfKind("StatefulSet");
    for (const YAML::Node& deployment : objects_.OfKind("Deployment")) all.push_back(deployment);
    return all;
  }

  // Of the pod that runs jobs, and of the one that answers callers.
  YAML::Node Server() const { return PodOf("worker"); }
  YAML::Node Front() const { return PodOf("front"); }
  YAML::Node PodOf(const std::string& role) const {
    const YAML::Node workload =
        IsFarm() ? objects_.Get("Deployment", "planish-" + role) : objects_.Get("StatefulSet", "planishd");
    return At(workload, "/spec/template/spec");
  }

  YAML::Node Settings(const std::string& role = "worker") const {
    const std::string name = IsFarm() ? "planish-" + role : "planishd";
    return YAML::Load(TextAt(objects_.Get("ConfigMap", name), "/data/planishd.yaml"));
  }

  Objects objects_;
};
INSTANTIATE_TEST_SUITE_P(Overlays, Kubernetes, ::testing::Values("single", "farm"),
                         [](const auto& test) { return test.param; });

// The profile "restricted" of the Pod Security Standards, and a file system that nobody writes to.
TEST_P(Kubernetes, NobodyIsRootOrCouldBecomeIt) {
  ASSERT_EQ(Workloads().size(), IsFarm() ? 2u : 1u);
  for (const YAML::Node& workload : Workloads()) {
    const YAML::Node pod = At(workload, "/spec/template/spec");
    SCOPED_TRACE(TextAt(workload, "/metadata/name"));
    EXPECT_EQ(TextAt(pod, "/securityContext/runAsNonRoot"), "true");
    EXPECT_THAT(TextAt(pod, "/securityContext/runAsUser"), Not(::testing::AnyOf("", "0")));
    EXPECT_EQ(TextAt(pod, "/securityContext/seccompProfile/type"), "RuntimeDefault");
    EXPECT_EQ(TextAt(pod, "/automountServiceAccountToken"), "false");
    EXPECT_FALSE(pod["hostNetwork"].IsDefined() || pod["hostPID"].IsDefined() || pod["hostIPC"].IsDefined());
    ASSERT_GE(pod["containers"].size(), 1u);
    for (const YAML::Node& container : pod["containers"]) {
      EXPECT_EQ(TextAt(container, "/securityContext/allowPrivilegeEscalation"), "false");
      EXPECT_EQ(TextAt(container, "/securityContext/readOnlyRootFilesystem"), "true");
      EXPECT_THAT(At(container, "/securityContext/capabilities/drop").as<std::vector<std::string>>(),
                  ElementsAre("ALL"));
      EXPECT_FALSE(At(container, "/securityContext/privileged").IsDefined());
    }
    for (const YAML::Node& volume : pod["volumes"]) EXPECT_FALSE(volume["hostPath"].IsDefined());
  }
  const YAML::Node labels = At(objects_.Get("Namespace", "planish"), "/metadata/labels");
  EXPECT_EQ(labels["pod-security.kubernetes.io/enforce"].as<std::string>(), "restricted");
}

TEST_P(Kubernetes, EverybodyIsProbedAndHasLimits) {
  for (const YAML::Node& workload : Workloads()) {
    for (const YAML::Node& container : At(workload, "/spec/template/spec/containers")) {
      SCOPED_TRACE(TextAt(container, "/name"));
      EXPECT_EQ(TextAt(container, "/livenessProbe/httpGet/path"), "/livez");
      EXPECT_EQ(TextAt(container, "/readinessProbe/httpGet/path"), "/readyz");
      std::set<std::string> ports;
      for (const YAML::Node& port : container["ports"]) ports.insert(port["name"].as<std::string>());
      EXPECT_TRUE(ports.contains(TextAt(container, "/livenessProbe/httpGet/port")));
      EXPECT_TRUE(ports.contains(TextAt(container, "/readinessProbe/httpGet/port")));
      EXPECT_GT(Bytes(TextAt(container, "/resources/limits/memory")), 0);
      EXPECT_GT(Bytes(TextAt(container, "/resources/requests/memory")), 0);
      EXPECT_NE(TextAt(container, "/resources/requests/cpu"), "");
    }
  }
}

TEST_P(Kubernetes, MemoryIsThatOfTheArithmetic) {
  const YAML::Node container = At(Server(), "/containers/0");
  const double limit = Bytes(TextAt(container, "/resources/limits/memory"));
  EXPECT_EQ(Bytes(TextAt(container, "/resources/requests/memory")), limit) << "memory is not shared";
  const double reserved = Settings()["memory-mb"].as<double>() * kMiB;
  // kubernetes/README.md: two jobs of a million triangles (core/unwrap/estimate.h), and a quarter.
  const double job = 8e6 + 1000 * 1e6 + 2 * 12e6;
  EXPECT_GE(reserved, Settings()["workers"].as<double>() * job * 1.25);
  EXPECT_GE(limit, 1.5 * reserved);
  const double cores = Settings()["workers"].as<double>() * Settings()["threads"].as<double>();
  EXPECT_EQ(std::stod(TextAt(container, "/resources/requests/cpu")), cores);
}

TEST_P(Kubernetes, PodsLiveAsLongAsTheirGrace) {
  for (const std::string role : {"front", "worker"}) {
    const int grace = Settings(role)["grace"].as<int>();
    EXPECT_GE(At(PodOf(role), "/terminationGracePeriodSeconds").as<int>(), grace + kSecondsAroundGrace) << role;
  }
  EXPECT_GT(At(Front(), "/containers/0/lifecycle/preStop/sleep/seconds").as<int>(), 0);
}

TEST_P(Kubernetes, JobsAreInAVolumeOrInTheDatabase) {
  if (IsFarm()) {
    for (const std::string role : {"front", "worker"}) {
      EXPECT_EQ(Settings(role)["role"].as<std::string>(), role);
      EXPECT_THAT(Settings(role)["store"].as<std::string>(), HasSubstr("sslmode=verify-full"));
      EXPECT_EQ(Settings(role)["blobs"].as<std::string>(), Settings("front")["blobs"].as<std::string>());
      for (const YAML::Node& volume : PodOf(role)["volumes"]) {
        EXPECT_TRUE(volume["projected"].IsDefined()) << "nothing that matters is in a pod: " << volume;
      }
    }
    return;
  }
  const YAML::Node set = objects_.Get("StatefulSet", "planishd");
  const std::string volume = TextAt(set, "/spec/volumeClaimTemplates/0/metadata/name");
  std::string mounted;
  for (const YAML::Node& mount : At(set, "/spec/template/spec/containers/0/volumeMounts")) {
    if (mount["name"].as<std::string>() == volume) mounted = mount["mountPath"].as<std::string>();
  }
  EXPECT_EQ(mounted, Settings()["data-dir"].as<std::string>());
  const double room = Bytes(TextAt(set, "/spec/volumeClaimTemplates/0/spec/resources/requests/storage"));
  EXPECT_GT(room, Settings()["store-mb"].as<double>() * kMiB * 1.5);
}

// The servers' ports, their metrics and the files that they read are there.
TEST_P(Kubernetes, WhatServersAreToldIsThere) {
  for (const std::string role : {"front", "worker"}) {
    SCOPED_TRACE(role);
    const YAML::Node pod = PodOf(role);
    const YAML::Node settings = Settings(role);
    std::set<std::string> ports;
    for (const YAML::Node& port : At(pod, "/containers/0/ports")) {
      ports.insert(absl::StrCat("0.0.0.0:", port["containerPort"].as<std::string>()));
    }
    EXPECT_TRUE(ports.contains(settings["metrics-listen"].as<std::string>()));
    const bool listens = settings["listen"].IsDefined();
    EXPECT_EQ(listens, !IsFarm() || role == "front") << "a worker answers nobody";
    if (listens) {
      EXPECT_TRUE(ports.contains(settings["listen"].as<std::string>()));
      EXPECT_TRUE(settings["tls-cert"].IsDefined() && settings["access-file"].IsDefined());
    }
    std::set<std::string> files;
    std::string config;
    for (const YAML::Node& mount : At(pod, "/containers/0/volumeMounts")) {
      if (mount["name"].as<std::string>() == "config") config = mount["mountPath"].as<std::string>();
    }
    for (const YAML::Node& volume : pod["volumes"]) {
      for (const YAML::Node& source : At(volume, "/projected/sources")) {
        const YAML::Node items = At(source, "/secret/items");
        if (!items.IsDefined()) continue;
        const YAML::Node secret = objects_.Get("Secret", TextAt(source, "/secret/name"));
        for (const YAML::Node& item : items) {
          files.insert(config + "/" + item["path"].as<std::string>());
          EXPECT_TRUE(secret["stringData"][item["key"].as<std::string>()].IsDefined()) << item["key"];
        }
      }
    }
    for (const std::string key : {"tls-cert", "tls-key", "tls-client-ca", "access-file", "store-password-file"}) {
      if (!settings[key].IsDefined()) continue;
      EXPECT_TRUE(files.contains(settings[key].as<std::string>())) << key;
    }
    EXPECT_THAT(At(pod, "/containers/0/args").as<std::vector<std::string>>(),
                ElementsAre("--config=/etc/planish/planishd.yaml"));
  }
}

TEST_P(Kubernetes, SelectorsFindSomething) {
  std::set<std::string> components;
  for (const YAML::Node& workload : Workloads()) {
    const YAML::Node labels = At(workload, "/spec/template/metadata/labels");
    components.insert(labels["app.kubernetes.io/component"].as<std::string>());
    const YAML::Node selector = At(workload, "/spec/selector/matchLabels");
    for (const auto& label : selector) {
      EXPECT_EQ(labels[label.first.as<std::string>()].as<std::string>(), label.second.as<std::string>());
    }
  }
  std::vector<YAML::Node> selectors;
  for (const YAML::Node& service : objects_.OfKind("Service")) selectors.push_back(At(service, "/spec/selector"));
  for (const YAML::Node& budget : objects_.OfKind("PodDisruptionBudget")) {
    selectors.push_back(At(budget, "/spec/selector/matchLabels"));
  }
  for (const YAML::Node& policy : objects_.OfKind("NetworkPolicy")) {
    selectors.push_back(At(policy, "/spec/podSelector/matchLabels"));
  }
  EXPECT_GE(selectors.size(), 4u);
  for (const YAML::Node& selector : selectors) {
    EXPECT_TRUE(components.contains(selector["app.kubernetes.io/component"].as<std::string>())) << selector;
    EXPECT_EQ(selector["app.kubernetes.io/name"].as<std::string>(), "planish") << selector;
  }
  const YAML::Node service = objects_.Get("Service", "planish");
  EXPECT_EQ(At(service, "/spec/selector")["app.kubernetes.io/component"].as<std::string>(),
            IsFarm() ? "front" : "server");
  for (const YAML::Node& object : objects_.all) {
    if (object["kind"].as<std::string>() == "Namespace") continue;
    EXPECT_EQ(TextAt(object, "/metadata/namespace"), "planish") << object;
  }
}

class Farm : public Kubernetes {};
INSTANTIATE_TEST_SUITE_P(Overlays, Farm, ::testing::Values("farm"), [](const auto& test) { return test.param; });

// As many workers as the queue needs, by what servers tell.
TEST_P(Farm, WorkersAreScaledByTheQueue) {
  const YAML::Node scaler = objects_.Get("HorizontalPodAutoscaler", "planish-worker");
  EXPECT_EQ(TextAt(scaler, "/spec/scaleTargetRef/kind"), "Deployment");
  EXPECT_FALSE(At(objects_.Get("Deployment", "planish-worker"), "/spec/replicas").IsDefined()) << "autoscaling decides";
  const std::string metric = TextAt(scaler, "/spec/metrics/0/pods/metric/name");
  EXPECT_EQ(metric, "planish_queue_oldest_wait_seconds");
  EXPECT_THAT(ReadSource("deploy/kubernetes/README.md"), HasSubstr(metric));
}

// `key` of a mapping of a compose file, or of those that it merges ("<<", which yaml-cpp leaves as it is).
YAML::Node Merged(const YAML::Node& mapping, const std::string& key) {
  if (mapping[key].IsDefined()) return mapping[key];
  const YAML::Node base = mapping["<<"];
  return base.IsDefined() ? Merged(base, key) : YAML::Node(YAML::NodeType::Undefined);
}

class Compose : public ::testing::TestWithParam<std::string> {
 protected:
  const YAML::Node compose_ = YAML::Load(ReadSource("deploy/" + GetParam()));

  // Those that run planishd, by name.
  std::map<std::string, YAML::Node> Servers() const {
    std::map<std::string, YAML::Node> servers;
    for (const auto& service : compose_["services"]) {
      if (Merged(service.second, "image").as<std::string>() != "planish") continue;
      servers.emplace(service.first.as<std::string>(), service.second);
    }
    return servers;
  }
};
INSTANTIATE_TEST_SUITE_P(Files, Compose, ::testing::Values("compose.yaml", "compose.farm.yaml"),
                         [](const auto& test) { return test.param == "compose.yaml" ? "single" : "farm"; });

TEST_P(Compose, ServersMayDoAsLittleAsInKubernetes) {
  ASSERT_EQ(Servers().size(), GetParam() == "compose.yaml" ? 1u : 4u);
  for (const auto& [name, server] : Servers()) {
    SCOPED_TRACE(name);
    EXPECT_EQ(Merged(server, "read_only").as<std::string>(), "true");
    EXPECT_EQ(TextAt(Merged(server, "cap_drop"), "/0"), "ALL");
    EXPECT_EQ(TextAt(Merged(server, "security_opt"), "/0"), "no-new-privileges:true");
    EXPECT_FALSE(Merged(server, "user").IsDefined()) << "the image says that it is not root";
    const int grace = Merged(Merged(server, "environment"), "PLANISHD_GRACE").as<int>();
    EXPECT_GE(std::stoi(Merged(server, "stop_grace_period").as<std::string>()), grace + 10);
  }
}

// Of a farm nothing but the database writes to a disk.
TEST_P(Compose, NothingButDataIsKept) {
  for (const auto& [name, server] : Servers()) {
    SCOPED_TRACE(name);
    int kept = 0;
    for (const YAML::Node& volume : Merged(server, "volumes")) kept += !volume.as<std::string>().ends_with(":ro");
    if (GetParam() == "compose.yaml") {
      EXPECT_EQ(kept, 1);
    } else {
      EXPECT_EQ(kept, 0);
      EXPECT_EQ(TextAt(Merged(server, "tmpfs"), "/0"), "/var/lib/planish") << "the image has a volume there";
    }
  }
}

// Files come from the tree: of "configs", podman-compose says nothing and mounts nothing.
TEST_P(Compose, WhatIsMountedIsThere) {
  EXPECT_FALSE(compose_["configs"].IsDefined());
  int files = 0;
  for (const auto& service : compose_["services"]) {
    EXPECT_FALSE(Merged(service.second, "configs").IsDefined()) << service.first;
    for (const YAML::Node& volume : Merged(service.second, "volumes")) {
      const std::string source = volume.as<std::string>().substr(0, volume.as<std::string>().find(':'));
      if (source.starts_with("./")) {
        EXPECT_FALSE(ReadSource("deploy/" + source.substr(2)).empty()) << source;
        ++files;
      } else if (!source.starts_with("${")) {
        EXPECT_TRUE(compose_["volumes"][source].IsDefined()) << source;
      }
    }
    // Only what asks for credentials is open to the network.
    for (const YAML::Node& port : Merged(service.second, "ports")) {
      const std::string name = service.first.as<std::string>();
      if (name == "planish" || name == "proxy") continue;
      EXPECT_TRUE(port.as<std::string>().starts_with("127.0.0.1:")) << port;
    }
  }
  EXPECT_EQ(files, GetParam() == "compose.yaml" ? 5 : 1);
}

TEST(ComposeFarm, TheProxyKnowsTheFronts) {
  const YAML::Node services = YAML::Load(ReadSource("deploy/compose.farm.yaml"))["services"];
  const std::string proxy = ReadSource("deploy/proxy/haproxy.cfg");
  int fronts = 0;
  for (const auto& service : services) {
    const YAML::Node settings = Merged(service.second, "environment");
    if (!settings.IsDefined() || !Merged(settings, "PLANISHD_LISTEN").IsDefined()) continue;
    const auto port = [&](const std::string& key) {
      const std::string address = Merged(settings, key).as<std::string>();
      return address.substr(address.find(':') + 1);
    };
    const std::string name = service.first.as<std::string>();
    EXPECT_THAT(proxy, HasSubstr(absl::StrCat("\n  server ", name, " ", name, ":", port("PLANISHD_LISTEN"),
                                              " proto h2 check port ", port("PLANISHD_METRICS_LISTEN"), " ")));
    ++fronts;
  }
  EXPECT_EQ(fronts, 2);
}

// While the image's server is set up it answers on its socket, and then ends.
TEST(ComposeFarm, TheDatabaseIsAskedByTcp) {
  const YAML::Node services = YAML::Load(ReadSource("deploy/compose.farm.yaml"))["services"];
  EXPECT_THAT(At(services, "/database/healthcheck/test").as<std::vector<std::string>>(), ::testing::Contains("-h"));
}

TEST(Image, IsNotRootAndAsksItself) {
  const std::string file = ReadSource("Dockerfile");
  const std::string image = file.substr(file.rfind("\nFROM "));
  EXPECT_THAT(image, HasSubstr("\nFROM scratch\n")) << "nothing in it but what it needs";
  EXPECT_THAT(image, HasSubstr("\nUSER 10001:10001\n"));
  EXPECT_THAT(image, HasSubstr("\nHEALTHCHECK"));
  EXPECT_THAT(image, HasSubstr("\nENTRYPOINT [\"planishd\"]\n"));
  for (const std::string label : {"title", "description", "version", "revision", "created", "licenses"}) {
    EXPECT_THAT(image, HasSubstr(absl::StrCat("org.opencontainers.image.", label, "=")));
  }
  // Safe unless somebody says otherwise.
  const YAML::Node settings = YAML::Load(ReadSource("deploy/image.yaml"));
  for (const std::string key : {"tls-cert", "tls-key", "access-file", "metrics-listen"}) {
    EXPECT_TRUE(settings[key].IsDefined()) << key;
  }
  EXPECT_FALSE(settings["insecure"].IsDefined());
}

}  // namespace
}  // namespace planish::deploy
