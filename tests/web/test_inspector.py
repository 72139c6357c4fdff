"""Inspector, phase card and events: the filter's numbers, in well-formed markup."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from scene_core.filter.records import Event
from tests.web.traces import MOUNT, accepted, changed, cloister, judged, until
from web_panels.events import events_html
from web_panels.inspector import cut, inspector_html
from web_panels.inspector_maths import ROW_CHARACTERS, gate_bar, rows_of_columns
from web_panels.mathml import formula, matrix, numbers, signed, symbol
from web_panels.phase_card import card_html
from web_panels.style import PHASES

VOID = {"img", "br", "rect", "path", "circle", "ellipse", "input"}


class Balance(HTMLParser):
    """Fails on a tag that is not closed, or closed in the wrong order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open and self.open.pop() == tag, f"</{tag}> does not close anything"


def well_formed(markup: str) -> None:
    parser = Balance()
    parser.feed(markup)
    parser.close()
    assert parser.open == []


def text(markup: str) -> str:
    return re.sub(r"<[^>]*>", " ", markup)


def test_the_numbers_are_those_of_the_association():
    a = accepted(cloister())
    page = inspector_html(cloister(), a.label, own_choice=False)
    well_formed(page)
    assert a.d2 is not None and a.nu is not None
    assert f"d2 = {a.d2:.1f} &lt; {a.gate:.2f}" in page
    assert signed(f"({a.nu[0]:+.1f}, {a.nu[1]:+.1f}) px") in text(page)
    assert "<math>" in page


@pytest.mark.parametrize("scale", [1e-6, 0.0123, 0.123, 1.23, 123.4])
def test_the_equation_has_three_digits_at_most(scale):
    a = accepted(cloister())
    nu, S = scale * np.array([-1.0, 0.5]), scale**2 * np.array([[1.0, -0.2], [-0.2, 0.5]])
    page = inspector_html(judged(cloister(), a.label, nu=nu, S=S), a.label, own_choice=False)
    well_formed(page)
    maths = re.findall(r"<mtd>(.*?)</mtd>", page)
    assert maths
    for cell in maths:
        mantissa = text(cell).strip(" \N{MINUS SIGN}").partition("e")[0]
        assert len(mantissa.replace(".", "").lstrip("0")) <= 3 or scale > 100


def test_every_block_of_h_is_there_with_its_name():
    a = accepted(cloister())
    (p,) = (p for p in cloister().predictions(MOUNT) if a.label in p.row)
    page = text(inspector_html(cloister(), a.label, own_choice=False))
    for role, blocks in p.H.items():
        assert (f"feature:{a.label}" if role == "feature" else role) in page
        largest = np.abs(blocks[p.row[a.label]]).max()
        assert f"{largest:.1f}"[:4] in page or f"{largest:.2f}"[:4] in page


def test_the_state_of_the_feature_has_angles_in_degrees():
    trace = cloister()
    label, f = next(
        (k, f) for k, f in trace.world.features.items() if "pitch" in f.model.state_labels
    )
    page = text(inspector_html(trace, label, own_choice=False))
    pitch = np.degrees(trace.world.gauss.mean(f.block)[f.model.state_labels.index("pitch")])
    assert signed(f"{pitch:.4g}")[:5] in page


@pytest.mark.parametrize("verdict", ["accepted", "rejected", "no match", "not selected"])
def test_every_verdict_gives_a_page(verdict):
    a = accepted(cloister())
    fields = (
        {}
        if verdict in ("accepted", "rejected")
        else dict(z=None, nu=None, d2=None, gate=None, why="so")
    )
    page = inspector_html(judged(cloister(), a.label, verdict=verdict, **fields), a.label, True)
    well_formed(page)
    assert f">{verdict}</span>" in page
    assert ("d2 =" in page) is (verdict in ("accepted", "rejected"))


def test_an_empty_map_and_a_feature_that_is_gone():
    well_formed(inspector_html(cloister(), None, own_choice=True))
    gone = inspector_html(cloister(), 999, own_choice=False)
    well_formed(gone)
    assert "no feature 999" in gone


@pytest.mark.parametrize("d2", [0.0, 0.3, 5.0, 9.2, 9.3, 40.0, 1e6])
def test_the_bar_stays_in_its_picture(d2):
    bar = gate_bar(d2, 9.21, "#fff")
    well_formed(bar)
    assert all(0 <= float(w) <= 420 for w in re.findall(r'width="([\d.]+)"', bar))


def test_a_patch_at_the_border_keeps_its_size():
    pixels = np.arange(48, dtype=np.uint8).reshape(6, 8)
    assert cut(pixels, np.array([7.0, 5.0]), 5).shape == (5, 5)
    np.testing.assert_array_equal(cut(pixels, np.array([3.2, 2.4]), 3), pixels[1:4, 2:5])


@pytest.mark.parametrize("phase", list(PHASES))
def test_every_phase_has_its_card(phase):
    if phase not in [r.phase for r in cloister().records]:
        pytest.fail(f"the frame has no phase {phase}")
    card = card_html(until(cloister(), phase))
    well_formed(card)
    assert PHASES[phase][0] in card


def test_the_update_card_shows_what_the_update_did():
    trace = until(cloister(), "update")
    card = text(card_html(trace))
    used = sum(a.verdict == "accepted" for a in trace.associations())
    assert f"{used} matches" in card
    robot = next(iter(trace.world.robots.values()))
    before, after = (r.world.gauss.mean(robot.block)[0] for r in trace.records[-2:])
    assert f"{signed(f'{before:.3f}')} → {signed(f'{after:.3f}')}" in card


def test_an_update_without_matches_says_that_nothing_changed():
    label = accepted(cloister()).label
    none = tuple(
        replace(a, verdict="no match", d2=None, nu=None) for a in cloister().associations()
    )
    trace = changed(
        changed(cloister(), "update", associations=none), "associate", associations=none
    )
    assert label in [a.label for a in none]
    assert "stays as it was predicted" in card_html(until(trace, "update"))


def test_events_are_escaped_and_newest_first():
    events = (Event(8, "born", "<script>x</script>"), Event(7, "rejected", "5 rejected"))
    page = events_html(events)
    well_formed(page)
    assert "<script>" not in page and "&lt;script&gt;" in page
    assert page.index("script") < page.index("5 rejected")
    well_formed(events_html(()))


def test_formulas_are_well_formed_and_escaped():
    well_formed(formula(symbol("<b>", True, "v"), matrix([["-1.0", "2"]]), numbers(np.eye(2))))
    assert "&lt;b&gt;" in symbol("<b>")
    assert "−1.0" in matrix([["-1.0"]])


@pytest.mark.parametrize("widths", [[5], [7] * 6, [7, 9, 11, 4] * 4, [80, 80], []])
def test_the_columns_of_a_jacobian_fit_beside_each_other(widths):
    runs = rows_of_columns(widths)
    assert [w for run in runs for w in widths[run]] == widths
    for run in runs:
        assert sum(w + 2 for w in widths[run]) <= ROW_CHARACTERS or len(widths[run]) == 1
    sizes = [len(widths[run]) for run in runs]
    assert not sizes or sizes[0] - sizes[-1] < len(sizes) + 1
