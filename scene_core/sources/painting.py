"""Pictures of a room's surfaces, painted by rule: the same for everybody, no file needed.

Sizes are metres, x to the right and y down from the top left corner of a surface; colours are
RGB in grey levels 0 to 255. Nothing here knows of cameras: a surface looks as it would under even,
white light.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

Colour = tuple[float, float, float]

INK: Colour = (34, 36, 42)
PAPER: Colour = (236, 233, 224)
WOOD: Colour = (122, 92, 66)
DARK_WOOD: Colour = (72, 54, 42)
WALL: Colour = (176, 172, 164)
ACCENTS: tuple[Colour, ...] = (
    (176, 78, 58),
    (212, 162, 74),
    (62, 104, 138),
    (70, 128, 104),
    (104, 74, 110),
    (222, 206, 176),
    (40, 58, 82),
)

_SHIFT = 4
"""Fractional bits of the polygon coordinates given to OpenCV."""


class Canvas:
    """A surface of width x height metres that is being painted."""

    def __init__(self, width: float, height: float, density: float, colour: Colour, seed: int):
        self.width, self.height, self.density = width, height, density
        self.rng = np.random.default_rng(seed)
        rows, columns = round(height * density), round(width * density)
        self.pixels = np.empty((rows, columns, 3), np.float32)
        self.pixels[:] = colour
        self.glow = np.zeros((rows, columns), np.float32)
        """Light a texel gives off itself, as a factor of its colour."""

    def shine(self, x: float, y: float, w: float, h: float, strength: float) -> None:
        """Let what is painted in a rectangle give off light."""
        x0, y0, x1, y1 = (round(v * self.density) for v in (x, y, x + w, y + h))
        self.glow[y0:y1, x0:x1] = strength

    def mottle(self, amount: float, scale: float) -> None:
        """Uneven paint: smooth noise of `amount` grey levels in patches of about `scale` metres."""
        rows, columns = self.pixels.shape[:2]
        for octave in range(3):
            size = scale / 2**octave
            coarse = self.rng.standard_normal(
                (max(2, round(self.height / size)) + 1, max(2, round(self.width / size)) + 1)
            ).astype(np.float32)
            wide = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
            self.pixels += (amount * 0.6**octave * wide)[..., None]

    def polygon(self, corners: Sequence[tuple[float, float]], colour: Colour) -> None:
        """A filled polygon with smooth edges."""
        at = (np.array(corners) * self.density - 0.5) * 2**_SHIFT
        cv2.fillPoly(self.pixels, [np.rint(at).astype(np.int32)], colour, cv2.LINE_8, _SHIFT)

    def rectangle(self, x: float, y: float, w: float, h: float, colour: Colour) -> None:
        """A filled rectangle; edges fall on whole texels."""
        x0, y0, x1, y1 = (round(v * self.density) for v in (x, y, x + w, y + h))
        self.pixels[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = colour

    def disc(self, x: float, y: float, radius: float, colour: Colour, line: float = 0.0) -> None:
        """A filled disc, or a ring of the given line width."""
        centre = tuple(int(v) for v in np.rint((np.array([x, y]) * self.density - 0.5) * 2**_SHIFT))
        size = round(radius * self.density * 2**_SHIFT)
        width = max(1, round(line * self.density)) if line else -1
        cv2.circle(self.pixels, centre, size, colour, width, cv2.LINE_8, _SHIFT)

    def line(self, points: Sequence[tuple[float, float]], width: float, colour: Colour) -> None:
        """A line through points."""
        at = (np.array(points) * self.density - 0.5) * 2**_SHIFT
        thick = max(1, round(width * self.density))
        cv2.polylines(
            self.pixels, [np.rint(at).astype(np.int32)], False, colour, thick, cv2.LINE_8, _SHIFT
        )

    def ellipse(
        self, x: float, y: float, a: float, b: float, degrees: float, width: float, colour: Colour
    ) -> None:
        """The outline of an ellipse with half axes a and b."""
        t = np.linspace(0.0, 2.0 * np.pi, 49)
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        ring = [
            (x + a * c * np.cos(v) - b * s * np.sin(v), y + a * s * np.cos(v) + b * c * np.sin(v))
            for v in t
        ]
        self.line(ring, width, colour)

    def text(self, words: str, x: float, y: float, height: float, colour: Colour) -> None:
        """Words whose capitals are `height` tall, standing on the base line y."""
        scale = height * self.density / 21.0
        at = (round(x * self.density), round(y * self.density))
        mask = np.zeros(self.pixels.shape[:2], np.uint8)
        thick = max(1, round(scale * 2.4))
        cv2.putText(mask, words, at, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, thick, cv2.LINE_AA)
        cover = mask[..., None] / np.float32(255)
        self.pixels += cover * (np.array(colour, np.float32) - self.pixels)

    def pick(self) -> Colour:
        """One of the accent colours."""
        return ACCENTS[int(self.rng.integers(len(ACCENTS)))]


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
