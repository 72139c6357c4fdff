"""The command `scene` above its commands: what it lists, what it refuses, who it leaves alone."""

from __future__ import annotations

import subprocess
import sys

import pytest

from web_panels.main import COMMANDS, main


def leave(*args: str) -> int:
    """Exit code of a command that ends by itself."""
    with pytest.raises(SystemExit) as left:
        main(list(args))
    return int(left.value.code or 0)


@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_lists_every_command_in_a_line(flag: str, capsys: pytest.CaptureFixture[str]) -> None:
    main([flag])
    lines = capsys.readouterr().out.splitlines()
    for name in COMMANDS:
        assert sum(line.split()[:1] == [name] for line in lines) == 1


@pytest.mark.parametrize("args", [*((name,) for name in COMMANDS), ("--port", "80")])
def test_every_command_has_its_own_help(
    args: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert leave(*args, "--help") == 0
    command = args[0] if args[0] in COMMANDS else "serve"
    assert f"usage: scene {command} " in capsys.readouterr().out


def test_an_unknown_command_is_answered_with_all_there_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert leave("bogus") == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert all(name in complaint for name in ("bogus", *COMMANDS))


def test_help_whose_reader_has_gone_is_no_traceback() -> None:
    call = "from web_panels.main import main; main(['--help'])"
    with subprocess.Popen(
        [sys.executable, "-c", f"input(); {call}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin and process.stdout and process.stderr
        process.stdout.close()
        process.stdin.write("\n")
        process.stdin.close()
        assert process.stderr.read() == ""
