"""What the documentation says is so: links lead somewhere, names and keys are those of the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from scene_core.models.registry import KINDS, models
from scene_core.session.presets import PRESETS, build, loadable
from scene_core.session.report import report
from scene_core.session.session import Session
from scene_core.sources.calibration import RIGHT_DOWN, load_calibration

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
README = PAGES[0].read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8"))
    local = [t for t in targets if not t.startswith("http")]
    assert [t for t in local if not (page.parent / t).exists()] == []


def test_the_camera_of_the_readme_can_be_read(tmp_path: Path) -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    file = tmp_path / "camera.toml"
    file.write_text(example, encoding="utf-8")
    calibration = load_calibration(file)
    assert calibration.sensor.name == "pinhole" and calibration.pose == RIGHT_DOWN
    assert calibration.settings == {
        "robots.camera.motion.sd_accel": 1.0,
        "policies.selection.budget": 16,
    }


def test_the_readme_names_every_preset_and_key() -> None:
    assert [name for name in PRESETS if f"| `{name}` |" not in README] == []
    session = Session(build("line"))
    session.advance()
    assert [key for key in report(session, 1.0) if f"`{key}`" not in README] == []


def test_the_statistics_have_a_row_for_every_simulated_preset() -> None:
    page = (ROOT / "docs" / "consistency.md").read_text(encoding="utf-8")
    rows = set(re.findall(r"^\| `(\w+)` \| \w+ \|", page, re.MULTILINE))
    assert rows == set(loadable())


def test_the_page_about_ones_own_models_quotes_every_line_of_the_examples() -> None:
    page = (ROOT / "docs" / "own_model.md").read_text(encoding="utf-8")
    quotes = "".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    quoted = [line for line in quotes.splitlines() if line]
    for name in ("my_motion", "my_sensor", "my_landmark"):
        text = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
        code = [line for line in text.split('"""', 2)[2].splitlines() if line]
        assert len(text.splitlines()) < 40 and len(code) > 20
        assert quoted[: len(code)] == code, name
        quoted = quoted[len(code) :]
    assert quoted == []


def test_the_table_of_models_is_complete() -> None:
    text = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
    rows = {m[1]: m[2] for m in re.finditer(r"^\| `([^`]+)` \|(.*)$", text, re.MULTILINE)}
    there = {name: model for kind in KINDS for name, model in models(kind).items()}
    assert rows.keys() == there.keys()
    for name, model in there.items():
        labels = next(
            getattr(model(), a) for a in ("state_labels", "needs", "labels") if hasattr(model, a)
        )
        assert rows[name].strip().startswith(", ".join(labels)), name
