#!/usr/bin/env python3
"""Parses each source of the product alone, with the commands of a compilation database.

    deploy/each-source.py compile_commands.json [PATTERN]

PATTERN (a regular expression) chooses sources by path; by default all but those that protoc makes. Sources that include
the same large headers, directly or through headers of ours, share a precompiled header of just these: parsing
them again for each source is most of the time. A source that includes no large header gets none of its names, so a
missing include is still an error. Needs a database of clang's commands. Ends with 1 if a source does not compile.
"""

import collections
import concurrent.futures
import functools
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile

# Headers of libraries that take long to parse. A name here that no source includes costs nothing.
LARGE = [
    "absl/status/statusor.h", "absl/strings/str_cat.h", "absl/time/time.h", "Eigen/Core", "Eigen/Geometry",
    "OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh", "nlohmann/json.hpp", "CLI/CLI.hpp", "google/protobuf/message.h",
    "grpcpp/server_context.h", "planish/v1/job.pb.h", "planish/v1/planish.pb.h", "planish/store/v1/store.pb.h",
    "planish/worker/v1/worker.pb.h"]
# A precompiled header takes about as long as two sources.
FEWEST_SOURCES = 4
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


class Source:
    """A source, the directory and the arguments of its compiler, and which of these are paths of headers."""

    def __init__(self, entry):
        self.path = entry["file"]
        self.directory = entry["directory"]
        arguments = shlex.split(entry["command"])
        self.compiler = arguments[0]
        self.flags, self.include_paths = [], []
        arguments = iter(arguments[1:])
        for argument in arguments:
            if argument in ("-o", "-c"):
                next(arguments)
            elif argument == "-isystem":
                self.include_paths.append(next(arguments))
            elif argument.startswith("-I"):
                self.include_paths.append(argument[2:])
            else:
                self.flags.append(argument)
        # Clang refuses a precompiled header that was made with others of these.
        self.group = (self.compiler, *(f for f in self.flags if not re.match("-[DW]", f)))

    def command(self, *more):
        """The command that parses it, with further arguments."""
        return [self.compiler, *self.flags, *self._paths(), *more, "-fsyntax-only", self.path]

    def header_command(self, header, output):
        """The command that precompiles `header` for this source's group."""
        flags = [f for f in self.flags if not f.startswith("-D")]
        return [self.compiler, *flags, *self._paths(), "-x", "c++-header", header, "-o", output]

    def _paths(self):
        return [word for path in self.include_paths for word in ("-isystem", path)]


@functools.cache
def included_names(path):
    with open(path, encoding="utf-8", errors="replace") as file:
        return INCLUDE.findall(file.read())


def large_headers(source):
    """The large headers that the source includes, directly or through files in its include paths."""
    found, seen, to_do = set(), {source.path}, [source.path]
    while to_do:
        path = to_do.pop()
        for name in included_names(path):
            if name in LARGE:
                found.add(name)
            for folder in [os.path.dirname(path), *source.include_paths]:
                if folder.startswith("/usr/"):
                    continue
                candidate = os.path.normpath(os.path.join(folder, name))
                if os.path.isfile(candidate):
                    if candidate not in seen:
                        seen.add(candidate)
                        to_do.append(candidate)
                    break
    return tuple(name for name in LARGE if name in found)


def run(command, directory):
    """Returns whether the command succeeds, and prints what it says."""
    result = subprocess.run(command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    sys.stdout.buffer.write(result.stdout)
    sys.stdout.flush()
    return result.returncode == 0


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        sources = [Source(entry) for entry in json.load(file)]
    if len(sys.argv) == 3:
        sources = [s for s in sources if re.search(sys.argv[2], s.path)]
    sources = [s for s in sources if "/proto/gen/" not in s.path]
    if not sources:
        sys.exit(f"each-source: {sys.argv[1]} names no such source")

    groups = collections.defaultdict(list)
    for source in sources:
        groups[source.group, large_headers(source)].append(source)
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as threads:

        def precompile(number, names, source):
            header = os.path.join(folder, f"{number}.h")
            with open(header, "w", encoding="utf-8") as file:
                file.writelines(f"#include <{name}>\n" for name in names)
            return ["-include-pch", header + ".pch"] if run(source.header_command(header, header + ".pch"),
                                                           source.directory) else None

        def parse(source, header):
            arguments = header.result() if header else []
            return arguments is not None and run(source.command(*arguments), source.directory)

        # Headers first: no source waits for a header that has not begun.
        work = []
        for number, ((_, names), members) in enumerate(sorted(groups.items(), key=lambda group: -len(group[1]))):
            shared = names and len(members) >= FEWEST_SOURCES
            work.append((threads.submit(precompile, number, names, members[0]) if shared else None, members))
        parsed = [threads.submit(parse, source, header) for header, members in work for source in members]
        failed = [p for p in parsed if not p.result()]
    if failed:
        sys.exit(f"each-source: {len(failed)} of {len(sources)} sources do not compile alone, see above")
    print(f"{len(sources)} sources compile alone")


main()
