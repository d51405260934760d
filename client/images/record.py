#!/usr/bin/env python3
"""Records what a command shows on a terminal, as an animated SVG that browsers and GitHub play without a script.

    client/images/record.py OUT.svg [--columns N] [--rows N] [--interval SECONDS] -- COMMAND...

The command runs in a detached tmux, whose screen is read ten times a second, or every --interval; frames that are like the
one before are left out. Needs tmux.
"""

import argparse
import html
import os
import re
import shlex
import subprocess
import tempfile
import time

COLORS = {31: "#ff7b72", 32: "#7ee787", 33: "#e3b341", 36: "#76e3ea"}
TEXT, DIM, BACKGROUND = "#e6edf3", "#6e7681", "#0d1117"
CELL_WIDTH, CELL_HEIGHT, MARGIN = 8.4, 18, 14
PAUSE = 4.0  # seconds that the last frame stays


class Tmux:
    """A tmux server of its own with one pane, which stays after the command in it has ended."""

    def __init__(self, columns, rows, command):
        self.directory = tempfile.TemporaryDirectory()
        self.done = os.path.join(self.directory.name, "done")
        script = f"{shlex.join(command)}; touch {shlex.quote(self.done)}; exec sleep 60"
        self.run("new-session", "-d", "-x", str(columns), "-y", str(rows), "sh", "-c", script)

    def run(self, *arguments):
        socket = os.path.join(self.directory.name, "socket")
        return subprocess.run(
            ["tmux", "-u", "-f", "/dev/null", "-S", socket, *arguments], check=True, capture_output=True, text=True
        ).stdout

    def screen(self):
        return self.run("capture-pane", "-e", "-p").rstrip("\n")

    def ended(self):
        return os.path.exists(self.done)

    def close(self):
        self.run("kill-server")
        self.directory.cleanup()


def record(columns, rows, interval, command):
    """The frames, as (second at which it is first seen, text with colour codes), and when the command ended."""
    tmux = Tmux(columns, rows, command)
    frames, start = [], time.monotonic()
    while True:
        ended = tmux.ended()
        screen = tmux.screen()
        now = time.monotonic() - start
        if not frames or frames[-1][1] != screen:
            frames.append((now, screen))
        if ended:
            break
        time.sleep(interval)
    tmux.close()
    return frames, now


def spans(line):
    """(column, text, colour, bold) of the parts of a line."""
    color, bold, column = TEXT, False, 0
    for codes, text in re.findall(r"\x1b\[([0-9;]*)m|([^\x1b]+)", line):
        if text:
            yield column, text, color, bold
            column += len(text)
            continue
        for code in [int(c) for c in codes.split(";") if c] or [0]:
            if code == 0:
                color, bold = TEXT, False
            elif code == 1:
                bold = True
            elif code == 2:
                color = DIM
            elif code == 39:
                color = TEXT
            elif code in COLORS:
                color = COLORS[code]


def draw(frames, seconds, columns, rows, prompt):
    total = seconds + PAUSE
    width, height = columns * CELL_WIDTH + 2 * MARGIN, (rows + 2) * CELL_HEIGHT + 2 * MARGIN
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'font-family="ui-monospace, DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="14">',
        f"<title>{html.escape(prompt)}</title>",
        f"<style>text {{ white-space: pre; fill: {TEXT} }} g {{ visibility: hidden; "
        f"animation: {total:.2f}s step-end infinite }}",
    ]
    for i, (begin, _) in enumerate(frames):
        first = 100 * begin / total
        last = 100 * frames[i + 1][0] / total if i + 1 < len(frames) else 100
        before = "0% { visibility: hidden } " if first > 0 else ""
        after = f"{last:.2f}% {{ visibility: hidden }} " if last < 100 else ""
        out.append(f"@keyframes f{i} {{ {before}{first:.2f}% {{ visibility: visible }} {after}}}")
    # Whoever wants no motion sees the end.
    out.append(
        f"@media (prefers-reduced-motion: reduce) {{ g {{ animation: none }} "
        f"#f{len(frames) - 1} {{ visibility: visible }} }}"
    )
    out += [
        "</style>",
        f'<rect width="100%" height="100%" rx="8" fill="{BACKGROUND}"/>',
        f'<text x="{MARGIN}" y="{MARGIN + CELL_HEIGHT:.0f}">$ {html.escape(prompt)}</text>',
    ]
    for i, (_, screen) in enumerate(frames):
        out.append(f'<g id="f{i}" style="animation-name: f{i}">')
        for row, line in enumerate(screen.split("\n")):
            y = MARGIN + (row + 2.2) * CELL_HEIGHT
            parts = []
            for column, text, color, bold in spans(line):
                if not text.strip():
                    continue
                weight = ' font-weight="bold"' if bold else ""
                lead = len(text) - len(text.lstrip())
                parts.append(
                    f'<tspan x="{MARGIN + (column + lead) * CELL_WIDTH:.1f}" fill="{color}"{weight} '
                    f'textLength="{len(text.strip()) * CELL_WIDTH:.1f}">{html.escape(text.strip())}</tspan>'
                )
            if parts:
                out.append(f'<text y="{y:.1f}">{"".join(parts)}</text>')
        out.append("</g>")
    out.append("</svg>")
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--columns", type=int, default=100)
    parser.add_argument("--rows", type=int, default=12)
    parser.add_argument("--interval", type=float, default=0.1, help="seconds between two looks")
    parser.add_argument("command", nargs="+")
    arguments = parser.parse_args()
    os.environ["TERM"] = "screen-256color"
    frames, seconds = record(arguments.columns, arguments.rows, arguments.interval, arguments.command)
    prompt = " ".join(arguments.command)
    used = max(len(screen.split("\n")) for _, screen in frames)
    with open(arguments.out, "w", encoding="utf-8") as file:
        file.write(draw(frames, seconds, arguments.columns, used, prompt))


if __name__ == "__main__":
    main()
