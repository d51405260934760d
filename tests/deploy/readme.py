#!/usr/bin/env python3
"""README.md against the programs: its commands run as they stand, and its picture is what its caption's command draws.

    readme.py SOURCE_DIR BIN_DIR
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import zlib

from ports import free_port

SOURCE, BIN = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
README = open(os.path.join(SOURCE, "README.md"), encoding="utf-8").read()


def fail(message):
    sys.exit(f"README.md: {message}")


def wait_for(port):
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    fail("the server does not listen")


def pixels(path):
    """Width, height and the bytes of a PNG of 8 bits a channel, rows one after the other."""
    data = open(path, "rb").read()
    width, height, depth, kind = *(int.from_bytes(data[i : i + 4], "big") for i in (16, 20)), data[24], data[25]
    channels = {2: 3, 6: 4}[kind]
    assert depth == 8, path
    at, packed = 8, b""
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        if data[at + 4 : at + 8] == b"IDAT":
            packed += data[at + 8 : at + 8 + length]
        at += length + 12
    raw, stride, rows = zlib.decompress(packed), width * channels, []
    before = bytearray(stride)
    for y in range(height):
        method, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1 : (y + 1) * (stride + 1)])
        for i in range(stride if method else 0):
            left = row[i - channels] if i >= channels else 0
            up, corner = before[i], before[i - channels] if i >= channels else 0
            if method == 4:
                guess = left + up - corner
                near = min((left, up, corner), key=lambda v: abs(guess - v))
            else:
                near = (left, up, (left + up) // 2)[method - 1]
            row[i] = (row[i] + near) & 255
        rows.append(bytes(row))
        before = row
    return width, height, b"".join(rows)


def check_commands(directory):
    blocks = re.findall(r"^```sh\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    commands = [line for block in blocks for line in block.splitlines()]
    if sum(line.startswith("planish ") for line in commands) < 4:
        fail("has fewer than four commands")
    port = free_port()
    servers = []
    try:
        for line in commands:
            line = line.replace("127.0.0.1:7741", f"127.0.0.1:{port}")
            if line.startswith("deploy/try.sh"):
                # What it does is what built the programs under test.
                if not os.access(os.path.join(SOURCE, "deploy/try.sh"), os.X_OK):
                    fail("deploy/try.sh cannot be run")
                continue
            if line.startswith("export PATH"):
                continue
            if line.endswith("&"):
                servers.append(subprocess.Popen(["sh", "-c", "exec " + line[:-1]], cwd=directory))
                wait_for(port)
                continue
            done = subprocess.run(["bash", "-c", line], cwd=directory, capture_output=True, text=True, timeout=120)
            if done.returncode != 0:
                fail(f"{line}\nended with {done.returncode}:\n{done.stdout}{done.stderr}")
    finally:
        for server in servers:
            server.send_signal(signal.SIGTERM)
            server.wait()
    for name in ("flat.obj", "flat.html", "done/spot_seam.obj"):
        if os.path.getsize(os.path.join(directory, name)) < 10000:
            fail(f"{name} was not written")


def check_picture(directory):
    caption = re.search(r"^\*`(planish unwrap [^`]*--picture=(\S+)[^`]*)` drew this", README, re.MULTILINE)
    if not caption:
        fail("the picture's caption names no command")
    subprocess.run(["bash", "-c", caption[1]], cwd=directory, check=True, capture_output=True, timeout=120)
    paths = os.path.join(directory, caption[2]), os.path.join(SOURCE, "client/images/spot.png")
    if open(paths[0], "rb").read() == open(paths[1], "rb").read():
        return
    drawn, shown = map(pixels, paths)
    if drawn[:2] != shown[:2]:
        fail(f"the picture has {shown[:2]} pixels, the command draws {drawn[:2]}")
    # Lines of a picture may fall a pixel beside on another machine; another map is another picture.
    other = sum(abs(a - b) > 32 for a, b in zip(drawn[2], shown[2])) / len(shown[2])
    if other > 0.002:
        fail(f"client/images/spot.png differs from what its command draws in {100 * other:.1f} % of its bytes; "
             "run that command and put its picture there")


def check_links():
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", README):
        if not os.path.exists(os.path.join(SOURCE, target)):
            fail(f"links to {target}, which is not there")


def main():
    os.environ["PATH"] = BIN + ":" + os.environ["PATH"]
    check_links()
    directory = tempfile.mkdtemp(prefix="planish-readme-")
    try:
        os.makedirs(os.path.join(directory, "tests"))
        os.symlink(os.path.join(SOURCE, "tests/data"), os.path.join(directory, "tests/data"))
        check_commands(directory)
        check_picture(directory)
    finally:
        shutil.rmtree(directory)
    print("ok")


main()
