// The command's parts that need no server: arguments, exit codes, words, JSON.
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/command_line.h"
#include "client/cli/exit_codes.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish::cli {
namespace {

using ::testing::HasSubstr;

ParsedArguments Parse(std::vector<const char*> words, const std::string& config = "") {
  words.insert(words.begin(), "planish");
  unsetenv("PLANISH_SERVER");
  setenv("PLANISH_CONFIG", config.c_str(), 1);
  return ParseArguments(static_cast<int>(words.size()), words.data());
}

// The arguments of a command that was given rightly.
template <typename CommandArguments>
CommandArguments Of(const ParsedArguments& parsed) {
  EXPECT_TRUE(parsed.arguments) << parsed.err;
  const auto* const arguments = parsed.arguments ? std::get_if<CommandArguments>(&*parsed.arguments) : nullptr;
  EXPECT_TRUE(arguments != nullptr) << "another command";
  return arguments != nullptr ? *arguments : CommandArguments();
}

template <typename CommandArguments>
CommandArguments Parsed(std::vector<const char*> words, const std::string& config = "") {
  return Of<CommandArguments>(Parse(std::move(words), config));
}

TEST(ArgumentsTest, UnwrapWithEverything) {
  const auto arguments = Parsed<UnwrapArguments>({"unwrap",
                                                  "in.obj",
                                                  "-o",
                                                  "out.obj",
                                                  "--server=h:1",
                                                  "--solver=minres",
                                                  "--system",
                                                  "full",
                                                  "--preconditioner=none",
                                                  "--hessian=exact",
                                                  "--boundary=convex",
                                                  "--precision=double",
                                                  "--seams=auto,hard:30,uv,materials,groups,edges:a.txt,edges:b.txt",
                                                  "--max-stretch=1.5",
                                                  "--texture-size=2048",
                                                  "--padding=0",
                                                  "--tiles=3",
                                                  "--effort=best",
                                                  "--tolerance=1e-7",
                                                  "--max-newton-iterations=7",
                                                  "--threads=3",
                                                  "--json",
                                                  "--progress=plain",
                                                  "--label=build=12",
                                                  "--label=note=a=b",
                                                  "--timeout=2.5"});
  EXPECT_EQ(arguments.inputs.first, "in.obj");
  EXPECT_EQ(arguments.output.path, "out.obj");
  EXPECT_EQ(arguments.server.address, "h:1");
  EXPECT_EQ(arguments.map.options.solver.method, Solver::kMinres);
  EXPECT_EQ(arguments.map.options.solver.system, System::kFull);
  EXPECT_EQ(arguments.map.options.solver.preconditioner, Preconditioner::kNone);
  EXPECT_EQ(arguments.map.options.solver.hessian, Hessian::kExact);
  EXPECT_EQ(arguments.map.options.boundary, Boundary::kConvex);
  EXPECT_EQ(arguments.map.options.precision, Precision::kDouble);
  EXPECT_EQ(arguments.map.options.seams, Seams::kAuto);
  EXPECT_EQ(arguments.map.options.hard_edge_degrees, 30);
  EXPECT_EQ(arguments.map.options.max_stretch, 1.5);
  EXPECT_EQ(arguments.map.options.texture_size, 2048);
  EXPECT_EQ(arguments.map.options.padding, 0);
  EXPECT_EQ(arguments.map.options.tiles, 3);
  EXPECT_EQ(arguments.map.options.effort, Effort::kBest);
  EXPECT_TRUE(arguments.map.options.pack);
  EXPECT_TRUE(arguments.map.seams.uv && arguments.map.seams.materials && arguments.map.seams.groups);
  EXPECT_THAT(arguments.map.seams.edge_files, ::testing::ElementsAre("a.txt", "b.txt"));
  EXPECT_EQ(arguments.map.options.solver.tolerance, 1e-7);
  EXPECT_EQ(arguments.map.options.solver.max_newton_iterations, 7);
  EXPECT_EQ(arguments.map.options.threads, 3);
  EXPECT_TRUE(arguments.json);
  EXPECT_EQ(arguments.terminal.progress, ProgressMode::kPlain);
  EXPECT_EQ(arguments.labels, (std::map<std::string, std::string>{{"build", "12"}, {"note", "a=b"}}));
  EXPECT_EQ(arguments.timeout_seconds, 2.5);
}

TEST(ArgumentsTest, Admin) {
  const auto drain = Parsed<AdminDrainArguments>({"admin", "drain", "--wait", "--server=h:1"});
  EXPECT_TRUE(drain.wait);
  const auto stats = Parsed<AdminStatsArguments>({"admin", "stats", "--json", "--server=h:1"});
  EXPECT_TRUE(stats.json);
  Parsed<AdminUndrainArguments>({"admin", "undrain", "--server=h:1"});
  Parsed<AdminConfigArguments>({"admin", "config", "--server=h:1"});
  EXPECT_EQ(Parse({"admin", "config"}).exit_code, kUsage) << "a private server has nothing to look after";
  EXPECT_EQ(Parse({"admin"}).exit_code, kUsage);
}

TEST(ArgumentsTest, SeamPolicies) {
  const auto policy = [](const char* list) {
    return Parsed<UnwrapArguments>({"unwrap", "in.obj", "-o", "o.obj", list}).map.options.seams;
  };
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "in.obj", "-o", "o.obj"}).map.options.seams, Seams::kAuto)
      << "the default";
  EXPECT_EQ(policy("--seams=none"), Seams::kNone);
  EXPECT_EQ(policy("--seams=keep"), Seams::kKeep);
  EXPECT_EQ(policy("--seams=needed"), Seams::kNeeded);
  EXPECT_EQ(policy("--seams=uv"), Seams::kNeeded) << "sources alone: these, and no more than needed";
  EXPECT_EQ(policy("--seams=uv,keep"), Seams::kKeep);
  EXPECT_EQ(policy("--seams=hard,auto"), Seams::kAuto);
  EXPECT_EQ(policy("--seams=uncut:a.txt"), Seams::kAuto) << "no source";
  EXPECT_EQ(Parse({"unwrap", "in.obj", "-o", "o.obj", "--seams=none,uncut:a.txt"}).exit_code, kUsage);
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "in.obj", "-o", "o.obj", "--seams=hard"}).map.options.hard_edge_degrees,
            66);
  EXPECT_FALSE(Parsed<UnwrapArguments>({"unwrap", "in.obj", "-o", "o.obj", "--pack=off"}).map.options.pack);
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "in.GLB", "-o", "o.obj", "--texcoord=1"}).texcoord, 1);
}

TEST(ArgumentsTest, SeveralFilesAreABatchUnlessTheyShareAnAtlas) {
  const auto parsed =
      Parsed<UnwrapArguments>({"unwrap", "a.obj", "b.glb", "-o", "out", "--format=glb", "--again", "--texcoord=1"});
  EXPECT_TRUE(parsed.batch);
  EXPECT_EQ(parsed.format, "glb");
  EXPECT_TRUE(parsed.again);
  EXPECT_THAT(parsed.inputs.more, ::testing::ElementsAre("b.glb"));
  EXPECT_TRUE(Parsed<UnwrapArguments>({"unwrap", ".", "-o", "out"}).batch) << "a directory";
  EXPECT_TRUE(Parsed<UnwrapArguments>({"unwrap", "a.obj", "b.obj", "-o", "out", "--detach", "--server=h:1"}).batch);
  EXPECT_FALSE(Parsed<UnwrapArguments>({"unwrap", "a.obj", "b.obj", "-o", "out", "--one-atlas"}).batch);
  EXPECT_FALSE(Parsed<UnwrapArguments>({"unwrap", "a.obj", "-o", "out/"}).batch);
}

TEST(ArgumentsTest, AtlasesPerFileMakeOneJobAndOthersABatch) {
  EXPECT_FALSE(Parsed<UnwrapArguments>({"unwrap", "a.obj", "b.glb", "-o", "out/", "--atlas-per=file"}).batch);
  const auto parsed = Parsed<UnwrapArguments>({"unwrap", "a.obj", "b.glb", "-o", "out/", "--atlas-per=mesh"});
  EXPECT_TRUE(parsed.batch);
  EXPECT_EQ(parsed.map.atlas_per, AtlasPer::kMesh);
}

TEST(ArgumentsTest, Pack) {
  const auto parsed = Parsed<PackArguments>({"pack", "in.glb", "-o", "o.glb", "--texture-size=2048", "--padding=8",
                                             "--tiles=2", "--density=keep", "--texcoord=1", "--preview=p.svg"});
  EXPECT_EQ(parsed.input, "in.glb");
  EXPECT_EQ(parsed.output.path, "o.glb");
  EXPECT_EQ(parsed.options.texture_size, 2048);
  EXPECT_EQ(parsed.options.padding, 8);
  EXPECT_EQ(parsed.options.tiles, 2);
  EXPECT_TRUE(parsed.keep_density);
  EXPECT_EQ(parsed.texcoord, 1);
  EXPECT_EQ(parsed.output.preview, "p.svg");
  const auto weighted =
      Parsed<PackArguments>({"pack", "in.obj", "-o", "-", "--density=equal", "--weight=skin=2", "--weight=a=b=0.5"});
  EXPECT_FALSE(weighted.keep_density);
  EXPECT_THAT(weighted.material_weights,
              ::testing::ElementsAre(::testing::Pair("a=b", 0.5), ::testing::Pair("skin", 2.0)));
}

TEST(ArgumentsTest, LightmapsAreASecondSetOfUv) {
  const auto plain = Parsed<UnwrapArguments>({"unwrap", "a.glb", "-o", "b.glb", "--texcoord=2"});
  EXPECT_EQ(plain.output.texcoord, std::nullopt);
  const auto parsed = Parsed<UnwrapArguments>({"unwrap", "a.glb", "-o", "b.glb", "--preset=lightmap"});
  EXPECT_EQ(parsed.texcoord, 0);
  EXPECT_EQ(parsed.output.texcoord, 1);
  EXPECT_EQ(parsed.map.options.padding, 4);
  EXPECT_EQ(parsed.map.options.seams, Seams::kAuto);
  EXPECT_EQ(parsed.map.options.prefer, Prefer::kTexture);
  EXPECT_EQ(plain.map.options.prefer, Prefer::kSeams);
  EXPECT_TRUE(parsed.map.seams.uv && parsed.map.seams.uv_is_optional);
  const auto own = Parsed<UnwrapArguments>({"unwrap", "a.glb", "-o", "b.glb", "--output-texcoord=3",
                                            "--preset=lightmap", "--padding=1", "--seams=keep,hard"});
  EXPECT_EQ(own.output.texcoord, 3);
  EXPECT_EQ(own.map.options.padding, 1);
  EXPECT_EQ(own.map.options.seams, Seams::kKeep);
  EXPECT_FALSE(own.map.seams.uv);
}

TEST(ArgumentsTest, SuggestsWhatWasMeant) {
  const auto said = [](const std::vector<const char*>& words) {
    const ParsedArguments parsed = Parse(words);
    EXPECT_EQ(parsed.exit_code, 2);
    return parsed.err;
  };
  EXPECT_THAT(said({"unwarp", "a.obj"}), HasSubstr("Did you mean unwrap?"));
  EXPECT_THAT(said({"jobs", "lst"}), HasSubstr("Did you mean list?"));
  EXPECT_THAT(said({"unwrap", "a.obj", "--texturesize=64"}), HasSubstr("Did you mean --texture-size?"));
  EXPECT_THAT(said({"frobnicate"}), Not(HasSubstr("Did you mean")));
}

TEST(ArgumentsTest, Preview) {
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "in.obj", "-o", "o.obj", "--preview=a.png"}).output.preview, "a.png");
  EXPECT_EQ(Parsed<JobsWatchArguments>(
                {"jobs", "watch", "x", "--server=h:1", "--mesh=in.obj", "-o", "o.obj", "--preview=a.svg"})
                .output.preview,
            "a.svg");
}

TEST(ArgumentsTest, Inspect) {
  const auto parsed = Parsed<InspectArguments>({"inspect", "in.obj", "--json"});
  EXPECT_EQ(parsed.input, "in.obj");
  EXPECT_TRUE(parsed.json);
  EXPECT_EQ(Parse({"inspect"}).exit_code, kUsage);
}

TEST(ArgumentsTest, Scheduling) {
  const auto parsed = Parsed<UnwrapArguments>(
      {"unwrap", "in.obj", "-o", "o.obj", "--priority=high", "--deadline=90", "--budget=2.5", "--fresh"});
  EXPECT_EQ(parsed.scheduling.priority, Priority::kHigh);
  EXPECT_EQ(parsed.scheduling.timeout, Seconds(90));
  EXPECT_EQ(parsed.scheduling.compute_budget, Seconds(2.5));
  EXPECT_TRUE(parsed.scheduling.fresh);
  const Scheduling by_default = Parsed<UnwrapArguments>({"unwrap", "in.obj", "-o", "o.obj"}).scheduling;
  EXPECT_EQ(by_default.priority, Priority::kNormal);
  EXPECT_EQ(by_default.timeout, Seconds(0));
  EXPECT_FALSE(by_default.fresh);
  for (const char* bad : {"--priority=urgent", "--deadline=0", "--budget=-1"}) {
    EXPECT_EQ(Parse({"unwrap", "in.obj", "-o", "o.obj", bad}).exit_code, kUsage) << bad;
  }
}

TEST(ArgumentsTest, Estimate) {
  const auto of_file = Parsed<EstimateArguments>({"estimate", "in.obj"});
  EXPECT_EQ(of_file.input, "in.obj");
  EXPECT_EQ(Parsed<EstimateArguments>({"estimate", "--triangles=5000000000"}).triangles, 5'000'000'000);
  for (const auto& bad : std::vector<std::vector<const char*>>{
           {"estimate"}, {"estimate", "in.obj", "--triangles=5"}, {"estimate", "--triangles=0"}}) {
    EXPECT_EQ(Parse(bad).exit_code, kUsage);
  }
}

TEST(ArgumentsTest, JobsStopAndLabels) {
  Parsed<JobsStopArguments>({"jobs", "stop", "abc", "--server=h:1"});
  EXPECT_EQ(Parsed<JobsStopArguments>({"jobs", "stop", "abc", "--server=h:1"}).job, "jobs/abc");
  const auto list = Parsed<JobsListArguments>(
      {"jobs", "list", "--label=file=night/*", "--filter=labels:build", "--state=EXPIRED", "--server=h:1"});
  EXPECT_EQ(list.labels.at("file"), "night/*");
  EXPECT_EQ(list.filter, "labels:build");
  EXPECT_EQ(list.state, JobState::kExpired);
}

TEST(ArgumentsTest, JobsCommands) {
  const auto parsed =
      Parsed<JobsWatchArguments>({"jobs", "watch", "abc", "--mesh", "in.obj", "-o", "-", "--server=h:1"});
  EXPECT_EQ(parsed.job, "jobs/abc");
  EXPECT_EQ(parsed.input, "in.obj");
  const auto list = Parsed<JobsListArguments>({"jobs", "list", "--state=FAILED", "--limit=3", "--server=h:1"});
  EXPECT_EQ(list.state, JobState::kFailed);
  EXPECT_EQ(list.limit, 3);
  Parsed<JobsCancelArguments>({"jobs", "cancel", "jobs/x", "--server=h:1"});
  Parsed<JobsDeleteArguments>({"jobs", "delete", "jobs/x", "--server=h:1"});
  Parsed<JobsShowArguments>({"jobs", "show", "jobs/x", "--server=h:1"});
}

TEST(ArgumentsTest, ServerFromTheEnvironment) {
  setenv("PLANISH_SERVER", "farm:7741", 1);
  const char* words[] = {"planish", "jobs", "list"};
  const ParsedArguments parsed = ParseArguments(3, words);
  unsetenv("PLANISH_SERVER");
  EXPECT_EQ(Of<JobsListArguments>(parsed).server.address, "farm:7741");
}

TEST(ArgumentsTest, HowToReachAServer) {
  const auto parsed = Parsed<JobsListArguments>({"jobs", "list", "--server=h:1", "--tls", "--tls-ca=ca",
                                                 "--tls-cert=cert", "--tls-key=key", "--tls-server-name=name",
                                                 "--token-file=file", "--token-over-plaintext"});
  const ClientOptions options = WithServer({}, parsed.server);
  EXPECT_TRUE(options.tls);
  EXPECT_EQ(options.tls_ca_file, "ca");
  EXPECT_EQ(options.tls_cert_file, "cert");
  EXPECT_EQ(options.tls_key_file, "key");
  EXPECT_EQ(options.tls_server_name, "name");
  EXPECT_EQ(options.token_file, "file");
  EXPECT_TRUE(options.token_over_plaintext);
}

TEST(ArgumentsTest, HowToReachAServerByTheEnvironment) {
  setenv("PLANISH_TLS", "1", 1);
  setenv("PLANISH_TLS_CA", "ca", 1);
  setenv("PLANISH_TOKEN", "secret", 1);
  const auto parsed = Parsed<VersionArguments>({"version", "--server=h:1"});
  const ClientOptions options = WithServer({}, parsed.server);
  const auto with_file = Parsed<VersionArguments>({"version", "--server=h:1", "--token-file=file"});
  const ClientOptions file = WithServer({}, with_file.server);
  unsetenv("PLANISH_TLS");
  unsetenv("PLANISH_TLS_CA");
  unsetenv("PLANISH_TOKEN");
  EXPECT_TRUE(options.tls);
  EXPECT_EQ(options.tls_ca_file, "ca");
  EXPECT_EQ(options.token, "secret");
  EXPECT_EQ(file.token, "");
  EXPECT_EQ(file.token_file, "file");
}

TEST(ArgumentsTest, BadUsageExitsWith2AndAHint) {
  const std::vector<std::pair<std::vector<const char*>, const char*>> cases = {
      {{}, "subcommand"},
      {{"unwrap"}, "IN"},
      {{"unwrap", "in.obj"}, "-o in_uv.obj"},
      {{"unwrap", "in.stl"}, "-o in_uv.obj"},
      {{"unwrap", "a.obj", "b.obj"}, "A batch needs -o DIRECTORY/"},
      {{"unwrap", "."}, "A batch needs -o DIRECTORY/"},
      {{"unwrap", "a.obj", "b.obj", "--detach", "--server=h:1"}, "A batch needs -o DIRECTORY/"},
      {{"unwrap", "a.obj", "b.obj", "-o", "out", "--detach"}, "--server"},
      {{"unwrap", "a.obj", "b.obj", "-o", "-"}, "DIRECTORY/"},
      {{"unwrap", "a.obj", "b.obj", "-o", "out", "--preview=x.png"}, "draw one mesh"},
      {{"unwrap", "a.obj", "b.obj", "-o", "out", "--seams=edges:a.txt"}, "the vertices of one mesh"},
      {{"unwrap", "a.obj", "b.obj", "-o", "out", "--format=stl"}, "stl"},
      {{"unwrap", "a.obj", "-o", "out", "--format=obj"}, "--format is for batches"},
      {{"unwrap", "a.obj", "-o", "out", "--again"}, "--again is for batches"},
      {{"unwrap", "a.obj", "b.obj", "--one-atlas"}, "-o DIRECTORY/"},
      {{"unwrap", "a.obj", ".", "--one-atlas", "-o", "out"}, "is a directory"},
      {{"unwrap", "a.obj", "b.obj", "--one-atlas", "--detach", "--server=h:1"}, "one file"},
      {{"unwrap", "a.obj", ".", "--atlas-per=file", "-o", "out"}, "--atlas-per=file takes files; . is a directory"},
      {{"unwrap", "a.obj", "b.obj", "--atlas-per=file", "--detach", "--server=h:1"}, "one file"},
      {{"unwrap", "a.obj", "b.obj", "-o", "out", "--one-atlas", "--atlas-per=group"}, "--one-atlas"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--atlas-per=group", "--pack=off"},
       "--atlas-per is about charts in an atlas"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--atlas-per=group", "--seams=none"}, "--atlas-per needs charts"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--atlas-layout=stacked"}, "give both"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--atlas-per=group", "--atlas-layout=stacked", "--report=x.html"},
       "--report"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--weight=skin=2", "--seams=none"}, "--weight needs charts"},
      {{"unwrap", "in.glb", "-o", "x.glb", "--texcoord=64"}, "texcoord"},
      {{"unwrap", "in.obj", "-o", "-", "--json"}, "stdout"},
      {{"unwrap", "in.obj", "--detach"}, "--server"},
      {{"unwrap", "in.obj", "--detach", "--server=h:1", "-o", "x.obj"}, "jobs watch"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--solver=gauss"}, "gauss"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--tolerance=1"}, "tolerance"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--tolerance=nan"}, "tolerance"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--texels-per-unit=0"}, "texels-per-unit"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--texels-per-unit=nan"}, "texels-per-unit"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--texture-size=most"}, "texture-size"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--max-newton-iterations=0"}, "max-newton-iterations"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--no-such-flag"}, "no-such-flag"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=uw"}, "'uw' is neither"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams="}, "--seams"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=uv,,hard"}, "'' is neither"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=edges:"}, "'edges:' is neither"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=keep,auto"}, "keep and auto exclude each other"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=none,uv"}, "no edge is cut"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=hard:0"}, "above 0 and up to 180"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=hard:nan"}, "above 0 and up to 180"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=hard:60deg"}, "above 0 and up to 180"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--seams=uv", "--max-stretch=1.1"}, "--seams=auto,uv"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--max-stretch=1"}, "max-stretch"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--texture-size=8"}, "texture-size"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--padding=-1"}, "padding"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--tiles=0"}, "tiles"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--pack=maybe"}, "maybe"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--texcoord=1"}, "is no glTF"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--preview=x.jpg"}, ".png or .svg"},
      {{"unwrap", "in.obj", "--detach", "--server=h:1", "--preview=x.png"}, "nothing to draw"},
      {{"jobs", "watch", "x", "--server=h:1", "--preview=x.png"}, "--mesh"},
      {{"pack", "in.obj"}, "planish pack in.obj -o in_uv.obj"},
      {{"pack", "in.obj", "-o", "x.obj", "--density=some"}, "some"},
      {{"pack", "in.obj", "-o", "x.obj", "--weight=skin"}, "MATERIAL=X"},
      {{"pack", "in.obj", "-o", "x.obj", "--weight=skin=0"}, "0.01 to 100"},
      {{"pack", "in.obj", "-o", "x.obj", "--pack=off"}, "--pack"},
      {{"pack", "in.obj", "-o", "x.obj", "--texels-per-unit=9", "--density=keep"}, "leave one of them out"},
      {{"pack", "in.obj", "-o", "x.obj", "--texture-size=32", "--padding=32"}, "leaves no room"},
      {{"inspect", "in.glb", "--texcoord=64"}, "texcoord"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--pack=off", "--padding=4"}, "--pack=off"},
      {{"unwrap", "in.obj", "-o", "x.obj", "--pack=off", "--effort=best"}, "--pack=off"},
      {{"pack", "in.obj", "-o", "x.obj", "--effort=0.3"}, "fast"},
      {{"jobs", "list"}, "--server"},
      {{"jobs", "watch", "x", "--mesh", "in.obj", "--server=h:1"}, "-o"},
  };
  for (const auto& [words, hint] : cases) {
    const ParsedArguments parsed = Parse(words);
    EXPECT_FALSE(parsed.arguments);
    EXPECT_EQ(parsed.exit_code, kUsage);
    EXPECT_THAT(parsed.err, HasSubstr(hint));
    EXPECT_EQ(parsed.out, "");
  }
}

TEST(ArgumentsTest, HelpGoesToStdoutWithExamples) {
  for (const std::vector<const char*>& words :
       {std::vector<const char*>{"--help"}, std::vector<const char*>{"unwrap", "--help"}}) {
    const ParsedArguments parsed = Parse(words);
    EXPECT_FALSE(parsed.arguments);
    EXPECT_EQ(parsed.exit_code, 0);
    EXPECT_THAT(parsed.out, HasSubstr("Examples:"));
    EXPECT_EQ(parsed.err, "");
  }
}

TEST(ArgumentsTest, ShortHelpHasTheMostUsedFlagsAndLongHelpAll) {
  const std::string brief = Parse({"unwrap", "-h"}).out, full = Parse({"unwrap", "--help"}).out;
  EXPECT_THAT(brief, HasSubstr("-o, --output OUT"));
  EXPECT_THAT(brief, ::testing::Not(HasSubstr("\n  --solver")));
  EXPECT_THAT(brief, HasSubstr("planish unwrap --help says more"));
  EXPECT_THAT(full, HasSubstr("\nSolver:\n  --solver"));
}

TEST(ArgumentsTest, QuietShowsNoProgressUnlessItIsAskedFor) {
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "a.obj", "-o", "b.obj"}).terminal.ShownProgress(), ProgressMode::kAuto);
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "a.obj", "-o", "b.obj", "-q"}).terminal.ShownProgress(),
            ProgressMode::kNone);
  EXPECT_TRUE(Parsed<UnwrapArguments>({"unwrap", "a.obj", "-o", "b.obj", "-v"}).terminal.verbose);
  EXPECT_THAT(Parse({"unwrap", "a.obj", "-o", "b.obj", "-v", "-q"}).err, HasSubstr("--quiet excludes --verbose"));
  EXPECT_TRUE(Parsed<JobsWatchArguments>({"jobs", "watch", "1", "--server=a:1", "--quiet"}).terminal.quiet);
  EXPECT_EQ(
      Parsed<UnwrapArguments>({"unwrap", "a.obj", "-o", "b.obj", "-q", "--progress=json"}).terminal.ShownProgress(),
      ProgressMode::kJson);
  EXPECT_EQ(Parsed<UnwrapArguments>({"unwrap", "a.obj", "-o", "b.obj", "--color=never"}).terminal.color,
            ColorMode::kNever);
}

TEST(ArgumentsTest, FlagsComeFromTheConfigurationFile) {
  const std::string config = ::testing::TempDir() + "/planish_cli_test.toml";
  const auto parse = [&](const std::string& text, std::vector<const char*> words) {
    std::ofstream(config) << text;
    return Parse(std::move(words), config);
  };
  const std::string text =
      "server = \"farm:1\"\nquiet = true\ntexture-size = 512\n[unwrap]\ntexture-size = 2048\n[jobs.list]\nlimit = 7\n";
  const auto unwrap = Of<UnwrapArguments>(parse(text, {"unwrap", "in.obj", "-o", "out.obj"}));
  EXPECT_EQ(unwrap.server.address, "farm:1");
  EXPECT_TRUE(unwrap.terminal.quiet);
  EXPECT_EQ(unwrap.map.options.texture_size, 2048) << "the command's section goes over what is for all";
  EXPECT_EQ(Of<UnwrapArguments>(parse(text, {"unwrap", "in.obj", "-o", "o.obj", "--texture-size=64"}))
                .map.options.texture_size,
            64);
  EXPECT_EQ(Of<PackArguments>(parse(text, {"pack", "in.obj", "-o", "out.obj"})).options.texture_size, 512);
  EXPECT_EQ(Of<JobsListArguments>(parse(text, {"jobs", "list"})).limit, 7);
  EXPECT_EQ(Of<UnwrapArguments>(parse(text, {"unwrap", "-o", "out.obj", "--", "-in.obj"})).inputs.first, "-in.obj");
  EXPECT_THAT(parse("serve = 1\n", {"unwrap", "in.obj", "-o", "out.obj"}).err, HasSubstr("no flag --serve"));
  EXPECT_THAT(parse("[wrap]\njson = true\n", {"inspect", "in.obj"}).err, HasSubstr("no command wrap"));
  EXPECT_EQ(parse("texture-size = 3\n", {"unwrap", "in.obj", "-o", "out.obj"}).exit_code, kUsage);
}

TEST(ExitCodesTest, FollowTheError) {
  const auto code = [](ErrorCode c, const char* reason) { return ExitCodeOf(Error(c, reason, "")); };
  EXPECT_EQ(code(ErrorCode::kInvalidArgument, "MESH_CLOSED"), kFailed);
  EXPECT_EQ(code(ErrorCode::kInvalidArgument, "FILE_MALFORMED"), kUsage);
  EXPECT_EQ(code(ErrorCode::kNotFound, "FILE_UNREADABLE"), kUsage);
  EXPECT_EQ(code(ErrorCode::kInvalidArgument, "OPTIONS_INVALID"), kUsage);
  EXPECT_EQ(code(ErrorCode::kUnavailable, "SERVER_UNREACHABLE"), kServerUnreachable);
  EXPECT_EQ(code(ErrorCode::kUnavailable, "PRIVATE_SERVER_FAILED"), kServerUnreachable);
  EXPECT_EQ(code(ErrorCode::kUnavailable, "TLS_FAILED"), kServerUnreachable);
  EXPECT_EQ(code(ErrorCode::kUnauthenticated, "CREDENTIALS_INVALID"), kUsage);
  EXPECT_EQ(code(ErrorCode::kPermissionDenied, "RIGHT_MISSING"), kUsage);
  EXPECT_EQ(code(ErrorCode::kDeadlineExceeded, "DEADLINE_EXCEEDED"), kFailed);
  EXPECT_EQ(code(ErrorCode::kCancelled, "CANCELLED"), kFailed);
}

TEST(JsonTest, FailureHasStateAndError) {
  const Json json =
      ReportJson(FailureOf(Error(ErrorCode::kInvalidArgument, "MESH_CLOSED", "closed", {{"genus", "0"}})));
  EXPECT_EQ(json["state"], "FAILED");
  EXPECT_EQ(json["error"]["code"], "INVALID_ARGUMENT");
  EXPECT_EQ(json["error"]["reason"], "MESH_CLOSED");
  EXPECT_EQ(json["error"]["metadata"]["genus"], "0");
}

TEST(JsonTest, WhatIsNoUtf8IsReplaced) {
  EXPECT_EQ(ValidUtf8("文件 a.obj"), "文件 a.obj");
  EXPECT_EQ(ValidUtf8("a\xff\xe6\x96.obj"), "a\xef\xbf\xbd\xef\xbf\xbd.obj");
}

TEST(NumbersTest, ForPeople) {
  EXPECT_EQ(WithCommas(0), "0");
  EXPECT_EQ(WithCommas(999), "999");
  EXPECT_EQ(WithCommas(1000), "1,000");
  EXPECT_EQ(WithCommas(-1234567), "-1,234,567");
  EXPECT_EQ(Significant(341.23, 3), "341");
  EXPECT_EQ(Significant(16932.7, 3), "16900");
  EXPECT_EQ(Significant(3.02e7, 3), "3.02e+07");
  EXPECT_EQ(Significant(179.84, 4), "179.8");
  EXPECT_EQ(Duration(0.424), "0.42 s");
  EXPECT_EQ(Duration(12.34), "12.3 s");
  EXPECT_EQ(Duration(59.96), "1:00");
  EXPECT_EQ(Duration(3725), "1:02:05");
}

}  // namespace
}  // namespace planish::cli
