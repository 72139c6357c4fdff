"""MathML for the formulas of the page: viser has no LaTeX, browsers draw this by themselves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from web_panels.style import escape

MINUS = "\N{MINUS SIGN}"


def signed(text: str) -> str:
    """A number with a typographic minus sign."""
    return text.replace("-", MINUS)


def symbol(name: str, bold: bool = False, sub: str = "") -> str:
    """An upright symbol, bold for vectors and matrices."""
    weight = "bold" if bold else "normal"
    mi = f'<mi mathvariant="normal" style="font-weight:{weight}">{escape(name)}</mi>'
    return f"<msub>{mi}<mi>{escape(sub)}</mi></msub>" if sub else mi


def op(text: str) -> str:
    """An operator or a relation."""
    return f"<mo>{escape(text)}</mo>"


def value(text: str, colour: str = "") -> str:
    """A number, already formatted."""
    style = f' style="color:{colour}"' if colour else ""
    return f"<mn{style}>{signed(text)}</mn>"


def power(base: str, exponent: str) -> str:
    """base to the exponent, both MathML."""
    return f"<msup>{base}<mrow>{exponent}</mrow></msup>"


def transposed(base: str) -> str:
    """base, transposed."""
    return power(base, "<mi>T</mi>")


def inverse(base: str) -> str:
    """base to the power of minus one."""
    return power(base, f"<mo>{MINUS}</mo><mn>1</mn>")


def matrix(cells: Sequence[Sequence[str]]) -> str:
    """Rows of formatted numbers in brackets; the style sheet draws them, as MathML's own do not
    stretch without a mathematical font."""
    rows = "".join(
        "<mtr>" + "".join(f"<mtd>{value(c)}</mtd>" for c in row) + "</mtr>" for row in cells
    )
    return f'<mtable class="mx">{rows}</mtable>'


def numbers(a: np.ndarray, spec: str = ".1f") -> str:
    """A vector (as a column) or a matrix of numbers."""
    a = np.asarray(a, dtype=np.float64)
    rows = a[:, None] if a.ndim == 1 else a
    return matrix([[format(v, spec) for v in row] for row in rows])


def formula(*parts: str) -> str:
    """The parts as one formula in the line."""
    return f"<math><mrow>{''.join(parts)}</mrow></math>"
