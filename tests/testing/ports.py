"""Ports for servers of tests."""

import random
import socket


def free_port():
    """That nobody has, and nobody gets who does not ask for that number: it is below those that the kernel gives out."""
    while True:
        port = random.randint(10_000, 30_000)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
