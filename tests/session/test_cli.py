"""The command line: figures come out, and what does not fit is one sentence and an exit code."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from scene_core.params import ParamError
from scene_core.session import cli, presets, toml_io
from scene_core.session.cli import main
from scene_core.session.cli_source import SourceOptions, experiment_from, parsed
from scene_core.session.report import report, summary
from scene_core.session.session import Session

SD = "estimator.robots.nomad.motion.sd_v"


def run(capsys: pytest.CaptureFixture[str], *args: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    code = 0
    try:
        main(args)
    except SystemExit as e:
        code = int(e.code or 0)
    out = capsys.readouterr()
    return code, out.out, out.err


def test_figures_as_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, err = run(capsys, "run", "--preset", "line", "--frames", "12", "--json", "-")
    assert code == 0 and err == ""
    figures = json.loads(out)
    assert figures["preset"] == "line" and figures["frames"] == 12 and figures["seed"] == 0
    file = tmp_path / "f.json"
    code, out, _ = run(capsys, "run", "--preset", "line", "--frames", "12", "--json", str(file))
    assert code == 0 and out == ""
    again = json.loads(file.read_text())
    for timing in ("fps_mean", "ms_per_phase"):
        del figures[timing], again[timing]
    assert again == figures


def test_metrics_from_leaves_frames_out(capsys: pytest.CaptureFixture[str]) -> None:
    args = ("run", "--preset", "line", "--frames", "20", "--json", "-")
    whole = json.loads(run(capsys, *args)[1])
    part = json.loads(run(capsys, *args, "--metrics-from", "10")[1])
    assert part["frames"] == 20 and part["pos_end_m"] == whole["pos_end_m"]
    assert part["pos_rmse_m"] != whole["pos_rmse_m"]


def test_a_summary_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "run", "--preset", "line", "--frames", "5", "--seed", "4")
    assert code == 0 and err == ""
    assert out.startswith("line, seed 4\n") and "NEES" in out


def test_config_repeats_a_run(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    options = SourceOptions(preset="nomad", seed=7, set=(f"{SD}=0.2",))
    toml_io.save(file, experiment_from(options))
    common = ("--frames", "15", "--json", "-")
    edited = run(capsys, "run", "--preset", "nomad", "--seed", "7", "--set", f"{SD}=0.2", *common)
    again = run(capsys, "run", "--config", str(file), *common)
    assert json.loads(edited[1])["state"] == json.loads(again[1])["state"]
    plain = run(capsys, "run", "--preset", "nomad", *common)
    assert json.loads(plain[1])["state"] != json.loads(again[1])["state"]


def test_presets_are_listed_and_written(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "presets")
    listed = [row.split()[0] for row in out.splitlines() if row.startswith("  ")]
    assert code == 0 and listed == list(presets.PRESETS)
    code, out, _ = run(capsys, "presets", "nomad", "--toml")
    assert code == 0 and toml_io.loads(out) == presets.build("nomad")
    code, out, _ = run(capsys, "presets", "mrclam")
    assert code == 0 and "--mrclam DIR" in out


@pytest.mark.parametrize(
    ("args", "complaint"),
    [
        ("run --preset moon", "no preset 'moon': choose one of room"),
        ("run --preset images", "preset 'images' needs files: start with --images"),
        ("run --preset line --config x.toml", "--config and --preset both choose"),
        ("run --images x --mrclam y", "--images and --mrclam both choose"),
        ("run --mrpt x --mrclam y", "--mrclam and --mrpt both choose"),
        ("run --mrpt /nowhere.txt", "/nowhere.txt can not be opened"),
        ("run --planar-mono x --tagbox y", "--planar-mono and --tagbox both choose"),
        ("run --planar-mono /nowhere", "there is no folder /nowhere: give the folder with camera"),
        ("run --starry-night /nowhere.mat", "/nowhere.mat can not be opened"),
        ("run --tagbox /nowhere", "there is no folder /nowhere: give the folder with K.txt"),
        ("run --preset planar_mono", "needs files: start with --planar-mono DIR"),
        ("run --images /nowhere", "add --calib FILE"),
        ("run --calib x.yaml", "--calib goes with --images"),
        ("run --reference x.txt", "--reference goes with --images"),
        ("run --config /nowhere.toml", "the settings file /nowhere.toml can not be opened"),
        ("run --config /dev/zero", "the settings file /dev/zero is no file: give a settings file"),
        ("run --preset line --robot 3", "--robot goes with --mrclam"),
        ("run --mrclam /nowhere", "/nowhere"),
        ("run --mrclam /nowhere --robot 9", "robot_number = 9 is outside [1, 5]"),
        ("run --preset line --frames 0", "--frames 0: give a whole number of at least 1"),
        ("run --preset line --seed -3", "--seed -3: give a whole number from 0"),
        ("run --preset line --frames 9 --metrics-from 9", "--metrics-from 9: give a frame from 0"),
        ("run --preset line --frames 2 --json /nowhere/x.json", "there is no folder /nowhere"),
        ("run --preset nomad --set sd_v", "--set sd_v: write path=value"),
        (f"run --preset nomad --set {SD}=-1", "is outside [0, 2]"),
        (f"run --preset nomad --set {SD}=much", "'much': give a number"),
        (f"run --preset nomad --set {SD}=nan", "give a finite number"),
        (
            "run --preset nomad --set estimator.sd=1",
            "no parameter 'sd' in estimator: it has robots",
        ),
        (
            "run --preset nomad --set estimator.policies.selection.budget=1e9",
            "budget = 1e+09 is out",
        ),
        ("run --preset nomad --set name=x", "it starts with estimator. or source."),
        ("run --preset nomad --set estimator.robots=1", "not a parameter that can be edited"),
        ("presets moon", "no preset 'moon'"),
        ("presets --toml", "give its name"),
        ("presets mrclam --toml", "needs files"),
        ("presets mrpt --toml", "needs files: start with --mrpt DIR|FILE"),
    ],
)
def test_bad_input_is_one_sentence(
    capsys: pytest.CaptureFixture[str], args: str, complaint: str
) -> None:
    code, out, err = run(capsys, *args.split())
    assert code == 2 and out == ""
    assert err.startswith("scene: ") and err.count("\n") == 1 and complaint in err


@pytest.mark.parametrize("args", ["", "fly", "run --fps 3", "run --frames many", "run --align x"])
def test_unknown_flags_exit_with_2(capsys: pytest.CaptureFixture[str], args: str) -> None:
    code, out, err = run(capsys, *args.split())
    assert code == 2 and err and "Traceback" not in out + err


def test_bad_settings_file_names_file_and_table(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "bad.toml"
    text = toml_io.dumps(presets.build("line"))
    file.write_text(text.replace("budget = 10", "budget = -1"))
    code, _, err = run(capsys, "run", "--config", str(file))
    assert code == 2 and f"{file}, [estimator.policies.selection]" in err
    file.write_text(text.replace('robot = "robot"', 'robot = "cat"', 1))
    code, _, err = run(capsys, "run", "--config", str(file))
    assert code == 2 and str(file) in err and "no such robot" in err


def test_a_run_that_breaks_off_exits_with_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from scene_core.models.motion.velocity_1d import Velocity1D

    def broken(self: object, *args: object) -> None:
        raise ZeroDivisionError("v / 0")

    monkeypatch.setattr(Velocity1D, "f", broken)
    code, out, err = run(capsys, "run", "--preset", "line", "--frames", "9", "--json", "-")
    assert code == 1 and out == ""
    assert err.splitlines()[-1].startswith("scene: frame 1: ")


def test_flags_of_images_and_logs(recordings: Callable[[str], Path]) -> None:
    folder = recordings("mono_scenelib_testseq")
    calib = Path(__file__).parents[1] / "recordings" / "testseq.toml"
    options = SourceOptions(
        images=str(folder / "frames"),
        calib=str(calib),
        reference=str(folder / "reference_sfm.txt"),
        align="se3",
        seed=5,
        set=("estimator.policies.selection.budget=7",),
    )
    experiment = experiment_from(options)
    assert experiment.align == "se3" and len(experiment.estimator.known) == 4
    assert experiment.seed == 5 and experiment.source.seed == 5  # type: ignore[attr-defined]
    assert experiment.estimator.policies.selection.budget == 7
    log = experiment_from(SourceOptions(mrclam=str(recordings("mrclam_dataset6")), robot=3))
    assert log.align == "se2" and log.source.robot_number == 3  # type: ignore[attr-defined]
    for one in (experiment, log):
        assert toml_io.loads(toml_io.dumps(one)) == one


def test_a_closed_pipe_is_no_traceback() -> None:
    code = "from scene_core.session.cli import main; main(['presets', 'room', '--toml'])"
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        errors = process.stderr.read()
    assert errors == b"" and process.returncode == 1


@pytest.mark.parametrize(
    ("text", "old", "value"),
    [
        ("true", False, True),
        ("False", True, False),
        ("maybe", True, "maybe"),
        ("3", 1, 3),
        ("3.5", 1, 3.5),
        ("1e-3", 1.0, 1e-3),
        ("x", 1.0, "x"),
        ("-0.3, 0.1", (0.0, 0.0), [-0.3, 0.1]),
        ("trace", "determinant", "trace"),
    ],
)
def test_values_typed_on_the_command_line(text: str, old: object, value: object) -> None:
    assert parsed(text, old) == value


def test_every_flag_is_explained() -> None:
    from scene_core.params import field_docs

    for options in (cli.SourceOptions, cli.Run):
        docs = field_docs(options)
        assert all(name in docs for name in options.__dataclass_fields__ if name != "source")


def test_a_parameter_can_be_named_with_its_unit() -> None:
    path = SD.replace("sd_v", "unknown_sd_v")
    named = experiment_from(SourceOptions("nomad", set=(f"{path}=1.5",)))
    assert experiment_from(SourceOptions("nomad", set=(f"{path}_m_per_s=1.5",))) == named
    assert named != presets.build("nomad")


def test_wrong_matches_are_counted_only_where_somebody_knows() -> None:
    session = Session(presets.build("line"))
    session.advance()
    session.advance()
    figures, totals = report(session, 1.0), session.metrics.totals()
    assert totals["known"] > 0 and " wrong" in summary(figures, totals)
    assert " wrong" not in summary(figures, {**totals, "known": 0})


def test_edits_take_effect_together() -> None:
    """Each limit alone would be beyond the other one; what is refused is what was meant."""
    at = "estimator.mounts.scanner.sensor"
    limits = (f"{at}.reach_min=20", f"{at}.reach_max=30")
    sensor = experiment_from(SourceOptions("nomad", set=limits)).estimator.mounts["scanner"].sensor
    assert (sensor.reach_min, sensor.reach_max) == (20.0, 30.0)  # type: ignore[attr-defined]
    for wrong, words in (
        (f"{SD}=-1", rf"^--set {SD}=-1: .* outside"),
        (f"{at}.reach_max=10", r"^--set .*min=20 --set .*max=30 --set .*max=10: .* not below"),
    ):
        with pytest.raises(ParamError, match=words):
            experiment_from(SourceOptions("nomad", set=(*limits, wrong)))


def test_edits_apply_in_order() -> None:
    experiment = experiment_from(SourceOptions(preset="nomad", set=(f"{SD}=0.5", f"{SD} = 0.6")))
    assert experiment.estimator.robots["nomad"].motion.sd_v == 0.6  # type: ignore[attr-defined]
    with pytest.raises(ParamError):
        experiment_from(SourceOptions(preset="nomad", set=(f"{SD}=",)))
