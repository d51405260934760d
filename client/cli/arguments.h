// Arguments that several commands share: structs, the flags that set their members, and checks. Arguments of a single
// command are declared beside that command (inspect_command.h, ...).
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/text.h"
#include "planish/client.h"
#include "planish/types.h"

namespace CLI {
class App;
}

namespace planish::cli {

// Each Add function adds flags to the command `app`. Parsing sets the variables that are passed by reference, which
// must outlive the parsing. `description` and `otherwise` are the part of the help text that depends on the command.

// ---- The server

// TLS and token as in ClientOptions.
struct ServerArguments {
  std::string address;  // empty: a private server
  bool tls = false;
  std::string tls_ca_file, tls_cert_file, tls_key_file, tls_server_name;
  std::string token_file;
  bool token_over_plaintext = false;
};

// Returns `options` with the TLS settings and the token of `server`. Without a token file the token is taken from
// PLANISH_TOKEN. There is no flag for the token itself, because every user of the machine sees the arguments of a
// command.
ClientOptions WithServer(ClientOptions options, const ServerArguments& server);
void AddServer(CLI::App& app, ServerArguments& server, const std::string& otherwise);

// ---- Jobs

void AddLabels(CLI::App& app, std::map<std::string, std::string>& labels, const std::string& description);
void AddTimeout(CLI::App& app, double& seconds, const std::string& description);
void AddScheduling(CLI::App& app, Scheduling& scheduling);

// ---- Terminal

enum class ProgressMode { kAuto, kBar, kPlain, kJson, kNone };
const char* ToString(ProgressMode mode);  // "auto", "bar", ...
const char* ToString(ColorMode mode);     // "auto", "always", "never"

struct TerminalArguments {
  bool quiet = false;
  ColorMode color = ColorMode::kAuto;
  // Only for commands that run a job.
  ProgressMode progress = ProgressMode::kAuto;
  bool verbose = false;  // not with `quiet`

  // `quiet` turns progress off unless the caller chose a mode.
  ProgressMode ShownProgress() const {
    return quiet && progress == ProgressMode::kAuto ? ProgressMode::kNone : progress;
  }
};

void AddJson(CLI::App& app, bool& json);
// AddTerminal() adds --quiet and --color, AddProgress() adds --progress and --verbose. AddTerminal() begins a group of
// the help, so only AddProgress() should come after it.
void AddTerminal(CLI::App& app, TerminalArguments& terminal);
void AddProgress(CLI::App& app, TerminalArguments& terminal);

// ---- Input files

// The arguments IN and MORE.
struct InputArguments {
  std::string first;
  std::vector<std::string> more;

  std::vector<std::string> All() const;
};

void AddTexcoord(CLI::App& app, int& texcoord);

// ---- Output files

// What happens to images of a model when the UV that they use are replaced (--textures).
enum class Textures { kTransfer, kKeep, kDrop };
const char* ToString(Textures textures);  // "transfer", ...

struct TextureArguments {
  Textures textures = Textures::kTransfer;
  std::int64_t memory_mb = 0;  // limit for one image; 0: half of the machine's memory
  bool allow_outside = false;  // read images outside the model's folder
  bool merge_materials = false;
  bool bake_colors = false;
};

struct OutputArguments {
  std::string path;             // a file, "-", or a directory
  std::optional<int> texcoord;  // the UV set that is written; without a value: the set that was read
  TextureArguments textures;
  std::string preview;  // a PNG or SVG of the UV layout; empty: none
};

void AddOutput(CLI::App& app, std::string& path, bool takes_batch);
void AddPreview(CLI::App& app, std::string& preview);
void AddOutputTexcoord(CLI::App& app, std::optional<int>& texcoord);
// AddTextures() adds --textures, --bake and the flags of AddImageFlags(): --merge-materials, --memory and
// --allow-outside.
void AddTextures(CLI::App& app, TextureArguments& textures);
void AddImageFlags(CLI::App& app, TextureArguments& textures);

// ---- The atlas

// Adds --weight. `pieces`: what the command packs, "charts" or "islands".
void AddWeights(CLI::App& app, std::map<std::string, double>& material_weights, const std::string& pieces);
// --texture-size and --tiles, for commands that check or show existing UV.
void AddTileSize(CLI::App& app, int& texture_size);
void AddTiles(CLI::App& app, int& tiles);

// ---- Checks. Each returns a message about a mistake, or an empty string

// Returns the first of `problems` that is not empty.
std::string FirstProblem(std::initializer_list<std::string> problems);

// Whether --texcoord fits the format of one input file.
std::string CheckTexcoord(int texcoord, const std::string& input);
std::string CheckStreams(const std::vector<std::string>& inputs);
std::string CheckPreview(const std::string& preview);
// Whether the mesh and JSON both want stdout.
std::string CheckStdout(const std::string& output, bool json);
// Whether --merge-materials and --bake can be combined with the value of --textures.
std::string CheckPainting(const TextureArguments& textures);
// Whether -o was given; the message has an example.
std::string CheckDestination(const std::string& output, const std::string& command, const std::string& input);

bool IsDirectory(const std::string& path);

}  // namespace planish::cli
