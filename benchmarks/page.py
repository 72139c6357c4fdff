"""The page under a raw client: frames a second, delay of an edit, cost of the map, memory.

The client is a process of its own that speaks viser's protocol, so that only the server's work is
counted in the server.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.figures import spread, table
from scene_core.geometry.ellipses import ellipsoids as axes
from scene_core.geometry.ellipses import sigma
from scene_core.session import presets
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.web.raw_client import RawClient, raw_client
from web_panels import gate
from web_panels.clouds import Cloud
from web_panels.instances import Instances
from web_panels.view_loop import ViewLoop

EDITED = "Select, max"
"""The slider that is edited: an integer whose value the page writes into its card of changes."""


def client(port: int, seconds: float, edits: int) -> None:
    """Be a browser: read everything for a while, edit now and then, print what was seen."""
    with raw_client(SimpleNamespace(get_port=lambda: port)) as me:  # type: ignore[arg-type]
        uuid = me.input(EDITED)["uuid"]
        end = time.monotonic() + 3.0
        while time.monotonic() < end:
            me.receive(0.05)
        messages, started = 0, time.monotonic()
        delays: list[float] = []
        rng = np.random.default_rng(0)
        while time.monotonic() - started < seconds:
            until = time.monotonic() + seconds / max(edits, 1) * rng.uniform(0.6, 1.0)
            until = min(until, started + seconds)
            while time.monotonic() < until:
                messages += len(me.receive(0.02))
                me.seen.clear()
            if edits:
                delays.append(1e3 * edited(me, uuid, 13 + len(delays) % 20))
        print(json.dumps({"messages": messages, "delays": delays}))


def edited(me: RawClient, uuid: str, value: int) -> float:
    """Seconds from sending an edit to the message that shows it in force."""
    sent = time.monotonic()
    me.set(uuid, value)
    while time.monotonic() - sent < 5.0:
        for message in me.receive(0.005):
            content = (message.get("updates") or {}).get("content", "")
            if isinstance(content, str) and EDITED in content and f"<b>{value}</b>" in content:
                return time.monotonic() - sent
    raise TimeoutError(f"the edit to {value} was not sent back within 5 s")


def rss_mb() -> float:
    """Resident memory of this process."""
    with open("/proc/self/status") as status:
        line = next(text for text in status if text.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def play(port: int, seconds: float, edits: int) -> dict[str, Any]:
    """Serve `room` to a raw client and watch the estimator's pace."""
    with Runner(Session(presets.build("room")), playing=True) as runner:
        server = gate.guarded_server("127.0.0.1", port, None)
        view = ViewLoop(server, runner)
        view.start()
        view.built.wait(30.0)
        command = [sys.executable, "-m", "benchmarks.page", "--client"]
        command += ["--port", str(port), "--seconds", str(seconds), "--edits", str(edits)]
        other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        time.sleep(4.0)
        memory: list[float] = []
        first, t0 = frame(runner), time.monotonic()
        while other.poll() is None:
            memory.append(rss_mb())
            time.sleep(1.0)
        rate = (frame(runner) - first) / (time.monotonic() - t0)
        out = json.loads(other.stdout.read() if other.stdout else "{}")
        view.stop()
        server.stop()
    return out | {"fps": rate, "memory": memory}


def frame(runner: Runner) -> int:
    trace = runner.latest.trace
    return trace.frame.index if trace else 0


def ellipsoids(port: int, count: int = 1000, updates: int = 100) -> list[float]:
    """CPU milliseconds of the whole process for an update of `count` ellipsoids, from their
    covariances to the wire, with one client attached."""
    server = gate.guarded_server("127.0.0.1", port, None)
    layer = Instances(server, nobody_clicks)
    command = [sys.executable, "-m", "benchmarks.page", "--listen", "--port", str(port)]
    other = subprocess.Popen(command)
    while not server.get_clients():
        time.sleep(0.05)
    rng = np.random.default_rng(0)
    A = 0.05 * rng.standard_normal((count, 3, 3))
    P = A @ A.transpose(0, 2, 1) + 1e-4 * np.eye(3)
    mean, labels = rng.uniform(-5, 5, (count, 3)), tuple(range(1, count + 1))
    rgb = np.tile(np.array([239, 71, 60], dtype=np.uint8), (count, 1))
    out = []
    for i in range(updates):
        t0 = time.process_time()
        sd, wxyz = axes(P * (1 + 0.001 * i))
        scales = sigma(3, 0.95) * sd
        ends = np.full((count, 2, 3), np.nan)
        cloud = Cloud(labels, mean + 0.001 * i, scales, wxyz, ends)
        with server.atomic():
            layer.render(cloud, rgb)
        time.sleep(1 / 30)
        out.append(1e3 * (time.process_time() - t0))
    other.terminate()
    server.stop()
    return out[10:]


def nobody_clicks(_: object) -> None: ...


def listen(port: int) -> None:
    with raw_client(SimpleNamespace(get_port=lambda: port)) as me:  # type: ignore[arg-type]
        while True:
            me.receive(1.0)
            me.seen.clear()


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8971)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--edits", type=int, default=40)
    parser.add_argument("--soak", type=float, default=0.0, metavar="MINUTES")
    parser.add_argument("--client", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--listen", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.client:
        return client(options.port, options.seconds, options.edits)
    if options.listen:
        return listen(options.port)
    sys.setswitchinterval(1e-3)
    seen = play(options.port, options.seconds, options.edits)
    delays = np.array(seen["delays"])
    rows = [
        ("estimator frames a second at 30 Hz", f"{seen['fps']:.1f}"),
        ("edit to its effect, message to message", spread(delays)),
        ("the same, 95 %", f"{np.percentile(delays, 95):.0f} ms"),
    ]
    gc.collect()
    rows.append(("1,000 ellipsoids, server CPU", spread(ellipsoids(options.port + 1))))
    if options.soak:
        memory = np.array(play(options.port + 2, 60 * options.soak, 0)["memory"])
        thirds = [part.mean() for part in np.array_split(memory, 6)]
        rows.append(
            (f"memory over {options.soak:g} min, MB", ", ".join(f"{m:.0f}" for m in thirds))
        )
    table("page: room, one raw client", rows)
    print(f"  threads left: {threading.active_count()}")


if __name__ == "__main__":
    main()
