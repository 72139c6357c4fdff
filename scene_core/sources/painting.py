"""Pictures of a room's surfaces, painted by rule: the same for everybody, no file needed.

Sizes are metres, x to the right and y down from the top left corner of a surface; colours are
RGB in grey levels 0 to 255. Nothing here knows of cameras: a surface looks as it would under even,
white light.
"""

from __future__ import annotations

import numpy as np

from scene_core.sources.canvas import DARK_WOOD, INK, PAPER, Canvas, Colour


def window(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    """A window onto a bright day, with bars and a sill."""
    c.rectangle(x - 0.09, y - 0.09, w + 0.18, h + 0.18, (228, 226, 220))
    sky = np.linspace(252, 226, max(2, round(h * c.density)))[:, None, None]
    x0, y0 = round(x * c.density), round(y * c.density)
    rows, columns = len(sky), round(w * c.density)
    c.pixels[y0 : y0 + rows, x0 : x0 + columns] = sky * np.array([0.97, 0.99, 1.0])
    trees = np.linspace(0.0, 1.0, 24)
    tops = 0.68 + c.rng.uniform(-0.12, 0.1, len(trees))
    edge = [(x + w * float(a), y + h * float(b)) for a, b in zip(trees, tops, strict=True)]
    c.polygon([*edge, (x + w, y + h), (x, y + h)], (112, 128, 104))
    c.polygon([(x + 0.1 * w, y + h), (x + 0.1 * w, y + 0.5 * h), (x + 0.24 * w, y + 0.42 * h),
               (x + 0.38 * w, y + 0.5 * h), (x + 0.38 * w, y + h)], (168, 138, 120))  # fmt: skip
    for at in (1 / 3, 2 / 3):
        c.rectangle(x + w * at - 0.025, y, 0.05, h, (222, 220, 214))
    c.rectangle(x, y + 0.4 * h - 0.025, w, 0.05, (222, 220, 214))
    c.rectangle(x - 0.14, y + h + 0.06, w + 0.28, 0.07, (206, 202, 194))
    c.shine(x, y, w, h, 1.05)
    for side in (x - 0.34, x + w + 0.1):
        for fold in range(6):
            shade = 0.82 + 0.18 * (fold % 2)
            c.rectangle(
                side + 0.04 * fold, y - 0.16, 0.04, h + 0.42, (142 * shade, 104 * shade, 88 * shade)
            )


def door(c: Canvas, x: float, w: float, h: float) -> None:
    """A panelled door standing on the floor."""
    y = c.height - h
    c.rectangle(x - 0.07, y - 0.07, w + 0.14, h + 0.07, (206, 200, 190))
    c.rectangle(x, y, w, h, (134, 116, 98))
    for row, (top, tall) in enumerate(((0.12, 0.62), (0.86, 0.36), (1.34, 0.58))):
        for column in range(2):
            a = x + 0.1 + column * (w - 0.14) / 2
            width = (w - 0.26) / 2
            c.rectangle(a, y + top, width, tall, (98, 84, 70))
            c.rectangle(
                a + 0.02, y + top + 0.02, width - 0.02, tall - 0.02, (150 + 6 * row, 132, 112)
            )
    c.disc(x + w - 0.07, y + 0.53 * h, 0.026, (218, 196, 132))


def clock(c: Canvas, x: float, y: float, radius: float) -> None:
    """A clock at ten past ten."""
    c.disc(x, y, radius, INK)
    c.disc(x, y, 0.87 * radius, PAPER)
    for hour in range(12):
        a = np.pi * hour / 6
        u, v = float(np.sin(a)), -float(np.cos(a))
        c.line(
            [(x + 0.66 * radius * u, y + 0.66 * radius * v),
             (x + 0.8 * radius * u, y + 0.8 * radius * v)], 0.016, INK)  # fmt: skip
    for a, length in ((np.radians(305), 0.48), (np.radians(60), 0.66)):
        tip = (x + length * radius * float(np.sin(a)), y - length * radius * float(np.cos(a)))
        c.line([(x, y), tip], 0.02, INK)


def _diamond(c: Canvas, x: float, y: float, a: float, b: float, colour: Colour) -> None:
    c.polygon([(x, y - b), (x + a, y), (x, y + b), (x - a, y)], colour)


def wallpaper(c: Canvas, period: float) -> None:
    """The same motif over and over, each `period` metres: every patch has a twin next door."""
    texels = round(period * c.density)
    tile = Canvas(period, period, c.density, (188, 182, 168), 0)
    _diamond(tile, period / 2, period / 2, 0.25 * period, 0.36 * period, (84, 100, 104))
    _diamond(tile, period / 2, period / 2, 0.12 * period, 0.2 * period, (220, 206, 168))
    for u in (0.0, period):
        for v in (0.0, period):
            tile.disc(u, v, 0.13 * period, (122, 84, 70))
    rows, columns = c.pixels.shape[:2]
    c.pixels[:] = np.tile(
        tile.pixels[:texels, :texels], (rows // texels + 1, columns // texels + 1, 1)
    )[:rows, :columns]


def books(c: Canvas, shelves: int) -> None:
    """The front of a bookcase, full."""
    edge = 0.045
    c.rectangle(0, 0, c.width, c.height, DARK_WOOD)
    gap = (c.height - edge) / shelves
    for row in range(shelves):
        top = row * gap + edge
        c.rectangle(edge, top, c.width - 2 * edge, gap - edge, (38, 31, 27))
        x = edge + 0.01
        while x < c.width - edge - 0.03:
            w = float(c.rng.uniform(0.025, 0.075))
            tall = float(c.rng.uniform(0.62, 0.93)) * (gap - edge)
            if c.rng.random() < 0.1:
                x += 1.6 * w
                continue
            w = min(w, c.width - edge - x)
            y = top + gap - edge - tall
            colour = c.pick()
            shade = float(c.rng.uniform(0.75, 1.15))
            c.rectangle(x, y, w - 0.005, tall, tuple(shade * v for v in colour))  # type: ignore[arg-type]
            if w > 0.035:
                c.rectangle(x + 0.006, y + 0.14 * tall, w - 0.017, 0.1 * tall, PAPER)
                c.rectangle(x + 0.006, y + 0.76 * tall, w - 0.017, 0.05 * tall, (214, 178, 96))
            x += w


def planks(c: Canvas) -> None:
    """A floor of boards laid along x, no two of the same tone, and a rug."""
    wide = 0.14
    for row in range(int(np.ceil(c.height / wide))):
        x = -float(c.rng.uniform(0.0, 1.2))
        while x < c.width:
            long = float(c.rng.uniform(0.8, 1.5))
            tone = float(c.rng.uniform(0.78, 1.14))
            left = max(x, 0.0)
            c.rectangle(
                left, row * wide, x + long - left, wide, (138 * tone, 108 * tone, 80 * tone)
            )
            c.rectangle(x + long - 0.008, row * wide, 0.008, wide, (74, 58, 44))
            x += long
        c.rectangle(0, row * wide, c.width, 0.006, (84, 66, 50))


def rug(c: Canvas, x: float, y: float, w: float, h: float) -> None:
    """A woven rug: borders and a field of diamonds."""
    for inset, colour in ((0.0, (92, 50, 48)), (0.06, (196, 172, 132)), (0.1, (58, 70, 88)),
                          (0.2, (176, 142, 108)), (0.23, (112, 56, 50))):  # fmt: skip
        c.rectangle(x + inset, y + inset, w - 2 * inset, h - 2 * inset, colour)
    columns, rows = 7, 4
    du, dv = (w - 0.6) / columns, (h - 0.6) / rows
    for i in range(columns):
        for j in range(rows):
            u, v = x + 0.3 + (i + 0.5) * du, y + 0.3 + (j + 0.5) * dv
            _diamond(c, u, v, 0.46 * du, 0.46 * dv, c.pick())
            _diamond(c, u, v, 0.22 * du, 0.22 * dv, c.pick())


def crate(c: Canvas) -> None:
    """A side of a wooden crate."""
    n = 4
    for i in range(n):
        tone = float(c.rng.uniform(0.86, 1.1))
        c.rectangle(
            0, c.height * i / n, c.width, c.height / n - 0.008, (168 * tone, 136 * tone, 96 * tone)
        )
    e = 0.07
    brace = [(e, -2 * e), (2 * e, -e), (-e, 2 * e), (-2 * e, e)]
    c.polygon([(x % c.width, y % c.height) for x, y in brace], (124, 96, 66))
    for x, y, w, h in ((0, 0, c.width, e), (0, c.height - e, c.width, e), (0, 0, e, c.height),
                       (c.width - e, 0, e, c.height)):  # fmt: skip
        c.rectangle(x, y, w, h, (140, 108, 74))
    for u in (e / 2, c.width - e / 2):
        for v in (e / 2, c.height - e / 2):
            c.disc(u, v, 0.014, INK)


def drawers(c: Canvas, rows: int, columns: int) -> None:
    """The front of a chest of drawers."""
    c.rectangle(0, 0, c.width, c.height, (96, 84, 74))
    for i in range(columns):
        for j in range(rows):
            w, h = (c.width - 0.04) / columns, (c.height - 0.04) / rows
            x, y = 0.02 + i * w, 0.02 + j * h
            c.rectangle(x + 0.014, y + 0.014, w - 0.028, h - 0.028, (164, 150, 130))
            c.rectangle(x + w / 2 - 0.07, y + h / 2 - 0.014, 0.14, 0.028, (46, 42, 40))
