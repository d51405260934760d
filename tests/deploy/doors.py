#!/usr/bin/env python3
"""The lines that the pages about the shell and the farm begin with, run as they stand. (Those of the other pages: python_recipes,
blender_addon, javascript_package, interop_node and e2e's consumer.)

    doors.py SOURCE_DIR BIN_DIR
"""

import os
import pwd
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

from ports import free_port

SOURCE, BIN = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
POSTGRES = "/usr/lib/postgresql/15/bin"


def fail(message):
    sys.exit(message)


def first_block(page):
    found = re.match(r"# [^\n]*\n\n```sh\n(.*?)^```", open(os.path.join(SOURCE, page), encoding="utf-8").read(), re.DOTALL | re.MULTILINE)
    return found[1].splitlines() if found else fail(f"{page} does not begin with lines to run")


def run(page, directory, port=0, environment=None):
    servers = []
    try:
        for line in first_block(page):
            line = line.replace("127.0.0.1:7741", f"127.0.0.1:{port}").partition(" #")[0].rstrip()
            if line.endswith("&"):
                servers.append(subprocess.Popen(["bash", "-c", "exec " + line[:-1]], cwd=directory, env=environment))
                if "--listen" in line:
                    wait_for(port, page)
                continue
            done = subprocess.run(["bash", "-c", line], cwd=directory, env=environment, capture_output=True, text=True, timeout=120)
            if done.returncode != 0:
                fail(f"{page}: {line}\nended with {done.returncode}:\n{done.stdout}{done.stderr}")
    finally:
        for server in servers:
            server.send_signal(signal.SIGTERM)
            server.wait()


def wait_for(port, page):
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    fail(f"{page}: nothing listens")


def postgres(directory, port):
    """A PostgreSQL of its own; the process, and the environment of its clients."""
    user = pwd.getpwnam("postgres") if os.geteuid() == 0 else None
    mine = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []} if user else {}
    if user:
        os.chown(directory, user.pw_uid, user.pw_gid)
    data = os.path.join(directory, "data")
    subprocess.run([POSTGRES + "/initdb", "-D", data, "-U", "planish", "--auth=trust", "--no-sync", "--no-locale", "-E", "UTF8"],
                   check=True, stdout=subprocess.DEVNULL, cwd=directory, **mine)
    server = subprocess.Popen([POSTGRES + "/postgres", "-D", data, "-k", directory, "-h", "", "-p", str(port), "-F"],
                              cwd=directory, stderr=subprocess.DEVNULL, **mine)
    environment = {**os.environ, "PGHOST": directory, "PGPORT": str(port), "PGUSER": "planish"}
    for _ in range(300):
        if subprocess.run([POSTGRES + "/pg_isready", "-q"], env=environment).returncode == 0:
            return server, environment
        time.sleep(0.1)
    fail("PostgreSQL does not listen")


def main():
    os.environ["PATH"] = f"{BIN}:{POSTGRES}:{os.environ['PATH']}"
    directory, database = tempfile.mkdtemp(prefix="planish-doors-"), tempfile.mkdtemp(prefix="planish-pg-", dir="/tmp")
    server = None
    try:
        os.makedirs(os.path.join(directory, "tests/data"))
        shutil.copy(os.path.join(SOURCE, "tests/data/spot_seam.obj"), os.path.join(directory, "tests/data"))
        run("client/GUIDE.md", directory)
        server, environment = postgres(database, free_port())
        run("deploy/FARM.md", directory, free_port(), environment)
    finally:
        if server:
            server.send_signal(signal.SIGINT)
            server.wait()
        shutil.rmtree(directory)
        shutil.rmtree(database)
    print("ok")


main()
