"""Step one frame by its phases, and print every decision with its reason.

Run it with `.venv/bin/python examples/04_phases.py [FRAME]`.
"""

from __future__ import annotations

import sys

import numpy as np

from scene_core.filter.records import PhaseRecord
from scene_core.models.base import words
from scene_core.session.presets import build
from scene_core.session.session import Session


def show(record: PhaseRecord) -> None:
    print(f"{record.phase} {record.mount or 'robots'} ({record.ms:.2f} ms)")
    if record.phase == "predict":
        robot = record.world.robots["robot"]
        sd = np.sqrt(np.diag(record.world.gauss.cov(robot.block)))
        print(f"  position sd {1e3 * sd[:3].max():.1f} mm at most")
    for p in record.predictions:
        for i, label in enumerate(p.labels):
            why = words(int(p.fault[i])) or f"score {p.score[i]:.3g}"
            verdict = "selected" if p.selected[i] else "not selected"
            print(f"  feature {label:>3} [{p.model}]: {verdict}, {why}")
    for match in record.matches:
        where = match.why if match.z is None else f"found at {np.round(match.z, 1)} px"
        print(f"  feature {match.label:>3}: {where}")
    for a in record.associations if record.phase == "associate" else ():
        print(f"  feature {a.label:>3}: {a.verdict}, {a.why}")
    if record.phase == "update":
        used = sum(a.verdict == "accepted" for a in record.associations)
        print(f"  {used} of {len(record.associations)} matches changed the state")
    for event in record.events:
        print(f"  {event.kind}: {event.text}")


def main(frame: int = 60) -> None:
    session = Session(build("cloister"))
    for _ in range(frame):
        session.advance()
    while True:
        show(session.step_phase())
        if not session.half_stepped:
            break
    print(f"frame {session.frame} is complete: the same bits as if it had not been stepped")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
