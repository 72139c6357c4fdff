"""A world from a file: what it says is there, and what it says wrongly is told in a sentence."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from scene_core import params
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D
from scene_core.params import ParamError
from scene_core.session.polymorphic import variants
from scene_core.sources.drivers import Driver
from scene_core.sources.simulated import Simulation
from scene_core.sources.world_file import WorldFile
from scene_core.sources.worlds import SimulatedWorld, landmarks, lines

GOOD = """
points = [[1, 2.5, 0.5], [3.0, 0.0, 1.0]]
ids = [7, 4]
segments = [[[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [0, 2, 1]]]
known = [4]
sd = 0.02
"""


def written(folder: Path, text: str) -> str:
    file = folder / "world.toml"
    file.write_text(text, encoding="utf-8")
    return str(file)


def test_a_file_is_the_world_it_describes(tmp_path: Path) -> None:
    world = WorldFile(written(tmp_path, GOOD))
    ids, points = landmarks(world)
    assert world.space is THREE_D and ids.tolist() == [7, 4]
    np.testing.assert_array_equal(points, [[1, 2.5, 0.5], [3, 0, 1]])
    line_ids, ends = lines(world)
    assert line_ids.tolist() == [8, 9] and ends.shape == (2, 2, 3)
    (known,) = world.known()
    assert known == (4, (3.0, 0.0, 1.0), 0.02)


@pytest.mark.parametrize(
    ("text", "space"),
    [
        ("points = [[1.0]]", ONE_D),
        ("points = [[1.0, 2.0]]", TWO_D),
        ("points = [[1,2,3]]", THREE_D),
    ],
)
def test_the_numbers_of_a_point_say_the_dimension(tmp_path: Path, text: str, space: object) -> None:
    world = WorldFile(written(tmp_path, text + "\nknown = true"))
    assert world.space is space and world.segments().shape == (0, 2, world.space.d)
    assert [k.id for k in world.known()] == [1]


def test_a_changed_file_is_another_world_once_its_path_is_given_again(tmp_path: Path) -> None:
    before = WorldFile(written(tmp_path, "points = [[1.0, 2.0]]"))
    assert landmarks(before)[1].tolist() == [[1.0, 2.0]]
    after = WorldFile(written(tmp_path, "points = [[3.0, 4.0]]"))
    assert landmarks(after)[1].tolist() == [[3.0, 4.0]]
    assert landmarks(before)[1].tolist() == [[1.0, 2.0]]


MANY = f"points = [{'[1.0, 2.0],' * 20001}]"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("points = [[1.0, 2.0", "is not valid TOML: .*points = "),
        ("", "the world is empty: give it a line like points = "),
        ("# nothing", "the world is empty"),
        ("points = []\nsegments = []", "the world is empty"),
        ("point = [[1.0]]", "there is no key 'point': a world has points, ids, segments"),
        ("points = 3", "points is 3: give a list of lists of numbers"),
        ("points = [1.0, 2.0]", r"points, row 1 is 1.0: give a list of 1, 2 or 3 numbers"),
        ("points = [[1, 2, 3, 4]]", "row 1 is .1, 2, 3, 4.: give a list of 1, 2 or 3 numbers"),
        ("points = [[]]", "row 1 is ..: give a list of 1, 2 or 3 numbers"),
        ("points = [[1, 2], [1, 2, 3]]", "points, row 2 is .1, 2, 3.: give 2 numbers in m, like"),
        ("points = [[1, nan]]", "points, row 1 has nan: give a finite number"),
        ("points = [[1, inf]]", "points, row 1 has inf: give a finite number"),
        ("points = [[1, 1e7]]", "points, row 1 has 10000000.0: give .* from -100000 to 100000 m"),
        ("points = [[1, 'a']]", "points, row 1 has 'a': give a finite number"),
        ("points = [[1, true]]", "points, row 1 has True: give a finite number"),
        ("points = [[1, 2], [3, 4]]\nids = [5, 5]", "ids: 5 occurs twice: give every point"),
        ("points = [[1, 2], [3, 4]]\nids = [5]", "ids: 1 for 2 points: give one for each"),
        ("points = [[1, 2]]\nids = [0]", "ids, number 1 is 0: give a whole number from 1"),
        ("points = [[1, 2]]\nids = [1.5]", "ids, number 1 is 1.5: give a whole number"),
        ("points = [[1, 2]]\nids = 4", "ids: 4 for 1 points"),
        ("segments = [[[1, 2, 3]]]", "row 1 is ..1, 2, 3..: give its two ends"),
        ("segments = [[[1, 2, 3], [1, 2, 3]]]", "row 1 has no length: give two different ends"),
        ("segments = [[[1, 2, 3], [1, 2]]]", "segments, row 1, end 2 is .1, 2.: give 3 numbers"),
        ("points = [[1, 2]]\nknown = 'yes'", "known is 'yes': give true, false or a list of ids"),
        ("points = [[1, 2]]\nknown = [3]", "known has the id 3, but no point has it"),
        ("points = [[1, 2]]\nknown = [1, 1]", "known has the id 1, but it is there twice"),
        ("points = [[1, 2]]\nknown = true\nsd = -1.0", "sd has -1.0: give a finite number from 0"),
        ("points = [[1, 2]]\nsd = nan", "sd has nan"),
        (f"points = {'[' * 5000}{']' * 5000}", "is not valid TOML: its lists are nested too"),
        (f"points = [[1{'0' * 5000}]]", "is not valid TOML: it has a number of thousands of"),
        (f"points = [[1{'0' * 400}]]", "points, row 1 has 10+\\.\\.\\.: give a finite number"),
        (MANY, "there are 20001 points: give at most 20000"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ParamError, match=words) as caught:
        WorldFile(path)
    assert str(caught.value).startswith(path) and "\n" not in str(caught.value)


def test_a_missing_file_a_folder_and_no_text_are_told(tmp_path: Path) -> None:
    with pytest.raises(ParamError, match="can not be opened: No such file"):
        WorldFile(str(tmp_path / "nowhere.toml"))
    with pytest.raises(ParamError, match="can not be opened: Is a directory"):
        WorldFile(str(tmp_path))
    (tmp_path / "image.png").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ParamError, match="is not a text file"):
        WorldFile(str(tmp_path / "image.png"))
    os.mkfifo(tmp_path / "pipe")
    for endless in ("/dev/zero", str(tmp_path / "pipe")):
        with pytest.raises(ParamError, match="is no file"):
            WorldFile(endless)
    for no_path in ("a\0b", "\ud800"):
        with pytest.raises(ParamError, match="is no path of a file"):
            WorldFile(no_path)
    with pytest.raises(ParamError, match="has no file: give the path"):
        Simulation(WorldFile(), {}, {}).start()


def test_a_bad_path_leaves_the_world_as_it_was(tmp_path: Path) -> None:
    simulation = Simulation(WorldFile(written(tmp_path, GOOD)), {}, {})
    with pytest.raises(ParamError, match="can not be opened"):
        params.replace(simulation, "world.path", "nowhere.toml")
    assert len(landmarks(simulation.world)[0]) == 2


def test_the_page_about_worlds_names_all_of_them_and_its_file_can_be_read(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "worlds.md").read_text(encoding="utf-8")
    for base in (SimulatedWorld, Driver):
        found = variants(base)
        assert found is not None
        assert [name for name in found[1] if f"| `{name}` |" not in page] == []
    (example,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    world = WorldFile(written(tmp_path, example))
    assert len(landmarks(world)[0]) == 2 and len(lines(world).ids) == 1 and len(world.known()) == 1
