#include "client/cli/arguments.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "client/cli/flags.h"
#include "client/files/mesh_file.h"

namespace planish::cli {
namespace {

void AddSecurity(CLI::App& app, ServerArguments& server) {
  app.add_flag("--tls", server.tls, "Encrypt, and require a server certificate that this system trusts")
      ->envname("PLANISH_TLS");
  app.add_option("--tls-ca", server.tls_ca_file, "Like --tls, but trust only the certificate authorities in this file")
      ->envname("PLANISH_TLS_CA")
      ->type_name("PEM");
  app.add_option("--tls-cert", server.tls_cert_file, "Client certificate, for servers that ask for one")
      ->envname("PLANISH_TLS_CERT")
      ->type_name("PEM");
  app.add_option("--tls-key", server.tls_key_file, "Private key of --tls-cert")
      ->envname("PLANISH_TLS_KEY")
      ->type_name("PEM");
  app.add_option("--tls-server-name", server.tls_server_name, "Name that the server's certificate must have [the host]")
      ->envname("PLANISH_TLS_SERVER_NAME")
      ->type_name("NAME");
  app.add_option("--token-file", server.token_file,
                 "File with your access token; or put the token itself into PLANISH_TOKEN")
      ->envname("PLANISH_TOKEN_FILE")
      ->type_name("FILE");
  app.add_flag("--token-over-plaintext", server.token_over_plaintext,
               "Send the token to another machine even without TLS; anybody on the way can read it");
}

}  // namespace

const char* ToString(ColorMode mode) {
  switch (mode) {
    case ColorMode::kAuto:
      return "auto";
    case ColorMode::kAlways:
      return "always";
    case ColorMode::kNever:
      return "never";
  }
  return "";
}

const char* ToString(ProgressMode mode) {
  switch (mode) {
    case ProgressMode::kAuto:
      return "auto";
    case ProgressMode::kBar:
      return "bar";
    case ProgressMode::kPlain:
      return "plain";
    case ProgressMode::kJson:
      return "json";
    case ProgressMode::kNone:
      return "none";
  }
  return "";
}

const char* ToString(Textures textures) {
  switch (textures) {
    case Textures::kTransfer:
      return "transfer";
    case Textures::kKeep:
      return "keep";
    case Textures::kDrop:
      return "drop";
  }
  return "";
}

void AddLabels(CLI::App& app, std::map<std::string, std::string>& labels, const std::string& description) {
  app.add_option_function<std::vector<std::string>>(
         "--label",
         [&labels](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) {
             const std::size_t equals = text.find('=');
             if (equals == std::string::npos || equals == 0) {
               throw CLI::ValidationError("--label", text + " is not of the form KEY=VALUE");
             }
             labels[text.substr(0, equals)] = text.substr(equals + 1);
           }
         },
         description)
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

void AddServer(CLI::App& app, ServerArguments& server, const std::string& otherwise) {
  app.add_option("--server", server.address, "host:port or unix:/path; " + otherwise)
      ->envname("PLANISH_SERVER")
      ->type_name("ADDR");
  const std::string group = app.option_defaults()->get_group();
  app.option_defaults()->group("Security");
  AddSecurity(app, server);
  app.option_defaults()->group(group);
}

void AddJson(CLI::App& app, bool& json) {
  app.add_flag("--json", json, "Print one JSON object on stdout");
}

void AddTerminal(CLI::App& app, TerminalArguments& terminal) {
  app.option_defaults()->group("Terminal");
  app.add_flag("-q,--quiet", terminal.quiet, "Print only errors on stderr");
  Choices<ColorMode>{{ColorMode::kAuto, ColorMode::kAlways, ColorMode::kNever}}.AddTo(
      app, "--color", terminal.color, "Colours on stderr; auto: on a terminal, unless NO_COLOR is set [auto]");
}

void AddProgress(CLI::App& app, TerminalArguments& terminal) {
  Choices<ProgressMode>{
      {ProgressMode::kAuto, ProgressMode::kBar, ProgressMode::kPlain, ProgressMode::kJson, ProgressMode::kNone}}
      .AddTo(app, "--progress", terminal.progress,
             "Progress of a running job on stderr; auto: a bar on a terminal, otherwise nothing, but a line per file "
             "for a batch, and as plain with --verbose");
  app.add_flag("-v,--verbose", terminal.verbose,
               "Print more on stderr: which server answers, what is sent, seconds of each stage, memory, charts and "
               "every warning")
      ->excludes("--quiet");
}

void AddOutput(CLI::App& app, std::string& path, bool takes_batch) {
  app.add_option("-o,--output", path,
                 std::string("Output file; its extension chooses the format: .obj, .ply, .off, .gltf, .glb or .drc; - "
                             "is stdout; in a directory the file has the input's name") +
                     (takes_batch ? "; a batch needs a directory" : ""))
      ->type_name("OUT");
}

void AddPreview(CLI::App& app, std::string& preview) {
  app.add_option(
         "--preview", preview,
         "Draw the layout alone, tile by tile, blue where the map shrinks the surface and red where it enlarges it")
      ->type_name("PNG|SVG");
}

void AddTimeout(CLI::App& app, double& seconds, const std::string& description) {
  app.add_option("--timeout", seconds, description)
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
}

void AddTexcoord(CLI::App& app, int& texcoord) {
  app.add_option("--texcoord", texcoord, "Read the UV set TEXCOORD_N of a glTF, N up to 63 [0]")
      ->check(CLI::Range(0, kLargestTexcoord).description(""))
      ->type_name("N");
}

void AddOutputTexcoord(CLI::App& app, std::optional<int>& texcoord) {
  app.add_option_function<int>(
         "--output-texcoord", [&texcoord](const int& n) { texcoord = n; },
         "Write the new UV to the set TEXCOORD_N; other sets stay unchanged [that of --texcoord]")
      ->check(CLI::Range(0, kLargestTexcoord).description(""))
      ->type_name("N");
}

void AddTextures(CLI::App& app, TextureArguments& textures) {
  Choices<Textures>{{Textures::kTransfer, Textures::kKeep, Textures::kDrop}}.AddTo(
      app, "--textures", textures.textures,
      "Images of a glTF or OBJ that use the replaced UV. transfer: redraw them for the new map; keep: keep images and "
      "old UV, and write the new UV to the next free set; drop: remove the references [transfer]");
  AddImageFlags(app, textures);
  app.add_option_function<std::string>(
         "--bake", [&textures](const std::string&) { textures.bake_colors = true; },
         "Write colours into a base colour image; colors: the vertex colours [nothing]")
      ->check(CLI::IsMember({"colors"}).description(""))
      ->type_name("colors");
}

void AddImageFlags(CLI::App& app, TextureArguments& textures) {
  app.add_flag("--merge-materials", textures.merge_materials,
               "glTF: merge materials that differ only in images and factors; the merged one has one set of images, "
               "and each mesh one primitive for it");
  app.add_option("--memory", textures.memory_mb,
                 "Memory limit for redrawing one image, in megabytes [half of the machine's memory]")
      ->check(CLI::Range(1, 1 << 24).description(""))
      ->type_name("MB");
  app.add_flag("--allow-outside", textures.allow_outside, "Also read images outside of the model's folder");
}

void AddScheduling(CLI::App& app, Scheduling& scheduling) {
  app.add_option_function<std::string>(
         "--priority",
         [&scheduling](const std::string& name) {
           for (const Priority priority : {Priority::kLow, Priority::kNormal, Priority::kHigh}) {
             if (name == ToString(priority)) scheduling.priority = priority;
           }
         },
         "Order among waiting jobs: high, as if it had waited 10 minutes longer; low, 10 minutes less [normal]")
      ->check(CLI::IsMember({"low", "normal", "high"}).description(""))
      ->type_name("low|normal|high");
  app.add_option_function<double>(
         "--deadline", [&scheduling](const double& seconds) { scheduling.timeout = Seconds(seconds); },
         "The server fails the job if it has not ended SECONDS after it was accepted; time in the queue counts")
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
  app.add_option_function<double>(
         "--budget", [&scheduling](const double& seconds) { scheduling.compute_budget = Seconds(seconds); },
         "The server stops the job after it has run for SECONDS, and delivers the best map so far")
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
  app.add_flag("--fresh", scheduling.fresh,
               "The server computes again even if it has stored the result for this mesh and these options");
}

ClientOptions WithServer(ClientOptions options, const ServerArguments& server) {
  options.tls = server.tls;
  options.tls_ca_file = server.tls_ca_file;
  options.tls_cert_file = server.tls_cert_file;
  options.tls_key_file = server.tls_key_file;
  options.tls_server_name = server.tls_server_name;
  options.token_file = server.token_file;
  options.token_over_plaintext = server.token_over_plaintext;
  const char* token = std::getenv("PLANISH_TOKEN");
  if (token != nullptr && server.token_file.empty()) options.token = token;
  return options;
}

namespace {

// Parses "skin=2" and adds it to `material_weights`; the name may have equals signs. Throws CLI::ValidationError.
void AddMaterialWeight(const std::string& text, std::map<std::string, double>* material_weights) {
  const std::size_t equals = text.rfind('=');
  double weight = 0;
  if (equals != std::string::npos) {
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data() + equals + 1, end, weight);
    if (error != std::errc() || rest != end) weight = 0;
  }
  if (!(weight >= 0.01 && weight <= 100)) {
    throw CLI::ValidationError("--weight", text + " is not MATERIAL=X with X from 0.01 to 100");
  }
  (*material_weights)[text.substr(0, equals)] = weight;
}

}  // namespace

void AddWeights(CLI::App& app, std::map<std::string, double>& material_weights, const std::string& pieces) {
  app.add_option_function<std::vector<std::string>>(
         "--weight",
         [&material_weights](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) AddMaterialWeight(text, &material_weights);
         },
         "Multiply the texel density of the " + pieces +
             " of a material by X, 0.01 to 100; repeat the flag for further materials")
      ->type_name("MATERIAL=X");
}

void AddTileSize(CLI::App& app, int& texture_size) {
  app.add_option("--texture-size", texture_size, "Texels per side of a tile, 16 to 65536 [1024]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
}

void AddTiles(CLI::App& app, int& tiles) {
  app.add_option("--tiles", tiles, "Tiles (UDIM 1001, 1002, ...) that charts may lie in, up to 100 [1]")
      ->check(CLI::Range(1, 100).description(""))
      ->type_name("N");
}

std::vector<std::string> InputArguments::All() const {
  std::vector<std::string> all = {first};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

// ---- Checks

std::string FirstProblem(std::initializer_list<std::string> problems) {
  for (const std::string& problem : problems) {
    if (!problem.empty()) return problem;
  }
  return "";
}

std::string CheckTexcoord(int texcoord, const std::string& input) {
  const std::optional<MeshFormat> format = FormatOfPath(input);
  const bool is_gltf = format == MeshFormat::kGltf || format == MeshFormat::kGlb;
  if (texcoord == 0 || input.empty() || IsStream(input) || is_gltf) return "";
  return "--texcoord=" + std::to_string(texcoord) + ": " + input +
         " is no glTF; other formats have one set of UV, number 0";
}

std::string CheckStreams(const std::vector<std::string>& inputs) {
  return std::count(inputs.begin(), inputs.end(), "-") > 1 ? "- (standard input) can be read once only" : "";
}

std::string CheckPreview(const std::string& preview) {
  if (preview.empty() || preview.ends_with(".png") || preview.ends_with(".svg")) return "";
  return "--preview=" + preview + ": the name must end in .png or .svg";
}

std::string CheckStdout(const std::string& output, bool json) {
  if (output != "-" || !json) return "";
  return "-o - and --json both want stdout; write the mesh to a file, or leave --json out";
}

std::string CheckPainting(const TextureArguments& textures) {
  if (textures.textures == Textures::kTransfer) return "";
  const std::string given = std::string("--textures=") + ToString(textures.textures);
  if (textures.merge_materials) return "--merge-materials draws images anew, and " + given + " does not";
  if (textures.bake_colors) return "--bake draws an image, and " + given + " draws none";
  return "";
}

namespace {

// "For example: planish unwrap in.stl -o in_uv.obj (or -o - for stdout)"
std::string OutputExample(const std::string& command, const std::string& input) {
  if (input == "-") return "For example: planish " + command + " - -o out.obj (or -o - for stdout)";
  const std::size_t dot = std::min(input.rfind('.'), input.size());
  const std::string extension = input.substr(dot);
  return "For example: planish " + command + " " + input + " -o " + input.substr(0, dot) + "_uv" +
         (extension == ".stl" || extension.empty() ? ".obj" : extension) + " (or -o - for stdout)";
}

}  // namespace

std::string CheckDestination(const std::string& output, const std::string& command, const std::string& input) {
  return output.empty() ? "where should the result go? " + OutputExample(command, input) : "";
}

bool IsDirectory(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

}  // namespace planish::cli
