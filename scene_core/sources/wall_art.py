"""What hangs on the walls of a room: framed pictures, and the poster whose corners are known."""

from __future__ import annotations

import numpy as np

from scene_core.sources.canvas import DARK_WOOD, INK, PAPER, Canvas


def framed(c: Canvas, x: float, y: float, w: float, h: float, kind: str) -> None:
    """A picture of w x h metres with frame and mount; `kind` is one of `ART`."""
    c.rectangle(x - 0.045, y - 0.045, w + 0.09, h + 0.09, DARK_WOOD)
    c.rectangle(x - 0.02, y - 0.02, w + 0.04, h + 0.04, INK)
    c.rectangle(x, y, w, h, PAPER)
    m = 0.08 * min(w, h)
    ART[kind](c, x + m, y + m, w - 2 * m, h - 2 * m)


def _blocks(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    columns = np.cumsum(c.rng.uniform(0.5, 1.5, 5))
    for i, right in enumerate(columns):
        left = columns[i - 1] if i else 0.0
        rows = np.cumsum(c.rng.uniform(0.5, 1.5, 4))
        for j, low in enumerate(rows):
            top = rows[j - 1] if j else 0.0
            c.rectangle(
                x + w * left / columns[-1] + 0.008,
                y + h * top / rows[-1] + 0.008,
                w * (right - left) / columns[-1] - 0.016,
                h * (low - top) / rows[-1] - 0.016,
                c.pick(),
            )


def _hills(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    c.rectangle(x, y, w, h, (198, 206, 210))
    c.disc(x + 0.72 * w, y + 0.26 * h, 0.11 * min(w, h), (238, 214, 150))
    for layer, colour in enumerate(((138, 150, 158), (92, 112, 116), (52, 68, 70))):
        peaks = np.linspace(0.0, 1.0, 7 + 2 * layer)
        tops = 0.42 + 0.17 * layer + c.rng.uniform(-0.13, 0.13, len(peaks))
        ridge = [(x + w * float(p), y + h * float(t)) for p, t in zip(peaks, tops, strict=True)]
        c.polygon([*ridge, (x + w, y + h), (x, y + h)], colour)


def _rings(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    c.rectangle(x, y, w, h, (214, 200, 172))
    for _ in range(9):
        r = float(c.rng.uniform(0.07, 0.2)) * min(w, h)
        u, v = x + c.rng.uniform(r, w - r), y + c.rng.uniform(r, h - r)
        c.disc(u, v, r, c.pick())
        c.disc(u, v, 0.45 * r, c.pick())


def _triangles(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    n = max(2, round(w / 0.13))
    rows = max(2, round(h / 0.13))
    for i in range(n):
        for j in range(rows):
            a, b = x + w * i / n, y + h * j / rows
            dx, dy = w / n, h / rows
            corners = [(a, b), (a + dx, b), (a + dx, b + dy), (a, b + dy)]
            out = int(c.rng.integers(4))
            c.polygon(corners, c.pick())
            c.polygon([q for k, q in enumerate(corners) if k != out], c.pick())


def _letters(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    c.rectangle(x, y, w, h * 0.2, INK)
    at = y + 0.3 * h
    while at < y + h - 0.03:
        length = float(c.rng.uniform(0.5, 1.0)) * w
        c.rectangle(x, at, length, 0.018, (86, 88, 94))
        at += 0.043
    c.rectangle(x + 0.55 * w, y + 0.52 * h, 0.38 * w, 0.3 * h, c.pick())


def _chart(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    c.rectangle(x, y, w, h, (48, 62, 78))
    for i in range(1, 5):
        c.line([(x, y + h * i / 5), (x + w, y + h * i / 5)], 0.006, (98, 114, 130))
    for colour in ((226, 186, 92), (220, 220, 214)):
        t = np.linspace(0.0, 1.0, 14)
        v = 0.5 + 0.36 * np.cumsum(c.rng.uniform(-1, 1, 14)) / 4
        points = [
            (x + w * float(a), y + h * float(np.clip(b, 0.08, 0.92)))
            for a, b in zip(t, v, strict=True)
        ]
        c.line(points, 0.016, colour)
        for u, at in points:
            c.disc(u, at, 0.016, colour)


ART = {
    "blocks": _blocks,
    "hills": _hills,
    "rings": _rings,
    "triangles": _triangles,
    "letters": _letters,
    "chart": _chart,
}
"""What hangs on walls."""


def poster(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    """The poster whose four outer corners are known: a robot's path among uncertain landmarks."""
    c.rectangle(x, y, w, h, INK)
    c.rectangle(x + 0.06, y + 0.06, w - 0.12, h - 0.12, PAPER)
    c.rectangle(x + 0.06, y + 0.06, w - 0.12, 0.15, (54, 92, 124))
    c.text("SCENE", x + 0.1, y + 0.175, 0.075, PAPER)
    c.text("see inside the filter", x + 0.47, y + 0.17, 0.03, PAPER)
    t = np.linspace(0.0, 1.0, 30)
    path = [
        (x + 0.14 + (w - 0.3) * float(a), y + 0.62 * h + 0.13 * h * float(np.sin(6.5 * a)))
        for a in t
    ]
    c.line(path, 0.014, (60, 128, 92))
    c.disc(*path[-1], 0.028, (60, 128, 92))
    for _ in range(9):
        u = x + float(c.rng.uniform(0.16, w - 0.2))
        v = y + float(c.rng.uniform(0.3, h - 0.15))
        tilt = float(c.rng.uniform(0, 180))
        c.ellipse(u, v, 0.062, 0.034, tilt, 0.011, (186, 70, 52))
        c.disc(u, v, 0.012, INK)
