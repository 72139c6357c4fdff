"""The command `scene`: `serve` starts the page, everything else is the library's command line."""

from __future__ import annotations

import errno
import logging
import secrets
import signal
import socket
import sys
import threading
import webbrowser
from dataclasses import dataclass, field
from typing import Annotated

import tyro

from scene_core.filter.ports import SourceError
from scene_core.models.library import Library, Watcher
from scene_core.params import ParamError
from scene_core.session import cli
from scene_core.session.cli_models import library_of
from scene_core.session.commands import ModelsSaved
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from web_panels import gate
from web_panels.view_loop import ViewLoop

COMMANDS = {
    "serve": "start the page and print its address; meant when only flags are given",
    "run": "run an experiment without the page, as fast as possible",
    "presets": "list the scenarios, or write one as a settings file",
    "models": "list the models, and which sensor goes with which landmark",
    "check": "say whether models of your own keep the promises of their kind",
}
BUILT_S = 10.0
"""The address is told once the page stands, or after this time."""
TOKEN_LENGTH = 8
"""A shorter token could be guessed."""


class ServeError(Exception):
    """The page can not be served: the message names the flag and what to do."""


@dataclass(frozen=True)
class Serve:
    """Start the page and print its address."""

    source: Annotated[cli.SourceOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=cli.SourceOptions
    )
    host: str = "127.0.0.1"
    """Address to listen on. 0.0.0.0 lets other machines in; they then need the token."""
    port: int = 8080
    """Port to listen on, 1 to 65535."""
    open: bool = False
    """Open the page in this machine's browser."""
    token: str = ""
    """Secret that browsers must bring; made up when other machines are let in and none is given."""


def check_address(host: str, port: int) -> None:
    """Raise ServeError, naming the flag that is wrong, unless a server can listen there.

    viser itself takes another port without a word, and never returns on an unusable host.
    """
    if not 1 <= port <= 65535:
        raise ServeError(f"--port {port}: give a port from 1 to 65535")
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError):
        raise ServeError(
            f"--host {host}: no such address; use 127.0.0.1 for this machine only, "
            "0.0.0.0 for all its networks"
        ) from None
    family, kind, _, _, address = found[0]
    with socket.socket(family, kind) as probe:
        if sys.platform != "win32":
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except PermissionError:
            raise ServeError(f"--port {port}: not allowed; choose one above 1023") from None
        except OSError as why:
            if why.errno == errno.EADDRINUSE:
                raise ServeError(
                    f"--port {port}: already in use on {host}; stop the other program or "
                    f"choose another, e.g. --port {port + 1 if port < 65535 else 8081}"
                ) from None
            raise ServeError(f"--host {host}: {why.strerror}; use 127.0.0.1") from None


def address(host: str, port: int, token: str | None) -> str:
    """What to type into a browser."""
    name = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(host, host)
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")


def checked_token(host: str, token: str) -> str | None:
    """The token in force: the one given, or a new one when other machines can reach `host`."""
    if token:
        if len(token) < TOKEN_LENGTH or not all(c.isalnum() or c in "-_.~" for c in token):
            raise ServeError(
                f"--token: give at least {TOKEN_LENGTH} letters, digits, or characters of -_.~"
            )
        if not token.isascii():
            raise ServeError("--token: give ASCII letters and digits only")
        return token
    return None if gate.is_loopback(host) else secrets.token_urlsafe(16)


def serve(options: Serve) -> None:
    """Run the page until interrupted."""
    host, port = options.host, options.port
    check_address(host, port)
    token = checked_token(host, options.token)
    library = library_of(options.source.models)
    session = Session(cli.experiment_from(options.source))
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    files = () if library is None else library.files
    with Runner(session, playing=True, files=files) as runner:
        server = gate.guarded_server(host, port, token)
        if server.get_port() != port:
            server.stop()
            raise ServeError(f"--port {port}: taken by another program just now; try again")
        view = ViewLoop(server, runner)
        view.start()
        watcher = None if library is None else watching(library, runner)
        # A browser that comes before the map would look at nothing, from a place of viser's own.
        view.built.wait(BUILT_S)
        url = address(host, port, token)
        print(f"Scene is at {url}  (Ctrl+C stops it)", flush=True)
        if options.open:
            webbrowser.open(url)
        while not stopped.wait(1.0):
            pass
        if watcher is not None:
            watcher.stop()
        view.stop()
        server.stop()


def watching(library: Library, runner: Runner) -> Watcher:
    """Tell the runner about every file of the user's that is saved."""

    def tell(said: tuple[str, ...]) -> None:
        runner.post(ModelsSaved(library.files, said))

    watcher = Watcher(library, tell)
    watcher.start()
    return watcher


def overview() -> str:
    """What `scene --help` says."""
    lines = "\n".join(f"  {name:<9}{does}" for name, does in COMMANDS.items())
    return (
        f"usage: scene [{' | '.join(COMMANDS)}] [OPTIONS]\n\n{lines}\n\n"
        "scene COMMAND --help lists the options of a command."
    )


def main(args: list[str] | None = None) -> None:
    """Run the command line; flags alone mean `serve`."""
    words = sys.argv[1:] if args is None else args
    command = words[0] if words and not words[0].startswith("-") else "serve"
    with cli.reader_may_leave():
        if words[:1] in (["-h"], ["--help"]):
            print(overview())
        elif command not in COMMANDS:
            *most, last = COMMANDS
            known = f"{', '.join(most)} or {last}"
            print(f"scene: no command '{command}': give {known}", file=sys.stderr)
            raise SystemExit(2)
        elif command == "serve":
            _serve_command(words[1:] if words[:1] == ["serve"] else words)
        else:
            cli.main(words)


def _serve_command(words: list[str]) -> None:
    logging.basicConfig(format="%(levelname)s: %(message)s")
    # A client that sends garbage loses its connection; that is nobody's traceback.
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    options = tyro.cli(Serve, args=words, prog="scene serve", description=Serve.__doc__)
    try:
        serve(options)
    except (ServeError, ParamError, SourceError) as why:
        print(f"scene: {why}", file=sys.stderr)
        raise SystemExit(2) from None
