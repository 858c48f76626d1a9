"""The demos are run as tests: each ends in an assertion against theory."""

import runpy
import sys
from pathlib import Path

import pytest
from support.reference import SHARED

from fenics_hytf.motion import recorded_names
from fenics_hytf.scene import Scene

DEMOS = Path(__file__).parents[2] / "demos"


@pytest.mark.parametrize("script", sorted(p.name for p in DEMOS.glob("demo_*.py")))
def test_script(script, tmp_path, monkeypatch):
    if script == "demo_column.py":
        require_records()
    monkeypatch.setattr(sys, "argv", [script, str(tmp_path)])
    runpy.run_path(str(DEMOS / script))
    assert (tmp_path / script).with_suffix(".png").stat().st_size > 10_000


def require_records():
    try:
        recorded_names()
    except ValueError:
        pytest.skip("the records extra is not installed")


def test_the_column_runs_on_any_at2_record():
    record = SHARED / "motions" / "NIS090.AT2"
    if not record.exists():
        pytest.skip("holds a recorded motion and is not in the repository")
    require_records()
    scene = Scene.load(DEMOS / "column.toml", motion_file=record)
    assert scene.motion[0].record.num_samples == 4096
